//! Detects rounding of short decimals: nearly flat or nearly square outlines, their halves, and vertices that nearly lie on an edge.

use foldhash::{HashMap, HashMapExt as _};
use glam::DVec3;

use super::{Corners, Scene, Written};
use crate::geometry::box_pairs::overlapping_pairs;
use crate::geometry::polygon::{self, is_along_axis};

/// The length, in units of the last digit, below which outlines and edges are no evidence: a unit is a part of their shape.
const MIN_UNITS: f64 = 100.0;

/// The same where most of several outlines, of numbers with places after the point, agree.
const FEW_UNITS: f64 = 10.0;

/// The fewest outlines that agree.
const AGREEING: u32 = 3;

/// The same length for a turned rectangle: its four corners must be right angles to 6 degrees or better.
const MIN_SIDE: f64 = 30.0;

/// The least share of rectangles that miss a right angle among pairs of triangles that form a quadrilateral: in an irregular mesh some do by chance.
const MIN_SHARE: f64 = 0.25;

/// The same for rectangles whose sides have few units.
const MIN_SHARE_OF_SMALL: f64 = 0.75;

/// The rounding of f64 in heights and cosines that are 0.
const NOISE: f64 = 1e-12;

/// The signs of rounding in the outlines of a file.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_field_names, reason = "counts are named n_ everywhere")]
pub(super) struct Misses {
    /// The number of outlines that are bent by at most a unit.
    n_nearly_flat: usize,
    /// The number of outlines that are bent by more, deliberately.
    n_bent: usize,
    /// The number of outlines of few units that are bent by at most one.
    n_small_nearly_flat: u32,
    /// The number of those that are bent by more, or are flat although they lie along no axis.
    n_small_others: u32,
    /// The number of turned rectangles whose corners miss a right angle.
    n_nearly_square: usize,
}

impl Misses {
    /// Examines an outline of the file.
    pub(super) fn see(&mut self, corners: &[DVec3], written: &Written) {
        if corners.len() < 4 {
            return;
        }
        let (low, high) = polygon::bounds(corners);
        let unit = written.unit(low.abs().max(high.abs()).max_element());
        let size = low.distance(high);
        let bend = polygon::planarity_error(corners);
        let is_bent = bend > NOISE * size.max(high.abs().max_element());
        let is_tilted = (high - low).min_element() > 0.0;
        if size >= MIN_UNITS * unit && is_bent {
            if bend <= unit {
                self.n_nearly_flat += 1;
            } else {
                self.n_bent += 1;
            }
        } else if size >= FEW_UNITS * unit && is_tilted && written.has_places() {
            if is_bent && bend <= unit {
                self.n_small_nearly_flat += 1;
            } else {
                self.n_small_others += 1;
            }
        }
        if let [a, b, c, d] = *corners {
            self.n_nearly_square += usize::from(is_nearly_square([b - a, c - b, d - c, a - d], MIN_SIDE, unit));
        }
    }

    /// Returns whether the examined faces of a file, or its vertices, miss each other by no more than a unit.
    ///
    /// Work: O(n log n) for n faces, unless boxes around edges meet many vertices.
    pub(super) fn show_rounding(self, scene: &Scene, written: &Written) -> bool {
        self.n_nearly_flat > self.n_bent
            || self.n_small_nearly_flat >= AGREEING.max(self.n_small_others + 1)
            || self.n_nearly_square > 0
            || has_nearly_square_halves(scene, written)
            || has_vertex_beside_edge(scene, written)
    }
}

/// Returns whether the corners between four edges, none along an axis, are right angles up to an error of a unit at their ends.
///
/// All are at least `min_side` units long.
fn is_nearly_square(edges: [DVec3; 4], min_side: f64, unit: f64) -> bool {
    if edges.iter().any(|&edge| is_along_axis(edge)) {
        return false;
    }
    let off = |k: usize| {
        let (one, next) = (edges[k], edges[(k + 1) % 4]);
        let (a, b) = (one.length(), next.length());
        let is_near = one.dot(next).abs() <= 1.5 * unit * (a + b);
        (is_near && a.min(b) >= min_side * unit).then(|| one.dot(next).abs() / (a * b))
    };
    let cosines = [off(0), off(1), off(2), off(3)];
    cosines.iter().all(Option::is_some) && cosines.iter().flatten().any(|&cosine| cosine > NOISE)
}

/// Returns whether many pairs of triangles with a common longest edge are halves of turned rectangles whose corners miss a right angle.
fn has_nearly_square_halves(scene: &Scene, written: &Written) -> bool {
    let unit = written.unit(scene.greatest_where_faces_meet());
    let at = |v: u32| scene.vertices[v as usize];
    // The corner opposite the longest edge, by that edge.
    let mut apex_of: HashMap<[u32; 2], u32> = HashMap::new();
    let (mut n_pairs, mut n_nearly_square, mut n_small) = (0_u32, 0_u32, 0_u32);
    for face in &scene.faces {
        let Corners::Triangle(corners) = face.corners else {
            continue;
        };
        let turned = [0, 1, 2].map(|k| [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]]);
        let length = |[from, to, _]: &[u32; 3]| at(*from).distance_squared(at(*to));
        let longest = turned.into_iter().max_by(|a, b| length(a).total_cmp(&length(b)));
        let Some([from, to, apex]) = longest else {
            continue;
        };
        if let Some(&other) = apex_of.get(&[to, from]) {
            let [a, b, c, d] = [from, other, to, apex].map(at);
            let edges = [b - a, c - b, d - c, a - d];
            // An edge along an axis keeps right angles exact, so upright walls are no evidence.
            n_pairs += u32::from(!edges.into_iter().any(is_along_axis));
            n_nearly_square += u32::from(is_nearly_square(edges, MIN_SIDE, unit));
            n_small += u32::from(is_nearly_square(edges, FEW_UNITS, unit));
        }
        apex_of.insert([from, to], apex);
    }
    let share = |n: u32| f64::from(n) / f64::from(n_pairs);
    (n_nearly_square > 0 && share(n_nearly_square) >= MIN_SHARE)
        || (written.has_places() && n_small >= AGREEING && share(n_small) >= MIN_SHARE_OF_SMALL)
}

/// Returns whether a vertex lies less than a unit off an edge of a face to which it does not belong.
///
/// Distinct vertices and intended gaps are at least a unit apart, so they are not counted.
fn has_vertex_beside_edge(scene: &Scene, written: &Written) -> bool {
    let unit = written.unit(scene.greatest_where_faces_meet());
    let mut edges: Vec<[u32; 2]> = Vec::new();
    let mut faces: Vec<&[u32]> = Vec::new();
    for face in &scene.faces {
        let corners = face.corners.as_slice();
        for (k, &a) in corners.iter().enumerate() {
            let edge = [a, corners[(k + 1) % corners.len()]];
            let [from, to] = edge.map(|v| scene.vertices[v as usize]);
            // Distances from an edge along an axis are whole units.
            if from.distance(to) >= 2.0 * MIN_UNITS * unit && !is_along_axis(to - from) {
                edges.push(edge);
                faces.push(corners);
            }
        }
    }
    if edges.is_empty() {
        return false;
    }
    let n_edges = u32::try_from(edges.len()).unwrap_or(u32::MAX);
    let margin = DVec3::splat(unit);
    let at = |v: u32| scene.vertices[v as usize];
    let of_edges = edges.iter().map(|edge| {
        let (from, to) = (at(edge[0]), at(edge[1]));
        (from.min(to) - margin, from.max(to) + margin)
    });
    let of_vertices = scene.vertices.iter().map(|&v| (v, v));
    let mut is_found = false;
    overlapping_pairs(of_edges.chain(of_vertices).collect(), |one, other| {
        let (edge, vertex) = (one.min(other), one.max(other));
        if is_found || edge >= n_edges || vertex < n_edges {
            return;
        }
        let vertex = vertex - n_edges;
        if faces[edge as usize].contains(&vertex) {
            return;
        }
        let [from, to] = edges[edge as usize].map(at);
        let length = from.distance(to);
        let along = (to - from) / length;
        let t = along.dot(at(vertex) - from);
        let off = along.cross(at(vertex) - from).length();
        let is_inside = t > MIN_UNITS * unit && t < length - MIN_UNITS * unit;
        is_found = is_inside && off < unit && off > NOISE * length.max(at(vertex).abs().max_element());
    });
    is_found
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use glam::{DQuat, DVec3};

    use super::super::load;

    /// Returns whether a file with these outlines shows that it was rounded.
    fn shows_rounding(outlines: &[&[DVec3]], number: impl Fn(f64) -> String) -> bool {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("scene.obj");
        let vertices = outlines.iter().copied().flatten();
        let lines = vertices.map(|v| format!("v {} {} {}\n", number(v.x), number(v.y), number(v.z)));
        let mut text: String = lines.collect();
        let mut n = 0;
        for outline in outlines {
            let corners: Vec<String> = (1..=outline.len()).map(|k| (n + k).to_string()).collect();
            let _ = writeln!(text, "f {}", corners.join(" "));
            n += outline.len();
        }
        std::fs::write(&path, text).expect("a file");
        let scene = load(&path).expect("a scene").scene;
        scene.written.expect("digits").shows_rounding()
    }

    fn turned(outline: &[[f64; 3]], turn: DQuat) -> Vec<DVec3> {
        outline.iter().map(|&v| turn * DVec3::from_array(v)).collect()
    }

    const FLOOR: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 3.0, 0.0], [0.0, 3.0, 0.0]];

    #[test]
    fn outlines_that_are_nearly_flat_or_square_show_it() {
        let tilted = DQuat::from_axis_angle(DVec3::new(2.0, 1.0, 2.0) / 3.0, 0.9);
        for (turn, places, expected) in [
            (DQuat::IDENTITY, 2, false),
            (DQuat::IDENTITY, 4, false),
            (DQuat::from_rotation_z(0.4), 2, true),
            (DQuat::from_rotation_z(0.4), 3, true),
            (tilted, 2, true),
            (tilted, 4, true),
            // With so few places a unit is a part of the shape.
            (tilted, 0, false),
        ] {
            let found = shows_rounding(&[&turned(&FLOOR, turn)], |x| format!("{x:.places$}"));
            assert_eq!(found, expected, "{turn} {places}");
        }
        // Millimetres, which are whole numbers.
        let of_metres = turned(&FLOOR, tilted);
        assert!(shows_rounding(&[&of_metres], |x| format!("{:.0}", 1000.0 * x)));
        // Each of its halves alone.
        for (turn, places, expected) in [
            (DQuat::IDENTITY, 2, false),
            (DQuat::from_rotation_z(0.4), 2, true),
            (tilted, 4, true),
        ] {
            let corners = turned(&FLOOR, turn);
            let halves = [
                vec![corners[0], corners[1], corners[2]],
                vec![corners[2], corners[3], corners[0]],
            ];
            let found = shows_rounding(&halves.each_ref().map(Vec::as_slice), |x| format!("{x:.places$}"));
            assert_eq!(found, expected, "halves, {turn} {places}");
        }
        // A rectangle along no axis with integer corners, and outlines that are bent on purpose.
        let square = [
            [0.0, 0.0, 0.0],
            [300.0, 400.0, 0.0],
            [-100.0, 700.0, 0.0],
            [-400.0, 300.0, 0.0],
        ];
        assert!(!shows_rounding(&[&turned(&square, DQuat::IDENTITY)], |x| format!(
            "{x:.0}"
        )));
        let bent = FLOOR.map(|[x, y, _]| [x, y, 0.1 * x * y]);
        assert!(!shows_rounding(&[&turned(&bent, DQuat::IDENTITY)], |x| format!(
            "{x:.2}"
        )));
    }

    /// Boxes of few units of the last digit: one turned off all axes, whole and in triangles; one along the axes; a warped ground.
    #[test]
    fn several_small_outlines_that_agree_show_it() {
        let tilted = DQuat::from_axis_angle(DVec3::new(2.0, 1.0, 2.0) / 3.0, 0.9);
        let corner = |k: usize| DVec3::new((k & 1) as f64 * 2.5, (k >> 1 & 1) as f64 * 2.0, (k >> 2) as f64 * 2.2);
        let sides = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        for (turn, expected) in [(tilted, true), (DQuat::IDENTITY, false)] {
            let quads: Vec<Vec<DVec3>> = sides
                .iter()
                .map(|side| side.iter().map(|&k| turn * corner(k)).collect())
                .collect();
            let halves = quads
                .iter()
                .flat_map(|q| [vec![q[0], q[1], q[2]], vec![q[2], q[3], q[0]]]);
            for outlines in [quads.clone(), halves.collect()] {
                let outlines: Vec<&[DVec3]> = outlines.iter().map(Vec::as_slice).collect();
                assert_eq!(
                    shows_rounding(&outlines, |x| format!("{x:.1}")),
                    expected,
                    "{turn} {}",
                    outlines.len()
                );
                // Whole numbers are exact.
                assert!(!shows_rounding(&outlines, |x| format!("{:.0}", 10.0 * x)));
            }
        }
        let height = |i: usize, j: usize| ((i * 7 + j * 5) % 4) as f64 * 0.3;
        let at = |i: usize, j: usize| DVec3::new(i as f64 * 2.0, j as f64 * 2.0, height(i, j));
        let ground: Vec<Vec<DVec3>> = (0..9)
            .map(|k| (k / 3, k % 3))
            .map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
            .collect();
        let ground: Vec<&[DVec3]> = ground.iter().map(Vec::as_slice).collect();
        assert!(!shows_rounding(&ground, |x| format!("{x:.1}")));
    }

    #[test]
    fn vertices_beside_an_edge_show_it() {
        let beside = |t: f64, off: f64| {
            // Two triangles on one side of an edge, and one on the other with a corner in the middle of it.
            let (from, to) = (DVec3::new(0.0, 0.0, 1.0), DVec3::new(5.0, 3.0, 2.0));
            let middle = from + t * (to - from) + off * DVec3::Z;
            let (left, right) = (DVec3::new(0.0, 4.0, 1.0), DVec3::new(4.0, 0.0, 2.0));
            [vec![from, to, left], vec![from, right, middle], vec![right, to, middle]]
        };
        for (t, off, places, expected) in [
            (0.5, 0.0, 2, false),
            (0.373, 0.0, 2, true),
            (0.373, 0.0, 3, false),
            (0.5, 0.2, 2, false),
            (0.373, 0.2, 2, false),
        ] {
            let outlines = beside(t, off);
            let found = shows_rounding(&outlines.each_ref().map(Vec::as_slice), |x| format!("{x:.places$}"));
            assert_eq!(found, expected, "{t} {off} {places}");
        }
    }
}
