//! In a closed room the form factors of each face sum to 1, whatever stands in it.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::scenes::Random;
use super::shapes::{Polygon, all_pairs, area, cuboid, exchange, in_triangles, random_rotation, turned};

fn row_sums(faces: &[Polygon], tolerance: f64) -> Vec<f64> {
    let pairs = all_pairs(faces, tolerance);
    pairs
        .iter()
        .zip(faces)
        .map(|(row, face)| row.iter().sum::<f64>() / area(face))
        .collect()
}

/// The tolerance holds for each pair, relative to the smaller face.
fn check(faces: &[Polygon], tolerance: f64, expected: impl Fn(usize) -> f64) {
    for (i, sum) in row_sums(faces, tolerance).into_iter().enumerate() {
        let error = (sum - expected(i)).abs();
        assert!(
            error < 3.0 * tolerance,
            "row {i} of {}: {sum}, off by {error:e}",
            faces.len()
        );
    }
}

#[test]
fn boxes_that_float_at_any_angle() {
    let mut random = Random::new(11);
    for _ in 0..4 {
        let mut faces = cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), false);
        for centre in [DVec3::new(1.0, 1.2, 0.9), DVec3::new(2.8, 1.6, 1.4)] {
            let half = 0.2 + 0.3 * random.point();
            let rotation = random_rotation(&mut random, TAU);
            faces.extend(turned(cuboid(centre - half, centre + half, true), rotation, centre));
        }
        let motion = random.motion();
        for face in &mut faces {
            for v in face {
                *v = motion.point(*v);
            }
        }
        check(&faces, 1e-6, |_| 1.0);
    }
}

#[test]
fn a_box_and_a_wedge_of_triangles() {
    let mut faces = cuboid(DVec3::ZERO, DVec3::new(2.0, 2.0, 2.0), false);
    let centre = DVec3::new(0.6, 0.7, 0.6);
    let slanted = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
    faces.extend(in_triangles(&turned(
        cuboid(centre - 0.25, centre + 0.25, true),
        slanted,
        centre,
    )));
    // A tetrahedron.
    let [a, b, c, d] = [
        DVec3::new(1.2, 1.1, 0.9),
        DVec3::new(1.7, 1.2, 1.0),
        DVec3::new(1.4, 1.7, 0.8),
        DVec3::new(1.4, 1.3, 1.5),
    ];
    faces.extend([vec![a, c, b], vec![a, b, d], vec![b, c, d], vec![c, a, d]]);
    check(&faces, 1e-6, |_| 1.0);
}

#[test]
fn a_block_that_stands_on_the_floor_hides_what_it_stands_on() {
    let mut faces = cuboid(DVec3::ZERO, DVec3::new(3.0, 3.0, 2.0), false);
    let (low, high) = (DVec3::new(0.8, 0.9, 0.0), DVec3::new(1.7, 1.5, 1.1));
    let about_its_foot = DQuat::from_rotation_z(0.4);
    let block = turned(
        cuboid(low, high, true),
        about_its_foot,
        low.midpoint(high) * DVec3::new(1.0, 1.0, 0.0),
    );
    faces.extend(block);
    let hidden = area(&faces[10]) / area(&faces[4]);
    assert!((hidden - 0.06).abs() < 1e-12, "{hidden}");
    check(&faces, 1e-6, |i| match i {
        4 => 1.0 - hidden,
        10 => 0.0,
        _ => 1.0,
    });
}

#[test]
fn a_block_in_a_corner_touches_three_walls() {
    let mut faces = cuboid(DVec3::ZERO, DVec3::new(3.0, 2.0, 2.0), false);
    faces.extend(cuboid(DVec3::ZERO, DVec3::new(1.0, 0.5, 0.8), true));
    // Coincident faces of opposite winding are a sheet: the parts of the walls behind the block see each other inside of it, and backs.
    let inner: Vec<Polygon> = [6, 8, 10].map(|i| faces[i].iter().rev().copied().collect()).to_vec();
    let lost = |k: usize| {
        let others = (0..3).filter(|&l| l != k);
        let among: f64 = others
            .map(|l| exchange(&inner[k], &inner[l], &[], 1e-9).exchange_area)
            .sum();
        (area(&inner[k]) - among) / area(&faces[2 * k])
    };
    let lost = [lost(0), lost(1), lost(2)];
    assert!(lost.iter().all(|&x| x > 0.02), "{lost:?}");
    check(&faces, 1e-7, |i| match i {
        0 | 2 | 4 => 1.0 - lost[i / 2],
        6 | 8 | 10 => 0.0,
        _ => 1.0,
    });
}

#[test]
fn a_two_sided_partition_that_reaches_from_wall_to_wall() {
    let mut faces = cuboid(DVec3::ZERO, DVec3::new(2.0, 3.0, 2.0), false);
    let front = vec![
        DVec3::new(0.0, 1.3, 0.0),
        DVec3::new(2.0, 1.3, 0.0),
        DVec3::new(2.0, 1.7, 1.2),
        DVec3::new(0.0, 1.7, 1.2),
    ];
    faces.push(front.iter().rev().copied().collect());
    faces.push(front);
    check(&faces, 1e-7, |_| 1.0);
}
