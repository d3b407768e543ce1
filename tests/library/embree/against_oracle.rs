//! Embree agrees with the f64 oracle, wherever f32 resolves the difference.

use glam::DVec3;
use radiosity::geometry::polygon;
use radiosity::scene::Scene;
use radiosity::visibility::brute_force::BruteForce;
use radiosity::visibility::embree::{EmbreeVisibility, largest_coordinate};
use radiosity::visibility::{Coherence, HitBatch, RayBatch, Visibility};

use super::scenes::{Random, soup};

/// How far a face, as Embree sees it, may be from where it is, in units of the largest coordinate L: √3 · 2⁻²⁴ L of
/// rounding a vertex, and as much again, a few times, for the arithmetic of the intersection.
const TOLERANCE: f64 = 6e-7;

/// What lies on a ray, with the uncertainty that [`TOLERANCE`] leaves.
struct Candidate {
    face: usize,
    /// Earliest and latest distance.
    near: f64,
    far: f64,
    /// The ray hits the face whatever the rounding.
    certain: bool,
}

/// Lists the faces that a ray from `o` in direction `d` (a unit vector) hits, certainly or possibly, up to the distance `end`.
fn candidates(polygons: &[Vec<DVec3>], o: DVec3, d: DVec3, end: f64, tolerance: f64) -> Vec<Candidate> {
    let of = |(face, corners): (usize, &Vec<DVec3>)| {
        let normal = polygon::area_vector(corners).normalize();
        let cosine = normal.dot(d);
        let slack = tolerance * (1.0 + 1.0 / cosine.abs());
        let distance = normal.dot(corners[0] - o) / cosine;
        let point = o + distance * d;
        let next = corners.iter().cycle().skip(1);
        let depths = corners
            .iter()
            .zip(next)
            .map(|(&a, &b)| normal.cross((b - a).normalize()).dot(point - a));
        let depth = depths.fold(f64::INFINITY, f64::min);
        let (near, far) = (distance - slack, distance + slack);
        (depth > -slack && far >= 0.0 && near <= end).then_some(Candidate {
            face,
            near,
            far,
            certain: depth > slack && near > 0.0 && far < end,
        })
    };
    polygons.iter().enumerate().filter_map(of).collect()
}

#[derive(Default)]
struct Tally {
    rays: usize,
    hits: usize,
    backs: usize,
    /// Rays for which more than one answer is right, because they pass an edge, or two faces at once, too closely.
    ambiguous: usize,
}

/// Compares the answers for rays (no end) or segments, and says how many there were of which kind.
fn compare(scene: &Scene, ends: bool, n: usize, random: &mut Random, tally: &mut Tally) {
    let embree = EmbreeVisibility::new(scene).unwrap();
    let oracle = BruteForce::new(scene);
    assert_eq!(embree.frame_origin(), oracle.frame_origin());
    let l = largest_coordinate(scene);
    let polygons: Vec<Vec<DVec3>> = scene
        .face_ids()
        .map(|face| {
            scene
                .polygon(face)
                .into_iter()
                .map(|v| v - embree.frame_origin())
                .collect()
        })
        .collect();

    let mut rays = RayBatch::default();
    for _ in 0..n {
        let from = l * random.direction() * random.between(0.2, 1.5);
        let to = l * random.direction() * random.unit();
        if ends {
            rays.push_segment(from, to);
        } else {
            rays.push_ray(from, (to - from) * random.between(0.1, 10.0));
        }
    }
    let (mut hits, mut truth) = (HitBatch::default(), HitBatch::default());
    embree.closest_hits(&rays, Coherence::Incoherent, &mut hits);
    oracle.closest_hits(&rays, Coherence::Incoherent, &mut truth);
    let (mut blocked, mut truly_blocked) = (Vec::new(), Vec::new());
    embree.occluded(&rays, Coherence::Incoherent, &mut blocked);
    oracle.occluded(&rays, Coherence::Incoherent, &mut truly_blocked);

    for k in 0..n {
        let o = DVec3::from(rays.origin.each_ref().map(|x| f64::from(x[k])));
        let direction = DVec3::from(rays.direction.each_ref().map(|x| f64::from(x[k])));
        let length = direction.length();
        let tolerance = TOLERANCE * l;
        let end = f64::from(rays.t_far[k]) * length;
        let found = candidates(&polygons, o, direction / length, end, tolerance);
        let certain_end = found
            .iter()
            .filter(|c| c.certain)
            .map(|c| c.far)
            .fold(f64::INFINITY, f64::min);
        let possible: Vec<&Candidate> = found.iter().filter(|c| c.near <= certain_end).collect();
        let may_miss = certain_end == f64::INFINITY;

        for (who, answer, stopped) in [("Embree", &hits, blocked[k]), ("oracle", &truth, truly_blocked[k])] {
            assert!(
                if stopped { !found.is_empty() } else { may_miss },
                "{who}, ray {k}: blocked is {stopped}"
            );
            let Some(hit) = answer.face(k) else {
                assert!(may_miss, "{who}, ray {k}: a miss");
                continue;
            };
            let distance = f64::from(answer.t[k]) * length;
            // t is rounded to f32.
            let rounding = 2e-7 * distance;
            let right = possible
                .iter()
                .any(|c| c.face == hit.face.0 as usize && (c.near - rounding..=c.far + rounding).contains(&distance));
            assert!(right, "{who}, ray {k}: face {} at {distance}", hit.face.0);
        }
        let unambiguous = possible.len() == usize::from(!may_miss);
        if unambiguous {
            assert_eq!(hits.face_and_side[k], truth.face_and_side[k], "ray {k}: face and side");
            if let Some(hit) = hits.face(k) {
                let corners = &polygons[hit.face.0 as usize];
                let normal = polygon::area_vector(corners).normalize();
                let slack = tolerance * (1.0 + length / normal.dot(direction).abs());
                let at = |of: &HitBatch| point_at(corners, f64::from(of.u[k]), f64::from(of.v[k]));
                let apart = at(&hits).distance(at(&truth));
                assert!(apart <= slack, "ray {k}: u and v are {apart} apart, more than {slack}");
                tally.backs += usize::from(hit.back);
            }
        }
        tally.rays += 1;
        tally.hits += usize::from(!may_miss);
        tally.ambiguous += usize::from(!unambiguous);
    }
}

/// The point with these local coordinates, by the words of `Visibility::closest_hits`.
fn point_at(corners: &[DVec3], u: f64, v: f64) -> DVec3 {
    match *corners {
        [a, b, c] => a + u * (b - a) + v * (c - a),
        [a, b, _, d] if u + v <= 1.0 => a + u * (b - a) + v * (d - a),
        [_, b, c, d] => c + (1.0 - u) * (d - c) + (1.0 - v) * (b - c),
        _ => panic!("a face has three or four corners"),
    }
}

#[test]
fn random_faces_under_random_motions_are_hit_where_the_oracle_hits_them() {
    let mut random = Random::new(1);
    let mut tally = Tally::default();
    for round in 0..20 {
        let motion = random.motion();
        let scene = motion.scene(soup(120, true, &mut random));
        compare(&scene, round % 2 == 1, 3_000, &mut random, &mut tally);
    }
    // The test compares something: hits of both sides, misses, and hardly a ray for which it accepts two answers.
    let share = |n: usize, of: usize| n as f64 / of as f64;
    assert!((0.25..0.75).contains(&share(tally.hits, tally.rays)));
    assert!((0.33..0.67).contains(&share(tally.backs, tally.hits)));
    assert!(
        share(tally.ambiguous, tally.rays) < 2e-4,
        "{} of {} rays",
        tally.ambiguous,
        tally.rays
    );
}
