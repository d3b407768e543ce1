//! Short functions to make systems and to solve them.

use std::ops::ControlFlow;

use radiosity::matrix::FormFactors;
use radiosity::matrix::operator::Block;
use radiosity::solver::registry::SOLVERS;
use radiosity::solver::{self, RadiositySystem, Solution, SolveOptions, Solver, SolverSettings, Tolerance};

use super::Uniform;

/// Returns the solver of a name with its defaults; it lives as long as the tests.
pub(crate) fn by_name(name: &str) -> &'static dyn Solver {
    Box::leak(solver::solver(name, &SolverSettings::default()).expect("known"))
}

pub(crate) fn all() -> impl Iterator<Item = &'static dyn Solver> {
    SOLVERS.iter().map(|entry| by_name(entry.name))
}

pub(crate) fn run(solver: &dyn Solver, system: &RadiositySystem, options: &SolveOptions) -> Solution {
    solver
        .solve(system, options, &mut |_| ControlFlow::Continue(()))
        .expect("accepted")
}

pub(crate) fn system<'a>(f: &'a FormFactors, reflectance: &Block, exitance: &Block) -> RadiositySystem<'a> {
    RadiositySystem::new(f, f.areas().to_vec(), reflectance.clone(), exitance.clone()).expect("accepted")
}

pub(crate) fn l2(tolerance: f64) -> SolveOptions<'static> {
    SolveOptions {
        tolerance: Tolerance::ResidualL2(tolerance),
        max_passes: 5000,
        ..SolveOptions::default()
    }
}

pub(crate) fn constant(n: usize, value: f64) -> Block {
    Block::from_values(vec![value; n], 1)
}

/// Three channels of random reflectances up to `rho_max`, some of them zero, and a few emitters.
pub(crate) fn random_materials(n: usize, rho_max: f64, seed: u64) -> (Block, Block) {
    let mut uniform = Uniform(seed);
    let mut reflectance = Block::zeros(n, 3);
    let mut exitance = Block::zeros(n, 3);
    for i in 0..n {
        for c in 0..3 {
            let black = uniform.next() < 0.1;
            let rho = rho_max * uniform.next();
            reflectance.row_mut(i)[c] = if black { 0.0 } else { rho };
            exitance.row_mut(i)[c] = if i % 7 == c { 1.0 + uniform.next() } else { 0.0 };
        }
    }
    (reflectance, exitance)
}

pub(crate) fn channel(block: &Block, c: usize) -> Block {
    let column = (0..block.n_rows()).map(|i| block.row(i)[c]).collect();
    Block::from_values(column, 1)
}
