//! What rounded coordinates leave open of form factors: `exact` states it, and does not claim a tolerance that it is above.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::path::Path;

use glam::{DQuat, DVec3};
use radiosity::form_factor::{Computed, ExactMethod};
use radiosity::scene::{Scene, builtin};
use support::rooms::{Prepared, Shapes, moved, with_decimals};
use support::{n_above, worst_error};

/// A corner of a room on a map of a country, in metres.
const ON_A_MAP: DVec3 = DVec3::new(500_000.0, 5_600_000.0, 100.0);

/// A room with two boxes that stand on its floor, turned against its walls.
fn room() -> Scene {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0), DQuat::IDENTITY, true);
    for (low, high, angle) in [
        (DVec3::new(1.0, 1.5, 0.0), DVec3::new(2.2, 3.0, 1.2), 0.3),
        (DVec3::new(2.7, 0.5, 0.0), DVec3::new(3.4, 1.2, 0.8), 0.1),
    ] {
        shapes.cuboid(low, high, DQuat::from_rotation_z(angle), false);
    }
    shapes.scene()
}

fn compute(scene: Scene, subdivide: u32, tolerance: f64) -> Computed {
    let method = ExactMethod {
        tolerance,
        ..ExactMethod::default()
    };
    Prepared::new(scene, subdivide).try_compute(&method).unwrap()
}

#[test]
fn a_tolerance_that_rounding_breaks_is_not_met() {
    let upright = DQuat::from_rotation_z(0.4);
    let tilted = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    for (turn, places, subdivide, tolerance) in [
        (upright, 3, 1, 1e-6),
        (upright, 3, 2, 1e-4),
        (upright, 6, 1, 1e-6),
        (tilted, 6, 1, 1e-8),
    ] {
        let case = format!("{turn} {places} {subdivide}");
        let scene = with_decimals(places, &moved(&room(), turn, 1.0, ON_A_MAP));
        let computed = compute(scene, subdivide, tolerance);
        let pairs = computed.pairs.unwrap();
        let (n, worst) = (n_above(&computed.factors, tolerance), worst_error(&computed.factors));
        assert!(n > 0 && !computed.tolerance_met, "{case}: {pairs:?}");
        assert_eq!((pairs.n_above_by_rounding, pairs.n_above_tolerance), (n, 0), "{case}");
        // Integrals and rounding make up what is stated together; the areas of bent quads differ by how they are taken.
        let of_rounding = pairs.rounding_error_max;
        assert!(
            of_rounding > 0.0 && of_rounding <= worst * (1.0 + 1e-6) && worst <= of_rounding + tolerance,
            "{case}: {of_rounding:e} {worst:e}"
        );
        if turn == tilted {
            // Pairs in full view, of quads that are bent, count as well.
            assert!(n > pairs.partial, "{case}: {n} {pairs:?}");
        }
    }
}

/// The scenes of the repository, as its users load them, and what files with six decimals have along the axes.
#[test]
fn ordinary_scenes_meet_their_tolerance() {
    let of_repository = ["cube", "room-box", "cornell-box", "corridor", "lewis-room"].map(|name| {
        let path = format!("{}/scenes/{name}/scene.obj", env!("CARGO_MANIFEST_DIR"));
        (name, radiosity::scene::load(Path::new(&path)).unwrap().scene)
    });
    let room_box = builtin::build("room-box", None).unwrap().scene;
    let thirds = moved(&room_box, DQuat::IDENTITY, 1.0 / 3.0, DVec3::ZERO);
    let turned = moved(&room(), DQuat::from_rotation_z(0.4), 1.0, DVec3::ZERO);
    let others = [
        ("six decimals", with_decimals(6, &thirds)),
        ("all digits", with_decimals(15, &turned)),
    ];
    for (name, scene) in of_repository.into_iter().chain(others) {
        for tolerance in [ExactMethod::DEFAULT_TOLERANCE, 1e-9] {
            let computed = compute(scene.clone(), 1, tolerance);
            let pairs = computed.pairs.unwrap();
            assert!(computed.tolerance_met, "{name} {tolerance:e}: {pairs:?}");
            assert_eq!(
                (pairs.n_above_tolerance, pairs.n_above_by_rounding),
                (0, 0),
                "{name} {tolerance:e}"
            );
            assert!(pairs.rounding_error_max <= 0.0, "{name} {tolerance:e}");
            assert_eq!(n_above(&computed.factors, tolerance), 0, "{name} {tolerance:e}");
        }
    }
}

/// Integrals leave room for what rounding adds: where that alone is within the tolerance, both together are.
#[test]
fn rounding_below_the_tolerance_does_not_break_it() {
    for angle in [0.2, 0.4, 0.6] {
        let turned = moved(&room(), DQuat::from_rotation_z(angle), 1.0, DVec3::ZERO);
        for (places, tolerance) in [(6, 1e-4), (7, 1e-5), (8, 1e-6)] {
            let computed = compute(with_decimals(places, &turned), 2, tolerance);
            assert!(
                computed.tolerance_met && n_above(&computed.factors, tolerance) == 0,
                "{angle} {places}: {:?}",
                computed.pairs
            );
        }
    }
}
