//! Bounds that hold for every pixel of a picture, whatever its patches are.

use super::points::Reference;
use crate::render::attributes::PolygonRecord;
use crate::render::direct::DirectMethod;

/// How far interpolated light may leave its bounds, as a share of them, where the file states its error: room for the solver's own tolerance.
const STATED: f64 = 0.01;

/// The same where it states none: rough form factors have rows whose sum is well above 1.
const UNSTATED: f64 = 10.0;

/// How far irradiance may fall below the direct light, as a share of the largest exitance, where no error is stated.
const UNSTATED_BELOW: f64 = 0.05;

/// The upper bound of a pixel's light, channel by channel.
pub(super) struct Limits {
    /// The most direct irradiance.
    pub(super) direct: [f64; 3],
    /// The most that its standard error can be.
    pub(super) noise: [f64; 3],
    /// The most irradiance: that of a furnace, max E / (1 - ρ), and what errors may add; infinite where an emitter reflects everything.
    pub(super) irradiance: [f64; 3],
    /// How far irradiance may fall below the direct light by an error of the solution.
    pub(super) slack: [f64; 3],
    /// The largest exitance.
    pub(super) exitance: [f64; 3],
    /// The least and the largest reflectance.
    pub(super) reflectance: [[f64; 2]; 3],
}

impl Limits {
    /// Returns the bounds of a scene; `error` is what the image states of its solution's error.
    pub(super) fn new(reference: &Reference<'_>, error: Option<[&[f32]; 3]>) -> Self {
        let attributes = reference.attributes();
        let records = || attributes.surfaces.iter().flat_map(|surface| &surface.polygons);
        let most = |of: &dyn Fn(&PolygonRecord) -> f64| records().map(of).fold(0.0, f64::max);
        let brightest = [0, 1, 2].map(|c| most(&|record| record.exitance[c]));
        let total = [0, 1, 2].map(|c| records().map(|record| record.exitance[c]).sum());
        // Where each emitter's visibility is estimated by itself, two that hide each other may both count.
        let direct = match attributes.render.direct {
            DirectMethod::Polygons { .. } => total,
            _ => brightest,
        };
        let noise = match attributes.render.direct {
            DirectMethod::Exact => [0.0; 3],
            _ => total,
        };
        let stated =
            error.map(|channels| channels.map(|channel| channel.iter().copied().map(f64::from).fold(0.0, f64::max)));
        let any = brightest.into_iter().fold(0.0, f64::max);
        let irradiance = [0, 1, 2].map(|c| {
            // If the brightest patch k has B = E + ρ H, and H is at most its own B, then B is at most E / (1 - ρ) of that patch.
            let furnace = most(&|record| match record.exitance[c] {
                e if e > 0.0 => e / (1.0 - record.reflectance[c]).max(0.0),
                _ => 0.0,
            });
            let own = match stated {
                Some(errors) => (1.0 + STATED) * furnace + errors[c],
                None if reference.nothing_reflects() => furnace,
                None => UNSTATED * furnace,
            };
            // Where methods count direct light twice, so does their irradiance.
            own + (direct[c] - brightest[c]) + 1e-6 * any
        });
        let slack = [0, 1, 2].map(|c| match stated {
            Some(errors) => STATED * brightest[c] + errors[c],
            None if reference.nothing_reflects() => 0.0,
            None => UNSTATED_BELOW * brightest[c],
        });
        Self {
            direct: direct.map(|bound| bound * (1.0 + 1e-6)),
            noise,
            irradiance,
            slack: slack.map(|slack| slack + 1e-6 * any),
            exitance: brightest,
            reflectance: [0, 1, 2].map(|c| {
                let least = records().map(|record| record.reflectance[c]).fold(1.0, f64::min);
                [least, most(&|record| record.reflectance[c])]
            }),
        }
    }
}
