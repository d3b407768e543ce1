//! The form factor from a point with a normal to a polygon, exactly.

use std::f64::consts::TAU;

use glam::DVec3;

use super::clip::clip_contour;
use super::polygon;

/// Returns the form factor from a differential area (a point with a unit normal) to the front of a planar polygon.
///
/// F = −1/(2π) Σ_k n · (r_k × r_{k+1}) θ_k / |r_k × r_{k+1}|, with r_k the corners seen from the point, θ_k the angle
/// between r_k and r_{k+1}, and the polygon cut at the point's horizon n · r = 0. The corners run counter-clockwise
/// seen from the polygon's front, hence the minus; a simple polygon need not be convex. Occlusion is ignored.
///
/// The result is in \[0, 1\], and 0 where the polygon's front does not face the point. A point within 8 ulps (of its
/// distance to the farthest corner) of the polygon's plane counts as in it. Edges of no length are skipped.
/// Accuracy, measured against 60 digits: absolute error below 1e-15 (measured 1.7e-16) for polygons of every size; for polygons that
/// are small seen from the point and do not cross the horizon, also a relative error below 1e-14 (measured 4e-15) at every distance, because
/// the sum is then taken about the polygon's middle, where its leading terms cancel by algebra and not by subtraction.
/// Exact under scaling by a power of two, as long as fourth powers of the lengths stay in range (1e-75 to 1e75).
///
/// Source: [`LAMBERT_1760`](crate::references::LAMBERT_1760). Departures: the cut at the horizon; the evaluation about the polygon's middle.
#[must_use]
#[doc(alias = "view factor")]
pub fn point_form_factor(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let Some(seen) = Seen::new(point, polygon) else {
        return 0.0;
    };
    let level = normal.dot(seen.centre);
    let vector = seen.contour_vector(polygon.len(), |offset| level + normal.dot(offset));
    // The exact sum is in [0, 1], so that clamping only removes rounding; adding zero makes −0 a plain 0.
    (-normal.dot(vector) / TAU).clamp(0.0, 1.0) + 0.0
}

/// Returns the vector Φ whose product n · Φ is the form factor for every normal n that has the whole polygon above its horizon.
///
/// Φ = −1/(2π) Σ_k (r_k × r_{k+1}) θ_k / |r_k × r_{k+1}|: the irradiance vector of a polygon of exitance 1; zero behind the
/// polygon. Accuracy and source as for [`point_form_factor`]. Departures: none.
#[must_use]
pub fn point_form_factor_vector(point: DVec3, polygon: &[DVec3]) -> DVec3 {
    Seen::new(point, polygon).map_or(DVec3::ZERO, |seen| seen.contour_vector(polygon.len(), |_| 1.0) / -TAU)
}

/// A polygon seen from a point: r_k = centre + offset(k).
struct Seen<'a> {
    polygon: &'a [DVec3],
    /// From the polygon's first corner to its middle.
    middle: DVec3,
    /// From the point to the polygon's middle; zero where the sum is taken about the point itself.
    centre: DVec3,
    /// From the point to the polygon's first corner where `centre` is zero, otherwise unused.
    first: DVec3,
}

impl<'a> Seen<'a> {
    /// Returns `None` if the polygon's front does not face the point.
    fn new(point: DVec3, polygon: &'a [DVec3]) -> Option<Self> {
        let &v0 = polygon.first()?;
        let (mut sum, mut farthest) = (DVec3::ZERO, 0.0_f64);
        for &v in polygon {
            sum += v - v0;
            farthest = farthest.max((v - point).length_squared());
        }
        let area_vector = polygon::area_vector(polygon);
        let height = area_vector.dot(point - v0);
        if height <= 8.0 * f64::EPSILON * farthest.sqrt() * area_vector.length() {
            return None;
        }
        let middle = sum / polygon.len() as f64;
        let first = v0 - point;
        let centre = first + middle;
        let radius_squared = polygon
            .iter()
            .map(|&v| (v - v0 - middle).length_squared())
            .fold(0.0, f64::max);
        let small = radius_squared < 0.25 * centre.length_squared();
        Some(Self {
            polygon,
            middle,
            centre: if small { centre } else { DVec3::ZERO },
            first,
        })
    }

    fn offset(&self, k: usize) -> DVec3 {
        let from_first = self.polygon[k] - self.polygon[0];
        if self.centre == DVec3::ZERO {
            self.first + from_first
        } else {
            from_first - self.middle
        }
    }

    /// Returns Σ (r_k × r_{k+1}) θ_k / |r_k × r_{k+1}| over the part of the polygon where `height` of the offset is not negative.
    fn contour_vector(&self, n_corners: usize, height: impl Fn(DVec3) -> f64) -> DVec3 {
        let mut vector = DVec3::ZERO;
        let mut ends: Option<(DVec3, DVec3)> = None;
        let term = |a, b| {
            if self.centre == DVec3::ZERO {
                near_term(a, b)
            } else {
                far_term(self.centre, a, b)
            }
        };
        clip_contour(
            n_corners,
            |k| self.offset(k),
            height,
            |corner| {
                ends = Some(match ends {
                    None => (corner, corner),
                    Some((first, last)) => {
                        vector += term(last, corner);
                        (first, corner)
                    }
                });
            },
        );
        ends.map_or(DVec3::ZERO, |(first, last)| vector + term(last, first))
    }
}

/// Returns (a × b) θ / |a × b| for one edge: its share of −2π times the irradiance vector, seen from the origin.
#[inline]
pub(crate) fn near_term(a: DVec3, b: DVec3) -> DVec3 {
    let cross = a.cross(b - a);
    let (sine_squared, cosine) = (cross.length_squared(), a.dot(b));
    let squared = cosine * cosine;
    let ratio = if cosine > 0.0 && sine_squared <= 0.09 * squared {
        // θ / sin θ with tan θ = x.
        angle_over_tangent(sine_squared / squared) / cosine
    } else {
        angle_over_sine(sine_squared, cosine)
    };
    cross * ratio
}

/// Returns θ / sin θ by the length of the product; 0 where the point is on the edge.
#[cold]
#[inline(never)]
fn angle_over_sine(sine_squared: f64, cosine: f64) -> f64 {
    if sine_squared > 0.0 {
        let sine = sine_squared.sqrt();
        sine.atan2(cosine) / sine
    } else {
        0.0
    }
}

/// Returns arctan(x)/x for x² up to 0.09, by the Taylor series; its first omitted term is below 7e-18.
#[inline(always)]
pub(super) fn angle_over_tangent(x_squared: f64) -> f64 {
    /// 1/(2k + 1) with the sign of (−1)^k, one row for each k mod 4: four independent sums.
    const SERIES: [[f64; 4]; 4] = [
        [1.0, 1.0 / 9.0, 1.0 / 17.0, 1.0 / 25.0],
        [-1.0 / 3.0, -1.0 / 11.0, -1.0 / 19.0, -1.0 / 27.0],
        [1.0 / 5.0, 1.0 / 13.0, 1.0 / 21.0, 1.0 / 29.0],
        [-1.0 / 7.0, -1.0 / 15.0, -1.0 / 23.0, 0.0],
    ];
    let second = x_squared * x_squared;
    let fourth = second * second;
    let row = |[w, x, y, z]: [f64; 4]| w + fourth * (x + fourth * (y + fourth * z));
    let (a, b, c, d) = (row(SERIES[0]), row(SERIES[1]), row(SERIES[2]), row(SERIES[3]));
    (a + second * c) + x_squared * (b + second * d)
}

/// Returns one edge's term without its part that adds up to zero around the contour.
///
/// With r = c + d and θ/|r_a × r_b| = (1 + δ)/c², the term is ((1 + δ) c × (b − a) + (1 + δ) a × b)/c². Around the closed contour
/// Σ c × (b − a) vanishes, so that only δ c × (b − a) is kept: the rest is of the order of the polygon's solid angle.
pub(crate) fn far_term(c: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let edge = b - a;
    let c_squared = c.length_squared();
    let (ra, rb) = (c + a, c + b);
    let angle = ra.cross(edge).length().atan2(ra.dot(rb));
    let deviation = [
        inverse_length_deviation(c, c_squared, a),
        inverse_length_deviation(c, c_squared, b),
        angle_over_sine_deviation(angle),
    ]
    .into_iter()
    .fold(0.0, |sum, x| sum + x + sum * x);
    (c.cross(edge) * deviation + a.cross(edge) * (1.0 + deviation)) / c_squared
}

/// Returns |c| / |c + d| − 1 to full relative accuracy.
fn inverse_length_deviation(c: DVec3, c_squared: f64, d: DVec3) -> f64 {
    let q = (2.0 * c + d).dot(d) / c_squared;
    let root = (1.0 + q).sqrt();
    -q / (root * (1.0 + root))
}

/// Returns θ / sin θ − 1 to full relative accuracy.
fn angle_over_sine_deviation(theta: f64) -> f64 {
    // 2 (2^(2n−1) − 1) |B_2n| / (2n)!; below 0.2 the first omitted term is 2e-16 of the sum.
    const SERIES: [f64; 7] = [
        1.0 / 6.0,
        7.0 / 360.0,
        31.0 / 15_120.0,
        127.0 / 604_800.0,
        73.0 / 3_421_440.0,
        1_414_477.0 / 653_837_184_000.0,
        8_191.0 / 37_362_124_800.0,
    ];
    if theta < 0.2 {
        let x = theta * theta;
        x * SERIES.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
    } else {
        theta / theta.sin() - 1.0
    }
}

#[cfg(test)]
mod tests;
