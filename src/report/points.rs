//! Files of free points, and of the views from them.
//!
//! Points are read from a table with the columns `x`, `y`, `z` in m and, for directed points, `nx`, `ny`, `nz`, in any order; other columns are ignored, as are lines that begin with `#`. Results have
//! a row for each point, as `.csv` or `.npz`: `row`, `status`, `F_NAME` and `F_NAME_error` of every surface, `F_surroundings`, `F_backs`, and with boundary conditions the irradiances, each with its
//! error.

use std::io::{self, Seek, Write};
use std::path::Path;

use glam::DVec3;
use serde_json::{Map, Value, json};

use super::exchange::Format;
use super::npz::NpzWriter;
use super::text_table::TextFile;
use super::{ReportError, csv, file};
use crate::heat::{PointQuery, PointView, Stated};
use crate::scene::Scene;

/// The name of such tables in messages.
pub const CONTENT: &str = "points";

/// The columns of the position, and of the normal.
const POSITION: [&str; 3] = ["x", "y", "z"];
const NORMAL: [&str; 3] = ["nx", "ny", "nz"];

/// Reads points from a table.
///
/// # Errors
/// [`ReportError::Unreadable`], and [`ReportError::BadTable`] with the line for text that is no such table, a number that is not finite, or a normal without a length.
pub fn read(path: &Path) -> Result<Vec<PointQuery>, ReportError> {
    let file = TextFile::read(path, "bad_points")?;
    let table = file.table("x,y,z")?;
    let [Some(x), Some(y), Some(z)] = table.find(POSITION) else {
        return Err(table.bad_head("the first line does not name the columns x, y and z; add it"));
    };
    let normal = match table.find(NORMAL) {
        [Some(nx), Some(ny), Some(nz)] => Some([nx, ny, nz]),
        [None, None, None] => None,
        _ => return Err(table.bad_head("not all of nx, ny and nz are there; give all or none")),
    };
    let mut points = Vec::new();
    for row in table.rows() {
        let query = PointQuery {
            position: row.numbers([x, y, z])?.into(),
            normal: normal
                .map(|columns| row.numbers(columns))
                .transpose()?
                .map(DVec3::from_array),
        };
        if query.normal.is_some_and(|own| own.try_normalize().is_none()) {
            return Err(row.bad("the normal has no length; correct it".into()));
        }
        points.push(query);
    }
    Ok(points)
}

/// Columns of numbers, each with its name.
type Columns = Vec<(String, Vec<f64>)>;

/// Returns the views from points as columns of numbers.
fn columns(scene: &Scene, views: &[PointView]) -> Columns {
    let mut columns = Columns::new();
    let mut add = |name: &str, value: &dyn Fn(&PointView) -> Stated| {
        columns.push((name.to_owned(), views.iter().map(|view| value(view).value).collect()));
        columns.push((
            format!("{name}_error"),
            views.iter().map(|view| value(view).error).collect(),
        ));
    };
    for (k, surface) in scene.surfaces.iter().enumerate() {
        add(&format!("F_{}", surface.name), &|view| view.surfaces[k]);
    }
    add("F_surroundings", &|view| view.surroundings);
    add("F_backs", &|view| view.backs);
    let Some(first) = views.first().and_then(|view| view.heat) else {
        return columns;
    };
    let heat =
        |view: &PointView, of: fn(&crate::heat::PointHeat) -> Stated| view.heat.as_ref().map_or(Stated::default(), of);
    add("irradiance_w_m2", &|view| heat(view, |own| own.irradiance));
    add("solar_irradiance_w_m2", &|view| heat(view, |own| own.solar));
    if first.sunlit.is_some() {
        add("sun_irradiance_w_m2", &|view| heat(view, |own| own.sun));
        add("sunlit_fraction", &|view| {
            heat(view, |own| own.sunlit.unwrap_or_default())
        });
    }
    if first.mean_radiant.is_some() {
        add("t_mrt_k", &|view| {
            heat(view, |own| own.mean_radiant.unwrap_or_default())
        });
    }
    columns
}

/// Writes the views from points to `path`, atomically, in the format of its ending; `settings` are those of the computation.
///
/// # Errors
/// [`ReportError::UnknownFormat`], [`ReportError::Unwritable`].
pub fn write(
    path: &Path,
    scene: &Scene,
    views: &[PointView],
    settings: &Map<String, Value>,
) -> Result<(), ReportError> {
    let format = Format::of(path, CONTENT)?;
    let columns = columns(scene, views);
    file::write(path, |writer| match format {
        Format::Csv => write_csv(writer, views, &columns),
        Format::Npz => write_npz(writer, views, &columns, settings),
    })
}

/// Writes the views from points as a table.
///
/// # Errors
/// Errors of the writer.
pub fn write_table(writer: &mut dyn Write, scene: &Scene, views: &[PointView]) -> io::Result<()> {
    write_csv(writer, views, &columns(scene, views))
}

fn write_csv(writer: &mut dyn Write, views: &[PointView], columns: &Columns) -> io::Result<()> {
    write!(writer, "row,status")?;
    for (name, _) in columns {
        write!(writer, ",{}", csv::quoted(name))?;
    }
    writeln!(writer)?;
    for (row, view) in views.iter().enumerate() {
        write!(writer, "{row},{}", view.status.name())?;
        for (_, values) in columns {
            write!(writer, ",{:?}", values[row])?;
        }
        writeln!(writer)?;
    }
    Ok(())
}

fn write_npz<W: Write + Seek>(
    writer: W,
    views: &[PointView],
    columns: &Columns,
    settings: &Map<String, Value>,
) -> io::Result<()> {
    let description = json!({ "format": "radiosity points 1", "settings": settings });
    let mut npz = NpzWriter::new(writer);
    npz.bytes("meta.json", format!("{description:#}").as_bytes())?;
    let statuses: Vec<String> = views.iter().map(|view| view.status.name().to_owned()).collect();
    npz.texts("status", &statuses)?;
    for (name, values) in columns {
        npz.numbers(&name.replace('/', "_"), &[values.len()], values)?;
    }
    npz.finish()
}
