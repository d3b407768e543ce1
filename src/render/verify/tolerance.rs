//! Statistical tolerances of a correct image.

use crate::geometry::sampling::Sequence;

/// Returns a lower bound of the number of independent samples to which n samples of a stream are equivalent.
///
/// Independent numbers: n. Scrambled Sobol points: n / Γ, with Γ = 2 the bound on a net's variance relative to independent samples in
/// two dimensions of base 2 ((b/(b−1))^(s−1), [`OWEN_1997`](crate::references::OWEN_1997)), and for an n that is not a power of two the
/// standard deviations of the nets that it falls into, added: Γ = 2 (Σ 2^(a/2))² / n over the binary digits 2^a of n.
/// Departures: the variance bound is used as if it bounded the tails as well; real nets stay far below it.
pub(super) fn effective_samples(n: u32, sequence: Sequence) -> f64 {
    let exact = f64::from(n);
    match sequence {
        Sequence::Random => exact,
        Sequence::Sobol => {
            let deviations: f64 = (0..u32::BITS)
                .filter(|bit| n >> bit & 1 == 1)
                .map(|bit| 2f64.powi(bit.cast_signed()).sqrt())
                .sum();
            exact * exact / (2.0 * deviations * deviations)
        }
    }
}

/// Returns KL(q ‖ p) of two probabilities of yes and no.
pub(super) fn divergence(q: f64, p: f64) -> f64 {
    let part = |a: f64, b: f64| if a > 0.0 { a * (a / b).ln() } else { 0.0 };
    part(q, p) + part(1.0 - q, 1.0 - p)
}

/// Returns the tolerance of the mean of n independent numbers in [0, 1] around its expectation p: the larger of both sides.
///
/// The mean leaves [p − d, p + d] with a probability of at most 2 exp(−`log_odds`), because P(mean ≥ q) ≤ exp(−n KL(q ‖ p)), and the same below
/// ([`HOEFFDING_1963`](crate::references::HOEFFDING_1963), theorem 1; it holds for any distribution, and for means p_k that differ, with p their mean).
pub(super) fn hoeffding(p: f64, n: f64, log_odds: f64) -> f64 {
    if p <= 0.0 || p >= 1.0 {
        return 0.0;
    }
    let divergence = |q: f64| divergence(q, p);
    // The divergence grows from 0 at p to its largest value at `end`.
    let reach = |end: f64| {
        let (mut inside, mut outside) = (p, end);
        if n * divergence(end) <= log_odds {
            return (end - p).abs();
        }
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            if n * divergence(middle) <= log_odds {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        (outside - p).abs()
    };
    reach(0.0).max(reach(1.0))
}

/// Returns the tolerance of the mean of m independent errors of expectation zero, by their own spread.
///
/// |Σ r| ≤ √(2 `log_odds`) √(Σ r²) but for a probability of 2 exp(−`log_odds`): exact for symmetric errors
/// ([`EFRON_1969`](crate::references::EFRON_1969)), and to leading order for others when their number is large ([`SHAO_1997`](crate::references::SHAO_1997)).
pub(super) fn self_normalised(sum_of_squares: f64, m: f64, log_odds: f64) -> f64 {
    (2.0 * log_odds * sum_of_squares).sqrt() / m
}

/// The error of rays where an emitter is partially visible, as a share of the largest exitance.
///
/// Rays see outlines whose corners are rounded to f32, 6e-8 of the scene's size off, and a shadow's edge moves by a few times that.
pub(super) const LEAK: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nets_count_half_and_awkward_numbers_less() {
        assert!((effective_samples(1024, Sequence::Random) - 1024.0).abs() < 1e-12);
        assert!((effective_samples(1024, Sequence::Sobol) - 512.0).abs() < 1e-9);
        // 3 = 2 + 1: 9 / (2 (1 + √2)²)
        let three = 9.0 / (2.0 * (1.0 + 2f64.sqrt()).powi(2));
        assert!((effective_samples(3, Sequence::Sobol) - three).abs() < 1e-12);
        // The worst case of all digits: Γ < 2 / (1 − 1/√2)² = 23.4.
        assert!(effective_samples(65535, Sequence::Sobol) > 65535.0 / 23.4);
    }

    /// Compares the bound with the exact binomial tail: it must hold, and exceed the tail by no more than the factor that large deviations allow.
    #[test]
    fn the_bound_holds_for_binomial_counts() {
        for (n, p) in [(64_u32, 0.2), (64, 0.004), (1000, 0.5), (500, 0.97)] {
            let log_odds = 9.0;
            let d = hoeffding(p, f64::from(n), log_odds);
            let mut probability = (1.0 - p).powi(n.cast_signed());
            let mut outside = 0.0;
            for k in 0..=n {
                if (f64::from(k) / f64::from(n) - p).abs() > d {
                    outside += probability;
                }
                probability *= f64::from(n - k) / f64::from(k + 1) * p / (1.0 - p);
            }
            let promised = 2.0 * (-log_odds).exp();
            assert!(outside <= promised, "{n} {p}: {outside:e}");
            assert!(
                d < 6.0 * (p * (1.0 - p) / f64::from(n)).sqrt() + 9.0 / f64::from(n),
                "{n} {p}: {d}"
            );
        }
        assert_eq!(hoeffding(0.0, 10.0, 9.0).to_bits(), 0);
        // Three samples are too few for a narrower bound.
        assert!((hoeffding(0.3, 3.0, 30.0) - 0.7).abs() < 1e-15);
    }
}
