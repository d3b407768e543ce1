//! Writes form factors between surfaces as a table.

use std::io::{self, Write};

use super::Description;
use super::csv::{quoted, write_description};
use super::sky::SkyColumns;
use crate::matrix::SurfaceRows;
use crate::scene::Scene;

/// Writes one row for every pair of surfaces: from, to, area of the former, form factor, its absolute error, and the sky and back factors of the former.
///
/// The area is in m². The description precedes the table in lines that begin with `#`. Numbers have the fewest digits that read back as the same
/// f64. Names are quoted where necessary (RFC 4180).
pub(super) fn write(
    writer: &mut dyn Write,
    scene: &Scene,
    surfaces: &SurfaceRows<'_>,
    sky: Option<&SkyColumns>,
    description: &Description,
) -> io::Result<()> {
    write_description(writer, &description.to_json())?;
    write!(writer, "from,to,from_area_m2,form_factor,error")?;
    for (name, _) in sky.into_iter().flatten() {
        write!(writer, ",{name}")?;
    }
    writeln!(writer)?;
    for (k, (from, row)) in scene.surfaces.iter().zip(surfaces.iter()).enumerate() {
        let (from, area) = (quoted(&from.name), row.area);
        for ((to, value), error) in scene.surfaces.iter().zip(row.form_factor).zip(row.error) {
            write!(writer, "{from},{},{area:?},{value:?},{error:?}", quoted(&to.name))?;
            for (_, values) in sky.into_iter().flatten() {
                write!(writer, ",{:?}", values[k])?;
            }
            writeln!(writer)?;
        }
    }
    Ok(())
}
