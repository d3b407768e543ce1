//! The laws of light: results that obey them pass, and each law is broken by what breaks it alone.
#![expect(
    clippy::shadow_unrelated,
    reason = "each run of a test has its own output, code and result"
)]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "support/program.rs"]
mod program;
mod support;

use std::io::{Read as _, Write as _};
use std::path::Path;

use glam::{DQuat, DVec3};
use radiosity::audit::{self, Audit, Claims, Given, Law};
use radiosity::form_factor::Reciprocity;
use radiosity::matrix::operator::Block;
use radiosity::matrix::{FormFactors, RowTally, RowTile, StorageChoice, Weighting};
use radiosity::render::{Image, Samples};
use radiosity::scene::Scene;
use radiosity::solver::{RadiositySystem, Solution};
use support::rooms::{Prepared, Shapes, names, quick};
use support::solving::{all, by_name, constant, l2, run, system};

/// A room of 2 × 1 × 1.5 m, with a box on no wall if `full`, and without its ceiling if `open`.
fn room(full: bool, open: bool) -> Scene {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.5), DQuat::IDENTITY, true);
    if full {
        let (low, high) = (DVec3::new(0.6, 0.3, 0.4), DVec3::new(1.1, 0.6, 0.9));
        shapes.cuboid(low, high, DQuat::from_rotation_z(0.3), false);
    }
    let mut scene = shapes.scene();
    if open {
        scene.faces.remove(5);
        scene.surfaces.remove(5);
        for face in scene.faces.iter_mut().skip(5) {
            face.surface.0 -= 1;
        }
    }
    scene
}

fn claims(closed: bool, reciprocity: Reciprocity) -> Claims<'static> {
    Claims {
        closed: closed.into(),
        reciprocity,
        errors_known: true,
        row_tolerance: 0.0,
    }
}

fn of_factors(factors: &FormFactors, claims: Claims<'_>) -> Audit {
    audit::form_factors(factors, claims).unwrap().audit
}

/// The laws that an audit found broken.
fn broken(audit: &Audit) -> Vec<Law> {
    audit.violations().map(|check| check.law).collect()
}

fn rooms() -> impl Iterator<Item = (bool, Prepared)> {
    let kinds = [(false, false), (true, false), (false, true), (true, true)];
    kinds
        .into_iter()
        .map(|(full, open)| (!open, Prepared::new(room(full, open), 3)))
}

#[test]
fn every_method_obeys_in_closed_and_open_rooms() {
    for (closed, prepared) in rooms() {
        for name in names() {
            let method = quick(name, 1);
            let Ok(computed) = prepared.try_compute(&*method) else {
                assert_eq!(name, "closed-form", "the box is turned");
                continue;
            };
            let found = of_factors(&computed.factors, claims(closed, method.reciprocity()));
            assert_eq!(broken(&found), [], "{name}, closed: {closed}: {found:?}");
            assert!(found.check(Law::Sign).unwrap().n_checked > 1000, "{name}");
            // What comes from a repair obeys as well.
            let factors = computed.factors.symmetrised(Weighting::default()).unwrap();
            let targets = computed.factors.row_targets(closed);
            let (balanced, report) = factors.balanced(&targets, 1e-12, 300).unwrap();
            assert!(report.converged, "{name}");
            let repaired = Claims {
                row_tolerance: 1e-12,
                ..claims(closed, method.reciprocity())
            };
            let found = of_factors(&balanced, repaired);
            assert_eq!(broken(&found), [], "{name}, closed: {closed}, balanced: {found:?}");
            assert!(found.check(Law::Reciprocity).is_some());
        }
    }
}

/// A closed room of 54 patches, exactly, in full rows, with `change` made to the exchange areas.
fn changed(change: impl Fn(&mut Vec<Vec<f64>>)) -> FormFactors {
    let prepared = Prepared::new(room(false, false), 3);
    let exact = prepared.compute(&*quick("exact", 0));
    let (n, areas) = (exact.n_rows(), exact.areas().to_vec());
    let exchange = |i: usize| (0..n).map(|j| areas[i] * exact.get(i, j)).collect();
    let mut rows: Vec<Vec<f64>> = (0..n).map(exchange).collect();
    change(&mut rows);
    let tiles = rows.iter().enumerate().map(|(i, row)| {
        let mut tile = RowTile::new(i);
        let entry = |(j, x): (u32, &f64)| (j, x / areas[i], exact.std_error(i, j as usize));
        let entries: Vec<_> = (0..).zip(row).map(entry).collect();
        tile.push_row(&entries, RowTally::default());
        tile
    });
    FormFactors::from_tiles(areas.clone(), tiles, StorageChoice::default()).unwrap()
}

/// Adds `step` to the exchange areas (i, j) and (k, l), and takes it from (i, l) and (k, j), on both sides: rows keep their sums.
fn swap(rows: &mut [Vec<f64>], [i, j, k, l]: [usize; 4], step: f64) {
    for (a, b, d) in [(i, j, step), (k, l, step), (i, l, -step), (k, j, -step)] {
        rows[a][b] += d;
        rows[b][a] += d;
    }
}

#[test]
fn each_law_of_form_factors_is_broken_by_itself() {
    let exact = claims(true, Reciprocity::Exact);
    let verdict = |claims: Claims, change: &dyn Fn(&mut Vec<Vec<f64>>)| of_factors(&changed(change), claims);
    assert_eq!(broken(&verdict(exact, &|_| {})), []);
    // Patches 0 and 1 share a wall, and so do 9 and 10: less than nothing goes between them.
    let negative = verdict(exact, &|rows| swap(rows, [0, 1, 9, 10], -1e-9));
    assert_eq!(broken(&negative), [Law::Sign], "{negative:?}");
    assert_eq!(negative.check(Law::Sign).unwrap().n_violations, 4);
    let one_way = verdict(exact, &|rows| {
        rows[3][20] += 1e-9;
        rows[3][30] -= 1e-9;
    });
    assert_eq!(broken(&one_way), [Law::Reciprocity]);
    let check = one_way.check(Law::Reciprocity).unwrap();
    assert!((check.deviation - 1e-9).abs() < 1e-12 && check.patch.unwrap().min(check.other_patch.unwrap()) == 3);
    let more = verdict(exact, &|rows| {
        rows[3][20] += 1e-9;
        rows[20][3] += 1e-9;
    });
    assert_eq!(broken(&more), [Law::Closure]);
    assert_eq!(more.check(Law::Closure).unwrap().n_violations, 2);
    let open = claims(false, Reciprocity::Exact);
    let bright = verdict(open, &|rows| rows.iter_mut().flatten().for_each(|x| *x *= 1.0 + 1e-9));
    assert_eq!(broken(&bright), [Law::RowSum]);
    // Above the smaller area a pair is above 1 in one of its rows, too: where rows are not held to 1, the bound is broken alone.
    let too_much = verdict(exact, &|rows| {
        let surplus = 3.0;
        rows[3][20] += surplus;
        rows[20][3] += surplus;
    });
    assert_eq!(broken(&too_much), [Law::Exchange, Law::Closure]);
    let message = too_much.check(Law::Exchange).unwrap().to_string();
    assert!(message.contains("no, in 2 of") && message.contains(" m²"), "{message}");
}

#[test]
fn counts_of_rays_may_differ_by_their_noise_and_no_more() {
    let prepared = Prepared::new(room(true, false), 2);
    let method = quick("sr", 4);
    let factors = prepared.compute(&*method);
    let noisy = claims(true, Reciprocity::ToNoise);
    assert!(of_factors(&factors, noisy).passed());
    assert_eq!(
        broken(&of_factors(&factors, claims(true, Reciprocity::Exact)))[..1],
        [Law::Reciprocity]
    );
    // A patch that sees a tenth less of another than that sees of it: 2000 rays a patch tell that from noise when the factor is large.
    let (n, areas) = (factors.n_rows(), factors.areas().to_vec());
    let tiles = (0..n).map(|i| {
        let mut tile = RowTile::new(i);
        let mut entries: Vec<_> = Vec::new();
        factors.for_each_in_row(i, |j, value, error| {
            entries.push((u32::try_from(j).unwrap(), value, error));
        });
        if i == 0 {
            // All that goes to the nearer half goes to the farther half.
            let half = entries.len() / 2;
            let moved: f64 = entries.iter().take(half).map(|e| e.1).sum();
            entries.iter_mut().take(half).for_each(|e| e.1 = 0.0);
            entries.last_mut().unwrap().1 += moved;
        }
        tile.push_row(&entries, factors.tallies()[i]);
        tile
    });
    let tampered = FormFactors::from_tiles(areas, tiles, StorageChoice::default()).unwrap();
    let found = of_factors(&tampered, noisy);
    assert!(broken(&found).contains(&Law::Reciprocity), "{found:?}");
    assert!(!broken(&found).contains(&Law::Closure));
}

#[test]
fn what_is_not_promised_is_not_checked_and_why_is_said() {
    let prepared = Prepared::new(room(true, true), 2);
    let method = quick("hemicube", 0);
    let factors = prepared.compute(&*method);
    let found = of_factors(&factors, claims(false, method.reciprocity()));
    assert!(found.check(Law::Reciprocity).is_none());
    assert!(
        found
            .not_checked
            .iter()
            .any(|s| s.law == Law::Reciprocity && s.reason.contains("promise"))
    );
    let unknown = Claims {
        errors_known: false,
        ..claims(false, Reciprocity::Exact)
    };
    let found = of_factors(&prepared.compute(&*quick("exact", 0)), unknown);
    assert!(found.check(Law::RowSum).is_none() && found.check(Law::Sign).is_some());
}

/// Form factors of the room with a box, open or not, and what they gain.
fn solved_room(open: bool) -> (FormFactors, Vec<f64>) {
    let prepared = Prepared::new(room(true, open), 2);
    let factors = prepared.compute(&*quick("exact", 0));
    let found = audit::form_factors(&factors, claims(!open, Reciprocity::Exact)).unwrap();
    assert!(found.audit.passed());
    (factors, found.gain)
}

fn given(gain: &[f64]) -> Given<'_> {
    Given {
        gain: Some(gain),
        costly: false,
    }
}

#[test]
fn every_solver_obeys_at_any_tolerance() {
    for open in [false, true] {
        let (factors, gain) = solved_room(open);
        let (rho, e) = support::solving::random_materials(factors.n_rows(), 0.95, 3);
        let system = system(&factors, &rho, &e);
        for solver in all() {
            for tolerance in [1e-2, 1e-6, 1e-11] {
                let solution = run(solver, &system, &l2(tolerance));
                let found = audit::solution(&system, &solution, given(&gain)).unwrap();
                assert_eq!(broken(&found), [], "{} {tolerance}: {found:?}", solver.name());
                assert_eq!(found.checks.len(), 6, "all laws of solutions");
            }
        }
    }
}

#[test]
fn power_that_one_sided_form_factors_make_is_accounted_for() {
    let prepared = Prepared::new(room(true, false), 2);
    let factors = prepared.compute(&*quick("sr", 2));
    let found = audit::form_factors(&factors, claims(true, Reciprocity::ToNoise)).unwrap();
    let n = factors.n_rows();
    let system = system(
        &factors,
        &constant(n, 0.8),
        &Block::from_values((0..n).map(|i| f64::from(u8::from(i < 4))).collect(), 1),
    );
    let solution = run(by_name("gauss-seidel"), &system, &l2(1e-12));
    let energy = &solution.energy[0];
    let made = energy.absorbed + energy.escaped - energy.emitted;
    assert!(made.abs() > 1e-4 * energy.emitted, "the noise makes or loses {made} W");
    assert!(
        audit::solution(&system, &solution, given(&found.gain))
            .unwrap()
            .passed()
    );
    // Without the account, the power does not add up.
    let none = vec![0.0; n];
    let blind = audit::solution(&system, &solution, given(&none)).unwrap();
    assert_eq!(broken(&blind), [Law::Energy]);
}

fn tampered(change: impl Fn(&RadiositySystem, &mut Solution)) -> Vec<Law> {
    let (factors, gain) = solved_room(true);
    let n = factors.n_rows();
    let e = Block::from_values((0..n).map(|i| 1.0 + f64::from(u8::from(i < 4))).collect(), 1);
    let system = system(&factors, &constant(n, 0.5), &e);
    let mut solution = run(by_name("pcg"), &system, &l2(1e-8));
    change(&system, &mut solution);
    broken(&audit::solution(&system, &solution, given(&gain)).unwrap())
}

/// Sets one radiosity, with irradiances that fit, and lets the solver admit to any residual in the mean.
fn set(system: &RadiositySystem, solution: &mut Solution, value: f64) {
    solution.radiosity.row_mut(5)[0] = value;
    system
        .operator()
        .apply(&solution.radiosity.clone(), &mut solution.irradiance);
    solution.residual_l2 = 1e3;
}

#[test]
fn each_law_of_solutions_is_broken_by_itself() {
    assert_eq!(tampered(|_, _| {}), []);
    assert_eq!(
        tampered(|_, s| s.irradiance.row_mut(7)[0] *= 1.0 + 1e-9),
        [Law::Irradiance]
    );
    assert_eq!(tampered(|_, s| s.residual_l2 *= 0.5), [Law::Residual]);
    assert_eq!(tampered(|_, s| s.energy[0].absorbed *= 1.001), [Law::Energy]);
    // Of patches that emit 1 and reflect a half none is darker than 1 or brighter than 4.
    assert_eq!(tampered(|system, s| set(system, s, 0.99)), [Law::LeastRadiosity]);
    assert_eq!(tampered(|system, s| set(system, s, 4.01)), [Law::GreatestRadiosity]);
    assert_eq!(tampered(|system, s| set(system, s, f64::NAN))[0], Law::Finite);
}

#[test]
fn propagated_light_lies_between_the_exitance_and_the_brightest_furnace() {
    let (rho, e) = (constant(3, 0.5), constant(3, 1.0));
    let sums = [1.0, 0.5, 0.0];
    let verdict = |b: [f64; 3]| {
        let b = Block::from_values(b.to_vec(), 1);
        broken(&audit::propagation(&rho, &e, &sums, &b, &b))
    };
    assert_eq!(verdict([2.0, 1.3, 1.0]), []);
    assert_eq!(verdict([2.001, 1.3, 1.0]), [Law::GreatestRadiosity]);
    assert_eq!(verdict([2.0, 1.3, 0.999]), [Law::LeastRadiosity]);
}

#[test]
fn dark_pixels_are_light_and_negative_ones_are_not() {
    let with = |value: f32, layer: &str| {
        let mut image = Image::new(2, 1);
        image.insert("R", Samples::F32(vec![0.0, 1.0]));
        image.insert(layer, Samples::F32(vec![0.5, value]));
        audit::picture(&image)
    };
    assert!(with(0.0, "irradiance.G").passed());
    assert!(with(-1.0, "N.X").passed(), "normals have signs");
    assert!(with(f32::INFINITY, "Z").passed(), "nothing is seen there");
    for value in [-1e-9, f32::NAN, f32::INFINITY] {
        let found = with(value, "radiosity.B");
        assert_eq!(broken(&found), [Law::Picture]);
        assert_eq!(found.checks[0].patch, Some(1));
    }
}

fn radiosity(directory: &Path, arguments: &[&str]) -> (i32, serde_json::Value, String) {
    let output = program::radiosity(directory, &[arguments, &["--json"]].concat());
    let document = serde_json::from_slice(&output.stdout).unwrap();
    (
        output.status.code().unwrap(),
        document,
        String::from_utf8(output.stderr).unwrap(),
    )
}

/// Copies an archive with another number at the start of the array `F`'s second row, and checksums that fit.
fn tamper(from: &Path, to: &Path) {
    let mut archive = zip::ZipArchive::new(std::fs::File::open(from).unwrap()).unwrap();
    let mut writer = zip::ZipWriter::new(std::fs::File::create(to).unwrap());
    for k in 0..archive.len() {
        let mut member = archive.by_index(k).unwrap();
        let mut bytes = Vec::new();
        member.read_to_end(&mut bytes).unwrap();
        let name = member.name().unwrap().into_owned();
        if name == "F.npy" {
            let place = bytes.len() - 8;
            bytes[place..].copy_from_slice(&0.25_f64.to_le_bytes());
        }
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        writer.start_file(name, options).unwrap();
        writer.write_all(&bytes).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_broken_law_is_a_warning_and_with_strict_exit_code_4() {
    let directory = tempfile::tempdir().unwrap();
    let at = |arguments: &[&str]| radiosity(directory.path(), arguments);
    at(&["scene", "cube", "-o", "cube.obj"]);
    let (code, document, errors) = at(&[
        "form-factors",
        "cube.obj",
        "--method",
        "sr",
        "--subdivide",
        "2",
        "-o",
        "F.npz",
        "--strict",
    ]);
    assert_eq!((code, errors.as_str()), (0, ""));
    assert_eq!(document["audit"]["passed"], true);
    let laws: Vec<&str> = document["audit"]["checks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["law"].as_str().unwrap())
        .collect();
    assert_eq!(laws, ["sign", "reciprocity", "exchange", "closure"]);
    tamper(&directory.path().join("F.npz"), &directory.path().join("G.npz"));
    let solve = |file, more: &[&str]| {
        at(&[
            &[
                "solve",
                "cube.obj",
                "--form-factors",
                file,
                "--balance",
                "off",
                "--solver",
                "jacobi",
            ],
            more,
        ]
        .concat())
    };
    let (code, document, errors) = solve("F.npz", &["--strict"]);
    assert_eq!((code, errors.as_str()), (0, ""), "{document}");
    let (code, document, errors) = solve("G.npz", &[]);
    assert_eq!(code, 0);
    assert_eq!(document["audit"]["passed"], false);
    assert!(
        errors.contains("warning: audit: row sums are 1 less what escapes: no, in 1 of 24 places"),
        "{errors}"
    );
    let (code, ..) = solve("G.npz", &["--strict"]);
    assert_eq!(code, 4);
}
