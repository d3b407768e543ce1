//! Chooses a view of a scene without a camera.

use glam::DVec3;

use super::{Camera, FaceId, Scene};
use crate::threads;

/// The vertical angle of view, in degrees.
const VERTICAL_FOV: f64 = 60.0;

/// The distances of the eye from the middle of the box, in units of its extent along the view: just inside, then further in.
const INSIDE: [f64; 3] = [0.48, 0.35, 0.2];

/// The distance of the eye outside, in units of the box's greatest extent: a flat scene may have none along the view.
const OUTSIDE: f64 = 1.5;

/// The rays per side of the grid that counts fronts.
const GRID: u32 = 10;

/// Chooses the view; see [`Camera::default_view`].
#[track_caller]
pub(super) fn choose(scene: &Scene) -> Camera {
    assert!(!scene.faces.is_empty(), "a view needs something to look at");
    let (low, high) = scene.bounding_box();
    let centre = 0.5 * (low + high);
    let extent = high - low;
    let up = up_axis(scene);
    let (a, b) = ((up + 1) % 3, (up + 2) % 3);
    let targets: Vec<Target> = scene.face_ids().map(|face| Target::new(scene, face)).collect();
    let mut best: Option<(usize, Camera)> = None;
    let inside = INSIDE.map(|depth| depth * extent);
    for distance in inside.into_iter().chain([DVec3::splat(OUTSIDE * extent.max_element())]) {
        // The longer axis and its far end come first: of equal views, the deeper one is chosen.
        let long_first = if extent[a] >= extent[b] { [a, b] } else { [b, a] };
        for axis in long_first {
            for sign in [1.0, -1.0] {
                let direction = DVec3::AXES[axis] * sign;
                let eye = centre - direction * distance[axis];
                let Ok(camera) = Camera::new(eye, direction, DVec3::AXES[up], VERTICAL_FOV) else {
                    continue;
                };
                let score = n_fronts(&targets, &camera);
                // No other place can show more than all.
                if score == (GRID * GRID) as usize {
                    return camera;
                }
                if best.as_ref().is_none_or(|(most, _)| score > *most) {
                    best = Some((score, camera));
                }
            }
        }
    }
    let Some((_, camera)) = best else {
        unreachable!("up is across every horizontal axis, and the coordinates of a scene are finite");
    };
    camera
}

/// Returns 1 if the emitted power leaves mostly along −y, and 2 otherwise.
fn up_axis(scene: &Scene) -> usize {
    let power: DVec3 = scene
        .face_ids()
        .map(|id| {
            let face = scene.faces[id.0 as usize];
            let exitance: f64 = scene.materials[face.material.0 as usize].exitance.iter().sum();
            exitance * scene.area_vector(id)
        })
        .sum();
    if -power.y > power.z.abs() { 1 } else { 2 }
}

/// A convex face, ready for many rays.
struct Target {
    corners: [DVec3; 4],
    n_corners: usize,
    area_vector: DVec3,
}

impl Target {
    fn new(scene: &Scene, face: FaceId) -> Self {
        let polygon = scene.polygon(face);
        let mut corners = [polygon[0]; 4];
        corners[..polygon.len()].copy_from_slice(&polygon);
        Self {
            corners,
            n_corners: polygon.len(),
            area_vector: scene.area_vector(face),
        }
    }

    /// Returns the distance along a ray, in units of the direction, if it is less than or equal to `limit`.
    fn distance(&self, origin: DVec3, direction: DVec3, limit: f64) -> Option<f64> {
        let t = (self.corners[0] - origin).dot(self.area_vector) / direction.dot(self.area_vector);
        // A parallel ray has an infinite t or none, and meets nothing.
        if !(t > 0.0 && t <= limit && t.is_finite()) {
            return None;
        }
        let point = origin + t * direction;
        let inside = (0..self.n_corners).all(|k| {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % self.n_corners]);
            (to - from).cross(point - from).dot(self.area_vector) >= 0.0
        });
        inside.then_some(t)
    }
}

fn n_fronts(targets: &[Target], camera: &Camera) -> usize {
    let in_row = |y: usize| {
        let is_front = |x: &u32| {
            let (origin, direction) = camera.primary_ray(f64::from(*x) + 0.5, y as f64 + 0.5, GRID, GRID);
            meets_front(targets, origin, direction)
        };
        (0..GRID).filter(is_front).count()
    };
    threads::collect(GRID as usize, in_row).into_iter().sum()
}

/// Returns whether the first face along a ray is met from the front; of the two sides of a sheet, the front counts.
fn meets_front(targets: &[Target], origin: DVec3, direction: DVec3) -> bool {
    let mut first = f64::INFINITY;
    let mut front = false;
    for target in targets {
        let faces_ray = target.area_vector.dot(direction) < 0.0;
        if let Some(t) = target.distance(origin, direction, first)
            && (t < first || faces_ray)
        {
            first = t;
            front = faces_ray;
        }
    }
    front
}
