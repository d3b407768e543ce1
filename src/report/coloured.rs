//! Writes a quantity on patches as colours of vertices, in PLY and OBJ, for programs that show meshes.
//!
//! Each vertex has the area mean over the patches around it on its flat surface ([`Mesh::vertex_values`]), as sRGB: black is 0 and below, white the greatest value. PLY also holds the numbers
//! themselves, as further properties of the vertices. Both name the quantity and the value of white in a comment. OBJ has the colour after the position (`v x y z r g b`), as MeshLab, Blender and
//! trimesh read it.

use std::io::{self, Write};

use super::csv::channel_names;
use crate::matrix::operator::Block;
use crate::mesh::{Mesh, Patch};
use crate::render::tone_map::srgb_curve;
use crate::scene::Scene;

/// The formats with colours of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Ply,
    Obj,
}

/// A quantity on patches, with its name and unit for comments.
pub(super) struct Quantity<'a> {
    pub(super) name: &'a str,
    pub(super) unit: &'a str,
    /// The values, \[n, c\]; one channel is grey, of others the first three are red, green and blue.
    pub(super) values: &'a Block,
}

/// Writes the patches with the colours of a quantity.
pub(super) fn write(
    writer: &mut dyn Write,
    format: Format,
    (scene, mesh): (&Scene, &Mesh),
    quantity: &Quantity<'_>,
) -> io::Result<()> {
    let values = mesh.vertex_values(quantity.values);
    let white = values.values().iter().copied().fold(0.0, f64::max);
    let comment = format!(
        "{} in {}; colours are sRGB, white is {white:?}",
        quantity.name, quantity.unit
    );
    let colour = |vertex: usize| {
        let row = values.row(vertex);
        [0, 1, 2].map(|channel| srgb(row[if row.len() < 3 { 0 } else { channel }], white))
    };
    match format {
        Format::Ply => write_ply(writer, mesh, (quantity.name, &values), &comment, colour),
        Format::Obj => write_obj(writer, (scene, mesh), &comment, colour),
    }
}

fn write_ply(
    writer: &mut dyn Write,
    mesh: &Mesh,
    (name, values): (&str, &Block),
    comment: &str,
    colour: impl Fn(usize) -> [f64; 3],
) -> io::Result<()> {
    writeln!(writer, "ply\nformat ascii 1.0\ncomment {comment}")?;
    writeln!(writer, "element vertex {}", mesh.vertices.len())?;
    for axis in ["x", "y", "z"] {
        writeln!(writer, "property double {axis}")?;
    }
    for channel in ["red", "green", "blue"] {
        writeln!(writer, "property uchar {channel}")?;
    }
    let columns = match values.n_channels() {
        1 => vec![name.to_owned()],
        n => channel_names(n)
            .iter()
            .map(|channel| format!("{name}_{channel}"))
            .collect(),
    };
    for column in &columns {
        // The name of a property contains no blanks.
        writeln!(writer, "property double {}", column.replace(char::is_whitespace, "_"))?;
    }
    writeln!(writer, "element face {}", mesh.n_patches())?;
    writeln!(
        writer,
        "property list uchar int vertex_indices\nproperty int surface\nend_header"
    )?;
    for (k, vertex) in mesh.vertices.iter().enumerate() {
        write!(writer, "{:?} {:?} {:?}", vertex.x, vertex.y, vertex.z)?;
        for channel in colour(k) {
            write!(writer, " {:.0}", 255.0 * channel)?;
        }
        for value in values.row(k) {
            write!(writer, " {value:?}")?;
        }
        writeln!(writer)?;
    }
    // Triangles precede quads: meshio accepts values of faces in no other order.
    let (triangles, quads): (Vec<&Patch>, Vec<&Patch>) = mesh
        .patches
        .iter()
        .partition(|patch| patch.corners.as_slice().len() == 3);
    for patch in triangles.into_iter().chain(quads) {
        let corners = patch.corners.as_slice();
        write!(writer, "{}", corners.len())?;
        for corner in corners {
            write!(writer, " {corner}")?;
        }
        writeln!(writer, " {}", patch.surface.0)?;
    }
    Ok(())
}

fn write_obj(
    writer: &mut dyn Write,
    (scene, mesh): (&Scene, &Mesh),
    comment: &str,
    colour: impl Fn(usize) -> [f64; 3],
) -> io::Result<()> {
    writeln!(writer, "# {comment}")?;
    for (k, vertex) in mesh.vertices.iter().enumerate() {
        let [r, g, b] = colour(k);
        let (x, y, z) = (vertex.x, vertex.y, vertex.z);
        writeln!(writer, "v {x:?} {y:?} {z:?} {r:.6} {g:.6} {b:.6}")?;
    }
    let mut of_surface = vec![Vec::new(); scene.surfaces.len()];
    for patch in &mesh.patches {
        of_surface[patch.surface.0 as usize].push(patch.corners);
    }
    for (surface, patches) in scene.surfaces.iter().zip(of_surface) {
        writeln!(writer, "o {}", surface.name)?;
        for corners in patches {
            write!(writer, "f")?;
            for corner in corners.as_slice() {
                write!(writer, " {}", u64::from(*corner) + 1)?;
            }
            writeln!(writer)?;
        }
    }
    Ok(())
}

/// Returns the sRGB of a value as a share of white, in \[0, 1\] (IEC 61966-2-1).
fn srgb(value: f64, white: f64) -> f64 {
    let share = if white > 0.0 { value / white } else { 0.0 };
    srgb_curve(share.clamp(0.0, 1.0))
}
