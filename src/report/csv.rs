//! Writes the solution as a table with one row per patch.

use std::io::{self, Write};

use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// Writes one row per patch: its id, surface, area in m², centroid in m, `quantities` (name, value per channel), and `scalars`, which have no channels.
///
/// Numbers have the fewest digits that read back as the same f64. Names are quoted where necessary (RFC 4180).
///
/// # Errors
/// Errors of the writer.
pub fn write_solution(
    writer: &mut dyn Write,
    scene: &Scene,
    mesh: &Mesh,
    quantities: &[(&str, &Block)],
    scalars: &[(&str, Vec<f64>)],
) -> io::Result<()> {
    let columns = quantities.iter().flat_map(|(name, block)| {
        let channels = channel_names(block.n_channels()).into_iter();
        channels.map(move |channel| format!("{name}_{channel}"))
    });
    let columns = columns.chain(scalars.iter().map(|(name, _)| (*name).to_owned()));
    write_rows(writer, scene, mesh, columns, |i| {
        let of_channels = quantities.iter();
        let of_channels = of_channels.flat_map(move |(_, block)| block.row(i).iter().copied());
        of_channels.chain(scalars.iter().map(move |(_, values)| values[i]))
    })
}

/// Writes one row per patch, as [`write_solution`] does, with one value of each of `quantities`.
pub(super) fn write_patches(
    writer: &mut dyn Write,
    scene: &Scene,
    mesh: &Mesh,
    quantities: &[(&str, &[f64])],
) -> io::Result<()> {
    let columns = quantities.iter().map(|(name, _)| (*name).to_owned());
    write_rows(writer, scene, mesh, columns, |i| {
        quantities.iter().map(move |(_, values)| values[i])
    })
}

fn write_rows<V: Iterator<Item = f64>>(
    writer: &mut dyn Write,
    scene: &Scene,
    mesh: &Mesh,
    columns: impl Iterator<Item = String>,
    values: impl Fn(usize) -> V,
) -> io::Result<()> {
    write!(writer, "patch,surface,area_m2,x_m,y_m,z_m")?;
    for name in columns {
        write!(writer, ",{name}")?;
    }
    writeln!(writer)?;
    for (i, patch) in mesh.patches.iter().enumerate() {
        let name = quoted(&scene.surfaces[patch.surface.0 as usize].name);
        let c = patch.centroid;
        write!(writer, "{i},{name},{:?},{:?},{:?},{:?}", patch.area, c.x, c.y, c.z)?;
        for value in values(i) {
            write!(writer, ",{value:?}")?;
        }
        writeln!(writer)?;
    }
    Ok(())
}

/// Writes the description of a file in lines that begin with `#`.
pub(super) fn write_description(writer: &mut dyn Write, description: &str) -> io::Result<()> {
    description.lines().try_for_each(|line| writeln!(writer, "# {line}"))
}

/// Returns the names of one grey channel or of three colours, else the numbers of the channels.
pub(super) fn channel_names(n_channels: usize) -> Vec<String> {
    match n_channels {
        1 => vec!["grey".to_owned()],
        3 => ["R", "G", "B"].map(str::to_owned).to_vec(),
        _ => (0..n_channels).map(|channel| channel.to_string()).collect(),
    }
}

pub(super) fn quoted(name: &str) -> String {
    if name.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
