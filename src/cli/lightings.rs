//! `radiosity solve --lighting`: many lightings of one scene, all in the same passes over the form factors.

use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::SolveArgs;
use super::failure::Failure;
use super::form_factors::{checks_to_json, describe_checks};
use super::pipeline::{Computed, Prepared, Run};
use super::stated::Stated;
use super::{Outcome, merge, solve};
use crate::matrix::operator::Block;
use crate::mesh::Patch;
use crate::plan::Plan;
use crate::report::solution::SolutionReport;
use crate::scene::{Lighting, Scene};
use crate::solver::{ChannelQuality, Coarsened, Solution};

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
    pub(super) fn warn_of_darkness(&self, run: &mut Run, scene: &Scene, files: &[PathBuf]) {
        let files = files.iter().map(|file| Some(file.as_path()));
        let lightings: Vec<_> = files.zip(self.all.iter().map(Option::as_ref)).collect();
        run.warn_of_darkness(scene, &lightings);
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
    mut prepared: Prepared,
    computed: &Computed,
    args: &SolveArgs,
) -> Result<Outcome, Failure> {
    let Lightings { names, outputs, all } = lightings;
    let n = prepared.mesh.n_patches();
    let stack = Stack::new(&prepared, all);
    let files: Vec<Option<PathBuf>> = args.lighting.iter().cloned().map(Some).collect();
    stack.announce(run, &mut prepared.plan, &files);
    run.set("lightings", json!(names));
    let blocks = (stack.reflectance.clone(), stack.exitance.clone());
    let areas = computed.factors.areas().to_vec();
    let solution = run.solve_system(
        (&mut prepared.plan, &prepared.mesh),
        (&computed.factors, areas),
        &args.solver,
        blocks,
        computed.known(),
    )?;
    let coarse = run.coarsened(&prepared, computed, &stack.reflectance, &solution)?;
    let row_sums = computed.factors.row_sums();
    let mut documents = Vec::new();
    let mut text = String::new();
    let mut worst = Stated::Relative(0.0);
    for (k, name) in names.iter().enumerate() {
        let (rho, e) = stack.materials(k);
        let own = stack.solution(k, &solution);
        let error = run.carried_error(computed, (&rho, &e), &own)?;
        let own_coarse = coarse.as_ref().map(|coarse| stack.coarsened(k, coarse));
        let mesh_error = run.mesh_error(&prepared, own_coarse.as_ref(), (&e, &own));
        let stated = run.stated(&prepared, error.as_ref(), &own);
        worst = worst.or_worse(stated);
        if let Some(path) = &outputs[k] {
            let report = SolutionReport {
                scene: &prepared.scene,
                mesh: &prepared.mesh,
                reflectance: &rho,
                exitance: &e,
                solution: &own,
                error: error.as_ref(),
                row_sums: Some(&row_sums),
                settings: &run.settings,
            };
            run.times.time("write", || report.write(path))?;
        }
        let mut document = json!({
            "name": name,
            "n_channels": own.radiosity.n_channels(),
            "energy": own.energy,
            "surfaces": prepared.surfaces_with_radiosity(&own),
            "mesh_error": mesh_error,
            "output": outputs[k].as_ref().map(|path| path.display().to_string()),
        });
        merge(&mut document, solve::quality_to_json(&own, stated));
        documents.push(document);
        let _ = writeln!(text, "\n{name}:");
        let solver = &args.solver.solver;
        solve::describe(&mut text, &prepared, (solver, mesh_error.as_ref()), &own, stated);
    }
    run.progress.finish();
    let mut result = solve::to_json(&prepared, &args.solver.solver, &solution, worst);
    if let Value::Object(result) = &mut result {
        // Each lighting has its own.
        result.remove("surfaces");
        result.remove("energy");
    }
    result["lightings"] = json!(documents);
    result["form_factors"] = checks_to_json(computed);
    let document = run.document_of(&prepared, result);
    let mut printed = run.explanation(&prepared);
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
        code: run.judged(solve::code(&solution, Some(computed), worst), args.audit.strict),
    })
}

/// Many lightings side by side, as channels of one system.
pub(super) struct Stack {
    channels: Vec<Range<usize>>,
    pub(super) reflectance: Block,
    pub(super) exitance: Block,
}

impl Stack {
    /// `None` is the lighting of the scene itself.
    pub(super) fn new(prepared: &Prepared, lightings: &[Option<Lighting>]) -> Self {
        let scene = &prepared.scene;
        let plain = |patch: &Patch| {
            let material = &scene.materials[patch.material.0 as usize];
            (material.reflectance, material.exitance)
        };
        let mut materials = Vec::new();
        let mut channels: Vec<Range<usize>> = Vec::new();
        let mut n_channels = 0;
        for lighting in lightings {
            let of_patch = |patch: &Patch| match lighting {
                Some(lighting) => lighting.of(scene, patch.surface, patch.material),
                None => plain(patch),
            };
            let of_patches: Vec<_> = prepared.mesh.patches.iter().map(of_patch).collect();
            // What is grey everywhere takes a third of the time in one channel.
            let grey = of_patches.iter().all(|(rho, e)| is_grey(rho) && is_grey(e));
            let own = n_channels..n_channels + if grey { 1 } else { 3 };
            n_channels = own.end;
            channels.push(own);
            materials.push(of_patches);
        }
        let mut reflectance = Block::zeros(prepared.mesh.n_patches(), n_channels);
        let mut exitance = reflectance.clone();
        for (own, of_patches) in channels.iter().zip(&materials) {
            for (i, (rho, e)) in of_patches.iter().enumerate() {
                reflectance.row_mut(i)[own.clone()].copy_from_slice(&rho[..own.len()]);
                exitance.row_mut(i)[own.clone()].copy_from_slice(&e[..own.len()]);
            }
        }
        Self {
            channels,
            reflectance,
            exitance,
        }
    }

    /// Returns ρ and E of lighting `k`.
    pub(super) fn materials(&self, k: usize) -> (Block, Block) {
        let own = |block| channels_of(block, &self.channels[k]);
        (own(&self.reflectance), own(&self.exitance))
    }

    /// Returns what of the coarser mesh of all lightings belongs to lighting `k`.
    pub(super) fn coarsened(&self, k: usize, all: &Coarsened) -> Coarsened {
        let own = |block| channels_of(block, &self.channels[k]);
        Coarsened {
            change: own(&all.change),
            spread: own(&all.spread),
            ..*all
        }
    }

    /// Tells the plan how many channels there are, and later messages which of the lightings' files each of them is from.
    pub(super) fn announce(&self, run: &mut Run, plan: &mut Plan, files: &[Option<PathBuf>]) {
        plan.revise_channels(self.reflectance.n_channels());
        let of_each = self.channels.iter().zip(files);
        let repeated = of_each.flat_map(|(own, file)| own.clone().map(|_| file.clone()));
        run.lighting_files = repeated.collect();
    }

    /// Returns what of the solution of all lightings belongs to lighting `k`. The passes, and what happened in them, are those of all together.
    pub(super) fn solution(&self, k: usize, all: &Solution) -> Solution {
        let own = &self.channels[k];
        let channels = all.channels[own.clone()].to_vec();
        let quality = ChannelQuality::of_all(&channels, all.stop_reason);
        Solution {
            radiosity: channels_of(&all.radiosity, own),
            irradiance: channels_of(&all.irradiance, own),
            energy: all.energy[own.clone()].to_vec(),
            stop_reason: quality.stop_reason,
            residual_l2: quality.residual_l2,
            residual_max_power: quality.residual_max_power,
            error_bound: quality.error_bound,
            channels,
            ..all.clone()
        }
    }
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

/// Tells whether all three channels are the same.
fn is_grey(rgb: &[f64; 3]) -> bool {
    rgb.iter().all(|value| value.to_bits() == rgb[0].to_bits())
}

/// Returns some channels of a block.
fn channels_of(block: &Block, own: &Range<usize>) -> Block {
    let rows = (0..block.n_rows()).flat_map(|i| &block.row(i)[own.clone()]);
    Block::from_values(rows.copied().collect(), own.len())
}
