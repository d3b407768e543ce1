//! Shafts between polygons, and what meets and closes them.

use glam::DQuat;

use super::*;
use crate::geometry::sampling::Random;

fn rectangle(c: DVec3, a: DVec3, b: DVec3) -> Vec<DVec3> {
    vec![c, c + a, c + a + b, c + b]
}

fn facing_squares() -> [Vec<DVec3>; 2] {
    [
        rectangle(DVec3::ZERO, DVec3::X, DVec3::Y),
        rectangle(DVec3::Z, DVec3::Y, DVec3::X),
    ]
}

#[test]
fn polygons_that_do_not_face_each_other_have_no_shaft() {
    let [p, q] = facing_squares();
    assert!(Shaft::new(&p, &q, 0.0).is_some());
    let turned: Vec<DVec3> = q.iter().rev().copied().collect();
    assert!(Shaft::new(&p, &turned, 0.0).is_none() && Shaft::new(&turned, &p, 0.0).is_none());
    let beside = rectangle(DVec3::X, DVec3::X, DVec3::Y);
    assert!(Shaft::new(&p, &beside, 0.0).is_none());
}

#[test]
fn faces_that_only_touch_the_hull_do_not_meet_it() {
    let [p, q] = facing_squares();
    let shaft = Shaft::new(&p, &q, 0.0).expect("they face each other");
    let wall = rectangle(DVec3::ZERO, DVec3::Y, DVec3::Z);
    let floor = rectangle(DVec3::new(-5.0, -5.0, 0.0), DVec3::X * 10.0, DVec3::Y * 10.0);
    let moved = |face: &[DVec3], by: DVec3| face.iter().map(|&v| v + by).collect::<Vec<_>>();
    for shift in [-1e-11, 0.0, 1e-11] {
        assert!(!shaft.meets(&moved(&wall, DVec3::X * shift)), "{shift}");
    }
    // A border that narrow hides nothing to speak of, but a sheet before the whole polygon hides all.
    for (shift, meets) in [
        (-1e-11, false),
        (0.0, false),
        (1e-15, false),
        (1e-13, true),
        (1e-11, true),
    ] {
        assert_eq!(shaft.meets(&moved(&floor, DVec3::Z * shift)), meets, "{shift}");
    }
    assert!(shaft.meets(&rectangle(DVec3::X * 1e-6, DVec3::Y, DVec3::Z)));
    // A corner that reaches in between the tests of all planes needs the cut: this triangle passes by an edge of the hull.
    let passing = [
        DVec3::new(1.3, 0.5, 0.5),
        DVec3::new(0.5, 1.3, 0.4),
        DVec3::new(1.3, 1.3, 0.6),
    ];
    assert!(shaft.meets(&passing));
    let outside = passing.map(|v| v + DVec3::new(0.15, 0.15, 0.0));
    assert!(!shaft.meets(&outside));
}

#[test]
fn a_corner_beside_an_edge_does_not_tilt_the_plane_through_both() {
    // A wall and a ceiling that share an edge but for a rounding of every size, and a box below.
    let wall = rectangle(DVec3::ZERO, DVec3::Z * 2.0, DVec3::X * 4.0);
    let top = rectangle(DVec3::new(1.0, 0.7, 1.0), DVec3::X, DVec3::Y);
    for k in 0..40 {
        let miss = 10.0_f64.powf(-4.0 - 0.3 * f64::from(k));
        for shift in [DVec3::Y * miss, DVec3::Z * miss, DVec3::new(miss, -miss, miss)] {
            let mut ceiling = rectangle(DVec3::Z * 2.0, DVec3::Y * 3.0, DVec3::X * 4.0);
            ceiling[0] += shift;
            for shaft in [Shaft::new(&wall, &ceiling, 0.0), Shaft::new(&ceiling, &wall, 0.0)] {
                let shaft = shaft.expect("they face each other");
                assert!(shaft.meets(&top), "{shift:?}");
                let lengths = shaft.sides().map(|side| side.plane.normal.length());
                assert!(lengths.fold(0.0, f64::max) < 1.0 + 1e-9, "{shift:?}");
            }
        }
    }
}

#[test]
fn a_shaft_is_closed_by_a_face_that_covers_its_section() {
    let [p, q] = facing_squares();
    let shaft = Shaft::new(&p, &q, 0.0).expect("they face each other");
    let closed_by = |face: &[DVec3]| shaft.is_closed_by(face, &Plane::of(face), 0.0);
    let section = rectangle(DVec3::Z * 0.5, DVec3::X, DVec3::Y);
    assert!(closed_by(&section));
    assert!(closed_by(&section.iter().rev().copied().collect::<Vec<_>>()));
    assert!(!closed_by(&rectangle(DVec3::Z * 0.5, DVec3::X * 0.999, DVec3::Y)));
    let slanted = rectangle(DVec3::new(-1.0, -1.0, 0.2), DVec3::new(3.0, 0.0, 0.5), DVec3::Y * 3.0);
    assert!(closed_by(&slanted));
}

#[test]
fn tolerances_beside_one_end_do_not_grow_with_the_distance_or_the_size_of_the_other() {
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4);
    let placed = |face: &[DVec3]| {
        face.iter()
            .map(|&v| turn * v + DVec3::new(0.3, 0.2, 0.1))
            .collect::<Vec<_>>()
    };
    for (distance, is_wide) in (0..15).flat_map(|k| [(10.0_f64.powi(k), false), (10.0_f64.powi(k), true)]) {
        let width = if is_wide { distance } else { 1.0 };
        let p = placed(&rectangle(DVec3::ZERO, DVec3::X, DVec3::Y));
        let q = placed(&rectangle(DVec3::Z * distance, DVec3::Y * width, DVec3::X * width));
        let section = 1.0 + 0.5 * (width - 1.0) / distance;
        for shaft in [Shaft::new(&p, &q, 0.0), Shaft::new(&q, &p, 0.0)] {
            let shaft = shaft.expect("they face each other");
            for (reach, meets) in [(-1e-6, false), (-1e-12, false), (0.0, false), (1e-7, true)] {
                let wall = placed(&rectangle(DVec3::X * reach, DVec3::Y, DVec3::Z * 0.5));
                assert_eq!(shaft.meets(&wall), meets, "{distance:e} {width:e} {reach:e}");
                let edge = section + reach;
                let plate = placed(&rectangle(
                    DVec3::new(-1.0, -1.0, 0.5),
                    DVec3::X * (1.0 + edge),
                    DVec3::Y * 4.0,
                ));
                let is_closed = reach > -1e-8;
                let plane = Plane::of(&plate);
                assert_eq!(
                    shaft.is_closed_by(&plate, &plane, 0.0),
                    is_closed,
                    "{distance:e} {width:e} {reach:e}"
                );
            }
        }
    }
}

#[test]
fn a_thin_thing_over_something_very_large_is_no_part_of_it() {
    let small = rectangle(DVec3::Z * 0.5, DVec3::X, DVec3::Y)
        .into_iter()
        .rev()
        .collect::<Vec<_>>();
    let plate = rectangle(DVec3::new(-1.0, -1.0, 0.1), DVec3::X * 1.5, DVec3::Y * 3.0);
    for size in (0..13).map(|k| 10.0_f64.powi(k)) {
        let ground = rectangle(DVec3::new(-0.5, -0.5, 0.0) * size, DVec3::X * size, DVec3::Y * size);
        let shaft = Shaft::new(&small, &ground, 0.0).expect("they face each other");
        assert!(
            shaft.meets(&plate) && !shaft.is_closed_by(&plate, &Plane::of(&plate), 0.0),
            "{size:e}"
        );
        assert!(!shaft.meets(&ground) && !shaft.meets(&small), "{size:e}");
    }
}

#[test]
fn a_sliver_hides_nothing_from_itself() {
    let mut random = Random(1);
    let mut point = || random.point();
    for k in 0..2000 {
        let thin = 10.0_f64.powf(-6.5 * f64::from(k) / 2000.0);
        let (at, along) = (4.0 * point(), (point() - 0.5).normalize());
        let across = along.cross(point() - 0.5).normalize() * thin;
        let face = [at, at + along * 0.3, at + along * 0.15 + across * 0.3];
        let up = Plane::of(&face).normal;
        let to = at + up + (point() - 0.5);
        let other = [
            to,
            to + up.any_orthonormal_vector(),
            to + up.any_orthonormal_vector().cross(up),
        ];
        // A part of the sliver, as a patch.
        let part = [
            face[0].lerp(face[1], 0.25),
            face[1],
            face[1].lerp(face[2], 0.5),
            face[0].lerp(face[2], 0.25),
        ];
        for patch in [&face[..], &part] {
            for slack in [0.0, 1e-15] {
                let shaft = Shaft::new(patch, &other, slack).expect("they face each other");
                for turn in 0..3 {
                    let mut whole = face;
                    whole.rotate_left(turn);
                    assert!(!shaft.meets(&whole), "{thin} {slack} {turn} {}", patch.len());
                    whole.reverse();
                    assert!(!shaft.meets(&whole), "{thin} {slack} {turn} {}", patch.len());
                }
            }
        }
    }
}

#[test]
fn only_what_faces_the_other_counts() {
    // The upper half of a wall that starts below the floor.
    let [p, _] = facing_squares();
    let wall = rectangle(DVec3::new(2.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::Y);
    let shaft = Shaft::new(&p, &wall, 0.0).expect("the upper half sees the floor");
    assert!(!shaft.meets(&rectangle(DVec3::new(1.5, 0.0, -0.5), DVec3::X * 0.1, DVec3::Y)));
    assert!(shaft.meets(&rectangle(DVec3::new(1.5, 0.0, 0.1), DVec3::X * 0.1, DVec3::Y)));
}
