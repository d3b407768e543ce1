//! The radiosity system (I − diag(ρ) F) B = E, validated.

use std::sync::OnceLock;

use super::error::SolverError;
use crate::matrix::connected;
use crate::matrix::operator::{Block, Components, LinearOperator, RowAccess};

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
    /// [`Self::greatest_mean_reflectances`].
    mean_reflectances: OnceLock<Vec<f64>>,
    /// The units of the solvers: powers of two, so that changing to them and back is exact.
    units: Units,
    /// Whether exitances, and so radiosities, may be negative.
    signed: bool,
    /// The components (in each channel) whose mean radiosity is undetermined.
    singular: Vec<Vec<u32>>,
}

/// Scales near the greatest area and the greatest exitance of each channel: in these units squares of relevant size neither under- nor overflow.
#[derive(Clone, Debug)]
struct Units {
    area: f64,
    exitance: Vec<f64>,
}

impl<'a> RadiositySystem<'a> {
    /// Makes and validates a system; one pass over F.
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
        Self::build(operator, areas, reflectance, exitance, false)
    }

    /// Makes a system whose exitances may be negative, such as the difference of two lightings.
    ///
    /// As [`new`](Self::new), except that a closed, white component is accepted where its exitances balance, Σ A E = 0 (to 1e-12 of Σ A |E|):
    /// its solution is then determined but for a constant, and solvers return the one with Σ A B = 0. Negative radiosities
    /// do not count against a solution.
    ///
    /// # Errors
    /// As for [`new`](Self::new), without [`SolverError::Exitance`] for negative values.
    pub fn with_signed_exitance(
        operator: &'a dyn LinearOperator,
        areas: Vec<f64>,
        reflectance: Block,
        exitance: Block,
    ) -> Result<Self, SolverError> {
        Self::build(operator, areas, reflectance, exitance, true)
    }

    /// Refuses the system where rows that are known to sum to 1 leave it without a finite solution.
    ///
    /// That does not depend on their computed sums: the light that inexact sums lose or make is an error.
    ///
    /// `closed`: whether all light of a patch arrives at others, \[n\].
    ///
    /// # Errors
    /// [`SolverError::NoFiniteSolution`] as for [`new`](Self::new); [`SolverError::Shape`] if sizes differ.
    pub fn with_closed_rows(mut self, closed: &[bool]) -> Result<Self, SolverError> {
        expect_size("closed rows", self.n_patches(), closed.len())?;
        self.singular = self.find_singular(|i| closed[i])?;
        Ok(self)
    }

    fn build(
        operator: &'a dyn LinearOperator,
        areas: Vec<f64>,
        reflectance: Block,
        exitance: Block,
        signed: bool,
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
        if let Some(k) = exitance
            .values()
            .iter()
            .position(|e| !(e.is_finite() && (signed || *e >= 0.0)))
        {
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
            area: power_of_two_below(areas.iter().copied()),
            exitance: (0..n_channels)
                .map(|c| power_of_two_below(exitance.values().iter().skip(c).step_by(n_channels).copied()))
                .collect(),
        };
        let mut system = Self {
            operator,
            areas,
            reflectance,
            exitance,
            row_sums,
            components: OnceLock::new(),
            mean_reflectances: OnceLock::new(),
            units,
            signed,
            singular: Vec::new(),
        };
        expect_readable(operator)?;
        system.singular = system.find_singular(|_| false)?;
        Ok(system)
    }

    /// Returns F.
    #[must_use]
    pub fn operator(&self) -> &'a dyn LinearOperator {
        self.operator
    }

    /// Returns access by rows, which `solver` needs.
    pub(super) fn rows_for(&self, solver: &'static str) -> Result<&'a dyn RowAccess, SolverError> {
        self.operator.rows().ok_or(SolverError::NeedsRows { solver })
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

    /// Returns the sets of patches that exchange light, found on the first call.
    ///
    /// There is a single set where the operator does not provide them. But if some patch reflects everything, it matters
    /// whether other patches are in the same set, and the rows of the operator are read.
    pub fn components(&self) -> &Components {
        self.components.get_or_init(|| {
            let is_white = || self.reflectance.values().iter().any(|rho| *rho >= 1.0);
            let by_rows = || {
                let rows = self.operator.rows().filter(|_| is_white())?;
                Some(connected(self.operator, rows))
            };
            let found = self.operator.components().or_else(by_rows);
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

    /// Returns whether exitances, and so radiosities, may be negative.
    #[must_use]
    pub fn is_signed(&self) -> bool {
        self.signed
    }

    /// Returns the components whose mean radiosity is undetermined in a channel, as they are closed and white: solutions have a mean of zero there.
    pub fn singular_components(&self, channel: usize) -> impl Iterator<Item = u32> {
        self.singular.get(channel).into_iter().flatten().copied()
    }

    /// Returns for each component whether any patch of it emits, channel by channel: component k and channel c are at place k n_channels + c.
    pub(super) fn emitting_components(&self) -> Vec<bool> {
        let Components { labels, n_components } = self.components();
        let n_channels = self.n_channels();
        let mut emits = vec![false; n_components * n_channels];
        for (i, &label) in labels.iter().enumerate() {
            let own = &mut emits[label as usize * n_channels..][..n_channels];
            for (any, exitance) in own.iter_mut().zip(self.exitance.row(i)) {
                *any |= exitance.abs() > 0.0;
            }
        }
        emits
    }

    /// Returns the greatest area-weighted mean reflectance of the components that emit, of each channel; calculated on the first call.
    pub(super) fn greatest_mean_reflectances(&self) -> &[f64] {
        self.mean_reflectances.get_or_init(|| {
            let (components, n_channels) = (self.components(), self.n_channels());
            let mut reflecting = Block::zeros(components.n_components, n_channels);
            let emits = self.emitting_components();
            let mut areas = vec![0.0; components.n_components];
            // A power of two, so that areas in any unit can be summed.
            let per_unit = self.area_unit().recip();
            for (i, (&label, area)) in components.labels.iter().zip(&self.areas).enumerate() {
                let room = label as usize;
                areas[room] += area * per_unit;
                for (sum, rho) in reflecting.row_mut(room).iter_mut().zip(self.reflectance.row(i)) {
                    *sum += area * per_unit * rho;
                }
            }
            let mut greatest = vec![0.0_f64; n_channels];
            for (room, area) in areas.iter().enumerate() {
                for (c, sum) in reflecting.row(room).iter().enumerate() {
                    if emits[room * n_channels + c] {
                        greatest[c] = greatest[c].max(sum / area);
                    }
                }
            }
            greatest
        })
    }

    /// Finds the enclosures that cannot lose light, and refuses those that gain any. Rows that are `closed` let nothing out, whatever their sum.
    fn find_singular(&self, closed: impl Fn(usize) -> bool) -> Result<Vec<Vec<u32>>, SolverError> {
        let mut found = vec![Vec::new(); self.n_channels()];
        for (channel, singular) in found.iter_mut().enumerate() {
            let reflects_all = |i: usize| self.reflectance.row(i)[channel] >= 1.0;
            if !(0..self.n_patches()).any(reflects_all) {
                continue;
            }
            let Components { labels, n_components } = self.components();
            let mut loses = vec![false; *n_components];
            let mut gained = vec![(0.0, 0.0); *n_components];
            let (area_unit, exitance_unit) = (self.units.area, self.units.exitance[channel]);
            for (i, &label) in labels.iter().enumerate() {
                let lets_out = !closed(i) && self.row_sums()[i] < 1.0 - f64::from(f32::EPSILON);
                loses[label as usize] |= !reflects_all(i) || lets_out;
                let power = self.areas[i] / area_unit * (self.exitance.row(i)[channel] / exitance_unit);
                let (net, gross) = &mut gained[label as usize];
                *net += power;
                *gross += power.abs();
            }
            let enclosures = (0_u32..)
                .zip(loses.iter().zip(&gained))
                .filter(|(_, (loses, _))| !**loses);
            for (component, (_, (net, gross))) in enclosures {
                if net.abs() > BALANCED_TO * gross {
                    let members = || (0..self.n_patches()).filter(|&i| labels[i] == component);
                    let emits = |i: &usize| self.exitance.row(*i)[channel].abs() > 0.0;
                    return Err(SolverError::NoFiniteSolution {
                        component,
                        n_patches: members().count(),
                        patch: members().find(emits).unwrap_or(0),
                        channel,
                    });
                }
                singular.push(component);
            }
        }
        Ok(found)
    }
}

/// The share of the sizes of powers below which their sum is rounding.
const BALANCED_TO: f64 = 1e-12;

/// Returns the error of an operator that could not be read, whose results must not be used.
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

/// Returns the power of two just below the greatest size of some values, within limits of the range; 1 if all are zero.
pub(crate) fn power_of_two_below(values: impl Iterator<Item = f64>) -> f64 {
    let max = values.map(f64::abs).fold(0.0, f64::max);
    if max > 0.0 {
        max.log2().floor().clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}
