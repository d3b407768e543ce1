//! Values certified elsewhere, to 1e-10 and better.

use glam::DVec3;
use serde_json::Value;

use super::scenes::{Motion, Random};
use super::shapes::{Polygon, all_pairs, area, cuboid, exchange, in_triangles};

fn reference() -> Value {
    serde_json::from_str(include_str!("../../data/reference/occluded.json")).expect("valid JSON")
}

fn number(value: &Value) -> f64 {
    let text = value.as_str().map(str::parse);
    text.map_or_else(|| value.as_f64().expect("a number"), |parsed| parsed.expect("a number"))
}

fn polygon(value: &Value, motion: Motion) -> Polygon {
    let corners = value.as_array().expect("corners");
    corners
        .iter()
        .map(|v| motion.point(DVec3::new(number(&v[0]), number(&v[1]), number(&v[2]))))
        .collect()
}

/// The identity and a few rigid motions.
fn motions() -> Vec<Motion> {
    let mut random = Random::new(5);
    let mut motions = vec![Motion::NONE];
    motions.extend((0..3).map(|_| random.motion()));
    motions
}

#[test]
fn a_plate_between_two_squares() {
    let plates = &reference()["plates"][0];
    for motion in motions() {
        let [p, q, plate] = ["src", "target", "occluder"].map(|name| polygon(&plates[name], motion));
        for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
            let result = exchange(&p, &q, std::slice::from_ref(&plate), tolerance);
            let error = (result.exchange_area - number(&plates["F12"])).abs();
            assert!(
                error <= result.error + 1e-13 && result.error <= tolerance,
                "{result:?} {error:e}"
            );
        }
    }
}

#[test]
fn a_partition_in_a_corridor() {
    let corridor = &reference()["corridor"];
    for motion in motions() {
        let [a, b, partition] = ["A", "B", "partition"].map(|name| polygon(&corridor[name], motion));
        let close = |p: &[DVec3], q: &[DVec3], occluders: &[Polygon], expected: &str| {
            for tolerance in [1e-6, 1e-8, 1e-10] {
                let result = exchange(p, q, occluders, tolerance);
                let error = (result.exchange_area / area(p) - number(&corridor[expected])).abs();
                assert!(error <= tolerance + 1e-11, "{expected} {result:?} {error:e}");
            }
        };
        let partition = [partition];
        close(&a, &b, &partition, "F_AB");
        close(&a, &b, &[], "F_AB_unobstructed");
        close(&a, &partition[0], &[], "F_A_partition");
    }
}

#[test]
fn all_pairs_of_a_room_with_a_floating_box() {
    let expected = &reference()["room_box_12"];
    let mut random = Random::new(6);
    for (motion, in_halves) in [(Motion::NONE, false), (random.motion(), true)] {
        let corner = |name: &str, k: usize| {
            let v = &expected[name][k];
            DVec3::new(number(&v[0]), number(&v[1]), number(&v[2]))
        };
        let mut faces = cuboid(corner("room", 0), corner("room", 1), false);
        faces.extend(cuboid(corner("box", 0), corner("box", 1), true));
        for face in &mut faces {
            for v in face {
                *v = motion.point(*v);
            }
        }
        let areas: Vec<f64> = faces.iter().map(|face| area(face)).collect();
        let pairs = if in_halves {
            // Each face as two triangles: four pairs for one.
            let parts = all_pairs(&in_triangles(&faces), 1e-10);
            let sum = |i: usize, j: usize| {
                [(0, 0), (0, 1), (1, 0), (1, 1)]
                    .map(|(k, l)| parts[2 * i + k][2 * j + l])
                    .iter()
                    .sum()
            };
            (0..12).map(|i| (0..12).map(|j| sum(i, j)).collect()).collect()
        } else {
            all_pairs(&faces, 1e-9)
        };
        let pairs: Vec<Vec<f64>> = pairs;
        for i in 0..12 {
            for j in 0..12 {
                let error = (pairs[i][j] / areas[i] - number(&expected["F"][i][j])).abs();
                // The reference is certified to about 1e-10, as its own reciprocity tells.
                assert!(error < 1.2e-9, "{i} {j}: {error:e}");
            }
            let sum = pairs[i].iter().sum::<f64>() / areas[i];
            assert!((sum - 1.0).abs() < 2e-9, "row {i}: {sum}");
        }
    }
}
