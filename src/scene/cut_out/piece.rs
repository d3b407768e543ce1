//! Convex pieces of a face, cut along the edges of the faces that are drawn on it.

use glam::DVec3;

use super::{polygon, without_repeats};

/// A straight line through two points.
type Line = [DVec3; 2];

/// A convex part of a face.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    corners: Vec<DVec3>,
    /// The line of the edge from each corner to the next, through corners of the scene. Crossings are computed from these alone, so that they are bit-identical
    /// in every piece and every face that meets there.
    along: Vec<Line>,
}

impl Piece {
    /// Returns the whole of a face.
    pub(super) fn new(corners: &[DVec3]) -> Self {
        Self {
            corners: corners.to_vec(),
            along: lines(corners).collect(),
        }
    }

    /// Returns the corners, in order.
    pub(super) fn corners(&self) -> &[DVec3] {
        &self.corners
    }
}

/// Returns the lines of the edges of an outline.
fn lines(corners: &[DVec3]) -> impl Iterator<Item = Line> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(&a, &b)| [a, b])
}

/// Returns the area of an outline divided by the square of its length: at most 1 / 4π, that of a circle.
fn roundness(corners: &[DVec3]) -> f64 {
    let length: f64 = lines(corners).map(|[a, b]| a.distance(b)).sum();
    polygon::area_vector(corners).length() / (length * length).max(f64::MIN_POSITIVE)
}

/// Returns the fraction of a line's path through an outline that lies on the edge that it extends: with a small fraction, rounding moves its ends further.
fn support(corners: &[DVec3], [a, b]: Line) -> f64 {
    let along = (b - a).normalize_or_zero();
    let places = corners.iter().map(|&v| along.dot(v - a));
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    (a.distance(b) / (high - low).max(f64::MIN_POSITIVE)).min(1.0)
}

/// The plane in which faces are cut.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    normal: DVec3,
    /// The distance below which points and lines are one, in m.
    tolerance: f64,
}

impl Plane {
    pub(super) fn new(normal: DVec3, tolerance: f64) -> Self {
        Self { normal, tolerance }
    }

    /// Returns the greatest distance of corners of `cutters` from the plane of a face; 0 up to the tolerance.
    pub(super) fn distance(&self, face: &[DVec3], cutters: &[Vec<DVec3>]) -> f64 {
        let normal = polygon::area_vector(face).normalize_or_zero();
        let heights = cutters.iter().flatten().map(|&v| normal.dot(v - face[0]).abs());
        let greatest = heights.fold(0.0, f64::max);
        if greatest > self.tolerance { greatest } else { 0.0 }
    }

    /// Returns the convex pieces that are left of a face without the convex `cutters`.
    ///
    /// A piece is cut along the edges of one cutter after another, from border to border: a wall becomes rectangles around an upright door, without slivers that run to its corners.
    /// Of the cutters in a piece, the one nearest to its middle comes first, which halves the rest. Of its edges, the one that leaves the roundest pieces and is not much shorter than the cut comes
    /// first.
    pub(super) fn subtract(&self, face: Piece, cutters: &[Vec<DVec3>]) -> Vec<Piece> {
        let middles: Vec<DVec3> = cutters.iter().map(|cutter| polygon::centroid(cutter)).collect();
        let mut work = vec![(face, (0..cutters.len()).collect::<Vec<_>>())];
        let mut left = Vec::new();
        while let Some((piece, mut within)) = work.pop() {
            within.retain(|&cutter| self.overlap(&piece.corners, &cutters[cutter]));
            let middle = polygon::centroid(&piece.corners);
            let distance = |k: usize| middles[within[k]].distance_squared(middle);
            let nearest = (0..within.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            let Some(nearest) = nearest else {
                left.push(piece);
                continue;
            };
            let cutter = &cutters[within.remove(nearest)];
            let outside = self.around(piece, cutter);
            work.extend(outside.into_iter().map(|part| (part, within.clone())));
        }
        left
    }

    /// Returns the parts of a piece outside of a cutter.
    fn around(&self, piece: Piece, cutter: &[DVec3]) -> Vec<Piece> {
        let mut edges: Vec<Line> = lines(cutter).collect();
        let mut parts = Vec::new();
        let mut rest = piece;
        loop {
            let mut best: Option<(f64, usize, [Option<Piece>; 2])> = None;
            for (k, &edge) in edges.iter().enumerate() {
                let [outside, inside] = self.cut(&rest, edge);
                if outside.is_none() {
                    continue;
                }
                let of_both = [&outside, &inside].into_iter().flatten();
                let worst = of_both.map(|part| roundness(&part.corners)).fold(1.0, f64::min);
                let score = worst * support(&rest.corners, edge);
                if best.as_ref().is_none_or(|(most, ..)| score > *most) {
                    best = Some((score, k, [outside, inside]));
                }
            }
            let Some((_, k, [outside, inside])) = best else {
                return parts;
            };
            edges.remove(k);
            parts.extend(outside);
            match inside {
                Some(inside) => rest = inside,
                None => return parts,
            }
        }
    }

    /// Returns whether two convex outlines overlap by more than the tolerance.
    fn overlap(&self, a: &[DVec3], b: &[DVec3]) -> bool {
        let apart = |by: &[DVec3], other: &[DVec3]| {
            lines(by).any(|line| {
                let inward = self.inward(line);
                other.iter().all(|&v| inward.dot(v - line[0]) <= self.tolerance)
            })
        };
        !apart(a, b) && !apart(b, a)
    }

    /// Returns whether a convex outline contains another one.
    pub(super) fn contains(&self, outer: &[DVec3], inner: &[DVec3]) -> bool {
        lines(outer).all(|line| {
            let inward = self.inward(line);
            inner.iter().all(|&v| inward.dot(v - line[0]) >= -self.tolerance)
        })
    }

    /// Returns the unit vector to the left of a line.
    fn inward(&self, [a, b]: Line) -> DVec3 {
        self.normal.cross(b - a).normalize_or_zero()
    }

    /// Cuts a piece along a line into the part to its right and the part to its left.
    fn cut(&self, piece: &Piece, line: Line) -> [Option<Piece>; 2] {
        let inward = self.inward(line);
        let heights: Vec<f64> = piece
            .corners
            .iter()
            .map(|&v| inward.dot(v - line[0]))
            .map(|height| if height.abs() <= self.tolerance { 0.0 } else { height })
            .collect();
        [-1.0, 1.0].map(|side| self.part(piece, &heights, line, side))
    }

    /// Returns the part of a piece where the heights of its corners over the line have one sign.
    fn part(&self, piece: &Piece, heights: &[f64], line: Line, side: f64) -> Option<Piece> {
        if heights.iter().all(|height| side * height <= 0.0) {
            return None;
        }
        let n = heights.len();
        let mut part = Piece {
            corners: Vec::with_capacity(n + 1),
            along: Vec::with_capacity(n + 1),
        };
        let mut push = |corner, along| {
            part.corners.push(corner);
            part.along.push(along);
        };
        for k in 0..n {
            let next = (k + 1) % n;
            let (height, height_next) = (side * heights[k], side * heights[next]);
            let along = piece.along[k];
            let crossing = || {
                let ends = [piece.corners[k], piece.corners[next]];
                self.crossing(along, line, ends, heights[k] / (heights[k] - heights[next]))
            };
            if height > 0.0 && height_next < 0.0 {
                push(piece.corners[k], along);
                push(crossing(), line);
            } else if height < 0.0 && height_next > 0.0 {
                push(crossing(), along);
            } else if height >= 0.0 {
                push(piece.corners[k], if height_next < 0.0 { line } else { along });
            }
        }
        Some(part)
    }

    /// Returns the point where two lines cross, independent of their order and directions; it lies between `ends`, near the fraction `t` of the way.
    fn crossing(&self, one: Line, other: Line, ends: [DVec3; 2], t: f64) -> DVec3 {
        let ordered = |[a, b]: Line| if a.to_array() <= b.to_array() { [a, b] } else { [b, a] };
        let [mut on, mut by] = [one, other].map(ordered);
        if let Some(&common) = on.iter().find(|v| by.contains(v)) {
            return common;
        }
        // A point on the longer line needs less extrapolation.
        let key = |[a, b]: Line| (a.distance_squared(b), a.to_array(), b.to_array());
        if key(by) > key(on) {
            std::mem::swap(&mut on, &mut by);
        }
        let inward = self.inward(by);
        let [from, to] = on.map(|v| inward.dot(v - by[0]));
        let exact = on[0] + (on[1] - on[0]) * (from / (from - to));
        let near = ends[0] + (ends[1] - ends[0]) * t;
        // Where corners were moved by the tolerance, lines at a small angle cross elsewhere.
        let point = if exact.distance(near) <= 4.0 * self.tolerance {
            exact
        } else {
            near
        };
        let corners = on.into_iter().chain(by);
        let nearest = corners.min_by(|a, b| a.distance_squared(point).total_cmp(&b.distance_squared(point)));
        nearest
            .filter(|corner| corner.distance(point) <= self.tolerance)
            .unwrap_or(point)
    }
}

/// Cuts a convex outline into triangles and quads, each time by the diagonal that leaves the roundest parts.
pub(super) fn convex_faces(corners: &[DVec3]) -> Vec<Vec<DVec3>> {
    let mut faces = Vec::new();
    let mut rest = corners.to_vec();
    // Cuts that end in one corner of the scene leave it twice.
    without_repeats(&mut rest);
    while rest.len() > 4 {
        let n = rest.len();
        // Four corners from the first one on, and the remaining outline with the two at the diagonal.
        let parts = |first: usize| {
            let turned: Vec<DVec3> = (0..n).map(|k| rest[(first + k) % n]).collect();
            let others = std::iter::once(turned[0]).chain(turned[3..].iter().copied()).collect();
            (turned[..4].to_vec(), others)
        };
        let worst = |(quad, others): &(Vec<DVec3>, Vec<DVec3>)| roundness(quad).min(roundness(others));
        let best = (0..n).map(parts).max_by(|a, b| worst(a).total_cmp(&worst(b)));
        let Some((quad, others)) = best else {
            break;
        };
        faces.push(quad);
        rest = others;
    }
    faces.push(rest);
    faces
}
