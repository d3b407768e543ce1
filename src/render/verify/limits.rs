//! Bounds of all pixels of an image, independent of its patches.

use super::points::Reference;
use crate::render::attributes::PolygonRecord;
use crate::render::direct::DirectMethod;

/// The relative excess over its bounds allowed to interpolated light where the file states its error; it covers the solver's own tolerance.
const STATED: f64 = 0.01;

/// The same where the file states no error: rough form factors have rows whose sum is well above 1.
const UNSTATED: f64 = 10.0;

/// The difference by which irradiance may fall below the direct light, as a share of the largest exitance, where no error is stated.
const UNSTATED_BELOW: f64 = 0.05;

/// The upper bound of a pixel's light, channel by channel.
pub(super) struct Limits {
    /// The greatest direct irradiance.
    pub(super) direct: [f64; 3],
    /// The greatest standard error of the direct irradiance.
    pub(super) noise: [f64; 3],
    /// The greatest irradiance: that of a furnace, max E / (1 - ρ), with an allowance for errors; infinite where an emitter reflects everything.
    pub(super) irradiance: [f64; 3],
    /// The difference by which irradiance may fall below the direct light, by an error of the solution.
    pub(super) slack: [f64; 3],
    /// The largest exitance.
    pub(super) exitance: [f64; 3],
    /// The least and the largest reflectance.
    pub(super) reflectance: [[f64; 2]; 3],
}

impl Limits {
    /// Returns the bounds of a scene; `error` is the error of the solution that the image states.
    pub(super) fn new(reference: &Reference<'_>, error: Option<[&[f32]; 3]>) -> Self {
        let attributes = reference.attributes;
        let records = || attributes.surfaces.iter().flat_map(|surface| &surface.polygons);
        let most = |of: &dyn Fn(&PolygonRecord) -> f64| records().map(of).fold(0.0, f64::max);
        let brightest = [0, 1, 2].map(|c| most(&|record| record.exitance[c]));
        let total = [0, 1, 2].map(|c| records().map(|record| record.exitance[c]).sum());
        // A method that estimates each emitter's visibility separately may count two that hide each other.
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
                None if reference.nothing_reflects => furnace,
                None => UNSTATED * furnace,
            };
            // Methods that count direct light twice do so in the irradiance as well.
            own + (direct[c] - brightest[c]) + 1e-6 * any
        });
        let slack = [0, 1, 2].map(|c| match stated {
            Some(errors) => STATED * brightest[c] + errors[c],
            None if reference.nothing_reflects => 0.0,
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
