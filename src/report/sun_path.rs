//! Reads tables of the sun's positions: a row for each time.
//!
//! The columns are `time`, `irradiance` (W·m⁻², of a plane that faces the sun) and either `x`, `y`, `z`, the direction towards the sun of any length, or `latitude`, `longitude`, in degrees north and
//! east. A time is a number, in any unit, or a date with time and offset in RFC 3339, which latitude and longitude require. Times increase from row to row.

use std::path::Path;

use glam::DVec3;

use super::ReportError;
use super::text_table::TextFile;
use crate::heat::{SunPath, SunPlace};
use crate::parameter::Parameter;

/// The columns of the position.
enum Columns {
    Direction([usize; 3]),
    Place([usize; 2]),
}

/// Reads the path of a sun whose disc has an angular radius in degrees; `axes`: north and up of the scene, for places on Earth.
///
/// # Errors
/// [`ReportError::Unreadable`]; [`ReportError::BadTable`] with the line for text that is no such table; [`ReportError::BadSetting`] for a radius out of range and, for places on Earth, a north along
/// up.
pub fn read(path: &Path, angular_radius_deg: f64, axes: [DVec3; 2]) -> Result<SunPath, ReportError> {
    let file = TextFile::read(path, "bad_sun_path")?;
    let table = file.table("time,x,y,z,irradiance")?;
    let [time, irradiance] = table.find(["time", "irradiance"]);
    let (Some(time), Some(irradiance)) = (time, irradiance) else {
        return Err(table.bad_head("the first line does not name the columns time and irradiance; add them"));
    };
    let columns = match (table.find(["x", "y", "z"]), table.find(["latitude", "longitude"])) {
        ([Some(x), Some(y), Some(z)], [None, None]) => Columns::Direction([x, y, z]),
        ([None, None, None], [Some(latitude), Some(longitude)]) => Columns::Place([latitude, longitude]),
        _ => {
            let wrong =
                "the first line names neither x, y and z nor latitude and longitude alone; give one set of them";
            return Err(table.bad_head(wrong));
        }
    };
    let mut found = SunPath::new(path, angular_radius_deg, axes);
    for row in table.rows() {
        let [strength] = row.numbers([irradiance])?;
        let place = match columns {
            Columns::Direction(places) => SunPlace::Direction(DVec3::from_array(row.numbers(places)?)),
            Columns::Place(places) => {
                let [latitude, longitude] = row.numbers(places)?;
                SunPlace::OnEarth { latitude, longitude }
            }
        };
        found
            .push(row.line(), row.text(time), place, strength)
            .map_err(|(key, reason)| match setting_of(key) {
                Some(parameter) => ReportError::BadSetting {
                    path: path.to_owned(),
                    parameter,
                    reason,
                },
                None => row.bad(format!("{key}: {reason}")),
            })?;
    }
    if found.steps.is_empty() {
        return Err(table.bad_head("no rows below the line of names; add one for each time"));
    }
    Ok(found)
}

/// Returns the setting of a value that no row contains.
fn setting_of(key: &str) -> Option<Parameter> {
    match key {
        "north" => Some(Parameter::North),
        "angular_radius_deg" => Some(Parameter::AngularRadius),
        _ => None,
    }
}
