//! How fast solvers are beside Gauss-Seidel, in the room of Lewis 1992.
//!
//! Every line is a level; runs alternate, and the ratio of medians counts: both from u = f to max |r| < 2.5e-5 W·m⁻², with one check of the true residual.
//! `cargo bench --bench solvers -- 5` goes up to level 5, which is what happens without a number.
#![expect(clippy::print_stdout, reason = "a benchmark prints its figures")]

use std::ops::ControlFlow;
use std::sync::Arc;

use radiosity::experiment::lewis::{Room, TOLERANCE};
use radiosity::matrix::Precision;
use radiosity::mesh::Prolongation;
use radiosity::solver::{GaussSeidel, Multigrid, RadiositySystem, SolveOptions, Solver, Tolerance};

/// Runs of each measurement; the median counts.
const N_ROUNDS: usize = 9;

fn main() {
    let level_max = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(5);
    println!(
        "multigrid (Galerkin, direct coarsest level) by gauss-seidel, {} threads",
        rayon::current_num_threads()
    );
    println!(
        "{:>2} {:>6} {:>12} {:>12} {:>12} {:>7} {:>11} {:>7}",
        "l", "N", "gs", "mg", "setup", "mg/gs", "with setup", "cycles"
    );
    for level in 1..=level_max {
        compare(level);
    }
}

fn compare(level: u32) {
    let room = Room { level };
    let precision = if level < 6 { Precision::F64 } else { Precision::F32 };
    let factors = room.form_factors(precision).expect("a sound matrix");
    let system =
        RadiositySystem::new(&factors, room.areas(), room.reflectance(), room.exitance()).expect("a sound system");
    let multigrid = Multigrid {
        hierarchy: Some(Arc::new(room.hierarchy())),
        prolongation: Prolongation::Injection,
        ..Multigrid::default()
    };
    let options = SolveOptions {
        tolerance: Tolerance::ResidualMax(TOLERANCE),
        ..SolveOptions::default()
    };
    let repeats = 1 + 2_000_000 / room.n_patches().pow(2);
    let (mut times, mut setups, mut cycles) = ([Vec::new(), Vec::new()], Vec::new(), 0);
    for _ in 0..N_ROUNDS {
        for (k, solver) in [&GaussSeidel as &dyn Solver, &multigrid].into_iter().enumerate() {
            let (mut total_s, mut setup_s) = (0.0, 0.0);
            for _ in 0..repeats {
                let solution = solver
                    .solve(&system, &options, &mut |_| ControlFlow::Continue(()))
                    .expect("solved");
                total_s += solution.history.last().map_or(f64::NAN, |last| last.time_s);
                setup_s += solution.setup_s;
                cycles = solution.n_passes;
            }
            times[k].push((total_s - setup_s) / repeats as f64);
            if k == 1 {
                setups.push(setup_s / repeats as f64);
            }
        }
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[N_ROUNDS / 2]
    };
    let [gs, mg] = times.map(median);
    let setup = median(setups);
    println!(
        "{level:>2} {:>6} {:9.3} ms {:9.3} ms {:9.3} ms {:7.3} {:11.3} {cycles:>7}",
        room.n_patches(),
        1e3 * gs,
        1e3 * mg,
        1e3 * setup,
        mg / gs,
        (mg + setup) / gs
    );
}
