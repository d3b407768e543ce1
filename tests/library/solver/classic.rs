//! The papers' stationary and relaxation solvers: their properties beyond a right solution.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;

use radiosity::matrix::FormFactors;
use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::solver::{
    self, Chebyshev, Overshooting, ProgressiveRefinement, RadiositySystem, STEPS_PER_PASS, SolveOptions, Solver,
    SolverError, SolverSettings, Sor, SpectrumBounds, Start, StopReason, Tolerance,
};

use crate::support::solving::{by_name, constant, l2, random_materials, run, system};
use crate::support::{LewisRoom, dense, matrix, random_room, relative_error, solve_direct};

/// A closed room in which all patches see all alike, F_ij = A_j / Σ A, with equal areas.
fn even_room(n: usize) -> FormFactors {
    mixing_room(&vec![1.0; n])
}

/// The same with any areas.
fn mixing_room(areas: &[f64]) -> FormFactors {
    let total: f64 = areas.iter().sum();
    let rows = vec![areas.iter().map(|area| area / total).collect(); areas.len()];
    matrix(areas, &rows).symmetrised().unwrap()
}

/// One patch in the corner of a room emits.
fn lamp(n: usize) -> Block {
    let mut exitance = vec![0.0; n];
    exitance[0] = 1.0;
    Block::from_values(exitance, 1)
}

/// The factor by which the residual falls with each of the last passes.
fn rate(solver: &dyn Solver, system: &RadiositySystem, n_passes: usize) -> f64 {
    let options = SolveOptions {
        max_passes: n_passes,
        true_history: true,
        ..l2(1e-300)
    };
    let history = run(solver, system, &options).history;
    let residual = |pass: usize| history.iter().find(|e| e.pass == pass).unwrap().residual_l2;
    (residual(n_passes) / residual(n_passes - 4)).powf(0.25)
}

/// In the even room diag(ρ) F has the one eigenvalue ρ, and 0.
#[test]
fn rates_follow_from_the_spectrum() {
    let (n, rho) = (400, 0.9);
    let f = even_room(n);
    let system = system(&f, &constant(n, rho), &lamp(n));
    let jacobi = rate(by_name("jacobi"), &system, 20);
    assert!((jacobi - rho).abs() < 1e-6, "{jacobi}");
    // A sweep of Gauss-Seidel: ln z = ρ (z − 1) / z as n → ∞, which 0.8096 solves; the correction is of the order 1 / n.
    let gauss_seidel = rate(by_name("gauss-seidel"), &system, 30);
    let z = 0.809_6_f64;
    assert!((z.ln() - rho * (z - 1.0) / z).abs() < 1e-3, "the root");
    assert!((gauss_seidel - z).abs() < 2.0 / n as f64 + 1e-3, "{gauss_seidel}");
    // Overrelaxed by the rule: the slow mode and the rest fall as ω − 1, ρ = 2 (ω − 1) ln(ω − 1) / (ω (ω − 2)).
    let omega = (1..10_000)
        .map(|k| 1.0 + f64::from(k) * 1e-4)
        .find(|w| 2.0 * (w - 1.0) * (w - 1.0).ln() / (w * (w - 2.0)) >= rho)
        .unwrap();
    let sor = rate(by_name("sor"), &system, 24);
    assert!(
        sor < omega - 1.0 + 0.06 && sor < gauss_seidel - 0.25,
        "{sor} for {}",
        omega - 1.0
    );
    // Chebyshev on 1 ± ρ: σ / (1 + sqrt(1 − σ²)) a pass.
    let chebyshev = rate(by_name("chebyshev"), &system, 24);
    let expected = rho / (1.0 + (1.0 - rho * rho).sqrt());
    assert!((chebyshev - expected).abs() < 0.03, "{chebyshev} for {expected}");
}

/// No ω does much better than the rule where it is derived for.
#[test]
fn the_rule_for_omega_is_near_the_best() {
    let n = 200;
    let f = even_room(n);
    for rho in [0.5, 0.8, 0.95, 0.99] {
        let system = system(&f, &constant(n, rho), &lamp(n));
        let passes = |omega: Option<f64>| run(&Sor { omega }, &system, &l2(1e-8)).n_passes;
        let best = (0..18).map(|k| passes(Some(1.0 + 0.05 * f64::from(k)))).min().unwrap();
        let ours = passes(None);
        assert!(ours <= best + best / 5 + 2, "ρ = {rho}: {ours} for {best}");
        assert!(ours < passes(Some(1.0)), "ρ = {rho}");
    }
}

#[test]
fn omega_outside_of_its_range_is_refused() {
    let f = even_room(4);
    let system = system(&f, &constant(4, 0.5), &lamp(4));
    for value in [0.0, 2.0, -1.0, f64::NAN] {
        let sor = Sor { omega: Some(value) };
        let refusal = sor.solve(&system, &l2(1e-6), &mut |_| ControlFlow::Continue(()));
        assert!(matches!(refusal, Err(SolverError::Omega { .. })), "{value}");
    }
}

/// All intervals lead to the same solution; the Lanczos steps, which know more, take no more passes than the safe one.
#[test]
fn intervals_for_chebyshev() {
    let f = random_room(80, 0.1, 41);
    let (reflectance, exitance) = random_materials(80, 0.95, 42);
    let expected = solve_direct(&dense(&f), &reflectance, &exitance);
    let passes = |bounds| {
        let solution = run(&Chebyshev { bounds }, &system(&f, &reflectance, &exitance), &l2(1e-10));
        assert_eq!(solution.stop_reason, StopReason::Converged, "{bounds:?}");
        let error = relative_error(f.areas(), &solution.radiosity, &expected);
        assert!(error < 1e-9, "{bounds:?}: {error:e}");
        solution.n_passes
    };
    let safe = passes(SpectrumBounds::Safe);
    let lanczos = passes(SpectrumBounds::Lanczos(NonZeroUsize::new(8).unwrap()));
    passes(SpectrumBounds::Average);
    assert!(lanczos < safe, "{lanczos} {safe}");
    let lewis = LewisRoom::new(1);
    let raw = lewis.form_factors();
    let chebyshev = Chebyshev {
        bounds: SpectrumBounds::Lanczos(NonZeroUsize::MIN),
    };
    let refusal = chebyshev.solve(
        &system(&raw, &lewis.reflectance, &lewis.exitance),
        &l2(1e-6),
        &mut |_| ControlFlow::Continue(()),
    );
    assert!(matches!(refusal, Err(SolverError::NeedsReciprocity { .. })));
}

/// Emission is what is absorbed, at every step: Σ A (1 − ρ) H = Σ A E with ρ H = B − E on patches that reflect.
#[test]
fn the_display_estimate_conserves_energy() {
    let n = 60;
    let f = random_room(n, 0.1, 43);
    let rho: Vec<f64> = (0..n).map(|i| 0.3 + 0.01 * i as f64).collect();
    let reflectance = Block::from_values(rho.clone(), 1);
    let system = system(&f, &reflectance, &lamp(n));
    let emitted = f.areas()[0];
    let step = NonZeroUsize::new(1);
    let solvers: [&dyn Solver; 2] = [
        &ProgressiveRefinement { steps_per_pass: step },
        &Overshooting { steps_per_pass: step },
    ];
    for solver in solvers {
        let mut errors = Vec::new();
        let exact = run(by_name("pcg"), &system, &l2(1e-13)).radiosity;
        for n_steps in [1, 2, 5, 30, 200] {
            let options = SolveOptions {
                max_passes: n_steps,
                ..l2(1e-14)
            };
            let solution = run(solver, &system, &options);
            assert_eq!(solution.selections.iter().sum::<u64>(), n_steps as u64);
            let display = solution.display.unwrap();
            let absorbed: f64 = (0..n)
                .map(|i| {
                    let e = system.exitance().row(i)[0];
                    f.areas()[i] * (1.0 - rho[i]) * (display.row(i)[0] - e) / rho[i]
                })
                .sum();
            // Rounding of 200 steps.
            assert!(
                (absorbed / emitted - 1.0).abs() < 1e-12,
                "{} after {n_steps}: {absorbed}",
                solver.name()
            );
            let plain = relative_error(f.areas(), &solution.radiosity, &exact);
            let shown = relative_error(f.areas(), &display, &exact);
            assert!(shown < plain, "{} after {n_steps}: {shown} {plain}", solver.name());
            errors.push(shown);
        }
        assert!(errors[4] < 0.5 * errors[0], "{errors:?}");
    }
}

/// Form factors that are not reciprocal: columns come from a transposed copy, and the answer is that of the matrix as it is.
#[test]
fn shooting_without_reciprocity() {
    let room = LewisRoom::new(2);
    let f = room.form_factors();
    assert!(f.reciprocal_areas().is_none());
    let expected = solve_direct(&dense(&f), &room.reflectance, &room.exitance);
    for name in ["progressive-refinement", "overshooting"] {
        let solution = run(
            by_name(name),
            &system(&f, &room.reflectance, &room.exitance),
            &l2(1e-12),
        );
        assert_eq!(solution.stop_reason, StopReason::Converged, "{name}");
        let error = relative_error(f.areas(), &solution.radiosity, &expected);
        assert!(error < 1e-10, "{name}: {error:e}");
    }
}

/// Southwell by hand: the greatest power first, and nothing is left where all of it has been shot.
#[test]
fn the_greatest_power_shoots_first() {
    // Two plates that see half of one another.
    let f = matrix(&[1.0, 1.0], &[vec![0.0, 0.5], vec![0.5, 0.0]])
        .symmetrised()
        .unwrap();
    let reflectance = Block::from_values(vec![0.8, 0.4], 1);
    let exitance = Block::from_values(vec![1.0, 3.0], 1);
    let solver = ProgressiveRefinement {
        steps_per_pass: NonZeroUsize::new(1),
    };
    let after = |n: usize| {
        let options = SolveOptions {
            max_passes: n,
            ..l2(1e-300)
        };
        run(&solver, &system(&f, &reflectance, &exitance), &options)
    };
    // Plate 2 shoots 3, of which plate 1 keeps 0.8 · 0.5 · 3 = 1.2; then plate 1 shoots 2.2, of which plate 2 keeps 0.44.
    let one = after(1);
    assert_eq!(one.selections, [0, 1]);
    assert!((one.radiosity.values()[0] - 2.2).abs() < 1e-15 && (one.radiosity.values()[1] - 3.0).abs() < 1e-15);
    let two = after(2);
    assert_eq!(two.selections, [1, 1]);
    assert!((two.radiosity.values()[1] - 3.44).abs() < 1e-15);
}

/// Where areas spread, the residual's norm rises for long while power goes from large patches to small ones: patience goes by the power.
#[test]
fn patience_counts_power_that_is_not_used_up() {
    let n = 120;
    let f = random_room(n, 1e-3, 45);
    // The largest patch emits: everything it sends goes to smaller ones.
    let largest = (0..n).max_by(|&a, &b| f.areas()[a].total_cmp(&f.areas()[b])).unwrap();
    let mut exitance = vec![0.0; n];
    exitance[largest] = 1.0;
    let exitance = Block::from_values(exitance, 1);
    let solver = by_name("progressive-refinement");
    for rho in [0.9, 0.99] {
        let reflectance = constant(n, rho);
        let expected = solve_direct(&dense(&f), &reflectance, &exitance);
        let options = SolveOptions {
            patience: 1,
            max_passes: 100_000,
            ..l2(1e-8)
        };
        let solution = run(solver, &system(&f, &reflectance, &exitance), &options);
        assert_eq!(solution.stop_reason, StopReason::Converged, "ρ = {rho}");
        let error = relative_error(f.areas(), &solution.radiosity, &expected);
        assert!(error <= solution.error_bound.unwrap(), "ρ = {rho}: {error:e}");
    }
}

/// Steps make passes, patience and work, but no difference to the steps themselves.
#[test]
fn steps_per_pass_only_divide_the_work() {
    let f = random_room(50, 0.1, 44);
    let (reflectance, exitance) = (constant(50, 0.8), lamp(50));
    let system = system(&f, &reflectance, &exitance);
    let options = SolveOptions {
        tolerance: Tolerance::ResidualMaxPower(1e-6),
        max_passes: 100_000,
        start: Start::Zero,
        ..SolveOptions::default()
    };
    for name in ["progressive-refinement", "overshooting"] {
        let with = |steps_per_pass: Option<NonZeroUsize>| {
            let mut settings = SolverSettings::default();
            if let Some(steps) = steps_per_pass {
                settings.values.set(&STEPS_PER_PASS, steps);
            }
            run(&*solver::solver(name, &settings).unwrap(), &system, &options)
        };
        let (whole, fine) = (with(None), with(NonZeroUsize::new(7)));
        assert_eq!(whole.stop_reason, StopReason::Converged);
        assert_eq!(
            whole.selections.iter().sum::<u64>(),
            fine.selections.iter().sum::<u64>(),
            "{name}"
        );
        let work = fine.history.last().unwrap().work;
        assert!(
            (work * 50.0 - fine.selections.iter().sum::<u64>() as f64).abs() < 1e-6,
            "{name}: {work}"
        );
    }
}

/// What many small patches leave unshot, each below the tolerance, a large one collects: the radiosities do not meet the tolerance yet, and the steps go on until they do.
#[test]
fn a_tolerance_in_watts_is_met_where_one_patch_is_large() {
    for share in [0.02, 0.1, 0.3, 0.6] {
        let mut areas = vec![1.0; 200];
        areas.push(200.0 * share / (1.0 - share));
        let f = mixing_room(&areas);
        let (reflectance, exitance) = (constant(201, 0.9), lamp(201));
        let expected = solve_direct(&dense(&f), &reflectance, &exitance);
        for name in ["progressive-refinement", "overshooting"] {
            let options = SolveOptions {
                tolerance: Tolerance::ResidualMaxPower(1e-6),
                ..l2(1e-6)
            };
            let solution = run(by_name(name), &system(&f, &reflectance, &exitance), &options);
            assert_eq!(solution.stop_reason, StopReason::Converged, "{name} {share}");
            assert!(solution.residual_max_power <= 1e-6, "{name} {share}");
            // |r| A is at most 1e-6 W at each of 201 patches, and ten times as much is under way.
            let error = relative_error(&areas, &solution.radiosity, &expected);
            assert!(error < 1e-4, "{name} {share}: {error:e}");
        }
    }
}
