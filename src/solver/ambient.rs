//! The ambient term: unshot light, as if it were spread evenly over its enclosure.

use super::deflation::leave_undetermined;
use super::scaled::Scaled;
use crate::matrix::operator::Block;

/// The sums of a system that the ambient term needs, by connected component and channel.
///
/// The ambient irradiance of unshot radiosities ΔB in an enclosure is
///
/// Ambient = Σ A s ΔB / Σ A (1 − ρ s), s_i = Σ_j F_ij:
///
/// of the unshot power Σ A ΔB the share Σ A s ΔB arrives, and an even irradiance loses A (1 − ρ s) at every patch, absorbed or let out. In a
/// closed room s = 1, and this is R Σ A ΔB / Σ A with R = 1 / (1 − ρ_avg), ρ_avg = Σ A ρ / Σ A. Where nothing is lost there is no even irradiance, and
/// the term is 0.
///
/// Source: Baranoski, Bramley and Shirley 1995, equations (9) to (11). Departures: by connected component, because light does not pass from one to
/// another; openings count, through s.
pub(super) struct Ambient<'a> {
    scaled: &'a Scaled<'a>,
    labels: &'a [u32],
    /// Σ A (1 − ρ s), \[components, c\]; 0 where that is rounding.
    lost: Block,
}

/// The share Σ A (1 − ρ s) / Σ A below which a loss is rounding.
///
/// Where ρ s is near 1, every term is off by one unit in the last place.
const LOST_FROM: f64 = f64::EPSILON;

impl<'a> Ambient<'a> {
    pub(super) fn new(scaled: &'a Scaled<'a>) -> Self {
        let system = scaled.system;
        let components = system.components();
        let mut lost = Block::zeros(components.n_components, system.n_channels());
        let mut areas = vec![0.0; components.n_components];
        for (i, (area, arriving)) in scaled.areas.iter().zip(system.row_sums()).enumerate() {
            let sums = lost.row_mut(components.labels[i] as usize);
            for (sum, rho) in sums.iter_mut().zip(system.reflectance().row(i)) {
                *sum += area * (1.0 - rho * arriving);
            }
            areas[components.labels[i] as usize] += area;
        }
        for (room, area) in areas.iter().enumerate() {
            for sum in lost.row_mut(room).iter_mut().filter(|sum| **sum < LOST_FROM * area) {
                *sum = 0.0;
            }
        }
        // Closed and white, to the precision of the storage: the remainder is no loss.
        leave_undetermined(system, &mut lost);
        Self {
            scaled,
            labels: &components.labels,
            lost,
        }
    }

    /// Returns the component of a patch.
    pub(super) fn room(&self, patch: usize) -> usize {
        self.labels[patch] as usize
    }

    /// Returns the power that an irradiance of 1 loses in a component; 0 if it loses none.
    pub(super) fn lost(&self, room: usize, channel: usize) -> f64 {
        self.lost.row(room)[channel]
    }

    /// Returns Σ A s x of each component, \[components, c\].
    pub(super) fn arriving(&self, x: &Block) -> Block {
        let mut sums = Block::zeros(self.lost.n_rows(), x.n_channels());
        for (i, (area, arriving)) in self.scaled.areas.iter().zip(self.scaled.system.row_sums()).enumerate() {
            let room = self.room(i);
            for (sum, value) in sums.row_mut(room).iter_mut().zip(x.row(i)) {
                *sum += area * arriving * value;
            }
        }
        sums
    }

    /// Returns the ambient irradiance of `unshot` at every patch, \[n, c\].
    pub(super) fn irradiance(&self, unshot: &Block) -> Block {
        let arriving = self.arriving(unshot);
        let mut irradiance = self.scaled.zeros();
        for i in 0..unshot.n_rows() {
            let room = self.room(i);
            for (c, h) in irradiance.row_mut(i).iter_mut().enumerate() {
                let lost = self.lost(room, c);
                if lost > 0.0 {
                    *h = arriving.row(room)[c] / lost;
                }
            }
        }
        irradiance
    }

    /// Returns the mean reflectance Σ A ρ s / Σ A of each component, \[components, c\].
    pub(super) fn mean_reflectance(&self) -> Block {
        let reflectance = self.arriving(self.scaled.system.reflectance());
        let mut areas = vec![0.0; self.lost.n_rows()];
        for (i, area) in self.scaled.areas.iter().enumerate() {
            areas[self.room(i)] += area;
        }
        let mut mean = reflectance;
        for (room, area) in areas.iter().enumerate() {
            mean.row_mut(room).iter_mut().for_each(|sum| *sum /= area);
        }
        mean
    }
}
