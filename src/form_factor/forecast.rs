//! A forecast of the run time of form factors, from a sample of the work.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use std::ops::Range;
use std::time::{Duration, Instant};

use super::{ExactMethod, FormFactorMethod, Input, MethodSettings, RandomShooting, SEQUENCE, TOLERANCE, settings};
use crate::geometry::sampling::Sequence;
use crate::progress::{Forecast, Progress};
use crate::threads;

/// The rays for each patch that shooting is forecast for.
pub(super) const RAYS: u64 = 4096;

/// Returns the results of `work` for some of `n` parts: those at `places` of the order of a golden section of all.
///
/// It stops once `most` has passed; one turn of all threads is always done.
pub(super) fn sampled<T: Send>(
    n: usize,
    places: Range<usize>,
    most: Duration,
    work: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let begun = Instant::now();
    let order: Vec<usize> = golden_section(n).take(places.end.min(n)).skip(places.start).collect();
    let mut results = Vec::new();
    for turn in order.chunks(rayon::current_num_threads()) {
        if begun.elapsed() > most {
            break;
        }
        results.append(&mut threads::collect_from(turn, |&k| work(k)));
    }
    results
}

/// Returns the mean of some times; `None` without one.
pub(super) fn mean(times: &[f64]) -> Option<f64> {
    (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
}

/// Returns positions among `n` that are spread evenly after any number of them.
pub(super) fn golden_section(n: usize) -> impl Iterator<Item = usize> {
    const STEP: f64 = 0.618_033_988_749_894_9;
    (1_u32..).map(move |k| {
        let place = (f64::from(k) * STEP).fract() * n as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and n")]
        let place = place as usize;
        place.min(n.saturating_sub(1))
    })
}

/// Draws among parts of work, each as often as its weight says.
pub(super) struct Drawn {
    weights: Vec<f64>,
    /// The sum of the weights up to each.
    until: Vec<f64>,
}

impl Drawn {
    /// Takes positive weights.
    pub(super) fn new(weights: Vec<f64>) -> Self {
        let mut sum = 0.0;
        let until = weights.iter().map(|weight| {
            sum += weight;
            sum
        });
        Self {
            until: until.collect(),
            weights,
        }
    }

    /// Returns the part of draw `k` of `n`, and the number of parts that it stands for: 1 over its probability.
    ///
    /// There must be a part. The draws are as many equal steps of the sum of all weights.
    pub(super) fn nth(&self, k: usize, n: usize) -> (usize, f64) {
        let sum = self.until.last().copied().unwrap_or(0.0);
        let place = (k as f64 + 0.5) / n as f64 * sum;
        let part = self
            .until
            .partition_point(|&until| until < place)
            .min(self.until.len() - 1);
        (part, sum / self.weights[part])
    }
}

/// Returns the seconds that shooting so many rays from each patch takes on all threads together.
pub(super) fn shooting_s(input: Input<'_>, rays: u64) -> Option<f64> {
    let method = RandomShooting {
        rays,
        sequence: Sequence::Sobol,
        seed: 0,
    };
    let rows = method.rows(input)?;
    let n = input.mesh.n_patches();
    let times = sampled(n, 0..256, Duration::from_millis(200), |i| {
        let begun = Instant::now();
        rows(i..i + 1);
        begun.elapsed().as_secs_f64()
    });
    Some(mean(&times)? * n as f64 / rayon::current_num_threads() as f64)
}

/// A method and its setting, chosen by the time that it is expected to take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The name of the method: `exact` or `sr`.
    pub method: &'static str,
    /// The tolerance of `exact`.
    pub tolerance: Option<f64>,
    /// The rays for each patch of `sr`.
    pub rays: Option<u64>,
    /// The wall time in s that it is expected to take.
    pub expected_s: f64,
}

impl Choice {
    /// Returns the settings of the method: those given, with the tolerance or the rays of the choice.
    #[must_use]
    pub fn settings(&self, given: &MethodSettings) -> MethodSettings {
        let mut chosen = given.clone();
        match self.tolerance {
            Some(tolerance) => chosen.values.set(&TOLERANCE, tolerance),
            None => chosen.values.remove(&TOLERANCE),
        }
        if let Some(rays) = self.rays {
            chosen.values.set(&settings::RAYS, rays);
        } else {
            chosen.values.remove(&settings::RAYS);
            chosen.values.remove(&SEQUENCE);
        }
        chosen
    }
}

/// The fewest rays for each patch of shooting, whatever time they take, and the most.
const RAYS_RANGE: (u64, u64) = (64, 1 << 20);

/// The margin for a forecast that is too low: 0.6 of the limit is planned.
const MARGIN: f64 = 0.6;

/// The part of the time that shooting itself gets: checks, repairs and errors then pass over all rows, each with their transpose, and take about as long again.
const SHOOTING: f64 = 0.6;

/// Returns the most accurate method whose form factors are expected within `limit`.
///
/// That is [`ExactMethod`] at `tolerance` or up to 1000 times it (0.1 at most), or [`RandomShooting`] with as many rays as there is time for.
/// They are compared by the tolerance and the greatest standard error of an entry. Where nothing fits, shooting with 64 rays for each patch is returned.
///
/// The choice depends on the machine and its load. Work: up to 5 s for the samples, less where all work is short.
#[must_use]
pub fn within(input: Input<'_>, tolerance: f64, limit: Duration, progress: &dyn Progress) -> Choice {
    let limit_s = MARGIN * limit.as_secs_f64();
    let exact = ExactMethod {
        tolerance,
        ..ExactMethod::default()
    };
    let forecast = exact.forecast(input, progress);
    let all = forecast
        .iter()
        .flat_map(|found| std::iter::once(&found.asked).chain(&found.looser));
    let fitting = all
        .filter(|(_, seconds)| *seconds <= limit_s)
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let (rays, seconds) = forecast
        .as_ref()
        .and_then(|found| found.shooting)
        .unwrap_or((RAYS_RANGE.0, 0.0));
    let per_ray = seconds / rays as f64;
    let mut rays = RAYS_RANGE.1;
    while rays > RAYS_RANGE.0 && rays as f64 * per_ray > SHOOTING * limit_s {
        rays /= 2;
    }
    match fitting {
        Some(&(tolerance, expected_s)) if tolerance <= Forecast::error_of_rays(rays) => Choice {
            method: "exact",
            tolerance: Some(tolerance),
            rays: None,
            expected_s,
        },
        _ => Choice {
            method: "sr",
            tolerance: None,
            rays: Some(rays),
            expected_s: rays as f64 * per_ray,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_over_draws_is_the_sum_over_parts() {
        let values: Vec<f64> = (1..=50).map(|k| f64::from(k * k * k)).collect();
        let sum: f64 = values.iter().sum();
        for power in [0.0, 0.5, 1.0] {
            let drawn = Drawn::new(values.iter().map(|value| value.powf(power)).collect());
            let of_draw = |k| {
                let (part, times) = drawn.nth(k, 1000);
                values[part] * times
            };
            let found = (0..1000).map(of_draw).sum::<f64>() / 1000.0;
            assert!((found / sum - 1.0).abs() < 0.01, "{power}: {found} and {sum}");
        }
        assert_eq!(Drawn::new(vec![2.0]).nth(6, 7), (0, 1.0));
    }

    #[test]
    fn samples_are_spread_over_all_parts() {
        let places: Vec<usize> = golden_section(1000).take(100).collect();
        let mut sorted = places.clone();
        sorted.sort_unstable();
        assert!(sorted.windows(2).all(|pair| (1..=30).contains(&(pair[1] - pair[0]))));
        assert!(golden_section(1).take(10).all(|place| place == 0));
        let mut parts = sampled(7, 0..1000, Duration::from_secs(9), |k| k);
        parts.sort_unstable();
        assert_eq!(parts.len(), 7);
        let [first, rest, all] = [0..3, 3..9, 0..9].map(|places| sampled(9, places, Duration::from_secs(9), |k| k));
        assert_eq!([first, rest].concat(), all);
        assert_eq!(mean(&[1.0, 3.0]), Some(2.0));
        assert_eq!(mean(&sampled(0, 0..10, Duration::from_secs(9), |_| 1.0)), None);
    }
}
