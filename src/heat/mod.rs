//! Radiative heat transfer: temperatures and net fluxes, each with its error, from boundary conditions in two bands, with sun and sky.
//!
//! Surfaces are grey and diffuse in each of two bands that do not mix. In the solar band nothing is emitted, and light D straight from sun and sky is reflected:
//!
//! H = D + F B, B = (1 − α) H, absorbed α H.
//!
//! In the thermal band the surroundings are black, with M₀ = σ T₀⁴ and s the fraction of each patch's light that escapes:
//!
//! H = s M₀ + F B, B = ε M + (1 − ε) H, M = σ T⁴, q = B − H = ε (M − H).
//!
//! A patch has a given T, or it is a member of a [group](Network) with one unknown T whose net heat Σ A q is its supplied heat and absorbed solar heat. A group is one patch where a flux is supplied,
//! the two sides of a sheet, or all patches of a node. Then M = Q / S + Σ w H, with S = Σ A ε and w = A ε / S, so all conditions form one linear system B = E + R F B, in which R is not negative and
//! its rows sum to at most 1. The [solvers](crate::solver) solve it directly: nodes need no further right-hand side, and no outer iteration is needed.
//!
//! Temperatures follow from H rather than from the difference of B and H. Backs of faces are black, at 0 K. `docs/heat.md` has the equations with their errors.

mod band;
mod boundary;
mod boundary_file;
mod error;
mod exchange;
mod inside;
mod network;
mod points;
mod result;
mod sides;
mod summary;
mod sun_path;
mod sun_position;
mod sunlight;
mod thermal;

pub use band::Band;
pub use boundary::{
    Boundary, Condition, MAX_FLUX, MAX_TEMPERATURE_K, MIN_EMISSIVITY, Node, PatchValues, Sky, Sun, SurfaceBoundary,
    SurfaceLines,
};
pub use error::HeatError;
pub use exchange::{ExchangeFactors, SURROUNDINGS};
pub use network::Network;
pub use points::{PointHeat, PointQuery, PointStatus, PointView};
pub use result::Heat;
pub use summary::{HeatBalance, SurfaceHeat};
pub use sun_path::{SunPath, SunPlace, SunStep};
pub use sun_position::sun_direction;
pub use sunlight::{Sunlight, Sunlit, above_horizon, sunlight};
pub use thermal::Stated;

pub(crate) use band::{Enclosure, Outside, Solved, solar_system, thermal_exitance};
pub(crate) use exchange::{Gathered, Nodes};
pub(crate) use points::PointScene;
pub(crate) use result::{DirectLight, Solution};
pub(crate) use sunlight::SunOccluders;

/// σ, the Stefan-Boltzmann constant, W·m⁻²·K⁻⁴: CODATA 2018.
pub const STEFAN_BOLTZMANN: f64 = 5.670_374_419e-8;

/// Returns σ T⁴, W·m⁻².
#[must_use]
pub fn emissive_power(kelvin: f64) -> f64 {
    STEFAN_BOLTZMANN * kelvin.powi(4)
}

/// Returns T of an emissive power, K.
#[must_use]
pub fn temperature(power: f64) -> f64 {
    (power / STEFAN_BOLTZMANN).sqrt().sqrt()
}
