//! Temperatures and fluxes of patches, surfaces and the scene, from both bands.

use super::band::{Band, Enclosure};
use super::boundary::Boundary;
use super::error::HeatError;
use super::network::Network;
use super::summary::{HeatBalance, Patches, SurfaceHeat};
use super::sunlight::Sunlight;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// The irradiance straight from sun and sky.
#[derive(Clone, Debug)]
pub(crate) struct DirectLight {
    pub(crate) sun: Option<Sunlight>,
    /// The irradiance from the sky, and its error, W·m⁻², \[n\].
    pub(crate) sky: [Vec<f64>; 2],
}

impl DirectLight {
    /// Returns the irradiance of both, and its error, W·m⁻², \[n\].
    pub(crate) fn irradiance(&self) -> [Vec<f64>; 2] {
        let mut sum = self.sky.clone();
        if let Some(sun) = &self.sun {
            for (own, more) in sum.iter_mut().zip([&sun.irradiance, &sun.irradiance_error]) {
                own.iter_mut().zip(more).for_each(|(x, y)| *x += y);
            }
        }
        sum
    }
}

/// The heat of a scene.
#[derive(Clone, Debug)]
pub struct Heat {
    /// The heat of each surface.
    pub surfaces: Vec<SurfaceHeat>,
    /// The balance of the whole scene.
    pub balance: HeatBalance,
    /// The solar band.
    pub solar: Band,
    /// The thermal band.
    pub thermal: Band,
    /// Quantities of each patch by name, with the unit in the name; each with its error as `NAME_error`.
    pub patches: Vec<(&'static str, Vec<f64>)>,
    /// The greatest error of a surface's thermal irradiance by form factors and solver, relative to the larger of its emissive power and irradiance; infinite where unknown.
    pub relative_error: f64,
}

/// The input of the heat of a scene.
pub(crate) struct Solution<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) mesh: &'a Mesh,
    pub(crate) boundary: &'a Boundary,
    pub(crate) network: &'a Network,
    pub(crate) enclosure: Enclosure<'a>,
    pub(crate) direct: &'a DirectLight,
    pub(crate) solar: Band,
    pub(crate) thermal: Band,
}

impl Solution<'_> {
    /// Returns temperatures and fluxes.
    ///
    /// # Errors
    /// [`HeatError::BelowZero`].
    pub(crate) fn heat(self) -> Result<Heat, HeatError> {
        let absorbed = self.network.absorbed(&self.solar);
        let absorbed = absorbed.each_ref().map(Vec::as_slice);
        let thermal = self.network.thermal(&self.thermal, absorbed, self.scene, self.mesh)?;
        let patches = Patches {
            scene: self.scene,
            mesh: self.mesh,
            boundary: self.boundary,
            network: self.network,
            enclosure: self.enclosure,
            solar: &self.solar,
            thermal_band: &self.thermal,
            thermal: &thermal,
            absorbed,
            sunlight: self.direct.sun.as_ref(),
            sky_light: self.direct.sky.each_ref().map(Vec::as_slice),
            surroundings: super::emissive_power(self.boundary.surroundings_k),
        };
        let (surfaces, balance) = (patches.surfaces(), patches.balance());
        let relative_error = patches.relative_error();
        let columns = patches.columns();
        Ok(Heat {
            surfaces,
            balance,
            patches: columns,
            relative_error,
            solar: self.solar,
            thermal: self.thermal,
        })
    }
}

impl Patches<'_> {
    /// Returns the greatest error of a surface's mean irradiance, relative to the larger of that and its mean emissive power.
    fn relative_error(&self) -> f64 {
        let mut sums = vec![[0.0; 3]; self.scene.surfaces.len()];
        let band = self.thermal_band;
        for (i, patch) in self.mesh.patches.iter().enumerate() {
            let own = [band.own_errors[1][i], band.irradiance[i], self.thermal.power[i].value];
            for (sum, value) in sums[patch.surface.0 as usize].iter_mut().zip(own) {
                *sum += patch.area * value;
            }
        }
        let share = |[error, irradiance, power]: &[f64; 3]| {
            let whole = irradiance.abs().max(*power);
            if *error > 0.0 { error / whole } else { 0.0 }
        };
        sums.iter().map(share).fold(0.0, f64::max)
    }

    /// Returns the quantities of each patch.
    fn columns(&self) -> Vec<(&'static str, Vec<f64>)> {
        let n = self.mesh.n_patches();
        let temperatures: Vec<_> = self
            .thermal
            .power
            .iter()
            .map(|power| power.stated().temperature())
            .collect();
        let stated = |judged: &[super::thermal::Judged]| -> Vec<_> { judged.iter().map(|x| x.stated()).collect() };
        let (flux, supplied) = (stated(&self.thermal.net_flux), stated(&self.thermal.supplied));
        let (solar, thermal) = (self.solar, self.thermal_band);
        let all = |of: &dyn Fn(usize) -> f64| (0..n).map(of).collect::<Vec<f64>>();
        let mut columns = vec![
            ("temperature_k", all(&|i| temperatures[i].value)),
            ("temperature_k_error", all(&|i| temperatures[i].error)),
            ("net_flux_w_m2", all(&|i| flux[i].value)),
            ("net_flux_w_m2_error", all(&|i| flux[i].error)),
            ("supplied_w_m2", all(&|i| supplied[i].value)),
            ("supplied_w_m2_error", all(&|i| supplied[i].error)),
            ("irradiance_w_m2", thermal.irradiance.clone()),
            ("irradiance_w_m2_error", all(&|i| thermal.irradiance_error_with_mesh(i))),
            ("radiosity_w_m2", thermal.radiosity.clone()),
            ("solar_irradiance_w_m2", solar.irradiance.clone()),
            (
                "solar_irradiance_w_m2_error",
                all(&|i| solar.irradiance_error_with_mesh(i)),
            ),
            ("solar_radiosity_w_m2", solar.radiosity.clone()),
            ("absorbed_solar_w_m2", self.absorbed[0].to_vec()),
            ("absorbed_solar_w_m2_error", self.absorbed[1].to_vec()),
            ("sky_irradiance_w_m2", self.sky_light[0].to_vec()),
            ("sky_irradiance_w_m2_error", self.sky_light[1].to_vec()),
            ("sky_factor", all(&|i| self.enclosure.sky[i].value)),
            ("sky_factor_error", all(&|i| self.enclosure.sky[i].error())),
            ("emissivity", self.network.emissivity.clone()),
            ("absorptance", self.network.absorptance.clone()),
        ];
        if let Some(sun) = self.sunlight {
            columns.extend([
                ("sunlit_fraction", sun.fraction.clone()),
                ("sunlit_fraction_error", sun.fraction_error.clone()),
                ("sun_irradiance_w_m2", sun.irradiance.clone()),
                ("sun_irradiance_w_m2_error", sun.irradiance_error.clone()),
            ]);
        }
        columns
    }
}
