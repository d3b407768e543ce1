//! `radiosity solve --lighting`: many lightings of one scene, all in the same passes over the form factors.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::SolveArgs;
use super::failure::Failure;
use super::form_factors::{checks_to_json, describe_checks};
use super::pipeline::{Computed, Prepared, Run};
use super::{Outcome, output, solve};
use crate::matrix::operator::Block;
use crate::report::solution::SolutionReport;
use crate::scene::Lighting;
use crate::solver::Solution;

/// Channels of each lighting.
const N_CHANNELS: usize = 3;

pub(super) fn run(
    files: &[PathBuf],
    mut run: Run,
    mut prepared: Prepared,
    computed: &Computed,
    args: &SolveArgs,
) -> Result<Outcome, Failure> {
    let names = names(files)?;
    let outputs: Vec<Option<PathBuf>> = names
        .iter()
        .map(|name| args.output.as_deref().map(|path| with_suffix(path, name)))
        .collect();
    for path in outputs.iter().flatten() {
        output::expect_possible(path)?;
    }
    let n = prepared.mesh.n_patches();
    let mut reflectance = Block::zeros(n, N_CHANNELS * files.len());
    let mut exitance = reflectance.clone();
    for (k, file) in files.iter().enumerate() {
        let lighting = Lighting::load(file, &prepared.scene)?;
        for (i, patch) in prepared.mesh.patches.iter().enumerate() {
            let (rho, e) = lighting.of(&prepared.scene, patch.surface, patch.material);
            let own = N_CHANNELS * k..N_CHANNELS * (k + 1);
            reflectance.row_mut(i)[own.clone()].copy_from_slice(&rho);
            exitance.row_mut(i)[own].copy_from_slice(&e);
        }
    }
    run.set("lightings", json!(names));
    let blocks = (reflectance.clone(), exitance.clone());
    let areas = computed.factors.areas().to_vec();
    let solution = run.solve_system(
        (&mut prepared.plan, &prepared.mesh),
        (&computed.factors, areas),
        &args.solver,
        blocks,
    )?;
    let mut documents = Vec::new();
    let mut text = String::new();
    for (k, name) in names.iter().enumerate() {
        let of_lighting = |block: &Block| channels(block, k);
        let (rho, e) = (of_lighting(&reflectance), of_lighting(&exitance));
        let own = Solution {
            radiosity: of_lighting(&solution.radiosity),
            irradiance: of_lighting(&solution.irradiance),
            energy: solution.energy[N_CHANNELS * k..N_CHANNELS * (k + 1)].to_vec(),
            ..solution.clone()
        };
        if let Some(path) = &outputs[k] {
            let report = SolutionReport {
                scene: &prepared.scene,
                mesh: &prepared.mesh,
                reflectance: &rho,
                exitance: &e,
                solution: &own,
                settings: &run.settings,
            };
            run.times.time("write", || report.write(path))?;
        }
        documents.push(json!({
            "name": name,
            "energy": own.energy,
            "surfaces": prepared.surfaces_with_radiosity(&own),
            "output": outputs[k].as_ref().map(|path| path.display().to_string()),
        }));
        let _ = writeln!(text, "\n{name}:");
        solve::describe(&mut text, &prepared, &args.solver.solver, &own);
    }
    run.progress.finish();
    let mut result = solve::to_json(&prepared, &args.solver.solver, &solution);
    if let Value::Object(result) = &mut result {
        // Each lighting has its own.
        result.remove("surfaces");
        result.remove("energy");
    }
    result["lightings"] = json!(documents);
    result["form_factors"] = checks_to_json(computed);
    let document = run.document(&prepared, result);
    let mut printed = run.explanation(&prepared);
    let _ = writeln!(printed, "{n} patches, {} lightings at once", names.len());
    describe_checks(&mut printed, computed);
    printed.push_str(&text);
    run.describe_times(&mut printed);
    for path in outputs.iter().flatten() {
        let _ = writeln!(printed, "wrote {}", path.display());
    }
    Ok(Outcome {
        text: printed,
        document,
        code: solve::code(&solution, Some(computed)),
    })
}

/// Returns the names of the lightings: the files' names without directory and ending, no two alike.
fn names(files: &[PathBuf]) -> Result<Vec<String>, Failure> {
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
fn with_suffix(path: &Path, name: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let file = match path.extension() {
        Some(ending) => format!("{stem}-{name}.{}", ending.to_string_lossy()),
        None => format!("{stem}-{name}"),
    };
    path.with_file_name(file)
}

/// Returns the channels of the k-th lighting.
fn channels(block: &Block, k: usize) -> Block {
    let own = N_CHANNELS * k..N_CHANNELS * (k + 1);
    let rows = (0..block.n_rows()).flat_map(|i| block.row(i)[own.clone()].to_vec());
    Block::from_values(rows.collect(), N_CHANNELS)
}
