//! The result of a solver.

use std::ops::Range;

use super::choice::Choice;
use super::energy::Energy;
use super::error::SolverError;
use super::error_bound;
use super::history::{HistoryEntry, Recorder};
use super::scaled::{Scaled, TrueResidual};
use super::stop::{StopReason, Tolerance, worst};
use super::system::{RadiositySystem, expect_readable};
use super::vectors::relative_errors;
use crate::matrix::operator::Block;

/// Radiosities, with their residuals and error bounds.
#[derive(Clone, Debug)]
pub struct Solution {
    /// B, W·m⁻², \[n, c\].
    pub radiosity: Block,
    /// H = F B of these radiosities, W·m⁻², \[n, c\]. B = E + ρ H up to the residual.
    pub irradiance: Block,
    /// Why the solver stopped.
    pub stop_reason: StopReason,
    /// Passes of the method; each reads all of F once.
    pub n_passes: usize,
    /// Further passes over F that were spent on true residuals.
    pub n_checks: usize,
    /// The work before the first pass, such as making coarse matrices, in passes over F.
    pub setup_work: f64,
    /// Wall time of that, s.
    pub setup_s: f64,
    /// sqrt(Σ A r² / Σ A E²) of these radiosities, the worst channel; r = E − (I − diag(ρ) F) B.
    pub residual_l2: f64,
    /// max |r_i A_i| of these radiosities, W, the worst channel.
    pub residual_max_power: f64,
    /// A bound of the relative error ‖B − B*‖ / ‖B‖, ‖x‖² = Σ A x², the worst channel; B* solves the system exactly.
    /// `None` where none can be proved: see the error of the form factors for the rest.
    pub error_bound: Option<f64>,
    /// The same figures for each channel by itself.
    pub channels: Vec<ChannelQuality>,
    /// The history, pass by pass; the last entry holds the true residual of the returned radiosities.
    pub history: Vec<HistoryEntry>,
    /// B with an estimate of the unshot light, W·m⁻², \[n, c\], for images before convergence; `None` for solvers without one.
    pub display: Option<Block>,
    /// The number of times that each patch was selected, \[n\], in solvers that select; otherwise empty. Their sum is the number of steps.
    pub selections: Vec<u64>,
    /// The power balance, channel by channel.
    pub energy: Vec<Energy>,
    /// The solver that [`Auto`](super::Auto) chose; `None` for the others.
    pub choice: Option<Choice>,
}

/// The residuals and the error bound of one channel of a [`Solution`]; channels of a system are independent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelQuality {
    /// [`StopReason::Converged`] where this channel meets the tolerance, whatever the others do.
    pub stop_reason: StopReason,
    /// sqrt(Σ A r² / Σ A E²).
    pub residual_l2: f64,
    /// max |r_i A_i|, W.
    pub residual_max_power: f64,
    /// See [`Solution::error_bound`].
    pub error_bound: Option<f64>,
}

impl ChannelQuality {
    /// The quality of a channel in which nothing reflects.
    const EXACT: Self = Self {
        stop_reason: StopReason::Converged,
        residual_l2: 0.0,
        residual_max_power: 0.0,
        error_bound: Some(0.0),
    };

    /// Returns the quality of several channels together; where some did not converge, the stop reason is that of `all`.
    pub(crate) fn of_all(channels: &[Self], all: StopReason) -> Self {
        let worst_of = |norm: fn(&Self) -> f64| worst(&channels.iter().map(norm).collect::<Vec<_>>());
        let converged = channels.iter().all(|own| own.stop_reason == StopReason::Converged);
        Self {
            stop_reason: if converged { StopReason::Converged } else { all },
            residual_l2: worst_of(|own| own.residual_l2),
            residual_max_power: worst_of(|own| own.residual_max_power),
            error_bound: channels
                .iter()
                .try_fold(0.0, |most: f64, own| Some(most.max(own.error_bound?))),
        }
    }
}

impl Solution {
    /// Returns the name of the solver that did the work: the one that [`Auto`](super::Auto) chose, or the one `asked` for.
    #[must_use]
    pub fn solver_name<'a>(&self, asked: &'a str) -> &'a str {
        self.choice.as_ref().map_or(asked, |choice| choice.solver)
    }

    /// Returns the solution of a scene in which nothing reflects: B = E, exactly, whatever F is.
    ///
    /// The irradiance, which has no effect here, is left at 0, and the energy empty. `exitance`: E, W·m⁻², \[n, c\]. Departures: none.
    #[must_use]
    pub fn without_reflection(exitance: Block) -> Self {
        Self {
            irradiance: Block::zeros(exitance.n_rows(), exitance.n_channels()),
            channels: vec![ChannelQuality::EXACT; exitance.n_channels()],
            radiosity: exitance,
            stop_reason: StopReason::Converged,
            n_passes: 0,
            n_checks: 0,
            setup_work: 0.0,
            setup_s: 0.0,
            residual_l2: 0.0,
            residual_max_power: 0.0,
            error_bound: Some(0.0),
            history: Vec::new(),
            display: None,
            selections: Vec::new(),
            energy: Vec::new(),
            choice: None,
        }
    }

    /// Returns the part of the solution for some of the channels; the passes and the history are those of all together.
    #[must_use]
    pub fn of_channels(&self, own: Range<usize>) -> Self {
        let channels = self.channels[own.clone()].to_vec();
        let quality = ChannelQuality::of_all(&channels, self.stop_reason);
        Self {
            radiosity: self.radiosity.channels(own.clone()),
            irradiance: self.irradiance.channels(own.clone()),
            display: self.display.as_ref().map(|display| display.channels(own.clone())),
            energy: self.energy.get(own).map(<[Energy]>::to_vec).unwrap_or_default(),
            stop_reason: quality.stop_reason,
            n_passes: self.n_passes,
            n_checks: self.n_checks,
            setup_work: self.setup_work,
            setup_s: self.setup_s,
            residual_l2: quality.residual_l2,
            residual_max_power: quality.residual_max_power,
            error_bound: quality.error_bound,
            channels,
            history: self.history.clone(),
            selections: self.selections.clone(),
            choice: self.choice,
        }
    }

    /// Returns B − E, the light that surfaces reflect, W·m⁻², \[n, c\]. `exitance`: E, in the shape of B. Departures: none.
    ///
    /// # Panics
    /// If the shapes differ.
    #[must_use]
    #[track_caller]
    pub fn reflected(&self, exitance: &Block) -> Block {
        self.radiosity.zip_with(exitance, |b, e| b - e)
    }

    /// Returns ρ H, the irradiance that surfaces reflect, W·m⁻², \[n, c\]: B − E up to the residual. `reflectance`: ρ.
    #[track_caller]
    pub(super) fn sent_on(&self, reflectance: &Block) -> Block {
        self.irradiance.zip_with(reflectance, |h, rho| rho * h)
    }

    /// Returns the greatest bound, over the channels, of the error relative to the reflected light, ‖B − B*‖ / ‖ρ H‖ with ‖x‖² = Σ A x².
    ///
    /// It gives the [`error_bound`](Self::error_bound) a meaning for a room whose small, bright lamps have nearly all of the norm of B. It is relative to the light that these radiosities would send on, ρ H, as B − E
    /// is nothing where the solver had met its tolerance before its first pass. `None` where a bound is not known; 0 where nothing is reflected. `system`: the one that was solved. Departures: none.
    ///
    /// # Panics
    /// If the shapes differ.
    #[must_use]
    #[track_caller]
    pub fn error_bound_of_reflected(&self, system: &RadiositySystem) -> Option<f64> {
        let reflected = self.sent_on(system.reflectance());
        let shares = relative_errors(system.areas(), &reflected, &self.radiosity);
        let of_channels = self.channels.iter().zip(shares);
        let mut bounds = of_channels.map(|(own, share)| {
            let bound = own.error_bound?;
            Some(if share > 0.0 { bound / share } else { 0.0 })
        });
        bounds.try_fold(0.0, |most: f64, bound| Some(most.max(bound?)))
    }

    /// Marks the solution as converged, for a caller that accepts its residual.
    pub(crate) fn accept(&mut self) {
        self.stop_reason = StopReason::Converged;
        for own in &mut self.channels {
            own.stop_reason = StopReason::Converged;
        }
    }

    /// Separates the power that back faces absorb from the power that escapes, in [`energy`](Self::energy).
    ///
    /// `radiosity` must still be B. `areas`: A, m², \[n\]; `backs`: the fraction of the light of each patch that back faces absorb, \[n\].
    ///
    /// # Panics
    /// If the lengths differ.
    #[track_caller]
    pub fn split_escaped_by_backs(&mut self, areas: &[f64], backs: &[f64]) {
        let n = self.radiosity.n_rows();
        assert_eq!([areas.len(), backs.len()], [n; 2], "one number per patch");
        for (c, energy) in self.energy.iter_mut().enumerate() {
            let power = |i: usize| areas[i] * self.radiosity.row(i)[c] * backs[i];
            let taken: f64 = (0..n).map(power).sum();
            energy.escaped += energy.absorbed_by_backs.unwrap_or(0.0) - taken;
            energy.absorbed_by_backs = Some(taken);
        }
    }

    /// Returns r = E − B + ρ H, W·m⁻², \[n, c\]. `reflectance`, `exitance`: ρ, E, \[n, c\].
    #[must_use]
    pub fn residual(&self, reflectance: &Block, exitance: &Block) -> Block {
        let mut residual = exitance.clone();
        let light = self.radiosity.values().iter().zip(self.irradiance.values());
        let terms = light.zip(reflectance.values());
        for (r, ((b, h), rho)) in residual.values_mut().iter_mut().zip(terms) {
            *r += rho * h - b;
        }
        residual
    }

    /// Returns the solution with [`display`](Self::display), where there is any, in place of B, and with its irradiance, residuals, bound and energy.
    ///
    /// The stop reason and the history stay. A solution that has converged stays unchanged where the estimate is further from it. `system`: the one that was solved; one pass over F.
    ///
    /// # Errors
    /// [`SolverError::Disk`] if F cannot be read.
    pub fn displayed(mut self, system: &RadiositySystem) -> Result<Self, SolverError> {
        let Some(display) = self.display.take() else {
            return Ok(self);
        };
        let scaled = Scaled::new(system);
        let radiosity = scaled.from_si(display);
        let truth = scaled.true_residual(&radiosity);
        let channels = qualities(&scaled, &radiosity, &truth, |c| self.channels[c].stop_reason);
        expect_readable(system.operator())?;
        let quality = ChannelQuality::of_all(&channels, self.stop_reason);
        if self.stop_reason == StopReason::Converged && quality.residual_l2 > self.residual_l2 {
            return Ok(self);
        }
        let (radiosity, irradiance) = (scaled.to_si(radiosity), scaled.to_si(truth.irradiance));
        Ok(Self {
            energy: Energy::of(system, &radiosity, &irradiance),
            residual_l2: quality.residual_l2,
            residual_max_power: quality.residual_max_power,
            error_bound: quality.error_bound,
            channels,
            radiosity,
            irradiance,
            ..self
        })
    }

    /// Makes a solution. `truth` belongs to `radiosity`, in solver units; `gave_up` is the reason why the solver stopped
    /// without reaching the tolerance. Fails if F could not be read.
    pub(super) fn new(
        scaled: &Scaled,
        radiosity: Block,
        truth: TrueResidual,
        tolerance: Tolerance,
        gave_up: StopReason,
        (n_passes, n_checks): (usize, usize),
        recorder: Recorder,
    ) -> Result<Self, SolverError> {
        let excess = tolerance.excess(&truth.norms);
        let signed = scaled.system.is_signed();
        let n_channels = radiosity.n_channels();
        let met = worst(&excess) <= 1.0;
        let mut possible = vec![true; n_channels];
        for (k, b) in radiosity.values().iter().enumerate() {
            let c = k % n_channels;
            // In the unit of the exitance; out of range in its own.
            let is_light = (b * scaled.system.exitance_units()[c]).is_finite() && (signed || *b >= 0.0 || !met);
            possible[c] &= is_light;
        }
        let stop_reason = if gave_up == StopReason::Diverged || possible.contains(&false) {
            StopReason::Diverged
        } else if met {
            StopReason::Converged
        } else {
            gave_up
        };
        let of_channel = |c: usize| {
            if excess[c] <= 1.0 && possible[c] {
                StopReason::Converged
            } else {
                stop_reason
            }
        };
        let channels = qualities(scaled, &radiosity, &truth, of_channel);
        // After any failure, no result that depends on it is returned.
        expect_readable(scaled.system.operator())?;
        let quality = ChannelQuality::of_all(&channels, stop_reason);
        let (radiosity, irradiance) = (scaled.to_si(radiosity), scaled.to_si(truth.irradiance));
        Ok(Self {
            energy: Energy::of(scaled.system, &radiosity, &irradiance),
            choice: None,
            radiosity,
            irradiance,
            stop_reason,
            n_passes,
            n_checks,
            setup_work: recorder.setup.work,
            setup_s: recorder.setup.time_s,
            residual_l2: quality.residual_l2,
            residual_max_power: quality.residual_max_power,
            error_bound: quality.error_bound,
            channels,
            history: recorder.entries,
            display: None,
            selections: Vec::new(),
        })
    }
}

/// Returns the quality of each channel of radiosities in solver units; `stop_reason` is the reason why its work ended.
fn qualities(
    scaled: &Scaled,
    radiosity: &Block,
    truth: &TrueResidual,
    stop_reason: impl Fn(usize) -> StopReason,
) -> Vec<ChannelQuality> {
    let bounds = error_bound::relative(scaled, radiosity, truth);
    let of_channel = |(c, error_bound)| ChannelQuality {
        stop_reason: stop_reason(c),
        residual_l2: truth.norms.l2[c],
        residual_max_power: truth.norms.max_power[c],
        error_bound,
    };
    bounds.into_iter().enumerate().map(of_channel).collect()
}
