//! All pairs of rectangles of two grids with parallel edges, from values at the grids' corners.
//!
//! The closed form of one pair is a sum over sixteen pairs of corners, and neighbours have corners in common: with one value for each pair of
//! corners of the two grids, a pair of rectangles costs about one value and sixteen additions, not the sixteen values of
//! [`rectangle_exchange_area`](super::rectangle_exchange_area).

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]
#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::ANGLE_TOLERANCE;
use crate::geometry::point_form_factor::angle_over_tangent;

/// A rectangle cut along lines into cells, all in one plane.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) origin: DVec3,
    /// Unit vectors along the edges; the front faces along x × y.
    pub(crate) axes: [DVec3; 2],
    /// Coordinates along each axis from the origin, ascending, in m.
    pub(crate) lines: [Vec<f64>; 2],
}

impl Grid {
    fn normal(&self) -> DVec3 {
        self.axes[0].cross(self.axes[1])
    }

    pub(crate) fn at(&self, x: f64, y: f64) -> DVec3 {
        self.origin + self.axes[0] * x + self.axes[1] * y
    }

    fn outer_corners(&self) -> [DVec3; 4] {
        let [x, y] = self.lines.each_ref().map(|lines| [lines[0], lines[lines.len() - 1]]);
        [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, j]| self.at(x[i], y[j]))
    }
}

/// Two grids whose cells all have a closed form with one another.
pub(crate) struct GridPair {
    position: Position,
    /// The axis of each grid that runs along the common direction (of parallel grids: along the first's first axis).
    common_axes: [usize; 2],
    /// The lines of the first and of the second grid along the common direction, then those along their other axes; in diameters of both grids.
    lines: [Vec<f64>; 4],
    /// −1 where an odd number of these lists descends.
    sign: f64,
    diameter: f64,
    /// The greatest distance of corners of the second grid from these lists, in m.
    misplaced: f64,
}

#[derive(Clone, Copy, Debug)]
enum Position {
    /// Face to face at this distance, in diameters.
    Parallel(f64),
    /// The other axes' lines are distances from the line in which the planes meet.
    Perpendicular,
}

impl GridPair {
    /// Returns `None` where edges are not parallel, or where the fronts of parallel grids do not face each other.
    pub(crate) fn new(from: &Grid, to: &Grid) -> Option<Self> {
        let frame = [from.axes[0], from.axes[1], from.normal()];
        // The axis of the frame along which each axis of the second grid and its normal runs.
        let along = |v: DVec3| {
            let mut large = (0..3).filter(|&k| frame[k].dot(v).abs() > ANGLE_TOLERANCE);
            large.next().filter(|_| large.next().is_none())
        };
        let [x, y, flat] = [to.axes[0], to.axes[1], to.normal()].map(along);
        let (to_axes, flat) = ([x?, y?], flat?);
        let shift = to.origin - from.origin;
        let placed = |axis: usize| -> Vec<f64> {
            let own = frame[to_axes[axis]];
            let (start, sign) = (own.dot(shift), own.dot(to.axes[axis]).signum());
            to.lines[axis].iter().map(|line| start + sign * line).collect()
        };
        let level = frame[flat].dot(shift);
        let faces = frame[flat].dot(to.normal()).signum();
        let all: Vec<DVec3> = from.outer_corners().into_iter().chain(to.outer_corners()).collect();
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = all.iter().fold(none, |(low, high), &v| (low.min(v), high.max(v)));
        let diameter = (high - low).length();
        let own_axis = if flat == 2 { 0 } else { 1 - flat };
        let to_axis = (0..2).find(|&k| to_axes[k] == own_axis)?;
        let mut lines = [
            from.lines[own_axis].clone(),
            placed(to_axis),
            from.lines[1 - own_axis].clone(),
            placed(1 - to_axis),
        ];
        let position = if flat == 2 {
            if faces > 0.0 || level <= 8.0 * f64::EPSILON * diameter {
                return None;
            }
            Position::Parallel(level / diameter)
        } else {
            // The part behind the other's plane is cut off.
            for x in &mut lines[2] {
                *x = (faces * (*x - level)).max(0.0);
            }
            for z in &mut lines[3] {
                *z = z.max(0.0);
            }
            Position::Perpendicular
        };
        let mut sign = 1.0;
        for list in &mut lines {
            if list[0] > list[list.len() - 1] {
                sign = -sign;
            }
            for line in list {
                *line /= diameter;
            }
        }
        // The frame's axes are those of the first grid; the second's own directions differ by rounding, or by a little more.
        let off = |k: usize, v: DVec3| v - frame[k] * frame[k].dot(v).signum();
        let reach = |axis: usize| to.lines[axis].iter().fold(0.0_f64, |m, line| m.max(line.abs()));
        let misplaced = (0..2)
            .map(|axis| reach(axis) * off(to_axes[axis], to.axes[axis]).length())
            .sum();
        Some(Self {
            position,
            common_axes: [own_axis, to_axis],
            lines,
            sign,
            diameter,
            misplaced,
        })
    }

    /// Returns the bound of the absolute error of every pair, in m²: the sums' rounding, and the effect of corners that are off by up to `off` m.
    ///
    /// The first part is that of [`rectangle_exchange_area`](super::rectangle_exchange_area) with both grids' diameter. A contour that is moved by δ changes an
    /// exchange area by less than δ times its length, because the form factor from any point of it is at most 1; `perimeters` are those of the largest cells.
    pub(crate) fn error(&self, off: f64, perimeters: [f64; 2]) -> f64 {
        let moved = off + self.misplaced + 4.0 * f64::EPSILON * self.diameter;
        3e-15 * self.diameter * self.diameter + moved * (perimeters[0] + perimeters[1])
    }

    /// Calls `emit(cell of the first grid, cell of the second grid, A₁F₁₂ in m²)` for all pairs of cells; a cell has a number along each axis.
    ///
    /// A₁F₁₂ = 1/(2π) Δ_a Δ_b Δ_c Δ_d C, differences along the four lists of lines, with
    /// C = (u² − d²)/4 ln(u² + d²) + d u atan(u/d) for perpendicular grids, u = a − b and d² = c² + d²;
    /// C = −h²/2 ln(u² + v² + h²) + u √(v² + h²) atan(u/√(v² + h²)) + v √(u² + h²) atan(v/√(u² + h²)) for parallel ones at the distance h, v = c − d.
    /// That is G of the closed form without the terms that cancel in the differences.
    pub(crate) fn for_each(&self, mut emit: impl FnMut([usize; 2], [usize; 2], f64)) {
        let [a, b, c, d] = &self.lines;
        let [n_b, n_c, n_d] = [b, c, d].map(|lines| lines.len() - 1);
        let corners = Corners::new(self.position, c, d);
        let n = corners.squared.len();
        let scale = self.sign * self.diameter * self.diameter / TAU;
        let (mut before, mut now) = (vec![0.0; b.len() * n], vec![0.0; b.len() * n]);
        let mut difference = vec![0.0; n];
        let numbers =
            |axis: usize, common: usize, other: usize| if axis == 0 { [common, other] } else { [other, common] };
        for (i, &a) in a.iter().enumerate() {
            for (&b, values) in b.iter().zip(now.chunks_exact_mut(n)) {
                corners.evaluate((a - b).abs(), values);
            }
            if i > 0 {
                for j in 0..n_b {
                    let [low, high]: [Range<usize>; 2] = [j, j + 1].map(|k| k * n..(k + 1) * n);
                    let sources = now[low.clone()].iter().zip(&now[high.clone()]);
                    let sources = sources.zip(before[low].iter().zip(&before[high]));
                    for (place, ((now_low, now_high), (before_low, before_high))) in difference.iter_mut().zip(sources)
                    {
                        *place = (now_low - now_high) - (before_low - before_high);
                    }
                    for k in 0..n_c {
                        let (low, high) = (&difference[k * (n_d + 1)..], &difference[(k + 1) * (n_d + 1)..]);
                        for l in 0..n_d {
                            let sum = (high[l] - high[l + 1]) - (low[l] - low[l + 1]);
                            let [own, to] = self.common_axes;
                            emit(numbers(own, i - 1, k), numbers(to, j, l), (scale * sum).max(0.0));
                        }
                    }
                }
            }
            std::mem::swap(&mut before, &mut now);
        }
    }
}

/// The corner function for all pairs of a line of the first grid and one of the second, across the common direction.
struct Corners {
    position: Position,
    /// c² + d², or v² + h² of parallel grids.
    squared: Vec<f64>,
    /// The square roots of these.
    root: Vec<f64>,
    /// v of parallel grids.
    across: Vec<f64>,
}

impl Corners {
    fn new(position: Position, first: &[f64], second: &[f64]) -> Self {
        let pairs = || first.iter().flat_map(|c| second.iter().map(move |d| (c, d)));
        let across: Vec<f64> = pairs().map(|(c, d)| (c - d).abs()).collect();
        let squared: Vec<f64> = match position {
            Position::Perpendicular => pairs().map(|(c, d)| c * c + d * d).collect(),
            Position::Parallel(h) => across.iter().map(|v| v * v + h * h).collect(),
        };
        Self {
            position,
            root: squared.iter().map(|d| d.sqrt()).collect(),
            squared,
            across,
        }
    }

    /// Sets the corner function at the distance `u` ≥ 0 along the common direction.
    fn evaluate(&self, u: f64, values: &mut [f64]) {
        let n = values.len();
        Arch::new().dispatch(Evaluation {
            position: self.position,
            u,
            squared: &self.squared[..n],
            root: &self.root[..n],
            across: &self.across[..n],
            values,
        });
    }
}

/// One call of [`Corners::evaluate`], to be compiled for several instruction sets.
struct Evaluation<'a> {
    position: Position,
    u: f64,
    squared: &'a [f64],
    root: &'a [f64],
    across: &'a [f64],
    values: &'a mut [f64],
}

impl WithSimd for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (u, n) = (self.u, self.values.len());
        let (squared, root, across, values) = (&self.squared[..n], &self.root[..n], &self.across[..n], self.values);
        match self.position {
            Position::Perpendicular => {
                for k in 0..n {
                    let (d_squared, d) = (squared[k], root[k]);
                    let logarithm = ln(u.mul_add(u, d_squared));
                    values[k] = (0.25 * logarithm).mul_add(u.mul_add(u, -d_squared), d * u * angle(u, d));
                }
            }
            Position::Parallel(h) => {
                let half = -0.5 * h * h;
                let other_root = u.hypot(h);
                for k in 0..n {
                    let (v, d) = (across[k], root[k]);
                    let angles = (u * d).mul_add(angle(u, d), v * other_root * angle(v, other_root));
                    values[k] = half.mul_add(ln(u.mul_add(u, squared[k])), angles);
                }
            }
        }
    }
}

/// Returns ln x for a normal x > 0 with an error below 3e-16 (1 + |ln x|), and for 0 some finite number.
///
/// It has no branches, so that the compiler can use vectors.
#[inline(always)]
fn ln(x: f64) -> f64 {
    /// The bits of √½: mantissas from there to √2 make 1.
    const ROOT_OF_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const ONE: u64 = 1023 << 52;
    /// 2⁵² + 2⁵¹, to whose bits a small integer is added to make it a number.
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    /// 2/(2k + 1), highest first: the series of 2 artanh f in f², up to f² = 0.0295; the omitted part is below 3e-18.
    const SERIES: [f64; 10] = [
        2.0 / 21.0,
        2.0 / 19.0,
        2.0 / 17.0,
        2.0 / 15.0,
        2.0 / 13.0,
        2.0 / 11.0,
        2.0 / 9.0,
        2.0 / 7.0,
        2.0 / 5.0,
        2.0 / 3.0,
    ];
    let bits = x.to_bits();
    let exponent = (bits.wrapping_sub(ROOT_OF_HALF).wrapping_add(ONE) >> 52).wrapping_sub(1023);
    let mantissa = f64::from_bits(bits.wrapping_sub(exponent << 52));
    let power = f64::from_bits(MAGIC.to_bits().wrapping_add(exponent)) - MAGIC;
    let f = (mantissa - 1.0) / (mantissa + 1.0);
    let f_squared = f * f;
    let sum = SERIES
        .iter()
        .fold(0.0_f64, |sum, coefficient| sum.mul_add(f_squared, *coefficient));
    power.mul_add(std::f64::consts::LN_2, (f * f_squared).mul_add(sum, 2.0 * f))
}

/// Returns arctan(y/x) for x, y ≥ 0, and 0 for both 0, with an error below 4e-16; without branches.
#[inline(always)]
fn angle(y: f64, x: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_8, SQRT_2};
    let (low, high) = if y <= x { (y, x) } else { (x, y) };
    // Turned by 0, π/8 or π/4 the tangent is at most tan(π/16) = 0.199.
    let (tangent, turn) = if low > 0.668_178_637_919_298_9 * high {
        (1.0, FRAC_PI_4)
    } else if low > 0.198_912_367_379_658 * high {
        (SQRT_2 - 1.0, FRAC_PI_8)
    } else {
        (0.0, 0.0)
    };
    let across = (-tangent).mul_add(high, low);
    let along = tangent.mul_add(low, high).max(f64::MIN_POSITIVE);
    let t = across / along;
    let angle = t.mul_add(angle_over_tangent(t * t), turn);
    if y <= x { angle } else { FRAC_PI_2 - angle }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::DQuat;

    use super::super::rectangle_exchange_area;
    use super::*;

    #[test]
    fn logarithms_and_angles_are_those_of_the_library() {
        for k in 0..20_000 {
            let x = 10.0_f64.powf(f64::from(k) * 1e-3 - 19.5);
            let error = (ln(x) - x.ln()).abs();
            assert!(error <= 3e-16 * (1.0 + x.ln().abs()), "{x:e} {error:e}");
            for (y, z) in [(x, 1.0), (1.0, x), (x, 0.3 * x), (0.41 * x, x)] {
                let off = (angle(y, z) - y.atan2(z)).abs();
                assert!(off <= 4e-16, "{y:e} {z:e} {off:e}");
            }
        }
        assert!(ln(0.0).is_finite());
        assert_eq!([angle(0.0, 0.0), angle(0.0, 1.0)].map(f64::to_bits), [0, 0]);
    }

    fn grid(corner: DVec3, x: DVec3, y: DVec3, n: [usize; 2]) -> Grid {
        let lines = [0, 1].map(|k| {
            let length = [x, y][k].length();
            // Unequal steps.
            (0..=n[k])
                .map(|i| length * (i as f64 / n[k] as f64).powf(1.3))
                .collect()
        });
        Grid {
            origin: corner,
            axes: [x.normalize(), y.normalize()],
            lines,
        }
    }

    /// Returns the greatest error in units of the bound, and the number of pairs that see each other.
    fn compare(from: &Grid, to: &Grid) -> (f64, usize) {
        let pair = GridPair::new(from, to).unwrap();
        let bound = pair.error(0.0, [0.0; 2]);
        let cell = |grid: &Grid, [i, j]: [usize; 2]| {
            let [x, y] = &grid.lines;
            [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[a, b]| grid.at(x[i + a], y[j + b]))
        };
        let (mut worst, mut n_seen, mut n_all) = (0.0_f64, 0, 0);
        pair.for_each(|i, j, value| {
            let exact = rectangle_exchange_area(&cell(from, i), &cell(to, j)).unwrap();
            worst = worst.max((value - exact).abs() / bound);
            n_seen += usize::from(exact > 0.0);
            n_all += 1;
        });
        let count = |grid: &Grid| grid.lines.iter().map(|lines| lines.len() - 1).product::<usize>();
        assert_eq!(n_all, count(from) * count(to));
        (worst, n_seen)
    }

    #[test]
    fn pairs_of_cells_have_the_closed_form_at_any_position() {
        let turns = [
            DQuat::IDENTITY,
            DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7),
        ];
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        for turn in turns {
            let turned = |corner: DVec3, a: DVec3, b: DVec3, n| grid(turn * corner, turn * a, turn * b, n);
            let floor = turned(DVec3::ZERO, 4.0 * x, 3.0 * y, [5, 4]);
            let others = [
                // Above, also touching the floor's plane from above, turned by a quarter and mirrored.
                (turned(3.0 * z, 3.0 * y, 4.0 * x, [3, 6]), 20 * 18),
                (turned(DVec3::new(3.0, 1.0, 1e-3), -2.0 * x, y, [2, 3]), 20 * 6),
                (turned(DVec3::new(2.0, 2.5, 0.5), -y, -x, [3, 2]), 20 * 6),
                // Walls: on an edge, across the floor, reaching below it, and far off.
                (turned(DVec3::ZERO, 3.0 * y, 2.0 * z, [4, 3]), 20 * 12),
                (turned(4.0 * x, 2.0 * z, 3.0 * y, [4, 3]), 20 * 12),
                (turned(DVec3::new(1.0, 1.7, 0.3), 2.0 * z, 2.0 * x, [2, 2]), 10 * 4),
                (turned(DVec3::new(1.0, 1.7, -0.5), 2.0 * x, 2.0 * z, [2, 4]), 15 * 6),
                (turned(DVec3::new(9.0, 0.5, 4.0), 2.0 * y, -3.0 * z, [3, 2]), 20 * 6),
            ];
            for (k, (other, n_seen)) in others.iter().enumerate() {
                for (from, to) in [(&floor, other), (other, &floor)] {
                    let (worst, seen) = compare(from, to);
                    // Both sums have the same bound; it holds with room.
                    assert!(worst < 0.5, "{k}: {worst}");
                    assert_eq!(seen, *n_seen, "{k}");
                }
            }
        }
    }

    #[test]
    fn other_positions_have_none() {
        let floor = grid(DVec3::ZERO, DVec3::X, DVec3::Y, [2, 2]);
        let above = grid(DVec3::Z, DVec3::X, DVec3::Y, [2, 2]);
        let below = grid(-DVec3::Z, DVec3::Y, DVec3::X, [2, 2]);
        let turned = grid(DVec3::Z, DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.8, -0.6, 0.0), [2, 2]);
        let leaning = grid(DVec3::Z, DVec3::Y, DVec3::new(1.0, 0.0, 0.1), [2, 2]);
        for other in [above, below, turned, leaning] {
            assert!(GridPair::new(&floor, &other).is_none(), "{other:?}");
        }
    }

    #[test]
    fn what_is_off_its_direction_is_in_the_error() {
        let floor = grid(DVec3::ZERO, DVec3::X, DVec3::Y, [2, 2]);
        let pair = |tilt: f64| {
            let up = DVec3::new(tilt, 0.0, 1.0).normalize();
            GridPair::new(&floor, &grid(DVec3::ZERO, DVec3::Y, up, [2, 2])).unwrap()
        };
        let [straight, tilted] = [0.0, 5e-13].map(|tilt| pair(tilt).error(0.0, [2.0, 2.0]));
        assert!((tilted - straight - 2e-12).abs() < 1e-14, "{tilted:e} {straight:e}");
    }
}
