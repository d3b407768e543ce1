//! The lines on the receiver along which the shadows on the target change their structure.
//!
//! Seen from a point x, the visible part of the target is a polygon. It changes its structure where a vertex v crosses an
//! edge ab in the view: x then lies on the line in which the plane of v, a, b cuts the receiver, within the image of ab
//! as projected from v. Where a and v lie in the receiver's own plane that plane does not apply: they cover each other on the line through both.
//! (Where three edges cross in the view x lies on a conic instead; those events are not listed here.)

use std::collections::HashMap;
use std::ops::Range;

use glam::{DVec2, DVec3};

use super::flat::{FLAT, Flat, crossing};
use super::receiver::Receiver;
use super::screen::{Screen, inward_normals};
use crate::geometry::clip::clip_contour;

/// The share of its terms from which on the sign of a difference is certain: [`Flat::rise`] computes the difference of heights as it is there.
const CERTAIN: f64 = 1e-3;

/// A segment in the receiver's plane where the view changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Event {
    /// One end, in the receiver's frame.
    pub(super) from: DVec2,
    /// The other end.
    pub(super) to: DVec2,
}

/// A corner of the target or of an occluder.
struct Vertex {
    position: DVec3,
    /// Height over the receiver's plane, and over the target's.
    h: f64,
    g: f64,
    of_target: bool,
}

/// An edge of the target or of an occluder.
struct Edge {
    /// The numbers of its ends.
    vertices: [usize; 2],
    /// For an edge of occluders: their number, and the first two by their screens, each true if its edge runs from the first end to the second.
    n_screens: usize,
    screens: [(usize, bool); 2],
    of_target: bool,
}

/// Vertices and edges of occluders found so far: a list is searched while they are few, which takes less time than hashing.
#[derive(Default)]
struct Known {
    vertices: Vec<(DVec3, usize)>,
    edges: Vec<([usize; 2], usize)>,
    vertex_of_bits: HashMap<[u64; 3], usize>,
    edge_of_ends: HashMap<[usize; 2], usize>,
}

/// The greatest length of a list that is searched from the beginning.
const SHORT: usize = 32;

impl Known {
    fn vertex(&mut self, position: DVec3, push: impl FnOnce() -> usize) -> usize {
        let bits = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let found = if self.vertices.len() <= SHORT {
            let same = self.vertices.iter().find(|known| known.0 == position);
            same.map(|known| known.1)
        } else {
            if self.vertex_of_bits.is_empty() {
                self.vertex_of_bits = self.vertices.iter().map(|&(p, index)| (bits(p), index)).collect();
            }
            self.vertex_of_bits.get(&bits(position)).copied()
        };
        found.unwrap_or_else(|| {
            let index = push();
            self.vertices.push((position, index));
            if !self.vertex_of_bits.is_empty() {
                self.vertex_of_bits.insert(bits(position), index);
            }
            index
        })
    }

    /// Returns the edge between two vertices.
    fn edge(&mut self, [from, to]: [usize; 2], push: impl FnOnce() -> usize) -> usize {
        let key = [from.min(to), from.max(to)];
        let found = if self.edges.len() <= SHORT {
            let same = self
                .edges
                .iter()
                .position(|known| known.0[0] == key[0] && known.0[1] == key[1]);
            same.map(|k| self.edges[k].1)
        } else {
            if self.edge_of_ends.is_empty() {
                self.edge_of_ends = self.edges.iter().copied().collect();
            }
            self.edge_of_ends.get(&key).copied()
        };
        found.unwrap_or_else(|| {
            let index = push();
            self.edges.push((key, index));
            if !self.edge_of_ends.is_empty() {
                self.edge_of_ends.insert(key, index);
            }
            index
        })
    }
}

/// The vertices and edges that a view is made of.
pub(super) struct Outline<'a> {
    receiver: &'a Receiver,
    target: &'a [DVec3],
    /// The planes of the receiver and of the target.
    planes: [Flat; 2],
    /// The half-planes that the receiver and the target are made of: inward normals and levels.
    sides: [Vec<(DVec3, f64)>; 2],
    vertices: Vec<Vertex>,
    edges: Vec<Edge>,
    screens: Vec<Screen>,
    /// The parts of occluders that lie between receiver and target.
    parts: Vec<Vec<DVec3>>,
}

impl<'a> Outline<'a> {
    /// Gathers the corners and edges of a target and of the parts of occluders between it and the receiver.
    pub(super) fn new<'b>(
        receiver: &'a Receiver,
        target: &'a [DVec3],
        occluders: impl Iterator<Item = &'b [DVec3]>,
    ) -> Self {
        let planes = [Flat::with_normal(&receiver.corners, receiver.normal), Flat::of(target)];
        let mut outline = Self {
            receiver,
            target,
            planes,
            sides: [(receiver.corners.as_slice(), planes[0]), (target, planes[1])].map(|(corners, plane)| {
                let sides = inward_normals(corners, plane.normal);
                sides.map(|(point, inward)| (inward, inward.dot(point))).collect()
            }),
            vertices: Vec::new(),
            edges: Vec::new(),
            screens: Vec::new(),
            parts: Vec::new(),
        };
        let n_of_target = target.len();
        for (k, &corner) in target.iter().enumerate() {
            outline.push_vertex(corner, true);
            outline.push_edge([k, (k + 1) % n_of_target], true);
        }
        let mut known = Known::default();
        for corners in occluders {
            let (screen, plane) = (outline.screens.len(), Flat::of(corners));
            outline.screens.push(Screen::new(corners, plane));
            let part = outline.between(corners);
            for (k, &a) in part.iter().enumerate() {
                let b = part[(k + 1) % part.len()];
                if a == b {
                    continue;
                }
                let ends = [a, b].map(|corner| known.vertex(corner, || outline.push_vertex(corner, false)));
                let edge = known.edge(ends, || outline.push_edge(ends, false));
                let edge = &mut outline.edges[edge];
                if let Some(place) = edge.screens.get_mut(edge.n_screens) {
                    *place = (screen, edge.vertices == ends);
                }
                edge.n_screens += 1;
            }
            outline.parts.push(part);
        }
        outline
    }

    /// Returns the parts of the occluders in front of the receiver's and the target's plane.
    pub(super) fn parts(&self) -> &[Vec<DVec3>] {
        &self.parts
    }

    /// Returns the part of an occluder in front of the receiver's and the target's plane.
    fn between(&self, corners: &[DVec3]) -> Vec<DVec3> {
        let mut part = corners.to_vec();
        for plane in &self.planes {
            let whole = std::mem::take(&mut part);
            clip_contour(
                whole.len(),
                |k| whole[k],
                |v| plane.snapped_height(v, FLAT),
                |v| part.push(v),
            );
        }
        part
    }

    fn push_vertex(&mut self, position: DVec3, of_target: bool) -> usize {
        self.vertices.push(Vertex {
            position,
            h: self.planes[0].height(position).max(0.0),
            g: self.planes[1].height(position).max(0.0),
            of_target,
        });
        self.vertices.len() - 1
    }

    fn push_edge(&mut self, vertices: [usize; 2], of_target: bool) -> usize {
        self.edges.push(Edge {
            vertices,
            n_screens: 0,
            screens: [(0, false); 2],
            of_target,
        });
        self.edges.len() - 1
    }

    /// Returns an upper bound of the work of [`events`](Self::events): the pairs of a vertex and an edge.
    pub(super) fn n_pairs(&self) -> usize {
        self.vertices.len() * self.edges.len()
    }

    /// Returns the events that are longer than `shortest`.
    pub(super) fn events(&self, shortest: f64) -> Vec<Event> {
        let mut events: Vec<Event> = self
            .screens
            .iter()
            .filter_map(|screen| self.edge_on(&screen.plane))
            .collect();
        events.extend(self.on_the_horizon());
        events.retain(|event| event.from.distance(event.to) > shortest);
        let levels = self.levels();
        for v in 0..self.vertices.len() {
            for edge in &self.edges {
                if self.vertices[v].of_target && edge.of_target {
                    continue;
                }
                for far_edge in [true, false] {
                    if self.may_meet(&levels, v, edge, far_edge)
                        && let Some(event) = self.event(v, edge, far_edge)
                        && event.from.distance(event.to) > shortest
                    {
                        events.push(event);
                    }
                }
            }
        }
        events
    }

    /// Returns the heights of all vertices over the sides of the receiver, then over those of the target, vertex by vertex.
    fn levels(&self) -> Vec<f64> {
        let [of_receiver, of_target] = &self.sides;
        let sides = || of_receiver.iter().chain(of_target);
        let level = |v: DVec3| sides().map(move |&(inward, level)| inward.dot(v) - level);
        self.vertices.iter().flat_map(|vertex| level(vertex.position)).collect()
    }

    /// Returns whether [`event`](Self::event) may find anything; true where rounding may decide.
    fn may_meet(&self, levels: &[f64], v: usize, edge: &Edge, far_edge: bool) -> bool {
        let (n_of_receiver, n_sides) = (self.sides[0].len(), self.sides[0].len() + self.sides[1].len());
        let of = |vertex: usize| &levels[vertex * n_sides..(vertex + 1) * n_sides];
        let [first, second] = edge.vertices;
        let (vertex, ends) = (&self.vertices[v], [&self.vertices[first], &self.vertices[second]]);
        let (level, levels_of_ends) = (of(v), [of(first), of(second)]);
        let is_beyond = |sign: f64, [a, b]: [f64; 2]| sign * (a - b) > CERTAIN * (a.abs() + b.abs());
        // The line through a vertex of height h and level s and a point of height h' and level s' meets the plane of heights at the level (h s' − h' s) / (h − h').
        let passes_by = |sign: f64, h: f64, h_ends: [f64; 2], sides: Range<usize>| {
            (0..2).all(|end| is_beyond(sign, [h, h_ends[end]]))
                || sides
                    .into_iter()
                    .any(|k| (0..2).all(|end| is_beyond(sign, [h * levels_of_ends[end][k], h_ends[end] * level[k]])))
        };
        let sign = if far_edge { 1.0 } else { -1.0 };
        if passes_by(sign, vertex.h, ends.map(|end| end.h), 0..n_of_receiver) {
            return false;
        }
        // Seen from the target, the edge that is behind the vertex is before it.
        vertex.of_target || edge.of_target || !passes_by(-sign, vertex.g, ends.map(|end| end.g), n_of_receiver..n_sides)
    }

    /// Returns the lines on which two points in the receiver's plane cover each other: corners of occluders that stand on or pierce the plane,
    /// and those of the target.
    ///
    /// From the receiver they are on the horizon, where the target is seen only if it reaches down to the plane too.
    fn on_the_horizon(&self) -> Vec<Event> {
        let is_low = |vertex: &&Vertex| vertex.h <= self.planes[0].tolerance(vertex.position, FLAT);
        let [of_target, of_occluders] = [true, false].map(|of_target| {
            let low = self.vertices.iter().filter(is_low);
            low.filter(|vertex| vertex.of_target == of_target)
                .map(|vertex| self.receiver.to_plane(vertex.position))
                .collect::<Vec<DVec2>>()
        });
        if of_occluders.is_empty() {
            return Vec::new();
        }
        let corners = self.receiver.corners.iter().map(|&v| self.receiver.to_plane(v));
        let corners: Vec<DVec2> = corners.collect();
        let mut events = Vec::new();
        for &near in &of_occluders {
            let reach = corners.iter().map(|&corner| corner.distance(near)).fold(0.0, f64::max);
            let mut from_behind = |far: DVec2| {
                if far.distance(near) > FLAT * (reach + far.length()) {
                    events.push(Event {
                        from: near,
                        to: near + (near - far).normalize() * reach,
                    });
                }
            };
            for &far in &of_target {
                from_behind(far);
            }
            for &far in &of_occluders {
                // The line must go on to the target.
                let side = |point: &DVec2| (far - near).perp_dot(*point - near);
                let (low, high) = of_target
                    .iter()
                    .map(side)
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
                if low < 0.0 && high > 0.0 {
                    from_behind(far);
                }
            }
        }
        events
    }

    /// Returns the line from which an occluder is seen edge on, if its plane cuts the receiver and the target; elsewhere that makes no difference.
    fn edge_on(&self, plane: &Flat) -> Option<Event> {
        let height = |v: DVec3| plane.height(v);
        let mut sides = [false; 2];
        for &v in self.target {
            let (height, tolerance) = (height(v), plane.tolerance(v, FLAT));
            sides[0] |= height <= -tolerance;
            sides[1] |= height >= tolerance;
        }
        if sides != [true; 2] {
            return None;
        }
        let corners = &self.receiver.corners;
        let mut ends = (0..corners.len()).filter_map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            let (height_a, height_b) = (height(a), height(b));
            ((height_a >= 0.0) != (height_b >= 0.0)).then(|| a + (b - a) * (height_a / (height_a - height_b)))
        });
        let (from, to) = (ends.next()?, ends.next()?);
        Some(Event {
            from: self.receiver.to_plane(from),
            to: self.receiver.to_plane(to),
        })
    }

    /// Returns the segment from which the vertex lies on the edge in the view; `far_edge` is true if the edge is behind the vertex.
    fn event(&self, vertex: usize, edge: &Edge, far_edge: bool) -> Option<Event> {
        let (number, vertex) = (vertex, &self.vertices[vertex]);
        let v = vertex.position;
        let of_ends = edge.vertices.map(|end| &self.vertices[end]);
        let (edge_ends, edge_h, edge_g) = (
            of_ends.map(|end| end.position),
            of_ends.map(|end| end.h),
            of_ends.map(|end| end.g),
        );
        // A corner of the target lies behind any occluder, an edge of the target too.
        if (vertex.of_target && far_edge) || (edge.of_target && !far_edge) || edge_ends.contains(&v) {
            return None;
        }
        let side = if far_edge { 1.0 } else { -1.0 };
        let mut range = Span { low: 0.0, high: 1.0 };
        // With z on the edge, x = (h_v z − h_z v) / (h_v − h_z): both are affine along the edge.
        let [of_receiver, of_target] = &self.planes;
        let h = [0, 1].map(|i| (edge_ends[i], edge_h[i]));
        let denominator = h.map(|z| of_receiver.rise((v, vertex.h), z));
        range.keep(denominator.map(|rise| -side * rise))?;
        let numerator = [0, 1].map(|i| crossing((v, vertex.h), h[i], denominator[i]));
        for &(inward, level) in &self.sides[0] {
            range.keep([0, 1].map(|i| -side * (inward.dot(numerator[i]) - denominator[i] * level)))?;
        }
        if !vertex.of_target && !edge.of_target {
            // The line must go on to the target, which it meets at y = (g_v z − g_z v) / (g_v − g_z).
            let [y, z] = [0, 1].map(|i| {
                let z = (edge_ends[i], edge_g[i]);
                let rise = of_target.rise((v, vertex.g), z);
                (crossing((v, vertex.g), z, rise), rise)
            });
            range.keep([y.1, z.1].map(|rise| side * rise))?;
            for &(inward, level) in &self.sides[1] {
                range.keep([y, z].map(|(y, w)| side * (inward.dot(y) - w * level)))?;
            }
        }
        let ends = [range.low, range.high].map(|t| {
            let w = denominator[0] + (denominator[1] - denominator[0]) * t;
            (numerator[0] + (numerator[1] - numerator[0]) * t) / w
        });
        if !ends.iter().all(|x| x.is_finite()) || self.is_hidden(number, edge, ends) {
            return None;
        }
        let seen = [range.low, range.high].map(|t| {
            let z = edge_ends[0].lerp(edge_ends[1], t);
            if vertex.of_target {
                v
            } else if edge.of_target {
                z
            } else {
                let g = edge_g[0] + (edge_g[1] - edge_g[0]) * t;
                let rise = of_target.rise((v, vertex.g), (z, g));
                crossing((v, vertex.g), (z, g), rise) / rise
            }
        });
        let is_screened = |screen: &Screen| {
            let [first, last] = [0, 1].map(|i| screen.place_on(ends[i], v, seen[i]));
            // Both lines of sight cross it on one side of v, and so do all between them.
            first.is_some() && first == last && !screen.touches(v, edge_ends)
        };
        if self.screens.iter().any(is_screened) {
            return None;
        }
        Some(Event {
            from: self.receiver.to_plane(ends[0]),
            to: self.receiver.to_plane(ends[1]),
        })
    }

    /// Returns whether, seen from everywhere between the two ends, the edge or the vertex lies inside its occluders' outline.
    fn is_hidden(&self, vertex: usize, edge: &Edge, ends: [DVec3; 2]) -> bool {
        let mut of_vertex = self
            .edges
            .iter()
            .filter(|other| !other.of_target && other.vertices.contains(&vertex));
        self.is_inner(edge, ends)
            || (!self.vertices[vertex].of_target && of_vertex.all(|other| self.is_inner(other, ends)))
    }

    /// Returns whether two occluders lie on both sides of their common edge, seen from everywhere between two ends.
    fn is_inner(&self, edge: &Edge, ends: [DVec3; 2]) -> bool {
        if edge.n_screens != 2 {
            return false;
        }
        // The sign shows on which side of the edge, seen from both ends, the occluder lies; it is 0 where they do not agree.
        let [first, second] = edge.screens.map(|(screen, is_forward)| {
            let [a, b] = ends.map(|x| self.screens[screen].side(x));
            let side = if a == b { a } else { 0 };
            if is_forward { side } else { -side }
        });
        first * second < 0
    }
}

/// An interval of the parameter of an edge.
struct Span {
    low: f64,
    high: f64,
}

impl Span {
    /// Keeps the part where an affine function given by its values at 0 and at 1 is not negative; `None` if that is empty.
    fn keep(&mut self, [at_0, at_1]: [f64; 2]) -> Option<()> {
        let zero = || at_0 / (at_0 - at_1);
        if at_0 < 0.0 {
            if at_1 <= 0.0 {
                return None;
            }
            self.low = self.low.max(zero());
        } else if at_1 < 0.0 {
            self.high = self.high.min(zero());
        }
        (self.low < self.high).then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(corner: DVec3, a: DVec3, b: DVec3) -> Vec<DVec3> {
        vec![corner, corner + a, corner + a + b, corner + b]
    }

    fn floor() -> Receiver {
        Receiver::new(
            rectangle(DVec3::new(-2.0, -2.0, 0.0), DVec3::X * 4.0, DVec3::Y * 4.0),
            DVec3::Z,
        )
    }

    fn world_events(receiver: &Receiver, target: &[DVec3], occluders: &[Vec<DVec3>]) -> Vec<[DVec3; 2]> {
        let outline = Outline::new(receiver, target, occluders.iter().map(Vec::as_slice));
        let events = outline.events(1e-9);
        events
            .iter()
            .map(|e| [receiver.to_world(e.from), receiver.to_world(e.to)])
            .collect()
    }

    #[test]
    fn a_plate_below_a_square_casts_the_borders_of_umbra_and_penumbra() {
        let receiver = floor();
        let target = rectangle(DVec3::new(-0.5, -0.5, 2.0), DVec3::Y, DVec3::X);
        let plate = rectangle(DVec3::new(-0.3, -0.3, 1.0), DVec3::X * 0.6, DVec3::Y * 0.6);
        let events = world_events(&receiver, &target, &[plate]);
        // Each of x and y is at ±2·0.3 ± 0.5 along an event.
        assert_eq!(events.len(), 32);
        for [from, to] in &events {
            let on_line = |axis: usize| {
                let (a, b) = (from[axis], to[axis]);
                (a - b).abs() < 1e-12 && [0.1, 1.1].iter().any(|line| (a.abs() - line).abs() < 1e-12)
            };
            assert!(on_line(0) || on_line(1), "{from} {to}");
        }
    }

    #[test]
    fn a_screen_in_front_of_it_all_leaves_its_own_events_only() {
        let receiver = floor();
        let target = rectangle(DVec3::new(-0.5, -0.5, 2.0), DVec3::Y, DVec3::X);
        let plate = rectangle(DVec3::new(-0.3, -0.3, 1.0), DVec3::X * 0.6, DVec3::Y * 0.6);
        let screen = rectangle(DVec3::new(-3.0, -3.0, 0.4), DVec3::X * 6.0, DVec3::Y * 6.0);
        let screened = world_events(&receiver, &target, &[plate.clone(), screen.clone()]);
        assert!(screened.is_empty(), "{screened:?}");
        // Half a screen leaves the other half of the receiver as it was.
        let half = rectangle(DVec3::new(-3.0, -3.0, 0.4), DVec3::X * 3.0, DVec3::Y * 6.0);
        let left = world_events(&receiver, &target, &[plate.clone(), half]);
        for event in world_events(&receiver, &target, &[plate]) {
            let in_sight = event.iter().all(|x| x.x > 0.6);
            let kept = left
                .iter()
                .any(|e| e[0].distance(event[0]) + e[1].distance(event[1]) < 1e-12);
            assert!(kept || !in_sight, "{event:?}");
        }
    }

    #[test]
    fn inner_edges_of_a_flat_occluder_make_no_events() {
        let receiver = floor();
        let target = rectangle(DVec3::new(-0.5, -0.5, 2.0), DVec3::Y, DVec3::X);
        let halves = [
            rectangle(DVec3::new(-0.3, -0.3, 1.0), DVec3::X * 0.3, DVec3::Y * 0.6),
            rectangle(DVec3::new(0.0, -0.3, 1.0), DVec3::X * 0.3, DVec3::Y * 0.6),
        ];
        for [from, to] in world_events(&receiver, &target, &halves) {
            // The shadow of the inner edge would end at x = ±0.5, along twice the edge's length; its two ends are on the outline and count.
            let as_long = (from.distance(to) - 1.2).abs() < 1e-9;
            assert!(!as_long || (from.x.abs() - 0.5).abs() > 1e-9, "{from} {to}");
        }
    }

    #[test]
    fn an_occluder_that_is_seen_edge_on_makes_an_event_only_if_it_parts_the_target() {
        let receiver = floor();
        let wall = rectangle(DVec3::new(0.2, -9.0, 1.0), DVec3::Y * 18.0, DVec3::Z * 0.5);
        let below = |[from, to]: &[DVec3; 2]| (from.x - 0.2).abs() < 1e-12 && (to.x - 0.2).abs() < 1e-12;
        let target = rectangle(DVec3::new(-0.5, -0.5, 2.0), DVec3::Y, DVec3::X);
        assert!(
            world_events(&receiver, &target, std::slice::from_ref(&wall))
                .iter()
                .any(below)
        );
        let beside = rectangle(DVec3::new(0.5, -0.5, 2.0), DVec3::Y, DVec3::X);
        assert!(!world_events(&receiver, &beside, &[wall]).iter().any(below));
    }

    #[test]
    fn what_is_behind_the_receiver_or_the_target_makes_no_events() {
        let receiver = floor();
        let target = rectangle(DVec3::new(-0.5, -0.5, 2.0), DVec3::Y, DVec3::X);
        let below = rectangle(DVec3::new(-0.3, -0.3, -1.0), DVec3::X * 0.6, DVec3::Y * 0.6);
        let above = rectangle(DVec3::new(-0.3, -0.3, 3.0), DVec3::X * 0.6, DVec3::Y * 0.6);
        assert!(world_events(&receiver, &target, &[below, above]).is_empty());
    }
}
