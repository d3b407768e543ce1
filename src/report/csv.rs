//! Writes tables with one row per patch.

use std::io::{self, Write};

use super::series::SeriesQuantity;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// Writes one row per patch: its id, surface, area in m², centroid in m, and `quantities`, whose channels are columns `NAME_CHANNEL`.
///
/// Numbers have the fewest digits that read back as the same f64. Names are quoted where necessary (RFC 4180).
pub(super) fn write_patches(
    writer: &mut dyn Write,
    scene: &Scene,
    mesh: &Mesh,
    quantities: &[SeriesQuantity],
) -> io::Result<()> {
    write!(writer, "patch,surface,area_m2,x_m,y_m,z_m")?;
    for SeriesQuantity { name, channels, .. } in quantities {
        match channels {
            None => write!(writer, ",{name}")?,
            Some(n) => channel_names(*n)
                .iter()
                .try_for_each(|channel| write!(writer, ",{name}_{channel}"))?,
        }
    }
    writeln!(writer)?;
    for (i, patch) in mesh.patches.iter().enumerate() {
        let name = quoted(&scene.surfaces[patch.surface.0 as usize].name);
        let c = patch.centroid;
        write!(writer, "{i},{name},{:?},{:?},{:?},{:?}", patch.area, c.x, c.y, c.z)?;
        for value in quantities.iter().flat_map(|own| own.of_patch(i)) {
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
