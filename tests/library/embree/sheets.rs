//! Two-sided sheets: whichever face Embree finds, the one that faces the ray counts.

use glam::DVec3;
use radiosity::scene::Scene;
use radiosity::visibility::brute_force::BruteForce;
use radiosity::visibility::embree::EmbreeVisibility;
use radiosity::visibility::{Coherence, HitBatch, RayBatch, Visibility};

use super::scenes::{Builder, Random};

/// Sheets across the unit cube at z = 0.5: a triangle on a triangle, a quad on a quad, a quad on two triangles, and two
/// small quads on the back of a large one.
fn sheets() -> Scene {
    let mut builder = Builder::default();
    let rectangle = |x: [f64; 2], y: [f64; 2]| {
        [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]].map(|[x, y]| DVec3::new(x, y, 0.5))
    };
    let reversed = |corners: &[DVec3]| corners.iter().rev().copied().collect::<Vec<_>>();

    let first = rectangle([0.0, 0.5], [0.0, 0.5]);
    builder.face(&first[..3]);
    builder.face(&[first[0], first[2], first[3]]);
    builder.face(&reversed(&first[..3]));
    builder.face(&[first[3], first[2], first[0]]);

    let second = rectangle([0.5, 1.0], [0.0, 0.5]);
    builder.face(&second);
    builder.face(&reversed(&second));

    let third = rectangle([0.0, 0.5], [0.5, 1.0]);
    builder.face(&third);
    builder.face(&reversed(&third[..3]));
    builder.face(&[third[3], third[2], third[0]]);

    builder.face(&rectangle([0.5, 1.0], [0.5, 1.0]));
    builder.face(&reversed(&rectangle([0.5, 0.7], [0.5, 1.0])));
    builder.face(&reversed(&rectangle([0.7, 1.0], [0.5, 1.0])));
    builder.finish()
}

#[test]
fn sheets_are_seen_from_their_front_on_either_side() {
    let mut random = Random::new(20);
    for _ in 0..5 {
        let motion = random.motion();
        let scene = motion.scene(sheets());
        let (embree, oracle) = (EmbreeVisibility::new(&scene).unwrap(), BruteForce::new(&scene));
        let mut rays = RayBatch::default();
        for _ in 0..20_000 {
            let (from, to) = (random.point(), random.point());
            // Through z = 0.5, at least 1e-4 from all borders of faces.
            let at = from + (to - from) * (0.5 - from.z) / (to.z - from.z);
            let near = |x: f64, lines: &[f64]| lines.iter().any(|line| (x - line).abs() < 1e-4);
            let crosses = (from.z - 0.5) * (to.z - 0.5) < -1e-3;
            let diagonal = (at.x.rem_euclid(0.5) - at.y.rem_euclid(0.5)).abs() < 1e-4;
            if crosses && !diagonal && !near(at.x, &[0.0, 0.5, 0.7, 1.0]) && !near(at.y, &[0.0, 0.5, 1.0]) {
                let [from, to] = [from, to].map(|p| motion.point(p) - embree.frame_origin());
                rays.push_segment(from, to);
            }
        }
        assert!(rays.len() > 5_000);
        let (mut hits, mut truth) = (HitBatch::default(), HitBatch::default());
        embree.closest_hits(&rays, Coherence::Incoherent, &mut hits);
        oracle.closest_hits(&rays, Coherence::Incoherent, &mut truth);
        let mut seen = vec![0; scene.faces.len()];
        for k in 0..rays.len() {
            let hit = hits.face(k).unwrap();
            assert!(!hit.back);
            assert_eq!(hits.face_and_side[k], truth.face_and_side[k]);
            assert!((hits.u[k] - truth.u[k]).abs() < 1e-4 && (hits.v[k] - truth.v[k]).abs() < 1e-4);
            seen[hit.face.0 as usize] += 1;
        }
        assert!(seen.iter().all(|&n| n > 100), "every face is seen: {seen:?}");
    }
}

#[test]
fn beside_a_small_face_on_its_back_a_large_one_shows_its_back() {
    let mut builder = Builder::default();
    let square =
        |low: f64, high: f64| [[low, low], [high, low], [high, high], [low, high]].map(|[x, y]| DVec3::new(x, y, 0.0));
    builder.face(&square(0.0, 1.0));
    builder.face(&{
        let mut small = square(0.25, 0.5);
        small.reverse();
        small
    });
    let visibility = EmbreeVisibility::new(&builder.finish()).unwrap();
    let mut rays = RayBatch::default();
    for x in [0.3, 0.6] {
        rays.push_ray(DVec3::new(x, 0.4, -1.0) - visibility.frame_origin(), DVec3::Z);
        rays.push_ray(DVec3::new(x, 0.4, 1.0) - visibility.frame_origin(), DVec3::NEG_Z);
    }
    let mut hits = HitBatch::default();
    visibility.closest_hits(&rays, Coherence::Coherent, &mut hits);
    let seen: Vec<_> = (0..4)
        .filter_map(|k| hits.face(k))
        .map(|hit| (hit.face.0, hit.back))
        .collect();
    assert_eq!(seen, [(1, false), (0, false), (0, true), (0, false)]);
}
