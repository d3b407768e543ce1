//! Form factors between surfaces as a table.

use std::io::{self, Write};

use super::Description;
use super::csv::{quoted, write_description};
use crate::matrix::SurfaceFormFactors;
use crate::scene::Scene;

/// Writes one row for every pair of surfaces: from, to, area of the former in m², form factor, estimate of its absolute error.
///
/// The description stands before the table in lines that begin with `#`. Numbers have the fewest digits that read back as the same
/// f64. Names are quoted where they need it (RFC 4180).
pub(super) fn write(
    writer: &mut dyn Write,
    scene: &Scene,
    surfaces: &SurfaceFormFactors,
    description: &Description,
) -> io::Result<()> {
    write_description(writer, &description.to_json())?;
    writeln!(writer, "from,to,from_area_m2,form_factor,error")?;
    let n = surfaces.n_surfaces;
    for (i, from) in scene.surfaces.iter().enumerate() {
        for (j, to) in scene.surfaces.iter().enumerate() {
            let (from, to, area) = (quoted(&from.name), quoted(&to.name), surfaces.areas[i]);
            let (value, error) = (surfaces.form_factor[i * n + j], surfaces.error[i * n + j]);
            writeln!(writer, "{from},{to},{area:?},{value:?},{error:?}")?;
        }
    }
    Ok(())
}
