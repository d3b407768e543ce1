//! The stages that several commands share, each one call into the library, timed and told to the progress bar.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::args::{BalanceName, CommonArgs, MeshArgs, MethodArgs, SolverArgs, StorageName};
use super::failure::Failure;
use super::progress::Bars;
use super::storage::{self, Storage};
use super::{SCHEMA_VERSION, warn};
use crate::form_factor::registry::{self, MethodEntry, Setting};
use crate::form_factor::{ExactMethod, FormFactorMethod, Input, MethodSettings, PairCounts};
use crate::matrix::operator::{Block, LinearOperator};
use crate::matrix::{BalanceReport, Checks, FormFactors, Weighting};
use crate::mesh::{Hierarchy, Mesh, Patch, Subdivision};
use crate::plan::Plan;
use crate::report::{StageTimes, memory_peak_byte};
use crate::scene::{LoadOptions, Material, Scene, Surface, load_with};
use crate::solver::registry::SolverEntry;
use crate::solver::{self, RadiositySystem, Solution, SolveOptions, SolverSettings, StopReason, Tolerance};
use crate::visibility::Visibility as _;
use crate::visibility::blockers::BlockerIndex;
use crate::visibility::embree::EmbreeVisibility;
use crate::visibility::gaps::narrowest_gap;

/// A run of one command: settings, clock, progress.
pub(super) struct Run {
    pub(super) command: &'static str,
    pub(super) common: CommonArgs,
    pub(super) times: StageTimes,
    pub(super) progress: Bars,
    pub(super) settings: serde_json::Map<String, Value>,
    pub(super) storage: Storage,
    has_looked_at_gaps: bool,
}

/// A scene with its patches, ready for ray queries.
pub(super) struct Prepared {
    pub(super) scene: Scene,
    pub(super) plan: Plan,
    pub(super) mesh: Mesh,
    pub(super) visibility: EmbreeVisibility,
}

/// Form factors with what was found out about them.
pub(super) struct Computed {
    pub(super) factors: FormFactors,
    pub(super) checks: Checks,
    pub(super) balance: Option<BalanceReport>,
    pub(super) closed: bool,
    pub(super) pairs: Option<PairCounts>,
    pub(super) tolerance_met: bool,
}

/// A method with what is known of its matrix.
pub(super) struct Chosen {
    pub(super) method: Box<dyn FormFactorMethod>,
    /// True if it computes whole rows.
    by_rows: bool,
    /// The most entries that a row can have, where the settings tell.
    n_entries: Option<u64>,
}

/// How finely form factors are computed, as far as commands differ in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fineness {
    /// Rays for each patch unless `--rays` says otherwise.
    pub(super) default_rays: u64,
    /// The tolerance asked for, or the command's own.
    pub(super) tolerance: Option<f64>,
    /// What is taken where none is asked for, by methods that have a tolerance.
    pub(super) default_tolerance: f64,
    /// What it is called among the settings.
    pub(super) tolerance_name: &'static str,
}

impl Fineness {
    fn tolerance_for(self, entry: &MethodEntry) -> Option<f64> {
        let has_one = entry.settings.iter().any(|s| matches!(s, Setting::Tolerance(_)));
        self.tolerance.or(has_one.then_some(self.default_tolerance))
    }
}

/// Says how visibility is found by exact clipping.
fn explain_exact(prepared: &mut Prepared, fineness: Fineness) {
    let tolerance = fineness.tolerance.unwrap_or(fineness.default_tolerance);
    let plan = &mut prepared.plan;
    if !plan.convex_and_empty {
        let n = BlockerIndex::new(&prepared.scene).n_blockers();
        plan.revise(
            "visibility",
            format!("exact clipping against {n} blockers"),
            "a vertex lies behind the plane of a face: something may block; flat neighbours count as one blocker",
        );
        let reason = if fineness.tolerance.is_some() {
            "as asked for"
        } else if tolerance > ExactMethod::DEFAULT_TOLERANCE {
            "the size of the patches weighs more in a picture than this"
        } else {
            "the default"
        };
        plan.decide("form-factor tolerance", format!("{tolerance:e}"), reason);
    }
}

/// Returns the greatest error of A_i F_ij / min(A_i, A_j).
fn worst_error(factors: &FormFactors) -> f64 {
    let areas = factors.areas();
    let mut worst = 0.0_f64;
    for (i, area) in areas.iter().enumerate() {
        factors.for_each_in_row(i, |j, _, error| worst = worst.max(error * area / area.min(areas[j])));
    }
    worst
}

/// Row sums are restored to far below the noise, or as far as so many passes go.
const BALANCE_TOLERANCE: f64 = 1e-10;
const BALANCE_PASSES: usize = 200;

impl Run {
    pub(super) fn new(command: &'static str, common: &CommonArgs) -> Self {
        Self {
            command,
            common: common.clone(),
            times: StageTimes::default(),
            progress: Bars::new(common.quiet),
            settings: serde_json::Map::new(),
            storage: Storage::default(),
            has_looked_at_gaps: false,
        }
    }

    pub(super) fn warn(&self, message: &str) {
        if !self.common.quiet {
            self.progress.finish();
            warn(message);
        }
    }

    pub(super) fn set(&mut self, name: &str, value: impl Into<Value>) {
        self.settings.insert(name.to_owned(), value.into());
    }

    /// Reads a scene, cuts it into patches and builds the ray tracer's tree.
    pub(super) fn prepare(
        &mut self,
        path: &Path,
        mesh_args: MeshArgs,
        default: impl FnOnce(&Scene) -> Subdivision,
    ) -> Result<Prepared, Failure> {
        let options = LoadOptions::default().allow_outside(self.common.allow_outside);
        let loaded = self.times.time("scene", || load_with(path, options))?;
        for warning in &loaded.warnings {
            self.warn(&warning.to_string());
        }
        self.prepare_scene(path, loaded.scene, mesh_args, default)
    }

    /// Cuts a scene into patches and builds the ray tracer's tree; `path` is what messages call it.
    pub(super) fn prepare_scene(
        &mut self,
        path: &Path,
        scene: Scene,
        mesh_args: MeshArgs,
        default: impl FnOnce(&Scene) -> Subdivision,
    ) -> Result<Prepared, Failure> {
        let plan = self.times.time("plan", || Plan::new(&scene));
        let subdivision = mesh_args.subdivision(default(&scene));
        match subdivision {
            Subdivision::Uniform(n) => self.set("subdivide", n),
            Subdivision::MaxEdge(length) => self.set("max_edge_m", length),
        }
        let mesh = self
            .times
            .time("mesh", || Mesh::new(&scene, subdivision))
            .map_err(|error| Failure::new("mesh", format!("{}: {error}", path.display())).in_file(path))?;
        let visibility = self
            .times
            .time("ray_tracer", || EmbreeVisibility::new(&scene))
            .map_err(|error| Failure::new("embree", error.to_string()))?;
        if let Some(&face) = visibility.vanished_faces().first() {
            self.warn(&format!(
                "{}:{}: this face and {} more are too small, beside the size of the scene, for rays to hit them",
                path.display(),
                scene.faces[face.0 as usize].line,
                visibility.vanished_faces().len() - 1
            ));
        }
        Ok(Prepared {
            scene,
            plan,
            mesh,
            visibility,
        })
    }

    /// Computes form factors, makes them symmetric where that is asked for, and checks them.
    pub(super) fn form_factors(
        &mut self,
        prepared: &mut Prepared,
        args: &MethodArgs,
        fineness: Fineness,
        needs_symmetry: bool,
    ) -> Result<Computed, Failure> {
        let Chosen {
            method,
            by_rows,
            n_entries,
        } = self.method(args, fineness)?;
        if method.name() == "exact" {
            if self.common.explain {
                explain_exact(prepared, fineness);
            }
            let nothing = "rays between patches: nothing here is sampled".into();
            prepared.plan.left_out.push(nothing);
        }
        let needs_symmetry = self.wants_symmetry(args.balance)? || needs_symmetry;
        let matrix = storage::Matrix {
            by_rows,
            repaired: repairs(args.balance, needs_symmetry && by_rows),
            n_entries: n_entries.unwrap_or(u64::MAX),
        };
        let chosen = storage::choose(self, prepared, matrix)?;
        let input = Input {
            scene: &prepared.scene,
            unoccluded: prepared.plan.convex_and_empty,
            mesh: &prepared.mesh,
            visibility: &prepared.visibility,
        };
        let result = self.times.time("form_factors", || {
            method.compute(input, chosen.choice(), &self.progress)
        })?;
        let of_pairs = result.pairs.map_or(0, |pairs| pairs.n_rays);
        if of_pairs > 0 || result.factors.tallies().iter().any(|tally| tally.n_rays > 0) {
            self.warn_of_narrow_gaps(prepared);
        }
        if let Some(pairs) = result.pairs.filter(|pairs| pairs.n_above_tolerance > 0) {
            self.warn(&format!(
                "{} pairs of patches spent their budget above the tolerance; the worst error is {:.1e}; give a greater --budget or --{}",
                pairs.n_above_tolerance,
                worst_error(&result.factors),
                fineness.tolerance_name.replace('_', "-")
            ));
        }
        self.repaired(prepared, result, args.balance, needs_symmetry)
    }

    /// Warns if rays start too far off the faces to see what lies in the narrowest gap.
    pub(super) fn warn_of_narrow_gaps(&mut self, prepared: &Prepared) {
        if std::mem::replace(&mut self.has_looked_at_gaps, true) {
            return;
        }
        let (scene, offset) = (&prepared.scene, prepared.visibility.offset());
        let Some(gap) = narrowest_gap(scene, offset) else {
            return;
        };
        let [first, second] = gap.faces.map(|id| {
            let face = &scene.faces[id.0 as usize];
            let name = &scene.surfaces[face.surface.0 as usize].name;
            format!("`{name}` (line {})", face.line)
        });
        self.warn(&format!(
            "{first} and {second} are {:.2e} m apart, and rays start {offset:.2e} m off a face: light between them is lost or blurred; \
             use a method without rays, or model the gap in a scene of its own",
            gap.width
        ));
    }

    /// Makes form factors symmetric where that is asked for, and checks them.
    pub(super) fn repaired(
        &mut self,
        prepared: &mut Prepared,
        result: crate::form_factor::Computed,
        asked: BalanceName,
        needs_symmetry: bool,
    ) -> Result<Computed, Failure> {
        let raw = result.factors;
        let n_rays: u64 = raw.tallies().iter().map(|t| t.n_rays).sum();
        let n_escaped: u64 = raw.tallies().iter().map(|t| t.n_escaped).sum();
        // A scene that no light leaves is closed, whether its faces show it or not.
        let closed = prepared.plan.watertight || (n_rays > 0 && n_escaped == 0);
        if prepared.plan.watertight && n_escaped > 0 {
            self.warn(&format!(
                "{n_escaped} of {n_rays} rays escaped from a closed scene; the row sums show what that amounts to"
            ));
        }
        let wanted = repairs(asked, needs_symmetry && !raw.is_symmetric());
        let by_variance = asked == BalanceName::Closure;
        self.set("balance", if by_variance { json!("closure") } else { json!(wanted) });
        let plan = &mut prepared.plan;
        if plan.convex_and_empty && result.pairs.is_some() && self.settings.get("method") != Some(&json!("exact")) {
            plan.left_out.push("rays between patches: nothing can block".into());
        }
        let (factors, balance) = if wanted {
            let targets = raw.row_targets(closed);
            let (factors, report) = self.times.time("balance", || {
                let symmetric = raw.symmetrised(Weighting::default())?;
                if by_variance {
                    symmetric.closed(&targets, BALANCE_TOLERANCE, BALANCE_PASSES)
                } else {
                    symmetric.balanced(&targets, BALANCE_TOLERANCE, BALANCE_PASSES)
                }
            })?;
            let how = if by_variance {
                "the defect of the row sums spread by the entries' variances"
            } else {
                "rows rescaled symmetrically"
            };
            plan.decide(
                "reciprocity",
                "restored",
                format!(
                    "each pair averaged with its reverse, {how} in {} passes",
                    report.n_passes
                ),
            );
            (factors, Some(report))
        } else {
            let reason = if raw.is_symmetric() && asked == BalanceName::Auto {
                "they are symmetric as they are"
            } else {
                "no symmetric system is needed"
            };
            plan.left_out.push(format!("balancing of the form factors: {reason}"));
            (raw, None)
        };
        if let Some(report) = balance.filter(|report| !report.converged) {
            self.warn(&format!(
                "rebalancing left row sums off by up to {:.1e} after {} passes",
                report.row_error_max, report.n_passes
            ));
        }
        let checks = self.times.time("checks", || factors.checks(closed));
        factors.if_readable(())?;
        Ok(Computed {
            factors,
            checks,
            balance,
            closed,
            pairs: result.pairs,
            tolerance_met: result.tolerance_met,
        })
    }

    /// Tells whether the storage asked for is that of symmetric form factors.
    pub(super) fn wants_symmetry(&self, balance: BalanceName) -> Result<bool, Failure> {
        let wanted = self.storage.args.storage == StorageName::Symmetric;
        if wanted && balance == BalanceName::Off {
            return Err(Failure::usage(
                "--storage symmetric makes form factors symmetric, and --balance off keeps them as they are; leave one of them out",
            ));
        }
        Ok(wanted)
    }

    pub(super) fn method(&mut self, args: &MethodArgs, fineness: Fineness) -> Result<Chosen, Failure> {
        let entry = registry::by_name(&args.method)?;
        // The direct pass of a render takes its numbers from there too.
        let sequence_is_elsewhere = self.command == "render" && !entry.settings.contains(&Setting::Sequence);
        let settings = entry.resolve(&MethodSettings {
            rays: args.rays.or(entry.shoots().then_some(fineness.default_rays)),
            points: args.points,
            resolution: args.resolution,
            normalise: args.normalise,
            sequence: args.sequence.filter(|_| !sequence_is_elsewhere).map(Into::into),
            tolerance: fineness.tolerance_for(entry),
            budget: args.budget,
            seed: args.seed,
        })?;
        self.set("method", entry.name);
        self.set("seed", args.seed);
        if let Some(rays) = settings.rays {
            self.set("rays", rays);
        }
        if let Some(points) = settings.points {
            self.set("points", points.get());
        }
        if let Some(resolution) = settings.resolution {
            self.set("resolution", resolution.get());
        }
        if entry.settings.contains(&Setting::Normalise) {
            self.set("normalise", settings.normalise);
        }
        if let Some(sequence) = settings.sequence {
            self.set("sequence", json!(sequence));
        }
        if let Some(tolerance) = settings.tolerance {
            self.set(fineness.tolerance_name, tolerance);
        }
        if let Some(budget) = settings.budget {
            self.set("budget", budget.get());
        }
        let by_rows = entry.by_rows() || settings.normalise;
        let n_entries = settings.rays.filter(|_| entry.shoots());
        Ok(Chosen {
            method: entry.build(&settings),
            by_rows,
            n_entries,
        })
    }

    /// Returns the solver that is asked for; settings that it has no use for are a usage error.
    pub(super) fn solver_entry(&self, args: &SolverArgs) -> Result<&'static SolverEntry, Failure> {
        let entry = solver::registry::by_name(&args.solver)?;
        entry.checked(&self.solver_settings(args, entry))?;
        Ok(entry)
    }

    /// Returns the settings that the flags give a solver.
    fn solver_settings(&self, args: &SolverArgs, entry: &SolverEntry) -> SolverSettings {
        SolverSettings {
            omega: args.omega,
            bounds: args.bounds.map(Into::into),
            steps_per_pass: args.steps_per_pass,
            display: args.display_ambient,
            restart: args.restart,
            depth: args.depth,
            // The flag is the storage's too; solvers that need no memory to speak of pass over it.
            memory_limit_byte: self
                .storage
                .args
                .memory_limit
                .filter(|_| entry.settings.contains(&solver::registry::Setting::MemoryLimit)),
            ..SolverSettings::default()
        }
    }

    /// Solves the radiosity system of a scene.
    pub(super) fn solve(
        &mut self,
        prepared: &mut Prepared,
        computed: &Computed,
        args: &SolverArgs,
    ) -> Result<Solution, Failure> {
        let (reflectance, exitance) = materials_of_patches(&prepared.scene, &prepared.mesh, prepared.plan.n_channels);
        let areas = computed.factors.areas().to_vec();
        self.solve_system(
            (&mut prepared.plan, &prepared.mesh),
            (&computed.factors, areas),
            args,
            (reflectance, exitance),
        )
    }

    /// Solves for given form factors and areas, reflectances and exitances of the patches.
    pub(super) fn solve_system(
        &mut self,
        (plan, mesh): (&mut Plan, &Mesh),
        (factors, areas): (&dyn LinearOperator, Vec<f64>),
        args: &SolverArgs,
        (reflectance, exitance): (Block, Block),
    ) -> Result<Solution, Failure> {
        let entry = self.solver_entry(args)?;
        let hierarchy = entry.uses_hierarchy().then(|| {
            let hierarchy = self.times.time("levels", || Hierarchy::of_mesh(mesh));
            let sizes: Vec<String> = hierarchy.sizes().iter().map(ToString::to_string).collect();
            plan.decide(
                "levels",
                sizes.join(", "),
                "patches of the mesh, the finest level first",
            );
            Arc::new(hierarchy)
        });
        let solver = entry.checked(&SolverSettings {
            hierarchy,
            ..self.solver_settings(args, entry)
        })?;
        self.set("solver", entry.name);
        self.set("tolerance", args.tolerance);
        self.set("max_passes", args.max_passes);
        self.set("start", json!(args.start));
        let system = RadiositySystem::new(factors, areas, reflectance, exitance)?;
        let options = SolveOptions {
            tolerance: Tolerance::ResidualL2(args.tolerance),
            max_passes: args.max_passes,
            start: args.start.into(),
            ..SolveOptions::default()
        };
        for (name, value) in [
            ("omega", args.omega.map(Value::from)),
            ("bounds", args.bounds.map(|bounds| json!(bounds))),
            ("steps_per_pass", args.steps_per_pass.map(|n| Value::from(n.get()))),
            ("display_ambient", args.display_ambient.then_some(Value::Bool(true))),
        ] {
            if let Some(value) = value {
                self.set(name, value);
            }
        }
        let mut solution = self.times.time("solve", || {
            solver.solve(&system, &options, &mut |_| std::ops::ControlFlow::Continue(()))
        })?;
        if args.display_ambient
            && let Some(display) = solution.display.take()
        {
            // The picture's irradiance belongs to what it shows; residual and bound stay those of the solution.
            factors.apply(&display, &mut solution.irradiance);
            solution.radiosity = display;
        }
        if let Some(choice) = &solution.choice {
            plan.decide("solver", choice.solver, choice.why.clone());
        }
        if solution.stop_reason != StopReason::Converged {
            self.warn(&format!(
                "the solver stopped without converging ({}) at a relative residual of {:.3e}",
                solution.stop_reason, solution.residual_l2
            ));
        }
        Ok(solution)
    }

    /// Returns the text of `--explain`, or nothing.
    pub(super) fn explanation(&self, prepared: &Prepared) -> String {
        let mut text = String::new();
        if self.common.explain {
            for decision in &prepared.plan.decisions {
                let _ = writeln!(text, "{}: {} ({})", decision.subject, decision.choice, decision.reason);
            }
            for item in &prepared.plan.left_out {
                let _ = writeln!(text, "left out: {item}");
            }
            let _ = writeln!(text);
        }
        text
    }

    /// Adds the line that says where the time went.
    pub(super) fn describe_times(&self, text: &mut String) {
        let total = self.times.total_s();
        let _ = write!(text, "{total:.2} s:");
        for (k, (name, seconds)) in self.times.iter().filter(|(_, s)| *s >= 0.005 * total).enumerate() {
            let comma = if k == 0 { "" } else { "," };
            let _ = write!(text, "{comma} {} {seconds:.2} s", name.replace('_', " "));
        }
        let _ = writeln!(text);
    }

    /// Returns the parts that every document has, with `result` merged in.
    pub(super) fn document(&self, prepared: &Prepared, result: Value) -> Value {
        let mut document = json!({
            "schema_version": SCHEMA_VERSION,
            "command": self.command,
            "version": env!("CARGO_PKG_VERSION"),
            "settings": self.settings,
            "stages": self.times.to_json(),
            "total_s": self.times.total_s(),
            "memory_peak_byte": memory_peak_byte(),
            "left_out": prepared.plan.left_out,
        });
        if self.common.explain {
            document["decisions"] = json!(prepared.plan.decisions);
        }
        if let (Value::Object(all), Value::Object(more)) = (&mut document, result) {
            all.extend(more);
        }
        document
    }
}

/// Tells whether form factors are made symmetric and balanced.
pub(super) fn repairs(asked: BalanceName, needed: bool) -> bool {
    match asked {
        BalanceName::On | BalanceName::Closure => true,
        BalanceName::Off => false,
        BalanceName::Auto => needed,
    }
}

impl Prepared {
    /// Returns the area of each surface, in m².
    pub(super) fn surface_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.scene.surfaces.len()];
        for patch in &self.mesh.patches {
            areas[patch.surface.0 as usize] += patch.area;
        }
        areas
    }

    /// Returns the area mean of `per_patch` over each surface, per channel.
    pub(super) fn surface_means(&self, per_patch: &Block) -> Vec<Vec<f64>> {
        let mut means = vec![vec![0.0; per_patch.n_channels()]; self.scene.surfaces.len()];
        for (i, patch) in self.mesh.patches.iter().enumerate() {
            for (mean, value) in means[patch.surface.0 as usize].iter_mut().zip(per_patch.row(i)) {
                *mean += patch.area * value;
            }
        }
        for (mean, area) in means.iter_mut().zip(self.surface_areas()) {
            // A surface whose faces were all skipped has no area and no mean but 0.
            if area > 0.0 {
                for value in mean {
                    *value /= area;
                }
            }
        }
        means
    }

    /// Returns name, area and number of patches of each surface.
    pub(super) fn surfaces_to_json(&self) -> Value {
        let mut n_patches = vec![0u64; self.scene.surfaces.len()];
        for patch in &self.mesh.patches {
            n_patches[patch.surface.0 as usize] += 1;
        }
        let areas = self.surface_areas();
        let surface =
            |(k, s): (usize, &Surface)| json!({"name": s.name, "area_m2": areas[k], "n_patches": n_patches[k]});
        self.scene.surfaces.iter().enumerate().map(surface).collect()
    }

    /// Returns name, area and mean radiosity of each surface.
    pub(super) fn surfaces_with_radiosity(&self, solution: &Solution) -> Value {
        let means = self.surface_means(&solution.radiosity);
        let mut surfaces = self.surfaces_to_json();
        for (surface, mean) in surfaces.as_array_mut().into_iter().flatten().zip(means) {
            surface["radiosity"] = json!(mean);
        }
        surfaces
    }
}

/// Returns ρ and E of every patch, in one channel where all are grey, else in three.
pub(super) fn materials_of_patches(scene: &Scene, mesh: &Mesh, n_channels: usize) -> (Block, Block) {
    let collect = |value: fn(&Material) -> [f64; 3]| {
        let of_patch = |patch: &Patch| value(&scene.materials[patch.material.0 as usize]);
        let values = mesh
            .patches
            .iter()
            .flat_map(|p| of_patch(p).into_iter().take(n_channels));
        Block::from_values(values.collect(), n_channels)
    };
    (collect(|m| m.reflectance), collect(|m| m.exitance))
}
