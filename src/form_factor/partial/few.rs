//! Rules of three or four points within a cell, for pairs that exchange less in all than the tolerance allows.

use glam::DVec2;

use super::cells::Shape;
use super::rule::Estimate;

/// Gauss points of the unit interval, (1 ∓ 1/√3)/2.
const PLACES: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Integrates f ≥ 0 over a triangle (degree 2) or a convex quadrilateral (degree 3 along both sides), for functions that are analytic inside.
///
/// So few points tell no degrees apart: the error is taken as half of the range of the values on them times the area, far above the true one of a smooth function. A function
/// whose values agree on all points by symmetry shows nothing at all, so that the caller states an error of its own beside it.
/// Sources: the three points (1/6, 1/6, 2/3) and the product of Gauss rules of two points, as in any table of quadrature rules. Departures: none.
pub(super) fn integrate(shape: Shape, mut f: impl FnMut(DVec2) -> f64) -> Estimate {
    let (mut sum, mut low, mut high, mut n_evaluations) = (0.0, f64::INFINITY, f64::NEG_INFINITY, 0);
    let mut add = |point: DVec2, weight: f64| {
        let value = f(point);
        sum += weight * value;
        (low, high) = (low.min(value), high.max(value));
        n_evaluations += 1;
    };
    match shape {
        Shape::Triangle([a, b, c]) => {
            let third = shape.area() / 3.0;
            for [near, far, other] in [[a, b, c], [b, c, a], [c, a, b]] {
                add(near * (2.0 / 3.0) + (far + other) / 6.0, third);
            }
        }
        Shape::Quad([a, b, c, d]) => {
            for t in PLACES {
                let (left, right) = (a + (d - a) * t, b + (c - b) * t);
                for s in PLACES {
                    let upwards = (d - a) + ((c - b) - (d - a)) * s;
                    add(left + (right - left) * s, 0.25 * (right - left).perp_dot(upwards).abs());
                }
            }
        }
    }
    Estimate {
        integral: sum,
        error: 0.5 * shape.area() * (high - low) + 4.0 * f64::EPSILON * sum,
        n_evaluations,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            parts
                .map(|corners| super::super::rule::integrate(corners, 0.0, f).integral)
                .sum()
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
                let halves = shape
                    .halves()
                    .map(|half| super::super::rule::integrate(half, 0.0, f).integral);
                let off = (found.integral - halves.iter().sum::<f64>()).abs();
                assert!(off < 0.2 * found.error, "{k} {shape:?} {off:e} {found:?}");
            }
        }
    }
}
