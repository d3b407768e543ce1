//! Rules of three or four points within a cell, for pairs that exchange less in all than the tolerance allows.

use glam::DVec2;

use super::cells::Shape;
use super::rule::{Estimate, Parts};

/// Gauss points of the unit interval, (1 ∓ 1/√3)/2.
const PLACES: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Integrates f ≥ 0 over a triangle (degree 2) or a convex quadrilateral (degree 3 along both sides), for functions that are analytic inside.
///
/// So few points cannot separate degrees: the error is taken as half of the range of the values on them times the area, far above the true one of a smooth function. A function
/// whose values agree on all points by symmetry shows no error at all, so that the caller states one of its own beside it.
/// Sources: the three points (1/6, 1/6, 2/3) and the product of Gauss rules of two points, as in any table of quadrature rules. Departures: none.
pub(super) fn integrate(shape: Shape, mut f: impl FnMut(DVec2) -> Parts) -> Estimate {
    match shape {
        Shape::Triangle([a, b, c]) => {
            let third = shape.area() / 3.0;
            let points = [[a, b, c], [b, c, a], [c, a, b]];
            let values = points.map(|[near, far, other]| f(near * (2.0 / 3.0) + (far + other) / 6.0));
            Estimate::of_parts(&values, |_, values| estimate(shape, values, &[third; 3]))
        }
        Shape::Quad([a, b, c, d]) => {
            let nodes: [(DVec2, f64); 4] = std::array::from_fn(|k| {
                let (s, t) = (PLACES[k % 2], PLACES[k / 2]);
                let (left, right) = (a + (d - a) * t, b + (c - b) * t);
                let upwards = (d - a) + ((c - b) - (d - a)) * s;
                (left + (right - left) * s, 0.25 * (right - left).perp_dot(upwards).abs())
            });
            let values = nodes.map(|(point, _)| f(point));
            Estimate::of_parts(&values, |_, values| {
                estimate(shape, values, &nodes.map(|(_, weight)| weight))
            })
        }
    }
}

fn estimate(shape: Shape, values: &[f64], weights: &[f64]) -> [f64; 2] {
    let sum = values
        .iter()
        .zip(weights)
        .map(|(value, weight)| value * weight)
        .sum::<f64>();
    let all = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.iter().fold(all, |(low, high), &v| (low.min(v), high.max(v)));
    [sum, 0.5 * shape.area() * (high - low) + 4.0 * f64::EPSILON * sum]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An integral and its error.
    #[derive(Debug)]
    struct One {
        integral: f64,
        error: f64,
        n_evaluations: usize,
    }

    fn integrate(shape: Shape, f: impl Fn(DVec2) -> f64) -> One {
        let both = super::integrate(shape, |p| [f(p), 0.0]);
        assert_eq!((both.integral[1], both.error[1]), (0.0, 0.0));
        One {
            integral: both.integral[0],
            error: both.error[0],
            n_evaluations: both.n_evaluations,
        }
    }

    fn by_triangle(corners: [DVec2; 3], f: impl Fn(DVec2) -> f64) -> f64 {
        super::super::rule::integrate(corners, 0.0, true, |p| [f(p), 0.0]).integral[0]
    }

    const TRIANGLE: Shape = Shape::Triangle([DVec2::new(-1.0, 0.5), DVec2::new(2.0, 0.0), DVec2::new(0.5, 3.0)]);
    const QUAD: Shape = Shape::Quad([
        DVec2::new(-1.0, 0.5),
        DVec2::new(2.0, 0.0),
        DVec2::new(1.5, 2.0),
        DVec2::new(0.5, 3.0),
    ]);

    #[test]
    fn polynomials_of_their_degrees_are_exact() {
        let finely = |shape: Shape, f: &dyn Fn(DVec2) -> f64| -> f64 {
            let parts = shape.triangles();
            parts.map(|corners| by_triangle(corners, f)).sum()
        };
        for shape in [TRIANGLE, QUAD] {
            // The element of area of a quadrilateral takes one degree.
            for (i, j) in [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)] {
                let f = |p: DVec2| p.x.powi(i) * p.y.powi(j);
                let (found, exact) = (integrate(shape, f).integral, finely(shape, &f));
                assert!((found - exact).abs() < 1e-14, "{shape:?} {i} {j}: {found} {exact}");
            }
        }
        let square = Shape::Quad([DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y]);
        let found = integrate(square, |p| (p.x * p.y).powi(3));
        assert!((found.integral - 1.0 / 16.0).abs() < 1e-15 && found.n_evaluations == 4);
        assert!((integrate(square, |p| p.x.powi(4)).integral - 0.2).abs() > 1e-3);
    }

    #[test]
    fn the_error_covers_smooth_functions() {
        for k in 0..50 {
            let turn = DVec2::from_angle(f64::from(k) * 0.13);
            let f = |p: DVec2| (0.8 * p.dot(turn)).exp() / (1.0 + 0.2 * p.length_squared());
            for shape in [TRIANGLE, QUAD] {
                let found = integrate(shape, f);
                let halves = shape.halves().map(|half| by_triangle(half, f));
                let off = (found.integral - halves.iter().sum::<f64>()).abs();
                assert!(off < 0.2 * found.error, "{k} {shape:?} {off:e} {found:?}");
            }
        }
    }
}
