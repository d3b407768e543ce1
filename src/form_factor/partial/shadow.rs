//! The visible part of a convex polygon behind convex occluders from a point, by exact clipping.

use std::cmp::Reverse;
use std::f64::consts::TAU;

use glam::DVec3;

use crate::geometry::point_form_factor::{far_term, near_term};
use crate::geometry::polygon;
use crate::visibility::occluders::Occluder;

use super::bodies::{self, Silhouette};
use super::flat::Flat;
use super::groups::{self, Group, Member};
use super::receiver::Receiver;
use super::rule::Parts;

/// The share of its distance up to which a point counts as in a caster's plane: the caster is seen edge on.
pub(super) const EDGE_ON: f64 = 1e-14;

/// The size of a target, in radii by distance squared, below which it is summed about its own middle.
///
/// The plain sum would lose more than two digits there.
const SMALL: f64 = 1e-4;

/// The most casters among which sides of bodies are searched.
const MAX_GROUPED: usize = 62;

/// A convex planar occluder.
#[derive(Clone, Debug)]
struct Caster {
    edges: Vec<Side>,
    plane: Flat,
    /// The height over the plane below which a point of the receiver may count as in it.
    least_height: f64,
    /// From the caster to the middle of the target.
    to_target: DVec3,
    /// Where the target lies: wholly in front of the caster's plane, wholly behind, or on both sides.
    target: Place,
    /// True if only a point in front of the caster needs to test it.
    one_sided: bool,
    /// The bit of the body that it is a part of.
    body: u64,
    /// Where it is in a group.
    group: Option<groups::Place>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    Front,
    Back,
    Both,
}

/// An edge of a caster.
#[derive(Clone, Copy, Debug)]
struct Side {
    from: DVec3,
    along: DVec3,
    /// The sum of its components without their signs.
    length: f64,
    /// From its beginning to the middle of the target, and the sum of its components without their signs.
    to_target: DVec3,
    to_target_length: f64,
}

/// A half-space n · r + c > 0 of the vectors r from the target's middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    pub(super) normal: DVec3,
    pub(super) offset: f64,
    /// The values up to which a point counts as on the plane: a constant, and one for each metre of r.
    pub(super) slack: [f64; 2],
}

impl HalfSpace {
    /// Makes the half-space of a plane through a point that is `to_target` from the target's middle; `slack` is the value up to which rounding reaches, for each metre.
    pub(super) fn through(to_target: DVec3, normal: DVec3, slack: f64) -> Self {
        Self {
            normal,
            offset: normal.dot(to_target),
            slack: [slack * to_target.abs().element_sum(), slack],
        }
    }

    pub(super) fn value(&self, r: DVec3) -> f64 {
        self.normal.dot(r) + self.offset
    }
}

/// A target and the casters in front of it; buffers included, so that evaluations allocate nothing.
pub(super) struct Shadows {
    /// From its middle: small and distant targets keep their digits.
    target: Vec<DVec3>,
    middle: DVec3,
    /// The square of the distance of the farthest corner from the middle.
    radius_squared: f64,
    receiver_normal: DVec3,
    /// Bodies first, then the casters that hide most, so that little remains for the others to cut.
    bodies: Vec<(Silhouette, u64)>,
    casters: Vec<Caster>,
    groups: Vec<Group>,
    fragments: Fragments,
    next: Fragments,
    piece: Vec<DVec3>,
    rest: Vec<DVec3>,
    half_spaces: Vec<HalfSpace>,
    /// The bodies that have hidden anything.
    hiding: u64,
    /// The number of times that a fragment was cut by a shadow, or found to be outside of it.
    pub(super) n_cuts: usize,
}

/// Convex polygons, one after the other.
#[derive(Default)]
pub(super) struct Fragments {
    corners: Vec<DVec3>,
    ends: Vec<usize>,
}

impl Fragments {
    pub(super) fn clear(&mut self) {
        self.corners.clear();
        self.ends.clear();
    }

    pub(super) fn push(&mut self, corners: &[DVec3]) {
        self.corners.extend_from_slice(corners);
        self.ends.push(self.corners.len());
    }

    /// Returns the number of fragments.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Drops all but the first `n` fragments.
    pub(super) fn truncate(&mut self, n: usize) {
        self.ends.truncate(n);
        self.corners.truncate(self.ends.last().copied().unwrap_or(0));
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.corners[start..end])
    }
}

impl Shadows {
    /// Prepares the casters for a target that lies in front of the receiver's plane.
    pub(super) fn new(receiver: &Receiver, target: &[DVec3], occluders: &[Occluder<'_>]) -> Self {
        let middle = target[0] + target.iter().map(|&v| v - target[0]).sum::<DVec3>() / target.len() as f64;
        let bodies = bodies::of(occluders);
        let ground = Flat::with_normal(&receiver.corners, receiver.normal);
        let height = |v: DVec3| ground.snapped_height(v, EDGE_ON);
        let mut casters: Vec<(&[DVec3], Caster)> = occluders
            .iter()
            .filter(|occluder| occluder.body.is_none_or(|body| !bodies.contains(&body)))
            .filter(|occluder| occluder.corners.iter().any(|&v| height(v) > 0.0))
            .filter_map(|occluder| {
                let (corners, one_sided) = (&*occluder.corners, occluder.one_sided);
                let plane = Flat::of(corners);
                if one_sided
                    && receiver
                        .corners
                        .iter()
                        .all(|&v| plane.snapped_height(v, EDGE_ON) <= 0.0)
                {
                    return None;
                }
                let heights = target.iter().map(|&v| plane.snapped_height(v, EDGE_ON));
                let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
                let place = match (low >= 0.0, high <= 0.0) {
                    (true, _) => Place::Front,
                    (_, true) => Place::Back,
                    _ => Place::Both,
                };
                let starts = std::iter::once(&corners[corners.len() - 1]).chain(corners);
                // Through an edge in the receiver's plane and a point there goes that plane alone, with the rest of the caster and all of the target in front; close to the edge rounding would say anything.
                let edges = starts
                    .zip(corners)
                    .filter(|&(&a, &b)| height(a).abs() > 0.0 || height(b).abs() > 0.0);
                let edges = edges.map(|(&from, &to)| Side {
                    from,
                    along: to - from,
                    length: (to - from).abs().element_sum(),
                    to_target: middle - from,
                    to_target_length: (middle - from).abs().element_sum(),
                });
                // A tolerance is convex: it is greatest at a corner.
                let tolerances = receiver.corners.iter().map(|&v| plane.tolerance(v, EDGE_ON));
                let caster = Caster {
                    edges: edges.collect(),
                    plane,
                    least_height: 1.001 * tolerances.fold(0.0, f64::max),
                    to_target: middle - corners[0],
                    target: place,
                    one_sided,
                    body: 0,
                    group: None,
                };
                Some((corners, caster))
            })
            .collect();
        let eye = polygon::centroid(&receiver.corners);
        casters.sort_by_cached_key(|(corners, _)| {
            let r = polygon::centroid(corners) - eye;
            let facing = polygon::area_vector(corners).dot(r).abs();
            Reverse((facing / r.length().powi(3)).to_bits())
        });
        let groups = if casters.len() < groups::MIN_SIDES {
            Vec::new()
        } else {
            let screen = Flat::of(target);
            let side = screen.snapped_height(eye, EDGE_ON);
            let is_between = |v: &DVec3| height(*v) > 0.0 && side * screen.snapped_height(*v, EDGE_ON) > 0.0;
            let members = casters.iter().map(|(corners, caster)| {
                corners.iter().all(is_between).then_some(Member {
                    corners,
                    plane: &caster.plane,
                })
            });
            let (groups, places) = Group::all(&members.collect::<Vec<_>>(), middle);
            for ((_, caster), place) in casters.iter_mut().zip(places) {
                caster.group = place;
            }
            groups
        };
        let silhouettes = bodies
            .into_iter()
            .filter_map(|body| Silhouette::new(body, receiver, target, middle));
        let bodies = silhouettes
            .enumerate()
            .map(|(k, body)| (body, 1 << k.min(63)))
            .collect();
        let target: Vec<DVec3> = target.iter().map(|&v| v - middle).collect();
        Self {
            bodies,
            radius_squared: target.iter().map(|v| v.length_squared()).fold(0.0, f64::max),
            target,
            middle,
            receiver_normal: receiver.normal,
            casters: casters.into_iter().map(|(_, caster)| caster).collect(),
            groups,
            fragments: Fragments::default(),
            next: Fragments::default(),
            piece: Vec::new(),
            rest: Vec::new(),
            half_spaces: Vec::new(),
            hiding: 0,
            n_cuts: 0,
        }
    }

    /// Returns the form factors from a point of the receiver to the visible and to the hidden part of the target.
    ///
    /// A part is 0 only if it is empty: where rounding leaves 0 of a part, it is the least positive number.
    pub(super) fn visible_and_hidden(&mut self, point: DVec3) -> Parts {
        self.look(point, true)
    }

    /// Returns the form factor to the visible part alone, which takes less time; that to the hidden part is NaN.
    pub(super) fn visible(&mut self, point: DVec3) -> Parts {
        self.look(point, false)
    }

    /// Finds the bodies of casters: sides that lie on one convex body, seen from outside, whose edges never cross in a view.
    pub(super) fn find_bodies(&mut self) {
        let n_silhouettes = self.bodies.len();
        let mut bodies: Vec<Vec<usize>> = Vec::new();
        for k in 0..self.casters.len() {
            let is_of = |body: &Vec<usize>| body.iter().all(|&other| self.are_of_one_body(k, other));
            // Where there are many, each is a body of its own.
            let found = bodies.iter().position(is_of).filter(|_| k < MAX_GROUPED);
            let body = found.unwrap_or_else(|| {
                bodies.push(Vec::new());
                bodies.len() - 1
            });
            bodies[body].push(k);
            self.casters[k].body = 1 << (n_silhouettes + body).min(63);
        }
    }

    fn are_of_one_body(&self, a: usize, b: usize) -> bool {
        let [a, b] = [a, b].map(|k| &self.casters[k]);
        let is_behind = |plane: &Flat, edges: &[Side]| {
            let mut corners = edges.iter().map(|edge| edge.from);
            corners.all(|v| plane.height(v) <= plane.tolerance(v, 1e-12))
        };
        a.one_sided && b.one_sided && is_behind(&a.plane, &b.edges) && is_behind(&b.plane, &a.edges)
    }

    /// Returns whether several bodies have hidden something since [`forget`](Self::forget).
    pub(super) fn several_hide(&self) -> bool {
        are_several(self.hiding)
    }

    /// Returns whether several bodies may each hide something of the target from a point, whatever the others hide.
    pub(super) fn several_may_hide(&mut self, point: DVec3) -> bool {
        let mut found = 0;
        for k in 0..self.bodies.len() + self.casters.len() {
            let Some(body) = self.prepare(k, point) else {
                continue;
            };
            if found & body == 0 && !is_outside(&self.target, &self.half_spaces) {
                found |= body;
            }
            if are_several(found) {
                return true;
            }
        }
        false
    }

    pub(super) fn forget(&mut self) {
        self.hiding = 0;
    }

    fn look(&mut self, point: DVec3, with_hidden: bool) -> Parts {
        self.fragments.clear();
        self.fragments.push(&self.target);
        let centre = self.middle - point;
        let is_small = self.radius_squared < SMALL * centre.length_squared();
        let contour = |corners: &[DVec3]| {
            if is_small {
                contour_vector(corners, |a, b| far_term(centre, a, b))
            } else {
                near_contour(centre, corners)
            }
        };
        let (mut hidden, mut is_cut) = (DVec3::ZERO, false);
        let mut groups = std::mem::take(&mut self.groups);
        let mut cut = |shadows: &mut Self, body: u64, half_spaces: &[HalfSpace]| {
            shadows.next.clear();
            shadows.n_cuts += shadows.fragments.ends.len();
            for fragment in shadows.fragments.iter() {
                if subtract(
                    fragment,
                    half_spaces,
                    &mut shadows.next,
                    &mut shadows.rest,
                    &mut shadows.piece,
                ) {
                    is_cut = true;
                    shadows.hiding |= body;
                    if with_hidden {
                        hidden += contour(&shadows.rest);
                    }
                }
            }
            std::mem::swap(&mut shadows.fragments, &mut shadows.next);
        };
        for group in &mut groups {
            for triangle in group.look_from(point) {
                // The last bit: its sides are bodies of their own.
                cut(self, 1 << 63, triangle);
            }
        }
        for k in 0..self.bodies.len() + self.casters.len() {
            if self.fragments.ends.is_empty() {
                break;
            }
            let place = k.checked_sub(self.bodies.len()).and_then(|k| self.casters[k].group);
            if place.is_some_and(|(group, place)| groups[group].covers(place)) {
                continue;
            }
            if let Some(body) = self.prepare(k, point) {
                let half_spaces = std::mem::take(&mut self.half_spaces);
                cut(self, body, &half_spaces);
                self.half_spaces = half_spaces;
            }
        }
        self.groups = groups;
        let factor = |contour: DVec3| (-contour.dot(self.receiver_normal) / TAU).clamp(0.0, 1.0);
        if !with_hidden {
            let visible = factor(self.fragments.iter().map(contour).sum());
            let is_any = !self.fragments.ends.is_empty();
            return [if is_any { visible.max(f64::MIN_POSITIVE) } else { 0.0 }, f64::NAN];
        }
        let hidden = factor(hidden);
        if is_cut && self.fragments.ends.is_empty() {
            return [0.0, hidden];
        }
        let whole = factor(contour(&self.target));
        if is_cut {
            [whole - hidden, hidden].map(|part| part.max(f64::MIN_POSITIVE))
        } else {
            [whole, 0.0]
        }
    }

    /// Sets the half-spaces whose intersection is the region that an occluder hides from the point, and returns the bit of its body.
    ///
    /// Occluder `k` counts bodies first, then casters; `None` if the region is empty.
    fn prepare(&mut self, k: usize, point: DVec3) -> Option<u64> {
        let n_bodies = self.bodies.len();
        let (hides, body) = match self.bodies.get_mut(k) {
            Some((silhouette, body)) => (silhouette.half_spaces(point, &mut self.half_spaces), *body),
            None => (
                self.prepare_half_spaces(k - n_bodies, point),
                self.casters[k - n_bodies].body,
            ),
        };
        hides.then_some(body)
    }

    /// Sets the half-spaces whose intersection is the region that caster `k` hides from the point; false if it is empty.
    fn prepare_half_spaces(&mut self, k: usize, point: DVec3) -> bool {
        let caster = &self.casters[k];
        let height = caster.plane.height(point);
        let may_be_edge_on = height.abs() <= caster.least_height;
        let (front, hidden) = match caster.target {
            _ if may_be_edge_on && height.abs() <= caster.plane.tolerance(point, EDGE_ON) => return false,
            Place::Both => (height > 0.0, true),
            Place::Front => (height > 0.0, height < 0.0),
            Place::Back => (height > 0.0, height > 0.0),
        };
        if !hidden || (caster.one_sided && !front) {
            return false;
        }
        self.half_spaces.clear();
        let sign = if front { 1.0 } else { -1.0 };
        for side in &caster.edges {
            let r = side.from - point;
            // Seen from the front the contour runs counter-clockwise, and r × edge points out of the cone's right side: inwards is the reverse.
            let normal = r.cross(side.along) * -sign;
            let slack = 1e-15 * r.abs().element_sum() * side.length;
            self.half_spaces.push(HalfSpace {
                normal,
                offset: normal.dot(side.to_target),
                slack: [slack * side.to_target_length, slack],
            });
        }
        if caster.target == Place::Both {
            let normal = caster.plane.normal * -sign;
            self.half_spaces.push(HalfSpace {
                normal,
                offset: normal.dot(caster.to_target),
                slack: [0.0; 2],
            });
        }
        true
    }
}

/// Returns whether these are bits of several bodies; the last bit stands for all bodies without one of their own.
fn are_several(bodies: u64) -> bool {
    bodies.count_ones() > 1 || bodies & (1 << 63) != 0
}

/// Returns whether a convex polygon lies outside one of some half-spaces.
fn is_outside(polygon: &[DVec3], half_spaces: &[HalfSpace]) -> bool {
    half_spaces
        .iter()
        .any(|half_space| polygon.iter().all(|&r| half_space.value(r) <= 0.0))
}

/// Adds to `out` the convex pieces of a convex fragment that lie outside at least one half-space.
///
/// Returns false if that is all of it; otherwise `rest` is the other part.
pub(super) fn subtract(
    fragment: &[DVec3],
    half_spaces: &[HalfSpace],
    out: &mut Fragments,
    rest: &mut Vec<DVec3>,
    piece: &mut Vec<DVec3>,
) -> bool {
    // Without f64::max, which spends time on NaN.
    let longer = |reach: f64, r: &DVec3| {
        let length = r.abs().element_sum();
        if length > reach { length } else { reach }
    };
    let reach = fragment.iter().fold(0.0, longer);
    let mut cutting = 0_u64;
    for (k, half_space) in half_spaces.iter().enumerate() {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &r in fragment {
            let value = half_space.value(r);
            low = if value < low { value } else { low };
            high = if value > high { value } else { high };
        }
        let slack = half_space.slack[0] + half_space.slack[1] * reach;
        if high <= slack {
            out.push(fragment);
            return false;
        }
        if low < -slack {
            cutting |= 1 << (k & 63);
        }
    }
    rest.clear();
    rest.extend_from_slice(fragment);
    for (k, half_space) in half_spaces.iter().enumerate() {
        if cutting & (1 << (k & 63)) == 0 {
            continue;
        }
        piece.clear();
        split(rest, half_space, piece);
        if piece.len() >= 3 {
            out.push(piece);
        }
        if rest.len() < 3 {
            return false;
        }
    }
    true
}

/// Splits a convex polygon: `inside` keeps the part inside the half-space, the other part goes to `outside`.
fn split(inside: &mut Vec<DVec3>, half_space: &HalfSpace, outside: &mut Vec<DVec3>) {
    let n = inside.len();
    let mut a = inside[n - 1];
    let mut value_a = half_space.value(a);
    for k in 0..n {
        let b = inside[k];
        let value_b = half_space.value(b);
        if (value_a >= 0.0) != (value_b >= 0.0) {
            let cut = a + (b - a) * (value_a / (value_a - value_b));
            inside.push(cut);
            outside.push(cut);
        }
        if value_b >= 0.0 {
            inside.push(b);
        } else {
            outside.push(b);
        }
        (a, value_a) = (b, value_b);
    }
    inside.drain(..n);
}

/// Returns the sum of the terms of all edges of a polygon that is not small.
fn near_contour(centre: DVec3, corners: &[DVec3]) -> DVec3 {
    let mut a = centre + corners[corners.len() - 1];
    let mut sum = DVec3::ZERO;
    for &corner in corners {
        let b = centre + corner;
        sum += near_term(a, b);
        a = b;
    }
    sum
}

/// Returns the sum of the terms of all edges of a polygon.
fn contour_vector(corners: &[DVec3], term: impl Fn(DVec3, DVec3) -> DVec3) -> DVec3 {
    let mut a = corners[corners.len() - 1];
    let mut sum = DVec3::ZERO;
    for &b in corners {
        sum += term(a, b);
        a = b;
    }
    sum
}

#[cfg(test)]
mod tests;
