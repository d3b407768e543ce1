//! The start of a solver.

use serde::Serialize;

use super::ambient::Ambient;
use super::scaled::Scaled;
use crate::matrix::operator::Block;

/// The radiosities that a solver starts from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// The exitance: B = E.
    #[default]
    Exitance,
    /// No light: B = 0.
    Zero,
    /// The exitance, and the rest of the light spread evenly over each room.
    ///
    /// B_i = E_i + ρ_i Ambient, with Ambient = Σ A s E / Σ A (1 − ρ s), s_i = Σ_j F_ij, over the connected component of i: as if
    /// the light spread evenly there. In a closed room s = 1, and Ambient = Σ A E / Σ A · 1 / (1 − ρ_avg). Where nothing is lost the term is left out.
    ///
    /// Source: Baranoski, Bramley and Shirley 1995, equations (9) to (11) and section 3.2.
    /// Departures: per connected component, because light does not pass from one to another; openings count, through s.
    Ambient,
}

impl Start {
    /// Returns the radiosities.
    pub(super) fn radiosity(self, scaled: &Scaled) -> Block {
        if self == Self::Zero {
            return scaled.zeros();
        }
        let mut radiosity = self.irradiance(scaled);
        let terms = scaled
            .exitance
            .values()
            .iter()
            .zip(scaled.system.reflectance().values());
        for (b, (e, rho)) in radiosity.values_mut().iter_mut().zip(terms) {
            *b = e + rho * *b;
        }
        radiosity
    }

    /// Returns the irradiance h of the start written as B = E + diag(ρ) h (for [`Start::Zero`] after one reflection).
    pub(super) fn irradiance(self, scaled: &Scaled) -> Block {
        match self {
            Self::Exitance | Self::Zero => scaled.zeros(),
            Self::Ambient => Ambient::new(scaled).irradiance(&scaled.exitance),
        }
    }
}
