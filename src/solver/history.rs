//! The history of a solver, pass by pass.

use std::ops::ControlFlow;
use std::time::Instant;

use serde::Serialize;

use super::scaled::Scaled;
use super::stop::{Norms, worst};
use crate::matrix::operator::Block;

/// The state after one pass, the worst channel of each norm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct HistoryEntry {
    /// The number of passes done; 0 is the start.
    pub pass: usize,
    /// Wall time since the start, s, setup included, without what is spent on this history itself.
    pub time_s: f64,
    /// The work so far, in passes over F, setup included; checks of the true residual are not counted.
    pub work: f64,
    /// sqrt(Σ A r² / Σ A E²).
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub residual_l2: f64,
    /// max |r_i A_i|, W.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub residual_max_power: f64,
    /// max |r_i|, W·m⁻².
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub residual_max: f64,
    /// sqrt(Σ r²), W·m⁻²: Baranoski, Bramley and Shirley 1995, equation (26). It depends on how finely the scene is cut.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub residual_euclidean: f64,
    /// True where the solver's own running estimate stands in for the residual: each solver documents its estimate.
    /// False where the residual was calculated from the radiosities themselves.
    pub estimated: bool,
    /// The errors, where a reference solution is known.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub errors: Option<Errors>,
}

/// Errors of radiosities B against a reference B*, the worst channel.
///
/// Source: Baranoski, Bramley and Shirley 1995, equations (27) and (28). Departures: none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Errors {
    /// sqrt(Σ A (B* − B)² / Σ A), W·m⁻².
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub error_rms: f64,
    /// sqrt(Σ (B* − B)² / Σ (B* − E)²): the share of the reflected light that is wrong (Goertler); 0 where nothing is reflected and nothing is wrong.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub error_goertler: f64,
}

/// A function that is called after every pass of a solver, and may stop it by breaking.
pub type Monitor<'a> = &'a mut dyn FnMut(&HistoryEntry) -> ControlFlow<()>;

/// The work before the first pass.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Setup {
    /// In passes over F.
    pub(super) work: f64,
    /// Wall time, s.
    pub(super) time_s: f64,
}

/// Stores the history and calls the caller's monitor.
pub(super) struct Recorder<'a> {
    start: Instant,
    /// Time that went into the history.
    overhead_s: f64,
    pub(super) setup: Setup,
    work: f64,
    /// B* in solver units.
    reference: Option<Block>,
    scaled: &'a Scaled<'a>,
    monitor: Monitor<'a>,
    pub(super) entries: Vec<HistoryEntry>,
}

impl<'a> Recorder<'a> {
    /// `reference`: B*, W·m⁻², \[n, c\].
    #[track_caller]
    pub(super) fn new(scaled: &'a Scaled<'a>, reference: Option<&Block>, setup: Setup, monitor: Monitor<'a>) -> Self {
        let shape = (scaled.system.n_patches(), scaled.system.n_channels());
        assert!(
            reference.is_none_or(|b| (b.n_rows(), b.n_channels()) == shape),
            "the reference has one row per patch and as many channels as the system"
        );
        Self {
            start: Instant::now(),
            overhead_s: 0.0,
            setup,
            work: setup.work,
            reference: reference.map(|b| scaled.from_si(b.clone())),
            scaled,
            monitor,
            entries: Vec::new(),
        }
    }

    /// Does work that only serves the history, without its time.
    pub(super) fn off_the_clock<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.overhead_s += start.elapsed().as_secs_f64();
        result
    }

    /// Returns whether the last entry lacks these norms of a true residual.
    pub(super) fn lacks(&self, norms: &Norms) -> bool {
        let holds = |last: &HistoryEntry| {
            !last.estimated
                && last.residual_l2.to_bits() == worst(&norms.l2).to_bits()
                && last.residual_max_power.to_bits() == worst(&norms.max_power).to_bits()
        };
        !self.entries.last().is_some_and(holds)
    }

    /// Records the state after a pass of so much `work`, in place of an earlier record of the same pass. Returns false if the
    /// caller asks to stop.
    pub(super) fn note(
        &mut self,
        pass: usize,
        work: f64,
        norms: &Norms,
        estimated: bool,
        radiosity: &dyn Fn() -> Block,
    ) -> bool {
        let now_s = self.start.elapsed().as_secs_f64();
        self.work += work;
        let entry = HistoryEntry {
            pass,
            time_s: self.setup.time_s + now_s - self.overhead_s,
            work: self.work,
            residual_l2: worst(&norms.l2),
            residual_max_power: worst(&norms.max_power),
            residual_max: worst(&norms.max),
            residual_euclidean: worst(&norms.euclidean),
            estimated,
            errors: self.reference.as_ref().map(|b| errors(self.scaled, b, &radiosity())),
        };
        if self.entries.last().is_some_and(|last| last.pass == pass) {
            self.entries.pop();
        }
        self.entries.push(entry);
        let goes_on = (self.monitor)(&entry).is_continue();
        self.overhead_s += self.start.elapsed().as_secs_f64() - now_s;
        goes_on
    }
}

fn errors(scaled: &Scaled, reference: &Block, radiosity: &Block) -> Errors {
    let n_channels = radiosity.n_channels();
    let total_area: f64 = scaled.areas.iter().sum();
    let (mut rms, mut goertler) = (vec![0.0; n_channels], vec![0.0; n_channels]);
    for c in 0..n_channels {
        let (mut weighted, mut wrong, mut reflected) = (0.0, 0.0, 0.0);
        for (i, area) in scaled.areas.iter().enumerate() {
            let (b, b_ref, e) = (radiosity.row(i)[c], reference.row(i)[c], scaled.exitance.row(i)[c]);
            weighted += area * (b_ref - b).powi(2);
            wrong += (b_ref - b).powi(2);
            reflected += (b_ref - e).powi(2);
        }
        rms[c] = (weighted / total_area).sqrt() * scaled.system.exitance_units()[c];
        goertler[c] = if wrong > 0.0 { (wrong / reflected).sqrt() } else { wrong };
    }
    Errors {
        error_rms: worst(&rms),
        error_goertler: worst(&goertler),
    }
}
