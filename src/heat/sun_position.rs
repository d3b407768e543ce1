//! The position of the sun, by place and time.

use glam::DVec3;
use solar_positioning::time::JulianDate;
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};
use toml::value::{Datetime, Offset};

/// Minutes in a day.
const DAY: f64 = 1440.0;

/// The Julian date of 1970-01-01T00:00:00Z.
const UNIX_EPOCH: f64 = 2_440_587.5;

/// Returns the unit vector towards the sun at a place on Earth, degrees north and east, and a `time` in RFC 3339, such as 2026-06-21T12:00:00+02:00.
///
/// `axes`: the directions north and up in the scene. The result has the sun's azimuth and its height with standard refraction, by the algorithm of the National Renewable Energy Laboratory, to
/// 0.0003°.
/// Source: I. Reda, A. Andreas, "Solar position algorithm for solar radiation applications", Solar Energy 76(5), 2004, by the crate `solar-positioning`. Departures: none.
///
/// # Errors
/// The name of the value and the fault: `latitude` or `longitude` out of range, a `time` that is not RFC 3339 or at which the sun is below the horizon, a `north` along `up`.
pub fn sun_direction(place: (f64, f64), time: &str, axes: [DVec3; 2]) -> Result<DVec3, (&'static str, String)> {
    let SunPosition {
        direction, height_deg, ..
    } = sun_position(place, time, axes)?;
    if height_deg > 0.0 {
        return Ok(direction);
    }
    let wrong = format!(
        "the sun is {:.1}° below the horizon then; choose a time of the day",
        -height_deg
    );
    Err(("time", wrong))
}

/// The position of the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SunPosition {
    /// The unit vector towards it.
    pub(crate) direction: DVec3,
    /// Its height above the horizon, degrees; negative below.
    pub(crate) height_deg: f64,
    /// The time, s from 1970-01-01T00:00:00Z without leap seconds, to a millisecond.
    pub(crate) time_s: f64,
}

/// Returns the position of the sun as [`sun_direction`] does, also below the horizon.
pub(crate) fn sun_position(
    (latitude, longitude): (f64, f64),
    time: &str,
    [north, up]: [DVec3; 2],
) -> Result<SunPosition, (&'static str, String)> {
    if !(-90.0..=90.0).contains(&latitude) {
        return Err(("latitude", format!("{latitude} is outside [-90, 90]; correct it")));
    }
    if !(-180.0..=180.0).contains(&longitude) {
        return Err(("longitude", format!("{longitude} is outside [-180, 180]; correct it")));
    }
    let up = up.normalize_or_zero();
    let north = (north - up * north.dot(up)).normalize_or_zero();
    if !north.is_normalized() {
        return Err(("north", "zero, or along up; give another direction".to_owned()));
    }
    let no_time = |why: String| ("time", format!("{why}; write it as 2026-06-21T12:00:00+02:00"));
    let julian = julian(time).map_err(no_time)?;
    let place = Location { latitude, longitude };
    let position = SolarPositions::new()
        .at_from_julian(julian, place, 0.0, Some(RefractionCorrection::standard()))
        .map_err(|error| no_time(error.to_string()))?;
    let (height, azimuth) = (position.elevation_angle(), position.azimuth());
    let ((sin_h, cos_h), (sin_a, cos_a)) = (height.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
    Ok(SunPosition {
        direction: cos_h * (cos_a * north + sin_a * north.cross(up)) + sin_h * up,
        height_deg: height,
        time_s: since_1970(&julian),
    })
}

/// Returns a time in RFC 3339 in s from 1970-01-01T00:00:00Z without leap seconds, to a millisecond.
///
/// # Errors
/// The name `time`, and the fault.
pub(super) fn seconds(time: &str) -> Result<f64, (&'static str, String)> {
    let found = julian(time).map_err(|why| ("time", format!("{why}; write it as 2026-06-21T12:00:00+02:00")))?;
    Ok(since_1970(&found))
}

/// Returns seconds from 1970, rounded to a millisecond: a Julian date in f64 resolves 40 µs.
fn since_1970(date: &JulianDate) -> f64 {
    ((date.julian_date() - UNIX_EPOCH) * DAY * 60.0 * 1e3).round() / 1e3
}

/// Returns a time in RFC 3339 as a Julian date.
fn julian(time: &str) -> Result<JulianDate, String> {
    let parsed: Datetime = time
        .trim()
        .parse()
        .map_err(|_| format!("`{time}` is no time in RFC 3339"))?;
    let Datetime {
        date: Some(date),
        time: Some(clock),
        offset: Some(offset),
    } = parsed
    else {
        return Err(format!(
            "`{time}` has no date, no time of the day or no offset from UTC"
        ));
    };
    let second = f64::from(clock.second.unwrap_or(0)) + 1e-9 * f64::from(clock.nanosecond.unwrap_or(0));
    let [month, day, hour, minute] = [date.month, date.day, clock.hour, clock.minute].map(u32::from);
    let year = i32::from(date.year);
    let known = |error: solar_positioning::Error| error.to_string();
    let shift = delta_t::estimate_from_date(year, month).map_err(known)?;
    // A leap second counts as the end of the second before it.
    let local = JulianDate::from_utc(year, month, day, hour, minute, second.min(59.999), shift).map_err(known)?;
    let minutes = match offset {
        Offset::Z => 0.0,
        Offset::Custom { minutes } => f64::from(minutes),
    };
    JulianDate::new(local.julian_date() - minutes / DAY, shift).map_err(known)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    const AXES: [DVec3; 2] = [DVec3::Y, DVec3::Z];

    /// Tests noon in Golden, Colorado, as in the paper's appendix (A.5): azimuth 194.34024°, zenith 50.11162°.
    ///
    /// The paper's refraction is that of 820 mbar and 11 °C; the tolerance covers the difference to the standard atmosphere.
    #[test]
    fn the_papers_example_comes_out() {
        let found = sun_direction((39.742_476, -105.178_6), "2003-10-17T12:30:30-07:00", AXES).unwrap();
        let (zenith, azimuth) = (50.111_62_f64.to_radians(), 194.340_24_f64.to_radians());
        let expected = DVec3::new(zenith.sin() * azimuth.sin(), zenith.sin() * azimuth.cos(), zenith.cos());
        assert!(found.distance(expected) < 0.01_f64.to_radians(), "{found} {expected}");
        assert!((found.length() - 1.0).abs() < 1e-14);
        let same = sun_direction((39.742_476, -105.178_6), "2003-10-17T19:30:30Z", AXES).unwrap();
        assert!(found.distance(same) < 1e-9, "the same moment");
        let turned = sun_direction((39.742_476, -105.178_6), "2003-10-17T19:30:30Z", [DVec3::X, DVec3::Y]).unwrap();
        assert!(
            turned.distance(DVec3::new(found.y, found.z, found.x)) < 1e-12,
            "{turned} {found}"
        );
    }

    #[test]
    fn what_is_no_place_or_time_is_refused() {
        let key = |place, time, axes| sun_direction(place, time, axes).unwrap_err().0;
        let noon = "2026-06-21T12:00:00Z";
        assert_eq!(key((91.0, 0.0), noon, AXES), "latitude");
        assert_eq!(key((0.0, f64::NAN), noon, AXES), "longitude");
        assert_eq!(key((0.0, 0.0), noon, [DVec3::Z, DVec3::Z]), "north");
        for time in [
            "noon",
            "2026-06-21",
            "2026-06-21T12:00:00",
            "2026-13-21T12:00:00Z",
            "2026-06-21T00:00:00Z",
        ] {
            assert_eq!(key((10.0, 0.0), time, AXES), "time", "{time}");
        }
    }
}
