//! The tiles that rows are read from, kept until another 64 rows are asked for.

use std::sync::{Mutex, PoisonError};

use super::super::square::Square;
use super::super::store::Scalar;
use super::DiskError;
use super::tile_file::{Part, TileFile};

/// Which tiles: those that hold the rows, or the columns, 64 K to 64 K + 63.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Band {
    /// Of a triangle: the tiles (0, K) to (K, K), then (K, K + 1) to the end. By symmetry they hold the rows.
    Cross(usize),
    /// The tiles (K, 0) to the end.
    Row(usize),
    /// The tiles (0, K) to the end.
    Column(usize),
}

/// The bands last read, one for each thread that reads.
///
/// Who reads rows takes a band out and puts it back, so that nothing waits, and a band that is asked for while it is out is read again.
#[derive(Debug)]
pub(super) struct Bands<T> {
    slots: Mutex<Vec<Option<Kept<T>>>>,
}

/// A band with what is known of its tiles.
type Kept<T> = (Band, Part, Vec<Square<T>>);

impl<T> Default for Bands<T> {
    fn default() -> Self {
        let slots = Mutex::default();
        Self { slots }
    }
}

impl<T> Bands<T> {
    fn exchange(&self, put: Option<Kept<T>>) -> Option<Kept<T>> {
        // A thread keeps its place, so that it finds what it has read.
        let own = rayon::current_thread_index().map_or(0, |index| index + 1);
        let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
        if slots.len() <= own {
            slots.resize_with(own + 1, || None);
        }
        std::mem::replace(&mut slots[own], put)
    }
}

impl<T: Scalar> TileFile<T> {
    /// Returns what `work` makes of the tiles of a band.
    pub(in super::super) fn with_band<R>(
        &self,
        band: Band,
        part: Part,
        work: impl FnOnce(&[Square<T>]) -> R,
    ) -> Result<R, DiskError> {
        let fits = |kept: &Kept<T>| kept.0 == band && (kept.1 == part || kept.1 == Part::All);
        // What is of no use is dropped before more is read.
        let kept = match self.bands.exchange(None).filter(fits) {
            Some(kept) => kept,
            None => (band, part, self.read_band(band, part)?),
        };
        let result = work(&kept.2);
        self.bands.exchange(Some(kept));
        Ok(result)
    }

    fn read_band(&self, band: Band, part: Part) -> Result<Vec<Square<T>>, DiskError> {
        let n_blocks = self.n_blocks();
        let (n_single, block) = match band {
            Band::Row(block) => return self.read(block, 0..n_blocks, part),
            Band::Cross(block) => (block, block),
            Band::Column(block) => (n_blocks, block),
        };
        let mut tiles = Vec::with_capacity(n_blocks);
        for row in 0..n_single {
            tiles.append(&mut self.read(row, block..block + 1, part)?);
        }
        if let Band::Cross(_) = band {
            tiles.append(&mut self.read(block, block..n_blocks, part)?);
        }
        Ok(tiles)
    }
}
