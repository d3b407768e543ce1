//! Paths of the sun: each time as if alone, in any block, turned and moved, and continued from a checkpoint.

use std::path::Path;

use glam::{DQuat, DVec3};
use radiosity::heat::{Boundary, Sun, SunPath, SunPlace};
use radiosity::matrix::Need;
use radiosity::matrix::operator::Block;
use radiosity::mesh::Subdivision;
use radiosity::report::series::SeriesBlock;
use radiosity::report::sun_path;
use radiosity::scene::Scene;
use radiosity::workflow::{
    Balance, Context, Daylight, FormFactorRequest, FormFactorStudy, Model, SkyRequest, SolveRequest, SunRequest, Use,
    Warning, WorkflowError,
};

use super::{boundary, inside, rectangle, scene};

const AXES: [DVec3; 2] = [DVec3::Y, DVec3::Z];

const CONDITIONS: &str = "[surroundings]\ntemperature_k = 250\n[sky]\nirradiance_w_m2 = 60\n\
     [[surface]]\nname = \"*\"\nemissivity = 0.8\nabsorptance = 0.6\nadiabatic = true\n";

/// An open box with a wall in it.
fn court() -> Scene {
    let mut surfaces = inside([3.0, 2.0, 1.0]);
    surfaces.retain(|(name, _)| *name != "z1");
    surfaces.push((
        "wall",
        vec![rectangle([1.5, 0.0, 0.0], [0.0, 1.2, 0.0], [0.0, 0.0, 0.8])],
    ));
    surfaces.push((
        "other",
        vec![rectangle([1.5, 0.0, 0.0], [0.0, 0.0, 0.8], [0.0, 1.2, 0.0])],
    ));
    scene(&surfaces)
}

/// A sun that goes round, at times below the floor.
fn path(n: usize, turn: DQuat) -> SunPath {
    let mut path = SunPath::new(Path::new("path.csv"), 0.0, AXES);
    for k in 0..n {
        let (sin, cos) = (0.37 * k as f64).sin_cos();
        let direction = turn * DVec3::new(cos, 0.6 * sin, (0.11 * k as f64).cos());
        let strength = if k % 7 == 3 { 0.0 } else { 500.0 + k as f64 };
        let place = SunPlace::Direction(direction);
        path.push(k + 2, &k.to_string(), place, strength).unwrap();
    }
    path
}

struct Court {
    model: Model,
    factors: FormFactorStudy,
    cx: Context,
}

fn prepared(scene: Scene, cut: u32) -> Court {
    let mut cx = Context::default();
    let mut model = Model::new(scene, "here", Subdivision::Uniform(cut).into(), Use::Light, &mut cx).unwrap();
    let need = SolveRequest::default().need(&cx).unwrap();
    let factors = model
        .form_factors(&FormFactorRequest::default(), need, &mut cx)
        .unwrap();
    Court { model, factors, cx }
}

/// The values of a quantity at a time.
fn at(blocks: &[SeriesBlock], name: &str, mut step: usize, n: usize) -> Vec<f64> {
    for block in blocks {
        if step < block.n_steps {
            let own = block.quantities.iter().find(|own| own.name == name).unwrap();
            let width = n * own.channels.unwrap_or(1);
            return own.values[step * width..(step + 1) * width].to_vec();
        }
        step -= block.n_steps;
    }
    panic!("no step {step}");
}

#[track_caller]
fn near(found: &[f64], expected: &[f64], relative: f64) {
    let whole = expected.iter().fold(1e-9, |most: f64, x| most.max(x.abs()));
    assert_eq!(found.len(), expected.len());
    for (x, y) in found.iter().zip(expected) {
        assert!((x - y).abs() <= relative * whole, "{x} {y}");
    }
}

/// Light and heat at a time of a path, with their errors, are those of that sun alone: in the first block and in the second, by day and by night, in one channel and under a coloured sky.
#[test]
fn each_time_is_as_if_alone() {
    let path = path(70, DQuat::IDENTITY);
    let request = SolveRequest::default();
    for irradiance in [[60.0; 3], [60.0, 40.0, 20.0]] {
        let Court {
            mut model,
            factors,
            mut cx,
        } = prepared(court(), 2);
        let sky = SkyRequest {
            sky: radiosity::heat::Sky::new(60.0, DVec3::Z).unwrap(),
            irradiance,
        };
        let mut blocks = Vec::new();
        let mut sink = |block: &SeriesBlock| -> Result<(), WorkflowError> {
            blocks.push(block.clone());
            Ok(())
        };
        let study = model
            .solve_along_sun_path(&factors, (&path, Some(sky)), &request, Some(&mut sink), &mut cx)
            .unwrap();
        assert_eq!((study.steps.len(), blocks.len(), study.n_resumed), (70, 2, 0));
        for k in [0, 3, 41, 69] {
            let own = &path.steps[k];
            let daylight = Daylight {
                sun: own.sun.map(|sun| SunRequest {
                    sun,
                    irradiance: [sun.irradiance(); 3],
                }),
                sky: Some(sky),
            };
            let alone = model.solve_in_daylight(&factors, &request, &daylight, &mut cx).unwrap();
            let n = model.mesh.n_patches();
            near(&at(&blocks, "radiosity", k, n), alone.solution.radiosity.values(), 1e-5);
            near(
                &at(&blocks, "irradiance", k, n),
                alone.solution.irradiance.values(),
                1e-5,
            );
            near(&at(&blocks, "error", k, n), alone.carried.unwrap().values(), 1e-2);
            let sun = alone.direct.sun.map(|sun| sun.light.fraction).unwrap_or(vec![0.0; n]);
            near(&at(&blocks, "sunlit_fraction", k, n), &sun, 1e-14);
            let means = model.surface_means(&alone.solution.radiosity);
            for (surface, mean) in study.steps[k].surfaces.iter().zip(means) {
                near(&surface.radiosity, &mean, 1e-5);
            }
        }
    }
    let Court {
        mut model,
        factors,
        mut cx,
    } = prepared(court(), 2);
    let conditions = boundary(CONDITIONS, &model.scene).unwrap();
    let study = model
        .heat_along_sun_path(&factors, (&path, &conditions), &request, None, &mut cx)
        .unwrap();
    for k in [0, 3, 69] {
        let alone = Boundary {
            sun: path.steps[k].sun,
            ..conditions.clone()
        };
        let alone = model.heat(&factors, &alone, &request, &mut cx).unwrap();
        let step = &study.steps[k];
        assert!(step.balance.energy_balance_w.abs() <= step.balance.energy_balance_w_error);
        for (found, expected) in step.surfaces.iter().zip(&alone.heat.surfaces) {
            near(&[found.temperature_k], &[expected.temperature_k], 1e-9);
            near(&[found.temperature_k_error], &[expected.temperature_k_error], 2e-2);
            near(&[found.absorbed_solar_w], &[expected.absorbed_solar_w], 1e-9);
        }
    }
}

/// The scene turned and moved with its sun and sky has the same light at every time.
#[test]
fn turned_and_moved_with_its_sun_a_scene_has_the_same_light() {
    let light = |turn: DQuat, shift: DVec3| {
        let mut scene = court();
        scene.vertices.iter_mut().for_each(|v| *v = turn * *v + shift);
        let Court {
            mut model,
            factors,
            mut cx,
        } = prepared(scene, 2);
        let sky = SkyRequest {
            sky: radiosity::heat::Sky::new(60.0, turn * DVec3::Z).unwrap(),
            irradiance: [60.0; 3],
        };
        let study = model
            .solve_along_sun_path(
                &factors,
                (&path(9, turn), Some(sky)),
                &SolveRequest::default(),
                None,
                &mut cx,
            )
            .unwrap();
        let of_step = |step: &radiosity::workflow::LightStep| {
            let surfaces = step.surfaces.iter();
            let numbers = surfaces.map(|own| {
                let sun = own.sun.as_ref().unwrap();
                [own.radiosity[0], 100.0 * sun.sunlit_fraction, sun.sun_irradiance[0]]
            });
            numbers.collect::<Vec<_>>().concat()
        };
        study.steps.iter().flat_map(of_step).collect::<Vec<f64>>()
    };
    let plain = light(DQuat::IDENTITY, DVec3::ZERO);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    // What of the escaping light is above the horizon is told by rays.
    near(&light(turn, DVec3::new(5.0, -3.0, 8.0)), &plain, 3e-3);
}

/// Work that ends after a block goes on from there: the same values, without solving it again.
#[test]
fn an_interrupted_path_goes_on() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("path.checkpoint");
    let path = path(150, DQuat::IDENTITY);
    let run = |n_blocks: usize, drops_surfaces: bool| {
        let mut cx = Context::default();
        cx.checkpoint_file = Some(file.clone());
        // The wall stands in the middle of one patch, under which light leaks: there is something to warn of.
        let mut model = Model::new(court(), "here", Subdivision::Uniform(1).into(), Use::Light, &mut cx).unwrap();
        let request = SolveRequest::default();
        let need = request.need(&cx).unwrap();
        let factors = model
            .form_factors(&FormFactorRequest::default(), need, &mut cx)
            .unwrap();
        let conditions = boundary(CONDITIONS, &model.scene).unwrap();
        let mut blocks = Vec::new();
        let mut sink = |block: &SeriesBlock| {
            blocks.push(block.clone());
            if blocks.len() >= n_blocks {
                return Err(WorkflowError::Interrupted);
            }
            Ok(())
        };
        cx.demand.drops_surfaces = drops_surfaces;
        let found = model.heat_along_sun_path(&factors, (&path, &conditions), &request, Some(&mut sink), &mut cx);
        (found, blocks, (cx.warnings(), cx.leaks.worst))
    };
    let (ended, first, _) = run(2, true);
    assert!(matches!(ended, Err(WorkflowError::Interrupted)) && first.len() == 2);
    let (resumed, all, (warnings, leak)) = run(usize::MAX, false);
    let resumed = resumed.unwrap();
    assert_eq!((resumed.n_resumed, all.len()), (128, 3));
    assert_eq!(all[..2], first[..]);
    std::fs::remove_file(&file).unwrap();
    let (whole, others, (expected, expected_leak)) = run(usize::MAX, false);
    assert_eq!(all, others);
    assert!(
        expected.iter().any(|one| matches!(one, Warning::LightLeak { .. })),
        "{expected:?}"
    );
    assert_eq!(warnings, expected);
    assert!(expected_leak.is_some());
    assert_eq!(leak, expected_leak);
    let whole = whole.unwrap();
    assert_eq!((whole.n_resumed, whole.n_passes), (0, resumed.n_passes));
    for (a, b) in whole.steps.iter().zip(&resumed.steps) {
        assert_eq!((&a.surfaces, a.balance), (&b.surfaces, b.balance));
        assert!(!a.surfaces.is_empty());
    }
    // Without the surfaces all else is the same, also from a checkpoint that has them.
    let (totals, same, _) = run(usize::MAX, true);
    let totals = totals.unwrap();
    assert_eq!((same, totals.n_resumed), (others, 150));
    for (a, b) in whole.steps.iter().zip(&totals.steps) {
        assert_eq!((a.balance, 0), (b.balance, b.surfaces.len()));
    }
}

/// Blocks are taken up with the same form factors only: those of other rays are others, though all rows of an enclosure sum to 1.
#[test]
fn a_path_with_other_form_factors_begins_anew() {
    let directory = tempfile::tempdir().unwrap();
    let path = path(3, DQuat::IDENTITY);
    let room = scene(&inside([3.0, 2.0, 1.0]));
    let run = |seed: u64| {
        let mut cx = Context::default();
        let mut model = Model::new(
            room.clone(),
            "here",
            Subdivision::Uniform(2).into(),
            Use::Light,
            &mut cx,
        )
        .unwrap();
        let request = SolveRequest::default();
        let mut shooting = FormFactorRequest {
            method: "sr".to_owned(),
            balance: Balance::Off,
            ..FormFactorRequest::default()
        };
        shooting.settings.seed = seed;
        let factors = model.form_factors(&shooting, Need::AsTheyAre, &mut cx).unwrap();
        let sums = factors.factors.row_sums();
        // So that nothing but the blocks themselves tells one run from another.
        let mut of_path = Context::default();
        of_path.checkpoint_file = Some(directory.path().join("path.checkpoint"));
        let found = model.solve_along_sun_path(&factors, (&path, None), &request, None, &mut of_path);
        (found.unwrap().n_resumed, sums)
    };
    let [(first, sums), (again, _), (other, other_sums)] = [1, 1, 2].map(run);
    assert_eq!((first, again, other), (0, 3, 0));
    assert_eq!(sums, other_sums);
}

/// Tables of places have nights, times of both kinds become numbers, and mistakes name file, line and remedy.
#[test]
fn tables_are_read_or_refused_with_their_line() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("p.csv");
    let read = |text: &str| {
        std::fs::write(&file, text).unwrap();
        sun_path::read(&file, 0.25, AXES)
    };
    let days = "# Zurich\ntime,longitude,latitude,irradiance,note\n2026-06-21T00:00:00+02:00,8.5,47.4,5,night\n\n\
         2026-06-21T12:00:00+02:00,8.5,47.4,900,noon\n2026-06-21T11:00:00Z,8.5,47.4,800,\n";
    let found = read(days).unwrap();
    assert_eq!(found.times(), [0.0, 43_200.0, 46_800.0]);
    let shines: Vec<bool> = found.steps.iter().map(|step| step.sun.is_some()).collect();
    assert_eq!((shines, found.unit()), (vec![false, true, true], "s"));
    assert!(found.steps[0].direction.z < 0.0 && found.steps[1].direction.z > 0.8);
    assert_eq!(found.steps[2].line, 6);
    let sun: Sun = found.steps[1].sun.unwrap();
    assert!((sun.angular_radius_deg() - 0.25).abs() <= 0.0 && (sun.irradiance() - 900.0).abs() <= 0.0);
    let numbers = read("TIME,X,Y,Z,Irradiance\n-1.5,0,0,2,3\n7,1,0,0,0\n").unwrap();
    assert_eq!((numbers.times(), numbers.unit()), (vec![-1.5, 7.0], "as given"));
    assert!(numbers.steps[1].sun.is_none() && numbers.steps[0].direction == DVec3::Z);
    let head = "time,x,y,z,irradiance\n0,0,0,1,5\n";
    for (text, line, part) in [
        (String::new(), 1, "no line of names"),
        ("time,x,y,z\n0,0,0,1\n".into(), 1, "irradiance"),
        ("time,x,y,irradiance\n0,0,0,1\n".into(), 1, "latitude"),
        ("time,x,y,z,latitude,longitude,irradiance\n".into(), 1, "latitude"),
        ("time,x,y,z,irradiance\n".into(), 1, "no rows"),
        (
            "time,x,y,z,irradiance,X\n0,0,0,1,5,1\n".into(),
            1,
            "two columns are called `X`",
        ),
        (format!("{head}1,0,0,0,5\n"), 3, "direction: zero"),
        (format!("{head}1,0,0,1,-5\n"), 3, "irradiance: -5"),
        (format!("{head}1,0,0,1,nan\n"), 3, "no finite number"),
        (format!("{head}1,0,0\n"), 3, "no finite number"),
        (format!("{head}\n0,0,0,1,5\n"), 4, "sort the rows"),
        (format!("{head}noon,0,0,1,5\n"), 3, "as a number"),
        (format!("{head}2026-06-21T12:00:00Z,0,0,1,5\n"), 3, "in one way"),
        ("time,latitude,longitude,irradiance\n12,47,8,5\n".into(), 2, "RFC 3339"),
        (
            "time,latitude,longitude,irradiance\n2026-06-21T12:00:00Z,97,8,5\n".into(),
            2,
            "latitude: 97",
        ),
    ] {
        let error = read(&text).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains(&format!("p.csv:{line}: ")) && message.contains(part),
            "{message}"
        );
        assert_eq!(error.kind(), "bad_sun_path");
    }
    // North is that of places on Earth; where rows have directions, it is not asked for.
    let upright = |text: &str| {
        std::fs::write(&file, text).unwrap();
        sun_path::read(&file, 0.25, [DVec3::Z; 2])
    };
    assert_eq!(
        upright(days).unwrap_err().to_string(),
        "north: zero, or along up; give another direction"
    );
    assert!(upright(head).is_ok());
}

/// Where heat is taken that does not arrive at one of the times, the message names that time.
#[test]
fn an_impossible_time_is_named() {
    let Court {
        mut model,
        factors,
        mut cx,
    } = prepared(court(), 1);
    let taken = format!("{CONDITIONS}[[surface]]\nname = \"z0\"\nsupplied_w_m2 = -300\n");
    let conditions = boundary(&taken, &model.scene).unwrap();
    let mut path = SunPath::new(Path::new("path.csv"), 0.0, AXES);
    for (line, time, strength) in [(2, "8.5", 1000.0), (3, "9.5", 0.0)] {
        path.push(line, time, SunPlace::Direction(DVec3::Z), strength).unwrap();
    }
    let request = SolveRequest::default();
    let error = model
        .heat_along_sun_path(&factors, (&path, &conditions), &request, None, &mut cx)
        .unwrap_err();
    assert!(error.to_string().contains("at time `9.5`, path.csv:3"), "{error}");
}

/// Columns of one length side by side and apart again.
#[test]
fn blocks_are_joined_and_parted() {
    let block = Block::side_by_side(&[
        Block::from_values(vec![1.0, 2.0, 3.0, 4.0], 2),
        Block::from_channels(&[vec![5.0, 6.0]]),
    ]);
    assert_eq!(block.values(), [1.0, 2.0, 5.0, 3.0, 4.0, 6.0]);
    assert_eq!(block.channels(1..3).values(), [2.0, 5.0, 4.0, 6.0]);
    assert_eq!(block.channel(1), [2.0, 4.0]);
}
