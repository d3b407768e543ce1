//! A rule of nine points on a convex quadrilateral for loose tolerances, border included.

use glam::DVec2;

use super::rule::{Estimate, INSET, Parts, SAFETY};

/// The number of evaluations that one quadrilateral takes.
pub(super) const N_POINTS: usize = 9;

/// The distance of the outer points from the middle of a side, as a part of the half side: a thousandth within the border, where a view may be degenerate.
const REACH: f64 = 1.0 - INSET;

/// The weight of an outer point on a line, of a sum of 1: the second moment is exact.
const OUTER: f64 = 1.0 / (6.0 * REACH * REACH);

/// The weight of the middle point.
const MIDDLE: f64 = 1.0 - 2.0 * OUTER;

/// Integrates f over a convex quadrilateral by Simpson's rule along both axes.
///
/// With c_mn the coefficients of f times the element of area in discrete orthonormal polynomials u^m v^n on the points, the error is taken as 3/2 area (‖c₂₀, c₁₁, c₀₂‖ + ‖c₂₁, c₁₂‖ + |c₂₂|):
/// the parts that the rule integrates exactly where f is smooth. A kink along an axis changes the integral by less, wherever it lies, and a jump by at most √2 times as much.
/// A detail wholly between points leaves no trace: the rule is for functions whose kinks are sides of the quadrilateral.
pub(super) fn integrate([a, b, c, d]: [DVec2; 4], mut f: impl FnMut(DVec2) -> Parts) -> Estimate {
    let places = [-REACH, 0.0, REACH].map(|u| 0.5 + 0.5 * u);
    let nodes: [(DVec2, f64); N_POINTS] = std::array::from_fn(|k| {
        let (s, t) = (places[k % 3], places[k / 3]);
        let (left, right) = (a + (d - a) * t, b + (c - b) * t);
        let upwards = (d - a) + ((c - b) - (d - a)) * s;
        (left + (right - left) * s, (right - left).perp_dot(upwards).abs())
    });
    let values = nodes.map(|(point, _)| f(point));
    let area = 0.5 * (c - a).perp_dot(d - b).abs();
    Estimate::of_parts(&values, |_, values| {
        // f times the element of area, resolved along s for each t.
        let lines = [0, 1, 2].map(|t| resolve([0, 1, 2].map(|s| values[3 * t + s] * nodes[3 * t + s].1)));
        let [zeroth, first, second] = [0, 1, 2].map(|m| resolve(lines.map(|line| line[m])));
        let size = |parts: &[f64]| parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        let error = size(&[zeroth[2], first[1], second[0]]) + size(&[first[2], second[1]]) + second[2].abs();
        let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        [zeroth[0], SAFETY * error + 4.0 * f64::EPSILON * area * largest]
    })
}

/// Returns the coefficients of three values in the discrete orthonormal polynomials of degree 0, 1 and 2.
fn resolve([low, middle, high]: [f64; 3]) -> [f64; 3] {
    // The mean of u² is 1/3 on the points too; u² − 1/3 has the norm τ.
    const BENT: f64 = REACH * REACH - 1.0 / 3.0;
    let tau = (2.0 * OUTER * BENT * BENT + MIDDLE / 9.0).sqrt();
    [
        OUTER * (low + high) + MIDDLE * middle,
        OUTER * REACH * 3.0_f64.sqrt() * (high - low),
        (OUTER * BENT * (low + high) - MIDDLE / 3.0 * middle) / tau,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An integral and its error.
    #[derive(Debug)]
    struct One {
        integral: f64,
        error: f64,
    }

    fn integrate(corners: [DVec2; 4], f: impl Fn(DVec2) -> f64) -> One {
        let both = super::integrate(corners, |p| [f(p), 0.0]);
        assert_eq!(
            (both.integral[1], both.error[1], both.n_evaluations),
            (0.0, 0.0, N_POINTS)
        );
        One {
            integral: both.integral[0],
            error: both.error[0],
        }
    }

    const QUAD: [DVec2; 4] = [
        DVec2::new(-1.0, 0.5),
        DVec2::new(2.0, 0.0),
        DVec2::new(1.5, 2.0),
        DVec2::new(0.5, 3.0),
    ];

    const SQUARE: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];

    #[test]
    fn cubic_functions_are_exact() {
        for (i, j) in [(0, 0), (1, 0), (2, 1), (3, 2), (3, 3)] {
            let found = integrate(SQUARE, |p| p.x.powi(i) * p.y.powi(j));
            let exact = 1.0 / f64::from((i + 1) * (j + 1));
            assert!((found.integral - exact).abs() < 1e-15, "{i} {j} {found:?}");
        }
        let found = integrate(SQUARE, |p| p.x.powi(4));
        assert!((found.integral - 0.2).abs() > 1e-3 && (found.integral - 0.2).abs() < found.error);
        // The element of area of a quadrilateral is linear.
        let area = integrate(QUAD, |_| 1.0);
        assert!((area.integral - 4.875).abs() < 1e-14, "{area:?}");
        let square = integrate(QUAD, |p| p.x * p.x).integral;
        let triangle = |p: [DVec2; 3]| super::super::rule::integrate(p, 0.0, true, |p| [p.x * p.x, 0.0]).integral[0];
        let exact = triangle([QUAD[0], QUAD[1], QUAD[2]]) + triangle([QUAD[0], QUAD[2], QUAD[3]]);
        assert!((square - exact).abs() < 1e-13, "{square} {exact}");
    }

    #[test]
    fn the_error_covers_linear_functions_kinks_and_jumps() {
        let linear = integrate(SQUARE, |p| 2.0 + p.x - 3.0 * p.y);
        assert!(linear.error < 1e-14, "{linear:?}");
        for k in 0..100 {
            let at = f64::from(k) / 100.0 + 0.003;
            let kink = integrate(SQUARE, |p| (p.x - at).max(0.0));
            let exact = 0.5 * (1.0 - at).powi(2);
            assert!((kink.integral - exact).abs() <= kink.error, "{at} {kink:?}");
            let jump = integrate(SQUARE, |p| f64::from(p.y > at));
            assert!((jump.integral - (1.0 - at)).abs() <= jump.error, "{at} {jump:?}");
            // A corner cut off aslant.
            let slope = 0.2 + at;
            let aslant = integrate(SQUARE, |p| (p.x + slope * p.y - at).max(0.0));
            // ∬ (x + s y − a)₊: the whole plane less the part below, whose triangle (a, a/s) may reach beyond the square.
            let below = |a: f64| a.max(0.0).powi(3) / (6.0 * slope);
            let exact = 0.5 + 0.5 * slope - at + below(at) - below(at - 1.0) - below(at - slope);
            assert!(
                (aslant.integral - exact).abs() <= aslant.error,
                "{at} {aslant:?} {exact}"
            );
        }
    }
}
