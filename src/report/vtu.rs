//! Writes patches with their values as an unstructured grid of VTK (`.vtu`), for ParaView and PyVista.

use std::fmt::Write as _;
use std::io::{self, Write};

use crate::mesh::Mesh;
use crate::scene::Scene;

/// Values on patches: a name, the number of components of each, and the values, patch by patch.
pub(super) struct CellData {
    pub(super) name: String,
    pub(super) n_components: usize,
    pub(super) values: Vec<f64>,
}

impl CellData {
    pub(super) fn new(name: impl Into<String>, n_components: usize, values: Vec<f64>) -> Self {
        let name = name.into();
        Self {
            name,
            n_components,
            values,
        }
    }
}

/// Writes the patches as cells, with their surface and area and `data`.
///
/// `description` and the surfaces' names become data of the whole field.
///
/// ASCII, numbers with the fewest digits that read back as the same f64.
pub(super) fn write(
    writer: &mut dyn Write,
    scene: &Scene,
    mesh: &Mesh,
    description: &str,
    data: &[CellData],
) -> io::Result<()> {
    write_at(writer, None, (scene, mesh), description, data)
}

/// Writes as [`write`] does, for values at a time, which becomes VTK's `TimeValue`.
pub(super) fn write_at(
    writer: &mut dyn Write,
    time: Option<f64>,
    (scene, mesh): (&Scene, &Mesh),
    description: &str,
    data: &[CellData],
) -> io::Result<()> {
    let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
    write_fields(writer, description, &names)?;
    if let Some(time) = time {
        let head = "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">";
        writeln!(writer, "{head}\n{time:?}\n</DataArray>")?;
    }
    end_fields(writer, mesh.vertices.len(), mesh.n_patches())?;
    write_numbers(
        writer,
        "Float64",
        "position",
        3,
        mesh.vertices.iter().map(glam::DVec3::to_array),
        |x| format!("{x:?}"),
    )?;
    writeln!(writer, "</Points>\n<Cells>")?;
    let corners = mesh.patches.iter().map(|patch| patch.corners.as_slice());
    write_numbers(writer, "Int64", "connectivity", 1, corners.clone(), u32::to_string)?;
    let mut end = 0;
    let ends = corners.clone().map(|corners| {
        end += corners.len();
        [end]
    });
    write_numbers(writer, "Int64", "offsets", 1, ends, usize::to_string)?;
    // The types of VTK: VTK_TRIANGLE is 5, VTK_QUAD is 9.
    let types = corners.map(|corners| [if corners.len() == 3 { 5 } else { 9 }]);
    write_numbers(writer, "UInt8", "types", 1, types, u8::to_string)?;
    writeln!(writer, "</Cells>\n<CellData>")?;
    let surfaces = mesh.patches.iter().map(|patch| [patch.surface.0]);
    write_numbers(writer, "Int64", "surface", 1, surfaces, u32::to_string)?;
    let areas = mesh.patches.iter().map(|patch| [patch.area]);
    write_numbers(writer, "Float64", "area_m2", 1, areas, |x| format!("{x:?}"))?;
    for CellData {
        name,
        n_components,
        values,
    } in data
    {
        let rows = values.chunks(*n_components);
        write_numbers(writer, "Float64", name, *n_components, rows, |x| format!("{x:?}"))?;
    }
    writeln!(writer, "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")
}

/// Writes everything up to the points: `description` and the surfaces' names as data of the whole field.
pub(super) fn write_head(
    writer: &mut dyn Write,
    description: &str,
    surface_names: &[&str],
    n_points: usize,
    n_cells: usize,
) -> io::Result<()> {
    write_fields(writer, description, surface_names)?;
    end_fields(writer, n_points, n_cells)
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
fn write_fields(writer: &mut dyn Write, description: &str, surface_names: &[&str]) -> io::Result<()> {
    writeln!(writer, "<?xml version=\"1.0\"?>")?;
    writeln!(
        writer,
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">"
    )?;
    writeln!(writer, "<UnstructuredGrid>\n<FieldData>")?;
    write_texts(writer, "description", &[description])?;
    write_texts(writer, "surface_name", surface_names)
}

fn end_fields(writer: &mut dyn Write, n_points: usize, n_cells: usize) -> io::Result<()> {
    writeln!(writer, "</FieldData>")?;
    writeln!(
        writer,
        "<Piece NumberOfPoints=\"{n_points}\" NumberOfCells=\"{n_cells}\">\n<Points>"
    )
}

/// Writes one array, a line for each of `rows`.
pub(super) fn write_numbers<T, R: AsRef<[T]>>(
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
fn write_texts(writer: &mut dyn Write, name: &str, texts: &[&str]) -> io::Result<()> {
    let n: usize = texts.iter().map(|text| text.len() + 1).sum();
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
