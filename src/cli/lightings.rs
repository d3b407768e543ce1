//! `radiosity solve --lighting`: many lightings of one scene, all in the same passes over the form factors.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::SolveArgs;
use super::checks::{checks_to_json, describe_checks};
use super::failure::Failure;
use super::run::Run;
use super::surfaces::surfaces_with_radiosity;
use super::{Outcome, merge, solution};
use crate::matrix::operator::LinearOperator;
use crate::report::solution::SolutionReport;
use crate::scene::{Lighting, Scene};
use crate::workflow::{FormFactorStudy, Model, Stack, TotalError};

/// The lightings of `solve`, with what is written for each.
pub(super) struct Lightings {
    names: Vec<String>,
    outputs: Vec<Option<PathBuf>>,
    all: Vec<Option<Lighting>>,
}

impl Lightings {
    pub(super) fn load(args: &SolveArgs, scene: &Scene) -> Result<Self, Failure> {
        let names = names(&args.lighting)?;
        let with_name = |name: &String| args.output.as_deref().map(|path| with_suffix(path, name));
        let outputs: Vec<Option<PathBuf>> = names.iter().map(with_name).collect();
        let mut all = Vec::new();
        for file in &args.lighting {
            all.push(Some(Lighting::load(file, scene)?));
        }
        Ok(Self { names, outputs, all })
    }

    /// Warns of lightings in which no face emits light; `files` are theirs.
    pub(super) fn warn_of_darkness(&self, run: &mut Run, model: &Model, files: &[PathBuf]) {
        let files = files.iter().map(|file| Some(file.as_path()));
        let lightings: Vec<_> = files.zip(self.all.iter().map(Option::as_ref)).collect();
        run.warn_of_darkness(model, &lightings);
    }

    pub(super) fn reflectance_max(&self) -> f64 {
        greatest_reflectance(self.all.iter().flatten())
    }
}

/// Returns the greatest reflectance that any of the lightings gives to anything.
pub(super) fn greatest_reflectance<'a>(lightings: impl Iterator<Item = &'a Lighting>) -> f64 {
    lightings.map(Lighting::reflectance_max).fold(0.0, f64::max)
}

pub(super) fn run(
    lightings: &Lightings,
    run: &mut Run,
    mut model: Model,
    computed: &FormFactorStudy,
    args: &SolveArgs,
) -> Result<Outcome, Failure> {
    let Lightings { names, outputs, all } = lightings;
    let n = model.mesh.n_patches();
    let stack = Stack::new(&model, all);
    let files: Vec<Option<PathBuf>> = args.lighting.iter().cloned().map(Some).collect();
    stack.announce(&mut model, &files, &mut run.cx);
    run.cx.set("lightings", json!(names));
    let blocks = (stack.reflectance.clone(), stack.exitance.clone());
    let areas = computed.factors.areas().to_vec();
    let system = (&computed.factors as &dyn LinearOperator, areas);
    let request = args.solver.request();
    let solution = model.solve_system(system, &request, blocks, computed.known(), &mut run.cx)?;
    let coarse = model.coarsened(computed, &stack.reflectance, &solution, &run.cx)?;
    let row_sums = computed.factors.row_sums();
    let mut documents = Vec::new();
    let mut text = String::new();
    let mut worst = TotalError::Relative(0.0);
    for (k, name) in names.iter().enumerate() {
        let (rho, e) = stack.materials(k);
        let own = stack.solution(k, &solution);
        let error = computed.carried_error((&rho, &e), &own, &run.cx)?;
        let own_coarse = coarse.as_ref().map(|coarse| stack.coarsened(k, coarse));
        let mesh_error = model.mesh_error(own_coarse.as_ref(), (&e, &own), &run.cx);
        let stated = TotalError::of(&model, error.as_ref(), &own, &run.cx);
        worst = worst.or_worse(stated);
        if let Some(path) = &outputs[k] {
            let report = SolutionReport {
                sun: None,
                scene: &model.scene,
                mesh: &model.mesh,
                reflectance: &rho,
                exitance: &e,
                solution: &own,
                error: error.as_ref(),
                row_sums: Some(&row_sums),
                settings: &run.cx.settings,
            };
            run.cx.time("write", || report.write(path))?;
        }
        let mut document = json!({
            "name": name,
            "n_channels": own.radiosity.n_channels(),
            "energy": own.energy,
            "surfaces": surfaces_with_radiosity(&model, &own),
            "mesh_error": mesh_error,
            "output": outputs[k].as_ref().map(|path| path.display().to_string()),
        });
        merge(&mut document, solution::quality_to_json(&own, stated));
        documents.push(document);
        let _ = writeln!(text, "\n{name}:");
        let solver = &args.solver.solver;
        solution::describe(&mut text, &model, (solver, mesh_error.as_ref()), &own, stated);
    }
    run.bars.finish();
    let mut result = solution::to_json(&model, &args.solver.solver, &solution, worst);
    if let Value::Object(result) = &mut result {
        // Each lighting has its own.
        result.remove("surfaces");
        result.remove("energy");
    }
    result["lightings"] = json!(documents);
    result["form_factors"] = checks_to_json(computed);
    let document = run.document_of(&model, result);
    let mut printed = run.explanation(&model);
    let _ = writeln!(printed, "{n} patches, {} lightings at once", names.len());
    describe_checks(&mut printed, computed);
    printed.push_str(&text);
    run.describe_audit(&mut printed);
    run.describe_times(&mut printed);
    for path in outputs.iter().flatten() {
        let _ = writeln!(printed, "wrote {}", path.display());
    }
    Ok(Outcome {
        text: printed,
        document,
        code: run.judged(solution::code(&solution, Some(computed), worst), args.audit.strict),
    })
}

/// Returns the names of the lightings: the files' names without directory and ending, no two alike.
pub(super) fn names(files: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let mut names: Vec<String> = Vec::new();
    for file in files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if names.contains(&name) {
            return Err(Failure::usage(format!(
                "two lightings are called `{name}`; rename one of the files"
            )));
        }
        names.push(name);
    }
    Ok(names)
}

/// Returns `B-NAME.csv` for `B.csv`.
pub(super) fn with_suffix(path: &Path, name: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let file = match path.extension() {
        Some(ending) => format!("{stem}-{name}.{}", ending.to_string_lossy()),
        None => format!("{stem}-{name}"),
    };
    path.with_file_name(file)
}
