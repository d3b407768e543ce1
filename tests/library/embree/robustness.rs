//! Odd input, sizes, threads.

use glam::DVec3;
use radiosity::embree::{Device, EmbreeError, SceneBuilder};
use radiosity::scene::Scene;
use radiosity::visibility::embree::EmbreeVisibility;
use radiosity::visibility::{Coherence, HitBatch, RayBatch, Visibility};
use rayon::prelude::*;

use super::scenes::{Builder, Motion, Random, room, soup};

fn random_rays(n: usize, random: &mut Random) -> RayBatch {
    let mut rays = RayBatch::default();
    for _ in 0..n {
        rays.push_segment(random.direction(), random.direction() * random.unit());
    }
    rays
}

#[test]
fn a_segment_is_blocked_if_and_only_if_it_hits_something() {
    let mut random = Random::new(10);
    let visibility = EmbreeVisibility::new(&soup(300, true, &mut random)).unwrap();
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let rays = random_rays(100_000, &mut random);
        let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
        visibility.closest_hits(&rays, coherence, &mut hits);
        visibility.occluded(&rays, coherence, &mut blocked);
        let hit: Vec<bool> = (0..rays.len()).map(|k| hits.face(k).is_some()).collect();
        let n_hit = hit.iter().filter(|&&hit| hit).count();
        assert!(n_hit > 20_000 && n_hit < 80_000, "{n_hit} of the segments are hit");
        assert!(hit == blocked);
    }
}

#[test]
fn batches_of_every_length_give_what_each_ray_gives_alone() {
    let mut random = Random::new(11);
    let visibility = EmbreeVisibility::new(&soup(300, true, &mut random)).unwrap();
    let all = random_rays(67, &mut random);
    let part = |from: usize, n: usize| {
        let cut = |x: &Vec<f32>| x[from..from + n].to_vec();
        RayBatch {
            origin: all.origin.each_ref().map(cut),
            direction: all.direction.each_ref().map(cut),
            t_far: cut(&all.t_far),
        }
    };
    let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
    let mut alone = Vec::new();
    for k in 0..all.len() {
        visibility.closest_hits(&part(k, 1), Coherence::Incoherent, &mut hits);
        visibility.occluded(&part(k, 1), Coherence::Incoherent, &mut blocked);
        alone.push((hits.face_and_side[0], blocked[0]));
    }
    // Long batches first: short ones must not keep what those left behind.
    for n in (0..=all.len()).rev() {
        visibility.closest_hits(&part(0, n), Coherence::Incoherent, &mut hits);
        visibility.occluded(&part(0, n), Coherence::Incoherent, &mut blocked);
        assert_eq!([hits.t.len(), hits.u.len(), hits.v.len(), blocked.len()], [n; 4]);
        let together: Vec<_> = hits
            .face_and_side
            .iter()
            .copied()
            .zip(blocked.iter().copied())
            .collect();
        assert_eq!(together, alone[..n]);
    }
}

#[test]
fn rays_that_are_not_finite_hit_nothing_and_do_not_disturb_their_neighbours() {
    let visibility = EmbreeVisibility::new(&room(3)).unwrap();
    let mut random = Random::new(12);
    let mut rays = RayBatch::default();
    for _ in 0..1000 {
        rays.push_ray(random.direction() * 0.3, random.direction());
    }
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for k in (0..rays.len()).step_by(3) {
        let value = odd[k / 3 % 3];
        match k / 9 % 7 {
            axis @ 0..3 => rays.origin[axis][k] = value,
            axis @ 3..6 => rays.direction[axis - 3][k] = value,
            _ => rays.t_far[k] = f32::NAN,
        }
    }
    let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
    visibility.closest_hits(&rays, Coherence::Incoherent, &mut hits);
    visibility.occluded(&rays, Coherence::Incoherent, &mut blocked);
    for (k, &stopped) in blocked.iter().enumerate() {
        let expected = k % 3 != 0;
        assert_eq!(hits.face(k).is_some(), expected, "ray {k}");
        assert_eq!(stopped, expected, "ray {k}");
    }
}

#[test]
fn a_scene_without_faces_stops_nothing() {
    let visibility = EmbreeVisibility::new(&Scene::default()).unwrap();
    let rays = random_rays(20, &mut Random::new(13));
    let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
    visibility.closest_hits(&rays, Coherence::Incoherent, &mut hits);
    visibility.occluded(&rays, Coherence::Coherent, &mut blocked);
    assert!(hits.face_and_side.iter().all(|&code| code == HitBatch::MISS));
    assert!(blocked.iter().all(|&blocked| !blocked));
}

#[test]
#[should_panic(expected = "directions and ends of rays differ in number")]
fn arrays_of_different_lengths_are_refused() {
    let visibility = EmbreeVisibility::new(&room(1)).unwrap();
    let mut rays = random_rays(5, &mut Random::new(14));
    rays.direction[2].pop();
    visibility.occluded(&rays, Coherence::Coherent, &mut Vec::new());
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    let mut random = Random::new(15);
    let scene = soup(2000, true, &mut random);
    let batches: Vec<RayBatch> = (0..64).map(|_| random_rays(1500, &mut random)).collect();
    // The scene is built within the pool, too.
    let answers = |n_threads: usize| -> Vec<Vec<u32>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            let visibility = EmbreeVisibility::new(&scene).unwrap();
            batches
                .par_iter()
                .map(|rays| {
                    let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
                    visibility.closest_hits(rays, Coherence::Incoherent, &mut hits);
                    visibility.occluded(rays, Coherence::Incoherent, &mut blocked);
                    let floats = [&hits.t, &hits.u, &hits.v].into_iter().flatten().map(|x| x.to_bits());
                    let blocked = blocked.iter().map(|&blocked| u32::from(blocked));
                    hits.face_and_side
                        .iter()
                        .copied()
                        .chain(floats)
                        .chain(blocked)
                        .collect()
                })
                .collect()
        })
    };
    assert!(answers(1) == answers(2));
}

#[test]
fn sizes_from_far_below_nanometres_to_beyond_galaxies_work_and_others_are_errors() {
    let scaled = |size: f64| {
        let mut scene = Motion::NONE.scene(room(2));
        scene.vertices.iter_mut().for_each(|v| *v *= size);
        EmbreeVisibility::new(&scene)
    };
    for size in [1e-29, 1e-9, 3e-8, 1e-3, 1.0, 1e6, 1e11, 1e13, 1e29] {
        let visibility = scaled(size).unwrap();
        let mut random = Random::new(16);
        let mut rays = RayBatch::default();
        for _ in 0..10_000 {
            let [from, to] = [0, 1].map(|_| (random.point() - 0.5) * size * 0.999);
            rays.push_segment(from, to + 2.0 * (to - from).normalize() * size);
        }
        let mut blocked = Vec::new();
        visibility.occluded(&rays, Coherence::Incoherent, &mut blocked);
        assert!(blocked.iter().all(|&blocked| blocked), "size {size}");
    }
    for size in [1e-31, 1e31, f64::INFINITY] {
        let error = scaled(size).unwrap_err();
        assert!(matches!(error, EmbreeError::ExtentOutOfRange { .. }), "{error:?}");
    }
}

#[test]
fn a_vertex_that_is_no_number_is_an_error() {
    let mut scene = room(2);
    scene.vertices[5].y = f64::NAN;
    let error = EmbreeVisibility::new(&scene).unwrap_err();
    assert!(
        matches!(error, EmbreeError::VertexOutOfRange { vertex: 5, .. }),
        "{error:?}"
    );
}

#[test]
fn faces_too_small_for_f32_are_named() {
    let mut builder = Builder::default();
    builder.face(&[DVec3::ZERO, DVec3::X, DVec3::Y]);
    let tiny = DVec3::new(0.7, 0.7, 0.0);
    builder.face(&[tiny, tiny + 1e-9 * DVec3::X, tiny + 1e-9 * DVec3::Y]);
    let visibility = EmbreeVisibility::new(&builder.finish()).unwrap();
    assert_eq!(
        visibility
            .vanished_faces()
            .iter()
            .map(|face| face.0)
            .collect::<Vec<_>>(),
        [1]
    );
}

#[test]
fn scenes_outlive_their_device_and_do_not_mind_others() {
    let make = |x: f32| {
        let device = Device::new().unwrap();
        let mut builder = SceneBuilder::new(vec![[x, -1.0, -1.0], [x, 1.0, -1.0], [x, 0.0, 1.0]]).unwrap();
        builder.triangle([0, 1, 2], 0).unwrap();
        builder.commit(&device).unwrap()
    };
    let scenes = [make(1.0), make(2.0)];
    let mut rays = RayBatch::default();
    rays.push_ray(DVec3::ZERO, DVec3::X);
    let mut hits = HitBatch::default();
    for (scene, t) in scenes.iter().zip([1.0_f32, 2.0]) {
        scene.closest_hits(&rays, Coherence::Incoherent, &mut hits);
        assert!((hits.t[0] - t).abs() < 1e-6);
    }
}
