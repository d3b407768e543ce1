//! The exchange area of two polygons past many occluders, from rays between them.

use std::f64::consts::PI;

use glam::DVec3;

use super::flat::Flat;
use super::shadow::EDGE_ON;
use super::{Partial, Whole};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::geometry::sampling::{PointStream, Sequence};
use crate::visibility::occluders::Occluder;

/// Independent scrambles, whose spread is the error.
const SCRAMBLES: usize = 16;

/// The first number of rays of each scramble; it is doubled until the error is small enough.
const FIRST: usize = 2;

/// The error in standard errors of the mean.
///
/// Of Student's distribution with 15 degrees of freedom, 999 in 1,000 are within 4.07; a stop at a spread that is small by chance needs a margin.
const SPREADS: f64 = 4.5;

/// The number of rays that may have missed an occluder, where some were stopped and others passed.
const MISSED: f64 = 3.0;

/// The same where all were stopped, or none: in three of 10,000 cases, n rays all miss a part that 8 in n would meet.
const MISSED_BY_ALL: f64 = 8.0;

/// The distance, in radii of the target, below which directions are drawn instead of points: the kernel has a peak there.
const NEAR: f64 = 2.0;

/// The solid angle in sr below which no directions are drawn.
const SMALL: f64 = 1e-3;

/// The fewest occluders apart from sides of solids for rays; fewer are clipped, unless there are solids too.
const MIN_LOOSE: usize = 3;

/// The same for all occluders.
const MIN_ALL: usize = 5;

/// The share of the allowed error for rays: the true errors of clipping are mostly far smaller than stated, those of rays are not, and rows have many of them.
const SHARE: f64 = 0.3;

/// How many times more clipping has to cost: its true errors are mostly far smaller, and rows gain from that.
const GAIN: f64 = 4.0;

/// The time of a ray, and of an occluder that it tests, in evaluations of the inner factor with one occluder.
const RAY: f64 = 0.5;
const LOOK: f64 = 0.02;

/// The cost of clipping: evaluations for each occluder, evaluations by loose corners, and the growth of each evaluation.
///
/// The second is for the square of the number of corners that loose occluders have beyond those of a connected surface, the third for the square of the number of occluders.
const CLIPS: f64 = 30.0;
const CROSSINGS: f64 = 10.0;
const SQUARE: f64 = 0.03;

/// Returns the most rays that a pair is worth, or `None` if clipping takes less time than rays.
///
/// A ray tests `n_sides` polygons of `n_occluders`, of which those that are no sides of solids have `n_corners`; `ratio` is the exchange area without occluders in units of the error allowed.
/// The error of n scrambled rays falls as n^(−5/8), as each is stopped or passes: between n^(−1/2) of independent rays and n^(−3/4) of the best for regions of four dimensions.
fn worth(n_occluders: usize, n_sides: usize, n_corners: usize, ratio: f64) -> Option<f64> {
    let [occluders, sides, corners] = [n_occluders, n_sides, n_corners].map(|n| n as f64);
    let expected = (SCRAMBLES * FIRST) as f64 + (0.5 * SPREADS * ratio).powf(1.6);
    let of_ray = RAY + LOOK * sides;
    let n_clips = CLIPS * occluders + CROSSINGS * (corners - occluders).max(0.0).powi(2);
    let of_clips = n_clips * (1.0 + SQUARE * occluders * occluders);
    // Rays in vain take as long as clipping, at most.
    (GAIN * expected * of_ray < of_clips).then_some(of_clips / of_ray)
}

/// Returns the exchange area of two polygons with occluders between them to within `goal`, m², by rays.
///
/// `None` where clipping takes less time, or rays turn out to take more than expected.
/// `count` is the number of occluders, at most three sides for each solid; `whole` is the exchange area without them.
///
/// A F = whole − ∫∫ K (1 − V) dA dA, by scrambled Sobol points on one polygon and on the other, or in the solid angle of the other where that is near; the part of `whole` that the unoccluded kernel K misses on the same rays
/// is corrected in proportion. Sixteen independent scrambles: the error is 4.5 standard errors of their mean, and the part that all rays may have missed. Equal arguments give equal bits.
/// Source: [`OWEN_1997`](crate::references::OWEN_1997) for the points; directions by J. Arvo, "Stratified Sampling of Spherical Triangles", SIGGRAPH 1995. Departures: none.
pub(in crate::form_factor) fn by_rays(
    sides: [&[DVec3]; 2],
    occluders: &[Occluder<'_>],
    count: usize,
    goal: f64,
    whole: Whole,
) -> Option<Partial> {
    let loose = || occluders.iter().filter(|occluder| !occluder.one_sided);
    let n_loose = loose().count();
    if n_loose < MIN_LOOSE && count < MIN_ALL {
        return None;
    }
    let enough = SHARE * goal;
    let most = worth(count, occluders.len(), n_corners(loose()), whole.area / enough)?;
    let between = Between::new(sides, occluders)?;
    let mut streams = between.streams();
    let (mut n, mut sums) = (FIRST, [[0.0; 3]; SCRAMBLES]);
    let (mut last, mut n_done, mut n_seeing, mut n_stopped) = (0, 0, 0, 0);
    loop {
        for (stream, [all, hidden, squared]) in streams.iter_mut().zip(&mut sums) {
            for _ in n_done..n {
                let (weight, ends) = between.ray(stream.next_point());
                *all += weight;
                *squared += weight * weight;
                if weight > 0.0 {
                    n_seeing += 1;
                    if between.is_stopped(ends, &mut last) {
                        *hidden += weight;
                        n_stopped += 1;
                    }
                }
            }
        }
        n_done = n;
        let n_rays = n * SCRAMBLES;
        let are_alike = n_stopped == 0 || n_stopped == n_seeing;
        let found = estimate(&sums, n, are_alike, whole);
        if found.error <= enough {
            return Some(Partial {
                exchange_area: found.area,
                error: found.error,
                n_evaluations: 0,
                n_rays,
                reached: true,
            });
        }
        n *= 2;
        if (n * SCRAMBLES) as f64 > most {
            return None;
        }
    }
}

/// Returns the number of distinct corners of some polygons.
fn n_corners<'a>(polygons: impl Iterator<Item = &'a Occluder<'a>>) -> usize {
    let corners = polygons.flat_map(|polygon| polygon.corners.iter());
    let mut places: Vec<[u64; 3]> = corners.map(|v| v.to_array().map(|x| (x + 0.0).to_bits())).collect();
    places.sort_unstable();
    places.dedup();
    places.len()
}

/// Returns the estimate from `n` rays of each scramble; the sums are of the kernel on all rays, on the stopped ones, and of its squares on all. `are_alike` is true if all rays of positive weight are stopped, or none.
///
/// The error sums the spread of the scrambles, the part that the rays may have missed, and the error of the kernel on the rays; it is at most the visible or the hidden part, whichever is more.
/// Where the kernel differs from ray to ray, the rays count as fewer.
fn estimate(sums: &[[f64; 3]; SCRAMBLES], n: usize, are_alike: bool, whole: Whole) -> Whole {
    let count = SCRAMBLES as f64;
    let [all, hidden, squared] = [0, 1, 2].map(|k| sums.iter().map(|sum| sum[k]).sum::<f64>());
    let share = if all > 0.0 { hidden / all } else { 0.0 };
    let of_scramble = sums.map(|[all, hidden, _]| (hidden - share * all) / n as f64 + share * whole.area);
    let mean = of_scramble.iter().sum::<f64>() / count;
    let variance = of_scramble.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let n_rays = n * SCRAMBLES;
    let missed = if are_alike { MISSED_BY_ALL } else { MISSED };
    let area = (whole.area - mean).clamp(0.0, whole.area);
    let off = (all / n_rays as f64 - whole.area).abs() * share.max(1.0 - share);
    let unseen = if squared > 0.0 {
        (missed * squared / (all * all)).min(1.0)
    } else {
        1.0
    };
    let error = SPREADS * (variance / count).sqrt() + whole.area * unseen + off + whole.error;
    Whole {
        area,
        error: whole.bounded(area, error),
    }
}

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

/// A convex occluder, as a ray meets it.
struct Screen {
    plane: Flat,
    /// The heights up to which the ends of rays on either polygon count as in the plane.
    tolerances: [f64; 2],
    one_sided: bool,
    /// The corners, each with a vector that points inwards from the edge that begins there.
    edges: Vec<(DVec3, DVec3)>,
}

/// Two polygons and their occluders.
struct Between {
    from: Fan,
    to: Fan,
    is_near: bool,
    screens: Vec<Screen>,
    seed: u64,
}

impl Between {
    /// Prepares rays, which begin on the smaller polygon; `None` where the two do not face each other.
    fn new([p, q]: [&[DVec3]; 2], occluders: &[Occluder<'_>]) -> Option<Self> {
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
        let screens = occluders.iter().filter(|occluder| occluder.corners.len() >= 3);
        let screens = screens.map(|occluder| {
            let corners = &occluder.corners;
            let plane = Flat::of(corners);
            let next = corners.iter().cycle().skip(1);
            let tolerance = |side: &Vec<DVec3>| side.iter().map(|&v| plane.tolerance(v, EDGE_ON)).fold(0.0, f64::max);
            Screen {
                plane,
                tolerances: sides.each_ref().map(tolerance),
                one_sided: occluder.one_sided,
                edges: corners
                    .iter()
                    .zip(next)
                    .map(|(&a, &b)| (a, plane.normal.cross(b - a)))
                    .collect(),
            }
        });
        let numbers = sides.iter().flatten().flat_map(DVec3::to_array);
        let seed = numbers.fold(0_u64, |seed, x| {
            (seed.rotate_left(23) ^ x.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        });
        Some(Self {
            is_near: gap < NEAR * balls[1].1,
            screens: screens.collect(),
            from,
            to,
            seed,
        })
    }

    fn streams(&self) -> [PointStream; SCRAMBLES] {
        std::array::from_fn(|k| PointStream::new(Sequence::Sobol, self.seed, k as u64))
    }

    /// Returns the ends of a ray, and the kernel without occluders there, m², over the density of such rays.
    fn ray(&self, [u, v, s, t]: [f64; 4]) -> (f64, [DVec3; 2]) {
        let x = self.from.point(u, v);
        if self.is_near {
            let directions = self.to.triangles.iter().map(|triangle| SolidAngle::of(triangle, x));
            let directions: Vec<SolidAngle> = directions.collect();
            let sum: f64 = directions.iter().map(|d| d.size).sum();
            if sum > SMALL {
                let mut end = 0.0;
                let ends: Vec<f64> = directions
                    .iter()
                    .map(|d| {
                        end += d.size / sum;
                        end
                    })
                    .collect();
                let (k, s) = part_of(s, &ends);
                let direction = directions[k].direction(s, t);
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

    /// Returns whether an occluder stops a ray; the one that stopped the `last` is tested first.
    fn is_stopped(&self, [x, y]: [DVec3; 2], last: &mut usize) -> bool {
        let stops = |screen: &Screen| {
            let (h_x, h_y) = (screen.plane.height(x), screen.plane.height(y));
            let [t_x, t_y] = screen.tolerances;
            let from_front = h_x > t_x && h_y < -t_y;
            let from_back = h_x < -t_x && h_y > t_y;
            // A ray has no direction here: if it leaves a solid, it has entered it.
            if !(from_front || from_back && !screen.one_sided) {
                return false;
            }
            let met = x + (y - x) * (h_x / (h_x - h_y));
            screen
                .edges
                .iter()
                .all(|&(corner, inward)| inward.dot(met - corner) >= 0.0)
        };
        if self.screens.get(*last).is_some_and(stops) {
            return true;
        }
        match self.screens.iter().position(stops) {
            Some(k) => {
                *last = k;
                true
            }
            None => false,
        }
    }
}

/// The directions in which a point sees a triangle.
struct SolidAngle {
    /// Unit vectors to the corners.
    corners: [DVec3; 3],
    /// The angle of the spherical triangle at the first corner.
    angle: f64,
    /// In sr; 0 where it has none.
    size: f64,
}

impl SolidAngle {
    fn of(triangle: &[DVec3; 3], point: DVec3) -> Self {
        let [a, b, c] = triangle.map(|v| (v - point).normalize_or_zero());
        let [ab, bc, ca] = [a.cross(b), b.cross(c), c.cross(a)].map(DVec3::normalize_or_zero);
        // Van Oosterom and Strackee 1983: exact for small angles too.
        let volume = a.dot(b.cross(c)).abs();
        let size = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        Self {
            corners: [a, b, c],
            angle: (-ca).dot(ab).clamp(-1.0, 1.0).acos(),
            size: if size.is_finite() && ab != DVec3::ZERO && bc != DVec3::ZERO && ca != DVec3::ZERO {
                size.max(0.0)
            } else {
                0.0
            },
        }
    }

    /// Maps the unit square to the directions, uniformly by solid angle.
    fn direction(&self, u: f64, v: f64) -> DVec3 {
        let [a, b, c] = self.corners;
        let (sin, cos) = self.angle.sin_cos();
        let (s, t) = (u * self.size - self.angle).sin_cos();
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
    use crate::form_factor::partial::{Accuracy, exchange_area};

    fn square(corner: DVec3, a: DVec3, b: DVec3) -> Vec<DVec3> {
        vec![corner, corner + a, corner + a + b, corner + b]
    }

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

    /// Squares that face each other, touch along an edge, and lie far apart, with plates between: rays against clipping, and the stated error.
    #[test]
    fn rays_agree_with_clipping() {
        let floor = square(DVec3::ZERO, DVec3::X, DVec3::Y);
        let targets = [
            square(DVec3::Z, DVec3::Y, DVec3::X),
            square(DVec3::ZERO, DVec3::Y, DVec3::Z),
            square(DVec3::new(0.0, 0.0, 12.0), DVec3::Y, DVec3::X),
        ];
        let part = |k: i32, step: f64| (f64::from(k) * step.sqrt()).fract();
        let (mut n, mut n_beyond, mut worst) = (0, 0, 0.0_f64);
        for target in &targets {
            let whole = Whole::of(&floor, target, 0.0);
            for case in 0..40 {
                let plates: Vec<Vec<DVec3>> = (0..6)
                    .map(|k| {
                        let k = 6 * case + k;
                        let corner = DVec3::new(0.9 * part(k, 2.0), 0.9 * part(k, 3.0), 0.1 + 0.7 * part(k, 5.0));
                        square(
                            corner,
                            DVec3::X * 0.3 * part(k, 7.0),
                            DVec3::new(0.0, 0.3, 0.2 * part(k, 11.0)),
                        )
                    })
                    .collect();
                let occluders: Vec<Occluder<'_>> = plates
                    .iter()
                    .map(|corners| Occluder {
                        corners: corners.into(),
                        one_sided: false,
                        body: None,
                    })
                    .collect();
                let accuracy = Accuracy {
                    tolerance: 1e-5,
                    budget: 10_000_000,
                };
                let exact = exchange_area(&floor, target, &occluders, accuracy);
                for goal in [1.0, 0.1].map(|share| share * whole.area) {
                    // Enough occluders for rays to be worth it.
                    let by = |p: &[DVec3], q: &[DVec3]| by_rays([p, q], &occluders, 40, goal, whole);
                    let found = by(&floor, target).expect("enough rays");
                    assert_eq!(Some(found), by(target, &floor));
                    let off = (found.exchange_area - exact.exchange_area).abs() / (found.error + exact.error);
                    assert!(found.error <= goal && found.n_rays >= SCRAMBLES * FIRST);
                    (n, n_beyond) = (n + 1, n_beyond + usize::from(off > 1.0));
                    worst = worst.max(off);
                }
            }
        }
        assert!(n == 240 && n_beyond == 0, "{n_beyond} of {n}, {worst}");
        assert!(worst > 0.2, "{worst}: the error is stated too large");
    }

    #[test]
    fn rays_are_chosen_where_clipping_would_cost_more() {
        assert_eq!(worth(5, 5, 0, 1000.0), None);
        assert!(worth(30, 30, 20, 5.0).is_some_and(|most| most < 1e5));
        assert!(worth(40, 40, 120, 600.0).is_some(), "loose leaves");
        assert_eq!(worth(40, 40, 24, 600.0), None, "facets of a surface");
        assert_eq!(worth(12, 12, 36, 1e5), None);
        let square = square(DVec3::ZERO, DVec3::X, DVec3::Y);
        let whole = Whole { area: 1.0, error: 0.0 };
        assert_eq!(by_rays([&square, &square], &[], 2, 1.0, whole), None);
    }
}
