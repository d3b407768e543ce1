//! Files of form factors.
//!
//! | ending | content | for |
//! |---|---|---|
//! | `.npz` | compressed sparse rows, as `scipy.sparse.load_npz` reads them: `data`, `indices`, `indptr`, `shape`, `format`; `error` of the same entries, `area_m2`, sky and back factors of the patches, the description `meta`; where asked for, `F` and `error` in full instead of the rows | this program, NumPy, SciPy |
//! | `.npy` | F in full; the description stands in a file of the same name with `.json` after it | this program, NumPy |
//! | `.mtx` | F as coordinates | this program, Matrix Market readers: SciPy, MATLAB, Julia |
//! | `.csv` | form factors between surfaces, with their errors, and the sky and back factors of the surface that light comes from | tables |
//! | `.exr` | F as an image: row i downwards, column j to the right | viewers |
//! | `.vf` | form factors between surfaces, with areas and emissivities | View3D's users |
//! | `.ply`, `.obj` | patches with the form factor to a chosen surface, else the sky factor, as colours of their vertices | MeshLab, Blender |
//! | `.vtu` | patches with row sum, error, sky and back factor with their errors, and the form factor to a chosen surface | ParaView, PyVista |
//!
//! F\[i, j\] is the fraction of the light leaving patch i that reaches patch j, `area_m2` is in m², `error` the standard error of
//! each form factor, `sky_factor` the fraction of the light of a patch that escapes, `back_factor` the fraction that black backs absorb.
//!
//! The error of an entry that no ray hit follows from the number of rays. Sparse rows list such entries, with a form factor of 0, unless they are more than eight times as many as the others.
//! Otherwise `open_error`, one number for each row, is the error of every entry that is not listed and whose patches face each other, or their factor without occluders where that is less; `points` is
//! the number of points along each side of a patch from which its rays start, 0 if they start anywhere.
//!
//! Every file contains this description, the hash of the patches' geometry and the settings; it holds no time, path or number of threads, and equal content gives equal bytes.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use super::file::{Hashed, by_ending};
use super::npy::{Dtype, Header};
use super::npz::{NpzWriter, write_numbers};
use super::series::SeriesQuantity;
use super::sky::sky_columns;
use super::{Description, ReportError, coloured, matrix_csv, matrix_exr, mtx, view3d, vtu};
use crate::form_factor::{PairCounts, SkyFactors};
use crate::matrix::operator::Block;
use crate::matrix::{FormFactors, Precision, RowTally};
use crate::mesh::Mesh;
use crate::scene::{Scene, SurfaceId};
use crate::threads;
use crate::whole_file;

pub use super::read::FormFactorFile;

/// Form factors with their scene and settings.
#[derive(Clone, Copy, Debug)]
pub struct FormFactorReport<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its patches.
    pub mesh: &'a Mesh,
    /// Their form factors.
    pub factors: &'a FormFactors,
    /// False if the error of a form factor is above the tolerance.
    pub tolerance_met: bool,
    /// The numbers of pairs of patches by their treatment, and those above the tolerance by the reason; `None` for methods without pairs.
    pub pairs: Option<PairCounts>,
    /// The sky and back factors of each patch, which files then hold with their errors.
    pub sky: Option<&'a SkyFactors>,
    /// The settings of the form factors: no time, path or number of threads. `subdivide` or `max_edge_m` is the subdivision of
    /// the scene.
    pub settings: &'a Map<String, Value>,
    /// The surface to which `.vtu`, `.ply` and `.obj` give every patch's form factor.
    pub surface: Option<SurfaceId>,
    /// True if light cannot leave the scene, for `.vf`.
    pub is_closed: bool,
    /// True if `.npz` holds F and its errors in full; other formats ignore it.
    pub dense: bool,
}

/// The formats of form factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NumPy's archive of arrays.
    Npz,
    /// NumPy's array, with its description beside it.
    Npy,
    /// Matrix Market.
    Mtx,
    /// A table of surfaces.
    Csv,
    /// An image.
    Exr,
    /// A mesh with colours of vertices.
    Ply,
    /// The same in Wavefront's format.
    Obj,
    /// View3D's text.
    View3D,
    /// An unstructured grid of VTK.
    Vtu,
}

/// The formats: ending, format, and whether form factors can be read from it. A new one also needs an arm in
/// [`FormFactorReport::write`], and one in [`FormFactorFile`] if it is read.
const FORMATS: [(&str, Format, bool); 9] = [
    ("npz", Format::Npz, true),
    ("npy", Format::Npy, true),
    ("mtx", Format::Mtx, true),
    ("csv", Format::Csv, false),
    ("exr", Format::Exr, false),
    ("vf", Format::View3D, false),
    ("ply", Format::Ply, false),
    ("obj", Format::Obj, false),
    ("vtu", Format::Vtu, false),
];

/// The greatest ratio of entries that no ray hit to the others up to which a sparse matrix lists them.
const MAX_OPEN: usize = 8;

impl Format {
    /// Returns the format of a file's ending.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`].
    pub fn of(path: &Path) -> Result<Self, ReportError> {
        Self::among(path, "form factors", |_| true)
    }

    /// Returns the format of a file's ending, if form factors can be read from it.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`].
    pub fn to_read(path: &Path) -> Result<Self, ReportError> {
        Self::among(path, "form factors to read", |readable| readable)
    }

    fn among(path: &Path, content: &'static str, counts: impl Fn(bool) -> bool) -> Result<Self, ReportError> {
        let known = FORMATS.iter().filter(|(.., readable)| counts(*readable));
        let known: Vec<_> = known.map(|&(name, format, _)| (name, format)).collect();
        by_ending(path, content, &known)
    }
}

impl FormFactorReport<'_> {
    /// Writes the form factors to `path`, atomically, in the format of its ending.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`], [`ReportError::Unwritable`], [`ReportError::Scratch`].
    ///
    /// # Panics
    /// If the mesh has not one patch for every row.
    #[track_caller]
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        assert_eq!(self.mesh.n_patches(), self.factors.n_rows(), "one row per patch");
        let factors = self.factors;
        let format = Format::of(path)?;
        let counts = match format {
            Format::Npz if !self.dense => self.row_counts(),
            _ => Vec::new(),
        };
        // The first rank writes the rows of all.
        let written = factors.by_first(|| match format {
            Format::Npy => self.write_npy(path),
            _ => whole_file::write(path, |writer| {
                self.write_one(format, writer, &counts)?;
                // After a failed read, the file is removed as if it had never been begun.
                factors.if_readable(()).map_err(io::Error::other)
            }),
        });
        written.unwrap_or(Ok(())).map_err(|source| match factors.failure() {
            Some(error) => ReportError::Scratch {
                path: path.to_owned(),
                source: error.clone(),
            },
            None => ReportError::unwritable(path, source),
        })
    }

    /// Writes the content of a format of one file.
    fn write_one(&self, format: Format, writer: &mut BufWriter<&mut File>, counts: &[[usize; 2]]) -> io::Result<()> {
        let (scene, factors) = (self.scene, self.factors);
        let n_surfaces = scene.surfaces.len();
        let surface_of_patch: Vec<u32> = self.mesh.patches.iter().map(|patch| patch.surface.0).collect();
        match format {
            Format::Npz => self.write_npz(writer, counts),
            Format::Mtx => mtx::write(writer, factors, self.description()),
            Format::Csv => {
                let sky = self.sky.map(|sky| sky.of_surfaces(self.mesh, n_surfaces));
                let columns = sky.as_ref().map(sky_columns);
                let rows = factors.surface_rows(&surface_of_patch, n_surfaces);
                matrix_csv::write(writer, scene, &rows, columns.as_ref(), &self.description())
            }
            Format::View3D => {
                let rows = factors.surface_rows(&surface_of_patch, n_surfaces);
                view3d::write(writer, scene, &rows, self.is_closed)
            }
            Format::Ply => self.write_coloured(writer, coloured::Format::Ply),
            Format::Obj => self.write_coloured(writer, coloured::Format::Obj),
            Format::Exr => matrix_exr::write(writer, factors, &self.description()).map_err(io::Error::other),
            Format::Vtu => {
                let description = self.description().to_json();
                vtu::write(writer, (scene, self.mesh), &description, &self.cell_data())
            }
            Format::Npy => unreachable!("it has two files"),
        }
    }

    /// Returns the values of every patch for `.vtu`.
    fn cell_data(&self) -> Vec<SeriesQuantity> {
        let n = self.factors.n_rows();
        let sum_to = |i: usize, counts: &dyn Fn(usize) -> bool| {
            let mut sums = (0.0, 0.0);
            sums.1 = self.factors.open_error(i);
            self.factors.for_each_in_row(i, |j, value, error| {
                if counts(j) {
                    sums = (sums.0 + value, sums.1 + error);
                }
            });
            sums
        };
        let columns = |name: &str, counts: &(dyn Fn(usize) -> bool + Sync)| {
            let (sums, errors) = threads::collect(n, |i| sum_to(i, counts)).into_iter().unzip();
            [
                SeriesQuantity::scalar(name, sums),
                SeriesQuantity::scalar(format!("{name}_error"), errors),
            ]
        };
        let mut data = Vec::from(columns("row_sum", &|_| true));
        let sky = self.sky.map(sky_columns).into_iter().flatten();
        data.extend(sky.map(|(name, values)| SeriesQuantity::scalar(name, values)));
        if let Some(surface) = self.surface {
            let name = format!("form_factor_to_{}", self.scene.surfaces[surface.0 as usize].name);
            data.extend(columns(&name, &|j| self.mesh.patches[j].surface == surface));
        }
        data
    }

    /// Writes patches in the colours of the form factor to the surface, else of the sky factor, else of the row sum.
    fn write_coloured(&self, writer: &mut dyn Write, format: coloured::Format) -> io::Result<()> {
        let data = self.cell_data();
        let wanted = match (self.surface, self.sky) {
            (Some(surface), _) => format!("form_factor_to_{}", self.scene.surfaces[surface.0 as usize].name),
            (None, Some(_)) => "sky_factor".to_owned(),
            (None, None) => "row_sum".to_owned(),
        };
        let Some(column) = data.iter().find(|column| column.name == wanted) else {
            return Err(io::Error::other("no such quantity"));
        };
        let quantity = coloured::Quantity {
            name: &column.name,
            unit: "1",
            values: &Block::from_values(column.values.clone(), 1),
        };
        coloured::write(writer, format, (self.scene, self.mesh), &quantity)
    }

    /// Writes F in full, and then the description with its checksum beside it.
    fn write_npy(&self, path: &Path) -> io::Result<()> {
        let n = self.factors.n_rows();
        let mut description = self.description();
        let matrix = whole_file::prepare(path, |writer| {
            let mut hashed = Hashed::new(writer);
            hashed.write_all(&Header::new(self.dtype(), &[n, n]).encode())?;
            self.write_rows(self.dtype(), &mut hashed, |value, _| value)?;
            description.file = Some(hashed.check());
            self.factors.if_readable(()).map_err(io::Error::other)
        })?;
        let described = whole_file::prepare(&beside(path), |writer| {
            writer.write_all(description.to_json().as_bytes())
        })?;
        // The lock keeps other processes from writing one of the two files in between.
        let _turn = whole_file::turn(whole_file::directory_of(path));
        matrix.put()?;
        described.put()
    }

    pub(super) fn description(&self) -> Description {
        Description::new(
            self.factors.n_rows(),
            self.mesh.geometry_hash(),
            self.factors.is_symmetric(),
            (self.tolerance_met, self.pairs),
            self.settings.clone(),
        )
    }

    /// Returns the type of F in files, which is that of its storage.
    pub(super) fn dtype(&self) -> Dtype {
        match self.factors.storage().precision {
            Precision::F64 => Dtype::F64,
            Precision::F32 => Dtype::F32,
        }
    }

    fn write_npz<W: Write + io::Seek>(&self, writer: W, counts: &[[usize; 2]]) -> io::Result<()> {
        let mut npz = NpzWriter::new(BufWriter::with_capacity(1 << 20, writer));
        npz.text("meta", &self.description().to_json())?;
        if self.dense {
            self.add_dense(&mut npz)?;
        } else {
            self.add_sparse(&mut npz, counts)?;
        }
        let n = self.factors.n_rows();
        npz.numbers("area_m2", &[n], self.factors.areas())?;
        add_tallies(&mut npz, self.factors.tallies())?;
        let open: Vec<f64> = (0..n).map(|i| self.factors.open_error(i)).collect();
        if open.iter().any(|error| *error > 0.0) {
            npz.numbers("open_error", &[n], &open)?;
            let points = self.factors.points().map_or(0, NonZeroUsize::get);
            npz.numbers("points", &[1], &[points as u64])?;
        }
        for (name, values) in self.sky.map(sky_columns).into_iter().flatten() {
            npz.numbers(name, &[n], &values)?;
        }
        npz.finish()
    }

    fn add_dense<W: Write + io::Seek>(&self, npz: &mut NpzWriter<W>) -> io::Result<()> {
        let n = self.factors.n_rows();
        let header = |dtype| Header::new(dtype, &[n, n]);
        npz.array("F", &header(self.dtype()), |writer| {
            self.write_rows(self.dtype(), writer, |value, _| value)
        })?;
        npz.array("error", &header(Dtype::F32), |writer| {
            self.write_rows(Dtype::F32, writer, |_, error| error)
        })
    }

    /// Writes rows with all their columns; `pick` chooses between the form factor and its error.
    pub(super) fn write_rows(
        &self,
        dtype: Dtype,
        writer: &mut dyn Write,
        pick: impl Fn(f64, f64) -> f64,
    ) -> io::Result<()> {
        let mut row = vec![0.0; self.factors.n_rows()];
        for i in 0..row.len() {
            row.fill(0.0);
            self.factors
                .for_each_error_in_row(i, |j, value, error| row[j] = pick(value, error));
            write_reals(writer, dtype, &row)?;
        }
        Ok(())
    }

    /// Calls `write` with the entries of each row: column, form factor, standard error.
    fn for_each_row(
        &self,
        lists_open: bool,
        mut write: impl FnMut(&[(usize, f64, f64)]) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut row = Vec::new();
        for i in 0..self.factors.n_rows() {
            row.clear();
            let add = |j, value, error| row.push((j, value, error));
            if lists_open {
                self.factors.for_each_error_in_row(i, add);
            } else {
                self.factors.for_each_in_row(i, add);
            }
            write(&row)?;
        }
        Ok(())
    }

    /// Returns for each row the number of stored entries, and of further ones that no ray hit; a collective call.
    fn row_counts(&self) -> Vec<[usize; 2]> {
        let counts = self.factors.numbers_of_rows(|i| {
            let mut n_stored: u64 = 0;
            self.factors.for_each_in_row(i, |_, _, _| n_stored += 1);
            [n_stored, self.factors.n_open(i) as u64].map(f64::from_bits)
        });
        let narrow = |count: f64| usize::try_from(count.to_bits()).unwrap_or(usize::MAX);
        counts.into_iter().map(|counts| counts.map(narrow)).collect()
    }

    /// Adds compressed sparse rows as `scipy.sparse.save_npz` does, and the errors of the same entries; `counts`: [`row_counts`](Self::row_counts).
    fn add_sparse<W: Write + io::Seek>(&self, npz: &mut NpzWriter<W>, counts: &[[usize; 2]]) -> io::Result<()> {
        let n = self.factors.n_rows();
        let total = |k: usize| counts.iter().map(|of_row| of_row[k]).sum::<usize>();
        let lists_open = total(1) <= MAX_OPEN * total(0);
        let mut begins = vec![0];
        let mut size = 0_usize;
        for [n_stored, n_open] in counts {
            size += if lists_open { n_stored + n_open } else { *n_stored };
            begins.push(size);
        }
        // SciPy requires both index arrays to have one type.
        let narrow = begins
            .iter()
            .map(|&b| i32::try_from(b).ok())
            .collect::<Option<Vec<_>>>();
        let narrow = narrow.filter(|_| i32::try_from(n).is_ok());
        npz.array("format", &Header::new(Dtype::Bytes(3), &[]), |w| w.write_all(b"csr"))?;
        npz.numbers("shape", &[2], &[n as u64, n as u64].map(u64::cast_signed))?;
        let index = if narrow.is_some() { Dtype::I32 } else { Dtype::I64 };
        if let Some(narrow) = &narrow {
            npz.numbers("indptr", &[n + 1], narrow)?;
        } else {
            let wide = begins.iter().map(|&b| (b as u64).cast_signed());
            npz.numbers("indptr", &[n + 1], &wide.collect::<Vec<_>>())?;
        }
        npz.array("indices", &Header::new(index, &[size]), |writer| {
            self.for_each_row(lists_open, |row| {
                let columns = row.iter().map(|&(j, ..)| (j as u64).cast_signed());
                if index == Dtype::I64 {
                    return write_numbers(writer, &columns.collect::<Vec<_>>());
                }
                let short = columns.map(|j| i32::try_from(j).unwrap_or(i32::MAX));
                write_numbers(writer, &short.collect::<Vec<_>>())
            })
        })?;
        npz.array("data", &Header::new(self.dtype(), &[size]), |writer| {
            self.for_each_row(lists_open, |row| {
                write_reals(writer, self.dtype(), &row.iter().map(|e| e.1).collect::<Vec<_>>())
            })
        })?;
        npz.array("error", &Header::new(Dtype::F32, &[size]), |writer| {
            self.for_each_row(lists_open, |row| {
                write_reals(writer, Dtype::F32, &row.iter().map(|e| e.2).collect::<Vec<_>>())
            })
        })
    }
}

/// Returns the files of form factors at `path`: the file itself, and the description if it has a file of its own.
#[must_use]
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let description = Format::of(path)
        .is_ok_and(|format| format == Format::Npy)
        .then(|| beside(path));
    [path.to_owned()].into_iter().chain(description).collect()
}

/// Returns the name of the description beside an array: that of the array with `.json` appended.
pub(super) fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

/// Writes numbers as f32 if that is the type, else as f64.
fn write_reals(writer: &mut dyn Write, dtype: Dtype, numbers: &[f64]) -> io::Result<()> {
    if dtype == Dtype::F32 {
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is what is asked for")]
        let narrow: Vec<f32> = numbers.iter().map(|&x| x as f32).collect();
        return write_numbers(writer, &narrow);
    }
    write_numbers(writer, numbers)
}

/// Adds the tallies of the rays, if there are any: counts, and the sums of the weights (NaN for rows without weights).
fn add_tallies<W: Write + io::Seek>(npz: &mut NpzWriter<W>, tallies: &[RowTally]) -> io::Result<()> {
    let n = tallies.len();
    if tallies.iter().all(|tally| *tally == RowTally::default()) {
        return Ok(());
    }
    for (name, k) in [("n_rays", 0), ("n_escaped", 1), ("n_absorbed", 2)] {
        let counts = tallies
            .iter()
            .map(|tally| [tally.n_rays, tally.n_escaped, tally.n_absorbed][k]);
        npz.numbers(name, &[n], &counts.collect::<Vec<_>>())?;
    }
    if tallies.iter().any(|tally| tally.weights.is_some()) {
        let weights = tallies.iter().flat_map(|tally| match tally.weights {
            Some(w) => [w.escaped, w.absorbed, w.squared],
            None => [f64::NAN; 3],
        });
        npz.numbers("ray_weights", &[n, 3], &weights.collect::<Vec<_>>())?;
    }
    Ok(())
}
