//! The scratch file of one matrix.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::matrix::choice::Scratch;
use crate::matrix::error::DiskError;
use crate::matrix::kernel::scalar::Scalar;
use crate::matrix::kernel::sizes::SIDE;
use crate::matrix::square::{Form, Square};

/// Bytes that are written or read at once: enough to hide the call, and few enough to stay in the second-level cache.
const STRIP_BYTE: u64 = 1 << 20;

/// Where a tile that could not be written is not found.
const NOWHERE: u64 = u64::MAX >> 1;

/// Square tiles in rows: all of them, those on and above the diagonal, or a part of either.
#[derive(Debug)]
pub(in crate::matrix) struct TileFile<T> {
    n: usize,
    file: Arc<File>,
    directory: PathBuf,
    waiting_byte: u64,
    rows: Vec<TileRow>,
    n_byte: u64,
    /// The first failure.
    failure: OnceLock<DiskError>,
    bands: Bands<T>,
}

/// A row of tiles: those of consecutive columns.
#[derive(Clone, Debug, Default)]
struct TileRow {
    /// The column of its first tile.
    first: usize,
    slots: Vec<Slot>,
    n_byte: u64,
    /// The numbers that are not zero of the first tile, and of the others.
    n_nonzero: [usize; 2],
}

/// The position of a tile in the file, and the form and checksum of its bytes.
#[derive(Clone, Copy, Debug)]
struct Slot {
    numbers: u64,
    errors: u64,
    checksums: [u32; 2],
    form: Form,
}

/// The part of a tile that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::matrix) enum Part {
    /// The numbers; the standard errors read as zero.
    Numbers,
    /// The numbers and their standard errors.
    All,
}

/// A band of tiles, as far as they are stored: those that hold the rows, or the columns, 64 K to 64 K + 63.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::matrix) enum Band {
    /// Of a triangle: the tiles (0, K) to (K, K), then (K, K + 1) to the end. By symmetry they hold the rows.
    Cross(usize),
    /// The tiles (K, 0) to the end.
    Row(usize),
    /// The tiles (0, K) to the end.
    Column(usize),
}

impl Band {
    /// Returns the row and the column of a tile of the band.
    fn place(self, block: usize) -> (usize, usize) {
        match self {
            Self::Cross(own) => (own.min(block), own.max(block)),
            Self::Row(own) => (own, block),
            Self::Column(own) => (block, own),
        }
    }
}

/// The bands last read, one for each thread that reads.
///
/// A reader takes a cached band and returns it; a concurrent reader reads from disk.
#[derive(Debug)]
struct Bands<T> {
    slots: Mutex<Vec<Option<Kept<T>>>>,
}

/// A band with the part of its tiles that was read.
type Kept<T> = (Band, Part, Vec<Option<Square<T>>>);

impl<T> Default for Bands<T> {
    fn default() -> Self {
        let slots = Mutex::default();
        Self { slots }
    }
}

impl<T> Bands<T> {
    fn exchange(&self, put: Option<Kept<T>>) -> Option<Kept<T>> {
        // A thread keeps its slot, so that it finds the band that it has read.
        let own = rayon::current_thread_index().map_or(0, |index| index + 1);
        let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
        if slots.len() <= own {
            slots.resize_with(own + 1, || None);
        }
        std::mem::replace(&mut slots[own], put)
    }
}

impl<T: Scalar> TileFile<T> {
    /// Makes a file without tiles for an n by n matrix.
    pub(in crate::matrix) fn create(n: usize, scratch: Scratch<'_>) -> Result<Self, DiskError> {
        let directory = scratch.directory.to_owned();
        let file = tempfile::tempfile_in(&directory).map_err(|error| DiskError::unwritable(&directory, &error))?;
        Ok(Self {
            n,
            file: Arc::new(file),
            directory,
            waiting_byte: scratch.memory_byte,
            rows: vec![TileRow::default(); n.div_ceil(SIDE)],
            n_byte: 0,
            failure: OnceLock::new(),
            bands: Bands::default(),
        })
    }

    /// Returns a matrix of the same size at the end of the same file, with some rows of tiles of this one.
    pub(in crate::matrix) fn beside(&self, rows: Range<usize>) -> Self {
        let mut kept = vec![TileRow::default(); self.rows.len()];
        kept[rows.clone()].clone_from_slice(&self.rows[rows]);
        Self {
            n: self.n,
            file: Arc::clone(&self.file),
            directory: self.directory.clone(),
            waiting_byte: self.waiting_byte,
            rows: kept,
            n_byte: self.n_byte,
            failure: self.failure.clone(),
            bands: Bands::default(),
        }
    }

    /// Stores the tiles of a row of tiles, from the column `first` of tiles on.
    pub(in crate::matrix) fn put_row(
        &mut self,
        row: usize,
        first: usize,
        tiles: &[Square<T>],
    ) -> Result<(), DiskError> {
        let slot = |tile: &Square<T>| Slot {
            numbers: NOWHERE,
            errors: NOWHERE,
            checksums: [0; 2],
            form: tile.form(),
        };
        let mut slots: Vec<Slot> = tiles.iter().map(slot).collect();
        let begin = self.n_byte;
        let written = self
            .push_part(tiles, Square::push_numbers, |k, offset, checksum| {
                (slots[k].numbers, slots[k].checksums[0]) = (offset, checksum);
            })
            .and_then(|()| {
                self.push_part(tiles, Square::push_errors, |k, offset, checksum| {
                    (slots[k].errors, slots[k].checksums[1]) = (offset, checksum);
                })
            });
        // After a failure the row is not found, and reads as such.
        let n_byte = self.n_byte - begin;
        let mut counts = tiles.iter().map(|tile| tile.sizes().n_nonzero);
        let n_nonzero = [counts.next().unwrap_or(0), counts.sum()];
        self.rows[row] = TileRow {
            first,
            slots,
            n_byte,
            n_nonzero,
        };
        written
    }

    /// Writes the bytes that `push` makes of each tile, and calls `note` with the tile's number in the row, the position of its bytes, and their checksum.
    fn push_part(
        &mut self,
        tiles: &[Square<T>],
        push: impl Fn(&Square<T>, &mut Vec<u8>),
        mut note: impl FnMut(usize, u64, u32),
    ) -> Result<(), DiskError> {
        let mut bytes = Vec::new();
        for (k, tile) in tiles.iter().enumerate() {
            let begin = bytes.len();
            push(tile, &mut bytes);
            note(k, self.n_byte + begin as u64, crc32fast::hash(&bytes[begin..]));
            if bytes.len() as u64 >= STRIP_BYTE || k + 1 == tiles.len() {
                let written = write_all_at(&self.file, &bytes, self.n_byte);
                written.map_err(|error| DiskError::unwritable(&self.directory, &error))?;
                self.n_byte += bytes.len() as u64;
                bytes.clear();
            }
        }
        Ok(())
    }

    /// Returns the place for more matrices of this kind.
    pub(in crate::matrix) fn scratch(&self) -> Scratch<'_> {
        Scratch {
            directory: &self.directory,
            memory_byte: self.waiting_byte,
        }
    }

    /// Returns the number of rows of the matrix.
    pub(in crate::matrix) fn n(&self) -> usize {
        self.n
    }

    /// Returns the numbers that are not zero in some rows of tiles: of the first tile of each, and of all others.
    pub(in crate::matrix) fn n_nonzero(&self, rows: Range<usize>) -> [usize; 2] {
        self.rows[rows].iter().fold([0; 2], |sum, row| {
            [sum[0] + row.n_nonzero[0], sum[1] + row.n_nonzero[1]]
        })
    }

    /// Returns the bytes of some rows of tiles.
    pub(in crate::matrix) fn n_byte(&self, rows: Range<usize>) -> usize {
        let byte: u64 = self.rows[rows].iter().map(|row| row.n_byte).sum();
        usize::try_from(byte).unwrap_or(usize::MAX)
    }

    /// Returns the columns of tiles that are stored of a row of tiles.
    fn columns(&self, row: usize) -> Range<usize> {
        let row = &self.rows[row];
        row.first..row.first + row.slots.len()
    }

    /// Calls `visit(column of tiles, tile)` for a row of tiles in order; reads a strip of them at a time.
    pub(in crate::matrix) fn for_each_tile(
        &self,
        row: usize,
        part: Part,
        mut visit: impl FnMut(usize, &Square<T>),
    ) -> Result<(), DiskError> {
        let columns = self.columns(row);
        let mut next = columns.start;
        while next < columns.end {
            let mut end = next + 1;
            while end < columns.end && self.slot(row, end).numbers - self.slot(row, next).numbers < STRIP_BYTE {
                end += 1;
            }
            for (column, tile) in (next..end).zip(self.read(row, next..end, part)?) {
                visit(column, &tile);
            }
            next = end;
        }
        Ok(())
    }

    /// Reads consecutive tiles of a row, and checks them.
    pub(in crate::matrix) fn read(
        &self,
        row: usize,
        columns: Range<usize>,
        part: Part,
    ) -> Result<Vec<Square<T>>, DiskError> {
        let [number_byte, error_byte] = columns.clone().fold([0; 2], |sum, column| {
            let byte = self.byte(row, column);
            [sum[0] + byte[0], sum[1] + byte[1]]
        });
        let Some(first) = columns.clone().next().map(|column| self.slot(row, column)) else {
            return Ok(Vec::new());
        };
        let numbers = self.bytes_at(first.numbers, number_byte)?;
        let errors = match part {
            Part::Numbers => Vec::new(),
            Part::All => self.bytes_at(first.errors, error_byte)?,
        };
        let (mut numbers_left, mut errors_left) = (numbers.as_slice(), errors.as_slice());
        let mut tiles = Vec::with_capacity(columns.len());
        for column in columns {
            let slot = self.slot(row, column);
            let byte = self.byte(row, column);
            let damaged = || DiskError::Damaged {
                directory: self.directory.clone(),
                row,
                column,
            };
            let (of_tile, rest) = numbers_left.split_at(byte[0]);
            numbers_left = rest;
            let mut its_errors: &[u8] = &[];
            if part == Part::All {
                (its_errors, errors_left) = errors_left.split_at(byte[1]);
                if crc32fast::hash(its_errors) != slot.checksums[1] {
                    return Err(damaged());
                }
            }
            if crc32fast::hash(of_tile) != slot.checksums[0] {
                return Err(damaged());
            }
            tiles.push(Square::from_bytes(slot.form, self.side(column), of_tile, its_errors));
        }
        Ok(tiles)
    }

    /// Returns the result of `work` for the tiles of a band, found by the row or column that differs from tile to tile; a tile that is not stored is `None`.
    ///
    /// `only` names the single tile that `work` reads, which is not worth a band.
    pub(in crate::matrix) fn with_band<R>(
        &self,
        band: Band,
        only: Option<usize>,
        part: Part,
        work: impl for<'t> FnOnce(&dyn Fn(usize) -> Option<&'t Square<T>>) -> R,
    ) -> Result<R, DiskError> {
        if let Some(block) = only {
            let tile = self.read_one(band.place(block), part)?;
            return Ok(work(&|_| tile.as_ref()));
        }
        let fits = |kept: &Kept<T>| kept.0 == band && (kept.1 == part || kept.1 == Part::All);
        // A band of no use is dropped before more is read.
        let kept = match self.bands.exchange(None).filter(fits) {
            Some(kept) => kept,
            None => (band, part, self.read_band(band, part)?),
        };
        let result = work(&|block| kept.2[block].as_ref());
        self.bands.exchange(Some(kept));
        Ok(result)
    }

    fn read_band(&self, band: Band, part: Part) -> Result<Vec<Option<Square<T>>>, DiskError> {
        let n_blocks = self.rows.len();
        let (singles, along) = match band {
            Band::Row(block) => (0..0, Some(block)),
            Band::Cross(block) => (0..block, Some(block)),
            Band::Column(_) => (0..n_blocks, None),
        };
        let mut tiles: Vec<Option<Square<T>>> = std::iter::repeat_with(|| None).take(n_blocks).collect();
        for block in singles {
            tiles[block] = self.read_one(band.place(block), part)?;
        }
        if let Some(row) = along {
            let columns = self.columns(row);
            for (tile, read) in tiles[columns.clone()].iter_mut().zip(self.read(row, columns, part)?) {
                *tile = Some(read);
            }
        }
        Ok(tiles)
    }

    /// Reads a tile; `None` if it is not stored.
    fn read_one(&self, (row, column): (usize, usize), part: Part) -> Result<Option<Square<T>>, DiskError> {
        if !self.columns(row).contains(&column) {
            return Ok(None);
        }
        Ok(self.read(row, column..column + 1, part)?.pop())
    }

    fn bytes_at(&self, offset: u64, n: usize) -> Result<Vec<u8>, DiskError> {
        let mut bytes = vec![0; n];
        let read = read_exact_at(&self.file, &mut bytes, offset);
        read.map_err(|error| DiskError::unreadable(&self.directory, &error))?;
        Ok(bytes)
    }

    fn slot(&self, row: usize, column: usize) -> &Slot {
        let row = &self.rows[row];
        &row.slots[column - row.first]
    }

    /// Returns the bytes of a tile's numbers and errors.
    fn byte(&self, row: usize, column: usize) -> [usize; 2] {
        self.slot(row, column)
            .form
            .byte::<T>(self.side(row) * self.side(column))
    }

    /// Returns the rows, or columns, of the tiles in a row, or column, of tiles.
    fn side(&self, block: usize) -> usize {
        SIDE.min(self.n - block * SIDE)
    }

    /// Returns the value of a result, or stores its error if that is the first one.
    pub(in crate::matrix) fn note<R>(&self, result: Result<R, DiskError>) -> Option<R> {
        result.map_err(|error| self.failure.get_or_init(|| error)).ok()
    }

    /// Returns the first failure.
    pub(in crate::matrix) fn failure(&self) -> Option<&DiskError> {
        self.failure.get()
    }

    #[cfg(test)]
    pub(in crate::matrix) fn file(&self) -> &File {
        &self.file
    }
}

/// Reports every number of `range` as NaN.
pub(in crate::matrix) fn visit_nothing_known(range: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
    for k in range {
        visit(k, f64::NAN, f64::NAN);
    }
}

#[cfg(unix)]
fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn write_all_at(file: &File, mut bytes: &[u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        match std::os::windows::fs::FileExt::seek_write(file, bytes, offset)? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            n => (bytes, offset) = (&bytes[n..], offset + n as u64),
        }
    }
    Ok(())
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, bytes, offset)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            n => (bytes, offset) = (&mut bytes[n..], offset + n as u64),
        }
    }
    Ok(())
}
