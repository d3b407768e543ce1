//! The tables, line by line, beside the paper's and the expected ones.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::ops::ControlFlow;
use std::sync::Arc;

use serde::Serialize;

use super::by_levels::{ByLevels, product_by_levels};
use super::figure_2::{VARIANTS, Variant, VariantRun, run_variant};
use super::model::Room;
use super::printed::{
    EXPECTED, GAUSS_SEIDEL_RESIDUALS, JACOBI_CYCLES, MULTIGRID_RESIDUALS, PLUS_SIGN_CYCLES, TABLE_2, WALL_MEANS,
};
use super::{LEVEL_MAX, TOLERANCE};
use crate::experiment::ExperimentError;
use crate::experiment::statistics::Spread;
use crate::matrix::{FormFactors, Precision};
use crate::mesh::Prolongation;
use crate::progress::Progress;
use crate::solver::{
    CoarseMatrices, Coarsest, Defect, GaussSeidel, Multigrid, RadiositySystem, Solution, SolveOptions, Solver,
    Tolerance,
};

/// One line of table 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SizeLine {
    /// l.
    pub level: u32,
    /// N.
    pub n_patches: usize,
    /// N².
    pub n_entries: u64,
    /// Bytes of every entry in f64.
    pub dense_bytes: u64,
    /// Bytes of the entries on and above the diagonal in f64: those of α A F, which is symmetric.
    pub symmetric_bytes: u64,
    /// Bytes of the entries that are not zero, each with its column (12): five sixths of all.
    pub sparse_bytes: u64,
}

/// One line of table 2.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "LewisSolverLine"))]
pub struct SolverLine {
    /// l.
    pub level: u32,
    /// N.
    pub n_patches: usize,
    /// Iterations of Gauss-Seidel and multigrid; the paper's.
    pub printed_iterations: Option<[usize; 2]>,
    /// Ours.
    pub iterations: [usize; 2],
    /// Multiplications of Gauss-Seidel and multigrid.
    pub multiply_adds: [f64; 2],
    /// Those of an independent program, to three digits.
    pub expected_multiply_adds: Option<[f64; 2]>,
    /// The paper's times, s.
    pub printed_times_s: Option<[f64; 2]>,
    /// The paper's ratio of times.
    pub printed_ratio: Option<f64>,
    /// Medians of our times, s; multigrid's without setup.
    #[serde(skip)]
    pub times_s: [f64; 2],
    /// The median time of multigrid's setup, s.
    #[serde(skip)]
    pub setup_s: f64,
    /// Multigrid's setup, in passes over F.
    pub setup_work: f64,
}

impl SolverLine {
    /// Returns multigrid's time over that of Gauss-Seidel, without setup.
    #[must_use]
    pub fn time_ratio(&self) -> f64 {
        self.times_s[1] / self.times_s[0]
    }

    /// Returns multigrid's time, with setup, over that of Gauss-Seidel.
    #[must_use]
    pub fn time_ratio_with_setup(&self) -> f64 {
        (self.times_s[1] + self.setup_s) / self.times_s[0]
    }
}

/// One of our numbers against what it must be.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "LewisCheck"))]
pub struct Check {
    /// Its kind.
    pub name: String,
    /// The value that it must have.
    pub expected: f64,
    /// Ours.
    pub measured: f64,
    /// The greatest difference allowed: half a unit of the last digit of `expected`, and rounding.
    pub tolerance: f64,
}

impl Check {
    /// Returns whether the number is as expected.
    #[must_use]
    pub fn is_met(&self) -> bool {
        (self.measured - self.expected).abs() <= self.tolerance
    }
}

/// All that is repeated of the paper.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LewisResults {
    /// Table 1.
    pub sizes: Vec<SizeLine>,
    /// Table 2.
    pub solvers: Vec<SolverLine>,
    /// max |r| after each pass at l = 4: Gauss-Seidel.
    pub gauss_seidel_residuals: Vec<f64>,
    /// The same: multigrid.
    pub multigrid_residuals: Vec<f64>,
    /// Figure 2 in its variants, at l = 1 to 4.
    pub variants: Vec<(Variant, Vec<VariantRun>)>,
    /// Section 7 at l = 4.
    pub by_levels: Vec<ByLevels>,
    /// The solution at l = 4, W·m⁻².
    #[serde(skip)]
    pub solution: Vec<f64>,
    /// Our numbers against what they must be.
    pub checks: Vec<Check>,
}

/// Reproduces the tables; table 2 up to `level_max`, each time as the median of `rounds` runs.
///
/// # Errors
/// [`ExperimentError`] if form factors cannot be stored, or a system is refused.
pub fn reproduce(
    tables: &[u8],
    level_max: u32,
    rounds: usize,
    progress: &dyn Progress,
) -> Result<LewisResults, ExperimentError> {
    let mut results = LewisResults {
        sizes: Vec::new(),
        solvers: Vec::new(),
        gauss_seidel_residuals: Vec::new(),
        multigrid_residuals: Vec::new(),
        variants: Vec::new(),
        by_levels: Vec::new(),
        solution: Vec::new(),
        checks: Vec::new(),
    };
    if tables.contains(&1) {
        results.sizes = (0..=LEVEL_MAX).map(size_line).collect();
        measure_sizes(&mut results)?;
    }
    if tables.contains(&2) {
        progress.begin("table 2", u64::from(level_max));
        for level in 1..=level_max {
            let line = solver_line(level, rounds)?;
            check_line(&mut results.checks, &line);
            results.solvers.push(line);
            progress.advance(1);
        }
        residuals(&mut results)?;
        wall_means(&mut results)?;
        for variant in VARIANTS {
            let runs = (1..=4).map(|level| run_variant(variant, level));
            results.variants.push((variant, runs.collect::<Result<_, _>>()?));
        }
        check_variants(&mut results);
        results.by_levels = product_by_levels(4, &results.solution)?;
    }
    Ok(results)
}

fn size_line(level: u32) -> SizeLine {
    let n_patches = Room { level }.n_patches();
    let n = n_patches as u64;
    SizeLine {
        level,
        n_patches,
        n_entries: n * n,
        dense_bytes: 8 * n * n,
        symmetric_bytes: 4 * n * (n + 1),
        sparse_bytes: 10 * n * n,
    }
}

/// Checks the counted sizes against the memory in use at l = 3, where sparse and symmetric storage also have indices of rows and tiles.
fn measure_sizes(results: &mut LewisResults) -> Result<(), ExperimentError> {
    let room = Room { level: 3 };
    let dense = room.form_factors(Precision::F64)?;
    let line = size_line(3);
    results.checks.push(Check {
        name: "bytes of dense storage at l = 3".to_owned(),
        expected: line.dense_bytes as f64,
        measured: dense.stored_byte() as f64,
        tolerance: 0.0,
    });
    results.checks.push(Check {
        name: "share of entries that are not zero at l = 3".to_owned(),
        expected: 5.0 / 6.0,
        measured: dense.density(),
        tolerance: 1e-15,
    });
    Ok(())
}

/// A room with the input of its solution.
struct Prepared {
    room: Room,
    factors: FormFactors,
}

impl Prepared {
    fn new(level: u32) -> Result<Self, ExperimentError> {
        let room = Room { level };
        // At l = 6 this needs 2.4 GB instead of 4.8.
        let precision = if level < 6 { Precision::F64 } else { Precision::F32 };
        Ok(Self {
            room,
            factors: room.form_factors(precision)?,
        })
    }

    fn system(&self) -> Result<RadiositySystem<'_>, ExperimentError> {
        let (areas, rho, exitance) = (self.room.areas(), self.room.reflectance(), self.room.exitance());
        Ok(RadiositySystem::new(&self.factors, areas, rho, exitance)?)
    }

    /// Returns multigrid with the paper's settings.
    fn multigrid(&self, true_residuals: bool) -> Result<Multigrid, ExperimentError> {
        let coarse = (0..self.room.level)
            .rev()
            .map(|level| Room { level }.form_factors(Precision::F64));
        Ok(Multigrid {
            hierarchy: Some(Arc::new(self.room.hierarchy())),
            prolongation: Prolongation::Bilinear,
            coarse_matrices: CoarseMatrices::Reevaluated(coarse.collect::<Result<_, _>>()?),
            coarsest: Coarsest::Sweeps(20),
            defect: Defect::OfRadiosities,
            true_residuals,
        })
    }
}

fn solve(
    system: &RadiositySystem,
    solver: &dyn Solver,
    tolerance: f64,
    max_passes: usize,
) -> Result<Solution, ExperimentError> {
    let options = SolveOptions {
        tolerance: Tolerance::ResidualMax(tolerance),
        max_passes,
        ..SolveOptions::default()
    };
    Ok(solver.solve(system, &options, &mut |_| ControlFlow::Continue(()))?)
}

fn solver_line(level: u32, rounds: usize) -> Result<SolverLine, ExperimentError> {
    let prepared = Prepared::new(level)?;
    let system = prepared.system()?;
    let as_printed = prepared.multigrid(true)?;
    let gauss_seidel = solve(&system, &GaussSeidel, TOLERANCE, 1000)?;
    let multigrid = solve(&system, &as_printed, TOLERANCE, 1000)?;
    let entries = (prepared.room.n_patches() as f64).powi(2);
    let work = multigrid.history.last().map_or(0.0, |last| last.work) - multigrid.setup_work;
    let timed = prepared.multigrid(false)?;
    let (mut times, mut setup) = ([Vec::new(), Vec::new()], Vec::new());
    for _ in 0..rounds {
        // The small rooms run many times, so that the times are measurable.
        let repeats = 1 + 2_000_000 / prepared.room.n_patches().pow(2);
        for (k, solver) in [&GaussSeidel as &dyn Solver, &timed].into_iter().enumerate() {
            let (mut total_s, mut setup_s) = (0.0, 0.0);
            for _ in 0..repeats {
                let solution = solve(&system, solver, TOLERANCE, 1000)?;
                setup_s += solution.setup_s;
                // The time ends with the last pass and its check; the bound of the error is computed later.
                total_s += solution.history.last().map_or(f64::NAN, |last| last.time_s);
            }
            times[k].push((total_s - setup_s) / repeats as f64);
            if k == 1 {
                setup.push(setup_s / repeats as f64);
            }
        }
    }
    let printed = TABLE_2.iter().find(|line| line.level == level);
    let expected = EXPECTED.iter().find(|line| line.level == level);
    Ok(SolverLine {
        level,
        n_patches: prepared.room.n_patches(),
        printed_iterations: printed.map(|line| line.iterations),
        iterations: [gauss_seidel.n_passes, multigrid.n_passes],
        multiply_adds: [gauss_seidel.n_passes as f64 * entries, work * entries],
        expected_multiply_adds: expected.map(|line| line.multiply_adds),
        printed_times_s: printed.and_then(|line| line.times_s),
        printed_ratio: printed.and_then(|line| line.ratio),
        times_s: times.map(|times| Spread::of(&times).median),
        setup_s: Spread::of(&setup).median,
        setup_work: multigrid.setup_work,
    })
}

fn check_line(checks: &mut Vec<Check>, line: &SolverLine) {
    let Some(expected) = EXPECTED.iter().find(|e| e.level == line.level) else {
        return;
    };
    for (k, name) in ["Gauss-Seidel", "multigrid"].into_iter().enumerate() {
        checks.push(Check {
            name: format!("{name}, l = {}: iterations", line.level),
            expected: expected.iterations[k] as f64,
            measured: line.iterations[k] as f64,
            tolerance: 0.0,
        });
        checks.push(Check {
            name: format!("{name}, l = {}: multiplications", line.level),
            expected: expected.multiply_adds[k],
            measured: line.multiply_adds[k],
            tolerance: half_digit(expected.multiply_adds[k], 3),
        });
    }
}

/// Returns half a unit of the last of `digits` digits of a number, with a margin for its own rounding.
fn half_digit(value: f64, digits: i32) -> f64 {
    let exponent = value.abs().log10().floor();
    0.5 * 10f64.powf(exponent - f64::from(digits - 1)) * (1.0 + 1e-9)
}

fn residuals(results: &mut LewisResults) -> Result<(), ExperimentError> {
    let prepared = Prepared::new(4)?;
    let system = prepared.system()?;
    // With an unreachable tolerance, there are as many passes as the lists are long.
    let multigrid = solve(&system, &prepared.multigrid(true)?, 1e-300, MULTIGRID_RESIDUALS.len())?;
    results.multigrid_residuals = multigrid.history.iter().map(|entry| entry.residual_max).collect();
    for n_passes in 1..=GAUSS_SEIDEL_RESIDUALS.len() {
        // The true residual is calculated only at the end of a run.
        let run = solve(&system, &GaussSeidel, 1e-300, n_passes)?;
        let last = run.history.last().map_or(f64::NAN, |entry| entry.residual_max);
        results.gauss_seidel_residuals.push(last);
    }
    let lists = [
        ("multigrid", &results.multigrid_residuals, &MULTIGRID_RESIDUALS[..]),
        (
            "Gauss-Seidel",
            &results.gauss_seidel_residuals,
            &GAUSS_SEIDEL_RESIDUALS[..],
        ),
    ];
    for (name, measured, expected) in lists {
        for (k, &expected) in expected.iter().enumerate() {
            results.checks.push(Check {
                name: format!("{name}, l = 4: max |r| after {}", k + 1),
                expected,
                measured: measured.get(k).copied().unwrap_or(f64::NAN),
                tolerance: half_digit(expected, 4),
            });
        }
    }
    Ok(())
}

fn wall_means(results: &mut LewisResults) -> Result<(), ExperimentError> {
    for (level, expected) in WALL_MEANS {
        let prepared = Prepared::new(level)?;
        let system = prepared.system()?;
        let solution = solve(&system, &prepared.multigrid(true).map(direct)?, 1e-14, 100)?;
        let means = prepared.room.wall_means(solution.radiosity.values());
        for ((wall, expected), measured) in ["x0", "x1", "y0", "y1", "z0", "z1"].iter().zip(expected).zip(means) {
            results.checks.push(Check {
                name: format!("mean of wall {wall}, l = {level}"),
                expected,
                measured,
                // The expected values have ten decimals.
                tolerance: 0.5e-10 + 1e-13,
            });
        }
        if level == 4 {
            results.solution = solution.radiosity.values().to_vec();
        }
    }
    Ok(())
}

/// Returns multigrid with a direct solution of the coarsest level and its own matrices, which l = 0 needs: it has no coarser level.
fn direct(multigrid: Multigrid) -> Multigrid {
    Multigrid {
        coarsest: Coarsest::Direct,
        coarse_matrices: CoarseMatrices::Galerkin,
        ..multigrid
    }
}

fn check_variants(results: &mut LewisResults) {
    let lists = [
        (Variant::Repaired, [4; 4]),
        (Variant::JacobiSmoothing, JACOBI_CYCLES),
        (Variant::PlusSign, PLUS_SIGN_CYCLES),
    ];
    for (variant, expected) in lists {
        let runs = results
            .variants
            .iter()
            .filter(|(other, _)| *other == variant)
            .flat_map(|(_, runs)| runs);
        for (run, expected) in runs.zip(expected) {
            results.checks.push(Check {
                name: format!("{}, l = {}: cycles", variant.description(), run.level),
                expected: expected as f64,
                measured: run.n_cycles.map_or(f64::INFINITY, |n| n as f64),
                tolerance: 0.0,
            });
        }
    }
}
