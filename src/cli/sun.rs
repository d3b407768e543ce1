//! Sun and sky by flags.

use glam::DVec3;

use super::args::SunArgs;
use super::failure::Failure;
use crate::heat::{Sky, Sun, sun_direction};
use crate::workflow::{Daylight, SkyRequest, SunRequest, is_grey};

/// Returns the sun that the flags request, in a scene where `up` is up.
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

/// Returns the sky that the flags request, in a scene where `up` is up.
pub(super) fn sky(args: &SunArgs, up: DVec3) -> Result<Option<SkyRequest>, Failure> {
    let made = args.sky.map(|irradiance| {
        let greatest = irradiance.into_iter().fold(0.0, f64::max);
        let sky = Sky::new(greatest, up)?;
        Ok(SkyRequest { sky, irradiance })
    });
    made.transpose()
        .map_err(|(_, wrong): (&str, String)| Failure::usage(format!("--sky: {wrong}")))
}

/// Returns the sun and sky that the flags request, where +z is up.
pub(super) fn daylight(args: &SunArgs) -> Result<Daylight, Failure> {
    Ok(Daylight {
        sun: sun(args, DVec3::Z)?,
        sky: sky(args, DVec3::Z)?,
    })
}

/// Refuses colours, as there is one solar band.
pub(super) fn expect_grey(args: &SunArgs) -> Result<(), Failure> {
    for (flag, channels) in [("--sun-irradiance", args.sun_irradiance), ("--sky", args.sky)] {
        if channels.is_some_and(|channels| !is_grey(channels)) {
            return Err(Failure::usage(format!(
                "{flag}: heat has one solar band; give one number"
            )));
        }
    }
    Ok(())
}
