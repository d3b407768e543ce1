//! Whole studies: their errors, their warnings by kind and number, and what they refuse.

use std::sync::Mutex;
use std::sync::{Arc, PoisonError};

use radiosity::form_factor::{RAYS, TOLERANCE};
use radiosity::matrix::{DiskError, Need, Precision};
use radiosity::mesh::{MeshOptions, Subdivision};
use radiosity::scene::{Material, Scene, SceneBuilder, builtin};
use radiosity::solver::OMEGA;
use radiosity::workflow::{
    Balance, Context, FormFactorRequest, Model, Parameter, SolveRequest, Storage, Unsuited, Use, Warning, WorkflowError,
};

fn model(scene: Scene, options: impl Into<MeshOptions>, cx: &mut Context) -> Model {
    Model::new(scene, "here", options.into(), Use::Light, cx).unwrap()
}

fn room_box() -> Scene {
    builtin::build("room-box", None).unwrap().scene
}

/// The error that a study states of its light is no less than how far it is from the light of a study that is a thousand times as exact, and no more than the tolerance of its form factors.
#[test]
fn the_error_of_light_is_stated_and_holds() {
    let light = |tolerance: f64| {
        let mut cx = Context::default();
        let mut model = model(room_box(), Subdivision::Uniform(3), &mut cx);
        let mut request = FormFactorRequest::default();
        request.settings.values.set(&TOLERANCE, tolerance);
        let factors = model.form_factors(&request, Need::default(), &mut cx).unwrap();
        let solve = SolveRequest {
            tolerance: 1e-12,
            ..SolveRequest::default()
        };
        let study = model.solve(&factors, &solve, &mut cx).unwrap();
        assert!(cx.audit.passed() && cx.warnings().is_empty(), "{:?}", cx.warnings());
        (model.mesh.areas(), study)
    };
    let (areas, coarse) = light(1e-3);
    let (_, fine) = light(1e-6);
    let (mut off, mut whole) = (0.0, 0.0);
    for (i, area) in areas.iter().enumerate() {
        let (b, exact) = (coarse.solution.radiosity.row(i)[0], fine.solution.radiosity.row(i)[0]);
        off += area * (b - exact).powi(2);
        whole += area * exact.powi(2);
    }
    let (off, stated) = ((off / whole).sqrt(), coarse.error.relative().unwrap());
    assert!(off > 0.0 && off <= stated && stated < 1e-3, "{off:e} of {stated:e}");
    assert!(fine.error.relative().unwrap() < 1e-2 * stated);
    assert!(coarse.mesh_error.is_some_and(|mesh| mesh.surface_mean_max > 0.0));
}

/// Two squares that look at each other, or away.
fn squares(is_turned: bool) -> Scene {
    let mut builder = SceneBuilder::new();
    let surfaces = [builder.surface("lower").unwrap(), builder.surface("upper").unwrap()];
    let lamp = builder
        .material(Material {
            name: "lamp".into(),
            reflectance: [0.5; 3],
            exitance: [1.0; 3],
        })
        .unwrap();
    let corner = |k: u32| [f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)];
    let vertices: Vec<[f64; 3]> = (0..8).map(corner).collect();
    let mut faces = [[0, 1, 3, 2], [4, 6, 7, 5]];
    if is_turned {
        for face in &mut faces {
            face.reverse();
        }
    }
    builder.faces(&vertices, &faces, &surfaces, &[lamp]).unwrap();
    builder.build().unwrap().scene
}

/// Warnings come as they are found, are kept, and name parameters, not flags; a program writes these its own way.
#[test]
fn warnings_are_told_and_name_parameters() {
    let told = Arc::new(Mutex::new(Vec::new()));
    let listener = Arc::clone(&told);
    let mut cx = Context::default().on_warning(move |warning| {
        listener
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(warning.clone());
    });
    model(squares(true), Subdivision::Uniform(1), &mut cx);
    let warnings = cx.warnings();
    assert_eq!(*told.lock().unwrap(), warnings);
    assert!(
        warnings
            .iter()
            .any(|warning| matches!(warning, Warning::NoneSees { surface: None, .. })),
        "{warnings:?}"
    );
    for warning in &warnings {
        let flag = |parameter: Parameter, _: Option<&str>| format!("-{}-", parameter.name());
        assert!(!warning.to_string().contains("--"), "{warning}");
        assert!(warning.text(&flag).contains("-flip-"), "{warning}");
    }
    let mut silent = Context::default();
    model(squares(false), Subdivision::Uniform(1), &mut silent);
    assert!(silent.warnings().is_empty());
}

/// Returns a parameter so that nothing else looks like it.
fn marked(parameter: Parameter, value: Option<&str>) -> String {
    format!("<{}|{}>", parameter.name(), value.unwrap_or_default())
}

/// What the steps below studies refuse names parameters too: as they are called in the library, or as a program writes them.
#[test]
fn refusals_of_every_step_name_parameters() {
    let room = |options: MeshOptions| Model::new(room_box(), "here", options, Use::Light, &mut Context::default());
    let forms = |request: &FormFactorRequest| {
        let mut cx = Context::default();
        let factors = model(room_box(), Subdivision::Uniform(1), &mut cx);
        { factors }
            .form_factors(request, Need::AsTheyAre, &mut cx)
            .err()
            .unwrap()
    };
    let mut unused = FormFactorRequest::default();
    unused.settings.values.set(&RAYS, 5_u64);
    let mut shooting = FormFactorRequest {
        method: "sr".to_owned(),
        tolerance_parameter: Parameter::FormFactorTolerance,
        ..FormFactorRequest::default()
    };
    shooting.settings.values.set(&TOLERANCE, 1e-3);
    let mut omega = SolveRequest::default();
    omega.settings.values.set(&OMEGA, 1.5);
    let mut tight = Context::default();
    tight.memory.limit_byte = Some(1 << 30);
    tight.memory.storage = Storage::Dense;
    let mut many = model(room_box(), Subdivision::Uniform(90), &mut tight);
    let too_many = many.form_factors(&FormFactorRequest::default(), Need::AsTheyAre, &mut tight);
    let zero = room(Subdivision::Uniform(0).into());
    let negative = room(Subdivision::MaxEdge(-1.0).into());
    for (refused, expected) in [
        (zero.err().unwrap(), "<subdivide|>"),
        (negative.err().unwrap(), "<max_edge|>"),
        (forms(&unused), "`<rays|>`"),
        (forms(&shooting), "`<form_factor_tolerance|>`"),
        (omega.entry(&Context::default()).err().unwrap(), "<omega|>"),
        (too_many.err().unwrap(), "<storage|auto>"),
    ] {
        let (plain, text) = (refused.to_string(), refused.text(&marked));
        assert!(!plain.contains("--") && text.contains(expected), "{plain}: {text}");
    }
    let directory = std::path::PathBuf::from("there");
    let disk = DiskError::Damaged {
        directory,
        row: 1,
        column: 2,
    };
    let (plain, text) = (disk.to_string(), WorkflowError::from(disk).text(&marked));
    assert!(
        plain.ends_with("scratch=DIR") && text.ends_with("<scratch|DIR>"),
        "{plain}: {text}"
    );
}

/// A library outside of the scene's folder is refused by the name of the option that allows it.
#[test]
fn libraries_outside_name_the_option_that_allows_them() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path().join("scene");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(directory.path().join("a.mtl"), "newmtl a\nKd 0.5 0.5 0.5\n").unwrap();
    let text = "mtllib ../a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::write(folder.join("a.obj"), text).unwrap();
    let refused = radiosity::scene::load(folder.join("a.obj")).err().unwrap();
    let (plain, named) = (refused.to_string(), refused.text(&marked));
    assert!(plain.ends_with("or say allow_outside"), "{plain}");
    assert!(named.ends_with("or say <allow_outside|>"), "{named}");
}

#[test]
fn symmetric_storage_wants_balanced_form_factors() {
    let mut cx = Context::default();
    cx.memory.storage = Storage::Symmetric;
    let request = FormFactorRequest {
        balance: Balance::Off,
        ..FormFactorRequest::default()
    };
    let refused = model(room_box(), Subdivision::Uniform(1), &mut cx).form_factors(&request, Need::AsTheyAre, &mut cx);
    let refused = refused.err().unwrap();
    assert!(
        matches!(refused, WorkflowError::Unsuited(Unsuited::SymmetricUnbalanced))
            && !refused.to_string().contains("--"),
        "{refused}"
    );
}

/// Solves without storing form factors, with digits that are asked for.
fn on_the_fly(method: &str, solver: &str, precision: Option<Precision>) -> Result<(), WorkflowError> {
    let mut cx = Context::default();
    cx.memory.precision = precision;
    let request = FormFactorRequest {
        method: method.to_owned(),
        ..FormFactorRequest::default()
    };
    let solve = SolveRequest {
        solver: solver.to_owned(),
        ..SolveRequest::default()
    };
    let mut model = model(room_box(), Subdivision::Uniform(1), &mut cx);
    let (study, _) = model.solve_on_the_fly(&request, &solve, false, &mut cx)?;
    assert_eq!(
        (study.error.relative(), cx.warnings()),
        (None, vec![Warning::NoErrorOnTheFly])
    );
    Ok(())
}

/// Without stored form factors there is no error to state, which is said; and what would need them is refused.
#[test]
fn light_without_stored_form_factors_states_no_error() {
    on_the_fly("sr", "jacobi", None).unwrap();
    let refused = |method, solver, precision| match on_the_fly(method, solver, precision) {
        Err(WorkflowError::Unsuited(unsuited)) => unsuited,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused("sr", "jacobi", Some(Precision::F32)), Unsuited::UnstoredStorage);
    assert_eq!(
        refused("sr", "pcg", None),
        Unsuited::UnstoredReciprocity { solver: "pcg" }
    );
    assert!(matches!(
        refused("exact", "jacobi", None),
        Unsuited::UnstoredPairs { .. }
    ));
}

/// A limit of memory that cannot hold the patches is told with both numbers.
#[test]
fn what_does_not_fit_is_refused_with_its_size() {
    let mut cx = Context::default();
    cx.memory.limit_byte = Some(1 << 20);
    let refused = Model::new(
        room_box(),
        "here",
        Subdivision::Uniform(200).into(),
        Use::Light,
        &mut cx,
    );
    match refused.err().unwrap() {
        WorkflowError::MemoryLimit { needed, limit, .. } => assert!(needed > limit && limit == 1 << 20),
        other => panic!("{other}"),
    }
}
