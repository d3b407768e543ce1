//! The results of surfaces and of the whole scene, each with its error.

use serde::{Deserialize, Serialize};

use super::band::{Band, Enclosure};
use super::boundary::{Boundary, Condition};
use super::network::Network;
use super::sunlight::Sunlight;
use super::thermal::{Judged, Stated, Thermal};
use crate::matrix::roundings;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// The heat of one surface. Errors are those of form factors, solver and mesh together; `null` where nothing is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SurfaceHeat {
    /// The surface.
    pub name: String,
    /// A, m².
    pub area_m2: f64,
    /// ε, thermal band.
    pub emissivity: f64,
    /// α, solar band.
    pub absorptance: f64,
    /// T from the mean of T⁴ over the surface, K.
    pub temperature_k: f64,
    /// Its error, K.
    pub temperature_k_error: f64,
    /// The least T of a patch, K.
    pub temperature_min_k: f64,
    /// Its error, K.
    pub temperature_min_k_error: f64,
    /// The greatest T of a patch, K.
    pub temperature_max_k: f64,
    /// Its error, K.
    pub temperature_max_k_error: f64,
    /// q = B − H of the thermal band, leaving, W·m⁻².
    pub net_flux_w_m2: f64,
    /// Its error, W·m⁻².
    pub net_flux_w_m2_error: f64,
    /// q A, W.
    pub net_heat_w: f64,
    /// Its error, W.
    pub net_heat_w_error: f64,
    /// The net heat less the absorbed solar heat, W.
    pub supplied_w: f64,
    /// Its error, W.
    pub supplied_w_error: f64,
    /// H of the thermal band, W·m⁻².
    pub irradiance_w_m2: f64,
    /// Its error, W·m⁻².
    pub irradiance_w_m2_error: f64,
    /// The absorbed solar heat, W.
    pub absorbed_solar_w: f64,
    /// Its error, W.
    pub absorbed_solar_w_error: f64,
    /// The fraction of the area that the sun lights; `None` without a sun.
    pub sunlit_fraction: Option<f64>,
    /// Its error.
    pub sunlit_fraction_error: Option<f64>,
    /// The fraction of what leaves the surface that escapes from the scene: the sky view factor.
    pub sky_factor: f64,
    /// Its error.
    pub sky_factor_error: f64,
}

/// The heat of the whole scene, both bands together, W. Errors as of [`SurfaceHeat`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct HeatBalance {
    /// The power supplied to all surfaces.
    pub supplied_w: f64,
    /// Its error.
    pub supplied_w_error: f64,
    /// The power straight from the sun.
    pub sun_w: f64,
    /// Its error.
    pub sun_w_error: f64,
    /// The power straight from the sky.
    pub sky_w: f64,
    /// Its error.
    pub sky_w_error: f64,
    /// The power from the surroundings.
    pub from_surroundings_w: f64,
    /// Its error.
    pub from_surroundings_w_error: f64,
    /// The power that escapes.
    pub escaped_w: f64,
    /// Its error.
    pub escaped_w_error: f64,
    /// The power that black back faces absorb, at 0 K.
    pub absorbed_by_backs_w: f64,
    /// Its error.
    pub absorbed_by_backs_w_error: f64,
    /// Supplied + sun + sky + from surroundings − escaped − absorbed by backs: 0.
    pub energy_balance_w: f64,
    /// How far it may be off 0: by the solver's residual, rows that do not sum to 1, form factors without reciprocity, and rounding.
    pub energy_balance_w_error: f64,
}

/// The input of the results, by patches.
pub(super) struct Patches<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: &'a Mesh,
    pub(super) boundary: &'a Boundary,
    pub(super) network: &'a Network,
    pub(super) enclosure: Enclosure<'a>,
    pub(super) solar: &'a Band,
    pub(super) thermal_band: &'a Band,
    pub(super) thermal: &'a Thermal,
    pub(super) absorbed: [&'a [f64]; 2],
    pub(super) sunlight: Option<&'a Sunlight>,
    /// The irradiance straight from the sky and its error, W·m⁻².
    pub(super) sky_light: [&'a [f64]; 2],
    /// The radiosity of the surroundings, W·m⁻².
    pub(super) surroundings: f64,
}

/// Sums over the patches of one surface.
#[derive(Clone, Copy, Default)]
struct Sums {
    area: f64,
    emissivity: f64,
    absorptance: f64,
    power: Judged,
    net_flux: Judged,
    supplied: Judged,
    irradiance: Judged,
    absorbed: Judged,
    lit: Judged,
    sky: Judged,
    coldest: Option<Extreme>,
    hottest: Option<Extreme>,
}

/// The least, or the greatest, of some values, and the range allowed by their errors.
#[derive(Clone, Copy)]
struct Extreme {
    value: f64,
    low: f64,
    high: f64,
}

impl Extreme {
    fn of(values: Option<Self>, next: Stated, choose: fn(f64, f64) -> f64) -> Self {
        let own = Self {
            value: next.value,
            low: next.value - next.error,
            high: next.value + next.error,
        };
        values.map_or(own, |old| Self {
            value: choose(old.value, own.value),
            low: choose(old.low, own.low),
            high: choose(old.high, own.high),
        })
    }

    fn stated(self) -> Stated {
        Stated {
            value: self.value,
            error: (self.value - self.low).max(self.high - self.value),
        }
    }
}

impl Patches<'_> {
    /// Returns the results of each surface.
    pub(super) fn surfaces(&self) -> Vec<SurfaceHeat> {
        let mut sums = vec![Sums::default(); self.scene.surfaces.len()];
        for (i, patch) in self.mesh.patches.iter().enumerate() {
            self.add(&mut sums[patch.surface.0 as usize], i, patch.area);
        }
        sums.iter().enumerate().map(|(k, sums)| self.surface(k, sums)).collect()
    }

    fn add(&self, sums: &mut Sums, i: usize, area: f64) {
        let temperature = self.thermal.power[i].stated().temperature();
        let certain = |value: f64, error: f64| Judged {
            value,
            error,
            change: 0.0,
        };
        sums.area += area;
        sums.emissivity += area * self.network.emissivity[i];
        sums.absorptance += area * self.network.absorptance[i];
        sums.power.add(area, self.thermal.power[i]);
        sums.net_flux.add(area, self.thermal.net_flux[i]);
        sums.supplied.add(area, self.thermal.supplied[i]);
        sums.absorbed
            .add(area, certain(self.absorbed[0][i], self.absorbed[1][i]));
        let band = self.thermal_band;
        let change = band.mesh_change.as_ref().map_or(0.0, |change| change[i]);
        let irradiance = Judged {
            change,
            ..certain(band.irradiance[i], band.irradiance_error[i])
        };
        sums.irradiance.add(area, irradiance);
        if let Some(sun) = self.sunlight {
            sums.lit.add(area, certain(sun.fraction[i], sun.fraction_error[i]));
        }
        let sky = self.enclosure.sky[i];
        sums.sky.add(area, certain(sky.value, sky.error()));
        sums.coldest = Some(Extreme::of(sums.coldest, temperature, f64::min));
        sums.hottest = Some(Extreme::of(sums.hottest, temperature, f64::max));
    }

    fn surface(&self, k: usize, sums: &Sums) -> SurfaceHeat {
        let mean = |sum: Judged| {
            let mut mean = Judged::default();
            if sums.area > 0.0 {
                mean.add(1.0 / sums.area, sum);
            }
            mean.stated()
        };
        let extreme = |found: Option<Extreme>| found.map_or(Stated::default(), Extreme::stated);
        let (temperature, flux, irradiance) = (
            mean(sums.power).temperature(),
            mean(sums.net_flux),
            mean(sums.irradiance),
        );
        let [heat, supplied, absorbed] = [sums.net_flux, sums.supplied, sums.absorbed].map(Judged::stated);
        let [coldest, hottest] = [sums.coldest, sums.hottest].map(extreme);
        let (lit, sky) = (self.sunlight.map(|_| mean(sums.lit)), mean(sums.sky));
        let own = self.boundary.surfaces[k];
        // The area means, where patches differ.
        let values = self.boundary.patch_values.get(k);
        let [emissivity, absorptance] = [
            (
                values.is_some_and(|values| !values.emissivity.is_empty()),
                sums.emissivity,
            ),
            (
                values.is_some_and(|values| !values.absorptance.is_empty()),
                sums.absorptance,
            ),
        ]
        .map(|(differ, sum)| (differ && sums.area > 0.0).then(|| sum / sums.area));
        // A given temperature is returned without rounding.
        let given = |found: Stated| match own.map(|own| own.condition) {
            Some(Condition::Temperature(kelvin)) if !self.boundary.has_patch_conditions(k) => Stated {
                value: kelvin,
                error: 0.0,
            },
            _ => found,
        };
        let [temperature, coldest, hottest] = [temperature, coldest, hottest].map(given);
        SurfaceHeat {
            name: self.scene.surfaces[k].name.clone(),
            area_m2: sums.area,
            emissivity: emissivity.unwrap_or_else(|| own.map_or(1.0, |own| own.emissivity)),
            absorptance: absorptance.unwrap_or_else(|| own.map_or(1.0, |own| own.absorptance)),
            temperature_k: temperature.value,
            temperature_k_error: temperature.error,
            temperature_min_k: coldest.value,
            temperature_min_k_error: coldest.error,
            temperature_max_k: hottest.value,
            temperature_max_k_error: hottest.error,
            net_flux_w_m2: flux.value,
            net_flux_w_m2_error: flux.error,
            net_heat_w: heat.value,
            net_heat_w_error: heat.error,
            supplied_w: supplied.value,
            supplied_w_error: supplied.error,
            irradiance_w_m2: irradiance.value,
            irradiance_w_m2_error: irradiance.error,
            absorbed_solar_w: absorbed.value,
            absorbed_solar_w_error: absorbed.error,
            sunlit_fraction: lit.map(|lit| lit.value),
            sunlit_fraction_error: lit.map(|lit| lit.error),
            sky_factor: sky.value,
            sky_factor_error: sky.error,
        }
    }

    /// Returns the balance of the whole scene.
    ///
    /// With q = B − H + r, H = F B + D and g the gain by form factors without reciprocity, Σ A (q − absorbed) + Σ A (sun + sky + surroundings) − Σ A B (sky + back) =
    /// Σ A r + Σ A B (1 − Σ_j F_ij − sky − back) − Σ B g, over both bands. The stated error is the sum of the sizes of these terms, and rounding.
    pub(super) fn balance(&self) -> HeatBalance {
        let areas = self.enclosure.factors.areas();
        let row_sums = self.enclosure.row_sums();
        let mut balance = HeatBalance::default();
        let (mut rows, mut gained, mut moved) = (0.0, 0.0, 0.0);
        let mut supplied = Judged::default();
        for (i, &area) in areas.iter().enumerate() {
            supplied.add(area, self.thermal.supplied[i]);
            if let Some(sun) = self.sunlight {
                balance.sun_w += area * sun.irradiance[i];
                balance.sun_w_error += area * sun.irradiance_error[i];
            }
            balance.sky_w += area * self.sky_light[0][i];
            balance.sky_w_error += area * self.sky_light[1][i];
            let [sky, back] = [self.enclosure.sky[i], self.enclosure.backs[i]];
            balance.from_surroundings_w += area * sky.value * self.surroundings;
            balance.from_surroundings_w_error += area * sky.error() * self.surroundings;
            let bands = [self.solar, self.thermal_band];
            let light: f64 = bands.iter().map(|band| band.radiosity[i]).sum();
            let light_error: f64 = bands.iter().map(|band| band.radiosity_error[i]).sum();
            let irradiance: f64 = bands.iter().map(|band| band.irradiance[i]).sum();
            balance.escaped_w += area * light * sky.value;
            balance.escaped_w_error += area * product_error(light, light_error, sky.value, sky.error());
            balance.absorbed_by_backs_w += area * light * back.value;
            balance.absorbed_by_backs_w_error += area * product_error(light, light_error, back.value, back.error());
            rows += area * light.abs() * (1.0 - row_sums[i] - sky.value - back.value).abs();
            gained += light * self.enclosure.gain[i];
            moved += area * (light.abs() + irradiance.abs() + self.thermal.supplied[i].value.abs());
        }
        balance.supplied_w = supplied.value;
        balance.supplied_w_error = supplied.stated().error;
        let rounding = 4.0 * roundings(areas.len()) * f64::EPSILON * moved;
        balance.energy_balance_w = balance.supplied_w + balance.sun_w + balance.sky_w + balance.from_surroundings_w
            - balance.escaped_w
            - balance.absorbed_by_backs_w;
        let residual = self.solar.residual_power + self.thermal_band.residual_power;
        balance.energy_balance_w_error = residual + rows + gained.abs() + rounding;
        balance
    }
}

/// Returns the error of a product; 0 times an unknown error is 0.
fn product_error(a: f64, a_error: f64, b: f64, b_error: f64) -> f64 {
    let carried = if b.abs() > 0.0 { b.abs() * a_error } else { 0.0 };
    a.abs() * b_error + carried
}
