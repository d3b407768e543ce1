//! The command `radiosity solve --lighting`: many lightings of one scene, all in the same passes over the form factors.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::args::SolveArgs;
use super::failure::Failure;
use super::run::Run;
use super::{Outcome, solution};
use crate::document::{LightingRecord, LightingsDocument, LitSurface, Quality, SolverRecord};
use crate::scene::{Lighting, Scene};
use crate::workflow::{FormFactorStudy, LightingStudy, Model, with_suffix};

/// The lightings of `solve`, with their outputs.
pub(super) struct Lightings {
    names: Vec<String>,
    outputs: Vec<Option<PathBuf>>,
    pub(super) all: Vec<Option<Lighting>>,
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

    pub(super) fn reflectance_max(&self) -> f64 {
        Lighting::greatest_reflectance(self.all.iter().flatten())
    }

    /// Returns the record of a lighting in the document.
    fn record(&self, model: &Model, lit: &LightingStudy) -> LightingRecord {
        let solution = &lit.study.solution;
        LightingRecord {
            name: self.names[lit.number].clone(),
            n_channels: solution.radiosity.n_channels(),
            energy: solution.energy.clone(),
            surfaces: LitSurface::of(model, solution),
            mesh_error: lit.study.mesh_error.clone(),
            output: self.outputs[lit.number].as_ref().map(|path| path.display().to_string()),
            quality: Quality::new(solution, lit.study.error),
        }
    }
}

pub(super) fn run(
    lightings: &Lightings,
    run: &mut Run,
    mut model: Model,
    computed: &FormFactorStudy,
    args: &SolveArgs,
) -> Result<Outcome, Failure> {
    let files: Vec<Option<PathBuf>> = args.lighting.iter().cloned().map(Some).collect();
    run.cx.settings.lightings = Some(lightings.names.clone());
    let (request, solver) = (args.solver.request(), args.solver.solver.as_str());
    let (mut records, mut of_each) = (Vec::new(), String::new());
    let each = (&lightings.all[..], &files[..]);
    let (solution, error) = model.solve_lightings(computed, each, &request, &mut run.cx, |model, lit, cx| {
        if let Some(path) = &lightings.outputs[lit.number] {
            let materials = (&lit.reflectance, &lit.exitance);
            cx.time("write", || {
                model.write_solution(path, Some(computed), materials, &lit.study, cx)
            })?;
        }
        records.push(lightings.record(model, &lit));
        let _ = writeln!(of_each, "\n{}:", lightings.names[lit.number]);
        solution::describe(&mut of_each, model, solver, &lit.study);
        Ok(())
    })?;
    run.bars.finish();
    let document = run.document_of(
        &model,
        LightingsDocument {
            solver: SolverRecord::new(&model, solver, &solution, error),
            form_factors: computed.into(),
            lightings: records,
        },
    );
    let mut text = run.explanation(&model);
    let (n_patches, n) = (model.mesh.n_patches(), lightings.names.len());
    let _ = writeln!(text, "{n_patches} patches, {n} lightings at once");
    run.describe_form_factors(&mut text, computed);
    text.push_str(&of_each);
    let code = solution::code(&solution, Some(computed), error);
    let written = lightings.outputs.iter().flatten();
    Ok(run.outcome(text, document, written, (code, args.audit.strict)))
}

/// Returns the names of the lightings: the files' names without directory and ending, which must differ.
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
