//! Product Gauss rules over both polygons, for pairs that are far apart against their sizes.

use std::f64::consts::PI;
use std::sync::OnceLock;

use glam::DVec3;

use super::facing::{FacingPair, Part};
use super::prepared::Piece;
use super::real::Real;

/// The largest order: 20 × 20 points a piece.
pub const LARGEST_ORDER: usize = 20;

/// Gauss points of the unit square: positions, weights, and weights of the four corners.
pub(super) struct SquareRule {
    pub(super) s: Vec<f64>,
    pub(super) t: Vec<f64>,
    pub(super) weight: Vec<f64>,
    pub(super) shares: [Vec<f64>; 4],
}

/// Returns the Gauss rule of the unit square with order² points.
pub(super) fn square_rule(order: usize) -> &'static SquareRule {
    static RULES: [OnceLock<SquareRule>; LARGEST_ORDER] = [const { OnceLock::new() }; LARGEST_ORDER];
    RULES[order - 1].get_or_init(|| {
        let line = f64::line_rule(order);
        let over_square = |value: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            line.iter()
                .flat_map(|outer| line.iter().map(|inner| value(inner.0, outer.0)))
                .collect()
        };
        let weights = line.iter().flat_map(|outer| line.iter().map(|inner| inner.1 * outer.1));
        SquareRule {
            s: over_square(&|s, _| s),
            t: over_square(&|_, t| t),
            weight: weights.collect(),
            shares: [
                over_square(&|s, t| (1.0 - s) * (1.0 - t)),
                over_square(&|s, t| s * (1.0 - t)),
                over_square(&|s, t| s * t),
                over_square(&|s, t| (1.0 - s) * t),
            ],
        }
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

    /// Fills in the points of a piece, seen from `-shift`.
    fn fill(&mut self, part: &Part, piece: &Piece, shift: DVec3, order: usize) {
        let heights = piece.corners.map(|corner| part.heights.get(corner));
        let [a, b, c, d] = piece.offsets.map(|corner| shift + corner);
        let rule = square_rule(order);
        let n = rule.weight.len();
        self.n = n;
        // One plain loop for each array, so that the compiler can use vectors.
        let [f, g, h, i] = [0, 1, 2, 3].map(|corner| &rule.shares[corner][..n]);
        let fill = |place: &mut [f64], values: [f64; 4]| {
            for k in 0..n {
                place[k] = f[k] * values[0] + g[k] * values[1] + h[k] * values[2] + i[k] * values[3];
            }
        };
        fill(&mut self.x[..n], [a.x, b.x, c.x, d.x]);
        fill(&mut self.y[..n], [a.y, b.y, c.y, d.y]);
        fill(&mut self.z[..n], [a.z, b.z, c.z, d.z]);
        fill(&mut self.moment[..n], heights);
        let [element, element_s, element_t] = piece.elements;
        let (along_s, along_t) = (element_s - element, element_t - element);
        let (s, t, weight, moment) = (&rule.s[..n], &rule.t[..n], &rule.weight[..n], &mut self.moment[..n]);
        for k in 0..n {
            moment[k] *= weight[k] * (element + s[k] * along_s + t[k] * along_t);
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
    let mut sum = 0.0;
    for piece in pair.first.polygon.pieces() {
        first.fill(&pair.first, piece, DVec3::ZERO, orders[0]);
        for other in pair.second.polygon.pieces() {
            second.fill(&pair.second, other, pair.shift, orders[1]);
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
