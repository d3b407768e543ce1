//! Compares the errors of all pixels together with the noise of the stated number of rays.

use super::answer::PixelAnswer;
use super::layers::Judged;
use super::points::Reference;

/// The least expected numbers of a pixel's rays that hit emitters, and that miss them, for its error to count as normal.
///
/// The fourth moment of a binomial number is then within 1.2 % of a normal one's.
const MIN_COUNT: f64 = 30.0;

/// The sum of (error / standard deviation)² over the pixels where a normal distribution fits, the worst channel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    sum: f64,
    n: f64,
    /// The largest correct sum.
    limit: f64,
    /// The effective number of independent rays for each ray: 1 for independent ones.
    worth: f64,
}

/// Sums the errors of all pixels.
///
/// A ray adds the exitance that it meets, e ∈ [0, e₀], with the mean p e₀: its variance is at most p (1 − p) e₀², and equal to it where all emitters are equally bright. So the mean
/// of n rays has a standard deviation of at most e₀ √(p (1 − p) / n), and the sum of the squared ratios of N pixels is at most
/// N + 2 √(N x) + 2 x except with a probability of e^(−x), x = `log_odds` ([`LAURENT_2000`](crate::references::LAURENT_2000), lemma 1). n is the
/// [effective](super::tolerance::effective_samples) number of rays. Departures: binomial errors are taken for normal; what offset and rounding may change is taken off each error.
pub(super) fn of<'a>(
    pixels: impl Iterator<Item = (&'a PixelAnswer, &'a Judged)>,
    reference: &Reference<'_>,
    log_odds: f64,
) -> Spread {
    let mut channels = [Spread::default(); 3];
    if reference.n_rays > 0 {
        for (answer, judged) in pixels {
            let Some((exact, _)) = answer.irradiance() else {
                continue;
            };
            for (c, spread) in channels.iter_mut().enumerate() {
                let (hits, misses) = reference.expected_counts(c, exact[c]);
                if hits < MIN_COUNT || misses < MIN_COUNT {
                    continue;
                }
                let known = judged.parts[1][c] + judged.parts[2][c];
                let error = (judged.error[c].abs() - known).max(0.0);
                spread.sum += (error / reference.standard_deviation(c, exact[c])).powi(2);
                spread.n += 1.0;
            }
        }
    }
    for spread in &mut channels {
        spread.limit = spread.n + 2.0 * (spread.n * log_odds).sqrt() + 2.0 * log_odds;
        spread.worth = reference.n_effective() / reference.n_rays.max(1) as f64;
    }
    let ratio = |spread: &Spread| if spread.n > 0.0 { spread.sum / spread.limit } else { 0.0 };
    let worst = (0..3).max_by(|&a, &b| ratio(&channels[a]).total_cmp(&ratio(&channels[b])));
    worst.map(|c| channels[c]).unwrap_or_default()
}

impl Spread {
    pub(super) fn is_right(&self) -> bool {
        self.n <= 0.0 || self.sum <= self.limit
    }

    /// Returns the root mean square of error / standard deviation of independent rays.
    pub(super) fn deviation(&self) -> Option<f64> {
        (self.n > 0.0).then(|| (self.sum / self.n / self.worth).sqrt())
    }

    /// Returns the largest correct deviation.
    pub(super) fn max_deviation(&self) -> Option<f64> {
        (self.n > 0.0).then(|| (self.limit / self.n / self.worth).sqrt())
    }
}
