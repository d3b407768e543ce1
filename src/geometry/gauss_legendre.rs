//! Nodes and weights of the Gauss-Legendre rules.

use std::f64::consts::PI;
use std::num::NonZeroUsize;

use super::double_double::DoubleDouble;

/// Returns the nodes and weights of the rule with n points on \[0, 1\], in ascending order, to 1e-30.
///
/// The nodes are the roots of the Legendre polynomial P, by Newton's method: in `f64` first, then in 31 digits; the weights are 1/((1 − x²) P′(x)²).
/// Source: the start by F. G. Tricomi, as in Handbook of Mathematical Functions (Abramowitz and Stegun 1964), 22.16.6. Departures: none.
pub(super) fn rule(n: NonZeroUsize) -> Vec<(DoubleDouble, DoubleDouble)> {
    let n = n.get();
    let count = n as f64;
    let mut points: Vec<(DoubleDouble, DoubleDouble)> = (0..n.div_ceil(2))
        .map(|k| {
            let angle = PI * (k as f64 + 0.75) / (count + 0.5);
            let mut start = -(1.0 - (count - 1.0) / (8.0 * count.powi(3))) * angle.cos();
            for _ in 0..4 {
                let (value, before) = legendre(n, start, 1.0, |x| x);
                start -= value * (1.0 - start * start) / (count * (before - start * value));
            }
            let middle = 2 * k + 1 == n;
            refined(n, DoubleDouble::new(if middle { 0.0 } else { start }))
        })
        .collect();
    let one = DoubleDouble::new(1.0);
    let mirrored = |&(node, weight): &(DoubleDouble, DoubleDouble)| (one - node, weight);
    let others: Vec<_> = points[..n / 2].iter().rev().map(mirrored).collect();
    points.extend(others);
    points
}

/// Returns the rule of [`rule`] rounded to `f64`.
pub(crate) fn rounded_rule(n: NonZeroUsize) -> Vec<(f64, f64)> {
    let points = rule(n).into_iter();
    points.map(|(node, weight)| (node.to_f64(), weight.to_f64())).collect()
}

/// Returns the Legendre polynomials of degrees n and n − 1 at x.
fn legendre<T>(n: usize, x: T, one: T, new: impl Fn(f64) -> T) -> (T, T)
where
    T: Copy + std::ops::Mul<Output = T> + std::ops::Sub<Output = T> + std::ops::Div<Output = T>,
{
    let (mut before, mut value) = (one, x);
    for k in 2..=n {
        let k = k as f64;
        let next = x * value * new(2.0 * k - 1.0) - before * new(k - 1.0);
        (before, value) = (value, next / new(k));
    }
    (value, before)
}

/// Returns node and weight on \[0, 1\] from a node on \[−1, 1\] that is accurate to 1e-15.
fn refined(n: usize, start: DoubleDouble) -> (DoubleDouble, DoubleDouble) {
    let (one, count) = (DoubleDouble::new(1.0), DoubleDouble::new(n as f64));
    // Returns 1 − x² and (1 − x²) P′ besides P.
    let at = |x: DoubleDouble| {
        let (value, before) = legendre(n, x, one, DoubleDouble::new);
        (value, one - x * x, (before - x * value) * count)
    };
    let mut node = start;
    for _ in 0..2 {
        let (value, flank, slope) = at(node);
        node = node - value * flank / slope;
    }
    let (_, flank, slope) = at(node);
    // Half of 2/((1 − x²) P′²), for an interval of half the length.
    ((node + one).scale(0.5), flank / (slope * slope))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// ∫₀¹ xᵐ = 1/(m + 1) up to the degree 2n − 1, to the last digits.
    #[test]
    fn rules_integrate_powers() {
        for n in [1, 2, 5, 16, 33, 48, 200] {
            let rule = rule(NonZeroUsize::new(n).unwrap());
            assert_eq!(rule.len(), n);
            assert!(rule.is_sorted_by(|a, b| a.0 < b.0), "{n}");
            for m in [0, 1, n, 2 * n - 1] {
                let mut sum = DoubleDouble::ZERO;
                for &(node, weight) in &rule {
                    let power = (0..m).fold(DoubleDouble::new(1.0), |power, _| power * node);
                    sum = sum + weight * power;
                }
                let exact = DoubleDouble::new(1.0) / DoubleDouble::new(m as f64 + 1.0);
                let off = (sum - exact).to_f64().abs();
                assert!(off < 1e-29, "{n} points, degree {m}: {off:e}");
                let plain: f64 = rounded_rule(NonZeroUsize::new(n).unwrap())
                    .iter()
                    .map(|&(node, weight)| weight * (0..m).fold(1.0, |power, _| power * node))
                    .sum();
                assert!((plain - exact.to_f64()).abs() < 2e-15, "{n} points, degree {m}");
            }
        }
    }

    #[test]
    fn nodes_are_those_of_the_tables() {
        // Abramowitz and Stegun 1964, table 25.4.
        let tables = [
            (2, 0.577_350_269_189_625_8, 1.0),
            (5, 0.906_179_845_938_664, 0.236_926_885_056_189_1),
            (10, 0.973_906_528_517_171_7, 0.066_671_344_308_688_1),
        ];
        for (n, node, weight) in tables {
            let rule = rounded_rule(NonZeroUsize::new(n).unwrap());
            assert!((2.0 * rule[n - 1].0 - 1.0 - node).abs() < 1e-15);
            assert!((2.0 * rule[0].1 - weight).abs() < 1e-15);
        }
        assert_eq!(rounded_rule(NonZeroUsize::MIN), [(0.5, 1.0)]);
        assert_eq!(rounded_rule(NonZeroUsize::new(3).unwrap())[1], (0.5, 4.0 / 9.0));
    }
}
