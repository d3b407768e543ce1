//! Sun and sky: shadows by hand, penumbras, and the part of the sky above the horizon.

use std::f64::consts::PI;

use glam::DVec3;

use super::{heat, inside, rectangle, scene, within};

const BLACK: &str = "[[surface]]\nname = \"*\"\nemissivity = 1.0\nadiabatic = true\n";

/// A plate of 1 m² over a floor of 4 m × 4 m.
fn plate_over_floor(height: f64) -> radiosity::scene::Scene {
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    scene(&[
        (
            "floor",
            vec![rectangle([0.0; 3], x.map(|v| 4.0 * v), y.map(|v| 4.0 * v))],
        ),
        ("above", vec![rectangle([1.0, 1.0, height], x, y)]),
        ("below", vec![rectangle([1.0, 1.0, height], y, x)]),
    ])
}

/// At three heights of the sun the shadow is as large as the plate where it falls on the floor, and moves by the height over the tangent.
#[test]
fn shadows_move_with_the_sun() {
    let scene = plate_over_floor(1.0);
    for (degrees, inside) in [(90.0_f64, 1.0), (45.0, 1.0), (30.0, 2.0 - 3.0_f64.sqrt())] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let text = format!(
            "[sun]\ndirection = [{:?}, 0.0, {:?}]\nirradiance_w_m2 = 1000.0\n{BLACK}",
            3.0 * cos,
            3.0 * sin
        );
        for cut in [1, 4, 7] {
            let found = heat(&scene, cut, &text);
            let floor = found.surface("floor");
            let lit = 1.0 - inside / 16.0;
            within(floor.sunlit_fraction.unwrap(), 1e-9, lit, 1.0);
            assert!(floor.sunlit_fraction_error.unwrap() < 1e-6);
            within(floor.absorbed_solar_w, 1e-6, 16.0 * 1000.0 * sin * lit, 1.0e9);
            within(found.surface("above").sunlit_fraction.unwrap(), 0.0, 1.0, 1.0);
            within(found.surface("below").sunlit_fraction.unwrap(), 0.0, 0.0, 1.0);
            let sun = found.study.heat.balance.sun_w;
            within(sun, 1e-6, 1000.0 * sin * (16.0 * lit + 1.0), 1e9);
        }
    }
}

/// Under a disc a small patch sees the part of it that the edge of a wide plate leaves.
#[test]
fn a_disc_has_a_penumbra() {
    let (radius, height) = (2.0_f64, 10.0);
    let reach = height * radius.to_radians().sin();
    for share in [-0.8, -0.3, 0.0, 0.5, 0.9] {
        // The edge of the plate at a part of the penumbra from overhead.
        let edge = share * reach;
        let side = 1e-3 * reach;
        let scene = scene(&[
            (
                "patch",
                vec![rectangle(
                    [-side, -side, 0.0],
                    [2.0 * side, 0.0, 0.0],
                    [0.0, 2.0 * side, 0.0],
                )],
            ),
            (
                "plate",
                vec![rectangle([edge, -50.0, height], [0.0, 100.0, 0.0], [50.0, 0.0, 0.0])],
            ),
        ]);
        let text = format!(
            "[sun]\ndirection = [0.0, 0.0, 1.0]\nirradiance_w_m2 = 100.0\nangular_radius_deg = {radius}\n{BLACK}"
        );
        let found = heat(&scene, 1, &text);
        // Directions u beyond edge / height are hidden; on the ground they are off by tan for sin.
        let u = edge / height;
        let chord = (u / (1.0 + u * u).sqrt() / radius.to_radians().sin()).clamp(-1.0, 1.0);
        let seen = 1.0 - (chord.acos() - chord * (1.0 - chord * chord).sqrt()) / PI;
        let own = found.surface("patch");
        let (value, error) = (own.sunlit_fraction.unwrap(), own.sunlit_fraction_error.unwrap());
        assert!(
            (value - seen).abs() < error && error < 0.06,
            "{share}: {value} +- {error} {seen}"
        );
    }
}

/// A closed room lets no sun in, and a lid with a hole lets in what falls through it.
#[test]
fn closed_rooms_are_dark() {
    let text = format!(
        "[sun]\ndirection = [0.2, 0.1, 1.0]\nirradiance_w_m2 = 1000.0\n[sky]\nirradiance_w_m2 = 100.0\n{BLACK}\
        [[surface]]\nname = \"z0\"\ntemperature_k = 300.0\n"
    );
    let closed = heat(&scene(&inside([1.0; 3])), 2, &text);
    let balance = closed.study.heat.balance;
    assert!(balance.sun_w.abs() + balance.sky_w.abs() <= 0.0, "{balance:?}");
    let open = heat(&scene(&inside([1.0; 3])[..5]), 3, &text);
    let cosine = DVec3::new(0.2, 0.1, 1.0).normalize().z;
    within(open.study.heat.balance.sun_w, 1e-6, 1000.0 * cosine, 1.0);
    // Whatever enters through the opening.
    let sky = open.study.heat.balance;
    within(sky.sky_w, sky.sky_w_error, 100.0, 2.0);
}

/// A plate that stands upright sees half of the sky; above a floor, what it sees is all sky.
#[test]
fn the_sky_ends_at_the_horizon() {
    let wall = rectangle([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let text = format!("[sky]\nirradiance_w_m2 = 100.0\n{BLACK}");
    let alone = heat(&scene(&[("wall", vec![wall.clone()])]), 1, &text);
    within(alone.surface("wall").absorbed_solar_w, 0.0, 50.0, 1e-9);
    let floor = rectangle([0.0, -50.0, 0.0], [50.0, 0.0, 0.0], [0.0, 101.0, 0.0]);
    let on_floor = heat(&scene(&[("wall", vec![wall]), ("floor", vec![floor])]), 1, &text);
    let own = on_floor.surface("wall");
    // Past the ends of the floor it sees little of the surroundings below the horizon.
    within(own.absorbed_solar_w, own.absorbed_solar_w_error, 50.0, 1.0);
}
