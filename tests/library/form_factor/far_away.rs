//! A scene far from the origin, as on a map: moved by a distance that its numbers can hold, it keeps its form factors.

use glam::{DQuat, DVec3};
use radiosity::form_factor::ExactMethod;
use radiosity::matrix::FormFactors;
use radiosity::scene::Scene;

use crate::support::rooms::{Prepared, Shapes, ground, moved};
use crate::support::{Uniform, n_cases};

/// Vertices are multiples of this, so that a move by whole metres up to 2^30 is exact.
const QUANTUM: f64 = 1.0 / 4_194_304.0;

/// On a map of a country, of the globe, and beyond.
const PLACES: [DVec3; 4] = [
    DVec3::new(524_288.0, 5_242_880.0, 64.0),
    DVec3::new(-8_388_608.0, 8_388_608.0, 1024.0),
    DVec3::new(4.0, -3_932_160.0, 5_046_272.0),
    DVec3::new(1_073_741_824.0, 3.0, -536_870_912.0),
];

fn quantised(mut scene: Scene) -> Scene {
    for vertex in &mut scene.vertices {
        *vertex = (*vertex / QUANTUM).round() * QUANTUM;
    }
    scene
}

/// A room with two boxes in it, turned, in triangles: quads would be bent.
fn room(random: &mut Uniform, size: f64) -> Scene {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, size * DVec3::new(4.0, 5.0, 3.0), DQuat::IDENTITY, true);
    for x in [0.5, 2.4] {
        let low = size * DVec3::new(x, 0.5 + 2.0 * random.next(), 0.3 * random.next());
        let high = low + size * DVec3::new(0.9, 0.4 + random.next(), 0.5 + random.next());
        shapes.cuboid(low, high, DQuat::from_rotation_z(random.next()), false);
    }
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 3.0 * random.next());
    let turned = moved(&shapes.scene(), turn, 1.0, DVec3::ZERO);
    let mut halves = Shapes::default();
    for face in turned.face_ids() {
        let corners = turned.polygon(face);
        halves.face(&corners[..3]);
        halves.face(&[corners[0], corners[2], corners[3]]);
    }
    halves.scene()
}

fn entries(factors: &FormFactors) -> Vec<[f64; 2]> {
    let n = factors.n_rows();
    let mut all = vec![[0.0; 2]; n * n];
    for i in 0..n {
        factors.for_each_in_row(i, |j, value, error| all[i * n + j] = [value, error]);
    }
    all
}

#[test]
fn a_move_that_is_exact_changes_no_form_factor_by_more_than_is_stated() {
    for seed in 0..n_cases(1, 3) {
        let mut random = Uniform(seed);
        let scenes = [
            ("fine ground", ground(0.125, || 0.02 * random.next()), 1),
            ("ground", ground(0.5, || 0.3 * random.next()), 1),
            ("hills", ground(10.0, || 12.0 * random.next()), 1),
            ("flat ground", ground(2.0, || 0.02 * random.next()), 1),
            ("a room", room(&mut random, 1.0), 1),
            ("a small room", room(&mut random, 0.05), 1),
        ];
        for (of_scene, (name, scene, subdivide)) in scenes.into_iter().enumerate() {
            let scene = quantised(scene);
            let exact = ExactMethod {
                tolerance: 1e-6,
                ..ExactMethod::default()
            };
            let near = Prepared::new(scene.clone(), subdivide).try_compute(&exact).unwrap();
            assert!(near.tolerance_met, "{name} {seed}: {:?}", near.pairs);
            let of_near = entries(&near.factors);
            for place in PLACES.into_iter().skip(of_scene % 2).step_by(n_cases(2, 1)) {
                let there = moved(&scene, DQuat::IDENTITY, 1.0, place);
                let far = Prepared::new(there, subdivide).try_compute(&exact).unwrap();
                // At 10^9 m what a double has room for is a tenth of a micrometre: what is stated may say so.
                let is_on_earth = place.abs().max_element() < 1e7;
                assert!(
                    far.tolerance_met || !is_on_earth,
                    "{name} {seed} {place}: {:?}",
                    far.pairs
                );
                // Estimates may be off by far less than the tolerance.
                for (k, (found, expected)) in entries(&far.factors).into_iter().zip(&of_near).enumerate() {
                    let off = (found[0] - expected[0]).abs();
                    let stated = found[1] + expected[1];
                    assert!(
                        off <= stated + 1e-3 * exact.tolerance,
                        "{name} {seed} {place}, entry {k}: {} is {}, off by {off:e}, {stated:e} stated",
                        expected[0],
                        found[0]
                    );
                }
            }
        }
    }
}
