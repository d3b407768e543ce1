//! The radiosity system (I − diag(ρ) F) B = E, validated.

use std::sync::OnceLock;

use super::SolverError;
use crate::matrix::operator::{Block, Components, LinearOperator};

/// The radiosity system (I − diag(ρ) F) B = E of n patches in c channels.
///
/// Source: Baranoski, Bramley and Shirley 1995, equation (8). Departures: none.
pub struct RadiositySystem<'a> {
    operator: &'a dyn LinearOperator,
    areas: Vec<f64>,
    reflectance: Block,
    exitance: Block,
    /// Σ_j F_ij.
    row_sums: Block,
    components: OnceLock<Components>,
    /// The units in which the solvers calculate: powers of two, so that changing to them and back is exact.
    units: Units,
}

/// Scales near the greatest area and the greatest exitance of each channel: in these units nothing that matters under- or overflows when squared.
#[derive(Clone, Debug)]
struct Units {
    area: f64,
    exitance: Vec<f64>,
}

impl<'a> RadiositySystem<'a> {
    /// Puts a system together and validates it; one pass over F.
    ///
    /// `operator`: F, \[n, n\]; `areas`: A, m², \[n\]; `reflectance`: ρ, \[n, c\]; `exitance`: E, W·m⁻², \[n, c\].
    ///
    /// # Errors
    /// [`SolverError::Empty`] without patches; [`SolverError::Shape`] if sizes differ; [`SolverError::Area`],
    /// [`SolverError::Reflectance`], [`SolverError::Exitance`] for values out of range;
    /// [`SolverError::NoFiniteSolution`] if in some channel a connected component of the patches emits, has ρ = 1 everywhere,
    /// and row sums of 1 or more: to 1.2e-7, what f32 storage can resolve; [`SolverError::Disk`] if F cannot be read.
    pub fn new(
        operator: &'a dyn LinearOperator,
        areas: Vec<f64>,
        reflectance: Block,
        exitance: Block,
    ) -> Result<Self, SolverError> {
        let n = operator.n_rows();
        let n_channels = exitance.n_channels();
        if n == 0 {
            return Err(SolverError::Empty);
        }
        expect_size("areas", n, areas.len())?;
        expect_size("rows of reflectance", n, reflectance.n_rows())?;
        expect_size("rows of exitance", n, exitance.n_rows())?;
        expect_size("channels of reflectance", n_channels, reflectance.n_channels())?;
        if let Some(patch) = areas.iter().position(|a| !(a.is_finite() && *a > 0.0)) {
            let area = areas[patch];
            return Err(SolverError::Area { patch, area });
        }
        let place = |k: usize| (k / n_channels, k % n_channels);
        if let Some(k) = reflectance.values().iter().position(|rho| !(0.0..=1.0).contains(rho)) {
            let ((patch, channel), reflectance) = (place(k), reflectance.values()[k]);
            return Err(SolverError::Reflectance {
                patch,
                channel,
                reflectance,
            });
        }
        if let Some(k) = exitance.values().iter().position(|e| !(e.is_finite() && *e >= 0.0)) {
            let ((patch, channel), exitance) = (place(k), exitance.values()[k]);
            return Err(SolverError::Exitance {
                patch,
                channel,
                exitance,
            });
        }
        let mut row_sums = Block::zeros(n, 1);
        operator.apply(&Block::from_values(vec![1.0; n], 1), &mut row_sums);
        expect_readable(operator)?;
        let units = Units {
            area: unit(areas.iter().copied()),
            exitance: (0..n_channels)
                .map(|c| unit(exitance.values().iter().skip(c).step_by(n_channels).copied()))
                .collect(),
        };
        let system = Self {
            operator,
            areas,
            reflectance,
            exitance,
            row_sums,
            components: OnceLock::new(),
            units,
        };
        system.expect_a_finite_solution()?;
        expect_readable(operator)?;
        Ok(system)
    }

    /// Returns F.
    #[must_use]
    pub fn operator(&self) -> &'a dyn LinearOperator {
        self.operator
    }

    /// Returns A, m², \[n\].
    #[must_use]
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Returns ρ, \[n, c\].
    #[must_use]
    pub fn reflectance(&self) -> &Block {
        &self.reflectance
    }

    /// Returns E, W·m⁻², \[n, c\].
    #[must_use]
    pub fn exitance(&self) -> &Block {
        &self.exitance
    }

    /// Returns Σ_j F_ij, \[n\].
    #[must_use]
    pub fn row_sums(&self) -> &[f64] {
        self.row_sums.values()
    }

    /// Returns n.
    #[must_use]
    pub fn n_patches(&self) -> usize {
        self.areas.len()
    }

    /// Returns c.
    #[must_use]
    pub fn n_channels(&self) -> usize {
        self.exitance.n_channels()
    }

    /// Returns the sets of patches that exchange light, found on the first call; a single one where the operator does not tell.
    pub fn components(&self) -> &Components {
        self.components.get_or_init(|| {
            let found = self.operator.components();
            found.unwrap_or_else(|| Components::single(self.n_patches()))
        })
    }

    /// Returns the unit of area in which solvers calculate.
    pub(super) fn area_unit(&self) -> f64 {
        self.units.area
    }

    /// Returns the unit of exitance of each channel in which solvers calculate.
    pub(super) fn exitance_units(&self) -> &[f64] {
        &self.units.exitance
    }

    /// Refuses enclosures that gain light and cannot lose it.
    fn expect_a_finite_solution(&self) -> Result<(), SolverError> {
        for channel in 0..self.n_channels() {
            let reflects_all = |i: usize| self.reflectance.row(i)[channel] >= 1.0;
            if !(0..self.n_patches()).any(reflects_all) {
                continue;
            }
            let components = self.components();
            let label = |i: usize| components.labels[i] as usize;
            let mut loses = vec![false; components.n_components];
            for i in 0..self.n_patches() {
                let lets_out = self.row_sums()[i] < 1.0 - f64::from(f32::EPSILON);
                loses[label(i)] |= !reflects_all(i) || lets_out;
            }
            let emits = |i: &usize| self.exitance.row(*i)[channel] > 0.0;
            if let Some(patch) = (0..self.n_patches()).filter(emits).find(|&i| !loses[label(i)]) {
                return Err(SolverError::NoFiniteSolution { patch, channel });
            }
        }
        Ok(())
    }
}

/// Refuses to go on with what an operator returned after it could not be read.
pub(super) fn expect_readable(operator: &dyn LinearOperator) -> Result<(), SolverError> {
    operator.failure().map_or(Ok(()), |error| Err(error.clone().into()))
}

fn expect_size(what: &'static str, expected: usize, found: usize) -> Result<(), SolverError> {
    if expected == found {
        Ok(())
    } else {
        Err(SolverError::Shape { what, expected, found })
    }
}

/// Returns the power of two just below the greatest of some values that are not negative, kept away from the ends of
/// the range; 1 if all are zero.
fn unit(values: impl Iterator<Item = f64>) -> f64 {
    let max = values.fold(0.0, f64::max);
    if max > 0.0 {
        max.log2().floor().clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}
