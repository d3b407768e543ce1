//! A forecast of the exact method's run time, from some runs of its rows.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use std::time::{Duration, Instant};

use super::batches::{Batches, Strip};
use super::method::ExactMethod;
use crate::form_factor::Input;
use crate::form_factor::forecast::{RAYS, golden_section, mean, sampled, shooting_s};
use crate::progress::Forecast;

/// The most time of a sample: to classify runs of rows, and then to integrate their pairs for each tolerance.
#[derive(Clone, Copy)]
struct Limits {
    of_rows: Duration,
    of_pairs: Duration,
}

/// The limits where the caller asked for a forecast.
const IN_FULL: Limits = Limits {
    of_rows: Duration::from_millis(1200),
    of_pairs: Duration::from_millis(600),
};

/// The limits where the forecast only warns, before the work itself begins.
const BY_THE_WAY: Limits = Limits {
    of_rows: Duration::from_millis(300),
    of_pairs: Duration::from_millis(100),
};

/// The limits of a first estimate: most work is so short that it needs no better one.
const AT_A_GLANCE: Limits = Limits {
    of_rows: Duration::from_millis(4),
    of_pairs: Duration::from_millis(4),
};

/// The part of [`Forecast::LONG`] below which a first estimate counts as short.
const SHORT: f64 = 0.05;

/// The greatest time of a pair where no occluder can lie between patches, in s.
const CLEAR_PAIR_S: f64 = 1e-5;

/// The fewest runs of rows for each run of the sample: little work is not worth a forecast.
const RUNS_PER_SAMPLE: usize = 32;

/// The pairs of a run that are integrated.
const PAIRS: usize = 4;

/// The budget at which a pair of the sample ends: the forecast is then too low.
const BUDGET: usize = 50_000;

/// Looser tolerances, as multiples of the one asked for.
const LOOSER: [f64; 3] = [10.0, 100.0, 1000.0];

/// The largest tolerance that is forecast.
const LOOSEST: f64 = 0.1;

impl Batches<'_> {
    /// Returns the forecast run time of all rows; `None` where that is short, unless `in_full`.
    pub(super) fn forecast(&self, input: Input<'_>, in_full: bool) -> Option<Forecast> {
        let n_pairs = 0.5 * (self.patches.len() as f64).powi(2);
        if !in_full && self.index.is_none() && n_pairs * CLEAR_PAIR_S < SHORT * Forecast::LONG {
            return None;
        }
        let runs: Vec<(usize, usize)> = (0..self.patches.faces.len())
            .flat_map(|f| self.patches.faces[f].row_runs.iter().map(move |&run| (f, run)))
            .collect();
        let n_samples = if in_full {
            runs.len()
        } else {
            runs.len() / RUNS_PER_SAMPLE
        };
        let within = |limits| Samples::new(self, &runs, n_samples, limits);
        if !in_full && within(AT_A_GLANCE)?.seconds(self.method.tolerance)? < SHORT * Forecast::LONG {
            return None;
        }
        let samples = within(if in_full { IN_FULL } else { BY_THE_WAY })?;
        let of_tolerance = |tolerance: f64| samples.seconds(tolerance);
        let asked = self.method.tolerance;
        let mut forecast = Forecast {
            asked: (asked, of_tolerance(asked)?),
            looser: Vec::new(),
            shooting: None,
        };
        if in_full || forecast.asked.1 > Forecast::LONG {
            let mut stricter_s = forecast.asked.1;
            for tolerance in LOOSER
                .map(|factor| factor * asked)
                .into_iter()
                .filter(|&t| t <= LOOSEST)
            {
                // A looser tolerance cannot cost more: a time that seems to is noise of the sample.
                stricter_s = of_tolerance(tolerance)?.min(stricter_s);
                forecast.looser.push((tolerance, stricter_s));
            }
            forecast.shooting = shooting_s(input, RAYS).map(|seconds| (RAYS, seconds));
        }
        Some(forecast)
    }

    /// Classifies a run of rows on one thread.
    fn classified_run(&self, (f, run): (usize, usize)) -> Sample {
        let face = &self.patches.faces[f];
        let begun = Instant::now();
        let views = self.views_of(f);
        let of_face = begun.elapsed().as_secs_f64() / face.row_runs.len() as f64;
        let begun = Instant::now();
        let strip = self.classify(f, &face.runs[run], &views);
        Sample {
            seconds: of_face + begun.elapsed().as_secs_f64(),
            strip,
        }
    }

    /// Returns the seconds that the partial pairs of a run take on one thread, from some of them.
    fn pairs_s(&self, strip: &Strip, tolerance: f64) -> f64 {
        let n_partial = strip.partial.len();
        let Some(index) = self.index.as_ref().filter(|_| n_partial > 0) else {
            return 0.0;
        };
        let method = ExactMethod {
            tolerance,
            budget: self.method.budget.min(BUDGET),
        };
        let n_integrated = PAIRS.min(n_partial);
        let begun = Instant::now();
        for k in golden_section(n_partial).take(n_integrated) {
            let pair = &strip.partial[k];
            self.partial(index, pair, &strip.occluders[pair.occluders.clone()], &method);
        }
        begun.elapsed().as_secs_f64() * n_partial as f64 / n_integrated as f64
    }
}

/// Some runs of rows, classified.
struct Samples<'a> {
    batches: &'a Batches<'a>,
    rows: Vec<Sample>,
    /// The mean of their times.
    looked_s: f64,
    n_runs: usize,
    limits: Limits,
}

impl<'a> Samples<'a> {
    /// Classifies up to `n_samples` of some runs; `None` without one.
    fn new(batches: &'a Batches<'a>, runs: &[(usize, usize)], n_samples: usize, limits: Limits) -> Option<Self> {
        let samples = sampled(runs.len(), n_samples, limits.of_rows, |k| {
            batches.classified_run(runs[k])
        });
        let times: Vec<f64> = samples.iter().map(|sample| sample.seconds).collect();
        Some(Self {
            batches,
            rows: samples,
            looked_s: mean(&times)?,
            n_runs: runs.len(),
            limits,
        })
    }

    /// Returns the seconds that all runs take on all threads together.
    fn seconds(&self, tolerance: f64) -> Option<f64> {
        let n = self.rows.len();
        let times = sampled(n, n, self.limits.of_pairs, |k| {
            self.batches.pairs_s(&self.rows[k].strip, tolerance)
        });
        let of_run = self.looked_s + mean(&times)?;
        let n_threads = rayon::current_num_threads() * self.batches.progress.ranks().size();
        Some(of_run * self.n_runs as f64 / n_threads as f64)
    }
}

/// A run of rows, and the seconds that it took to classify.
struct Sample {
    seconds: f64,
    strip: Strip,
}
