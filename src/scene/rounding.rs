//! The possible rounding of the corners of a scene.

use glam::DVec3;

use super::far_parts::greatest;
use super::{Corners, Face, MaterialId, Scene, SurfaceId, Written};
use crate::geometry::polygon::{self, is_along_axis};
use crate::threads;

/// The number of digits from which coordinates count as rounded: 0.25 is a quarter, 0.333333 a rounded third.
const MIN_DIGITS: i32 = 6;

/// The greatest height of a rounded corner over the plane of three others, in units of the rounding of a coordinate: the standard deviation is about 1.
const HEIGHT: f64 = 4.0;

/// The ratio of [`Scene::slack`] to the greatest shift of a corner, which is the rounding of a coordinate in each of three directions.
pub(crate) const SLACK_PER_CORNER: f64 = HEIGHT / 1.732_050_807_568_877_2;

impl Scene {
    /// Returns the height, in m, by which faces that were meant to touch or to lie in one plane may be apart.
    ///
    /// It is two units of the last digit of the file's coordinates, or twice the bend of a quad, if that is more. Apart from bent quads, it is 0 for files
    /// whose numbers need at most five digits or are whole and where faces meet as exactly, for scenes along the axes, and for scenes made in memory. Far parts that [meet no others](Self::meeting_faces) do not count.
    /// Rotated scenes in files with six decimals have 2e-6. Thinner gaps are indistinguishable from contact.
    pub(crate) fn slack(&self) -> f64 {
        let mut quads = self.meeting_faces();
        let of_digits = HEIGHT * self.rounding(&quads);
        quads.retain(|face| face.corners.as_slice().len() > 3);
        let bends = threads::collect_from(&quads, |face| polygon::planarity_error(&self.positions(face)));
        let bent = bends.into_iter().fold(0.0, f64::max);
        of_digits.max(2.0 * bent)
    }

    /// Returns one unit in the last decimal place of the file's coordinates, in m; 0 for whole numbers, and for a scene made in memory.
    pub(crate) fn last_place(&self) -> f64 {
        let written = self.written.filter(|written| written.is_rounded(1));
        written.map_or(0.0, |written| written.unit(self.greatest_where_faces_meet()))
    }

    /// Returns the precision of the coordinates if they were rounded ([`Written::shows_rounding`]): each may then be off by half of its [unit](Written::unit).
    ///
    /// Units within the rounding of f64 do not count.
    pub(crate) fn rounded(&self) -> Option<Written> {
        let written = self.written.filter(Written::shows_rounding)?;
        let is_known = |x: f64| written.unit(x.abs()) <= 4.0 * f64::EPSILON * x.abs();
        let mut coordinates = self.vertices.iter().flat_map(DVec3::to_array);
        (!coordinates.all(|x| x.abs() <= 0.0 || is_known(x))).then_some(written)
    }

    /// Returns the greatest distance of joined vertices, in m, where it exceeds the rounding by the file's digits.
    pub(crate) fn joined_beyond_digits(&self) -> Option<f64> {
        self.written?.joined_beyond_digits(self.greatest_where_faces_meet())
    }

    /// Returns the distance, in m, by which corners of faces that meet may be apart where they were meant to be one: two units of the last digit where the file shows rounding, and at least so many ulps.
    pub(crate) fn apart(&self, ulps: f64) -> f64 {
        let greatest = self.greatest_where_faces_meet();
        // Faces that are turned within an axis-aligned plane are rounded too, although no corner leaves the plane.
        let written = self.written.filter(Written::shows_rounding);
        let of_digits = written.map_or(0.0, |written| 2.0 * written.unit(greatest));
        of_digits.max(ulps * f64::EPSILON * greatest)
    }

    /// Returns the greatest rounding of a coordinate of some faces, in m.
    fn rounding(&self, faces: &[&Face]) -> f64 {
        let is_rounded = |written: &Written| written.is_rounded(MIN_DIGITS) || written.misses;
        let Some(written) = self.written.filter(is_rounded) else {
            return 0.0;
        };
        if faces
            .iter()
            .all(|face| is_along_axis(polygon::area_vector(&self.positions(face))))
        {
            return 0.0;
        }
        0.5 * written.unit(greatest(self.box_of(faces)))
    }
}

/// Returns [`Scene::slack`] of faces that are given by their corners alone, with as many digits as the coordinates need.
pub(crate) fn slack_of<'a>(faces: impl Iterator<Item = &'a [DVec3]>) -> f64 {
    let mut scene = Scene::default();
    let mut written = Written::new();
    for corners in faces {
        let first = u32::try_from(scene.vertices.len()).unwrap_or(u32::MAX);
        let corner = |k: u32| first.saturating_add(k);
        scene.faces.push(Face {
            corners: match corners.len() {
                3 => Corners::Triangle([0, 1, 2].map(corner)),
                4 => Corners::Quad([0, 1, 2, 3].map(corner)),
                // Scenes have no such faces.
                _ => continue,
            },
            surface: SurfaceId(0),
            material: MaterialId(0),
            line: 0,
        });
        scene.vertices.extend(corners);
        for x in corners.iter().flat_map(DVec3::to_array) {
            written.see(&x.to_string());
        }
    }
    scene.written = Some(written);
    scene.slack()
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::slack_of;

    /// Returns the slack of a triangle as read from a file, and from its corners alone.
    fn slacks(vertices: &str) -> [f64; 2] {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("scene.obj");
        std::fs::write(&path, format!("{vertices}f 1 2 3\n")).expect("a file");
        let scene = load(&path).expect("a scene").scene;
        let faces: Vec<_> = scene.face_ids().map(|face| scene.polygon(face)).collect();
        [scene.slack(), slack_of(faces.iter().map(Vec::as_slice))]
    }

    #[test]
    fn digits_tell_how_far_corners_may_be_off() {
        for (vertices, expected) in [
            ("v 0 0 0\nv 0.25 1 0.5\nv 2 0.125 1\n", 0.0),
            ("v 0 0 0\nv 1.333333 1 0.5\nv 2 0.125 1\n", 2e-6),
            // Zeros need no digits, before and after the point.
            ("v 0.000000 0.000000 0.000000\nv 3.100000 1.2 0.5\nv 2 0.125 1\n", 0.0),
            ("v 0 0 0\nv 100000 1.2 0.5\nv 200000.0 0.125 1\n", 0.0),
            // Metres of a map, with heights of a ground.
            (
                "v 500000 5400000 100\nv 500012 5400001 103\nv 500001 5400017 101\n",
                0.0,
            ),
            // Along the axes.
            ("v 0 0 0\nv 0.333333 0 0\nv 0 0.777777 0\n", 0.0),
            // Six digits in all.
            ("v 0 0 0\nv 4.08446 1 0.005289\nv 2 0.12512 1\n", 2e-5),
            // Coordinates of a map, with trailing zeros omitted.
            (
                "v 500000.5 5400000 100\nv 500012.125 5400001 103\nv 500001 5400017.375 101\n",
                2e-3,
            ),
            // f64, and f32 with nine digits.
            ("v 0 0 0\nv 0.3333333333333333 1 0.5\nv 2 0.125 1\n", 2e-15),
            ("v 0 0 0\nv 0.333333343 0.5 0.25\nv 1.5 0.125 1\n", 2.0_f64.powi(-22)),
        ] {
            let is_found = |found: f64| (found - expected).abs() <= 1e-3 * expected;
            for found in slacks(vertices) {
                assert!(is_found(found), "{vertices}: {found:e}");
            }
        }
    }
}
