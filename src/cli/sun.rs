//! The sun that flags ask for.

use glam::DVec3;

use super::args::SunArgs;
use super::failure::Failure;
use crate::heat::{Sun, sun_direction};
use crate::workflow::SunRequest;

/// Returns the sun that flags ask for, in a scene where `up` is up.
pub(super) fn sun(args: &SunArgs, up: DVec3) -> Result<Option<SunRequest>, Failure> {
    let made = args.sun_irradiance.map(|irradiance| {
        let direction = match (args.sun, args.latitude.zip(args.longitude), &args.time) {
            (None, Some(place), Some(time)) => sun_direction(place, time, [DVec3::from_array(args.north), up])?,
            (direction, ..) => DVec3::from_array(direction.unwrap_or_default()),
        };
        let greatest = irradiance.into_iter().fold(0.0, f64::max);
        let radius = args.sun_radius.unwrap_or(0.0);
        let sun = Sun::new(direction, greatest, radius)?;
        Ok(SunRequest { sun, irradiance })
    });
    made.transpose().map_err(|(key, wrong): (&str, String)| {
        let flag = match key {
            "direction" => "--sun",
            "irradiance_w_m2" => "--sun-irradiance",
            "angular_radius_deg" => "--sun-radius",
            other => return Failure::usage(format!("--{other}: {wrong}")),
        };
        Failure::usage(format!("{flag}: {wrong}"))
    })
}

/// Returns the sun of the one solar band.
pub(super) fn grey(request: SunRequest) -> Result<Sun, Failure> {
    if request.is_grey() {
        return Ok(request.sun);
    }
    Err(Failure::usage(
        "--sun-irradiance: heat has one solar band; give one number",
    ))
}
