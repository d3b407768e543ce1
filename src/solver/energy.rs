//! The power balance of a solution.

use serde::{Deserialize, Serialize};

use super::system::RadiositySystem;
use crate::matrix::operator::Block;

/// The power balance of one channel.
///
/// With r = E − B + ρ H, Σ A r = emitted − absorbed − absorbed_by_backs − escaped holds exactly where A_i F_ij is symmetric, so that
/// its size is at most sqrt(Σ A) sqrt(Σ A r²); else the rest is the light that form factors without reciprocity make or lose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Energy {
    /// Σ A E, W.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub emitted: f64,
    /// Σ A (1 − ρ) H, W.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub absorbed: f64,
    /// Σ A B (1 − Σ_j F_ij) without `absorbed_by_backs`, W: what leaves through openings, or is lost or made by row sums that are wrong. With what backs take where that is not known.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub escaped: f64,
    /// Σ A B b, W, with b_i the fraction of the light of patch i that black backs take; `None` where it is not known.
    pub absorbed_by_backs: Option<f64>,
    /// Σ A B, W: the power that leaves all patches.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub leaving: f64,
}

impl Energy {
    /// Returns (emitted − absorbed − absorbed_by_backs − escaped) / leaving; 0 in the dark.
    #[must_use]
    pub fn imbalance(&self) -> f64 {
        let lost = self.emitted - self.absorbed - self.absorbed_by_backs.unwrap_or(0.0) - self.escaped;
        if self.leaving > 0.0 { lost / self.leaving } else { lost }
    }

    /// Returns the balance of every channel. `radiosity`, `irradiance`: B, H, W·m⁻², \[n, c\].
    pub(super) fn of(system: &RadiositySystem, radiosity: &Block, irradiance: &Block) -> Vec<Self> {
        let channel = |c: usize| {
            let mut energy = Self {
                emitted: 0.0,
                absorbed: 0.0,
                escaped: 0.0,
                absorbed_by_backs: None,
                leaving: 0.0,
            };
            for (i, (area, row_sum)) in system.areas().iter().zip(system.row_sums()).enumerate() {
                let (b, h) = (radiosity.row(i)[c], irradiance.row(i)[c]);
                energy.emitted += area * system.exitance().row(i)[c];
                energy.absorbed += area * (1.0 - system.reflectance().row(i)[c]) * h;
                energy.escaped += area * b * (1.0 - row_sum);
                energy.leaving += area * b;
            }
            energy
        };
        (0..system.n_channels()).map(channel).collect()
    }
}
