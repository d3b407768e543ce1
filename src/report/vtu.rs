//! Writes patches with their values as an unstructured grid of VTK (`.vtu`), for ParaView and PyVista.

use std::fmt::Write as _;
use std::io::{self, Write};

use super::series::SeriesQuantity;
use crate::mesh::Mesh;
use crate::scene::{Scene, SurfaceId};

/// Writes the patches as cells, with their surface and area and `data`.
///
/// `description` and the surfaces' names become data of the whole field.
///
/// ASCII, numbers with the fewest digits that read back as the same f64.
pub(super) fn write(
    writer: &mut dyn Write,
    scene: (&Scene, &Mesh),
    description: &str,
    data: &[SeriesQuantity],
) -> io::Result<()> {
    write_at(writer, None, scene, description, data)
}

/// Writes as [`write`] does, for values at a time, which becomes VTK's `TimeValue`.
pub(super) fn write_at(
    writer: &mut dyn Write,
    time: Option<f64>,
    (scene, mesh): (&Scene, &Mesh),
    description: &str,
    data: &[SeriesQuantity],
) -> io::Result<()> {
    write_fields(writer, description, scene)?;
    if let Some(time) = time {
        let head = "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">";
        writeln!(writer, "{head}\n{time:?}\n</DataArray>")?;
    }
    let points = mesh.vertices.iter().map(glam::DVec3::to_array);
    let corners = mesh.patches.iter().map(|patch| patch.corners.as_slice());
    let surfaces = mesh.patches.iter().map(|patch| patch.surface);
    write_cells(writer, points, corners, surfaces)?;
    write_reals(writer, "area_m2", 1, mesh.patches.iter().map(|patch| [patch.area]))?;
    for own in data {
        let n_components = own.n_components();
        write_reals(writer, &own.name, n_components, own.values.chunks(n_components))?;
    }
    write_end(writer)
}

/// Writes points and cells, with the data of the whole field ended before and the data of cells begun: their surfaces.
///
/// Cells of 3, 4 and 8 corners are triangles, quads and hexahedra.
pub(super) fn write_cells<C: AsRef<[u32]>>(
    writer: &mut dyn Write,
    points: impl ExactSizeIterator<Item = [f64; 3]>,
    cells: impl ExactSizeIterator<Item = C> + Clone,
    surfaces: impl Iterator<Item = SurfaceId>,
) -> io::Result<()> {
    let (n_points, n_cells) = (points.len(), cells.len());
    writeln!(writer, "</FieldData>")?;
    writeln!(
        writer,
        "<Piece NumberOfPoints=\"{n_points}\" NumberOfCells=\"{n_cells}\">\n<Points>"
    )?;
    write_reals(writer, "position", 3, points)?;
    writeln!(writer, "</Points>\n<Cells>")?;
    write_numbers(writer, "Int64", "connectivity", 1, cells.clone(), u32::to_string)?;
    let mut end = 0;
    let ends = cells.clone().map(|corners| {
        end += corners.as_ref().len();
        [end]
    });
    write_numbers(writer, "Int64", "offsets", 1, ends, usize::to_string)?;
    // The types of VTK: VTK_TRIANGLE is 5, VTK_QUAD is 9, VTK_HEXAHEDRON is 12.
    let kind = |corners: C| match corners.as_ref().len() {
        3 => [5],
        4 => [9],
        _ => [12],
    };
    write_numbers(writer, "UInt8", "types", 1, cells.map(kind), u8::to_string)?;
    writeln!(writer, "</Cells>\n<CellData>")?;
    let surfaces = surfaces.map(|surface| [surface.0]);
    write_numbers(writer, "Int64", "surface", 1, surfaces, u32::to_string)
}

/// Ends the data of cells and the file.
pub(super) fn write_end(writer: &mut dyn Write) -> io::Result<()> {
    writeln!(writer, "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")
}

/// A time, and the name of its file.
pub(super) type Collected<'a> = (f64, &'a str);

/// Writes the list of the files of a series (`.pvd`), which are beside it.
pub(super) fn write_collection(writer: &mut dyn Write, files: &[Collected<'_>]) -> io::Result<()> {
    writeln!(writer, "<?xml version=\"1.0\"?>")?;
    writeln!(
        writer,
        "<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>"
    )?;
    for (time, name) in files {
        let name = escaped(name);
        writeln!(
            writer,
            "<DataSet timestep=\"{time:?}\" group=\"\" part=\"0\" file=\"{name}\"/>"
        )?;
    }
    writeln!(writer, "</Collection>\n</VTKFile>")
}

/// Writes the beginning, with data of the whole field, to which more may be added.
pub(super) fn write_fields(writer: &mut dyn Write, description: &str, scene: &Scene) -> io::Result<()> {
    writeln!(writer, "<?xml version=\"1.0\"?>")?;
    writeln!(
        writer,
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">"
    )?;
    writeln!(writer, "<UnstructuredGrid>\n<FieldData>")?;
    write_texts(writer, "description", [description].into_iter())?;
    write_texts(writer, "surface_name", scene.surfaces.iter().map(|s| s.name.as_str()))
}

/// Writes one array of f64, a line for each of `rows`.
pub(super) fn write_reals<R: AsRef<[f64]>>(
    writer: &mut dyn Write,
    name: &str,
    n_components: usize,
    rows: impl Iterator<Item = R>,
) -> io::Result<()> {
    write_numbers(writer, "Float64", name, n_components, rows, |x: &f64| format!("{x:?}"))
}

/// Writes one array, a line for each of `rows`.
fn write_numbers<T, R: AsRef<[T]>>(
    writer: &mut dyn Write,
    kind: &str,
    name: &str,
    n_components: usize,
    rows: impl Iterator<Item = R>,
    text: impl Fn(&T) -> String,
) -> io::Result<()> {
    let name = escaped(name);
    writeln!(
        writer,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{n_components}\" format=\"ascii\">"
    )?;
    for row in rows {
        let texts: Vec<String> = row.as_ref().iter().map(&text).collect();
        writeln!(writer, "{}", texts.join(" "))?;
    }
    writeln!(writer, "</DataArray>")
}

/// Writes texts as the numbers of their bytes, each text ended by 0, which readers without arrays of strings accept too.
fn write_texts<'a>(writer: &mut dyn Write, name: &str, texts: impl Iterator<Item = &'a str> + Clone) -> io::Result<()> {
    let n: usize = texts.clone().map(|text| text.len() + 1).sum();
    writeln!(
        writer,
        "<DataArray type=\"UInt8\" Name=\"{name}\" NumberOfTuples=\"{n}\" format=\"ascii\">"
    )?;
    for text in texts {
        let mut line = String::new();
        for byte in text.bytes() {
            let _ = write!(line, "{byte} ");
        }
        writeln!(writer, "{line}0")?;
    }
    writeln!(writer, "</DataArray>")
}

/// Returns text escaped for an attribute.
fn escaped(text: &str) -> String {
    let with = |unescaped: String, from, to| unescaped.replace(from, to);
    with(with(with(text.to_owned(), '&', "&amp;"), '<', "&lt;"), '"', "&quot;")
}
