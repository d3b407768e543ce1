//! Where solvers start.

use super::scaled::Scaled;
use crate::matrix::operator::Block;

/// The radiosities that a solver starts from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// B = E.
    #[default]
    Exitance,
    /// B = 0.
    Zero,
    /// B_i = E_i + ρ_i Ambient, with Ambient = Σ A E / Σ A · 1 / (1 − ρ_avg) and ρ_avg = Σ A ρ / Σ A over the connected
    /// component of i: as if the light spread evenly there. Where everything reflects everything the term is left out.
    ///
    /// Source: Baranoski, Bramley and Shirley 1995, equations (9) to (11) and section 3.2.
    /// Departures: per connected component, because light does not pass from one to another.
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

    /// Returns the irradiance h in B = E + diag(ρ) h that the start amounts to (for [`Start::Zero`] after one reflection).
    pub(super) fn irradiance(self, scaled: &Scaled) -> Block {
        match self {
            Self::Exitance | Self::Zero => scaled.zeros(),
            Self::Ambient => ambient(scaled),
        }
    }
}

fn ambient(scaled: &Scaled) -> Block {
    let system = scaled.system;
    let components = system.components();
    let label = |i: usize| components.labels[i] as usize;
    let mut emitted = Block::zeros(components.n_components, system.n_channels());
    let mut absorbing_area = emitted.clone();
    for (i, area) in scaled.areas.iter().enumerate() {
        for c in 0..system.n_channels() {
            emitted.row_mut(label(i))[c] += area * scaled.exitance.row(i)[c];
            absorbing_area.row_mut(label(i))[c] += area * (1.0 - system.reflectance().row(i)[c]);
        }
    }
    let mut irradiance = scaled.zeros();
    for i in 0..system.n_patches() {
        for (c, h) in irradiance.row_mut(i).iter_mut().enumerate() {
            let (emitted, absorbing) = (emitted.row(label(i))[c], absorbing_area.row(label(i))[c]);
            if absorbing > 0.0 {
                *h = emitted / absorbing;
            }
        }
    }
    irradiance
}
