//! Tries every solver on stiff, extreme and impossible systems, and checks its statements.
//!
//! A cell of the table is one solver on one case. It is *right* if the solver reports `converged`, and all of its statements agree with
//! an exact solution (a factorisation, refined with residuals in twice the precision): the radiosities are finite, not negative, their true residual
//! meets the tolerance, their error is within the error bound (or, without a bound, within that of the residual), and energy is
//! conserved. It is *refused* if the solver or the system returned a typed error or stopped as `stagnated` or `diverged`, and *slow* if all passes were used up. Everything else is
//! *wrong*: there must be no such cell. The heat of enclosures is judged in the same way, by comparing irradiances with their stated errors.

#![cfg_attr(
    test,
    expect(
        clippy::shadow_unrelated,
        reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
    )
)]

mod cases;
mod heat;
mod oracle;
mod report;
mod rooms;

use std::ops::{ControlFlow, RangeInclusive};
use std::time::Instant;

use serde::Serialize;

use super::ExperimentError;
use crate::matrix::operator::Block;
use crate::progress::Progress;
use crate::solver::registry::{SOLVERS, SolverEntry};
use crate::solver::{
    RadiositySystem, Solution, SolveOptions, Solver, SolverError, SolverSettings, StopReason, Tolerance,
};
use cases::{Case, Expected};
use oracle::{Oracle, residuals};

pub use report::{CaseTimes, StabilityDocument};

/// The tolerance on sqrt(Σ A r² / Σ A E²).
pub const TOLERANCE: f64 = 1e-6;

/// The limit of passes of a solver.
pub const MAX_PASSES: usize = 1000;

/// The numbers of runs of a cell, of which the least time counts.
///
/// Only the first number is run if these take [`RUNS_S`]; the least of many short times is steady.
const N_RUNS: RangeInclusive<usize> = 3..=100;

/// The total time of the runs of a cell, s.
const RUNS_S: f64 = 5e-3;

/// How one solver did on one case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "StabilityVerdict"))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It converged, and all it says is true.
    Right,
    /// It used up its passes, and says so.
    Slow,
    /// It, or the system, refused, or it stopped and says why.
    Refused,
    /// It says what is not true.
    Wrong,
}

/// One solver on one case.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "StabilityCell"))]
pub struct Cell {
    /// The case's name.
    pub case: String,
    /// The solver's name.
    pub solver: &'static str,
    /// How it did.
    pub verdict: Verdict,
    /// Why it stopped, which error it returned, or what is wrong.
    pub detail: String,
    /// The solver that `auto` took.
    pub choice: Option<&'static str>,
    /// Passes, without checks.
    pub n_passes: Option<usize>,
    /// Work in passes over F, checks of the true residual included.
    pub work: Option<f64>,
    /// Wall time, s, the least of three to a hundred runs.
    #[serde(skip)]
    pub time_s: Option<f64>,
    /// ‖B − B*‖ / ‖B*‖ in the norm sqrt(Σ A x²), the worst channel.
    pub error: Option<f64>,
    /// The bound of the same that the solver gave.
    pub error_bound: Option<f64>,
    /// sqrt(Σ A r² / Σ A E²).
    pub residual_l2: Option<f64>,
}

impl Cell {
    /// Returns the cell of a case that the solver refuses.
    fn refused(case: &str, entry: &SolverEntry, detail: String) -> Self {
        Self {
            case: case.to_owned(),
            solver: entry.name,
            verdict: Verdict::Refused,
            detail,
            choice: None,
            n_passes: None,
            work: None,
            time_s: None,
            error: None,
            error_bound: None,
            residual_l2: None,
        }
    }

    /// Returns the cell of a solution without its errors; `converged` judges one that is reported as converged.
    fn solved(
        case: &str,
        entry: &SolverEntry,
        solution: &Solution,
        time_s: f64,
        converged: impl FnOnce() -> (Verdict, String),
    ) -> Self {
        let (verdict, detail) = match solution.stop_reason {
            StopReason::Converged => converged(),
            StopReason::MaxPasses => (Verdict::Slow, StopReason::MaxPasses.to_string()),
            other => (Verdict::Refused, other.to_string()),
        };
        Self {
            verdict,
            choice: solution.choice.as_ref().map(|choice| choice.solver),
            n_passes: Some(solution.n_passes),
            work: Some(solution.history.last().map_or(0.0, |last| last.work) + solution.n_checks as f64),
            time_s: Some(time_s),
            residual_l2: Some(solution.residual_l2),
            ..Self::refused(case, entry, detail)
        }
    }
}

/// One case and how `auto` did among the solvers.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "StabilityCase"))]
pub struct CaseSummary {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub about: String,
    /// Number of patches.
    pub n_patches: usize,
    /// The solver, other than `auto`, that was right in the least work, with that work.
    pub best: Option<(&'static str, f64)>,
    /// The work of `auto` by that of the best.
    pub auto_work_ratio: Option<f64>,
    /// The time of `auto` by the least time of another solver that was right.
    #[serde(skip)]
    pub auto_time_ratio: Option<f64>,
}

/// The whole table.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Stability {
    /// The cases, in order.
    pub cases: Vec<CaseSummary>,
    /// The solvers' names, in the registry's order.
    pub solvers: Vec<&'static str>,
    /// The cells, case by case, in the order of `solvers`.
    pub cells: Vec<Cell>,
}

impl Stability {
    /// Returns the cells whose verdict is [`Verdict::Wrong`].
    pub fn wrong(&self) -> impl Iterator<Item = &Cell> {
        self.cells.iter().filter(|cell| cell.verdict == Verdict::Wrong)
    }
}

/// Tries every solver of the registry on every case; `seed` is that of the Monte Carlo noise.
///
/// # Errors
/// [`ExperimentError`] if a case cannot be built.
pub fn run(seed: u64, progress: &dyn Progress) -> Result<Stability, ExperimentError> {
    try_all(seed, N_RUNS, progress)
}

fn try_all(seed: u64, n_runs: RangeInclusive<usize>, progress: &dyn Progress) -> Result<Stability, ExperimentError> {
    let cases = cases::all(seed)?;
    let enclosures = heat::all();
    progress.begin("stability", ((cases.len() + enclosures.len()) * SOLVERS.len()) as u64);
    let mut table = Stability {
        cases: Vec::new(),
        solvers: SOLVERS.iter().map(|s| s.name).collect(),
        cells: Vec::new(),
    };
    for case in &cases {
        let cells = try_case(case, &n_runs, progress);
        table
            .cases
            .push(summary((&case.name, &case.about), case.areas.len(), &cells));
        table.cells.extend(cells);
    }
    let mut cube = heat::Enclosure::new()?;
    for case in &enclosures {
        let tried = |entry: &&'static SolverEntry| {
            progress.advance(1);
            cube.cell(case, entry)
        };
        let cells: Vec<Cell> = SOLVERS.iter().map(tried).collect();
        table
            .cases
            .push(summary((case.name, case.about), cube.n_patches(), &cells));
        table.cells.extend(cells);
    }
    Ok(table)
}

fn try_case(case: &Case, n_runs: &RangeInclusive<usize>, progress: &dyn Progress) -> Vec<Cell> {
    let system = case.system();
    let judge = system
        .as_ref()
        .map(|accepted| (accepted, Oracle::new(accepted, case.signed)));
    let (accepted, oracle) = match &judge {
        Ok(judge) => judge,
        Err(error) => {
            progress.advance(SOLVERS.len() as u64);
            let refused = |entry: &&'static SolverEntry| Cell::refused(&case.name, entry, error.to_string());
            return SOLVERS.iter().map(refused).collect();
        }
    };
    let mut trials: Vec<Trial> = SOLVERS.iter().copied().map(Trial::new).collect();
    // Each solver has a system of its own, as for a user: solvers cache results in it. They run in turns, so that the placement of vectors in memory and changes of the machine's speed affect all
    // alike.
    while trials.iter().any(|trial| !trial.is_over(n_runs)) {
        for trial in trials.iter_mut().filter(|trial| !trial.is_over(n_runs)) {
            trial.run(&case.system().expect("it was accepted before"));
            if trial.is_over(n_runs) {
                progress.advance(1);
            }
        }
    }
    let judged = |trial| judged(case, trial, accepted, oracle);
    trials.into_iter().map(judged).collect()
}

/// The runs of one solver on one case.
struct Trial {
    entry: &'static SolverEntry,
    solver: Box<dyn Solver>,
    n_done: usize,
    /// The least of the times, s.
    time_s: f64,
    /// The sum of the times, s.
    spent_s: f64,
    /// The result of the last run.
    outcome: Option<Result<Solution, SolverError>>,
}

impl Trial {
    fn new(entry: &'static SolverEntry) -> Self {
        Self {
            entry,
            solver: entry.build(&SolverSettings::default()),
            n_done: 0,
            time_s: f64::INFINITY,
            spent_s: 0.0,
            outcome: None,
        }
    }

    /// Returns whether there are enough runs.
    fn is_over(&self, n_runs: &RangeInclusive<usize>) -> bool {
        let is_slow = self.n_done >= *n_runs.start() && self.spent_s > RUNS_S;
        is_slow || self.n_done >= *n_runs.end() || matches!(self.outcome, Some(Err(_)))
    }

    fn run(&mut self, system: &RadiositySystem) {
        let options = SolveOptions {
            tolerance: Tolerance::ResidualL2(TOLERANCE),
            max_passes: MAX_PASSES,
            ..SolveOptions::default()
        };
        let start = Instant::now();
        self.outcome = Some(self.solver.solve(system, &options, &mut |_| ControlFlow::Continue(())));
        let time_s = start.elapsed().as_secs_f64();
        self.n_done += 1;
        self.spent_s += time_s;
        self.time_s = self.time_s.min(time_s);
    }
}

/// Returns the verdict on a solver's runs.
fn judged(case: &Case, trial: Trial, system: &RadiositySystem, oracle: &Oracle) -> Cell {
    let Trial { entry, time_s, .. } = trial;
    let solution = match trial.outcome.expect("at least one run") {
        Ok(solution) => solution,
        Err(error) => return Cell::refused(&case.name, entry, error.to_string()),
    };
    let error = relative_error(system.areas(), &solution.radiosity, &oracle.radiosity);
    let cell = Cell::solved(&case.name, entry, &solution, time_s, || {
        match lie(case, system, oracle, &solution, error) {
            None => (Verdict::Right, "converged".to_owned()),
            Some(lie) => (Verdict::Wrong, lie),
        }
    });
    Cell {
        error: Some(error),
        error_bound: solution.error_bound,
        ..cell
    }
}

/// Returns the false statement of a solution that is reported as converged.
fn lie(case: &Case, system: &RadiositySystem, oracle: &Oracle, solution: &Solution, error: f64) -> Option<String> {
    let b = solution.radiosity.values();
    if b.iter().any(|b| !b.is_finite()) {
        return Some("a radiosity is not finite".to_owned());
    }
    if case.expected == Expected::Refusal || !(oracle.of_light || case.signed) {
        return Some("converged, where nothing means anything".to_owned());
    }
    if !case.signed && b.iter().any(|b| *b < 0.0) {
        return Some("a radiosity is negative".to_owned());
    }
    for c in 0..system.n_channels() {
        let residuals = residuals(system, c, &system.exitance().channel(c), &solution.radiosity.channel(c));
        let residual = |i: usize| residuals[i];
        let l2 = |value: &dyn Fn(usize) -> f64| -> f64 {
            // The greatest value is factored out: its square may overflow.
            let max = (0..b.len() / system.n_channels())
                .map(|i| value(i).abs())
                .fold(0.0, f64::max);
            let squares = system
                .areas()
                .iter()
                .enumerate()
                .map(|(i, a)| a * (value(i) / max).powi(2));
            if max > 0.0 {
                max * squares.sum::<f64>().sqrt()
            } else {
                0.0
            }
        };
        let (r, e) = (l2(&residual), l2(&|i| system.exitance().row(i)[c]));
        if r > TOLERANCE * (1.0 + 1e-9) * e {
            return Some(format!("the residual is {:.1e}", r / e));
        }
        let area: f64 = system.areas().iter().sum();
        if let Some(energy) = solution
            .energy
            .get(c)
            .filter(|_| system.operator().reciprocal_areas().is_some())
        {
            let lost = (energy.emitted - energy.absorbed - energy.escaped).abs();
            if lost > area.sqrt() * r + 1e-12 * energy.leaving.abs() {
                return Some(format!(
                    "{lost:.1e} W of {:.1e} W are not accounted for",
                    energy.emitted
                ));
            }
        }
        let b_l2 = l2(&|i| oracle.radiosity.row(i)[c]);
        let r_max = (0..system.n_patches()).map(|i| residual(i).abs()).fold(0.0, f64::max);
        let explained =
            r_max * oracle.amplification[c] / b_l2 + ROUNDING * (1.0 + oracle.amplification[c] / area.sqrt());
        let allowed = solution.error_bound.unwrap_or(explained);
        // The oracle's own error is far below 1e-12.
        if error > allowed * (1.0 + 1e-6) + 1e-12 {
            return Some(format!("the error is {error:.1e}, above {allowed:.1e}"));
        }
    }
    None
}

/// The relative rounding error of a pass over a few hundred patches.
const ROUNDING: f64 = 1e-14;

fn relative_error(areas: &[f64], x: &Block, y: &Block) -> f64 {
    let mut worst = 0.0_f64;
    for c in 0..y.n_channels() {
        let max = (0..areas.len()).map(|i| y.row(i)[c].abs()).fold(0.0, f64::max);
        let sum =
            |term: &dyn Fn(usize) -> f64| -> f64 { areas.iter().enumerate().map(|(i, a)| a * term(i).powi(2)).sum() };
        let difference = sum(&|i| (x.row(i)[c] - y.row(i)[c]) / max);
        let size = sum(&|i| y.row(i)[c] / max);
        let error = (difference / size).sqrt();
        worst = if error.is_nan() {
            f64::INFINITY
        } else {
            worst.max(error)
        };
    }
    worst
}

fn summary((name, about): (&str, &str), n_patches: usize, cells: &[Cell]) -> CaseSummary {
    let right = || cells.iter().filter(|cell| cell.verdict == Verdict::Right);
    let others = || right().filter(|cell| cell.solver != "auto");
    let auto = right().find(|cell| cell.solver == "auto");
    let best = others()
        .filter_map(|cell| Some((cell.solver, cell.work?)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let least_time = others().filter_map(|cell| cell.time_s).min_by(f64::total_cmp);
    CaseSummary {
        name: name.to_owned(),
        about: about.to_owned(),
        n_patches,
        best,
        auto_work_ratio: auto.and_then(|auto| Some(auto.work? / best?.1)),
        auto_time_ratio: auto.and_then(|auto| Some(auto.time_s? / least_time?)),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::solver::{GaussSeidel, Sor};

    /// Tests the table: no cell is wrong, all solvers refuse cases without a solution, and some solver is right in every other case.
    #[test]
    fn no_solver_says_what_is_not_true() {
        let table = try_all(0, 1..=1, &Silent).unwrap();
        let wrong: Vec<&Cell> = table.wrong().collect();
        assert!(wrong.is_empty(), "{wrong:#?}");
        let of_solvers = cases::all(0).unwrap();
        let expected = of_solvers.iter().map(|case| case.expected);
        let expected: Vec<Expected> = expected.chain(heat::all().iter().map(|case| case.expected)).collect();
        assert_eq!(table.cases.len(), expected.len());
        for (case, expected) in table.cases.iter().zip(expected) {
            let cells: Vec<&Cell> = table.cells.iter().filter(|cell| cell.case == case.name).collect();
            assert_eq!(cells.len(), SOLVERS.len());
            match expected {
                Expected::Refusal => assert!(cells.iter().all(|c| c.verdict == Verdict::Refused), "{cells:#?}"),
                // Beyond 1 − ρ = 1e-9 rounding alone is above the tolerance.
                Expected::Solution if case.name.ends_with("1e-10") || case.name.ends_with("1e-12") => {}
                Expected::Solution => {
                    let auto = cells.iter().find(|c| c.solver == "auto").unwrap();
                    assert_eq!(auto.verdict, Verdict::Right, "{auto:#?}");
                }
            }
        }
    }

    /// Tests that residuals of sweeps that rise before they fall, oscillate for longer than the patience, or lag behind do not count as stagnation.
    #[test]
    fn slow_is_not_stagnated() {
        let cases = cases::all(0).unwrap();
        let passes = |exponent: i32, solver: &dyn Solver, max_passes: usize| {
            let name = format!("six patches, 1 − ρ = 1e-{exponent}");
            let case = cases.iter().find(|case| case.name == name).unwrap();
            let options = SolveOptions {
                max_passes,
                ..SolveOptions::default()
            };
            let system = case.system().unwrap();
            let solution = solver
                .solve(&system, &options, &mut |_| ControlFlow::Continue(()))
                .unwrap();
            (solution.stop_reason, solution.n_passes)
        };
        let sor = |omega: f64| Sor { omega: Some(omega) };
        // The least passes after which the true residual meets the tolerance, counted by a separate program; estimates that lag cost a twentieth more.
        for (exponent, solver, least) in [
            (1, &sor(1.9) as &dyn Solver, 126),
            (3, &sor(1.5), 2254),
            (3, &GaussSeidel, 6462),
            (4, &sor(1.97), 1021),
            (4, &Sor::default(), 609),
            (5, &Sor::default(), 2045),
        ] {
            let (reason, n) = passes(exponent, solver, 10_000);
            assert_eq!(reason, StopReason::Converged, "{} at 1e-{exponent}: {n}", solver.name());
            assert!(
                (least..=least + least / 20 + 1).contains(&n),
                "{} at 1e-{exponent}: {n}",
                solver.name()
            );
        }
        assert_eq!(passes(5, &GaussSeidel, 1000), (StopReason::MaxPasses, 1000));
    }

    /// Tests that the oracle distinguishes systems of light from others, as the cases state.
    #[test]
    fn expectations_are_those_of_the_oracle() {
        for case in cases::all(0).unwrap().iter().filter(|case| !case.signed) {
            let blocks = (case.reflectance.clone(), case.exitance.clone());
            if let Ok(system) = RadiositySystem::new(&*case.operator, case.areas.clone(), blocks.0, blocks.1) {
                let oracle = Oracle::new(&system, false);
                assert_eq!(oracle.of_light, case.expected == Expected::Solution, "{}", case.name);
            }
        }
    }

    /// Tests that the judge finds errors.
    #[test]
    fn the_judge_finds_what_is_wrong() {
        let cases = cases::all(0).unwrap();
        let case = &cases[1];
        let blocks = (case.reflectance.clone(), case.exitance.clone());
        let system = RadiositySystem::new(&*case.operator, case.areas.clone(), blocks.0, blocks.1).unwrap();
        let oracle = Oracle::new(&system, false);
        let entry = crate::solver::registry::by_name("direct").unwrap();
        let solver = entry.build(&SolverSettings::default());
        let solution = solver
            .solve(&system, &SolveOptions::default(), &mut |_| ControlFlow::Continue(()))
            .unwrap();
        let found = |solution: &Solution| {
            let error = relative_error(system.areas(), &solution.radiosity, &oracle.radiosity);
            lie(case, &system, &oracle, solution, error)
        };
        assert_eq!(found(&solution), None);
        let mut brighter = solution.clone();
        brighter.radiosity.values_mut().iter_mut().for_each(|b| *b *= 1.001);
        assert!(found(&brighter).unwrap().contains("residual"));
        let mut negative = solution.clone();
        negative.radiosity.values_mut()[0] = -1e-300;
        assert!(found(&negative).unwrap().contains("negative"));
        let mut infinite = solution.clone();
        infinite.radiosity.values_mut()[0] = f64::NAN;
        assert!(found(&infinite).unwrap().contains("finite"));
        let mut sure = solution.clone();
        sure.radiosity.values_mut().iter_mut().for_each(|b| *b *= 1.0 + 1e-9);
        sure.error_bound = Some(1e-15);
        assert!(found(&sure).unwrap().contains("error"));
        let mut lossy = solution;
        lossy.energy[0].absorbed *= 0.9;
        assert!(found(&lossy).unwrap().contains("accounted"));
    }
}
