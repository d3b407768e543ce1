//! Layers along the border of a cell, thinner than the points of a rule can show.
//!
//! Between the discontinuity lines the hidden part is analytic, but on the scale of the distance to the edges that form it. Where such an
//! edge runs close above the receiver, as in a narrow gap, the view may change within a strip of that width beside a discontinuity line, between the border and the
//! points of a rule. Points at a tenth, a hundredth, ... of their inset then show the change there.

use glam::{DVec2, DVec3};

use super::events::Event;
use super::rule::{INSET, N_BORDER, Parts, border};

/// Edges that run close above a receiver: in its frame, with their heights.
#[derive(Default)]
pub(super) struct LowEdges {
    edges: Vec<[DVec3; 2]>,
    /// The least height of any of them above the receiver.
    lowest: f64,
    /// Heights up to this are in the receiver's plane.
    tolerance: f64,
}

impl LowEdges {
    /// Keeps the edges that are nearer to a receiver with these corners than the outermost points of a rule are to its border.
    pub(super) fn new(edges: impl Iterator<Item = [DVec3; 2]>, corners: &[DVec2], tolerance: f64) -> Self {
        let bounds = Bounds::of(corners);
        let (mut kept, mut lowest) = (Vec::new(), f64::INFINITY);
        for edge in edges {
            if let Some(height) = bounds.height(edge, tolerance) {
                kept.push(edge);
                lowest = lowest.min(height);
            }
        }
        Self {
            edges: kept,
            lowest,
            tolerance,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// Returns the least height of an edge above the receiver.
    pub(super) fn lowest(&self) -> f64 {
        self.lowest
    }

    /// Returns the errors of the integrals over a triangle by its layers, and the number of points that this took.
    pub(super) fn error(&self, corners: [DVec2; 3], mut f: impl FnMut(DVec2) -> Parts) -> (Parts, usize) {
        let bounds = Bounds::of(&corners);
        let heights = self
            .edges
            .iter()
            .filter_map(|&edge| bounds.height(edge, self.tolerance));
        let lowest = heights.fold(f64::INFINITY, f64::min);
        let (mut error, mut n_evaluations) = ([0.0; 2], 0);
        if lowest.is_infinite() {
            return (error, n_evaluations);
        }
        let (a, e, g) = (corners[0], corners[1] - corners[0], corners[2] - corners[0]);
        let area = 0.5 * e.perp_dot(g).abs();
        let mut at = |inset: f64| border(inset).map(|[x, y]| f(a + e * x + g * y));
        let (mut inset, mut last) = (INSET, at(INSET));
        while inset * bounds.size > STEP * lowest {
            let next = at(STEP * inset);
            for part in 0..2 {
                let changes = (0..N_BORDER).map(|k| (next[k][part] - last[k][part]).abs());
                // Strips along all sides are twice their inset of the triangle.
                error[part] += area * 2.0 * inset * changes.fold(0.0, f64::max);
            }
            n_evaluations += N_BORDER;
            (inset, last) = (STEP * inset, next);
        }
        (error, n_evaluations + N_BORDER)
    }
}

/// The greatest height of a low part of an occluder between receiver and target, as a fraction of the receiver's diameter.
const LOW: f64 = 0.1;

/// Returns the cuts of a receiver for a low part of an occluder, given in the receiver's frame: below its edges, and across it at its corners.
///
/// The hidden part is greatest there, within its own height; where the target is as near, no discontinuity line marks the position.
/// Beside an edge that is too low for the points of a rule, strips as wide as their distance from it follow the view on its own scale: halving isotropic cells down to a strip of width w would take 1/w of them.
pub(super) fn cuts(part: &[DVec3], diameter: f64) -> Vec<Event> {
    if part.len() < 3 || part.iter().any(|v| v.z > LOW * diameter) {
        return Vec::new();
    }
    let next = part.iter().cycle().skip(1);
    let edges: Vec<[DVec3; 2]> = part.iter().zip(next).map(|(&a, &b)| [a, b]).collect();
    let below = edges.iter().map(|edge| {
        let [from, to] = edge.map(DVec3::truncate);
        Event { from, to }
    });
    let longest = below
        .clone()
        .map(|line| line.to - line.from)
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let across = diameter * longest.unwrap_or_default().normalize_or_zero().perp();
    let at_corners = part.iter().map(|v| Event {
        from: v.truncate() - across,
        to: v.truncate() + across,
    });
    let beside = edges.iter().flat_map(|&edge| strips(edge, diameter));
    below.chain(at_corners).chain(beside).collect()
}

/// Returns the lines on both sides of an edge that bound strips, the first at half of its least height, each at twice the distance of the one before.
///
/// They go on until they are as wide as the points of a rule can show by themselves.
fn strips([a, b]: [DVec3; 2], diameter: f64) -> Vec<Event> {
    let lowest = a.z.min(b.z);
    let [from, to] = [a.truncate(), b.truncate()];
    let sideways = (to - from).normalize_or_zero().perp();
    let mut lines = Vec::new();
    // An edge that comes down to the plane has no scale.
    if lowest <= THINNEST * diameter || lowest >= INSET * diameter {
        return lines;
    }
    let mut distance = 0.5 * lowest;
    while distance < WIDEST * diameter {
        for offset in [distance * sideways, -distance * sideways] {
            lines.push(Event {
                from: from + offset,
                to: to + offset,
            });
        }
        distance *= 2.0;
    }
    lines
}

/// The least height of an edge that strips follow, as a fraction of the receiver's diameter: discontinuity lines are within 1e-9 of it.
const THINNEST: f64 = 4e-9;

/// The distance from an edge up to which strips follow it, as a fraction of the receiver's diameter: up to the inset of the points alone, two to five times as many evaluations were needed.
const WIDEST: f64 = 10.0 * INSET;

/// The distance of the next step's points from the border, relative to that of the last.
const STEP: f64 = 0.1;

/// A box around a polygon in the receiver's frame.
struct Bounds {
    low: DVec2,
    high: DVec2,
    /// Its diameter.
    size: f64,
}

impl Bounds {
    fn of(corners: &[DVec2]) -> Self {
        let all = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = corners.iter().fold(all, |(l, h), &v| (l.min(v), h.max(v)));
        Self {
            low,
            high,
            size: low.distance(high),
        }
    }

    /// Returns the least height of an edge above the box.
    ///
    /// `None` if it is too high to make a layer, or reaches down to the plane, where there is no scale.
    fn height(&self, [from, to]: [DVec3; 2], tolerance: f64) -> Option<f64> {
        let reach = INSET * self.size;
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            for (sign, level) in [(1.0, self.low[axis]), (-1.0, -self.high[axis])] {
                let [at_0, at_1] = [from, to].map(|v| sign * v[axis] - level + reach);
                if at_0 < 0.0 && at_1 < 0.0 {
                    return None;
                }
                let zero = at_0 / (at_0 - at_1);
                if at_0 < 0.0 {
                    first = first.max(zero);
                } else if at_1 < 0.0 {
                    last = last.min(zero);
                }
            }
        }
        let lowest = from.lerp(to, first).z.min(from.lerp(to, last).z);
        (first < last && lowest > tolerance && lowest < reach).then_some(lowest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: [DVec2; 3] = [DVec2::ZERO, DVec2::X, DVec2::Y];

    fn edge(height: f64) -> [DVec3; 2] {
        [DVec3::new(-1.0, 0.0, height), DVec3::new(2.0, 0.0, height)]
    }

    #[test]
    fn only_edges_close_above_the_receiver_count() {
        let kept = |edge: [DVec3; 2]| LowEdges::new(std::iter::once(edge), &UNIT, 1e-13).edges.len();
        assert_eq!(
            [1e-2, 1e-4, 1e-12, 1e-14, 0.0, -1e-4].map(|h| kept(edge(h))),
            [0, 1, 1, 0, 0, 0]
        );
        // One that pierces the plane, and one beside the triangle.
        assert_eq!(kept([DVec3::new(0.5, 0.2, -1e-4), DVec3::new(0.5, 0.3, 1e-4)]), 0);
        assert_eq!(kept(edge(1e-4).map(|v| v - DVec3::Y)), 0);
    }

    /// Light through a gap of width w beside a wall: (1 − t/√(t² + w²))/2 at the distance t.
    #[test]
    fn a_layer_of_any_width_is_seen() {
        for width in [1e-5, 1e-7, 1e-9] {
            let low = LowEdges::new(std::iter::once(edge(width)), &UNIT, 1e-13);
            let (error, n_evaluations) = low.error(UNIT, |p| [0.5 * (1.0 - p.y / p.y.hypot(width)), 0.3]);
            // ∫ over the triangle is width/2 but for the end of the strip.
            assert!(error[0] > 0.5 * width && error[0] < 20.0 * width, "{width:e} {error:?}");
            assert!(error[1].abs() < f64::MIN_POSITIVE && n_evaluations < 60);
        }
    }
}
