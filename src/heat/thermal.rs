//! Temperatures and net fluxes from the irradiance of the thermal band.

use super::band::Band;
use super::error::HeatError;
use super::network::{Group, Network, State};
use super::{emissive_power, temperature};
use crate::matrix::roundings;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// A value with its error by form factors and solver, and its change by a coarser mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Judged {
    pub(super) value: f64,
    pub(super) error: f64,
    pub(super) change: f64,
}

impl Judged {
    /// Returns a given value, without error.
    fn certain(value: f64) -> Self {
        Self {
            value,
            error: 0.0,
            change: 0.0,
        }
    }

    fn with_error(self, error: f64) -> Self {
        Self { error, ..self }
    }

    /// Returns the value with an error that includes the mesh's.
    pub(super) fn stated(self) -> Stated {
        Stated {
            value: self.value,
            error: self.error + self.change.abs(),
        }
    }

    /// Adds another value with a weight above 0, and the sizes of changes: signed changes may cancel by chance.
    pub(super) fn add(&mut self, weight: f64, other: Self) {
        self.value += weight * other.value;
        self.error += weight * other.error;
        self.change += weight * other.change.abs();
    }
}

/// A value with its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stated {
    /// The value.
    pub value: f64,
    /// An estimate of its absolute error; infinite where unknown.
    pub error: f64,
}

impl Stated {
    /// Returns T of an emissive power σ T⁴ and its error.
    pub(super) fn temperature(self) -> Self {
        let [low, value, high] = [-self.error, 0.0, self.error].map(|off| temperature((self.value + off).max(0.0)));
        Self {
            value,
            error: (value - low).max(high - value),
        }
    }
}

/// The thermal quantities of each patch.
#[derive(Clone, Debug, Default)]
pub(super) struct Thermal {
    /// M = σ T⁴, W·m⁻².
    pub(super) power: Vec<Judged>,
    /// The net flux q = B − H, W·m⁻².
    pub(super) net_flux: Vec<Judged>,
    /// The heat supplied apart from the absorbed solar heat, W·m⁻².
    pub(super) supplied: Vec<Judged>,
}

impl Network {
    /// Returns the heat of each group and its error, W: its supplied heat and its absorbed solar heat.
    ///
    /// `absorbed`: the absorbed solar heat and its error, W·m⁻², \[n\].
    pub(super) fn heats(&self, absorbed: [&[f64]; 2]) -> Vec<[f64; 2]> {
        let of_group = |group: &Group| {
            let sum = |of: &[f64]| group.members.iter().map(|&(i, _)| self.areas()[i] * of[i]).sum::<f64>();
            [group.supplied + sum(absorbed[0]), sum(absorbed[1])]
        };
        self.groups.iter().map(of_group).collect()
    }

    /// Returns the absorbed solar heat of each patch and its error, W·m⁻², \[n\] each.
    pub(crate) fn absorbed(&self, solar: &Band) -> [Vec<f64>; 2] {
        let all = self.absorptance.iter().enumerate();
        let value = all.clone().map(|(i, absorptance)| absorptance * solar.irradiance[i]);
        let error = all.map(|(i, absorptance)| absorptance * solar.irradiance_error_with_mesh(i));
        [value.collect(), error.collect()]
    }

    /// Returns the error of the absorbed solar heat by form factors and solver, without the mesh's, W·m⁻², \[n\].
    pub(crate) fn absorbed_own_error(&self, solar: &Band) -> Vec<f64> {
        let all = self.absorptance.iter().zip(&solar.own_errors[1]);
        all.map(|(absorptance, error)| absorptance * error).collect()
    }

    /// Returns temperatures and fluxes of all patches from the thermal band; `absorbed`: the absorbed solar heat and its error, W·m⁻².
    ///
    /// M = H + q / ε where q is known, M = Q / S + Σ w H for a group; q = ε (M − H). This avoids the small difference of B and H.
    ///
    /// # Errors
    /// [`HeatError::BelowZero`].
    pub(super) fn thermal(
        &self,
        band: &Band,
        absorbed: [&[f64]; 2],
        scene: &Scene,
        mesh: &Mesh,
    ) -> Result<Thermal, HeatError> {
        let heats = self.heats(absorbed);
        let powers = self.group_powers(band, &heats, scene, mesh)?;
        let mut thermal = Thermal::default();
        for (i, state) in self.state.iter().enumerate() {
            let irradiance = Judged {
                value: band.irradiance[i],
                error: band.irradiance_error[i],
                change: band.mesh_change.as_ref().map_or(0.0, |change| change[i]),
            };
            let solar = [absorbed[0][i], absorbed[1][i]];
            let given = |(power, flux): (Judged, Judged)| {
                let supplied = Judged {
                    value: flux.value - solar[0],
                    error: flux.error + solar[1],
                    change: flux.change,
                };
                (power, flux, supplied)
            };
            let (power, flux, supplied) = match *state {
                State::Given(kelvin) => given(self.of_given(i, kelvin, irradiance)),
                State::Member(group) if self.groups[group].members.len() == 1 => {
                    let per_area = |heat: f64| heat / self.areas()[i];
                    let flux = Judged::certain(per_area(heats[group][0])).with_error(per_area(heats[group][1]));
                    let supplied = Judged::certain(per_area(self.groups[group].supplied));
                    (powers[group], flux, supplied)
                }
                State::Member(group) => {
                    let known = (powers[group], heats[group][0]);
                    given((powers[group], self.of_member(i, &self.groups[group], known, band)))
                }
            };
            thermal.power.push(power);
            thermal.net_flux.push(flux);
            thermal.supplied.push(supplied);
        }
        Ok(thermal)
    }

    /// Returns M of each group.
    fn group_powers(
        &self,
        band: &Band,
        heats: &[[f64; 2]],
        scene: &Scene,
        mesh: &Mesh,
    ) -> Result<Vec<Judged>, HeatError> {
        let of_group = |(group, &[heat, heat_error]): (&Group, &[f64; 2])| {
            let arriving = group.mean(&band.irradiance);
            let power = Judged {
                value: heat / group.absorbing + arriving,
                error: heat_error / group.absorbing + group.mean(&band.irradiance_error),
                change: band.mesh_change.as_ref().map_or(0.0, |change| group.mean(change)),
            };
            if power.value + power.stated().error < 0.0 {
                let patch = group.members[0].0;
                let surface = mesh.patches[patch].surface.0 as usize;
                return Err(HeatError::BelowZero {
                    surface: scene.surfaces[surface].name.clone(),
                    taken: -heat / group.absorbing * self.emissivity[patch],
                    // Where other patches would be below absolute zero too, this can be negative.
                    arriving: (arriving * self.emissivity[patch]).max(0.0),
                });
            }
            Ok(Judged {
                value: power.value.max(0.0),
                ..power
            })
        };
        self.groups.iter().zip(heats).map(of_group).collect()
    }

    /// Returns M and q of a patch of a given temperature.
    fn of_given(&self, i: usize, kelvin: f64, irradiance: Judged) -> (Judged, Judged) {
        let (emissivity, value) = (self.emissivity[i], emissive_power(kelvin));
        let flux = Judged {
            value: emissivity * (value - irradiance.value),
            error: emissivity * irradiance.error,
            change: -emissivity * irradiance.change,
        };
        (Judged::certain(value), flux)
    }

    /// Returns q of a patch in a group of one temperature; `heat` is its share Q / S of the group's heat.
    ///
    /// M − H = Q / S + Σ_j w_j (H_j − H). The sum is evaluated in this form where the patch has most of the weight, as M then nearly equals its own H.
    fn of_member(&self, i: usize, group: &Group, (power, heat): (Judged, f64), band: &Band) -> Judged {
        let emissivity = self.emissivity[i];
        let own = band.irradiance[i];
        let own_error = band.irradiance_error[i];
        let own_change = band.mesh_change.as_ref().map_or(0.0, |change| change[i]);
        let weight = self.areas()[i] * emissivity / group.absorbing;
        let share = heat / group.absorbing;
        let others = group.members.iter().filter(|(j, _)| *j != i);
        let (above, terms) = if weight > 0.5 {
            others.fold((share, share.abs()), |(sum, terms), &(j, w)| {
                let other = band.irradiance[j];
                (sum + w * (other - own), terms + w * (other.abs() + own.abs()))
            })
        } else {
            (power.value - own, share.abs() + power.value.abs() + own.abs())
        };
        // Both terms of M − H contain the patch's own irradiance.
        let carried = power.error - weight * own_error + (1.0 - weight) * own_error;
        let rounding = roundings(group.members.len()) * f64::EPSILON * terms;
        Judged {
            value: emissivity * above,
            error: emissivity
                * if own_error.is_finite() {
                    carried.max(0.0) + rounding
                } else {
                    f64::INFINITY
                },
            change: emissivity * (power.change - own_change),
        }
    }
}
