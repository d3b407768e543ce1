//! Every solver on extreme, singular, noisy and invalid systems.

#![expect(clippy::shadow_unrelated, reason = "every step of a test names its own results")]

use std::ops::ControlFlow;

use radiosity::matrix::FormFactors;
use radiosity::matrix::operator::Block;
use radiosity::solver::{
    Deflate, HistoryEntry, Pcg, RadiositySystem, SolveOptions, SolverError, SolverSettings, Start, StopReason,
};

use crate::support::solving::{all, by_name, channel, constant, l2, random_materials, run, system};
use crate::support::{LewisRoom, Uniform, bits, dense, matrix, random_room, relative_error, solve_direct};

/// The same light at any unit of length and power: neither squares nor tolerances depend on it.
#[test]
fn units_do_not_matter() {
    let f = random_room(30, 0.01, 8);
    let (reflectance, exitance) = random_materials(30, 0.9, 9);
    for solver in all() {
        let base = run(solver, &system(&f, &reflectance, &exitance), &l2(1e-6));
        for (length, light) in [
            (1e-6, 1.0),
            (1e6, 1.0),
            (1e6, 1e294),
            (1e-6, 1e-294),
            (1.0, 1e-30),
            (1.0, 1e30),
            (1e-75, 1e-300),
            (1e75, 1e300),
        ] {
            let areas: Vec<f64> = f.areas().iter().map(|a| a * length * length).collect();
            let scaled_f = matrix(&areas, &dense(&f)).symmetrised().unwrap();
            let scaled_e = exitance.values().iter().map(|e| e * light).collect();
            let scaled_e = Block::from_values(scaled_e, 3);
            let solution = run(solver, &system(&scaled_f, &reflectance, &scaled_e), &l2(1e-6));
            assert_eq!(solution.stop_reason, StopReason::Converged);
            assert_eq!(
                solution.n_passes,
                base.n_passes,
                "{} at {length:e}, {light:e}",
                solver.name()
            );
            let pairs = solution.radiosity.values().iter().zip(base.radiosity.values());
            let error = pairs
                .map(|(b, expected)| (b / light / expected - 1.0).abs())
                .fold(0.0, f64::max);
            // Without a preconditioner rounding decides among answers that are equally good: small patches by their areas' share less so.
            let (limit, ratio) = if solver.name() == "cg" {
                (1e-4, 1.0)
            } else {
                (1e-12, 1e-6)
            };
            assert!(error < limit, "{} at {length:e}, {light:e}: {error:e}", solver.name());
            // A factorisation leaves nothing but rounding, about 1e-15, which units change.
            assert!((solution.residual_l2 - base.residual_l2).abs() < ratio * base.residual_l2 + 1e-14);
            let watt = length * length * light;
            if solver.name() != "cg" && watt.is_normal() && (1e3 * watt).is_finite() {
                let off = solution.residual_max_power / watt - base.residual_max_power;
                let limit = ratio * base.residual_max_power + 1e-14;
                assert!(off.abs() < limit, "{} at {length:e}, {light:e}: {off:e}", solver.name());
                for (energy, expected) in solution.energy.iter().zip(&base.energy) {
                    let off = energy.leaving / watt / expected.leaving - 1.0;
                    assert!(off.abs() < 1e-9, "{} at {length:e}, {light:e}: {off:e}", solver.name());
                    assert!((energy.imbalance() - expected.imbalance()).abs() < 1e-6);
                }
            }
        }
    }
}

#[test]
fn areas_that_differ_by_1e8() {
    let f = random_room(40, 1e-8, 10);
    let spread = f.areas().iter().copied().fold(1.0, f64::min);
    assert!(spread < 1e-7);
    let (reflectance, exitance) = random_materials(40, 0.95, 11);
    let expected = solve_direct(&dense(&f), &reflectance, &exitance);
    for solver in all() {
        let solution = run(solver, &system(&f, &reflectance, &exitance), &l2(1e-9));
        assert_eq!(solution.stop_reason, StopReason::Converged);
        for (b, expected) in solution.radiosity.values().iter().zip(expected.values()) {
            assert!(
                (b - expected).abs() <= 1e-4 * expected,
                "{}: {b} for {expected}",
                solver.name()
            );
        }
        assert!(relative_error(f.areas(), &solution.radiosity, &expected) < 1e-7);
    }
}

#[test]
fn nearly_white_rooms() {
    let f = random_room(60, 0.1, 12);
    let mut emission = vec![0.0; 60];
    emission[7] = 1.0;
    let exitance = Block::from_values(emission, 1);
    for dark in [1e-2, 1e-4, 1e-8] {
        let mut uniform = Uniform(13);
        let reflectance = (0..60).map(|_| 1.0 - 2.0 * dark * uniform.next()).collect();
        let reflectance = Block::from_values(reflectance, 1);
        let expected = solve_direct(&dense(&f), &reflectance, &exitance);
        let solution = run(by_name("pcg"), &system(&f, &reflectance, &exitance), &l2(1e-6));
        assert_eq!(solution.stop_reason, StopReason::Converged);
        assert!(
            solution.n_passes <= 12,
            "1 − ρ = {dark:e}: {} passes",
            solution.n_passes
        );
        let error = relative_error(f.areas(), &solution.radiosity, &expected);
        assert!(error < 1e-6, "1 − ρ = {dark:e}: {error:e}");
    }
}

#[test]
fn black_patches() {
    let f = random_room(20, 0.1, 14);
    let (_, exitance) = random_materials(20, 0.9, 15);
    for solver in all() {
        let solution = run(solver, &system(&f, &Block::zeros(20, 3), &exitance), &l2(1e-12));
        assert_eq!(
            bits(solution.radiosity.values()),
            bits(exitance.values()),
            "{}",
            solver.name()
        );
        assert_eq!(solution.stop_reason, StopReason::Converged);
        // A reflectance at the edge of f64 must not unbalance the others.
        let mut reflectance = Block::zeros(20, 3);
        for (k, rho) in reflectance.values_mut().iter_mut().enumerate() {
            *rho = [0.0, 1e-300, 0.5, 0.9][k % 4];
        }
        let solution = run(solver, &system(&f, &reflectance, &exitance), &l2(1e-12));
        let expected = solve_direct(&dense(&f), &reflectance, &exitance);
        assert_eq!(solution.stop_reason, StopReason::Converged);
        assert!(relative_error(f.areas(), &solution.radiosity, &expected) < 1e-11);
    }
}

#[test]
fn darkness_takes_no_pass() {
    let f = random_room(10, 0.1, 16);
    for solver in all() {
        let solution = run(solver, &system(&f, &constant(10, 1.0), &constant(10, 0.0)), &l2(1e-12));
        assert_eq!(solution.stop_reason, StopReason::Converged);
        assert_eq!(solution.n_passes, 0);
        assert_eq!(bits(solution.radiosity.values()), vec![0; 10]);
        assert_eq!(solution.error_bound.unwrap().to_bits(), 0);
    }
}

#[test]
fn one_patch() {
    for (f_ii, rho, expected) in [(1.0, 0.75, 4.0), (0.5, 1.0, 2.0), (0.0, 1.0, 1.0)] {
        let f = matrix(&[2.0], &[vec![f_ii]]).symmetrised().unwrap();
        for solver in all() {
            let solution = run(solver, &system(&f, &constant(1, rho), &constant(1, 1.0)), &l2(1e-12));
            assert_eq!(solution.stop_reason, StopReason::Converged, "{}", solver.name());
            // The residual that is left, divided by what a reflection loses.
            let error = (solution.radiosity.values()[0] - expected).abs();
            assert!(error < 1.01e-12 / (1.0 - rho * f_ii), "{}: {error:e}", solver.name());
        }
    }
}

/// Two rooms that do not see each other, of two plates each.
fn two_rooms() -> FormFactors {
    let row = |j: usize| (0..4).map(|k| f64::from(u8::from(k == j))).collect();
    matrix(&[1.0; 4], &[row(1), row(0), row(3), row(2)])
        .symmetrised()
        .unwrap()
}

#[test]
fn white_rooms_have_no_finite_solution_where_they_are_lit() {
    let f = two_rooms();
    let new = |rho: [f64; 4], e: [f64; 4]| {
        let blocks = [rho, e].map(|values| Block::from_values(values.to_vec(), 1));
        let [reflectance, exitance] = blocks;
        RadiositySystem::new(&f, f.areas().to_vec(), reflectance, exitance).map(|_| ())
    };
    let refused = Err(SolverError::NoFiniteSolution {
        component: 1,
        n_patches: 2,
        patch: 3,
        channel: 0,
    });
    assert_eq!(new([0.5, 0.5, 1.0, 1.0], [1.0, 0.0, 0.0, 1e-30]), refused);
    assert_eq!(
        new([1.0, 1.0, 0.5, 0.5], [0.0, 0.0, 0.0, 1.0]),
        Ok(()),
        "the white room is dark"
    );
    assert_eq!(
        new([0.5, 1.0, 1.0, 0.999], [1.0, 0.0, 0.0, 1.0]),
        Ok(()),
        "both rooms absorb"
    );
    let open = matrix(&[1.0; 2], &[vec![0.0, 0.99], vec![0.99, 0.0]]);
    let white = RadiositySystem::new(&open, vec![1.0; 2], constant(2, 1.0), constant(2, 1.0));
    let solution = run(by_name("gauss-seidel"), &white.unwrap(), &l2(1e-12));
    assert!(
        (solution.radiosity.values()[0] / 100.0 - 1.0).abs() < 1e-9,
        "light leaves an open white room"
    );
}

/// A white, dark room beside a lit one: it stays dark, whatever the start, and nothing is singular.
#[test]
fn light_stays_in_its_component() {
    let f = two_rooms();
    let reflectance = Block::from_values(vec![0.9, 0.8, 1.0, 1.0], 1);
    let exitance = Block::from_values(vec![1.0, 0.0, 0.0, 0.0], 1);
    for solver in all() {
        for start in [Start::Exitance, Start::Zero, Start::Ambient] {
            let options = SolveOptions { start, ..l2(1e-13) };
            let solution = run(solver, &system(&f, &reflectance, &exitance), &options);
            assert_eq!(solution.stop_reason, StopReason::Converged);
            let b = solution.radiosity.values();
            assert!(
                (b[0] - 1.0 / 0.28).abs() < 1e-11 && (b[1] - 0.8 / 0.28).abs() < 1e-11,
                "{b:?}"
            );
            assert!(b[2].abs() < 1e-300 && b[3].abs() < 1e-300);
        }
    }
}

/// Two rooms, of which only the other one is lit as bright: none is called solved for the sake of the other, and what has no solution of light in the dim one is found out.
#[test]
fn a_bright_room_does_not_speak_for_a_dim_one() {
    let (n, dim_light) = (40, 1e-7);
    let rooms = [random_room(n, 0.1, 31), random_room(n, 0.1, 32)];
    let areas: Vec<f64> = rooms.iter().flat_map(|room| room.areas().to_vec()).collect();
    let side_by_side = |factor: f64| {
        let mut rows = vec![vec![0.0; 2 * n]; 2 * n];
        for (k, room) in rooms.iter().enumerate() {
            for (i, row) in dense(room).iter().enumerate() {
                for (j, f) in row.iter().enumerate() {
                    rows[k * n + i][k * n + j] = factor * f;
                }
            }
        }
        matrix(&areas, &rows).symmetrised().unwrap()
    };
    let rho = |i: usize| if i < n { 0.5 } else { 0.99 };
    let reflectance = Block::from_values((0..2 * n).map(rho).collect(), 1);
    let light = |i: usize| match i {
        0 => 1.0,
        _ if i == n => dim_light,
        _ => 0.0,
    };
    let exitance = Block::from_values((0..2 * n).map(light).collect(), 1);
    let f = side_by_side(1.0);
    let lit = system(&f, &reflectance, &exitance);
    let expected = solve_direct(&dense(&f), &reflectance, &exitance);
    let dim = |b: &Block| Block::from_values(b.values()[n..].to_vec(), 1);
    for solver in all() {
        let options = SolveOptions {
            max_passes: 3000,
            ..l2(1e-6)
        };
        let solution = run(solver, &lit, &options);
        assert_eq!(solution.stop_reason, StopReason::Converged, "{}", solver.name());
        let error = relative_error(&areas[n..], &dim(&solution.radiosity), &dim(&expected));
        // A residual of 1e-6 of the dim room's own light, over 1 − ρ, at most.
        assert!(error < 1e-4, "{}: {error:e}", solver.name());
    }
    let f = side_by_side(1.02);
    let impossible = system(&f, &reflectance, &exitance);
    for solver in all() {
        let solution = run(solver, &impossible, &l2(1e-6));
        assert_ne!(solution.stop_reason, StopReason::Converged, "{}", solver.name());
    }
}

/// Channels that have no solution do not keep others from theirs, and each tells of its own.
#[test]
fn a_channel_that_fails_does_not_speak_for_the_others() {
    let n = 40;
    let f = random_room(n, 0.1, 33);
    let rho = |c: usize| if c == 1 { 1.0 - 1e-13 } else { 0.95 };
    let reflectance = Block::from_values((0..3 * n).map(|k| rho(k % 3)).collect(), 3);
    let exitance = Block::from_values((0..3 * n).map(|k| if k < 3 { 1.0 } else { 0.0 }).collect(), 3);
    let three = system(&f, &reflectance, &exitance);
    for name in ["jacobi", "gauss-seidel", "sor", "pcg", "gmres"] {
        let solution = run(by_name(name), &three, &l2(1e-9));
        let reasons: Vec<_> = solution.channels.iter().map(|own| own.stop_reason).collect();
        assert_ne!(solution.stop_reason, StopReason::Converged, "{name}");
        assert_eq!(
            (reasons[0], reasons[2]),
            (StopReason::Converged, StopReason::Converged),
            "{name}"
        );
        assert_ne!(reasons[1], StopReason::Converged, "{name}");
        let own = &solution.channels[0];
        assert!(
            own.residual_l2 <= 1e-9 && own.residual_l2 < solution.residual_l2,
            "{name}"
        );
    }
}

#[test]
fn conjugate_gradients_refuse_what_is_not_reciprocal() {
    let room = LewisRoom::new(1);
    let f = room.form_factors();
    let system = system(&f, &room.reflectance, &room.exitance);
    let pcg = by_name("pcg");
    let refusal = pcg.solve(&system, &l2(1e-6), &mut |_| ControlFlow::Continue(()));
    assert_eq!(refusal.unwrap_err(), SolverError::NeedsReciprocity { solver: "pcg" });
}

/// Form factors that are wrong by 2 % make the system indefinite from ρ = 1 / 1.02 on; the answer would be negative.
#[test]
fn row_sums_above_one_are_found_out() {
    let closed = random_room(40, 0.1, 22);
    let rows: Vec<Vec<f64>> = dense(&closed)
        .iter()
        .map(|row| row.iter().map(|f| 1.02 * f).collect())
        .collect();
    let f = matrix(closed.areas(), &rows).symmetrised().unwrap();
    let mut emission = vec![0.0; 40];
    emission[0] = 1.0;
    let exitance = Block::from_values(emission, 1);
    let definite = run(by_name("pcg"), &system(&f, &constant(40, 0.98), &exitance), &l2(1e-6));
    assert_eq!(definite.stop_reason, StopReason::Converged);
    for solver in all() {
        let solution = run(solver, &system(&f, &constant(40, 0.99), &exitance), &l2(1e-6));
        // Where patches are chosen one by one, or passes weighed, the residual does not grow in every pass.
        let uneven = ["progressive-refinement", "overshooting", "chebyshev"].contains(&solver.name());
        let by_steps = uneven && solution.stop_reason == StopReason::Stagnated;
        assert!(
            by_steps || solution.stop_reason == StopReason::Diverged,
            "{} {:?}",
            solver.name(),
            solution.stop_reason
        );
        assert_eq!(solution.error_bound, None);
    }
}

/// Form factors of a closed room with multiplicative noise: rows sum to 1, reciprocity is off by up to a factor.
fn noisy_room(n: usize, noise: f64, seed: u64) -> FormFactors {
    let room = random_room(n, 0.5, seed);
    let mut uniform = Uniform(seed + 1);
    let mut rows = dense(&room);
    for row in &mut rows {
        for f in row.iter_mut() {
            *f *= 1.0 + noise * (2.0 * uniform.next() - 1.0);
        }
        let sum: f64 = row.iter().sum();
        for f in row.iter_mut() {
            *f /= sum;
        }
    }
    matrix(room.areas(), &rows)
}

/// Without symmetry conjugate gradients need not converge; the solution must say so.
#[test]
fn noise_is_not_called_convergence() {
    let f = noisy_room(60, 0.9, 23);
    let mut emission = vec![0.0; 60];
    emission[5] = 1.0;
    let (reflectance, exitance) = (constant(60, 0.95), Block::from_values(emission, 1));
    let options = SolveOptions {
        allow_nonreciprocal: true,
        ..l2(1e-11)
    };
    // Deflation, which every pass restores, would get there.
    let plain = Pcg {
        deflation: Deflate::Never,
    };
    let solution = run(&plain, &system(&f, &reflectance, &exitance), &options);
    // The residual falls and rises in long waves: which of them ends it says nothing.
    let gave_up = [StopReason::Stagnated, StopReason::Diverged].contains(&solution.stop_reason);
    assert!(gave_up, "{:?} after {}", solution.stop_reason, solution.n_passes);
    assert!(solution.residual_l2 > 1e-11);
    let expected = solve_direct(&dense(&f), &reflectance, &exitance);
    let error = relative_error(f.areas(), &solution.radiosity, &expected);
    assert!(error <= solution.error_bound.unwrap());
}

/// The recurrence of conjugate gradients goes on falling where rounding keeps the true residual up.
#[test]
fn a_tolerance_below_rounding_stagnates() {
    let f = random_room(40, 0.1, 26);
    let (reflectance, exitance) = random_materials(40, 0.9, 27);
    for solver in all() {
        let mut claims = 0;
        let system = system(&f, &reflectance, &exitance);
        let mut monitor = |entry: &HistoryEntry| {
            claims += u32::from(entry.estimated && entry.residual_l2 <= 1e-17);
            ControlFlow::Continue(())
        };
        let solution = solver.solve(&system, &l2(1e-17), &mut monitor).unwrap();
        assert_eq!(solution.stop_reason, StopReason::Stagnated, "{}", solver.name());
        assert!(solution.residual_l2 < 1e-14 && solution.residual_l2 > 1e-17);
        let recurs = ["pcg", "gmres", "cg", "progressive-refinement", "overshooting"].contains(&solver.name());
        assert_eq!(claims > 0, recurs, "{}", solver.name());
    }
}

#[test]
fn bad_systems_are_refused() {
    let f = random_room(3, 0.1, 32);
    let new = |areas: &[f64], rho: &[f64], e: &[f64], n_channels: usize| {
        let (rho, e) = (
            Block::from_values(rho.to_vec(), n_channels),
            Block::from_values(e.to_vec(), 1),
        );
        RadiositySystem::new(&f, areas.to_vec(), rho, e)
            .map(|_| ())
            .unwrap_err()
    };
    let ones = [1.0; 3];
    let shape = |what, found| SolverError::Shape {
        what,
        expected: 3,
        found,
    };
    assert_eq!(new(&[1.0; 2], &ones, &ones, 1), shape("areas", 2));
    assert_eq!(new(&ones, &[0.5; 2], &ones, 1), shape("rows of reflectance", 2));
    assert_eq!(new(&ones, &[0.5; 3], &[1.0; 4], 1), shape("rows of exitance", 4));
    assert!(matches!(
        new(&ones, &[0.5; 6], &ones, 2),
        SolverError::Shape {
            what: "channels of reflectance",
            expected: 1,
            found: 2
        }
    ));
    assert_eq!(
        new(&[1.0, 0.0, 1.0], &ones, &ones, 1),
        SolverError::Area { patch: 1, area: 0.0 }
    );
    for reflectance in [-1e-9, 1.000_000_1] {
        let expected = SolverError::Reflectance {
            patch: 2,
            channel: 0,
            reflectance,
        };
        assert_eq!(new(&ones, &[0.5, 0.5, reflectance], &ones, 1), expected);
    }
    let error = new(&ones, &[f64::NAN, 0.5, 0.5], &ones, 1);
    assert!(matches!(error, SolverError::Reflectance { patch: 0, .. }));
    let error = new(&ones, &[0.5; 3], &[1.0, -1.0, 0.0], 1);
    assert_eq!(
        error,
        SolverError::Exitance {
            patch: 1,
            channel: 0,
            exitance: -1.0
        }
    );
    let error = new(&ones, &[0.5; 3], &[1.0, 1.0, f64::INFINITY], 1);
    assert!(matches!(error, SolverError::Exitance { patch: 2, .. }));
}

/// A closed, white room whose exitances balance: the solution is determined but for a constant, and its mean is zero.
#[test]
fn balanced_light_in_a_white_room_has_the_mean_zero() {
    let f = random_room(40, 0.1, 33);
    let mut uniform = Uniform(34);
    let mut exitance: Vec<f64> = (0..40).map(|_| uniform.next() - 0.5).collect();
    let power: f64 = f.areas().iter().zip(&exitance).map(|(a, e)| a * e).sum();
    let area: f64 = f.areas().iter().sum();
    for e in &mut exitance {
        *e -= power / area;
    }
    let signed = |rho: f64, e: &[f64]| {
        let exitance = Block::from_values(e.to_vec(), 1);
        RadiositySystem::with_signed_exitance(&f, f.areas().to_vec(), constant(40, rho), exitance)
    };
    let system = signed(1.0, &exitance).unwrap();
    // The limit of ρ → 1 is the solution with the mean zero: B(ρ) has the mean 0 by balance, and differs by O(1 − ρ).
    let limit = solve_direct(&dense(&f), &constant(40, 1.0 - 1e-9), system.exitance());
    for solver in all() {
        let solution = run(solver, &system, &l2(1e-10));
        assert_eq!(solution.stop_reason, StopReason::Converged, "{}", solver.name());
        let b = solution.radiosity.values();
        let mean: f64 = f.areas().iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / area;
        assert!(mean.abs() < 1e-15, "{}: mean {mean:e}", solver.name());
        assert!(b.iter().any(|b| *b < 0.0));
        let error = relative_error(f.areas(), &solution.radiosity, &limit);
        assert!(error < 1e-6, "{}: {error:e}", solver.name());
    }
    exitance[0] += 0.1;
    let refused = signed(1.0, &exitance).map(|_| ());
    let expected = SolverError::NoFiniteSolution {
        component: 0,
        n_patches: 40,
        patch: 0,
        channel: 0,
    };
    assert_eq!(refused, Err(expected));
    // With losses there is nothing special about exitances of both signs.
    let system = signed(0.5, &exitance).unwrap();
    let expected = solve_direct(&dense(&f), &constant(40, 0.5), system.exitance());
    assert!(expected.values().iter().any(|b| *b < 0.0));
    for solver in all() {
        let solution = run(solver, &system, &l2(1e-9));
        assert_eq!(solution.stop_reason, StopReason::Converged, "{}", solver.name());
        let error = relative_error(f.areas(), &solution.radiosity, &expected);
        let bound = solution.error_bound.unwrap();
        assert!(
            error < 2e-9 && error <= bound + 1e-14,
            "{}: {error:e}, {bound:e}",
            solver.name()
        );
    }
}

/// Form factors in f32 whose rows sum to a little above 1, in a room that is white and dark beside one that is lit.
#[test]
fn a_white_room_without_light_does_no_harm() {
    let (n, rho) = (20, [0.8, 1.0]);
    let in_room = |i: usize, j: usize| if i / n == j / n { 1.0 / n as f64 } else { 0.0 };
    let rows: Vec<Vec<f64>> = (0..2 * n)
        .map(|i| (0..2 * n).map(|j| in_room(i, j) * (1.0 + 3e-8)).collect())
        .collect();
    let f = matrix(&vec![1.0; 2 * n], &rows).symmetrised().unwrap();
    let mut exitance = vec![0.0; 2 * n];
    exitance[3] = 1.0;
    let reflectance = Block::from_values((0..2 * n).map(|i| rho[i / n]).collect(), 1);
    let system = system(&f, &reflectance, &Block::from_values(exitance, 1));
    for solver in all() {
        let solution = run(solver, &system, &l2(1e-9));
        assert_eq!(solution.stop_reason, StopReason::Converged, "{}", solver.name());
        assert!(
            solution.radiosity.values()[n..].iter().all(|b| b.abs() <= 0.0),
            "{}",
            solver.name()
        );
    }
}

/// At loose tolerances an iteration can claim to be done with radiosities below 0, goes on, and must do so as well in company as alone.
#[test]
fn rejected_answers_are_gone_on_from_in_every_channel() {
    let mut n_compared = 0;
    for seed in 0..40 {
        let f = random_room(12, 0.001, 500 + seed);
        let (reflectance, exitance) = random_materials(12, 0.99, 600 + seed);
        for tolerance in [0.5, 0.3, 0.1, 0.03] {
            for solver in all() {
                let together = run(solver, &system(&f, &reflectance, &exitance), &l2(tolerance));
                let alone = (0..3).map(|c| {
                    let system = system(&f, &channel(&reflectance, c), &channel(&exitance, c));
                    run(solver, &system, &l2(tolerance)).stop_reason
                });
                if alone.into_iter().all(|reason| reason == StopReason::Converged) {
                    n_compared += 1;
                    let name = solver.name();
                    assert_eq!(together.stop_reason, StopReason::Converged, "{name} {seed} {tolerance}");
                }
            }
        }
    }
    assert!(n_compared > 2000, "{n_compared}");
}

/// Emitted = absorbed + escaped, to what the residual explains.
#[test]
fn light_is_accounted_for() {
    let closed = random_room(40, 0.01, 35);
    let open: Vec<Vec<f64>> = dense(&closed)
        .iter()
        .map(|row| row.iter().map(|f| 0.8 * f).collect())
        .collect();
    let open = matrix(closed.areas(), &open).symmetrised().unwrap();
    let (reflectance, exitance) = random_materials(40, 0.95, 36);
    for f in [&closed, &open] {
        let system = system(f, &reflectance, &exitance);
        let area: f64 = f.areas().iter().sum();
        for solver in all() {
            for tolerance in [1e-3, 1e-9] {
                let solution = run(solver, &system, &l2(tolerance));
                for (c, energy) in solution.energy.iter().enumerate() {
                    let e_l2: f64 = f
                        .areas()
                        .iter()
                        .enumerate()
                        .map(|(i, a)| a * exitance.row(i)[c].powi(2))
                        .sum();
                    let lost = energy.emitted - energy.absorbed - energy.escaped;
                    let bound = area.sqrt() * e_l2.sqrt() * solution.residual_l2 + 1e-13 * energy.leaving;
                    assert!(lost.abs() <= bound, "{}: {lost:e} above {bound:e}", solver.name());
                    assert!(energy.absorbed > 0.0 && energy.emitted > 0.0);
                    let opens = energy.escaped > 0.1 * energy.emitted;
                    assert_eq!(opens, std::ptr::eq(f, &raw const open), "{energy:?}");
                }
            }
        }
    }
}

/// Conjugate gradients without symmetry wander; what is returned is the best that they had.
#[test]
fn a_stagnating_solver_returns_its_best() {
    let f = noisy_room(60, 0.9, 23);
    let mut emission = vec![0.0; 60];
    emission[5] = 1.0;
    let system = system(&f, &constant(60, 0.95), &Block::from_values(emission, 1));
    let options = SolveOptions {
        allow_nonreciprocal: true,
        ..l2(1e-11)
    };
    for solver in all() {
        let solution = run(solver, &system, &options);
        let true_ones = solution.history.iter().filter(|entry| !entry.estimated);
        let least = true_ones.map(|entry| entry.residual_l2).fold(f64::INFINITY, f64::min);
        assert!(solution.residual_l2 <= least, "{}", solver.name());
    }
}

#[test]
fn factorisations_keep_to_their_memory() {
    let f = random_room(20, 0.1, 37);
    let (reflectance, exitance) = random_materials(20, 0.9, 38);
    let system = system(&f, &reflectance, &exitance);
    let settings = SolverSettings {
        memory_limit_byte: Some(3 * 8 * 400 - 1),
        ..SolverSettings::default()
    };
    let refusal = radiosity::solver::solver("direct", &settings)
        .unwrap()
        .solve(&system, &l2(1e-6), &mut |_| ControlFlow::Continue(()));
    let expected = SolverError::Memory {
        solver: "direct",
        needed_byte: 3 * 8 * 400,
        limit_byte: 3 * 8 * 400 - 1,
    };
    assert_eq!(refusal.unwrap_err(), expected);
    let auto = radiosity::solver::solver("auto", &settings).unwrap();
    let solution = run(&*auto, &system, &l2(1e-6));
    assert_eq!(solution.choice.unwrap().solver, "pcg");
}

/// Where 1 − ρ is near rounding, E − B + ρ H in f64 is mostly 0, whatever B is. What converged meets the tolerance with sums and products in exact arithmetic too, and its bound holds.
#[test]
fn rounding_is_not_taken_for_convergence() {
    let mut n_converged = 0;
    for (k, loss) in [1e-6, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-15].into_iter().enumerate() {
        let f = random_room(12, 0.1, 700 + k as u64);
        let mut exitance = vec![0.0; 12];
        exitance[5] = 1.0;
        for lamp in [exitance, vec![1.0; 12]] {
            let (reflectance, exitance) = (constant(12, 1.0 - loss), Block::from_values(lamp, 1));
            let system = system(&f, &reflectance, &exitance);
            let e_l2: f64 = (0..12).map(|i| f.areas()[i] * exitance.row(i)[0].powi(2)).sum();
            for solver in all() {
                let solution = run(solver, &system, &l2(1e-6));
                if solution.stop_reason != StopReason::Converged {
                    continue;
                }
                n_converged += 1;
                let residual = |i: usize| {
                    let b = |j: usize| solution.radiosity.row(j)[0];
                    let mut terms = vec![exitance.row(i)[0], -b(i)];
                    for j in 0..12 {
                        for part in product(f.get(i, j), b(j)) {
                            terms.extend(product(1.0 - loss, part));
                        }
                    }
                    exact_sum(&terms)
                };
                let r_l2: f64 = (0..12).map(|i| f.areas()[i] * residual(i).powi(2)).sum();
                let relative = (r_l2 / e_l2).sqrt();
                assert!(
                    relative <= 1e-6 * (1.0 + 1e-9),
                    "{} at {loss:e}: {relative:e}",
                    solver.name()
                );
            }
        }
    }
    assert!(n_converged > 40, "{n_converged}");
}

/// A product as two numbers whose sum it is.
fn product(a: f64, b: f64) -> [f64; 2] {
    [a * b, a.mul_add(b, -(a * b))]
}

/// The sum of numbers, rounded once: it is kept as numbers that do not overlap (Shewchuk 1997, Grow-Expansion).
fn exact_sum(terms: &[f64]) -> f64 {
    let mut parts: Vec<f64> = Vec::new();
    for &term in terms {
        let mut carried = term;
        let mut next = Vec::new();
        for part in parts {
            let sum = carried + part;
            let of_part = sum - carried;
            let lost = (carried - (sum - of_part)) + (part - of_part);
            if lost.abs() > 0.0 {
                next.push(lost);
            }
            carried = sum;
        }
        next.push(carried);
        parts = next;
    }
    parts.iter().sum()
}

/// Two patches that send one another far more light than they have: what solves the equations to the last bit is negative, and no pass can better it.
#[test]
fn a_negative_answer_without_a_residual_ends_it() {
    let f = matrix(&[1.0; 2], &[vec![0.0, 32.0], vec![32.0, 0.0]])
        .symmetrised()
        .unwrap();
    let exitance = Block::from_values(vec![100.0, 0.0], 1);
    let system = system(&f, &constant(2, 0.5), &exitance);
    for solver in all() {
        let solution = run(solver, &system, &l2(1e-6));
        assert_eq!(solution.stop_reason, StopReason::Diverged, "{}", solver.name());
        assert!(solution.n_passes < 100, "{}: {}", solver.name(), solution.n_passes);
    }
}
