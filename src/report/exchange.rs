//! Files of exchange factors.
//!
//! | ending | content |
//! |---|---|
//! | `.npz` | `G`, `G_error`, `script_f`, `conductance_m2` \[m, m\], `names` \[m\], `meta.json` |
//! | `.csv` | `node_i,node_j,conductance_m2` for i < j without zeros, as thermal network programs read it |

use std::io::{self, Seek, Write};
use std::path::Path;

use serde_json::{Map, Value, json};

use super::file::{self, by_ending};
use super::npz::NpzWriter;
use super::{ReportError, csv};
use crate::heat::ExchangeFactors;

/// The name of exchange factors in messages.
pub const CONTENT: &str = "exchange factors";

/// The formats of exchange factors, and of tables of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A table.
    Csv,
    /// NumPy's archive of arrays.
    Npz,
}

impl Format {
    /// Returns the format of a file's ending; messages call the content `content`.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`].
    pub fn of(path: &Path, content: &'static str) -> Result<Self, ReportError> {
        by_ending(path, content, &[("csv", Self::Csv), ("npz", Self::Npz)])
    }
}

/// Writes exchange factors to `path`, atomically, in the format of its ending; `settings` are those of the computation.
///
/// # Errors
/// [`ReportError::UnknownFormat`], [`ReportError::Unwritable`].
pub fn write(path: &Path, factors: &ExchangeFactors, settings: &Map<String, Value>) -> Result<(), ReportError> {
    let format = Format::of(path, CONTENT)?;
    file::write(path, |writer| match format {
        Format::Csv => write_csv(writer, factors),
        Format::Npz => write_npz(writer, factors, settings),
    })
}

fn write_csv(writer: &mut dyn Write, factors: &ExchangeFactors) -> io::Result<()> {
    writeln!(writer, "node_i,node_j,conductance_m2")?;
    let (m, conductance) = (factors.n_nodes(), factors.conductance());
    let names: Vec<String> = factors.names.iter().map(|name| csv::quoted(name)).collect();
    for (i, from) in names.iter().enumerate() {
        for (j, to) in names.iter().enumerate().skip(i + 1) {
            let value = conductance[i * m + j];
            if value > 0.0 {
                writeln!(writer, "{from},{to},{value:?}")?;
            }
        }
    }
    Ok(())
}

fn write_npz<W: Write + Seek>(writer: W, factors: &ExchangeFactors, settings: &Map<String, Value>) -> io::Result<()> {
    let m = factors.n_nodes();
    let description = json!({
        "format": "radiosity exchange factors 1",
        "unit": "G, G_error, script_f: 1; conductance_m2: m2",
        "settings": settings,
    });
    let mut npz = NpzWriter::new(writer);
    npz.bytes("meta.json", format!("{description:#}").as_bytes())?;
    npz.numbers("G", &[m, m], &factors.gebhart)?;
    npz.numbers("G_error", &[m, m], &factors.gebhart_error)?;
    npz.numbers("script_f", &[m, m], &factors.script_f())?;
    npz.numbers("conductance_m2", &[m, m], &factors.conductance())?;
    npz.texts("names", &factors.names)?;
    npz.finish()
}
