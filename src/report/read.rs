//! Reads form factors from a file, for the patches to which they belong.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use super::description::FORMAT;
use super::form_factors::{Format, beside};
use super::mtx::{self, MtxRows};
use super::npy::Dtype;
use super::npz::{Archive, Array};
use super::{Description, ReportError};
use crate::form_factor::upper_bounds;
use crate::input_file::{self, DESCRIPTION_LIMIT};
use crate::matrix::{
    Entry, FormFactors, MatrixError, Precision, RayWeights, RowTally, RowTile, StorageChoice, UPPER_ROWS,
};
use crate::mesh::Mesh;

/// A file of form factors with its description.
#[derive(Clone, Debug)]
pub struct FormFactorFile {
    path: PathBuf,
    description: Description,
}

impl FormFactorFile {
    /// Opens a `.npz`, `.npy` or `.mtx` file of [`FormFactorReport::write`](super::form_factors::FormFactorReport::write), and reads its description.
    ///
    /// # Errors
    /// [`ReportError::Unreadable`], [`ReportError::Damaged`], [`ReportError::NoDescription`] for a file of another program,
    /// [`ReportError::Version`] for one of a later version, [`ReportError::UnknownFormat`].
    pub fn open(path: &Path) -> Result<Self, ReportError> {
        let missing = |what: String| ReportError::NoDescription {
            path: path.to_owned(),
            what,
        };
        if path.is_dir() {
            let source = std::io::Error::new(std::io::ErrorKind::IsADirectory, "it is a directory; name a file");
            return Err(ReportError::unreadable(path, source));
        }
        let description = match Format::to_read(path)? {
            Format::Npz => {
                let text = archived_description(&mut Archive::open(path)?)?;
                description(path, &text.ok_or_else(|| missing("the member `meta`".into()))?)?
            }
            Format::Mtx => {
                let text = mtx::description(path)?;
                if text.trim().is_empty() {
                    return Err(missing("the description in its comments".into()));
                }
                description(path, text.as_bytes())?
            }
            _ => {
                let path = beside(path);
                match input_file::expect_plain(&path).and_then(|()| input_file::read(&path, DESCRIPTION_LIMIT)) {
                    Ok(text) => description(&path, &text)?,
                    Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                        return Err(missing(format!("{} beside it", path.display())));
                    }
                    Err(source) => return Err(ReportError::unreadable(&path, source)),
                }
            }
        };
        Ok(Self {
            path: path.to_owned(),
            description,
        })
    }

    /// Returns the file's path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the description of the file.
    #[must_use]
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Returns whether the file holds the errors of its form factors.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        Format::to_read(&self.path).is_ok_and(|format| format == Format::Npz)
    }

    /// Reads the form factors of a mesh.
    ///
    /// Accuracy: form factors that are not symmetric are restored to the last bit. For symmetric ones, whose exchange areas are the upper triangle of F times the areas, the exchange areas are
    /// restored to 3 units in the last place. A `.npy` or `.mtx` file has neither errors nor tallies of rays: both are then unknown.
    ///
    /// # Errors
    /// [`ReportError::OtherGeometry`] unless the mesh has the patches of the form factors; [`ReportError::Damaged`] and
    /// [`ReportError::Matrix`] if the file is cut off, changed, contradicts itself, or holds numbers that are not form factors.
    pub fn read(&self, mesh: &Mesh) -> Result<FormFactors, ReportError> {
        self.read_into(mesh, StorageChoice::default())
    }

    /// Reads the form factors of a mesh as [`read`](Self::read) does, and stores them in `storage`, with no more digits than the file has.
    ///
    /// It reads a few rows at a time, so a matrix on a disk is never in memory as a whole.
    ///
    /// # Errors
    /// As [`read`](Self::read), and [`ReportError::Scratch`].
    pub fn read_into(&self, mesh: &Mesh, storage: StorageChoice<'_>) -> Result<FormFactors, ReportError> {
        if mesh.geometry_hash() != self.description.geometry_sha256 {
            return Err(ReportError::OtherGeometry {
                path: self.path.clone(),
            });
        }
        let n = mesh.n_patches();
        let (areas, tallies) = if Format::to_read(&self.path)? == Format::Npz {
            let mut archive = Archive::open(&self.path)?;
            (Self::areas(&mut archive, mesh)?, self.tallies(&mut archive, n)?)
        } else {
            (mesh.areas(), vec![RowTally::default(); n])
        };
        let mut rows = self.rows(n)?;
        let points = self.points(rows.skips_open)?;
        let has_open = rows.skips_open;
        let with_bounds = |factors: FormFactors| {
            if has_open {
                factors.with_bounds(upper_bounds(mesh, points))
            } else {
                factors
            }
        };
        let storage = StorageChoice {
            precision: match rows.precision() {
                Precision::F32 => Precision::F32,
                Precision::F64 => storage.precision,
            },
            ..storage
        };
        let in_file = |error| self.in_file(error);
        if !self.description.symmetric {
            let mut failure = None;
            let tiles = (0..n).step_by(UPPER_ROWS).map_while(|first| {
                let end = n.min(first + UPPER_ROWS);
                rows.tile(first..end, &tallies, |_, _| true)
                    .map_err(|error| failure = Some(error))
                    .ok()
            });
            let factors = FormFactors::from_tiles(areas, tiles, storage);
            if let Some(error) = failure {
                return Err(in_file(error));
            }
            // After a failure, the rest of the file has not been read.
            let factors = factors.map_err(|error| in_file(error.into()))?;
            rows.finish()?;
            return Ok(with_bounds(factors));
        }
        let upper = (0..n).step_by(UPPER_ROWS).map(|first| {
            let end = n.min(first + UPPER_ROWS);
            rows.tile(first..end, &tallies, |i, j| j >= i)
        });
        let factors = FormFactors::from_upper_rows(areas, tallies.clone(), upper, storage).map_err(in_file)?;
        rows.finish()?;
        self.expect_symmetric(self.rows(n)?, &factors)?;
        factors
            .if_readable(with_bounds(factors.clone()))
            .map_err(|error| in_file(MatrixError::from(error).into()))
    }

    /// Reads the number of points along each side of a patch from which its rays start, if there is one.
    fn points(&self, has_open: bool) -> Result<Option<NonZeroUsize>, ReportError> {
        if !has_open {
            return Ok(None);
        }
        let mut array = Archive::open(&self.path)?.array("points")?;
        array.expect_shape(&[1])?;
        let mut found = Vec::new();
        array.next_counts(1, &mut found)?;
        array.finish()?;
        // A number beyond the limit of the method would make an endless rule.
        match found[..] {
            [0] => Ok(None),
            [q] if q <= 256 => Ok(usize::try_from(q).ok().and_then(NonZeroUsize::new)),
            _ => Err(ReportError::damaged(
                &self.path,
                "`points` is no number of points along a side",
            )),
        }
    }

    /// Opens the rows of F at the first.
    fn rows(&self, n: usize) -> Result<Rows, ReportError> {
        match &self.description.file {
            Some(check) if Format::to_read(&self.path)? == Format::Mtx => {
                let entries = MtxRows::open(&self.path, n, check.clone())?;
                Ok(Rows::new(Source::Text(entries), n))
            }
            Some(check) => Rows::in_full(Array::open_npy(&self.path, check)?, None, n),
            None => {
                let mut archive = Archive::open(&self.path)?;
                let mut rows = Rows::open(&mut archive, n)?;
                rows.skips_open = archive.has("open_error");
                Ok(rows)
            }
        }
    }

    fn in_file(&self, failure: Failure) -> ReportError {
        match failure {
            Failure::Report(error) => error,
            Failure::Matrix(MatrixError::Disk(source)) => ReportError::Scratch {
                path: self.path.clone(),
                source,
            },
            Failure::Matrix(source) => ReportError::Matrix {
                path: self.path.clone(),
                source,
            },
        }
    }

    fn areas(archive: &mut Archive, mesh: &Mesh) -> Result<Vec<f64>, ReportError> {
        let areas = mesh.areas();
        // Files of older programs call them `area`.
        let name = if archive.has("area_m2") { "area_m2" } else { "area" };
        let mut array = archive.array(name)?;
        array.expect_shape(&[areas.len() as u64])?;
        let mut found = Vec::new();
        array.next_reals(areas.len(), &mut found)?;
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        if let Some(patch) = areas.iter().zip(&found).position(|pair| !same(pair)) {
            let (told, known) = (found[patch], areas[patch]);
            let reason = format!("patch {patch} has {known:?} m² and the file says {told:?} m²");
            return Err(array.error(reason));
        }
        array.finish().map(|()| areas)
    }

    fn tallies(&self, archive: &mut Archive, n: usize) -> Result<Vec<RowTally>, ReportError> {
        let mut tallies = vec![RowTally::default(); n];
        if !archive.has("n_rays") {
            return Ok(tallies);
        }
        let mut counts = [Vec::new(), Vec::new(), Vec::new()];
        for (name, of_rows) in ["n_rays", "n_escaped", "n_absorbed"].iter().zip(&mut counts) {
            let mut array = archive.array(name)?;
            array.expect_shape(&[n as u64])?;
            array.next_counts(n, of_rows)?;
            array.finish()?;
        }
        let mut weights = Vec::new();
        if archive.has("ray_weights") {
            let mut array = archive.array("ray_weights")?;
            array.expect_shape(&[n as u64, 3])?;
            array.next_reals(3 * n, &mut weights)?;
            array.finish()?;
        }
        for (i, tally) in tallies.iter_mut().enumerate() {
            let [n_rays, n_escaped, n_absorbed] = [counts[0][i], counts[1][i], counts[2][i]];
            let of_row = weights.get(3 * i..3 * i + 3).filter(|w| !w[0].is_nan());
            *tally = RowTally {
                n_rays,
                n_escaped,
                n_absorbed,
                weights: of_row.map(|w| RayWeights {
                    escaped: w[0],
                    absorbed: w[1],
                    squared: w[2],
                }),
            };
            if !tally.is_consistent() {
                let reason = format!("the tally of the rays of patch {i} contradicts itself");
                return Err(ReportError::damaged(&self.path, reason));
            }
        }
        Ok(tallies)
    }

    /// Refuses a file whose lower triangle contradicts the upper, from which `factors` were made.
    ///
    /// Each rank compares its own rows; a collective call.
    fn expect_symmetric(&self, mut rows: Rows, factors: &FormFactors) -> Result<(), ReportError> {
        let n = factors.n_rows();
        let (unit, least) = match factors.storage().precision {
            Precision::F64 => (f64::EPSILON, f64::MIN_POSITIVE),
            Precision::F32 => (f32::EPSILON.into(), f32::MIN_POSITIVE.into()),
        };
        let none = vec![RowTally::default(); n];
        let mut expected = vec![0.0; n];
        let own = factors.own_rows();
        let mut found = Vec::new();
        for i in 0..n {
            let tile = rows
                .tile(i..i + 1, &none, |_, _| true)
                .map_err(|error| self.in_file(error))?;
            if !own.contains(&i) || !found.is_empty() {
                continue;
            }
            expected.fill(0.0);
            factors.for_each_in_row(i, |j, value, _| expected[j] = value);
            for &(j, value, _) in tile.row(0) {
                expected[j as usize] -= value;
                // Three roundings lead from the upper triangle, and two to the lower.
                if expected[j as usize].abs() <= 4.0 * unit * value.abs() + least {
                    expected[j as usize] = 0.0;
                }
            }
            if let Some(j) = expected.iter().position(|difference| difference.abs() > 0.0) {
                found.extend([i, j].map(|k| k as f64));
            }
        }
        if let [i, j, ..] = factors.gathered(found)[..] {
            let reason = format!("it says that A_i F_ij is symmetric, and it is not between the patches {i} and {j}");
            return Err(ReportError::damaged(&self.path, reason));
        }
        rows.finish()
    }

    /// Returns bytes that identify the numbers of the file: its description and the checksums that are compared on reading.
    ///
    /// # Errors
    /// [`ReportError`] if the file cannot be read.
    pub(crate) fn fingerprint(&self) -> Result<Vec<u8>, ReportError> {
        let mut bytes = self.description.to_json().into_bytes();
        if self.has_errors() {
            bytes.extend(Archive::open(&self.path)?.checksums()?);
        }
        Ok(bytes)
    }
}

/// Returns the description in an archive, if there is one; files of older programs have it as a member that is not an array.
fn archived_description(archive: &mut Archive) -> Result<Option<Vec<u8>>, ReportError> {
    if !archive.has("meta") {
        return archive.bytes("meta.json");
    }
    let mut array = archive.array("meta")?;
    array.expect_shape(&[])?;
    let text = array.next_text()?;
    array.finish()?;
    Ok(Some(text.into_bytes()))
}

fn description(path: &Path, text: &[u8]) -> Result<Description, ReportError> {
    let damaged = |reason: String| ReportError::damaged(path, reason);
    let value: serde_json::Value =
        serde_json::from_slice(text).map_err(|error| damaged(format!("its description is no JSON: {error}")))?;
    let format = value["format"].as_str().unwrap_or("nothing known");
    if format != FORMAT {
        return Err(ReportError::Version {
            path: path.to_owned(),
            found: format.to_owned(),
            expected: FORMAT,
        });
    }
    Description::from_json(value).map_err(damaged)
}

/// An error while a matrix is made of rows.
enum Failure {
    Report(ReportError),
    Matrix(MatrixError),
}

impl From<MatrixError> for Failure {
    fn from(error: MatrixError) -> Self {
        Self::Matrix(error)
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        Self::Report(error)
    }
}

/// The rows of F and their standard errors, read in parallel.
struct Rows {
    source: Source,
    n: usize,
    buffer: [Vec<f64>; 2],
    columns: Vec<u64>,
    /// True if entries of 0 are those that no ray hit, whose errors follow without being stored.
    skips_open: bool,
}

/// The source of rows.
#[expect(clippy::large_enum_variant, reason = "there is one of them at a time")]
enum Source {
    Arrays {
        values: Array,
        errors: Option<Array>,
        /// The columns of the entries and the start of each row, for sparse rows.
        sparse: Option<(Array, Vec<u64>)>,
    },
    Text(MtxRows),
}

impl Rows {
    fn new(source: Source, n: usize) -> Self {
        Self {
            source,
            n,
            buffer: Default::default(),
            columns: Vec::new(),
            skips_open: false,
        }
    }

    /// Returns rows with all their columns.
    fn in_full(values: Array, errors: Option<Array>, n: usize) -> Result<Self, ReportError> {
        for array in [&values].into_iter().chain(&errors) {
            array.expect_shape(&[n as u64; 2])?;
        }
        let sparse = None;
        Ok(Self::new(Source::Arrays { values, errors, sparse }, n))
    }

    fn open(archive: &mut Archive, n: usize) -> Result<Self, ReportError> {
        if archive.has("F") {
            return Self::in_full(archive.array("F")?, Some(archive.array("error")?), n);
        }
        let mut format = archive.array("format")?;
        if format.next_text()? != "csr" {
            return Err(format.error("only compressed sparse rows, `csr`, can be read"));
        }
        format.finish()?;
        let square = [n as u64; 2];
        let mut shape = archive.array("shape")?;
        let mut found = Vec::new();
        shape.expect_shape(&[2])?;
        shape.next_counts(2, &mut found)?;
        if found != square {
            return Err(shape.error(format!("the matrix has the shape {found:?} instead of {square:?}")));
        }
        shape.finish()?;
        let mut begins = archive.array("indptr")?;
        begins.expect_shape(&[n as u64 + 1])?;
        let mut begin = Vec::new();
        begins.next_counts(n + 1, &mut begin)?;
        let values = archive.array("data")?;
        let errors = archive.array("error")?;
        let columns = archive.array("indices")?;
        let size = [values.header.shape.first().copied().unwrap_or(0)];
        for array in [&values, &errors, &columns] {
            array.expect_shape(&size)?;
        }
        if begin[0] != 0 || begin[n] != size[0] || !begin.is_sorted() {
            return Err(begins.error("the rows do not follow each other"));
        }
        begins.finish()?;
        let (errors, sparse) = (Some(errors), Some((columns, begin)));
        Ok(Self::new(Source::Arrays { values, errors, sparse }, n))
    }

    fn precision(&self) -> Precision {
        match &self.source {
            Source::Arrays { values, .. } if values.header.dtype == Dtype::F32 => Precision::F32,
            _ => Precision::F64,
        }
    }

    /// Reads the next rows, which are `range`, with the entries for which `keep(i, j)` is true.
    fn tile(
        &mut self,
        range: std::ops::Range<usize>,
        tallies: &[RowTally],
        keep: impl Fn(usize, usize) -> bool,
    ) -> Result<RowTile, Failure> {
        let mut tile = RowTile::new(range.start);
        let mut entries: Vec<Entry> = Vec::new();
        for i in range {
            let size = self.read_row(i)?;
            entries.clear();
            for k in 0..size {
                let column = self
                    .columns
                    .get(k)
                    .map_or(k, |&j| usize::try_from(j).unwrap_or(usize::MAX));
                let is_open = self.skips_open && self.buffer[0][k].abs() <= 0.0;
                if keep(i, column) && !is_open {
                    let column = u32::try_from(column).unwrap_or(u32::MAX);
                    let value = self.buffer[0][k];
                    if value < 0.0 {
                        return Err(MatrixError::Negative { row: i, column, value }.into());
                    }
                    entries.push((column, self.buffer[0][k], self.buffer[1][k]));
                }
            }
            tile.push_row(&entries, tallies[i]);
        }
        Ok(tile)
    }

    /// Reads row i into the buffers, and returns the number of its entries; all columns if the rows are not sparse.
    fn read_row(&mut self, i: usize) -> Result<usize, ReportError> {
        let mut size = self.n;
        let (values, errors, sparse) = match &mut self.source {
            Source::Arrays { values, errors, sparse } => (values, errors, sparse),
            Source::Text(rows) => {
                let [of_row, none] = &mut self.buffer;
                rows.read_row(i, &mut self.columns, of_row)?;
                none.clear();
                none.resize(of_row.len(), 0.0);
                return Ok(of_row.len());
            }
        };
        if let Some((columns, begins)) = sparse {
            size = usize::try_from(begins[i + 1] - begins[i]).unwrap_or(usize::MAX);
            columns.next_counts(size, &mut self.columns)?;
            let n = self.n as u64;
            if !self.columns.is_sorted_by(|a, b| a < b) || self.columns.last().is_some_and(|&j| j >= n) {
                return Err(columns.error(format!("the columns of row {i} are not ascending numbers below {n}")));
            }
        }
        values.next_reals(size, &mut self.buffer[0])?;
        match errors {
            Some(errors) => errors.next_reals(size, &mut self.buffer[1])?,
            None => self.buffer[1].resize(size, 0.0),
        }
        Ok(size)
    }

    fn finish(self) -> Result<(), ReportError> {
        let (values, errors, sparse) = match self.source {
            Source::Arrays { values, errors, sparse } => (values, errors, sparse),
            Source::Text(rows) => return rows.finish(),
        };
        if let Some((columns, _)) = sparse {
            columns.finish()?;
        }
        values.finish()?;
        errors.map_or(Ok(()), Array::finish)
    }
}
