//! Boundary conditions of single patches.

#![expect(clippy::shadow_unrelated, reason = "every step of a test names its own results")]

use radiosity::heat::HeatError;
use radiosity::scene::Scene;
use radiosity::workflow::WorkflowError;

use super::{Found, boundary, heat, inside, scene, try_heat};

const PARTS: u32 = 3;

fn room() -> Scene {
    scene(&inside([1.0, 2.0, 1.5]))
}

fn conditions(of_z0: &str) -> String {
    format!(
        "[[surface]]\nname = \"*\"\nemissivity = 0.7\ntemperature_k = 300.0\n[[surface]]\nname = \"z0\"\nemissivity = 0.9\n{of_z0}\n"
    )
}

fn list(values: &[f64]) -> String {
    format!("{values:?}")
}

/// The numbers of the patches of `z0`, which are the fifth surface's.
fn of_z0(found: &Found, name: &str) -> Vec<f64> {
    let n = PARTS.pow(2) as usize;
    found.patches(name)[4 * n..5 * n].to_vec()
}

#[test]
fn equal_values_of_all_patches_are_that_of_the_surface() {
    let n_own = PARTS.pow(2) as usize;
    let plain = heat(&room(), PARTS, &conditions("temperature_k = 350.0"));
    for n in [n_own, 6 * n_own] {
        let (kelvin, emissivity) = (list(&vec![350.0; n]), list(&vec![0.9; n]));
        let text = conditions(&format!("temperature_k = {kelvin}"))
            .replace("emissivity = 0.9", &format!("emissivity = {emissivity}"));
        let found = heat(&room(), PARTS, &text);
        for (name, values) in &plain.study.heat.patches {
            assert_eq!(found.patches(name), values, "{name} {n}");
        }
        for (own, expected) in found.study.heat.surfaces.iter().zip(&plain.study.heat.surfaces) {
            let close = |a: f64, b: f64| assert!((a - b).abs() <= 1e-12 * b.abs(), "{}: {a} {b}", own.name);
            close(own.emissivity, expected.emissivity);
            close(own.absorptance, expected.absorptance);
            close(own.temperature_k, expected.temperature_k);
        }
    }
}

#[test]
fn each_patch_has_its_own_temperature_or_heat() {
    let n = PARTS.pow(2) as usize;
    let rising: Vec<f64> = (0..n).map(|k| 310.0 + 5.0 * k as f64).collect();
    let found = heat(
        &room(),
        PARTS,
        &conditions(&format!("temperature_k = {}", list(&rising))),
    );
    for (a, b) in of_z0(&found, "temperature_k").iter().zip(&rising) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    let own = found.surface("z0");
    assert!((own.temperature_min_k - 310.0).abs() < 1e-9 && (own.temperature_max_k - 350.0).abs() < 1e-9);
    // The mean of T⁴, as the patches are equally large.
    let mean = (rising.iter().map(|t| t.powi(4)).sum::<f64>() / n as f64).powf(0.25);
    assert!((own.temperature_k - mean).abs() < 1e-9);

    let supplied: Vec<f64> = (0..n).map(|k| -10.0 + 20.0 * k as f64).collect();
    let found = heat(
        &room(),
        PARTS,
        &conditions(&format!("supplied_w_m2 = {}", list(&supplied))),
    );
    let errors = of_z0(&found, "net_flux_w_m2_error");
    for ((a, b), error) in of_z0(&found, "net_flux_w_m2").iter().zip(&supplied).zip(errors) {
        assert!((a - b).abs() <= error + 1e-9, "{a} {b}");
    }
}

#[test]
fn as_many_values_as_patches_each_in_its_range() {
    let refused = |text: &str| match try_heat(&room(), PARTS, text).map(drop) {
        Err(WorkflowError::Heat { line, error, .. }) => {
            assert_eq!(line, Some(8), "{error}");
            error
        }
        other => panic!("{other:?}"),
    };
    for key in ["temperature_k", "supplied_w_m2"] {
        let error = refused(&conditions(&format!("{key} = [1.0, 2.0]")));
        assert!(
            matches!(&error, HeatError::OutOfRange { surface, key: found, .. } if surface == "z0" && *found == key)
        );
        assert!(
            error
                .to_string()
                .contains("2 values, where the surface has 9 patches and the scene 54"),
            "{error}"
        );
    }
    for (own, line, words) in [
        ("temperature_k = [300.0, -1.0]", 8, "temperature_k: -1.0 is negative"),
        ("temperature_k = []", 8, "or a list of one for each patch"),
        (
            "temperature_k = 1.0\nabsorptance = [0.5, 1.5]",
            9,
            "absorptance: 1.5 is outside [0, 1]",
        ),
        (
            "temperature_k = [\"warm\"]",
            8,
            "expected a number, or a list of one for each patch",
        ),
    ] {
        let error = boundary(&conditions(own), &room()).unwrap_err();
        let text = error.to_string();
        assert!(text.contains(words) && text.contains(&format!(":{line}:")), "{text}");
    }
}
