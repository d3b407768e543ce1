//! Convex pieces of a face, cut along the contact edges on it.
//!
//! A patch that straddles a wall leaks light across it, and its part under an object counts as lit. Where faces end at contact edges, so do
//! patches. Each contact edge cuts the piece on which it lies, along its whole line, so that pieces stay convex; a tree of these lines finds the piece of a point.
//!
//! Source: [`BAUM_1991`](crate::references::BAUM_1991). Departures: lines through whole pieces in the place of a triangulation.

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3};

use super::contact_edge::ContactEdge;
use crate::geometry::polygon;

/// The most contact edges that are tried as the next line of a piece.
const MAX_TRIED: usize = 64;

/// The cost of a contact edge that a line cuts in two, in contact edges that one side has more than the other.
const COST_OF_CUT: usize = 8;

/// A corner of a piece, in the plane of the face and in space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) flat: DVec2,
    pub(super) place: DVec3,
}

/// A line, and the nodes on either side of it: where the cross product of its direction with the way from its start is not negative, and where it is.
#[derive(Clone, Debug)]
enum Node {
    Line {
        start: DVec2,
        along: DVec2,
        sides: [usize; 2],
    },
    /// The number of a piece.
    Piece(usize),
}

/// Finds the piece of a point in the plane of a face.
#[derive(Clone, Debug)]
pub(super) struct PieceTree {
    nodes: Vec<Node>,
}

impl PieceTree {
    /// Returns the number of the piece that contains a point of the face.
    pub(super) fn piece_at(&self, point: DVec2) -> usize {
        let mut node = 0;
        loop {
            match &self.nodes[node] {
                Node::Line { start, along, sides } => {
                    node = sides[usize::from(along.perp_dot(point - start) < 0.0)];
                }
                Node::Piece(piece) => return *piece,
            }
        }
    }
}

/// The pieces of a face, each with three or four corners, counter-clockwise, and their positions.
#[derive(Clone, Debug)]
pub(super) struct Pieces {
    /// The face itself.
    pub(super) face: Vec<Corner>,
    pub(super) outlines: Vec<Vec<Corner>>,
    pub(super) tree: PieceTree,
    /// The greatest distance of the contact edges from the plane, in m.
    pub(super) misfit: f64,
}

/// A contact edge in the plane of a face.
#[derive(Clone, Copy, Debug)]
struct Segment {
    ends: [DVec2; 2],
    /// The least thickness of a piece beside it, in m: its tolerance.
    least: f64,
}

impl Pieces {
    /// Cuts a convex face along contact edges in its plane, which need not lie within the face; `None` where none crosses it.
    ///
    /// Work: O(n log n) for n contact edges, unless lines cross many others.
    pub(super) fn cut(face: &[DVec3], contact_edges: &[ContactEdge]) -> Option<Self> {
        let (origin, x) = (face[0], (face[1] - face[0]).normalize());
        let y = polygon::area_vector(face).normalize().cross(x);
        let flat = |place: DVec3| DVec2::new(x.dot(place - origin), y.dot(place - origin));
        let face: Vec<Corner> = face
            .iter()
            .map(|&place| Corner {
                flat: flat(place),
                place,
            })
            .collect();
        let segments = contact_edges.iter().map(|edge| Segment {
            ends: [flat(edge.from), flat(edge.to)],
            least: edge.tolerance,
        });
        let segments: Vec<Segment> = segments.collect();
        let crossing = segments.iter().zip(contact_edges);
        let crossing = crossing.filter(|(segment, _)| crosses(&face, **segment).is_some());
        let misfit = crossing.map(|(_, edge)| edge.misfit).fold(0.0, f64::max);
        let mut outlines = Vec::new();
        let mut nodes = vec![Node::Piece(0)];
        let mut open = vec![(0, face.clone(), segments)];
        while let Some((node, piece, mut here)) = open.pop() {
            here.retain(|edge| crosses(&piece, *edge).is_some());
            let (line, parts) = if let Some(Segment {
                ends: [start, end],
                least,
            }) = best_line(&piece, &here)
            {
                let along = (end - start).normalize();
                let parts = [along, -along].map(|direction| part_beside(&piece, start, direction, least));
                ((start, along), parts)
            } else if let Some((from, to)) = diagonal(&piece) {
                let start = piece[from].flat;
                let part = |range: RangeInclusive<usize>| range.map(|k| piece[k % piece.len()]).collect();
                // The part to the left of the way from one corner to the other comes after the other.
                let parts = [part(to..=from + piece.len()), part(from..=to)];
                ((start, piece[to % piece.len()].flat - start), parts)
            } else {
                nodes[node] = Node::Piece(outlines.len());
                outlines.push(piece);
                continue;
            };
            let first = nodes.len();
            nodes[node] = Node::Line {
                start: line.0,
                along: line.1,
                sides: [first, first + 1],
            };
            nodes.extend([Node::Piece(0), Node::Piece(0)]);
            for (k, part) in parts.into_iter().enumerate().rev() {
                open.push((first + k, part, here.clone()));
            }
        }
        let tree = PieceTree { nodes };
        (outlines.len() > 1).then_some(Self {
            face,
            outlines,
            tree,
            misfit,
        })
    }
}

/// Returns the length of a contact edge inside a convex piece, if its line has parts of the piece on both sides.
///
/// It must not run along the border.
fn crosses(
    piece: &[Corner],
    Segment {
        ends: [start, end],
        least,
    }: Segment,
) -> Option<f64> {
    let along = end - start;
    let length = along.length();
    let heights = piece.iter().map(|corner| along.perp_dot(corner.flat - start) / length);
    let (low, high) = heights.fold((0.0, 0.0), |(low, high): (f64, f64), h| (low.min(h), high.max(h)));
    if !(low < -least && high > least) {
        return None;
    }
    let inside = |k: usize, point: DVec2| {
        let (a, b) = (piece[k].flat, piece[(k + 1) % piece.len()].flat);
        (b - a).perp_dot(point - a) / a.distance(b)
    };
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for k in 0..piece.len() {
        let (h, g) = (inside(k, start), inside(k, end));
        if h < 0.0 && g < 0.0 {
            return None;
        }
        let t = h / (h - g);
        if h < 0.0 {
            first = first.max(t);
        } else if g < 0.0 {
            last = last.min(t);
        }
    }
    let part = (last - first) * length;
    let middle = start.lerp(end, 0.5 * (first + last));
    let is_inside = part > least && (0..piece.len()).all(|k| inside(k, middle) > least);
    is_inside.then_some(part)
}

/// Returns the contact edge whose line cuts the fewest others in two and leaves about as many on either side; of equals the longest.
fn best_line(piece: &[Corner], contact_edges: &[Segment]) -> Option<Segment> {
    let step = contact_edges.len().div_ceil(MAX_TRIED).max(1);
    let cost = |edge: &Segment| {
        let unit = (edge.ends[1] - edge.ends[0]).normalize_or_zero();
        let (mut left, mut right, mut cut) = (0_usize, 0_usize, 0);
        for other in contact_edges {
            let heights = other.ends.map(|end| unit.perp_dot(end - edge.ends[0]));
            match (
                heights.iter().any(|h| *h > edge.least),
                heights.iter().any(|h| *h < -edge.least),
            ) {
                (true, true) => cut += 1,
                (true, false) => left += 1,
                (false, true) => right += 1,
                (false, false) => {}
            }
        }
        COST_OF_CUT * cut + left.abs_diff(right)
    };
    let tried = contact_edges.iter().step_by(step).map(|edge| {
        let inside = crosses(piece, *edge).unwrap_or(0.0);
        (cost(edge), -inside, *edge)
    });
    tried
        .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
        .map(|(_, _, edge)| edge)
}

/// Returns the corners of a piece with more than four between which a line cuts off a quad and leaves the best two parts.
///
/// The number of the second continues beyond the last corner.
fn diagonal(piece: &[Corner]) -> Option<(usize, usize)> {
    let n = piece.len();
    if n <= 4 {
        return None;
    }
    // Area over squared border: 1/16 for a square.
    let shape = |corners: &[DVec2]| {
        let m = corners.len();
        let border: f64 = (0..m).map(|k| corners[k].distance(corners[(k + 1) % m])).sum();
        let area: f64 = (0..m).map(|k| corners[k].perp_dot(corners[(k + 1) % m])).sum();
        area / (border * border)
    };
    let quality = |k: usize| {
        let at = |corner: usize| piece[corner % n].flat - piece[0].flat;
        let quad: Vec<DVec2> = (k..k + 4).map(at).collect();
        let rest: Vec<DVec2> = (k + 3..=k + n).map(at).collect();
        shape(&quad).min(shape(&rest))
    };
    let best = (0..n).max_by(|&a, &b| quality(a).total_cmp(&quality(b)))?;
    Some((best, best + 3))
}

/// Returns the part of a convex piece to the left of a line; corners within `least` of the line count as on it.
fn part_beside(piece: &[Corner], start: DVec2, along: DVec2, least: f64) -> Vec<Corner> {
    let height = |corner: &Corner| {
        let h = along.perp_dot(corner.flat - start);
        if h.abs() <= 0.5 * least { 0.0 } else { h }
    };
    let mut part = Vec::with_capacity(piece.len() + 1);
    for (k, corner) in piece.iter().enumerate() {
        let next = &piece[(k + 1) % piece.len()];
        let (h, g) = (height(corner), height(next));
        if h >= 0.0 {
            part.push(*corner);
        }
        if h * g < 0.0 {
            // From the same end for both sides of the line, and for the piece beyond the edge.
            let (one, other) = if comes_first(corner, next) {
                (corner, next)
            } else {
                (next, corner)
            };
            let t = height(one) / (height(one) - height(other));
            part.push(Corner {
                flat: one.flat.lerp(other.flat, t),
                place: one.place.lerp(other.place, t),
            });
        }
    }
    part
}

/// Returns the end of an edge that comes first, in either direction.
fn comes_first(a: &Corner, b: &Corner) -> bool {
    (a.flat.x, a.flat.y) < (b.flat.x, b.flat.y)
}
