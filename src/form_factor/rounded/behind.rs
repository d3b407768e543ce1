//! Pairs of patches that do not face each other as their file has them, but may do so as they were meant.

use std::f64::consts::PI;
use std::ops::Range;

use glam::{DMat2, DVec2, DVec3};

use super::{DEVIATIONS, End, Rounded, Vertex};
use crate::form_factor::facing::Facing;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};
use crate::matrix::Entry;

/// The least height of a patch's middle over a plane, as a part of its radius, at which the patch is certainly in front.
const IN_FRONT: f64 = 1e-8;

/// The part of both radii up to which corners count as meant to touch, if they are nearer to another patch than they may be off.
const TOUCHING: f64 = 0.05;

/// The height of a face over another's plane, in standard deviations of rounding, from which on both may have been meant to lie apart.
const PARTED: f64 = 3.5;

/// The plane of a face, and its change with the face's vertices.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    middle: DVec3,
    /// The change of each vertex's weight in the height of a point on the way to that point, per m.
    ///
    /// The heights of the vertices fit the plane by least squares.
    slopes: Vec<DVec3>,
    /// How far the normal may turn, in radians.
    tilt: f64,
}

impl Plane {
    pub(super) fn new(vertices: &[Vertex], normal: DVec3) -> Self {
        let n = vertices.len() as f64;
        let middle = vertices.iter().map(|v| v.position).sum::<DVec3>() / n;
        let across = normal.any_orthonormal_vector();
        let up = normal.cross(across);
        let places: Vec<DVec2> = vertices
            .iter()
            .map(|v| v.position - middle)
            .map(|r| DVec2::new(across.dot(r), up.dot(r)))
            .collect();
        let squares = places
            .iter()
            .map(|r| DMat2::from_cols(r.x * *r, r.y * *r))
            .fold(DMat2::ZERO, |sum, square| sum + square);
        let inverse = squares.inverse();
        let slopes: Vec<DVec3> = places
            .iter()
            .map(|r| inverse * *r)
            .map(|slope| slope.x * across + slope.y * up)
            .collect();
        let square: f64 = vertices
            .iter()
            .zip(&slopes)
            .map(|(v, slope)| (height_off(v, normal) * slope.length()).powi(2))
            .sum();
        Self {
            tilt: deviations(square).min(1.0),
            middle,
            slopes,
        }
    }
}

impl End {
    /// Returns the weights of the vertices in the height of a point over the plane, `way` from its middle.
    fn weights(&self, way: DVec3) -> impl Iterator<Item = (&Vertex, f64)> {
        let even = (self.vertices.len() as f64).recip();
        let slopes = self.vertices.iter().zip(&self.plane.slopes);
        slopes.map(move |(vertex, slope)| (vertex, -even - slope.dot(way)))
    }
}

/// Returns how far a vertex may be off along a normal, in m.
fn height_off(vertex: &Vertex, normal: DVec3) -> f64 {
    normal.abs().dot(vertex.half)
}

/// Returns the stated error of a sum of numbers that are each uniform up to x, from the sum of all x².
fn deviations(square: f64) -> f64 {
    DEVIATIONS * (square / 3.0).sqrt()
}

/// A coarse description of a patch that decides most pairs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glance {
    normal: DVec3,
    middle: DVec3,
    radius: f64,
    off: f64,
    tilt: f64,
    /// The way from the middle of the patch to that of its face, in m.
    lever: f64,
}

impl Glance {
    pub(super) fn new(end: &End) -> Self {
        Self {
            normal: end.normal,
            middle: end.middle,
            radius: end.radius,
            off: end.off,
            tilt: end.plane.tilt,
            lever: end.middle.distance(end.plane.middle),
        }
    }

    /// Returns the height of the middle of another patch over the plane, and how much higher a part of that patch may be, in m.
    fn height(&self, of: &Self) -> (f64, f64) {
        let way = of.middle - self.middle;
        let reach = of.radius + 2.0 * (self.off + of.off) + self.tilt * (way.length() + of.radius + self.lever);
        (self.normal.dot(way), reach)
    }
}

/// The part of a patch that may be in front of another's plane.
struct Front {
    /// Its area, m².
    area: f64,
    /// Its greatest possible height over that plane, m.
    highest: f64,
    /// The sine of the steepest angle at which it may rise from the other patch; `None` where no line separates the two.
    slope: Option<f64>,
    /// True if its highest corner is certainly in front: higher than it may be off.
    is_certain: bool,
    /// True if it may all be behind the plane.
    may_be_none: bool,
}

/// The exchange that two patches may have had before rounding.
pub(super) struct Meant {
    /// The most, m².
    pub(super) most: f64,
    /// True if one is hardly in front of the other's plane, so that the first order of its error means little.
    pub(super) is_grazing: bool,
    /// True if it may be 0.
    pub(super) may_be_none: bool,
}

/// Returns the exchange that two patches that face each other in the file may have as they were meant.
pub(super) fn meant([own, other]: [&End; 2]) -> Meant {
    let fronts = front(own, other).zip(front(other, own));
    let Some((of_own, of_other)) = fronts else {
        return Meant {
            most: 0.0,
            is_grazing: true,
            may_be_none: true,
        };
    };
    Meant {
        is_grazing: !(of_own.is_certain && of_other.is_certain),
        may_be_none: of_own.may_be_none || of_other.may_be_none,
        most: most(own, other, [&of_own, &of_other]),
    }
}

impl Rounded {
    /// Calls `visit(j, x)` for the patches among `columns` that do not [face](Facing::pair) patch i in the file, but may do so as both were meant.
    ///
    /// x is the most that A_i F_ij may then be, m². Each corner's height over the other's plane has the error of the vertices that it depends on, as in [`error`](Self::error).
    /// The parts that cannot be in front of that plane are cut off, which leaves a_i and a_j.
    /// With θ the angles to both normals, A_i F_ij is at most a_i a_j cos θ_i cos θ_j / (π g²) at a gap g, and a_i sin² φ / 2 if j rises to an angle φ over the plane of i, and the reverse. As
    /// cos θ_i + cos θ_j ≤ |n_i − n_j|, patches of about the same plane hardly see each other, however near they are. Corners that patches share, or touch each other with, move both.
    /// A patch that lies flat on another, as far as it is wider than it may be off, is meant to, and sees nothing.
    ///
    /// It also visits the pairs that face each other so closely that they may count as two sides of a sheet, although their faces are [farther apart](parted) than rounding alone would bring them.
    ///
    /// Work: some ns for each column, and some µs for each pair that is not decided by middles and radii.
    pub(in crate::form_factor) fn behind(
        &self,
        facing: &Facing,
        i: usize,
        columns: Range<usize>,
        mut visit: impl FnMut(usize, f64),
    ) {
        let own = &self.glances[i];
        for j in columns {
            let other = &self.glances[j];
            let (over_own, reach) = own.height(other);
            if over_own < -reach {
                continue;
            }
            let (over_other, reach_back) = other.height(own);
            let is_facing = over_own > IN_FRONT * other.radius && over_other > IN_FRONT * own.radius;
            if !is_facing && over_other < -reach_back || self.ends[i].face == self.ends[j].face {
                continue;
            }
            let ends = [&self.ends[i], &self.ends[j]];
            let most = if !is_facing && !facing.pair(i, j) {
                most_behind(ends[0], ends[1])
            } else if own.normal.dot(other.normal) < 0.0
                && over_own.min(over_other) <= (reach - other.radius).max(reach_back - own.radius)
            {
                most_between_sides(ends)
            } else {
                0.0
            };
            if most > 0.0 {
                visit(j, most);
            }
        }
    }
}

/// Returns the most that two ends that do not face each other may exchange as they were meant, m².
fn most_behind(own: &End, other: &End) -> f64 {
    let Some(of_own) = front(own, other) else { return 0.0 };
    let Some(of_other) = front(other, own) else { return 0.0 };
    let may_lie_flat = own.border().max(other.border()) < 1.0 && own.normal.dot(other.normal) < -0.5;
    if may_lie_flat && gap(own, other) <= 0.0 && lies_in_plane(own, other) && lies_in_plane(other, own) {
        return 0.0;
    }
    most(own, other, [&of_own, &of_other])
}

/// States an error beside those of the first `n` entries, which are sorted by column: of a new entry of 0, or of one that is 0 with less.
///
/// Returns the error that was stated before; `None` if nothing changes.
pub(in crate::form_factor) fn state(entries: &mut Vec<Entry>, n: usize, column: u32, error: f64) -> Option<f64> {
    match entries[..n].binary_search_by_key(&column, |entry| entry.0) {
        Err(_) => {
            entries.push((column, 0.0, error));
            Some(0.0)
        }
        Ok(k) => {
            let (_, value, known) = &mut entries[k];
            (*value <= 0.0 && *known < error).then(|| std::mem::replace(known, error))
        }
    }
}

/// Returns the most that two ends that face each other across hardly any gap may exchange, m²; 0 where rounding alone may have parted their faces.
fn most_between_sides(ends: [&End; 2]) -> f64 {
    let [own, other] = ends;
    if !parted(own, other) && !parted(other, own) {
        return 0.0;
    }
    // The gap is at most twice that of the file, and light from beside a patch grows no faster than the gap.
    let [p, q] = ends.map(|end| PreparedPolygon::new(&end.corners));
    let exchange = exchange_area(&p, &q, Tolerance { rel: 1e-2, abs: 0.0 });
    (2.0 * exchange.value).min(own.area).min(other.area)
}

/// Returns whether the middle of an end's face is higher over the plane of another's than rounding alone puts it in all but one of 4,000 cases.
///
/// The height of a middle is known better than those of corners, as roundings of different coordinates are independent. Equal coordinates are rounded alike.
fn parted(end: &End, over: &End) -> bool {
    let n = end.vertices.len() as f64;
    let middle = end.vertices.iter().map(|v| v.position).sum::<DVec3>() / n;
    let way = middle - over.plane.middle;
    let weights = end.vertices.iter().map(|v| (v, n.recip())).chain(over.weights(way));
    let weights: Vec<(&Vertex, f64)> = weights.collect();
    let mut square = 0.0;
    for axis in 0..3 {
        let of = |k: usize| weights[k].0.position[axis].to_bits();
        for k in 0..weights.len() {
            if (0..k).any(|before| of(before) == of(k)) {
                continue;
            }
            let alike = (k..weights.len()).filter(|&l| of(l) == of(k));
            let weight: f64 = alike.map(|l| weights[l].1).sum();
            square += (weight * over.normal[axis] * weights[k].0.half[axis]).powi(2);
        }
    }
    // Where all roundings cancel, that of f64 is left.
    let least = height_off(&end.vertices[0], over.normal);
    over.normal.dot(way) > least.max(PARTED * (square / 3.0).sqrt())
}

/// Returns the most that two ends may exchange, m², by the parts that may be in front of each other's planes.
fn most(own: &End, other: &End, [of_own, of_other]: [&Front; 2]) -> f64 {
    let gap = gap(own, other);
    let turn = own.normal.distance(other.normal) + own.plane.tilt + other.plane.tilt;
    let sine_of = |front: &Front| {
        let by_gap = if gap > 0.0 { front.highest / gap } else { f64::INFINITY };
        by_gap.min(front.slope.unwrap_or(f64::INFINITY)).min(turn).min(1.0)
    };
    // The part of one end that rises over the other is seen from there.
    let (from_own, from_other) = (sine_of(of_other), sine_of(of_own));
    let product = (from_own * from_other).min(0.25 * turn * turn);
    // A part beside an end fills at most half of the directions around it.
    let part = |rise: f64, front: &Front| if front.slope.is_some() { 0.5 } else { 1.0 } * rise * rise;
    let most = (of_own.area * part(from_own, of_other)).min(of_other.area * part(from_other, of_own));
    if gap > 0.0 {
        most.min(product * of_own.area * of_other.area / (PI * gap * gap))
    } else {
        most
    }
}

/// Returns the part of an end that may be in front of the plane of another; `None` if there is none.
fn front(end: &End, over: &End) -> Option<Front> {
    let both_off = end.off + over.off;
    let may_touch = both_off <= TOUCHING * end.radius.min(over.radius);
    let (mut heights, mut above) = (Vec::with_capacity(4), Vec::with_capacity(4));
    for (c, corner) in end.corners.iter().enumerate() {
        let is_shared = over.corners.contains(corner);
        if is_shared || (may_touch && polygon::distance(*corner, &over.corners) <= both_off) {
            heights.push((0.0, 0.0));
            above.push(0.0);
        } else {
            let height = over.normal.dot(*corner - over.middle);
            let own_off = corner_off(end, c, over);
            heights.push((height, own_off));
            above.push(height + own_off);
        }
    }
    let highest = above.iter().copied().fold(0.0, f64::max);
    (highest > 0.0).then(|| Front {
        slope: slope(end, over, &above),
        area: area_above(&end.corners, &above) * (1.0 + end.border()),
        highest,
        is_certain: heights.iter().any(|(height, own_off)| height > own_off),
        may_be_none: !heights.iter().any(|(height, own_off)| *height > 2.0 * own_off),
    })
}

/// Returns the sine of the greatest angle to which an end, with such greatest heights of its corners, may rise as seen from another.
///
/// `None` where no line in the plane of the other separates the two. Both height and distance from such a line are linear, so that their ratio is greatest at a corner.
fn slope(end: &End, over: &End, heights: &[f64]) -> Option<f64> {
    let off = end.off + over.off;
    let sides = |of: &End| -> Vec<DVec3> {
        let next = of.corners.iter().cycle().skip(1);
        let edges = of.corners.iter().zip(next).map(|(a, b)| *b - *a);
        edges.map(|edge| edge.cross(over.normal)).collect()
    };
    let inward = sides(end)
        .into_iter()
        .map(|side| if end.normal.dot(over.normal) > 0.0 { -side } else { side });
    let directions = sides(over).into_iter().chain(inward).chain([end.middle - over.middle]);
    let tangent = |direction: DVec3| {
        let direction = direction.reject_from_normalized(over.normal).normalize_or_zero();
        let line = over
            .corners
            .iter()
            .map(|v| direction.dot(*v))
            .fold(f64::NEG_INFINITY, f64::max);
        let of_corners = end.corners.iter().zip(heights).map(|(corner, &height)| {
            let distance = direction.dot(*corner) - line - off;
            match (height > 0.0, distance > 0.0) {
                (true, true) => height / distance,
                (false, _) if distance > -2.0 * off - 1e-9 * end.radius => 0.0,
                _ => f64::INFINITY,
            }
        });
        of_corners.fold(0.0, f64::max)
    };
    let least = directions.map(tangent).fold(f64::INFINITY, f64::min);
    least.is_finite().then(|| least / least.hypot(1.0))
}

/// Returns how far the height of a corner over the plane of another end may be off, in m.
fn corner_off(end: &End, corner: usize, over: &End) -> f64 {
    let mut weights: [(DVec3, f64, f64); 8] = [(DVec3::ZERO, 0.0, 0.0); 8];
    let mut n = 0;
    let mut add = |vertex: &Vertex, weight: f64| {
        let known = weights[..n].iter_mut().find(|known| known.0 == vertex.position);
        if let Some(known) = known {
            known.1 += weight;
        } else if let Some(free) = weights.get_mut(n) {
            *free = (vertex.position, weight, height_off(vertex, over.normal));
            n += 1;
        }
    };
    for (vertex, share) in end.vertices.iter().zip(end.shares[corner]) {
        add(vertex, share);
    }
    let way = end.corners[corner] - over.plane.middle;
    for (vertex, weight) in over.weights(way) {
        add(vertex, weight);
    }
    let (mut most, mut square) = (0.0, 0.0);
    for (_, weight, off) in &weights[..n] {
        most += weight.abs() * off;
        square += (weight * off).powi(2);
    }
    // A height is at most the distance; where an end is hardly more than a line, no better bound is known.
    let farthest = way.length() + end.off + over.off;
    deviations(square).min(most).min(farthest)
}

/// Returns the area of the part of a polygon whose heights, given at its corners, are above 0.
fn area_above(corners: &[DVec3], heights: &[f64]) -> f64 {
    let n = corners.len();
    let mut part = Vec::with_capacity(n + 2);
    for k in 0..n {
        let (a, b) = (corners[k], corners[(k + 1) % n]);
        let (of_a, of_b) = (heights[k], heights[(k + 1) % n]);
        if of_a >= 0.0 {
            part.push(a);
        }
        if (of_a >= 0.0) != (of_b >= 0.0) {
            part.push(a + (b - a) * (of_a / (of_a - of_b)));
        }
    }
    polygon::area_vector(&part).length()
}

/// Returns a lower bound of the distance between points of two ends, in m.
fn gap(one: &End, other: &End) -> f64 {
    let from = |end: &End, to: &End| polygon::distance(end.middle, &to.corners) - end.radius;
    from(one, other).max(from(other, one)) - one.off - other.off
}

/// Returns whether all of an end may lie in the plane of another.
fn lies_in_plane(end: &End, over: &End) -> bool {
    (0..end.corners.len()).all(|c| {
        let height = over.normal.dot(end.corners[c] - over.middle);
        height.abs() <= corner_off(end, c, over) + end.off.min(over.off)
    })
}
