//! The patches of a mesh, face by face, in nested runs with the convex hull of each.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::form_factor::facing::Facing;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::PreparedPolygon;
use crate::mesh::Mesh;
use crate::threads;
use crate::visibility::plane::Lean;

/// A run of consecutive patches of one face.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// The numbers of the patches.
    pub(super) patches: Range<usize>,
    /// The convex hull of all of them, wound like the face.
    pub(super) hull: Vec<DVec3>,
    /// The two halves, as indices of the face's runs; none for a single patch.
    pub(super) halves: Option<[usize; 2]>,
}

/// The patches of one face.
#[derive(Clone, Debug)]
pub(super) struct FacePatches {
    /// The runs: the first is the whole face.
    pub(super) runs: Vec<Run>,
    /// The numbers of the runs that make rows of work: each of at most [`ROW_RUN`] patches, together all.
    pub(super) row_runs: Vec<usize>,
}

/// The most patches of a run that is classified as one against others.
pub(super) const ROW_RUN: usize = 8;

/// All patches as polygons.
pub(super) struct Patches {
    /// The corners of each patch, in m.
    pub(super) corners: Arc<[Vec<DVec3>]>,
    /// The same, prepared for the unoccluded kernel.
    pub(super) prepared: Vec<PreparedPolygon>,
    /// The area of each patch, in m²; stored in a row, as every pair reads two of them.
    pub(super) areas: Vec<f64>,
    /// How far the corners of each patch are off its plane, or may be off where they are meant, in m; 0 where rounding explains that.
    bent: Vec<f64>,
    /// The share of each patch's area along its border, as wide as its corners are off its plane.
    pub(super) borders: Vec<f64>,
    /// Faces with their patches, in order: every patch belongs to one.
    pub(super) faces: Vec<FacePatches>,
    /// The index in `faces` of each patch.
    pub(super) face_of_patch: Vec<usize>,
}

impl Patches {
    /// Gathers the patches, whose corners `facing` has; without `nested` each face is one run, for scenes where nothing is classified.
    pub(super) fn new(mesh: &Mesh, facing: &Facing, nested: bool) -> Self {
        let corners = Arc::clone(facing.corners());
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for same_face in mesh.patches.chunk_by(|a, b| a.face == b.face) {
            let begin = ranges.last().map_or(0, |range| range.end);
            ranges.push(begin..begin + same_face.len());
        }
        let face = |range: &Range<usize>| {
            let mut face = FacePatches {
                runs: Vec::new(),
                row_runs: Vec::new(),
            };
            let frame = Frame::new(mesh.patches[range.start].normal, &corners[range.start]);
            face.grow(range.clone(), &frame, &corners, nested);
            face
        };
        let mut face_of_patch = vec![0; corners.len()];
        for (f, range) in ranges.iter().enumerate() {
            face_of_patch[range.clone()].fill(f);
        }
        let prepared: Vec<PreparedPolygon> = threads::collect_from(&corners, |c| PreparedPolygon::new(c));
        let mut patches = Self {
            areas: prepared.iter().map(PreparedPolygon::area).collect(),
            bent: threads::collect_from(&corners, |c| bent(c)),
            borders: Vec::new(),
            prepared,
            faces: threads::collect_from(&ranges, face),
            face_of_patch,
            corners,
        };
        patches.find_borders();
        patches
    }

    fn find_borders(&mut self) {
        let of_prepared = self.prepared.iter().zip(&self.bent);
        let borders = of_prepared.map(|(prepared, bent)| bent * prepared.perimeter() / prepared.area());
        self.borders = borders.collect();
    }

    /// Takes the corners of patches cut at contact edges to be off by as much as those of the faces that stand there may be, in m.
    pub(super) fn loosen_cut_ones(&mut self, mesh: &Mesh, slack: f64) {
        for (bent, patch) in self.bent.iter_mut().zip(&mesh.patches) {
            if let Some(misfit) = mesh.misfit(patch.face) {
                *bent = bent.max(slack).max(misfit);
            }
        }
        self.find_borders();
    }

    /// Returns the corners of a patch, those of a bent one in its mean plane.
    ///
    /// Integrals put points into that plane, and meet no tolerance where corners are elsewhere.
    pub(super) fn flat_corners(&self, patch: usize) -> Cow<'_, [DVec3]> {
        let corners = &self.corners[patch];
        if self.bent[patch] <= 0.0 {
            return Cow::Borrowed(corners);
        }
        let normal = self.prepared[patch].normal();
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        corners.iter().map(|&v| v - normal.dot(v - middle) * normal).collect()
    }

    /// Returns the least reach of any patch: the greatest distance of a corner from the mean of its corners, in m.
    pub(super) fn least_reach(&self) -> f64 {
        let reaches = threads::collect_from(&self.corners, |corners| Lean::of(corners).reach());
        reaches.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Returns whether two faces are one patch each.
    pub(super) fn are_one_pair(&self, faces: [usize; 2]) -> bool {
        faces.iter().all(|&face| self.faces[face].range().len() == 1)
    }

    /// Returns the number of patches.
    pub(super) fn len(&self) -> usize {
        self.corners.len()
    }
}

impl FacePatches {
    /// Returns the numbers of all patches of the face.
    pub(super) fn range(&self) -> Range<usize> {
        self.runs[0].patches.clone()
    }

    /// Adds the run of a range and those inside it; returns its index.
    fn grow(&mut self, range: Range<usize>, frame: &Frame, corners: &[Vec<DVec3>], nested: bool) -> usize {
        let index = self.runs.len();
        let hull = match &corners[range.clone()] {
            [one] => one.clone(),
            several => frame.hull(several.iter().flatten().copied()),
        };
        self.runs.push(Run {
            patches: range.clone(),
            hull,
            halves: None,
        });
        let is_row_run = range.len() <= ROW_RUN;
        if is_row_run
            && self
                .row_runs
                .last()
                .is_none_or(|&k| self.runs[k].patches.end <= range.start)
        {
            self.row_runs.push(index);
        }
        if range.len() > 1 && (nested || !is_row_run) {
            let middle = Frame::cut(&range, corners);
            let first = self.grow(range.start..middle, frame, corners, nested);
            let second = self.grow(middle..range.end, frame, corners, nested);
            self.runs[index].halves = Some([first, second]);
        }
        index
    }
}

/// Returns how far the corners of a polygon are off its plane, or 0 where that is rounding.
fn bent(corners: &[DVec3]) -> f64 {
    let off = polygon::planarity_error(corners);
    let size = corners.iter().map(|v| v.distance(corners[0])).fold(0.0, f64::max);
    let largest = corners.iter().map(|v| v.abs().max_element()).fold(0.0, f64::max);
    if off > 1e-13 * size + 16.0 * f64::EPSILON * largest {
        off
    } else {
        0.0
    }
}

/// Two axes in a face's plane.
struct Frame {
    origin: DVec3,
    x: DVec3,
    y: DVec3,
}

/// The part of a hull's size below which corners that stand out are left out: far less than the size of a shadow that counts.
const FLAT: f64 = 1e-13;

impl Frame {
    fn new(normal: DVec3, corners: &[DVec3]) -> Self {
        let origin = corners[0];
        let along = corners[1] - origin;
        let x = (along - normal * normal.dot(along)).normalize_or_zero();
        Self {
            origin,
            x,
            y: normal.cross(x),
        }
    }

    fn to_plane(&self, point: DVec3) -> DVec2 {
        let r = point - self.origin;
        DVec2::new(self.x.dot(r), self.y.dot(r))
    }

    /// Returns where to cut a run: at the greatest step from one patch to the next near its middle, which is the end of a row of patches.
    fn cut(range: &Range<usize>, corners: &[Vec<DVec3>]) -> usize {
        let middle = |k: usize| corners[k].iter().sum::<DVec3>() / corners[k].len() as f64;
        let half = range.start.midpoint(range.end);
        let window = (range.len() / 4).max(1);
        let low = half.saturating_sub(window).max(range.start + 1);
        let high = (half + window).min(range.end - 1);
        let mut best = (half.clamp(low, high), 0.0);
        for k in low..=high {
            let step = middle(k).distance(middle(k - 1));
            let is_nearer = k.abs_diff(half) < best.0.abs_diff(half);
            if step > best.1 * (1.0 + 1e-6) || (is_nearer && step > best.1 * (1.0 - 1e-6)) {
                best = (k, step);
            }
        }
        best.0
    }

    /// Returns the convex hull of points in the plane, counter-clockwise, without straight corners (quickhull).
    ///
    /// It begins with the two farthest points, which are corners for certain: an order by coordinates would depend on the rounding of points on one line.
    fn hull(&self, points: impl Iterator<Item = DVec3>) -> Vec<DVec3> {
        let points: Vec<(DVec2, DVec3)> = points.map(|p| (self.to_plane(p), p)).collect();
        let farthest_from = |from: DVec2| {
            let distance = |k: usize| points[k].0.distance_squared(from);
            (0..points.len()).fold(0, |best, k| if distance(k) > distance(best) { k } else { best })
        };
        let a = farthest_from(points[0].0);
        let b = farthest_from(points[a].0);
        let slack = FLAT * points[a].0.distance(points[b].0);
        let all: Vec<usize> = (0..points.len()).collect();
        let mut corners = vec![a];
        stand_out(&points, &all, a, b, slack, &mut corners);
        corners.push(b);
        stand_out(&points, &all, b, a, slack, &mut corners);
        // A point in the middle of an edge may have been taken for its farthest.
        let at = |k: usize| points[corners[k % corners.len()]].0;
        let n = corners.len();
        let turns = (0..n).filter(|&k| {
            let (before, after) = (at(k) - at(k + n - 1), at(k + 1) - at(k));
            before.normalize_or_zero().perp_dot(after) > slack
        });
        turns.map(|k| points[corners[k]].1).collect()
    }
}

/// Adds the corners of the hull of `among` that lie to the right of the line from a to b, in their order.
fn stand_out(points: &[(DVec2, DVec3)], among: &[usize], a: usize, b: usize, slack: f64, corners: &mut Vec<usize>) {
    let (from, along) = (points[a].0, (points[b].0 - points[a].0).normalize_or_zero());
    let height = |k: usize| -along.perp_dot(points[k].0 - from);
    let outside: Vec<usize> = among.iter().copied().filter(|&k| height(k) > slack).collect();
    let Some(c) = outside
        .iter()
        .copied()
        .reduce(|best, k| if height(k) > height(best) { k } else { best })
    else {
        return;
    };
    stand_out(points, &outside, a, c, slack, corners);
    corners.push(c);
    stand_out(points, &outside, c, b, slack, corners);
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::mesh::Subdivision;
    use crate::scene::builtin;

    fn patches(name: &str, n: u32) -> (Patches, Mesh) {
        let scene = builtin::build(name, None).unwrap().scene;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(n)).unwrap();
        (Patches::new(&mesh, &Facing::new(&mesh), true), mesh)
    }

    #[test]
    fn runs_are_nested_down_to_single_patches_and_hulls_hold_them() {
        for (name, n) in [("cornell-box", 5), ("sphere-room-r1", 2), ("cube", 13)] {
            let (patches, mesh) = patches(name, n);
            let mut next_row = 0;
            for face in &patches.faces {
                for run in &face.runs {
                    let normal = mesh.patches[run.patches.start].normal;
                    let area: f64 = mesh.patches[run.patches.clone()].iter().map(|p| p.area).sum();
                    let hull = polygon::area_vector(&run.hull).dot(normal);
                    assert!(hull > area * (1.0 - 1e-12), "{name} {run:?}");
                    for corner in patches.corners[run.patches.clone()].iter().flatten() {
                        for (k, &a) in run.hull.iter().enumerate() {
                            let b = run.hull[(k + 1) % run.hull.len()];
                            let inwards = normal.cross(b - a).normalize();
                            assert!(inwards.dot(*corner - a) > -1e-11);
                        }
                    }
                    match run.halves.map(|halves| halves.map(|k| face.runs[k].patches.clone())) {
                        Some([first, second]) => {
                            assert_eq!((first.start, second.end), (run.patches.start, run.patches.end));
                            assert!(first.end == second.start && !first.is_empty() && !second.is_empty());
                        }
                        None => assert_eq!(run.patches.len(), 1),
                    }
                }
                for &k in &face.row_runs {
                    assert_eq!(face.runs[k].patches.start, next_row);
                    next_row = face.runs[k].patches.end;
                }
            }
            assert_eq!(next_row, mesh.n_patches());
        }
    }

    #[test]
    fn hulls_do_not_depend_on_rounding() {
        let frame = Frame {
            origin: DVec3::ZERO,
            x: DVec3::X,
            y: DVec3::Y,
        };
        // A 3 × 3 grid of points, each moved by some ulps.
        for seed in 0..200_i32 {
            let noise = |k: i32| f64::from((seed * 37 + k * 101) % 7 - 3) * 1e-16;
            let points = (0..9).map(|k| DVec3::new(f64::from(k % 3) + noise(k), f64::from(k / 3) + noise(k + 50), 0.0));
            let hull = frame.hull(points);
            assert!((polygon::area_vector(&hull).z - 4.0).abs() < 1e-14, "{seed} {hull:?}");
            assert_eq!(hull.len(), 4);
        }
    }

    #[test]
    fn a_grid_is_cut_between_its_rows_and_has_four_cornered_hulls() {
        let (patches, _) = patches("cube", 13);
        for face in &patches.faces {
            assert_eq!(face.runs[0].hull.len(), 4);
            let [first, _] = face.runs[0].halves.unwrap();
            assert_eq!(face.runs[first].patches.len() % 13, 0);
            assert!(face.runs.iter().all(|run| run.hull.len() == 4), "{:?}", face.runs);
        }
    }
}
