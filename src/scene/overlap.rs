//! Finds faces of one winding that overlap in one plane, whose common area would count twice.

use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use glam::DVec3;

use super::split::PLANARITY;
use super::{Face, FaceId, Scene, Written};
use crate::geometry::box_pairs::{collected_pairs, overlapping_pairs};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon::{self, is_along_axis};
use crate::threads;

/// The width of a strip that two faces may share by the rounding of six digits, in units of the greatest |coordinate|.
///
/// Files with six digits place a corner up to 5e-6 of it off along each axis, and edges that should meet up to √8 times that over one another.
const SIX_DIGITS: f64 = 2e-5;

/// The width of the same strip in units of the last written digit.
const UNITS: f64 = 2.0;

/// The least width, in such strips, of a common part that covers most of a face: narrower ones may be due to rounding alone.
const COVERED: f64 = 0.05;

/// The uncertainty of a distance between planes in f64, in units of the greatest |coordinate|.
const ULPS: f64 = 8.0 * f64::EPSILON;

/// The gap between two parallel faces, in diameters of the smaller one, from which on it was meant: computed coordinates that should be equal are closer.
const COMPUTED: f64 = 1e-10;

/// The greatest angle between the normals of two faces in one plane, in rad; the normal of a narrow face is no more accurate.
const PARALLEL: f64 = 0.14;

/// The greatest such angle of faces that are small enough for rounding to turn them.
///
/// Faces that meet at 45 degrees or more are never in one plane.
const PARALLEL_IF_ROUNDED: f64 = 0.6;

/// The share of a face as narrow as the rounding that must lie on another face: neighbours with rounded corners overlap in part.
const COVERED_IF_ROUNDED: f64 = 0.9;

/// The greatest number of overlaps in a list, which takes 400 MB; it exceeds that of any model with faces drawn on others.
pub(super) const MAX_OVERLAPS: usize = 1 << 24;

/// Two faces that overlap in one plane with the same winding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Overlap {
    /// The faces, the one of the greater line first.
    pub(super) faces: [FaceId; 2],
    /// The common area, in m².
    pub(super) area: f64,
}

/// Returns two faces that overlap in one plane with the same winding, the one of the greater line first; of all such pairs, the first by their lines.
///
/// Two faces lie in one plane where no corner of the smaller is further from the larger's plane than [`PLANARITY`] of its diameter and the rounding of the coordinates
/// ([`Scene::slack`]); faces that are exactly parallel are in one plane only up to 1e-10 of the smaller one's diameter, or two units of the last digit where the file shows rounding. They overlap where the common part is wider (twice its area over its outline's length) than the rounding. The rounding follows the digits of the file
/// ([`Written`](super::Written)), but is at least six digits of the faces' size and at most six digits of the coordinates. Faces that one outline was split into do not overlap.
///
/// Where the file shows that it was rounded, faces that are not along the axes are off their plane by half a [unit](super::Written::unit) u of each coordinate. They then lie in one plane where, over
/// all of the common part, their distance is at most g = Σ u |n|, summed over the axes, with n the larger's normal: g ≤ √3 u. Faces wider than 3 u that were meant to be in one plane are always found,
/// those meant to be 2 g apart never. The common part must then be wider than 2 u, or be 9/10 of a face that is as narrow.
///
/// Work: O(n log n) for n faces of similar size, and the pairs whose boxes meet.
pub(super) fn find(scene: &Scene) -> Option<[FaceId; 2]> {
    let mut first: Option<[(u32, u32); 2]> = None;
    let (search, boxes) = Search::new(scene);
    overlapping_pairs(boxes, |a, b| {
        if let Some(pair) = search.pair(a, b)
            && first.is_none_or(|first| pair < first)
            && search.common_area(a, b).is_some()
        {
            first = Some(pair);
        }
    });
    first.map(|pair| pair.map(|(_, face)| FaceId(face)))
}

/// Returns the pairs that [`find`] chooses from, ordered by their lines: all of them, or [`MAX_OVERLAPS`] if there are more.
pub(super) fn all(scene: &Scene) -> Vec<Overlap> {
    let n_found = AtomicUsize::new(0);
    let (search, boxes) = Search::new(scene);
    let mut found = collected_pairs(boxes, |a, b, found: &mut Vec<([(u32, u32); 2], f64)>| {
        if n_found.load(Relaxed) <= MAX_OVERLAPS
            && let Some(pair) = search.pair(a, b)
            && let Some(area) = search.common_area(a, b)
        {
            n_found.fetch_add(1, Relaxed);
            found.push((pair, area));
        }
    });
    if found.len() > MAX_OVERLAPS {
        // A sequential search makes the list independent of the threads.
        found.clear();
        overlapping_pairs(Search::new(scene).1, |a, b| {
            if found.len() < MAX_OVERLAPS
                && let Some(pair) = search.pair(a, b)
                && let Some(area) = search.common_area(a, b)
            {
                found.push((pair, area));
            }
        });
    }
    found.sort_unstable_by_key(|(pair, _)| *pair);
    let overlaps = found.into_iter().map(|(pair, area)| Overlap {
        faces: pair.map(|(_, face)| FaceId(face)),
        area,
    });
    overlaps.collect()
}

/// A search for faces with nearly the same normal whose boxes meet.
struct Search<'a> {
    scene: &'a Scene,
    slack: f64,
    /// Whether the file shows that its coordinates were rounded.
    shows_rounding: bool,
    measured: Vec<Measures>,
}

impl<'a> Search<'a> {
    /// Returns the search with the boxes of all faces.
    fn new(scene: &'a Scene) -> (Self, Vec<(DVec3, DVec3)>) {
        let slack = scene.slack();
        let measured: Vec<Measures> = threads::collect_from(&scene.faces, |face| Measures::of(scene, face));
        let boxes = threads::collect(measured.len(), |face| {
            let measures = &measured[face];
            let (low, high) = scene.positions(&scene.faces[face]).bounding_box();
            let of_digits = (0.5 * slack).max(measures.half_unit.length());
            let margin = PLANARITY * measures.diameter + ULPS * measures.greatest + of_digits;
            (low - margin, high + margin)
        });
        let search = Self {
            scene,
            slack,
            shows_rounding: scene.written.is_some_and(|written| written.shows_rounding()),
            measured,
        };
        (search, boxes)
    }

    /// Returns the lines and numbers of two faces, the greater first, if their normals are nearly the same.
    fn pair(&self, a: u32, b: u32) -> Option<[(u32, u32); 2]> {
        let [of_a, of_b] = [a, b].map(|face| &self.measured[face as usize]);
        let places = [a, b].map(|face| (self.scene.faces[face as usize].line, face));
        let pair = [places[0].max(places[1]), places[0].min(places[1])];
        // Faces of built-in scenes have no lines.
        let is_one_outline = pair[0].0 == pair[1].0 && pair[0].0 != 0;
        (!is_one_outline && of_a.is_parallel_to(of_b)).then_some(pair)
    }

    fn common_area(&self, a: u32, b: u32) -> Option<f64> {
        let [of_a, of_b] = [a, b].map(|face| &self.measured[face as usize]);
        let outlines = [a, b].map(|face| self.scene.positions(&self.scene.faces[face as usize]));
        let mut larger_first = [(&*outlines[0], of_a), (&*outlines[1], of_b)];
        if of_a.area < of_b.area {
            larger_first.reverse();
        }
        let off = of_a.off.max(of_b.off);
        let least_gap = if self.shows_rounding { off } else { self.slack.min(off) };
        common_area(larger_first, self.slack, least_gap)
    }
}

/// Properties of a face, computed once.
struct Measures {
    normal: DVec3,
    area: f64,
    /// The diagonal of its box.
    diameter: f64,
    /// The distance of its corners from its plane.
    bend: f64,
    /// The greatest |coordinate|.
    greatest: f64,
    /// The distance between two corners, meant as one, that are written with its precision.
    off: f64,
    /// The width of the strip that it may share with another face whose coordinates are no greater.
    strip: f64,
    /// The greatest rounding of its corners along each axis, where the file shows rounding and the face is not along the axes; else 0.
    half_unit: DVec3,
}

impl Measures {
    /// Returns the properties of a face.
    fn of(scene: &Scene, face: &Face) -> Self {
        let corners = scene.positions(face);
        let (low, high) = corners.bounding_box();
        let vector = polygon::area_vector(&corners);
        let reach = low.abs().max(high.abs());
        let greatest = reach.max_element();
        let off = UNITS * scene.written.map_or(0.0, |written| written.unit(greatest));
        let most = SIX_DIGITS * greatest;
        let diameter = low.distance(high);
        let least = (SIX_DIGITS * diameter).max(ULPS * greatest).min(most);
        let rounded = scene.written.filter(Written::shows_rounding);
        // Faces along the axes stay so after rounding, and keep their contacts.
        let rounded = rounded.filter(|_| !is_along_axes(&corners));
        Self {
            normal: vector.normalize_or_zero(),
            area: vector.length(),
            diameter,
            bend: polygon::planarity_error(&corners),
            greatest,
            off,
            strip: off.clamp(least, if rounded.is_some() { most.max(off) } else { most }),
            half_unit: rounded.map_or(DVec3::ZERO, |written| reach.map(|x| 0.5 * written.unit(x))),
        }
    }

    /// Returns whether the normals of two faces are equal within their accuracy.
    fn is_parallel_to(&self, other: &Self) -> bool {
        let angle = PARALLEL + self.lean() + other.lean();
        self.normal.distance(other.normal) <= angle.min(PARALLEL_IF_ROUNDED)
    }

    /// Returns the angle, in rad, by which rounding may turn the normal.
    fn lean(&self) -> f64 {
        2.0 * self.half_unit.length() * self.diameter / self.area.max(f64::MIN_POSITIVE)
    }
}

/// Returns whether all edges of an outline are along axes, but for the diagonal in half of a rectangle.
fn is_along_axes(corners: &[DVec3]) -> bool {
    let next = corners.iter().cycle().skip(1);
    let n_along = corners
        .iter()
        .zip(next)
        .filter(|&(&a, &b)| is_along_axis(b - a))
        .count();
    n_along + usize::from(corners.len() == 3) >= corners.len()
}

/// Returns the common area of two faces with nearly the same normal, the larger first, where they lie in one plane and share more than rounding explains.
///
/// A gap of up to `least_gap` between parallel faces may be due to rounding.
fn common_area(
    [(large, measures), (small, of_small)]: [(&[DVec3], &Measures); 2],
    slack: f64,
    least_gap: f64,
) -> Option<f64> {
    let normal = measures.normal;
    let strip = measures.strip.max(of_small.strip);
    let off = measures.off.max(of_small.off);
    let half_units = measures.half_unit + of_small.half_unit;
    let is_rounded = half_units.max_element() > 0.0;
    let least = (COVERED * strip).max(if is_rounded { 0.5 * off } else { 0.0 });
    // The common part is no wider than across an edge of either face.
    let apart = |by: &[DVec3], other: &[DVec3]| {
        let mut last = by[by.len() - 1];
        by.iter().any(|&corner| {
            let edge = corner - std::mem::replace(&mut last, corner);
            let inward = normal.cross(edge);
            let most = least * edge.length();
            other.iter().all(|&v| inward.dot(v - corner) <= most)
        })
    };
    if apart(large, small) || apart(small, large) {
        return None;
    }
    let is_level = |corners: &[DVec3], gap: f64| corners.iter().all(|&v| normal.dot(v - large[0]).abs() <= gap);
    let ulps = ULPS * measures.greatest.max(of_small.greatest);
    // The digits of a file count in full where they show rounding, which is where the slack is positive.
    let rounding = (measures.bend + off)
        .min(PLANARITY * measures.diameter)
        .max(slack.min(off));
    let in_plane = is_level(small, PLANARITY * of_small.diameter + rounding + ulps);
    let is_gap = || {
        let heights = small.iter().map(|&v| normal.dot(v - large[0]));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low <= ulps && low.max(-high) > COMPUTED * of_small.diameter + least_gap + ulps
    };
    if !is_rounded && (!in_plane || is_gap()) {
        return None;
    }
    let mut shared = small.to_vec();
    for k in 0..large.len() {
        let inward = normal.cross(large[(k + 1) % large.len()] - large[k]);
        shared = clip_to_half_space(&shared, large[k], inward);
    }
    // Faces of one plane across an axis have the same coordinate along it, rounded or not.
    let is_across_axis = is_along_axis(normal) && is_along_axis(of_small.normal);
    let off_plane = if is_across_axis {
        0.0
    } else {
        normal.abs().dot(half_units)
    };
    let bends = 2.0 * (measures.bend + of_small.bend);
    if !in_plane && !is_level(&shared, off_plane + bends + ulps) {
        return None;
    }
    let area = polygon::area_vector(&shared).length();
    let width = 2.0 * area / polygon::perimeter(&shared).max(f64::MIN_POSITIVE);
    let covered = if is_rounded && strip <= off {
        COVERED_IF_ROUNDED
    } else {
        0.5
    };
    (width > strip || (width > least && area > covered * of_small.area)).then_some(area)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::scene::{Corners, MaterialId, SurfaceId, Written};

    /// Faces in one plane through no axis, shifted, with lines 1, 2, ...; `z` is the height above the plane.
    fn scene(faces: &[&[[f64; 3]]]) -> Scene {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 0.7);
        let mut scene = Scene::default();
        for (line, corners) in (1..).zip(faces) {
            let first = u32::try_from(scene.vertices.len()).expect("a few");
            let place = |p: &[f64; 3]| turn * DVec3::from_array(*p) + DVec3::new(0.5, -0.25, 0.125);
            scene.vertices.extend(corners.iter().map(place));
            scene.faces.push(Face {
                corners: match corners.len() {
                    3 => Corners::Triangle([0, 1, 2].map(|k| first + k)),
                    _ => Corners::Quad([0, 1, 2, 3].map(|k| first + k)),
                },
                surface: SurfaceId(0),
                material: MaterialId(0),
                line,
            });
        }
        scene
    }

    fn rectangle(x: [f64; 2], y: [f64; 2], z: f64) -> [[f64; 3]; 4] {
        [[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]]
    }

    fn lines(scene: &Scene) -> Option<[u32; 2]> {
        find(scene).map(|faces| faces.map(|face| scene.faces[face.0 as usize].line))
    }

    #[test]
    fn parallel_faces_bound_a_gap_that_was_meant() {
        let wall = rectangle([-1.0, 2.0], [-1.0, 2.0], 0.0);
        for gap in [1e-3, 1e-4, 1e-5, 1e-7, 1e-8, 1e-9] {
            for height in [gap, -gap] {
                let sheet = rectangle([0.2, 0.8], [0.1, 0.6], height);
                assert_eq!(lines(&scene(&[&wall, &sheet])), None, "{height}");
            }
            // A sheet that leans was meant to lie on the wall, up to a millionth.
            let mut leaning = rectangle([0.2, 0.8], [0.1, 0.6], 0.0);
            leaning[2][2] = gap;
            leaning[3][2] = gap;
            assert_eq!(lines(&scene(&[&wall, &leaning])).is_some(), gap < 1e-6, "{gap}");
        }
        let computed = rectangle([0.2, 0.8], [0.1, 0.6], 1e-11);
        assert_eq!(lines(&scene(&[&wall, &computed])), Some([2, 1]));
    }

    /// Returns a scene of upright faces, shifted far and written with some places after the point.
    fn written(faces: &[&[[f64; 3]]], shift: DVec3, places: usize) -> Scene {
        let mut scene = scene(faces);
        let mut written = Written::new();
        let turn = DQuat::from_rotation_z(0.3);
        for (v, corner) in scene.vertices.iter_mut().zip(faces.iter().copied().flatten()) {
            let text = (turn * DVec3::from_array(*corner) + shift)
                .to_array()
                .map(|x| format!("{x:.places$}"));
            for token in &text {
                written.see(token);
            }
            *v = DVec3::from_array(text.map(|token| token.parse().expect("a number")));
        }
        scene.written = Some(written);
        scene
    }

    const SQUARE: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn faces_of_one_winding_that_share_area_are_found_however_they_are_cut() {
        let half = [SQUARE[0], SQUARE[1], SQUARE[2]];
        let other_half = [SQUARE[0], SQUARE[1], SQUARE[3]];
        let decal = rectangle([0.3, 0.4], [0.5, 0.55], 0.0);
        let beside = rectangle([0.5, 1.5], [0.0, 1.0], 0.0);
        let strip = rectangle([0.9999, 2.0], [0.0, 1.0], 0.0);
        let cross = rectangle([-1.0, 2.0], [0.4, 0.6], 0.0);
        for (name, faces) in [
            ("a half", [&SQUARE as &[_], &half]),
            ("two halves across", [&half, &other_half]),
            ("a decal", [&SQUARE, &decal]),
            ("a wall on its decal", [&decal, &SQUARE]),
            ("by half", [&SQUARE, &beside]),
            ("by a strip", [&SQUARE, &strip]),
            ("a cross", [&SQUARE, &cross]),
            ("the same", [&SQUARE, &SQUARE]),
        ] {
            assert_eq!(lines(&scene(&faces)), Some([2, 1]), "{name}");
        }
    }

    #[test]
    fn faces_that_touch_lie_above_or_look_the_other_way_may_stay() {
        let mut reversed = rectangle([0.2, 0.8], [0.2, 0.8], 0.0);
        reversed.reverse();
        let beside = rectangle([1.0, 2.0], [0.0, 1.0], 0.0);
        let t_junction = rectangle([1.0, 2.0], [0.5, 3.0], 0.0);
        let corner = rectangle([1.0, 2.0], [1.0, 2.0], 0.0);
        let above = rectangle([0.2, 0.8], [0.2, 0.8], 1e-4);
        // An edge in common, rounded to six decimals.
        let rounded = rectangle([1.0 - 2e-6, 2.0], [0.5, 3.0], 0.0);
        let folded = [SQUARE[0], SQUARE[1], [0.5, 0.5, 0.1]];
        for (name, face) in [
            ("a sheet", &reversed as &[_]),
            ("an edge", &beside),
            ("a part of an edge", &t_junction),
            ("a corner", &corner),
            ("above", &above),
            ("rounding", &rounded),
            ("a fold", &folded),
        ] {
            assert_eq!(lines(&scene(&[&SQUARE, face])), None, "{name}");
            assert_eq!(lines(&scene(&[face, &SQUARE])), None, "{name}");
        }
    }

    #[test]
    fn the_first_pair_by_its_lines_is_told() {
        let far = |k: f64| rectangle([k, k + 1.0], [0.0, 1.0], 0.0);
        let faces = [far(0.0), far(2.0), far(4.0), far(4.0), far(0.0), far(2.5)];
        let faces: Vec<&[_]> = faces.iter().map(|face| face as &[_]).collect();
        assert_eq!(lines(&scene(&faces)), Some([4, 3]));
    }

    #[test]
    fn what_is_found_does_not_depend_on_where_the_scene_stands() {
        let decal = rectangle([0.3, 0.4], [0.5, 0.55], 0.0);
        let strip = rectangle([0.98, 2.0], [0.0, 1.0], 0.0);
        // Edges in common that rounding shifts over one another.
        let t_junction = rectangle([1.0, 2.0], [0.5, 3.0], 0.0);
        let above = rectangle([0.2, 0.8], [0.2, 0.8], 0.02);
        let far = [DVec3::new(5e5, 5.4e6, 100.0), DVec3::new(-3e6, 40.0, 0.0)];
        for (shift, least_places) in [(DVec3::ZERO, 6), (far[0], 3), (far[1], 3)] {
            for places in [least_places, 6] {
                let found = |face: &[[f64; 3]]| lines(&written(&[&SQUARE, face], shift, places));
                assert_eq!(found(&decal), Some([2, 1]), "{shift} {places}");
                assert_eq!(found(&strip), Some([2, 1]), "{shift} {places}");
                assert_eq!(found(&t_junction), None, "{shift} {places}");
                assert_eq!(found(&above), None, "{shift} {places}");
            }
        }
    }

    #[test]
    fn a_road_just_above_a_wide_ground_is_not_in_its_plane() {
        let ground = rectangle([0.0, 3000.0], [0.0, 3000.0], 0.0);
        for (height, expected) in [(0.004, None), (0.0, Some([2, 1]))] {
            let road = rectangle([1000.0, 1010.0], [1000.0, 2000.0], height);
            for shift in [DVec3::ZERO, DVec3::new(5e5, 5.4e6, 0.0)] {
                assert_eq!(
                    lines(&written(&[&ground, &road], shift, 3)),
                    expected,
                    "{height} {shift}"
                );
            }
        }
        // A small sign on a long wall along no axis, with six places.
        let sign = rectangle([10.0, 10.2], [1.0, 1.1], 0.0);
        let wall = rectangle([0.0, 50.0], [0.0, 3.0], 0.0);
        let mut slanted = scene(&[&wall, &sign]);
        let mut digits = Written::new();
        for v in &mut slanted.vertices {
            let text = v.to_array().map(|x| format!("{x:.6}"));
            for token in &text {
                digits.see(token);
            }
            *v = DVec3::from_array(text.map(|token| token.parse().expect("a number")));
        }
        slanted.written = Some(digits);
        assert_eq!(lines(&slanted), Some([2, 1]));
    }
}
