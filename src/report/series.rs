//! Writes files of patches at many times, block by block.
//!
//! | ending | content | for |
//! |---|---|---|
//! | `.npz` | `time` \[k\], `time_text` \[k\]; each quantity \[k, n\] or \[k, n, c\], those that do not change \[n\] or \[n, c\]; `area`, `surface` \[n\], `centroid` \[n, 3\]; `meta.json` | NumPy |
//! | `.pvd`, `.vtu` | `NAME.pvd`, which lists the times, and beside it `NAME-0000.vtu` and so on, a file for each time, with the time as `TimeValue` | ParaView, PyVista |
//!
//! Until all blocks are written, values are in a scratch file beside the output: memory does not grow with the number of times.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::file::{self, by_ending};
use super::npy::{Element as _, Header};
use super::npz::{NpzWriter, write_numbers};
use super::vtu::Collected;
use super::{ReportError, vtu};
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::whole_file;

/// The number of values copied at once.
const AT_ONCE: usize = 1 << 16;

/// A quantity with a value for every patch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeriesQuantity {
    /// Its name.
    pub name: String,
    /// The numbers of one patch at one time: `None` for a single number, else c.
    pub channels: Option<usize>,
    /// The values, time by time, patch by patch.
    pub values: Vec<f64>,
}

/// All quantities at some times, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeriesBlock {
    /// The number of times.
    pub n_steps: usize,
    /// The values that vary, at these times.
    pub quantities: Vec<SeriesQuantity>,
    /// The values that do not vary.
    pub constants: Vec<SeriesQuantity>,
}

/// The formats of series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Npz,
    Vtu,
}

/// The data common to a series.
#[derive(Clone, Copy, Debug)]
pub struct SeriesReport<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its patches.
    pub mesh: &'a Mesh,
    /// The times.
    pub times: &'a [f64],
    /// The times as texts.
    pub time_texts: &'a [String],
    /// The unit of the times.
    pub time_unit: &'a str,
    /// The settings of the computation: no time, path or number of threads.
    pub settings: &'a Map<String, Value>,
}

/// Receives blocks, and writes the file of all of them.
#[derive(Debug)]
pub struct SeriesWriter {
    path: PathBuf,
    format: Format,
    scratch: File,
    /// The start of each block's values in the scratch file, and its number of times.
    blocks: Vec<(u64, usize)>,
    /// The quantities, without values.
    quantities: Vec<SeriesQuantity>,
    constants: Vec<SeriesQuantity>,
}

impl SeriesQuantity {
    /// Returns one number for each patch and time.
    #[must_use]
    pub fn scalar(name: impl Into<String>, values: Vec<f64>) -> Self {
        Self {
            name: name.into(),
            channels: None,
            values,
        }
    }

    /// Returns `channels` numbers for each patch and time.
    #[must_use]
    pub fn of_channels(name: impl Into<String>, channels: usize, values: Vec<f64>) -> Self {
        Self {
            name: name.into(),
            channels: Some(channels),
            values,
        }
    }

    /// Returns a block as a quantity.
    pub(crate) fn of_block(name: &str, block: &Block) -> Self {
        Self::of_channels(name, block.n_channels(), block.values().to_vec())
    }

    /// Returns the numbers of one patch at one time.
    pub(super) fn n_components(&self) -> usize {
        self.channels.unwrap_or(1)
    }

    /// Returns the values of a patch at the first time.
    pub(super) fn of_patch(&self, patch: usize) -> &[f64] {
        &self.values[patch * self.n_components()..(patch + 1) * self.n_components()]
    }

    /// Returns the array's shape for `first` times, or without times.
    pub(super) fn shape(&self, first: Option<usize>, n_patches: usize) -> Vec<usize> {
        first.into_iter().chain([n_patches]).chain(self.channels).collect()
    }
}

impl SeriesWriter {
    /// Begins a series in the format of the ending of `path`.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`], [`ReportError::Unwritable`].
    pub fn new(path: &Path) -> Result<Self, ReportError> {
        let format = format_of(path)?;
        let directory = path.parent().filter(|own| !own.as_os_str().is_empty());
        let scratch = tempfile::tempfile_in(directory.unwrap_or(Path::new(".")));
        Ok(Self {
            path: path.to_owned(),
            format,
            scratch: scratch.map_err(|source| ReportError::unwritable(path, source))?,
            blocks: Vec::new(),
            quantities: Vec::new(),
            constants: Vec::new(),
        })
    }

    /// Returns the main file: that of `path`, or `NAME.pvd` for `NAME.vtu`.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`].
    pub fn file_of(path: &Path) -> Result<PathBuf, ReportError> {
        Ok(match format_of(path)? {
            Format::Npz => path.to_owned(),
            Format::Vtu => path.with_extension("pvd"),
        })
    }

    /// Stores the next block.
    ///
    /// # Errors
    /// [`ReportError::Unwritable`] if there is no space for it.
    pub fn push(&mut self, block: &SeriesBlock) -> Result<(), ReportError> {
        let without_values = |own: &SeriesQuantity| SeriesQuantity {
            values: Vec::new(),
            ..own.clone()
        };
        if self.blocks.is_empty() {
            self.quantities = block.quantities.iter().map(without_values).collect();
            self.constants.clone_from(&block.constants);
        }
        let written = self.scratch.stream_position().and_then(|start| {
            self.blocks.push((start, block.n_steps));
            let mut all = block.quantities.iter();
            all.try_for_each(|own| write_numbers(&mut self.scratch, &own.values))
        });
        written.map_err(|source| ReportError::unwritable(&self.path, source))
    }

    /// Writes the file, or files, of all blocks, atomically; returns the main file.
    ///
    /// # Errors
    /// [`ReportError::Unwritable`].
    pub fn finish(mut self, report: &SeriesReport<'_>) -> Result<PathBuf, ReportError> {
        let written = match self.format {
            Format::Npz => {
                let path = self.path.clone();
                whole_file::write(&path, |writer| self.write_npz(writer, report)).map(|()| path)
            }
            Format::Vtu => self.write_vtus(report),
        };
        written.map_err(|source| ReportError::unwritable(&self.path, source))
    }

    fn write_npz<W: Write + Seek>(&mut self, writer: W, report: &SeriesReport<'_>) -> io::Result<()> {
        let n = report.mesh.n_patches();
        let mut npz = NpzWriter::new(writer);
        npz.bytes("meta.json", report.description().as_bytes())?;
        npz.numbers("time", &[report.times.len()], report.times)?;
        npz.texts("time_text", report.time_texts)?;
        for own in &self.constants {
            npz.numbers(&own.name, &own.shape(None, n), &own.values)?;
        }
        for k in 0..self.quantities.len() {
            let own = &self.quantities[k];
            let header = Header::new(f64::DTYPE, &own.shape(Some(report.times.len()), n));
            let name = own.name.clone();
            npz.array(&name, &header, |array| {
                for block in 0..self.blocks.len() {
                    let n_steps = self.blocks[block].1;
                    self.copy((block, k), 0..n_steps, n, &mut |numbers| write_numbers(array, numbers))?;
                }
                Ok(())
            })?;
        }
        npz.patches(report.mesh)?;
        npz.finish()
    }

    /// Copies the values of quantity `k` at some times of a block.
    fn copy(
        &mut self,
        (block, k): (usize, usize),
        steps: std::ops::Range<usize>,
        n_patches: usize,
        take: &mut dyn FnMut(&[f64]) -> io::Result<()>,
    ) -> io::Result<()> {
        let (start, n_steps) = self.blocks[block];
        let before: usize = self.quantities[..k]
            .iter()
            .map(|own| own.n_components() * n_patches * n_steps)
            .sum();
        let width = self.quantities[k].n_components() * n_patches;
        let place = (before + steps.start * width) as u64 * size_of::<f64>() as u64;
        self.scratch.seek(SeekFrom::Start(start + place))?;
        let mut reader = BufReader::new(&mut self.scratch);
        let mut left = steps.len() * width;
        let mut numbers = Vec::with_capacity(left.min(AT_ONCE));
        while left > 0 {
            numbers.clear();
            let mut bytes = [0; size_of::<f64>()];
            for _ in 0..left.min(AT_ONCE) {
                reader.read_exact(&mut bytes)?;
                numbers.push(f64::from_le_bytes(bytes));
            }
            left -= numbers.len();
            take(&numbers)?;
        }
        Ok(())
    }

    /// Writes a file for each time, and the file that lists them.
    fn write_vtus(&mut self, report: &SeriesReport<'_>) -> io::Result<PathBuf> {
        let digits = report.times.len().saturating_sub(1).to_string().len().max(4);
        let list = self.path.with_extension("pvd");
        let stem = list.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (mut prepared, mut names) = (Vec::new(), Vec::new());
        let steps: Vec<(usize, usize)> = (0..self.blocks.len())
            .flat_map(|block| (0..self.blocks[block].1).map(move |step| (block, step)))
            .collect();
        let description = report.description();
        for (number, ((block, step), time)) in steps.into_iter().zip(report.times).enumerate() {
            let name = format!("{stem}-{number:0digits$}.vtu");
            let data = self.at((block, step), report.mesh.n_patches())?;
            prepared.push(whole_file::prepare(&list.with_file_name(&name), |writer| {
                vtu::write_at(writer, Some(*time), (report.scene, report.mesh), &description, &data)
            })?);
            names.push(name);
        }
        let files: Vec<Collected<'_>> = names
            .iter()
            .zip(report.times)
            .map(|(name, time)| (*time, name.as_str()))
            .collect();
        let last = whole_file::prepare(&list, |writer| vtu::write_collection(writer, &files))?;
        prepared.into_iter().try_for_each(whole_file::Prepared::put)?;
        last.put()?;
        Ok(list)
    }

    /// Returns all quantities at one time.
    fn at(&mut self, (block, step): (usize, usize), n_patches: usize) -> io::Result<Vec<SeriesQuantity>> {
        let mut data = self.quantities.clone();
        for (k, own) in data.iter_mut().enumerate() {
            self.copy((block, k), step..step + 1, n_patches, &mut |numbers| {
                own.values.extend_from_slice(numbers);
                Ok(())
            })?;
        }
        data.extend_from_slice(&self.constants);
        Ok(data)
    }
}

impl SeriesReport<'_> {
    fn description(&self) -> String {
        let mut description = file::described("radiosity series 1", (self.scene, self.mesh), self.settings);
        description["n_steps"] = self.times.len().into();
        description["time_unit"] = self.time_unit.into();
        format!("{description:#}")
    }
}

fn format_of(path: &Path) -> Result<Format, ReportError> {
    let known = [("npz", Format::Npz), ("vtu", Format::Vtu), ("pvd", Format::Vtu)];
    by_ending(path, "a series of times", &known)
}
