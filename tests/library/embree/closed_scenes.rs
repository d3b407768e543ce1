//! The laws of closed scenes: no ray escapes, and no face shadows itself.

use glam::DVec3;
use radiosity::scene::Scene;
use radiosity::visibility::embree::EmbreeVisibility;
use radiosity::visibility::{Coherence, HitBatch, RayBatch, Visibility};

use super::scenes::{Motion, Random, room, room_and_sphere};

/// Three motions: none, a rotation, and a rotation with a translation of several times the scene's size.
fn motions(random: &mut Random) -> [Motion; 3] {
    let moved = random.motion();
    let turned = Motion {
        translation: DVec3::ZERO,
        ..random.motion()
    };
    [Motion::NONE, turned, moved]
}

/// Counts rays that hit nothing, and rays that hit a back.
fn escaped_and_back(visibility: &EmbreeVisibility, rays: &RayBatch, coherence: Coherence) -> (usize, usize) {
    let mut hits = HitBatch::default();
    visibility.closest_hits(rays, coherence, &mut hits);
    let found = (0..rays.len()).map(|k| hits.face(k));
    found.fold((0, 0), |(escaped, back), hit| match hit {
        None => (escaped + 1, back),
        Some(hit) => (escaped, back + usize::from(hit.back)),
    })
}

#[test]
fn no_random_ray_escapes_from_a_closed_room_or_sees_a_back() {
    let mut random = Random::new(2);
    let scenes: [(fn() -> Scene, f64); 2] = [(|| room(7), 1.0), (room_and_sphere, 0.15)];
    for (scene, height) in scenes {
        for motion in motions(&mut random) {
            let visibility = EmbreeVisibility::new(&motion.scene(scene())).unwrap();
            let mut rays = RayBatch::default();
            for _ in 0..200_000 {
                let mut from = random.point();
                from.z *= height; // below the sphere
                let from = motion.point(from) - visibility.frame_origin();
                rays.push_ray(from, random.direction());
            }
            assert_eq!(escaped_and_back(&visibility, &rays, Coherence::Incoherent), (0, 0));
        }
    }
}

#[test]
fn no_ray_that_aims_at_a_point_of_an_edge_escapes() {
    const N: u32 = 7;
    let mut random = Random::new(3);
    for motion in motions(&mut random) {
        let visibility = EmbreeVisibility::new(&motion.scene(room(N))).unwrap();
        let mut rays = RayBatch::default();
        for i in 0..300_000 {
            // A point on a grid line of a wall, away from the vertices.
            let wall = f64::from(i % 2);
            let line = f64::from(i % (N + 1)) / f64::from(N);
            let cell = f64::from(i / 2 % N);
            let at = [wall, line, (cell + random.between(0.01, 0.99)) / f64::from(N)];
            let turn = (i / 5 % 3) as usize;
            let to = DVec3::new(at[turn], at[(turn + 1) % 3], at[(turn + 2) % 3]);
            let from = random.point();
            let [from, to] = [from, to].map(|p| motion.point(p) - visibility.frame_origin());
            rays.push_ray(from, to - from);
        }
        let (escaped, _) = escaped_and_back(&visibility, &rays, Coherence::Incoherent);
        assert_eq!(escaped, 0);
    }
}

/// Counts blocked segments between random points of different walls of the unit room, whose ends are lifted by `offset`.
fn blocked_between_walls(visibility: &EmbreeVisibility, motion: &Motion, offset: f64, random: &mut Random) -> usize {
    let mut rays = RayBatch::default();
    for _ in 0..300_000_u32 {
        let walls = (random.unit() * 6.0, random.unit() * 5.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small and not negative"
        )]
        let (a, b) = (walls.0 as usize, walls.1 as usize);
        let b = if b >= a { b + 1 } else { b };
        let [from, to] = [a, b].map(|wall| {
            let axis = wall / 2;
            let inward = if wall % 2 == 0 { 1.0 } else { -1.0 };
            // Strictly within a cell of the wall, whatever its size: also near the room's edges.
            let mut point = random.point() * 0.999_98 + 1e-5;
            point[axis] = (wall % 2) as f64;
            motion.point(point) + motion.rotation * DVec3::AXES[axis] * inward * offset - visibility.frame_origin()
        });
        rays.push_segment(from, to);
    }
    let mut blocked = Vec::new();
    visibility.occluded(&rays, Coherence::Coherent, &mut blocked);
    blocked.into_iter().filter(|&blocked| blocked).count()
}

#[test]
fn nothing_blocks_the_view_between_points_of_a_convex_room() {
    let mut random = Random::new(4);
    for motion in motions(&mut random) {
        let visibility = EmbreeVisibility::new(&motion.scene(room(7))).unwrap();
        let offset = visibility.offset();
        assert_eq!(blocked_between_walls(&visibility, &motion, offset, &mut random), 0);
    }
}

#[test]
fn without_the_offset_patches_shadow_themselves() {
    let mut random = Random::new(5);
    for motion in motions(&mut random) {
        let visibility = EmbreeVisibility::new(&motion.scene(room(7))).unwrap();
        assert!(blocked_between_walls(&visibility, &motion, 0.0, &mut random) > 30_000);
    }
}

#[test]
fn segments_that_graze_an_edge_are_blocked_on_its_inner_side_only() {
    let mut random = Random::new(6);
    for motion in motions(&mut random) {
        let visibility = EmbreeVisibility::new(&motion.scene(room_and_sphere())).unwrap();
        // Outside the room, across its edge x = y = 0: the room is the occluder.
        let mut rays = RayBatch::default();
        let mut inside = Vec::new();
        for i in 0..100_000 {
            let distance = random.between(2.0, 100.0) * visibility.offset();
            let inner = i % 2 == 0;
            let shift = if inner { distance } else { -distance };
            let middle = DVec3::new(shift, shift, random.between(0.1, 0.9));
            let along = DVec3::new(1.0, -1.0, random.between(-0.5, 0.5)) * random.between(0.01, 0.3);
            let [from, to] = [middle - along, middle + along].map(|p| motion.point(p) - visibility.frame_origin());
            rays.push_segment(from, to);
            inside.push(inner);
        }
        let mut blocked = Vec::new();
        visibility.occluded(&rays, Coherence::Incoherent, &mut blocked);
        assert!(blocked == inside);
    }
}
