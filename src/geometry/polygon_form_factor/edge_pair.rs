//! The integral of ln r over a pair of edges, the outer one by graded Gauss rules and the inner one exactly.

use glam::DVec3;

use super::real::{LONGEST_RULE, Real, Vector};

/// A directed edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge<T> {
    pub(super) start: Vector<T>,
    pub(super) end: Vector<T>,
    pub(super) vector: Vector<T>,
    length_squared: T,
}

impl<T: Real> Edge<T> {
    /// Returns `None` for an edge of no length.
    pub(super) fn new(start: Vector<T>, end: Vector<T>) -> Option<Self> {
        let vector = end.minus(start);
        let length_squared = vector.dot(vector);
        (length_squared > T::new(0.0)).then_some(Self {
            start,
            end,
            vector,
            length_squared,
        })
    }

    pub(super) fn length(&self) -> f64 {
        self.length_squared.to_f64().sqrt()
    }

    /// Returns ∫₀¹ ln |start + t vector − y| dt.
    ///
    /// It is (t₁ ln r₁² − t₀ ln r₀²)/2 − 1 + h θ/L, with t the ends' positions along the edge seen from y's foot, in lengths L of the
    /// edge, h the distance of y from the edge's line and θ the angle under which y sees the edge.
    fn logarithm_from(&self, y: Vector<T>) -> T {
        let (to_start, to_end) = (self.start.minus(y), self.end.minus(y));
        let term = |corner: Vector<T>| {
            let r_squared = corner.dot(corner);
            if r_squared > T::new(0.0) {
                corner.dot(self.vector) / self.length_squared * r_squared.ln()
            } else {
                T::new(0.0) // t ln t² at t = 0
            }
        };
        let cross = to_start.cross(self.vector);
        let twice_area = cross.dot(cross).sqrt();
        let angle = T::angle(twice_area, to_start.dot(to_end));
        (term(to_end) - term(to_start)).scale(0.5) - T::new(1.0) + twice_area / self.length_squared * angle
    }
}

/// An integral of ln r and the size of the terms that it was summed from, to which its rounding is proportional.
pub(super) struct Integral<T> {
    pub(super) value: T,
    pub(super) size: f64,
}

/// Returns ∫₀¹ ∫₀¹ ln r ds dt over two edges, r the distance of their points.
///
/// Edges that share a corner are exact: with r homogeneous of degree 1 in (s, t), Euler's theorem makes the integral half of its two
/// inner integrals at s = 1 and t = 1, minus 1/2. Otherwise the inner integral is exact and the outer one a Gauss rule
/// on pieces that shrink towards the points where the other edge comes near, to `digits` decimal digits.
pub(super) fn logarithm_integral<T: Real>(a: &Edge<T>, b: &Edge<T>, digits: f64) -> Integral<T> {
    let meeting = [
        (a.start, a.end, b.start, b.end),
        (a.start, a.end, b.end, b.start),
        (a.end, a.start, b.start, b.end),
        (a.end, a.start, b.end, b.start),
    ];
    for (apex_a, end_a, apex_b, end_b) in meeting {
        if apex_a == apex_b {
            let ratio = a.length() / b.length();
            return Integral {
                value: (a.logarithm_from(end_b) + b.logarithm_from(end_a) - T::new(1.0)).scale(0.5),
                size: 2.0 + ratio.max(1.0 / ratio),
            };
        }
    }
    // The edges come near each other less often along the shorter one.
    let (outer, inner) = if a.length_squared < b.length_squared {
        (a, b)
    } else {
        (b, a)
    };
    let singularities = singularities(
        [outer.start, outer.vector].map(Vector::to_f64),
        [inner.start, inner.vector].map(Vector::to_f64),
        inner.end.to_f64(),
    );
    let mut sum = T::new(0.0);
    graded_pieces(&singularities, digits, &mut |low, high, n_points| {
        let width = T::new(high) - T::new(low);
        for &(node, weight) in T::line_rule(n_points) {
            let s = T::new(low) + width * node;
            sum = sum + width * weight * inner.logarithm_from(outer.start.plus(s, outer.vector));
        }
    });
    Integral {
        value: sum,
        // The terms of the inner integral are as large as the edges' distance in lengths of the inner one.
        size: 2.0 + (outer.start.minus(inner.start).to_f64().length() + outer.length()) / inner.length(),
    }
}

/// A complex point x ± iy along the outer edge (its ends at 0 and 1) where the inner integral is not analytic.
#[derive(Clone, Copy, Debug)]
struct Singularity {
    x: f64,
    y: f64,
}

impl Singularity {
    /// Returns the sum of the half axes of the ellipse through this point with foci at the ends of an interval, 1 on it.
    fn ellipse(self, low: f64, high: f64) -> f64 {
        let half_sum = ((self.x - low).hypot(self.y) + (self.x - high).hypot(self.y)) / (high - low);
        half_sum + (half_sum * half_sum - 1.0).max(0.0).sqrt()
    }
}

/// Returns the points where r vanishes at an end of the inner edge, and where the distance to its line does.
fn singularities(
    [start, vector]: [DVec3; 2],
    [inner_start, inner_vector]: [DVec3; 2],
    inner_end: DVec3,
) -> [Singularity; 3] {
    let length_squared = vector.length_squared();
    let end = |corner: DVec3| {
        let x = (corner - start).dot(vector) / length_squared;
        Singularity {
            x,
            y: (corner - start - x * vector).length() / length_squared.sqrt(),
        }
    };
    let [first, last] = [end(inner_start), end(inner_end)];
    let between = inner_start - start;
    let normal = vector.cross(inner_vector);
    let normal_squared = normal.length_squared();
    let place = between.cross(inner_vector).dot(normal) / normal_squared;
    let inner_place = between.cross(vector).dot(normal) / normal_squared;
    // Beyond the inner edge's ends the angle under which it is seen vanishes with the distance to its line, and nothing is singular.
    let nearest = if (-1.0..=2.0).contains(&inner_place) {
        Singularity {
            x: place,
            y: between.dot(normal).abs() * inner_vector.length() / normal_squared,
        }
    } else {
        first
    };
    [first, last, nearest]
}

/// The smallest ellipse on which a piece is integrated without a further cut.
const SMALLEST_ELLIPSE: f64 = 2.5;

/// Cuts [0, 1] into pieces that are small against their distance from the singularities, and gives each its number of Gauss points.
///
/// A Gauss rule of n points has an error of the order of ρ^(−2n) where the integrand is analytic inside the ellipse of
/// the half axes' sum ρ (Trefethen, *Approximation Theory and Approximation Practice*, theorem 19.3).
fn graded_pieces(singularities: &[Singularity], digits: f64, integrate: &mut impl FnMut(f64, f64, usize)) {
    // A piece of length l with the singularity at its end, s ln s, has an error of at most 1e-3 l²; and f64 resolves positions to 1e-16.
    let shortest = 10.0_f64.powf(-0.5 * digits).max(1e-15);
    let mut waiting = vec![(0.0, 1.0)];
    while let Some((low, high)) = waiting.pop() {
        let width: f64 = high - low;
        let (ellipse, x) = singularities
            .iter()
            .map(|place| (place.ellipse(low, high), place.x))
            .fold(
                (f64::INFINITY, 0.0),
                |best, next| if next.0 < best.0 { next } else { best },
            );
        if ellipse >= SMALLEST_ELLIPSE || width <= shortest {
            let rate = 2.0 * ellipse.max(SMALLEST_ELLIPSE).log10();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "small and positive"
            )]
            let n_points = (digits / rate).ceil() as usize + 1;
            integrate(low, high, n_points.min(LONGEST_RULE));
            continue;
        }
        // A factor of five costs the fewest points where the singularity is an end.
        let near = ((x - low) / width).clamp(0.0, 1.0);
        let cut = if near < 0.2 {
            low + 0.2 * width
        } else if near > 0.8 {
            high - 0.2 * width
        } else {
            x
        };
        waiting.push((low, cut));
        waiting.push((cut, high));
    }
}
