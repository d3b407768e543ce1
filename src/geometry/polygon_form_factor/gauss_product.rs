//! Product Gauss rules over both polygons, for pairs that are far apart against their sizes.

use std::f64::consts::PI;
use std::sync::OnceLock;

use glam::DVec3;

use super::facing::{FacingPair, Part};
use super::real::Real;

/// The largest order: 20 × 20 points a piece.
pub const LARGEST_ORDER: usize = 20;

/// A point of the square with its weight and its weights of the four corners.
pub(super) struct SquarePoint {
    pub(super) s: f64,
    pub(super) t: f64,
    pub(super) weight: f64,
    pub(super) shares: [f64; 4],
}

/// Returns the Gauss points of the unit square, order² of them.
pub(super) fn square_rule(order: usize) -> &'static [SquarePoint] {
    static RULES: [OnceLock<Vec<SquarePoint>>; LARGEST_ORDER] = [const { OnceLock::new() }; LARGEST_ORDER];
    RULES[order - 1].get_or_init(|| {
        let line = f64::line_rule(order);
        let point = |&(t, weight_t): &(f64, f64), &(s, weight_s): &(f64, f64)| SquarePoint {
            s,
            t,
            weight: weight_s * weight_t,
            shares: [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t],
        };
        line.iter()
            .flat_map(|outer| line.iter().map(move |inner| point(outer, inner)))
            .collect()
    })
}

/// Points on a piece of a polygon: coordinates, and weight times height over the other's plane.
struct Cloud<const N: usize> {
    n: usize,
    x: [f64; N],
    y: [f64; N],
    z: [f64; N],
    moment: [f64; N],
}

impl<const N: usize> Cloud<N> {
    fn new() -> Self {
        Self {
            n: 0,
            x: [0.0; N],
            y: [0.0; N],
            z: [0.0; N],
            moment: [0.0; N],
        }
    }

    /// Fills in the points of the k-th piece, seen from `-shift`.
    fn fill(&mut self, part: &Part, k: usize, shift: DVec3, order: usize) {
        let piece = &part.polygon.pieces()[k];
        let heights = piece.corners.map(|k| part.heights.get(k));
        let rule = square_rule(order);
        self.n = rule.len();
        for (k, point) in rule.iter().enumerate() {
            let (offset, element) = piece.at(point);
            (self.x[k], self.y[k], self.z[k]) = (shift + offset).into();
            let [f, g, h, i] = point.shares;
            let height = f * heights[0] + g * heights[1] + h * heights[2] + i * heights[3];
            self.moment[k] = point.weight * element * height;
        }
    }
}

/// Returns 1/π Σ w_i w_j h_i h_j / r_ij⁴ over the Gauss points of both parts, `orders` points along each side of their pieces.
///
/// h_i is the height of a point over the other polygon's plane, r cos θ: interpolated between the corners' heights, none of which
/// is negative, it keeps its digits where the planes nearly coincide.
pub(super) fn product_sum(pair: &FacingPair, orders: [usize; 2]) -> f64 {
    match orders[0].max(orders[1]) {
        0..=3 => sum_over_pieces::<9>(pair, orders),
        4 => sum_over_pieces::<16>(pair, orders),
        5..=8 => sum_over_pieces::<64>(pair, orders),
        _ => sum_over_pieces::<{ LARGEST_ORDER * LARGEST_ORDER }>(pair, orders),
    }
}

fn sum_over_pieces<const N: usize>(pair: &FacingPair, orders: [usize; 2]) -> f64 {
    let (mut first, mut second) = (Cloud::<N>::new(), Cloud::<N>::new());
    let shift = pair.shift();
    let mut sum = 0.0;
    for k in 0..pair.first.polygon.pieces().len() {
        first.fill(&pair.first, k, DVec3::ZERO, orders[0]);
        for l in 0..pair.second.polygon.pieces().len() {
            second.fill(&pair.second, l, shift, orders[1]);
            sum += cloud_sum(&first, &second);
        }
    }
    sum / PI
}

fn cloud_sum<const N: usize>(first: &Cloud<N>, second: &Cloud<N>) -> f64 {
    // One sum for each of the second's points: independent, so that the compiler can use vectors.
    let n = second.n;
    let mut sums = [0.0; N];
    let (xs, ys, zs, sums) = (&second.x[..n], &second.y[..n], &second.z[..n], &mut sums[..n]);
    for i in 0..first.n {
        let (x, y, z, moment) = (first.x[i], first.y[i], first.z[i], first.moment[i]);
        for j in 0..n {
            let (dx, dy, dz) = (xs[j] - x, ys[j] - y, zs[j] - z);
            let r_squared = dx * dx + dy * dy + dz * dz;
            sums[j] += moment / (r_squared * r_squared);
        }
    }
    sums.iter()
        .zip(&second.moment[..n])
        .map(|(sum, moment)| sum * moment)
        .sum()
}
