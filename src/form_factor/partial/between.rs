//! Rays between two polygons, by points on both or by directions towards the larger one.

use std::f64::consts::PI;

use glam::DVec3;

use super::stops::Stops;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::geometry::sampling::{PointStream, Sequence};
use crate::visibility::occluders::Occluder;

/// The distance, in radii of the target, below which directions are drawn instead of points: the kernel has a peak there.
const NEAR: f64 = 2.0;

/// The solid angle in sr below which no directions are drawn.
const SMALL: f64 = 1e-3;

/// A polygon as a fan of triangles.
struct Fan {
    normal: DVec3,
    area: f64,
    triangles: Vec<[DVec3; 3]>,
    /// The area up to the end of each triangle, as a part of all.
    ends: Vec<f64>,
}

impl Fan {
    fn new(corners: &[DVec3]) -> Self {
        let triangles: Vec<[DVec3; 3]> = (1..corners.len() - 1)
            .map(|k| [corners[0], corners[k], corners[k + 1]])
            .collect();
        let mut sum = 0.0;
        let mut ends: Vec<f64> = triangles
            .iter()
            .map(|triangle| {
                sum += polygon::area_vector(triangle).length();
                sum
            })
            .collect();
        for end in &mut ends {
            *end /= sum;
        }
        Self {
            normal: polygon::area_vector(corners).normalize_or_zero(),
            area: sum,
            triangles,
            ends,
        }
    }

    /// Returns a point, uniform by area.
    fn point(&self, u: f64, v: f64) -> DVec3 {
        let (k, u) = part_of(u, &self.ends);
        let [a, b, c] = self.triangles[k];
        let root = u.sqrt();
        a + root * (1.0 - v) * (b - a) + root * v * (c - a)
    }
}

/// Returns the part of \[0, 1\] that a number is in, the parts given by their ends, and its position in that part, from 0 to 1.
fn part_of(u: f64, ends: &[f64]) -> (usize, f64) {
    let k = ends.partition_point(|&end| end <= u).min(ends.len() - 1);
    let begin = if k == 0 { 0.0 } else { ends[k - 1] };
    (k, ((u - begin) / (ends[k] - begin)).clamp(0.0, 1.0))
}

/// Two polygons and their occluders.
pub(super) struct Between {
    from: Fan,
    to: Fan,
    is_near: bool,
    stops: Stops,
    /// The occluder that stopped a ray last.
    last: usize,
    /// Room for the parts of the other polygon in a view, each with the sum of solid angles up to its end.
    directions: Vec<(SolidAngle, f64)>,
    seed: u64,
}

impl Between {
    /// Prepares rays, which begin on the smaller polygon; `None` where the two do not face each other.
    pub(super) fn new([p, q]: [&[DVec3]; 2], occluders: &[Occluder<'_>]) -> Option<Self> {
        let [area_p, area_q] = [p, q].map(polygon::area_vector);
        let mut sides = [
            clip_to_half_space(p, *q.first()?, area_q),
            clip_to_half_space(q, *p.first()?, area_p),
        ];
        if sides.iter().any(|side| side.len() < 3) {
            return None;
        }
        let corners = |side: &[DVec3]| side.iter().map(DVec3::to_array).collect::<Vec<_>>();
        if (area_q.length(), corners(q)) < (area_p.length(), corners(p)) {
            sides.reverse();
        }
        let [from, to] = sides.each_ref().map(|side| Fan::new(side));
        if from.area <= 0.0 || to.area <= 0.0 {
            return None;
        }
        let balls = sides.each_ref().map(|side| {
            let middle = side.iter().sum::<DVec3>() / side.len() as f64;
            (middle, side.iter().map(|v| v.distance(middle)).fold(0.0, f64::max))
        });
        let gap = balls[0].0.distance(balls[1].0) - balls[0].1 - balls[1].1;
        let numbers = sides.iter().flatten().flat_map(DVec3::to_array);
        let seed = numbers.fold(0_u64, |seed, x| {
            (seed.rotate_left(23) ^ x.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        });
        Some(Self {
            is_near: gap < NEAR * balls[1].1,
            stops: Stops::new(sides.each_ref().map(Vec::as_slice), occluders),
            last: 0,
            directions: Vec::with_capacity(to.triangles.len()),
            from,
            to,
            seed,
        })
    }

    /// Returns points of the unit cube for rays, in one of many independent scrambles.
    pub(super) fn stream(&self, scramble: usize) -> PointStream {
        PointStream::new(Sequence::Sobol, self.seed, scramble as u64)
    }

    /// Prepares for a number of rays in all.
    pub(super) fn expect(&mut self, n_rays: usize) {
        self.stops.expect(n_rays);
    }

    /// Returns whether an occluder stops a ray.
    pub(super) fn stop(&mut self, ends: [DVec3; 2]) -> bool {
        self.stops.stop(ends, &mut self.last)
    }

    /// Returns the ends of a ray, and the kernel without occluders there, m², over the density of such rays.
    pub(super) fn ray(&mut self, [u, v, s, t]: [f64; 4]) -> (f64, [DVec3; 2]) {
        let x = self.from.point(u, v);
        if self.is_near {
            let directions = &mut self.directions;
            directions.clear();
            let mut sum = 0.0;
            directions.extend(self.to.triangles.iter().map(|triangle| {
                let part = SolidAngle::of(triangle, x);
                sum += part.size;
                (part, sum)
            }));
            if sum > SMALL {
                let k = directions
                    .partition_point(|&(_, end)| end <= s * sum)
                    .min(directions.len() - 1);
                let (part, end) = &directions[k];
                let s = ((s * sum - (end - part.size)) / part.size).clamp(0.0, 1.0);
                let direction = part.direction(s, t);
                let rise = self.to.normal.dot(direction);
                let along = self.to.normal.dot(self.to.triangles[0][0] - x) / rise;
                let cosine = self.from.normal.dot(direction);
                if !(along > 0.0 && along.is_finite() && cosine > 0.0) {
                    return (0.0, [x; 2]);
                }
                return (self.from.area * sum * cosine / PI, [x, x + along * direction]);
            }
        }
        let y = self.to.point(s, t);
        let r = y - x;
        let squared = r.length_squared();
        let cosines = self.from.normal.dot(r).max(0.0) * (-self.to.normal.dot(r)).max(0.0);
        let kernel = cosines / (PI * squared * squared);
        let weight = self.from.area * self.to.area * kernel;
        (if weight.is_finite() { weight } else { 0.0 }, [x, y])
    }
}

/// The directions in which a point sees a triangle.
struct SolidAngle {
    /// Unit vectors to the corners.
    corners: [DVec3; 3],
    /// In sr; 0 where it has none.
    size: f64,
}

impl SolidAngle {
    fn of(triangle: &[DVec3; 3], point: DVec3) -> Self {
        let [a, b, c] = triangle.map(|v| (v - point).normalize_or_zero());
        let are_apart = |p: DVec3, q: DVec3| p.cross(q).length_squared() > 0.0;
        // Van Oosterom and Strackee 1983: exact for small angles too.
        let volume = a.dot(b.cross(c)).abs();
        let size = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        Self {
            corners: [a, b, c],
            size: if size.is_finite() && are_apart(a, b) && are_apart(b, c) && are_apart(c, a) {
                size.max(0.0)
            } else {
                0.0
            },
        }
    }

    /// Maps the unit square to the directions, uniformly by solid angle.
    fn direction(&self, u: f64, v: f64) -> DVec3 {
        let [a, b, c] = self.corners;
        // The angle of the spherical triangle at the first corner.
        let [ab, ca] = [a.cross(b), c.cross(a)].map(DVec3::normalize_or_zero);
        let angle = (-ca).dot(ab).clamp(-1.0, 1.0).acos();
        let (sin, cos) = angle.sin_cos();
        let (s, t) = (u * self.size - angle).sin_cos();
        let (p, q) = (t - cos, s + sin * a.dot(b));
        let along = (((q * t - p * s) * cos - q) / ((q * s + p * t) * sin)).clamp(-1.0, 1.0);
        let towards = |axis: DVec3, other: DVec3| (other - axis * axis.dot(other)).normalize_or_zero();
        let end = along * a + (1.0 - along * along).max(0.0).sqrt() * towards(a, c);
        let height = 1.0 - v * (1.0 - end.dot(b));
        (height * b + (1.0 - height * height).max(0.0).sqrt() * towards(b, end)).normalize_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_fill_a_solid_angle_evenly() {
        let triangle = [
            DVec3::new(1.0, 0.2, 0.5),
            DVec3::new(0.1, 1.5, 0.4),
            DVec3::new(-0.3, -0.4, 2.0),
        ];
        let all = SolidAngle::of(&triangle, DVec3::ZERO);
        // Of the directions, each part holds its share of the solid angle.
        let middle = triangle[1].midpoint(triangle[2]);
        let part = SolidAngle::of(&[triangle[0], triangle[1], middle], DVec3::ZERO);
        let edge = triangle[0].cross(middle);
        let n = 200_u32;
        let inside = (0..n * n).filter(|k| {
            let [u, v] = [k % n, k / n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
            edge.dot(all.direction(u, v)) * edge.dot(triangle[1]) > 0.0
        });
        let share = inside.count() as f64 / f64::from(n * n);
        assert!((share - part.size / all.size).abs() < 2e-3, "{share}");
    }
}
