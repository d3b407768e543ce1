//! What the exact method is going to take, from some runs of its rows.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use std::time::{Duration, Instant};

use super::ExactMethod;
use super::batch::Batches;
use crate::form_factor::Input;
use crate::form_factor::forecast::{RAYS, golden_section, mean_s, shooting_s};
use crate::progress::Forecast;

/// The sample of one tolerance takes about this long at most.
const MOST: Duration = Duration::from_millis(1200);

/// And no more than one run of rows in so many: little work is not worth a forecast.
const RUNS_PER_SAMPLE: usize = 32;

/// Pairs of a run that are integrated.
const PAIRS: usize = 4;

/// A pair of the sample ends at this budget: the forecast is then too low.
const BUDGET: usize = 50_000;

/// Looser tolerances by the one asked for.
const LOOSER: [f64; 3] = [10.0, 100.0, 1000.0];

/// No tolerance above this is worth a forecast.
const LOOSEST: f64 = 0.1;

impl Batches<'_> {
    /// Returns what all rows are going to take; `None` where they are few. `in_full` asks for all of it however short the work is.
    pub(super) fn forecast(&self, input: Input<'_>, in_full: bool) -> Option<Forecast> {
        let runs: Vec<(usize, usize)> = (0..self.patches.faces.len())
            .flat_map(|f| self.patches.faces[f].row_runs.iter().map(move |&run| (f, run)))
            .collect();
        let n_samples = if in_full {
            runs.len()
        } else {
            runs.len() / RUNS_PER_SAMPLE
        };
        let asked = self.method.tolerance;
        let of_tolerance = |tolerance: f64| {
            let mean = mean_s(runs.len(), n_samples, MOST, |k| self.run_s(runs[k], tolerance))?;
            Some((
                tolerance,
                mean * runs.len() as f64 / rayon::current_num_threads() as f64,
            ))
        };
        let mut forecast = Forecast {
            asked: of_tolerance(asked)?,
            looser: Vec::new(),
            shooting: None,
        };
        if in_full || forecast.asked.1 > Forecast::LONG {
            let looser = LOOSER.iter().map(|factor| factor * asked);
            forecast.looser = looser.filter(|&t| t <= LOOSEST).filter_map(of_tolerance).collect();
            forecast.shooting = shooting_s(input, RAYS).map(|seconds| (RAYS, seconds));
        }
        Some(forecast)
    }

    /// Returns the seconds that a run of rows takes on one thread.
    fn run_s(&self, (f, run): (usize, usize), tolerance: f64) -> f64 {
        let face = &self.patches.faces[f];
        let begun = Instant::now();
        let views = self.views_of(f);
        let of_face = begun.elapsed().as_secs_f64() / face.row_runs.len() as f64;
        let begun = Instant::now();
        let strip = self.classify(f, &face.runs[run], &views);
        let of_run = begun.elapsed().as_secs_f64();
        let n_partial = strip.partial.len();
        let Some(index) = self.index.as_ref().filter(|_| n_partial > 0) else {
            return of_face + of_run;
        };
        let method = ExactMethod {
            tolerance,
            budget: self.method.budget.min(BUDGET),
        };
        let n_integrated = PAIRS.min(n_partial);
        let begun = Instant::now();
        for k in golden_section(n_partial).take(n_integrated) {
            let pair = &strip.partial[k];
            self.partial(index, pair, &strip.blockers[pair.blockers.clone()], &method);
        }
        let of_pairs = begun.elapsed().as_secs_f64() * n_partial as f64 / n_integrated as f64;
        of_face + of_run + of_pairs
    }
}
