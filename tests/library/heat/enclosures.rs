//! Enclosures by hand, by a dense solver, and at the ends of the range of numbers.

use std::f64::consts::PI;
use std::fmt::Write as _;

use glam::{DMat3, DVec3};
use radiosity::audit::Law;
use radiosity::mesh::Subdivision;
use radiosity::scene::Scene;
use radiosity::workflow::{Context, ExchangeNodes, FormFactorRequest, Model, SolveRequest, Use, Warning};
use serde_json::Value;

use super::{Found, SIGMA, boundary, heat, inside, rectangle, scene, sphere, within};

fn power(kelvin: f64) -> f64 {
    SIGMA * kelvin.powi(4)
}

/// Turns and moves a scene.
fn moved(scene: &Scene) -> Scene {
    let mut moved = scene.clone();
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    for vertex in &mut moved.vertices {
        *vertex = turn * *vertex + DVec3::new(3.0, -1.0, 0.5);
    }
    moved
}

/// Random conditions in closed boxes against numpy's dense solver, which `heat_box.py` runs with form factors of its own.
#[test]
fn boxes_are_what_a_dense_solver_finds() {
    let cases: Value = serde_json::from_str(include_str!("../../data/reference/heat_box.json")).unwrap();
    let room = scene(&inside([2.0, 1.0, 1.5]));
    for (k, case) in cases.as_array().unwrap().iter().enumerate() {
        let room = if k % 2 == 0 { room.clone() } else { moved(&room) };
        let found = heat(&room, 2, case["boundary"].as_str().unwrap());
        for (name, expected) in case["surfaces"].as_object().unwrap() {
            let own = found.surface(name);
            let [kelvin, watt] = ["temperature_k", "net_heat_w"].map(|key| expected[key].as_f64().unwrap());
            // The reference has the same patches: the error of the mesh is no excuse.
            assert!(
                (own.temperature_k - kelvin).abs() < 1e-9 * kelvin,
                "{name}: {own:?} {kelvin}"
            );
            assert!(
                (own.net_heat_w - watt).abs() < 1e-8 * watt.abs().max(1.0),
                "{name}: {own:?} {watt}"
            );
        }
    }
}

/// Three zones of a cube with one patch a side: floor and ceiling of given temperatures, adiabatic walls.
#[test]
fn a_cube_is_a_network_of_three_zones() {
    const OPPOSITE: f64 = 0.199_824_895_698_387_5;
    let cube = scene(&inside([1.0; 3]));
    let (floor, ceiling) = ((0.3, 500.0), (0.8, 300.0));
    let text = "[[surface]]\nname = \"*\"\nemissivity = 0.5\nadiabatic = true\n\
         [[surface]]\nname = \"z0\"\nemissivity = 0.3\ntemperature_k = 500\n\
         [[surface]]\nname = \"z1\"\nemissivity = 0.8\ntemperature_k = 300.0\n";
    let found = heat(&cube, 1, text);
    // Adiabatic walls are two conductors in a row beside the direct one.
    let direct = OPPOSITE + 0.5 * (1.0 - OPPOSITE);
    let resistance = (1.0 - floor.0) / floor.0 + 1.0 / direct + (1.0 - ceiling.0) / ceiling.0;
    let flow = (power(floor.1) - power(ceiling.1)) / resistance;
    let radiosities = [
        power(floor.1) - flow * (1.0 - floor.0) / floor.0,
        power(ceiling.1) + flow * (1.0 - ceiling.0) / ceiling.0,
    ];
    let walls = (0.5 * (radiosities[0] + radiosities[1]) / SIGMA).powf(0.25);
    within(found.surface("z0").net_heat_w, 1e-9 * flow, flow, f64::INFINITY);
    within(found.surface("z1").net_heat_w, 1e-9 * flow, -flow, f64::INFINITY);
    for name in ["x0", "x1", "y0", "y1"] {
        let own = found.surface(name);
        within(own.temperature_k, 1e-9 * walls, walls, f64::INFINITY);
        assert!(
            own.supplied_w.abs() < 1e-300 && own.supplied_w_error < 1e-300,
            "{own:?}"
        );
    }
    assert!(found.cx.warnings().contains(&Warning::NoMeshError), "one patch a side");
}

/// Two zones: a body in a hollow body of the same centre. The formula of concentric spheres with the areas of the tessellations, the nearer the finer.
#[test]
fn spheres_in_spheres_converge() {
    let (inner, outer) = ((0.4, 700.0), (0.7, 300.0));
    let text = "[[surface]]\nname = \"inner\"\nemissivity = 0.4\ntemperature_k = 700.0\n\
         [[surface]]\nname = \"outer\"\nemissivity = 0.7\ntemperature_k = 300.0\n";
    let off = |level: u32| {
        let both = scene(&[
            ("inner", sphere(0.5, level, false)),
            ("outer", sphere(1.0, level, true)),
        ]);
        let found = heat(&both, 1, text);
        let areas = [found.surface("inner").area_m2, found.surface("outer").area_m2];
        let resistance = 1.0 / inner.0 + areas[0] / areas[1] * (1.0 / outer.0 - 1.0);
        let flow = areas[0] * (power(inner.1) - power(outer.1)) / resistance;
        let heats = [found.surface("inner").net_heat_w, found.surface("outer").net_heat_w];
        assert!((heats[0] + heats[1]).abs() < 1e-6 * flow, "{heats:?}");
        assert!((heats[0] / flow - 1.0).abs() < 1e-5, "{heats:?} {flow}");
        // Of the spheres themselves.
        let between = 1.0 / inner.0 + 0.25 * (1.0 / outer.0 - 1.0);
        (heats[0] * between / (PI * (power(inner.1) - power(outer.1))) - 1.0).abs()
    };
    let offs = [off(0), off(1)];
    assert!(offs[0] < 0.3 && offs[1] < 0.35 * offs[0], "{offs:?}");
}

/// n shields between two plates let 1 / (n + 1) through: the nearer the plates, the nearer to it.
#[test]
fn shields_part_what_goes_through() {
    let through = |n: usize, gap: f64| {
        let side = |up: bool, height: f64| {
            let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
            let corner = [0.0, 0.0, height];
            vec![if up {
                rectangle(corner, x, y)
            } else {
                rectangle(corner, y, x)
            }]
        };
        let mut names: Vec<(String, Vec<Vec<DVec3>>)> = vec![("hot".into(), side(true, 0.0))];
        let mut text = "[surroundings]\ntemperature_k = 0\n[[surface]]\nname = \"*\"\nemissivity = 0.1\n\
             [[surface]]\nname = \"hot\"\ntemperature_k = 400.0\n[[surface]]\nname = \"cold\"\ntemperature_k = 0.0\n"
            .to_owned();
        for k in 1..=n {
            names.push((format!("down {k}"), side(false, gap * k as f64)));
            names.push((format!("up {k}"), side(true, gap * k as f64)));
            let _ = write!(text, "[[surface]]\nname = \"down {k}\"\nother_side = \"up {k}\"\n");
        }
        names.push(("cold".into(), side(false, gap * (n + 1) as f64)));
        let names: Vec<(&str, _)> = names
            .iter()
            .map(|(name, faces)| (name.as_str(), faces.clone()))
            .collect();
        let found = heat(&scene(&names), 1, &text);
        for k in 1..=n {
            let [down, up] = ["down", "up"].map(|name| found.surface(&format!("{name} {k}")));
            assert!((down.temperature_k - up.temperature_k).abs() < 1e-9);
            assert!((down.net_heat_w + up.net_heat_w).abs() < 1e-9 * up.net_heat_w.abs());
        }
        -found.surface("cold").net_heat_w
    };
    let between_two = power(400.0) / (2.0 / 0.1 - 1.0);
    for n in [0, 1, 3] {
        let off = |gap: f64| (through(n, gap) * (n + 1) as f64 / between_two - 1.0).abs();
        let offs = [off(1e-4), off(1e-5)];
        assert!(offs[0] < 0.03 && offs[1] < 0.2 * offs[0], "{n}: {offs:?}");
    }
}

/// Stated errors hold the true ones, by a mesh that is twice as fine.
#[test]
fn errors_are_stated_and_hold() {
    let room = scene(&inside([1.0, 1.0, 0.5]));
    let text = "[[surface]]\nname = \"*\"\nemissivity = 0.2\nsupplied_w_m2 = 5.0\n\
         [[surface]]\nname = \"x*\"\nemissivity = 0.6\ntemperature_k = 350.0\n\
         [[surface]]\nname = \"z1\"\nnode = \"lid\"\n[[node]]\nname = \"lid\"\nsupplied_w = 100.0\n";
    let (coarse, fine) = (heat(&room, 4, text), heat(&room, 8, text));
    for (own, exact) in coarse.study.heat.surfaces.iter().zip(&fine.study.heat.surfaces) {
        for (value, error, truth) in [
            (own.temperature_k, own.temperature_k_error, exact.temperature_k),
            (own.net_heat_w, own.net_heat_w_error, exact.net_heat_w),
            (own.irradiance_w_m2, own.irradiance_w_m2_error, exact.irradiance_w_m2),
        ] {
            // Errors of the finer mesh are in it too.
            within(value, 1.5 * error, truth, 0.05 * truth.abs().max(1.0));
        }
        assert!(exact.temperature_k_error < own.temperature_k_error || own.temperature_k_error <= 0.0);
    }
}

/// Emissivities of 1e-6 everywhere.
#[test]
fn a_room_of_mirrors_is_right() {
    let cube = scene(&inside([1.0; 3]));
    let text = "[[surface]]\nname = \"*\"\nemissivity = 1e-6\nadiabatic = true\n\
         [[surface]]\nname = \"z0\"\ntemperature_k = 400.0\n[[surface]]\nname = \"z1\"\ntemperature_k = 300.0\n";
    let found = heat(&cube, 2, text);
    let even = (0.5 * (power(400.0) + power(300.0)) / SIGMA).powf(0.25);
    // The light is even to some 1e-6: each of the two emits and absorbs half of it.
    let flow = 1e-6 * 0.5 * (power(400.0) - power(300.0));
    within(found.surface("x0").temperature_k, 1e-4, even, 0.1);
    within(found.surface("z0").net_heat_w, 1e-5 * flow, flow, f64::INFINITY);
    assert!(
        found.surface("z0").net_heat_w_error < 1e-3 * flow,
        "{:?}",
        found.surface("z0")
    );
}

/// An emissivity of 1e-3 beside 1, and 3 K beside 3,000 K.
#[test]
fn cold_beside_hot_is_right() {
    let cube = scene(&inside([1.0; 3]));
    let text = "[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 3.0\n\
         [[surface]]\nname = \"z0\"\nemissivity = 1e-3\ntemperature_k = 3000.0\n";
    let found = heat(&cube, 2, text);
    let arriving = found.surface("z0").net_heat_w;
    within(arriving, 1e-9, 1e-3 * (power(3000.0) - power(3.0)), f64::INFINITY);
    let cold: f64 = ["x0", "x1", "y0", "y1", "z1"]
        .iter()
        .map(|name| found.surface(name).net_heat_w)
        .sum();
    assert!((cold + arriving).abs() < 1e-9 * arriving, "{cold} {arriving}");
}

/// Supplied heats that nearly cancel, beside a floor that hardly emits.
#[test]
fn heats_that_cancel_are_right() {
    let cube = scene(&inside([1.0; 3]));
    let text = "[[surface]]\nname = \"*\"\nemissivity = 0.5\nadiabatic = true\n\
         [[surface]]\nname = \"x0\"\nsupplied_w_m2 = 1000.0\n[[surface]]\nname = \"x1\"\nsupplied_w_m2 = -999.999999\n\
         [[surface]]\nname = \"z0\"\nemissivity = 1e-3\ntemperature_k = 900.0\n";
    let found = heat(&cube, 2, text);
    within(found.surface("z0").net_heat_w, 1e-9, -1e-6, 1e-6);
}

/// Errors of the mesh hold from 4 × 4 patches a side on; 2 × 2 are told apart from one a side alone, and where that is much a warning says so.
#[test]
fn errors_of_the_mesh_hold_or_are_warned_of() {
    let gap = inside([2.0, 2.0, 0.5]);
    let room = scene(&gap[..5]);
    let text = "[surroundings]\ntemperature_k = 250.0\n[[surface]]\nname = \"*\"\nemissivity = 0.5\nadiabatic = true\n\
         [[surface]]\nname = \"x0\"\ntemperature_k = 600\n[[surface]]\nname = \"y1\"\nsupplied_w_m2 = 500\n";
    let is_warned_of = |found: &Found| {
        let warnings = found.cx.warnings();
        warnings.iter().any(|own| matches!(own, Warning::OnePatchAFace { .. }))
    };
    let [two, four, fine] = [2, 4, 12].map(|cut| heat(&room, cut, text));
    assert!(is_warned_of(&two) && !is_warned_of(&four) && !is_warned_of(&fine));
    for (own, truth) in four.study.heat.surfaces.iter().zip(&fine.study.heat.surfaces) {
        for (value, error, expected, slack) in [
            (
                own.temperature_k,
                own.temperature_k_error,
                truth.temperature_k,
                truth.temperature_k_error,
            ),
            (
                own.net_heat_w,
                own.net_heat_w_error,
                truth.net_heat_w,
                truth.net_heat_w_error,
            ),
            (
                own.irradiance_w_m2,
                own.irradiance_w_m2_error,
                truth.irradiance_w_m2,
                truth.irradiance_w_m2_error,
            ),
        ] {
            assert!(
                (value - expected).abs() <= error + slack + 1e-12 * expected.abs(),
                "{}: {value} +- {error:e}, and not {expected}",
                own.name
            );
        }
    }
}

/// What one side of a sheet gives off the other takes up, and the parts of a node exchange what is supplied, however unlike their emissivities are: to rounding, and within the stated errors.
#[test]
fn unlike_sides_of_one_temperature_conserve_heat() {
    let mut both = inside([1.0; 3]);
    let names: Vec<String> = both.iter().map(|(name, _)| format!("far {name}")).collect();
    let far: Vec<_> = both
        .iter()
        .map(|(_, faces)| {
            let moved = |face: &Vec<DVec3>| face.iter().map(|v| *v + DVec3::X).collect();
            faces.iter().map(moved).collect::<Vec<Vec<_>>>()
        })
        .collect();
    both.extend(names.iter().map(String::as_str).zip(far));
    let both = scene(&both);
    for [black, bright] in [[1.0, 1e-3], [0.1, 1e-6], [0.9, 1e-8], [1e-4, 1e-8]] {
        let text = format!(
            "[[surface]]\nname = \"*\"\nemissivity = 0.5\ntemperature_k = 300\n[[surface]]\nname = \"far *\"\ntemperature_k = 3000\n\
             [[surface]]\nname = \"far z0\"\nemissivity = 0.9\ntemperature_k = 1000\n\
             [[surface]]\nname = \"x1\"\nemissivity = {black}\nother_side = \"far x0\"\n[[surface]]\nname = \"far x0\"\nemissivity = {bright}\n\
             [[surface]]\nname = \"z1\"\nemissivity = {black}\nnode = \"n\"\n[[surface]]\nname = \"far z1\"\nemissivity = {bright}\nnode = \"n\"\n\
             [[node]]\nname = \"n\"\n"
        );
        let found = heat(&both, 1, &text);
        for pair in [["x1", "far x0"], ["z1", "far z1"]] {
            let [a, b] = pair.map(|name| found.surface(name));
            let (sum, error) = (a.net_heat_w + b.net_heat_w, a.net_heat_w_error + b.net_heat_w_error);
            assert!(sum.abs() <= error, "{pair:?} {black} {bright}: {sum:e} +- {error:e}");
            assert!(
                sum.abs() <= 1e-13 * b.net_heat_w.abs(),
                "{pair:?} {black} {bright}: {sum:e} of {b:?}"
            );
        }
    }
}

/// Nodes of patches that see the open differently: what is supplied escapes, and the checks hold, though the mixed form factors have no reciprocity.
#[test]
fn nodes_in_the_open_pass_the_checks() {
    let room = scene(&inside([2.0, 2.0, 0.5])[..5]);
    let text = "[surroundings]\ntemperature_k = 250.0\n[[surface]]\nname = \"*\"\nemissivity = 0.5\nadiabatic = true\n\
         [[surface]]\nname = \"x0\"\ntemperature_k = 600\n[[surface]]\nname = \"?0\"\nnode = \"n\"\n[[node]]\nname = \"n\"\nsupplied_w = 50\n";
    for node in ["z0", "*1"] {
        let found = heat(&room, 4, &text.replace("?0", node));
        assert!(found.cx.audit.checks.iter().any(|check| check.law == Law::Energy));
    }
}

/// Gebhart factors: rows of 1, symmetric conductors, and the net heats of the whole solution.
#[test]
fn exchange_factors_give_the_heats_of_the_room() {
    let plates = scene(&inside([1.0, 2.0, 1.0])[..5]);
    let temperatures = [300.0, 350.0, 400.0, 450.0, 500.0];
    let mut text = "[surroundings]\ntemperature_k = 250.0\n".to_owned();
    for (k, (surface, kelvin)) in plates.surfaces.iter().zip(temperatures).enumerate() {
        let (name, emissivity) = (&surface.name, 0.15 * (k + 1) as f64);
        let _ = write!(
            text,
            "[[surface]]\nname = \"{name}\"\nemissivity = {emissivity}\ntemperature_k = {kelvin}\n"
        );
    }
    let found = heat(&plates, 2, &text);
    for by in [ExchangeNodes::Surfaces, ExchangeNodes::Patches] {
        let mut cx = Context::default();
        let options = Subdivision::Uniform(2).into();
        let mut model = Model::new(plates.clone(), "here", options, Use::Light, &mut cx).unwrap();
        let request = SolveRequest::default();
        let need = request.need(&cx).unwrap();
        let factors = model
            .form_factors(&FormFactorRequest::default(), need, &mut cx)
            .unwrap();
        let conditions = boundary(&text, &plates).unwrap();
        let exchange = model
            .exchange_factors(&factors, &conditions, by, &request, &mut cx)
            .unwrap();
        let m = exchange.n_nodes();
        let conductance = exchange.conductance();
        let mut heats = vec![0.0; plates.surfaces.len()];
        for i in 0..m {
            let row = &exchange.gebhart[i * m..][..m];
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{by:?} row {i}: {row:?}");
            for j in 0..m {
                let there = exchange.emitting_area[i] * row[j];
                assert!((conductance[i * m + j] - there).abs() < 1e-9, "{by:?} {i} {j}");
            }
        }
        let kelvin = |node: usize| {
            let of_surface = |(surface, kelvin): (&radiosity::scene::Surface, &f64)| {
                exchange.names[node].starts_with(&surface.name).then_some(*kelvin)
            };
            let known = plates.surfaces.iter().zip(&temperatures);
            known.into_iter().find_map(of_surface).unwrap_or(250.0)
        };
        for i in 0..m - 1 {
            let k = plates
                .surfaces
                .iter()
                .position(|s| exchange.names[i].starts_with(&s.name))
                .unwrap();
            let flow = |j: usize| conductance[i * m + j] * (power(kelvin(i)) - power(kelvin(j)));
            heats[k] += (0..m).map(flow).sum::<f64>();
        }
        for (heat, surface) in heats.iter().zip(&found.study.heat.surfaces) {
            assert!(
                (heat - surface.net_heat_w).abs() < 1e-6 * heat.abs().max(1.0),
                "{by:?}: {heat} {surface:?}"
            );
        }
    }
}
