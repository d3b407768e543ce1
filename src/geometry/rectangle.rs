//! The exchange area of two rectangles with parallel edges, in closed form.

pub(crate) mod grids;

use std::f64::consts::TAU;

use glam::DVec3;

/// Cosines below this count as zero: the tolerance on right angles and on parallel edges.
const ANGLE_TOLERANCE: f64 = 1e-12;

/// Returns A₁F₁₂ in m² between two unoccluded rectangles whose edges are parallel; `None` for any other polygons.
///
/// A₁F₁₂ = 1/(2π) Σ ± \[G(a₂ − b₁) − G(a₁ − b₁) − G(a₂ − b₂) + G(a₁ − b₂)\] over the pairs of parallel edges \[a₁, a₂\], \[b₁, b₂\], with
/// G(u; d²) = (u² − d²)/4 ln(u² + d²) − 3u²/4 + d u atan(u/d), d the distance of the edges' lines and G(0; 0) = 0; the sign is that of the
/// edges' directions along the contours. It is ∮∮ ln r dr₁·dr₂ / (2π), integrated.
///
/// Both planes may be parallel or perpendicular, at any offset and in any rotated frame. Corners run counter-clockwise
/// seen from the front; the part behind the other's front is cut off first, which leaves rectangles. Rectangles in one
/// plane or back to front give `Some(0.0)`. Angles are taken as right within 1e-12.
///
/// Accuracy: 3e-15 of the squared diameter of the pair, absolute. Terms cancel: the relative error grows to 1e-11 at F = 1e-4, so that
/// quadrature is better beyond about three diameters. Source: the contour integral of
/// [`SPARROW_1963`](crate::references::SPARROW_1963), integrated by hand. Departures: none.
#[must_use]
#[doc(alias = "view factor")]
pub fn rectangle_exchange_area(from: &[DVec3], to: &[DVec3]) -> Option<f64> {
    let (from, to) = (Rectangle::new(from)?, Rectangle::new(to)?);
    let mut second = to.in_frame_of(&from)?;
    let mut first = [Interval::new(0.0, from.lengths[0]), Interval::new(0.0, from.lengths[1])];
    let diameter = second
        .intervals
        .iter()
        .zip([first[0], first[1], Interval::new(0.0, 0.0)])
        .map(|(a, b)| (a.high.max(b.high) - a.low.min(b.low)).powi(2))
        .sum::<f64>()
        .sqrt();
    // Logarithms of lengths near 1 cancel best, and the sum around closed contours does not depend on the unit.
    for interval in first.iter_mut().chain(&mut second.intervals) {
        interval.scale(1.0 / diameter);
    }
    let area = match (second.flat_axis, second.faces_up) {
        (2, true) => 0.0,
        (2, false) => parallel(first, second.intervals),
        (axis, faces_up) => {
            // Move the second rectangle into the plane x = c, facing +x.
            let mut boxed = [first[axis], first[1 - axis]];
            let mut stands = [second.intervals[axis], second.intervals[1 - axis], second.intervals[2]];
            if !faces_up {
                boxed[0].mirror();
                stands[0].mirror();
            }
            perpendicular(boxed, stands)
        }
    };
    Some(area.max(0.0) * diameter * diameter)
}

#[derive(Clone, Copy, Debug)]
struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    fn new(a: f64, b: f64) -> Self {
        Self {
            low: a.min(b),
            high: a.max(b),
        }
    }

    fn scale(&mut self, factor: f64) {
        self.low *= factor;
        self.high *= factor;
    }

    fn mirror(&mut self) {
        *self = Self::new(-self.low, -self.high);
    }

    /// Cuts off the part below `bound`; returns `None` if that is all.
    fn above(self, bound: f64) -> Option<Self> {
        (self.high > bound).then_some(Self {
            low: self.low.max(bound),
            high: self.high,
        })
    }
}

struct Rectangle {
    corners: [DVec3; 4],
    /// Unit vectors along the first edge, along the last edge backwards, and the normal.
    axes: [DVec3; 3],
    lengths: [f64; 2],
}

/// A rectangle with edges along the axes of another one's frame.
struct Aligned {
    intervals: [Interval; 3],
    flat_axis: usize,
    /// Whether the normal points along +`flat_axis`.
    faces_up: bool,
}

impl Rectangle {
    fn new(corners: &[DVec3]) -> Option<Self> {
        let corners: [DVec3; 4] = corners.try_into().ok()?;
        let (a, b) = (corners[1] - corners[0], corners[3] - corners[0]);
        let lengths = [a.length(), b.length()];
        let gap = (corners[2] - corners[1] - b).length();
        let right = a.dot(b).abs() <= ANGLE_TOLERANCE * lengths[0] * lengths[1];
        let closed = gap <= ANGLE_TOLERANCE * lengths[0].min(lengths[1]);
        let (x, normal) = (a / lengths[0], a.cross(b).normalize_or_zero());
        (right && closed && normal != DVec3::ZERO).then(|| Self {
            corners,
            axes: [x, normal.cross(x), normal],
            lengths,
        })
    }

    /// Returns this rectangle in the frame of `other`, its first corner the origin, or `None` if the edges are not parallel.
    fn in_frame_of(&self, other: &Self) -> Option<Aligned> {
        let flat_axis = (0..3).find(|&k| self.axes[2].dot(other.axes[k]).abs() > 0.5 * 3.0_f64.sqrt())?;
        for axis in self.axes {
            let large = other
                .axes
                .iter()
                .filter(|other_axis| axis.dot(**other_axis).abs() > ANGLE_TOLERANCE)
                .count();
            if large != 1 {
                return None;
            }
        }
        let intervals = [0, 1, 2].map(|k| {
            let coordinates = self.corners.map(|v| other.axes[k].dot(v - other.corners[0]));
            if k == flat_axis {
                // One plane, instead of four roundings of it.
                let mean = 0.25 * coordinates.iter().sum::<f64>();
                return Interval::new(mean, mean);
            }
            Interval {
                low: coordinates.into_iter().fold(f64::INFINITY, f64::min),
                high: coordinates.into_iter().fold(f64::NEG_INFINITY, f64::max),
            }
        });
        Some(Aligned {
            intervals,
            flat_axis,
            faces_up: self.axes[2].dot(other.axes[flat_axis]) > 0.0,
        })
    }
}

/// The first rectangle lies in z = 0 and faces +z; the second lies in z = h and faces −z.
fn parallel(first: [Interval; 2], second: [Interval; 3]) -> f64 {
    let h = second[2].low;
    if h <= 8.0 * f64::EPSILON {
        return 0.0; // one plane, to rounding; the diameter is 1 here
    }
    let mut sum = 0.0;
    for axis in [0, 1] {
        let (a, b) = (first[1 - axis], second[1 - axis]);
        let edges = |p: f64, q: f64| double_logarithm(first[axis], second[axis], (p - q).hypot(h));
        sum += edges(a.low, b.high) + edges(a.high, b.low) - edges(a.low, b.low) - edges(a.high, b.high);
    }
    sum / TAU
}

/// The first rectangle \[x, y\] lies in z = 0 and faces +z; the second \[c, y, z\] lies in x = c and faces +x.
fn perpendicular(first: [Interval; 2], second: [Interval; 3]) -> f64 {
    let c = second[0].low;
    let (Some(x), Some(z)) = (first[0].above(c), second[2].above(0.0)) else {
        return 0.0;
    };
    let edges = |p: f64, q: f64| double_logarithm(first[1], second[1], (p - c).hypot(q));
    (edges(x.low, z.high) + edges(x.high, z.low) - edges(x.low, z.low) - edges(x.high, z.high)) / TAU
}

/// Returns ∫_a ∫_b ln r for two parallel segments whose lines are `d` apart.
fn double_logarithm(a: Interval, b: Interval, d: f64) -> f64 {
    let g = |u: f64| {
        let r_squared = u * u + d * d;
        if r_squared > 0.0 {
            0.25 * (u * u - d * d) * r_squared.ln() - 0.75 * u * u + d * u * u.atan2(d)
        } else {
            0.0
        }
    };
    g(a.high - b.low) - g(a.low - b.low) - g(a.high - b.high) + g(a.low - b.high)
}

#[cfg(test)]
pub(crate) mod tests;
