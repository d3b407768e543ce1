//! `gauss-lambert`: Gauss points on one patch, the exact form factor from each of them to the other.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::num::NonZeroUsize;

use glam::DVec3;

use super::entry::{MethodEntry, Work};
use super::facing;
use super::pairs::Exchange;
use super::sampled::{self, Sampled};
use super::segments::{Independence, PairSums, Segments, VisibleFraction};
use super::settings::FIVE_POINTS;
use super::{ComputeResult, FormFactorMethod, Input};
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{Tolerance, exchange_area};
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::matrix::StorageChoice;
use crate::progress::Progress;

/// The error of the rule, relative to the exchange area, above which its patch is cut.
///
/// A row that adds up such errors is off by at most that part of all light.
const RULE_TOLERANCE: f64 = 1e-3;

/// The most points on the parts of a patch.
const MAX_POINTS: usize = 4096;

/// The fewest points along each side of a part: with one, the error falls so slowly with cuts that thousands are needed where a few do with two.
const MIN_POINTS_OF_PARTS: NonZeroUsize = NonZeroUsize::new(2).unwrap();

/// Gauss points on one patch of each pair, exact point-to-polygon form factors to the other.
///
/// A_i F_ij = v A_i Σ_p w_p F(x_p → j), with F by [`point_form_factor`] and v = Σ_p w_p F(x_p → j) Σ_s k_ps V_ps / Σ_s k_ps over Σ_p w_p F(x_p → j) the visible fraction by rays from
/// q × q points x_p to q × q Gauss points of the other patch, k the integrand times the Gauss weight.
///
/// The points lie on the patch for which d / (R √A) is greater, with d its middle's distance from the edges of the other, R its radius and A its area. The rule converges
/// with d / R, as F changes fast beside edges that are near; where it does not converge, its error is at most A. (The area alone puts the points on a long narrow strip of which the
/// other patch sees little; d / R alone puts them on a plate although a narrow strip close to it is all that they should meet.)
/// Where the rule is further than 0.001 of the entry from the exact exchange area, one point becomes 2 × 2, and where that is not enough the patch is cut, across its longest side and at the
/// greatest errors first, with q × q points on each part, and at least 2 × 2, until it is nearer or there are 4096 points.
///
/// Order: 2q between patches apart from each other; where they touch still high, as the exact inner integral leaves only a weak singularity
/// of higher derivatives (3e-8 in a cube of 216 patches with q = 5). Bias: that of the rule, seldom above 0.001 of the entry as the patch is cut then; and about
/// q^(−3/2) of the entry at the border of a shadow. 0 ≤ A_i F_ij ≤ the smaller patch's area.
/// Error of an entry: the distance of the rule from the exact exchange area without occluders, as far as the pair is visible, plus the error of the visible
/// fraction and 1e-14 of the smaller area for rounding.
///
/// Source: [`LAMBERT_1760`](crate::references::LAMBERT_1760); the combination is folklore. Departures: none.
#[derive(Clone, Copy, Debug)]
pub struct GaussLambert {
    /// q, the number of Gauss points along each side.
    pub points: NonZeroUsize,
}

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "gauss-lambert",
    summary: "Gauss points on one patch, exact to the other",
    settings: &[FIVE_POINTS],
    work: Work::Pairs,
    make: |s| Some(Box::new(GaussLambert { points: s.points()? })),
};

impl FormFactorMethod for GaussLambert {
    fn name(&self) -> &'static str {
        "gauss-lambert"
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let patches = &input.mesh.patches;
        let polygons = facing::prepared(input.mesh);
        let rule = GaussProduct::new(self.points);
        let rule_of_parts = GaussProduct::new(self.points.max(MIN_POINTS_OF_PARTS));
        let points = facing::polygons(input.mesh, |corners| rule.on_polygon(corners));
        let finer = (self.points < MIN_POINTS_OF_PARTS)
            .then(|| facing::polygons(input.mesh, |corners| rule_of_parts.on_polygon(corners)));
        let outer_first = |[i, j]: [usize; 2]| {
            let suits = |k: usize, other: usize| {
                let distance = polygon::distance_from_edges(patches[k].centroid, polygons[other].corners());
                distance / polygons[k].radius() * (patches[other].area / patches[k].area).sqrt().sqrt()
            };
            // Rounding must not choose between equal patches: a moved scene would get another rule.
            let swaps = suits(j, i) > (1.0 + 1e-9) * suits(i, j) + 1e-9;
            if swaps { [j, i] } else { [i, j] }
        };
        let factor = |[outer, inner]: [usize; 2], x: DVec3| {
            point_form_factor(x, patches[outer].normal, polygons[inner].corners())
        };
        let method = Sampled {
            independence: Independence::SharedEnds,
            sample: |segments: &mut Segments<'_>, owner: usize, pair: [usize; 2]| {
                if segments.is_known(owner) {
                    return;
                }
                let [outer, inner] = outer_first(pair);
                let ends = [outer, inner].map(|k| (&patches[k], points[k].as_slice()));
                let [(from, from_points), (to, to_points)] = ends;
                segments.join(owner, (outer, from_points), (inner, to_points), |x, weights| {
                    weights.extend(sampled::by_kernel((from, x), (to, to_points)));
                    let total: f64 = weights.iter().sum();
                    // Zero if no point of the other patch is above the horizon although a sliver of it is.
                    if total > 0.0 {
                        from.area * x.weight * factor([outer, inner], x.position) / total
                    } else {
                        0.0
                    }
                });
                sampled::join_parts_in_front(segments, input.mesh, owner, pair);
            },
            exchange: |pair: [usize; 2], sums: PairSums, visible: VisibleFraction| {
                let [outer, inner] = outer_first(pair);
                let exact = exchange_area(&polygons[outer], &polygons[inner], Tolerance::default());
                let integrand = |x: DVec3| factor([outer, inner], x);
                let smaller = patches[outer].area.min(patches[inner].area);
                let tolerance = RULE_TOLERANCE * exact.value + 1e-12 * smaller;
                let is_near = |area: f64| (area - exact.value).abs() <= tolerance;
                let first = integral(patches[outer].area, &points[outer], integrand);
                let whole = match &finer {
                    Some(finer) if !is_near(first) => integral(patches[outer].area, &finer[outer], integrand),
                    _ => first,
                };
                let area = if is_near(whole) {
                    whole
                } else {
                    Division::new(polygons[outer].corners(), whole, &rule_of_parts, &integrand).refined(is_near)
                };
                let area = area.min(smaller);
                let unoccluded = Exchange {
                    area,
                    // With a margin, as errors are stored in f32.
                    error: 1.01 * (area - exact.value).abs() + exact.error,
                };
                let mut exchange = unoccluded.times(visible.beside(sums.by_kernel, exact.value));
                exchange.error += 1e-14 * smaller;
                Ok(exchange)
            },
        };
        method.compute(input, storage, progress)
    }
}

/// A patch in parts, with the integral of a factor over each.
struct Division<'a, F> {
    rule: &'a GaussProduct,
    factor: &'a F,
    parts: Vec<Part>,
    /// The parts that may still be cut: the integral's possible error, as an exponent of 2, and the part's number.
    ///
    /// The order of cutting decides between equal doubts, and
    /// nearly equal ones count as equal, so that rounding does not decide in a scene that has been moved.
    open: BinaryHeap<(i32, Reverse<usize>)>,
    integral: f64,
}

/// A part of a patch.
struct Part {
    corners: Vec<DVec3>,
    integral: f64,
}

impl<'a, F: Fn(DVec3) -> f64> Division<'a, F> {
    /// Makes a division of one part, with its integral.
    fn new(corners: &[DVec3], integral: f64, rule: &'a GaussProduct, factor: &'a F) -> Self {
        let corners = corners.to_vec();
        let whole = Part { corners, integral };
        Self {
            rule,
            factor,
            parts: vec![whole],
            open: BinaryHeap::from([(0, Reverse(0))]),
            integral,
        }
    }

    /// Returns the integral over all parts after halving the most doubtful ones, until it is near its exact value or [`MAX_POINTS`] are used up.
    ///
    /// The doubt about a half is half of the change by the halving, against the whole patch, and at least an eighth of the doubt before. Regions
    /// that all points of a part miss are so found in time.
    fn refined(mut self, is_near: impl Fn(f64) -> bool) -> f64 {
        let area = polygon::area_vector(&self.parts[0].corners).length();
        let most_cuts = MAX_POINTS / (2 * self.rule.n_points());
        for _ in 0..most_cuts {
            if is_near(self.integral) {
                break;
            }
            let Some((doubt, Reverse(number))) = self.open.pop() else {
                break;
            };
            let part = &self.parts[number];
            let halves = halves(&part.corners).map(|corners| Part {
                integral: integral(
                    polygon::area_vector(&corners).length(),
                    &self.rule.on_polygon(&corners),
                    self.factor,
                ),
                corners,
            });
            let change = halves.iter().map(|half| half.integral).sum::<f64>() - part.integral;
            self.integral += change;
            let doubt = exponent(0.5 * change.abs() / area).max(doubt - 3);
            for half in halves {
                self.open.push((doubt, Reverse(self.parts.len())));
                self.parts.push(half);
            }
        }
        self.integral
    }
}

/// Returns the greatest n with 2^n ≤ x, for x ≥ 0.
fn exponent(x: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "from -1075 on, or the least of all of 0")]
    let n = x.log2().floor() as i32;
    n
}

fn integral(area: f64, points: &[WeightedPoint], factor: impl Fn(DVec3) -> f64) -> f64 {
    area * points.iter().map(|x| x.weight * factor(x.position)).sum::<f64>()
}

/// Cuts a triangle or a quad through the middle of its longest side, a quad through that of the opposite side too.
fn halves(corners: &[DVec3]) -> [Vec<DVec3>; 2] {
    let n = corners.len();
    let corner = |k: usize| corners[k % n];
    let length = |k: usize| corner(k).distance(corner(k + 1));
    // The first one of equal sides, whatever rounding makes of them.
    let longest = (1..n).fold(0, |best, k| {
        if length(k) > (1.0 + 1e-9) * length(best) {
            k
        } else {
            best
        }
    });
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| corner(longest + k));
    let middle = a.midpoint(b);
    if n == 3 {
        return [vec![a, middle, c], vec![middle, b, c]];
    }
    let opposite = c.midpoint(d);
    [vec![a, middle, opposite, d], vec![middle, b, c, opposite]]
}
