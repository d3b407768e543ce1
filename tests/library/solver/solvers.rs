//! Every solver against direct solutions, closed forms and published numbers.

#![expect(clippy::shadow_unrelated, reason = "every step of a test names its own results")]

use std::ops::ControlFlow;

use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::solver::{HistoryEntry, Solution, SolveOptions, Solver, SolverError, Start, StopReason, Tolerance};

use crate::support::solving::{all, by_name, channel, constant, l2, random_materials, run, system};
use crate::support::{LewisRoom, bits, dense, random_room, relative_error, solve_direct};

/// The solvers that choose patches one by one.
const SELECTING: [&str; 2] = ["progressive-refinement", "overshooting"];

#[test]
fn agrees_with_a_direct_solve() {
    let f = random_room(60, 0.01, 1);
    let (reflectance, exitance) = random_materials(60, 0.95, 2);
    let expected = solve_direct(&dense(&f), &reflectance, &exitance);
    let system = system(&f, &reflectance, &exitance);
    for solver in all() {
        for start in [Start::Exitance, Start::Zero, Start::Ambient] {
            let options = SolveOptions { start, ..l2(1e-13) };
            let solution = run(solver, &system, &options);
            assert_eq!(
                solution.stop_reason,
                StopReason::Converged,
                "{} {start:?}",
                solver.name()
            );
            let error = relative_error(f.areas(), &solution.radiosity, &expected);
            assert!(error < 1e-12, "{} {start:?}: {error:e}", solver.name());
            let mut irradiance = Block::zeros(60, 3);
            f.apply(&solution.radiosity, &mut irradiance);
            let difference = relative_error(f.areas(), &solution.irradiance, &irradiance);
            assert!(difference < 1e-15, "irradiance is F B: {difference:e}");
        }
    }
}

#[test]
fn reports_the_true_residual() {
    let f = random_room(40, 0.1, 3);
    let (reflectance, exitance) = random_materials(40, 0.9, 4);
    let system = system(&f, &reflectance, &exitance);
    for solver in all() {
        let solution = run(solver, &system, &l2(1e-5));
        let (mut worst_l2, mut worst_power) = (0.0_f64, 0.0_f64);
        for c in 0..3 {
            let (mut above, mut below) = (0.0, 0.0);
            for i in 0..40 {
                let gathered: f64 = (0..40).map(|j| f.get(i, j) * solution.radiosity.row(j)[c]).sum();
                let r = exitance.row(i)[c] + reflectance.row(i)[c] * gathered - solution.radiosity.row(i)[c];
                above += f.areas()[i] * r * r;
                below += f.areas()[i] * exitance.row(i)[c].powi(2);
                worst_power = worst_power.max((f.areas()[i] * r).abs());
            }
            worst_l2 = worst_l2.max((above / below).sqrt());
        }
        assert!(
            // Sums in another order differ by about 1e-16 of the terms, which are near 1.
            (solution.residual_l2 - worst_l2).abs() < 1e-8 * worst_l2 + 1e-15,
            "{}",
            solver.name()
        );
        assert!(
            (solution.residual_max_power - worst_power).abs() < 1e-8 * worst_power + 1e-14,
            "{}",
            solver.name()
        );
        assert!(solution.residual_l2 <= 1e-5);
        let last = solution.history.last().unwrap();
        assert!(!last.estimated && last.pass == solution.n_passes);
        assert_eq!(last.residual_l2.to_bits(), solution.residual_l2.to_bits());
    }
}

/// In a closed room with uniform ρ and E, B = E / (1 − ρ).
#[test]
fn furnace() {
    let f = random_room(50, 1e-3, 5);
    for rho in [0.0, 0.5, 0.9, 0.99] {
        let system = system(&f, &constant(50, rho), &constant(50, 2.0));
        for solver in all() {
            // Without a preconditioner, and where patches are chosen by their power, rounding counts by the spread of A / ρ, a thousandfold here.
            let by_power = ["cg", "progressive-refinement", "overshooting"].contains(&solver.name());
            let tolerance = if by_power { 1e-10 } else { 1e-12 };
            let options = SolveOptions {
                // While the powerful patches shoot, light gathers unshot on the small ones, and the residual rises for many passes.
                patience: if by_power { 5000 } else { 50 },
                ..l2(tolerance)
            };
            let solution = run(solver, &system, &options);
            assert_eq!(solution.stop_reason, StopReason::Converged, "{} {rho}", solver.name());
            for (&b, area) in solution.radiosity.values().iter().zip(f.areas()) {
                let error = (b * (1.0 - rho) / 2.0 - 1.0).abs();
                // There an entry may err by as much as its area allows it.
                let total: f64 = f.areas().iter().sum();
                let share = if by_power { (total / area).sqrt() } else { 1.0 };
                assert!(
                    error < 2.0 * tolerance * share / (1.0 - rho),
                    "{} ρ = {rho}: {error:e}",
                    solver.name()
                );
            }
        }
    }
}

/// Values of an independent f64 solution of Lewis's room, and the passes of Gauss-Seidel in Lewis 1992, table 2.
#[test]
fn lewis_room() {
    let walls = [
        (
            0,
            [
                0.025_926_661_7,
                0.072_224_272_0,
                0.049_932_830_0,
                0.092_978_373_2,
                0.112_348_867_6,
                0.320_682_200_9,
            ],
        ),
        (
            3,
            [
                0.024_413_582_0,
                0.070_834_220_0,
                0.047_374_014_7,
                0.091_193_218_0,
                0.113_734_641_0,
                0.320_329_636_4,
            ],
        ),
        (
            4,
            [
                0.025_008_182_0,
                0.072_187_937_7,
                0.048_525_134_9,
                0.092_998_457_7,
                0.116_539_703_7,
                0.322_128_072_9,
            ],
        ),
    ];
    let gauss_seidel = by_name("gauss-seidel");
    for (l, expected) in walls {
        let room = LewisRoom::new(l);
        let f = room.form_factors();
        let solution = run(gauss_seidel, &system(&f, &room.reflectance, &room.exitance), &l2(1e-13));
        for (wall, expected) in solution.radiosity.values().chunks(room.patches_per_wall).zip(expected) {
            let mean = wall.iter().sum::<f64>() / wall.len() as f64;
            assert!((mean - expected).abs() < 1e-10, "l = {l}: {mean} for {expected}");
        }
        if l == 3 {
            let alpha = [(0, 1.239_114_481_156), (3, 1.117_015_814_881), (27, 1.007_248_054_315)];
            assert!(alpha.iter().all(|&(i, value)| (room.alpha[i] - value).abs() < 1e-12));
            assert!((f.get(0, 128) - 0.256_884_969_891_37).abs() < 1e-14);
            let values = [
                (0, 0.015_229_383_123),
                (27, 0.028_533_420_881),
                (128, 0.028_609_209_866),
                (292, 0.137_985_030_558),
                (347, 1.073_311_996_705),
            ];
            for (patch, expected) in values {
                let u = solution.radiosity.values()[patch];
                assert!((u - expected).abs() < 1e-12, "u[{patch}] = {u} for {expected}");
            }
        }
    }
    for (l, n_passes) in [(1, 11), (2, 11), (3, 11), (4, 12)] {
        let room = LewisRoom::new(l);
        let f = room.form_factors();
        let options = SolveOptions {
            tolerance: Tolerance::ResidualMax(2.5e-5),
            ..SolveOptions::default()
        };
        let solution = run(gauss_seidel, &system(&f, &room.reflectance, &room.exitance), &options);
        assert_eq!((solution.n_passes, solution.n_checks), (n_passes, 1), "l = {l}");
    }
}

/// Two walls of Lewis's room reflect everything, so that no bound follows from one reflection.
#[test]
fn the_error_bound_holds_and_is_not_far_off() {
    let lewis = LewisRoom::new(2);
    let lewis_f = lewis.form_factors();
    let repaired = lewis_f.symmetrised().unwrap();
    let (repaired, _) = repaired.balanced(&[1.0; 96], 1e-13, 1000).unwrap();
    let room = random_room(40, 0.01, 6);
    let (reflectance, exitance) = random_materials(40, 0.9, 7);
    let cases = [
        (&lewis_f, &lewis.reflectance, &lewis.exitance),
        (&repaired, &lewis.reflectance, &lewis.exitance),
        (&room, &reflectance, &exitance),
    ];
    for (f, reflectance, exitance) in cases {
        let expected = solve_direct(&dense(f), reflectance, exitance);
        let system = system(f, reflectance, exitance);
        for solver in all() {
            for tolerance in [1e-2, 1e-5, 1e-8] {
                let options = SolveOptions {
                    allow_nonreciprocal: true,
                    ..l2(tolerance)
                };
                let solution = run(solver, &system, &options);
                // Relative to the radiosities found, as the bound is; what was expected is known to 1e-14.
                let error = relative_error(f.areas(), &expected, &solution.radiosity);
                let bound = solution.error_bound.unwrap();
                assert!(error <= bound + 1e-14, "{}: {error:e} above {bound:e}", solver.name());
                assert!(
                    // What rounding can do is bounded as well: 1.2e-14 to 1.8e-14 here, before it is amplified.
                    bound < 200.0 * error.max(5e-15),
                    "{}: {error:e} far below {bound:e}",
                    solver.name()
                );
            }
        }
    }
}

#[test]
fn an_ambient_start_saves_passes() {
    let f = random_room(60, 0.1, 17);
    let mut emission = vec![0.0; 60];
    emission[3] = 1.0;
    let system = system(&f, &constant(60, 0.9), &Block::from_values(emission, 1));
    let gauss_seidel = by_name("gauss-seidel");
    let plain = run(gauss_seidel, &system, &l2(1e-3));
    let ambient = run(
        gauss_seidel,
        &system,
        &SolveOptions {
            start: Start::Ambient,
            ..l2(1e-3)
        },
    );
    assert!(
        2 * ambient.n_passes < plain.n_passes,
        "{} for {}",
        ambient.n_passes,
        plain.n_passes
    );
}

#[test]
fn channels_do_not_influence_each_other() {
    let f = random_room(45, 0.01, 18);
    let (reflectance, exitance) = random_materials(45, 0.95, 19);
    for solver in all() {
        if SELECTING.contains(&solver.name()) {
            continue; // All channels together decide which patch is next.
        }
        // With a tolerance out of reach the others do the same number of passes in both cases.
        let fixed = SolveOptions {
            max_passes: 7,
            ..l2(1e-300)
        };
        // Channels of the others rest as they meet the tolerance.
        let rests = ["cg", "pcg", "gmres", "anderson", "direct", "auto"].contains(&solver.name());
        let options = if rests { l2(1e-8) } else { fixed };
        let together = run(solver, &system(&f, &reflectance, &exitance), &options);
        for c in 0..3 {
            let alone = run(
                solver,
                &system(&f, &channel(&reflectance, c), &channel(&exitance, c)),
                &options,
            );
            let taken = |solution: &Solution| solution.choice.as_ref().map(|choice| choice.solver);
            if taken(&alone) != taken(&together) {
                continue; // Another solver may be the fastest for more channels.
            }
            assert_eq!(
                bits(alone.radiosity.values()),
                bits(channel(&together.radiosity, c).values()),
                "{}",
                solver.name()
            );
        }
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let f = random_room(100, 0.01, 20);
    let (reflectance, exitance) = random_materials(100, 0.95, 21);
    let in_pool = |n_threads: usize, solver: &dyn Solver| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| run(solver, &system(&f, &reflectance, &exitance), &l2(1e-9)))
    };
    for solver in all() {
        let one = in_pool(1, solver);
        for n_threads in [2, 5] {
            let many = in_pool(n_threads, solver);
            assert_eq!(
                bits(one.radiosity.values()),
                bits(many.radiosity.values()),
                "{}",
                solver.name()
            );
            assert_eq!(
                bits(one.irradiance.values()),
                bits(many.irradiance.values()),
                "{}",
                solver.name()
            );
            assert_eq!(one.residual_l2.to_bits(), many.residual_l2.to_bits());
        }
    }
}

#[test]
fn budgets_and_interruptions() {
    let f = random_room(40, 0.1, 28);
    let (reflectance, exitance) = random_materials(40, 0.95, 29);
    let system = system(&f, &reflectance, &exitance);
    // One pass of a factorisation is all it takes, for `auto` too, which takes it for so few patches.
    for solver in all().filter(|s| !["direct", "auto"].contains(&s.name())) {
        let solution = run(
            solver,
            &system,
            &SolveOptions {
                max_passes: 3,
                ..l2(1e-12)
            },
        );
        assert_eq!(
            (solution.stop_reason, solution.n_passes),
            (StopReason::MaxPasses, 3),
            "{}",
            solver.name()
        );
        let passes: Vec<usize> = solution.history.iter().map(|entry| entry.pass).collect();
        assert_eq!(passes[passes.len() - 3..], [1, 2, 3]);
        let mut monitor = |entry: &HistoryEntry| {
            if entry.pass < 2 {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        };
        let solution = solver.solve(&system, &l2(1e-12), &mut monitor).unwrap();
        assert_eq!(
            (solution.stop_reason, solution.n_passes),
            (StopReason::Interrupted, 2),
            "{}",
            solver.name()
        );
    }
}

#[test]
fn absolute_tolerances_are_in_their_units() {
    let f = random_room(40, 0.1, 30);
    let (reflectance, exitance) = random_materials(40, 0.9, 31);
    let system = system(&f, &reflectance, &exitance);
    for solver in all() {
        for tolerance in [Tolerance::ResidualMaxPower(1e-7), Tolerance::ResidualMax(1e-7)] {
            let solution = run(
                solver,
                &system,
                &SolveOptions {
                    tolerance,
                    ..SolveOptions::default()
                },
            );
            assert_eq!(solution.stop_reason, StopReason::Converged);
            let area_min = f.areas().iter().copied().fold(1.0, f64::min);
            let relaxed = if matches!(tolerance, Tolerance::ResidualMax(_)) {
                1.0
            } else {
                1.0 / area_min
            };
            for i in 0..40 {
                for c in 0..3 {
                    let h = solution.irradiance.row(i)[c];
                    let r = exitance.row(i)[c] + reflectance.row(i)[c] * h - solution.radiosity.row(i)[c];
                    assert!(r.abs() <= 1e-7 * relaxed * (1.0 + 1e-6), "{}: {r:e}", solver.name());
                }
            }
        }
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let refusal = solver.solve(&system, &l2(value), &mut |_| ControlFlow::Continue(()));
            assert!(matches!(refusal, Err(SolverError::Tolerance { .. })));
        }
    }
}

#[test]
fn stop_reasons_have_stable_names() {
    let reasons = [
        StopReason::Converged,
        StopReason::MaxPasses,
        StopReason::Stagnated,
        StopReason::Diverged,
    ];
    let names = reasons.map(|reason| serde_json::to_string(&reason).unwrap());
    assert_eq!(
        names,
        ["\"converged\"", "\"max_passes\"", "\"stagnated\"", "\"diverged\""]
    );
}
