//! Multigrid: the counts and residuals of Lewis 1992 by an independent program, stiff rooms, and other scenes' hierarchies.

#![expect(clippy::shadow_unrelated, reason = "every step of a test names its own results")]

use std::sync::Arc;

use radiosity::form_factor::{FormFactorMethod, Input, RandomShooting};
use radiosity::geometry::sampling::Sequence;
use radiosity::matrix::operator::Block;
use radiosity::matrix::{FormFactors, StorageChoice};
use radiosity::mesh::hierarchy::FaceShape;
use radiosity::mesh::{Hierarchy, Mesh, Patch, Prolongation, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{Material, builtin, topology};
use radiosity::solver::{
    CoarseMatrices, Coarsest, Defect, GaussSeidel, Multigrid, Solution, SolveOptions, SolverError, StopReason,
    Tolerance,
};
use radiosity::visibility::embree::EmbreeVisibility;

use crate::support::solving::{by_name, constant, l2, random_materials, run, system};
use crate::support::{LewisRoom, bits, dense, random_room, relative_error, solve_direct};

#[expect(clippy::unnecessary_wraps, reason = "it fills a setting that may be left out")]
fn hierarchy(l: u32) -> Option<Arc<Hierarchy>> {
    let m = 1_u32 << l;
    let n = 6 * 4_usize.pow(l);
    let walls = [FaceShape::Quad { n_u: m, n_v: m }; 6];
    Some(Arc::new(Hierarchy::of_faces(
        &walls,
        &vec![1.0 / 4f64.powi(l.cast_signed()); n],
    )))
}

/// The algorithm as Lewis had it: form factors of every level, 20 sweeps on the coarsest one.
fn as_in_the_paper(l: u32) -> Multigrid {
    Multigrid {
        hierarchy: hierarchy(l),
        prolongation: Prolongation::Bilinear,
        coarse_matrices: CoarseMatrices::Reevaluated((0..l).rev().map(|l| LewisRoom::new(l).form_factors()).collect()),
        coarsest: Coarsest::Sweeps(20),
        defect: Defect::OfRadiosities,
        true_residuals: true,
    }
}

fn max(tolerance: f64, max_passes: usize) -> SolveOptions<'static> {
    SolveOptions {
        tolerance: Tolerance::ResidualMax(tolerance),
        max_passes,
        ..SolveOptions::default()
    }
}

#[test]
fn table_2_and_its_multiplications() {
    let expected = [(1, 8.64e3), (2, 6.11e4), (3, 8.23e5), (4, 1.29e7)];
    for (l, multiply_adds) in expected {
        let room = LewisRoom::new(l);
        let f = room.form_factors();
        let system = system(&f, &room.reflectance, &room.exitance);
        for prolongation in [Prolongation::Injection, Prolongation::Bilinear] {
            let multigrid = Multigrid {
                prolongation,
                ..as_in_the_paper(l)
            };
            let solution = run(&multigrid, &system, &max(2.5e-5, 100));
            assert_eq!(
                (solution.stop_reason, solution.n_passes),
                (StopReason::Converged, 4),
                "l = {l}"
            );
            let cycles = solution.history.last().unwrap().work - solution.setup_work;
            let measured = cycles * (f.n_rows() as f64).powi(2);
            // Three digits are known.
            assert!((measured / multiply_adds - 1.0).abs() < 5e-3, "l = {l}: {measured:e}");
        }
        // With the forecast instead of true residuals: as many cycles, and one check.
        let multigrid = Multigrid {
            true_residuals: false,
            ..as_in_the_paper(l)
        };
        let solution = run(&multigrid, &system, &max(2.5e-5, 100));
        assert_eq!((solution.n_passes, solution.n_checks), (4, 1), "l = {l}");
    }
}

#[test]
fn the_residuals_of_level_4() {
    let room = LewisRoom::new(4);
    let f = room.form_factors();
    let system = system(&f, &room.reflectance, &room.exitance);
    let solution = run(&as_in_the_paper(4), &system, &max(1e-300, 8));
    let expected = [
        5.571e-3, 6.029e-4, 7.661e-5, 1.081e-5, 1.492e-6, 2.035e-7, 2.769e-8, 3.763e-9,
    ];
    for (entry, expected) in solution.history.iter().zip(expected) {
        // Four digits are known.
        let error = (entry.residual_max / expected - 1.0).abs();
        assert!(
            error < 1e-3 && format!("{:.3e}", entry.residual_max) == format!("{expected:.3e}"),
            "{entry:?}"
        );
    }
    assert_eq!(solution.history.len(), 8);
    let expected = [
        3.253e-2, 1.361e-2, 6.770e-3, 3.221e-3, 1.470e-3, 6.583e-4, 2.922e-4, 1.291e-4, 5.695e-5, 2.509e-5, 1.104e-5,
        4.861e-6,
    ];
    for (k, expected) in expected.into_iter().enumerate() {
        let solution = run(&GaussSeidel, &system, &max(1e-300, k + 1));
        let residual = solution.history.last().unwrap().residual_max;
        assert_eq!(format!("{residual:.3e}"), format!("{expected:.3e}"), "sweep {}", k + 1);
    }
}

/// Galerkin matrices and a direct solve of the coarsest level: the same solution, in as many cycles.
#[test]
fn the_solution_of_lewis_room() {
    let walls = [
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
    for (l, expected) in walls {
        let room = LewisRoom::new(l);
        let f = room.form_factors();
        let system = system(&f, &room.reflectance, &room.exitance);
        for prolongation in [Prolongation::Injection, Prolongation::Bilinear] {
            let multigrid = Multigrid {
                hierarchy: hierarchy(l),
                prolongation,
                ..Multigrid::default()
            };
            assert_eq!(run(&multigrid, &system, &max(2.5e-5, 100)).n_passes, 4);
            let solution = run(&multigrid, &system, &l2(1e-13));
            let b = solution.radiosity.values();
            for (wall, expected) in b.chunks(room.patches_per_wall).zip(expected) {
                let mean = wall.iter().sum::<f64>() / wall.len() as f64;
                assert!((mean - expected).abs() < 1e-10, "l = {l}: {mean} for {expected}");
            }
            if l == 3 {
                let values = [
                    (0, 0.015_229_383_123),
                    (27, 0.028_533_420_881),
                    (128, 0.028_609_209_866),
                    (292, 0.137_985_030_558),
                    (347, 1.073_311_996_705),
                ];
                assert!(values.iter().all(|&(i, u)| (b[i] - u).abs() < 1e-12));
            }
        }
    }
}

/// A direct solve of the coarsest level takes 9 to 20 cycles to 1e-10 at any ρ; 20 sweeps stall.
#[test]
fn the_number_of_cycles_hardly_depends_on_the_reflectance() {
    let room = LewisRoom::new(3);
    let f = room.form_factors();
    for loss in [0.9, 0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8] {
        let reflectance = constant(384, 1.0 - loss);
        let system = system(&f, &reflectance, &room.exitance);
        // As near as it gets.
        let factored = run(by_name("direct"), &system, &l2(1e-15));
        for coarse_matrices in [CoarseMatrices::Galerkin, as_in_the_paper(3).coarse_matrices] {
            let direct = Multigrid {
                hierarchy: hierarchy(3),
                coarse_matrices,
                true_residuals: true,
                ..Multigrid::default()
            };
            // The light spreads to 0.25 / (6 (1 − ρ)) on an area of 6, from 1 on 0.25: ‖B‖ / ‖E‖ = 0.2 / (1 − ρ). Rounding leaves some units in the last place of B.
            let norm_ratio = 0.2 / loss;
            let tolerance = f64::max(1e-10, 16.0 * f64::EPSILON * norm_ratio);
            let solution = run(&direct, &system, &l2(tolerance));
            let error = relative_error(f.areas(), &solution.radiosity, &factored.radiosity);
            // ‖G⁻¹‖ = 1 / (1 − ρ) but for the weights that rows without reciprocity have, at most 2; the factorisation's own rounding is amplified as much.
            let allowed = 2.0 * (tolerance / norm_ratio + 16.0 * f64::EPSILON) / loss;
            assert!(error <= allowed, "1 − ρ = {loss:e}: {error:e} above {allowed:e}");
            assert_eq!(solution.stop_reason, StopReason::Converged, "1 − ρ = {loss:e}");
            assert!(
                solution.n_passes <= 20,
                "1 − ρ = {loss:e}: {} cycles",
                solution.n_passes
            );
        }
    }
    let stiff = constant(384, 1.0 - 1e-6);
    let system = system(&f, &stiff, &room.exitance);
    let sweeps = Multigrid {
        coarsest: Coarsest::Sweeps(20),
        hierarchy: hierarchy(3),
        ..Multigrid::default()
    };
    let options = SolveOptions {
        max_passes: 100,
        ..l2(1e-10)
    };
    assert_ne!(run(&sweeps, &system, &options).stop_reason, StopReason::Converged);
}

/// What the sweep has changed tells the same defect as the radiosities do.
#[test]
fn both_defects_make_the_same_cycles() {
    let lewis = LewisRoom::new(3);
    let lewis = Room {
        f: lewis.form_factors(),
        reflectance: lewis.reflectance.clone(),
        exitance: lewis.exitance.clone(),
        hierarchy: hierarchy(3).unwrap(),
    };
    for room in [lewis, room("cornell-box", 4)] {
        let system = system(&room.f, &room.reflectance, &room.exitance);
        for coarsest in [Coarsest::Direct, Coarsest::Sweeps(20)] {
            let [changes, radiosities] = [Defect::OfChanges, Defect::OfRadiosities].map(|defect| {
                let multigrid = Multigrid {
                    hierarchy: Some(Arc::clone(&room.hierarchy)),
                    prolongation: Prolongation::Bilinear,
                    coarsest,
                    defect,
                    true_residuals: true,
                    ..Multigrid::default()
                };
                run(&multigrid, &system, &max(1e-300, 4))
            });
            let greatest = changes.radiosity.values().iter().copied().fold(0.0, f64::max);
            for (a, b) in changes.radiosity.values().iter().zip(radiosities.radiosity.values()) {
                // Four cycles leave residuals of about 1e-5: they agree because the cycles do. What is wrong is 6e-8 (f32) of the last correction, which is of the size of the
                // residual before it, 1e-4 of the greatest radiosity.
                assert!((a - b).abs() < 1e-11 * greatest, "{a:e} {b:e}");
            }
            let residuals = changes.history.iter().zip(&radiosities.history);
            assert!(
                residuals
                    .clone()
                    .all(|(a, b)| (a.residual_max / b.residual_max - 1.0).abs() < 1e-6)
            );
            assert_eq!(residuals.count(), 4);
            let work = |solution: &Solution| solution.history.last().unwrap().work - solution.setup_work;
            assert!(work(&changes) < work(&radiosities));
        }
    }
}

struct Room {
    f: FormFactors,
    reflectance: Block,
    exitance: Block,
    hierarchy: Arc<Hierarchy>,
}

fn room(name: &str, n: u32) -> Room {
    let scene = builtin::build(name, None).unwrap().scene;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(n)).unwrap();
    let visibility = EmbreeVisibility::new(&scene).unwrap();
    let input = Input {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        unoccluded: topology::is_convex_and_empty(&scene),
    };
    let method = RandomShooting {
        rays: 1024,
        sequence: Sequence::Sobol,
        seed: 0,
    };
    let raw = method
        .compute(input, StorageChoice::default(), &Silent)
        .unwrap()
        .factors;
    let targets = raw.row_targets(topology::is_watertight(&scene));
    let (f, _) = raw.symmetrised().unwrap().balanced(&targets, 1e-12, 200).unwrap();
    let collect = |value: fn(&Material) -> [f64; 3]| {
        let of_patch = |patch: &Patch| value(&scene.materials[patch.material.0 as usize]);
        Block::from_values(mesh.patches.iter().flat_map(of_patch).collect(), 3)
    };
    Room {
        f,
        reflectance: collect(|m| m.reflectance),
        exitance: collect(|m| m.exitance),
        hierarchy: Arc::new(Hierarchy::of_mesh(&mesh)),
    }
}

/// On other scenes, coloured ones too, the cycles do not grow with the number of patches, and the answer is that of Gauss-Seidel.
#[test]
fn the_number_of_cycles_does_not_depend_on_the_number_of_patches() {
    for (name, subdivisions) in [("cornell-box", [3, 6]), ("room-box", [3, 6]), ("corridor", [5, 10])] {
        let mut cycles = Vec::new();
        for n in subdivisions {
            let room = room(name, n);
            // Some light somewhere, where the scene has none of its own.
            let mut exitance = room.exitance.clone();
            if exitance.values().iter().all(|e| e.abs() <= 0.0) {
                exitance.row_mut(0).fill(1.0);
            }
            let system = system(&room.f, &room.reflectance, &exitance);
            let expected = run(&GaussSeidel, &system, &l2(1e-12));
            for prolongation in [Prolongation::Injection, Prolongation::Bilinear] {
                let multigrid = Multigrid {
                    hierarchy: Some(Arc::clone(&room.hierarchy)),
                    prolongation,
                    ..Multigrid::default()
                };
                let solution = run(&multigrid, &system, &l2(1e-10));
                assert_eq!(solution.stop_reason, StopReason::Converged, "{name} {n}");
                let error = relative_error(room.f.areas(), &solution.radiosity, &expected.radiosity);
                // Losses of a few per cent at least make an error of at most about 100 residuals.
                assert!(error < 1e-8, "{name} {n}: {error:e}");
                assert!(solution.radiosity.values().iter().all(|&b| b >= 0.0));
                cycles.push(solution.n_passes);
            }
        }
        let (coarse, fine) = (cycles[..2].iter().max().unwrap(), cycles[2..].iter().max().unwrap());
        assert!(*fine <= coarse + 2 && *fine <= 20, "{name}: {cycles:?}");
    }
}

/// Reflectances that differ inside coarse patches, in each channel otherwise: channels keep rows of their own, and do not influence one another.
#[test]
fn reflectances_that_differ_within_a_coarse_patch() {
    let f = random_room(64, 0.5, 41);
    let (reflectance, exitance) = random_materials(64, 0.95, 42);
    let mut mixed = reflectance.clone();
    for i in 0..64 {
        mixed.row_mut(i)[1] = 0.7;
    }
    let levels = Hierarchy::of_faces(&[FaceShape::Quad { n_u: 8, n_v: 8 }], f.areas());
    let multigrid = Multigrid {
        hierarchy: Some(Arc::new(levels)),
        ..Multigrid::default()
    };
    let solution = run(&multigrid, &system(&f, &mixed, &exitance), &l2(1e-13));
    assert_eq!(solution.stop_reason, StopReason::Converged);
    let expected = solve_direct(&dense(&f), &mixed, &exitance);
    assert!(relative_error(f.areas(), &solution.radiosity, &expected) < 1e-12);
    let fixed = SolveOptions {
        max_passes: 5,
        ..l2(1e-300)
    };
    let together = run(&multigrid, &system(&f, &mixed, &exitance), &fixed);
    for c in 0..3 {
        let alone = |block: &Block| crate::support::solving::channel(block, c);
        let single = run(&multigrid, &system(&f, &alone(&mixed), &alone(&exitance)), &fixed);
        assert_eq!(
            bits(single.radiosity.values()),
            bits(alone(&together.radiosity).values())
        );
    }
}

#[test]
fn patches_that_hardly_reflect_are_not_corrected_by_what_the_others_are() {
    // Two plates that see nothing but each other. A correction by the mean of the two leaves the dark one as wrong as it makes the other right, cycle after cycle.
    let mut tile = radiosity::matrix::RowTile::new(0);
    for row in [[0.0, 1.0], [1.0, 0.0]] {
        tile.push_row(&crate::support::exact(&row), radiosity::matrix::RowTally::default());
    }
    let f = FormFactors::from_tiles(vec![1.0; 2], [tile], StorageChoice::default()).unwrap();
    let (bright, dark) = (0.999_999, 1e-12);
    let reflectance = Block::from_values(vec![bright, dark], 1);
    let system = system(&f, &reflectance, &constant(2, 1.0));
    for prolongation in [Prolongation::Injection, Prolongation::Bilinear] {
        let multigrid = Multigrid {
            prolongation,
            ..Multigrid::default()
        };
        let solution = run(&multigrid, &system, &l2(1e-12));
        assert_eq!(solution.stop_reason, StopReason::Converged);
        assert!(solution.n_passes <= 3, "{}", solution.n_passes);
        // B_1 = 1 + ρ_1 B_2 and B_2 = 1 + ρ_2 B_1.
        let [b_1, b_2] = [
            (1.0 + bright) / (1.0 - bright * dark),
            (1.0 + dark) / (1.0 - bright * dark),
        ];
        let expected = Block::from_values(vec![b_1, b_2], 1);
        assert!(relative_error(f.areas(), &solution.radiosity, &expected) < 1e-11);
    }
}

#[test]
fn hierarchies_of_another_size_are_refused() {
    let f = random_room(10, 0.5, 43);
    let multigrid = Multigrid {
        hierarchy: Some(Arc::new(Hierarchy::of_groups(&[0; 9], &[1.0; 9]))),
        ..Multigrid::default()
    };
    let system = system(&f, &constant(10, 0.5), &constant(10, 1.0));
    let refusal = radiosity::solver::Solver::solve(&multigrid, &system, &l2(1e-6), &mut |_| {
        std::ops::ControlFlow::Continue(())
    });
    let expected = SolverError::Shape {
        what: "patches of the hierarchy",
        expected: 10,
        found: 9,
    };
    assert_eq!(refusal.unwrap_err(), expected);
}

/// Every patch that sees no other is a set of its own: the level of sets is as large as there are such patches, and costs no more than that.
#[test]
fn thousands_of_patches_alone_are_no_work() {
    let (n_room, n_alone) = (60, 5000);
    let room = dense(&random_room(n_room, 0.1, 44));
    let mut tile = radiosity::matrix::RowTile::new(0);
    for row in &room {
        tile.push_row(&crate::support::exact(row), radiosity::matrix::RowTally::default());
    }
    for _ in 0..n_alone {
        tile.push_row(&[], radiosity::matrix::RowTally::default());
    }
    let n = n_room + n_alone;
    let f = FormFactors::from_tiles(vec![1.0; n], [tile], StorageChoice::default()).unwrap();
    let f = f.symmetrised().unwrap();
    let mut exitance = vec![0.0; n];
    (exitance[3], exitance[n - 1]) = (1.0, 0.5);
    let exitance = Block::from_values(exitance, 1);
    let system = system(&f, &constant(n, 0.9), &exitance);
    assert_eq!(system.components().n_components, n_alone + 1);
    let solution = run(by_name("multigrid"), &system, &l2(1e-9));
    assert_eq!(solution.stop_reason, StopReason::Converged);
    assert_eq!(solution.radiosity.values()[n - 1].to_bits(), 0.5_f64.to_bits());
    // A factorisation of the sets would take 4e10 multiplications; a pass over F takes 3600.
    let multiplications = 3600.0 * solution.setup_work;
    assert!(multiplications < 1e8, "{multiplications}");
}
