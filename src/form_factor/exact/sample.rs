//! A forecast of the exact method's run time, from some runs of its rows.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use super::batches::{Batches, PartialPair, Strip};
use super::method::ExactMethod;
use crate::form_factor::Input;
use crate::form_factor::forecast::{Drawn, RAYS, mean, sampled, shooting_s};
use crate::form_factor::partial;
use crate::geometry::polygon;
use crate::progress::{Forecast, Progress};

/// The most time of a sample: to classify runs of rows, to integrate their pairs for each tolerance, and for one pair.
#[derive(Clone, Copy)]
struct Limits {
    rows: Duration,
    pairs: Duration,
    pair: Duration,
}

/// The limits where the caller asked for a forecast.
const IN_FULL: Limits = Limits {
    rows: Duration::from_millis(1200),
    pairs: Duration::from_millis(600),
    pair: Duration::from_millis(300),
};

/// The limits where the forecast only warns, before the work itself begins.
const BY_THE_WAY: Limits = Limits {
    rows: Duration::from_millis(300),
    pairs: Duration::from_millis(400),
    pair: Duration::from_millis(300),
};

/// The limits of a first estimate: most work is so short that it needs no better one.
const AT_A_GLANCE: Limits = Limits {
    rows: Duration::from_millis(4),
    pairs: Duration::from_millis(4),
    pair: Duration::from_millis(10),
};

/// The part of [`Forecast::LONG`] below which a first estimate counts as short.
const SHORT: f64 = 0.05;

/// The factor that a first estimate may be too low by where it did not finish a pair.
const UNFINISHED: f64 = 100.0;

/// The greatest time of a pair where no occluder can lie between patches, in s.
const CLEAR_PAIR_S: f64 = 1e-5;

/// The fewest runs of rows for each run of the sample: little work is not worth a forecast.
const RUNS_PER_SAMPLE: usize = 32;

/// The most pairs that are integrated for one tolerance.
const PAIRS: usize = 1024;

/// The part of all draws of runs that go by their number, and of pairs; the others go by their expected cost, which may be wrong.
const BY_NUMBER: f64 = 0.25;

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
        if n_samples == 0 {
            return None;
        }
        let mut samples = Samples::new(self, &runs, n_samples);
        if !in_full {
            samples.look(AT_A_GLANCE);
            if self.is_short(&samples) {
                return None;
            }
        }
        samples.look(if in_full { IN_FULL } else { BY_THE_WAY });
        let of_tolerance = |tolerance: f64| samples.seconds(tolerance);
        let tolerance = self.method.tolerance;
        let asked = of_tolerance(tolerance);
        let mut forecast = Forecast {
            asked: (tolerance, asked.seconds),
            at_least: asked.at_least,
            looser: Vec::new(),
            shooting: None,
        };
        if in_full || asked.seconds > Forecast::LONG {
            let mut stricter_s = asked.seconds;
            for looser in LOOSER
                .map(|factor| factor * tolerance)
                .into_iter()
                .filter(|&t| t <= LOOSEST)
            {
                // A looser tolerance cannot cost more: a time that seems to is noise of the sample.
                stricter_s = of_tolerance(looser).seconds.min(stricter_s);
                forecast.looser.push((looser, stricter_s));
            }
            forecast.shooting = shooting_s(input, RAYS).map(|seconds| (RAYS, seconds));
        }
        Some(forecast)
    }

    /// Returns whether all rows seem to take so little time that a better forecast is not worth its own.
    fn is_short(&self, glance: &Samples<'_>) -> bool {
        let found = glance.seconds(self.method.tolerance);
        let times = if found.at_least { UNFINISHED } else { 1.0 };
        times * found.seconds < SHORT * Forecast::LONG
    }

    /// Returns a number that grows with the expected cost of a run: the area of its patches times the number of later ones.
    fn expected_exchange(&self, (f, run): (usize, usize)) -> f64 {
        let rows = self.patches.faces[f].runs[run].patches.clone();
        let area: f64 = rows.clone().map(|i| self.patches.areas[i]).sum();
        area * (self.patches.len() - rows.start) as f64
    }

    /// Returns the expected cost of a pair, in rays.
    pub(super) fn expected_cost(&self, strip: &Strip, pair: &PartialPair, tolerance: f64) -> f64 {
        let Some(index) = &self.index else { return 0.0 };
        let [p, q] = [pair.i, pair.j].map(|k| (self.patches.areas[k], polygon::centroid(&self.patches.corners[k])));
        let distance_squared = p.1.distance_squared(q.1);
        let ratio = p.0.max(q.0) / (PI * distance_squared).max(p.0.min(q.0)) / tolerance;
        partial::expected_cost(ratio, index.count(&strip.occluders[pair.occluders.clone()]))
    }

    /// Classifies a run of rows on one thread.
    fn classified_run(&self, (f, run): (usize, usize)) -> (f64, Strip) {
        let face = &self.patches.faces[f];
        let begun = Instant::now();
        let views = self.views_of(f);
        let of_face = begun.elapsed().as_secs_f64() / face.row_runs.len() as f64;
        let begun = Instant::now();
        let strip = self.classify(f, &face.runs[run], &views);
        (of_face + begun.elapsed().as_secs_f64(), strip)
    }

    /// Returns the seconds that a partial pair takes on one thread, and whether it was stopped before its end.
    fn pair_s(&self, strip: &Strip, pair: &PartialPair, tolerance: f64, most: Duration) -> (f64, bool) {
        let Some(index) = &self.index else { return (0.0, false) };
        let method = ExactMethod {
            tolerance,
            ..*self.method
        };
        let begun = Instant::now();
        let until = Until {
            progress: self.progress,
            end: begun + most,
        };
        self.partial(index, pair, &strip.occluders[pair.occluders.clone()], &method, &until);
        (begun.elapsed().as_secs_f64(), until.is_cancelled())
    }
}

/// Returns draws of which the part [`BY_NUMBER`] goes by number and the others by `costs`.
fn mixed(mut costs: Vec<f64>) -> Vec<f64> {
    let by_number = BY_NUMBER / (1.0 - BY_NUMBER) * mean(&costs).unwrap_or(0.0);
    for cost in &mut costs {
        *cost += by_number.max(f64::MIN_POSITIVE);
    }
    costs
}

/// Work that is to end at a time, or once the work that it is a sample of ends.
struct Until<'a> {
    progress: &'a dyn Progress,
    end: Instant,
}

impl Progress for Until<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}

    fn deadline(&self) -> Option<Instant> {
        self.progress.deadline()
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled() || Instant::now() >= self.end
    }
}

/// A time, from samples.
struct Expected {
    seconds: f64,
    /// Some pairs were stopped before their end.
    at_least: bool,
}

/// Some runs of rows, classified.
struct Samples<'a> {
    batches: &'a Batches<'a>,
    runs: &'a [(usize, usize)],
    /// The draws among the runs.
    drawn: Drawn,
    n_draws: usize,
    /// The runs drawn so far.
    rows: Vec<Sample>,
    /// The wall time that they took.
    spent: Duration,
    limits: Limits,
}

impl<'a> Samples<'a> {
    /// Prepares `n_draws` draws among some runs.
    fn new(batches: &'a Batches<'a>, runs: &'a [(usize, usize)], n_draws: usize) -> Self {
        let costs = runs.iter().map(|&run| batches.expected_exchange(run)).collect();
        Self {
            batches,
            runs,
            drawn: Drawn::new(mixed(costs)),
            n_draws,
            rows: Vec::new(),
            spent: Duration::ZERO,
            limits: AT_A_GLANCE,
        }
    }

    /// Classifies more runs, until all are drawn or the time is spent, that of earlier ones included.
    fn look(&mut self, limits: Limits) {
        self.limits = limits;
        let rest = limits.rows.saturating_sub(self.spent);
        if rest.is_zero() {
            return;
        }
        let begun = Instant::now();
        let rows = sampled(self.n_draws, self.rows.len()..self.n_draws, rest, |k| {
            let (run, times) = self.drawn.nth(k, self.n_draws);
            let (seconds, strip) = self.batches.classified_run(self.runs[run]);
            Sample { seconds, strip, times }
        });
        self.rows.extend(rows);
        self.spent += begun.elapsed();
    }

    /// Returns all partial pairs, and the draws among them.
    fn draws(&self, tolerance: f64) -> (Vec<(&Sample, &PartialPair)>, Drawn) {
        let pairs: Vec<(&Sample, &PartialPair)> = self
            .rows
            .iter()
            .flat_map(|row| row.strip.partial.iter().map(move |pair| (row, pair)))
            .collect();
        let cost = |&(row, pair): &(&Sample, &PartialPair)| {
            row.times * self.batches.expected_cost(&row.strip, pair, tolerance)
        };
        let drawn = Drawn::new(mixed(pairs.iter().map(cost).collect()));
        (pairs, drawn)
    }

    /// Returns the seconds that all runs take on all threads together.
    fn seconds(&self, tolerance: f64) -> Expected {
        let batches = self.batches;
        let (pairs, drawn) = self.draws(tolerance);
        let n = if pairs.is_empty() { 0 } else { PAIRS };
        let times = sampled(n, 0..n, self.limits.pairs, |k| {
            let (k, times) = drawn.nth(k, n);
            let (row, pair) = pairs[k];
            let (seconds, is_stopped) = batches.pair_s(&row.strip, pair, tolerance, self.limits.pair);
            (row.times * times * seconds, is_stopped)
        });
        let of_pairs = times.iter().map(|time| time.0).sum::<f64>() / times.len().max(1) as f64;
        let looked: f64 = self.rows.iter().map(|row| row.times * row.seconds).sum();
        let n_rows_and_threads = self.rows.len() * rayon::current_num_threads() * batches.progress.ranks().size();
        Expected {
            seconds: (looked + of_pairs) / n_rows_and_threads as f64,
            at_least: times.iter().any(|time| time.1),
        }
    }
}

/// A run of rows, and the seconds that it took to classify.
struct Sample {
    seconds: f64,
    strip: Strip,
    /// The number of runs that it stands for.
    times: f64,
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::split::tests::leaves;
    use super::*;
    use crate::mesh::{Mesh, Subdivision};
    use crate::progress::Silent;
    use crate::visibility::embree::EmbreeVisibility;

    /// A floor and a ceiling with many leaves between are one pair of some hundred, of which 100 draws by number would have one at most.
    #[test]
    fn expensive_pairs_are_drawn_more_often() {
        let scene = leaves(40);
        let mesh = Mesh::new(&scene, Subdivision::Uniform(1)).unwrap();
        let visibility = EmbreeVisibility::new(&scene).unwrap();
        let input = Input {
            scene: &scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded: false,
        };
        let method = ExactMethod {
            tolerance: 1e-5,
            ..ExactMethod::default()
        };
        let batches = Batches::new(&method, input, None, &Silent);
        let runs: Vec<(usize, usize)> = (0..batches.patches.faces.len())
            .map(|f| (f, batches.patches.faces[f].row_runs[0]))
            .collect();
        let mut samples = Samples::new(&batches, &runs, runs.len());
        samples.rows.extend(runs.iter().map(|&run| {
            let (seconds, strip) = batches.classified_run(run);
            Sample {
                seconds,
                strip,
                times: 1.0,
            }
        }));
        let (pairs, drawn) = samples.draws(method.tolerance);
        let is_dear = |k: usize| {
            let pair = pairs[drawn.nth(k, 100).0].1;
            (pair.i.min(pair.j), pair.i.max(pair.j)) == (0, 1)
        };
        let n_dear = (0..100).filter(|&k| is_dear(k)).count();
        assert!(
            pairs.len() > 100 && n_dear >= 10,
            "{n_dear} of 100 draws among {} pairs",
            pairs.len()
        );
    }
}
