//! What a solver did, pass by pass.

use std::ops::ControlFlow;
use std::time::Instant;

use serde::Serialize;

use super::scaled::Norms;
use super::stop::worst;

/// The residual after one pass, the worst channel of each norm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HistoryEntry {
    /// The number of passes done; 0 is the start.
    pub pass: usize,
    /// Wall time since the start, s.
    pub time_s: f64,
    /// sqrt(Σ A r² / Σ A E²).
    pub residual_l2: f64,
    /// max |r_i A_i|, W.
    pub residual_max_power: f64,
    /// True where the solver's own running estimate stands in for the residual: each solver says what it estimates.
    /// False where the residual was calculated from the radiosities themselves.
    pub estimated: bool,
}

/// Keeps the history and tells the caller's monitor.
pub(super) struct Recorder<'a> {
    start: Instant,
    monitor: &'a mut dyn FnMut(&HistoryEntry) -> ControlFlow<()>,
    pub(super) entries: Vec<HistoryEntry>,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(monitor: &'a mut dyn FnMut(&HistoryEntry) -> ControlFlow<()>) -> Self {
        Self {
            start: Instant::now(),
            monitor,
            entries: Vec::new(),
        }
    }

    /// Notes the state after a pass, in place of what was noted for the same pass before. Returns false if the caller asks to stop.
    pub(super) fn note(&mut self, pass: usize, norms: &Norms, estimated: bool) -> bool {
        let entry = HistoryEntry {
            pass,
            time_s: self.start.elapsed().as_secs_f64(),
            residual_l2: worst(&norms.l2),
            residual_max_power: worst(&norms.max_power),
            estimated,
        };
        if self.entries.last().is_some_and(|last| last.pass == pass) {
            self.entries.pop();
        }
        self.entries.push(entry);
        (self.monitor)(&entry).is_continue()
    }
}
