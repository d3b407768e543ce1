//! Laws that form factors obey in any scene, for every method on random rooms with boxes and triangles in them.
//!
//! The random cases are the same in every run; others, for as long as one likes: `PROPTEST_RNG_SEED=7 PROPTEST_CASES=200 cargo test --release --test library properties::`.

use std::num::NonZeroUsize;

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use proptest::test_runner::{FileFailurePersistence, RngSeed};
use radiosity::form_factor::GaussShooting;
use radiosity::form_factor::partial::VisibleFactor;
use radiosity::geometry::quadrature::GaussProduct;
use radiosity::geometry::sampling::Sequence;
use radiosity::matrix::FormFactors;
use radiosity::mesh::{Mesh, PatchId, Subdivision};
use radiosity::scene::Scene;
use radiosity::solver::StopReason;
use radiosity::visibility::occluders::Occluder;

use crate::support::rooms::{Prepared, Shapes, moved, names, quick};
use crate::support::solving::{all, l2, random_materials, run, system};
use crate::support::{dense, n_cases, relative_error, solve_direct};

/// A room of 1 to 2 m a side with things in it that do not touch its walls.
#[derive(Clone, Debug)]
struct Room {
    size: DVec3,
    /// Middle and half sizes in units of the room, and a turn (0 for boxes along the walls).
    boxes: Vec<(DVec3, DVec3, f64)>,
    /// Corners in units of the room.
    triangles: Vec<[DVec3; 3]>,
}

impl Room {
    fn shapes(&self) -> Shapes {
        let mut shapes = Shapes::default();
        shapes.cuboid(DVec3::ZERO, self.size, DQuat::IDENTITY, true);
        for &(middle, half, turn) in &self.boxes {
            let axis = DVec3::new(1.0, 2.0, 3.0).normalize();
            let (low, high) = ((middle - half) * self.size, (middle + half) * self.size);
            shapes.cuboid(low, high, DQuat::from_axis_angle(axis, turn), false);
        }
        for triangle in &self.triangles {
            shapes.face(&triangle.map(|v| v * self.size));
        }
        shapes
    }

    fn scene(&self) -> Scene {
        self.shapes().scene()
    }

    /// Whether `closed-form` takes it.
    fn is_rectangular(&self) -> bool {
        self.triangles.is_empty() && self.boxes.iter().all(|b| b.2.abs() < 1e-12)
    }

    fn methods(&self) -> impl Iterator<Item = &'static str> {
        let rectangular = self.is_rectangular();
        names().filter(move |&name| name != "closed-form" || rectangular)
    }
}

fn between(low: f64, high: f64) -> impl Strategy<Value = DVec3> {
    [low..high, low..high, low..high].prop_map(DVec3::from)
}

fn room(n_triangles: impl Into<proptest::collection::SizeRange>) -> impl Strategy<Value = Room> {
    let turn = prop_oneof![Just(0.0), 0.1..1.5];
    let boxes = proptest::collection::vec((between(0.3, 0.7), between(0.05, 0.14), turn), 0..2);
    let triangle = [between(0.1, 0.9), between(0.1, 0.9), between(0.1, 0.9)]
        .prop_filter("a triangle that is not thin", |[a, b, c]| {
            (b - a).cross(c - a).length() > 0.05
        });
    (
        between(1.0, 2.0),
        boxes,
        proptest::collection::vec(triangle, n_triangles),
    )
        .prop_map(|(size, boxes, triangles)| Room { size, boxes, triangles })
}

/// So many cases from a seed, or a quarter of them (see `n_cases`), which `PROPTEST_RNG_SEED` and `PROPTEST_CASES` replace. What fails is kept beside this file, and tried first from then on.
fn cases(n: u32, seed: u64) -> ProptestConfig {
    let asked = ProptestConfig::default();
    ProptestConfig {
        cases: if std::env::var_os("PROPTEST_CASES").is_some() {
            asked.cases
        } else {
            n_cases(n.div_ceil(4), n)
        },
        rng_seed: match asked.rng_seed {
            RngSeed::Random => RngSeed::Fixed(seed),
            fixed @ RngSeed::Fixed(_) => fixed,
        },
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..asked
    }
}

/// Calls `check(i, j, F, error)` for all pairs of the first `n` patches.
fn for_each(factors: &FormFactors, n: usize, mut check: impl FnMut(usize, usize, f64, f64)) {
    for i in 0..n {
        for j in 0..n {
            check(i, j, factors.get(i, j), factors.std_error(i, j));
        }
    }
}

/// Rays from a ninth of a face: enough to tell the grids' own errors from noise.
const RAYS_OF_PART: u64 = 6000;

/// Returns the form factors from a face to every face as the sums over q × q Gauss points on each of its patches of the points' exact ones.
///
/// Every face must be a surface of its own.
fn of_gauss_points(prepared: &Prepared, face: usize, q: usize) -> Vec<f64> {
    let (scene, mesh) = (&prepared.scene, &prepared.mesh);
    let outlines = Mesh::new(scene, Subdivision::Uniform(1)).expect("a mesh");
    let polygons: Vec<Vec<DVec3>> = (0..outlines.n_patches())
        .map(|k| outlines.polygon(PatchId::from_index(k)))
        .collect();
    let normal = |polygon: &[DVec3]| (polygon[1] - polygon[0]).cross(polygon[2] - polygon[0]).normalize();
    let rule = GaussProduct::new(NonZeroUsize::new(q).expect("points"));
    let sender = normal(&polygons[face]);
    let patches: Vec<usize> = (0..mesh.n_patches())
        .filter(|&i| mesh.patches[i].surface.0 as usize == face)
        .collect();
    let area: f64 = patches.iter().map(|&i| mesh.patches[i].area).sum();
    let to = |target: usize| {
        if target == face {
            return 0.0;
        }
        let between = |k: &usize| *k != face && *k != target;
        let occluder = |k: usize| Occluder {
            corners: polygons[k].as_slice().into(),
            one_sided: false,
            body: None,
        };
        let occluders: Vec<_> = (0..polygons.len()).filter(between).map(occluder).collect();
        let mut visible = VisibleFactor::new(&polygons[face], sender, &polygons[target], &occluders);
        let (front, on_it) = (normal(&polygons[target]), polygons[target][0]);
        let mut sum = 0.0;
        for &i in &patches {
            for point in rule.on_polygon(&mesh.polygon(PatchId::from_index(i))) {
                if (point.position - on_it).dot(front) > 0.0 {
                    sum += mesh.patches[i].area / area * point.weight * visible.at(point.position);
                }
            }
        }
        sum
    };
    (0..polygons.len()).map(to).collect()
}

proptest! {
    #![proptest_config(cases(12, 1))]

    #[test]
    fn form_factors_are_bounded_and_reciprocal(room in room(0..3)) {
        let prepared = Prepared::new(room.scene(), 2);
        let areas = prepared.mesh.areas();
        for name in room.methods() {
            let factors = prepared.compute(&*quick(name, 3));
            let is_noisy = name.starts_with('s');
            // Rows of rays keep A_i F_ij below the smaller area to their noise; these three do not promise it.
            let is_bounded = !["centre", "pdm", "hemicube"].contains(&name);
            let is_reciprocal = !is_noisy && name != "hemicube";
            for_each(&factors, factors.n_rows(), |i, j, value, error| {
                let exchange = areas[i] * value;
                let smaller = areas[i].min(areas[j]);
                let noise = if is_noisy { 5.0 * areas[i] * error } else { 1e-14 * smaller + 1e-6 * areas[i] * error };
                assert!(value >= 0.0 && error >= 0.0 && error.is_finite(), "{name} {i} {j}: {value} ± {error}");
                assert!(!is_bounded || exchange <= smaller + noise, "{name} {i} {j}: {exchange} of {smaller}");
                let reverse = areas[j] * factors.get(j, i);
                assert!(!is_reciprocal || (exchange - reverse).abs() <= 1e-15 * exchange, "{name} {i} {j}");
                let same_face = prepared.mesh.patches[i].face == prepared.mesh.patches[j].face;
                assert!(!same_face || value.abs() < 1e-300, "{name} {i} {j}: a flat face does not see itself");
            });
        }
    }

    #[test]
    fn an_occluder_never_increases_a_form_factor(room in room(1..2)) {
        let with = Prepared::new(room.scene(), 2);
        let without = Prepared::new(Room { triangles: Vec::new(), ..room.clone() }.scene(), 2);
        let n = without.mesh.n_patches();
        let mut n_less = 0;
        for name in room.methods() {
            let (open, shaded) = (without.compute(&*quick(name, 5)), with.compute(&*quick(name, 5)));
            for_each(&shaded, n, |i, j, value, error| {
                // Rounding: in a room without boxes no ray was traced before, and the sums are not the same ones. `exact` integrates
                // both to a tolerance.
                let before = open.get(i, j);
                let known = if name == "exact" { error + open.std_error(i, j) } else { 0.0 };
                assert!(value <= before * (1.0 + 1e-12) + known + 1e-13, "{name} {i} {j}: {value} above {before}");
                n_less += u32::from(value < 0.999 * before);
            });
        }
        prop_assert!(n_less > 0, "the triangle hides something");
    }

    #[test]
    fn rows_of_a_closed_room_sum_to_one_within_their_errors(room in room(0..1)) {
        let prepared = Prepared::new(room.scene(), 2);
        for name in room.methods() {
            let factors = prepared.compute(&*quick(name, 7));
            let sums_rays = ["sr", "sg", "sg5", "sg10", "hemicube"].contains(&name);
            for i in 0..factors.n_rows() {
                let (mut sum, mut error) = (0.0, 0.0);
                factors.for_each_in_row(i, |_, value, stated| {
                    sum += value;
                    error += stated;
                });
                let tolerance = if sums_rays { 1e-12 } else { 2.0 * error + 1e-13 };
                // A ray that meets an edge of a box within f32's rounding may find the side that faces away, which takes it: one of
                // 12,288 did in one of some 100 rooms.
                let tally = &factors.tallies()[i];
                let taken = tally.absorbed().unwrap_or(0.0);
                assert!(tally.n_escaped == 0 && tally.n_absorbed <= 1, "{name} {i}: {tally:?}");
                assert!((sum + taken - 1.0).abs() <= tolerance, "{name} {i}: {sum} ± {error:e}");
            }
        }
    }

    /// What a closed room emits it absorbs, within the errors of its form factors.
    #[test]
    fn light_is_kept_by_the_form_factors_of_every_method(room in room(0..1), seed in 0..1000_u64) {
        let prepared = Prepared::new(room.scene(), 2);
        for name in room.methods() {
            let factors = prepared.compute(&*quick(name, 8));
            let n = factors.n_rows();
            let areas = factors.areas();
            let (reflectance, exitance) = random_materials(n, 0.9, seed);
            let radiosity = solve_direct(&dense(&factors), &reflectance, &exitance);
            for c in 0..3 {
                let (mut emitted, mut absorbed, mut known) = (0.0, 0.0, 0.0);
                for (i, area) in areas.iter().enumerate() {
                    let (mut irradiance, mut of_row) = (0.0, 0.0);
                    factors.for_each_in_row(i, |j, value, error| {
                        irradiance += value * radiosity.row(j)[c];
                        of_row += error * radiosity.row(j)[c];
                    });
                    emitted += area * exitance.row(i)[c];
                    absorbed += area * (1.0 - reflectance.row(i)[c]) * irradiance;
                    known += area * of_row;
                }
                let lost = (emitted - absorbed).abs();
                // Stated errors are standard errors, all of one sign here.
                assert!(lost <= 2.0 * known + 1e-12 * emitted, "{name}: {lost:e} of {emitted}, ± {known:e}");
            }
        }
    }

    #[test]
    fn form_factors_add_up_over_the_parts_of_a_face(room in room(0..2)) {
        let (whole, parts) = (Prepared::new(room.scene(), 1), Prepared::new(room.scene(), 3));
        // What `sg` states leaves out the bias of its grid, which is coarse on a whole wall: the next test knows it.
        for name in room.methods().filter(|name| !name.starts_with("sg")) {
            let coarse = whole.by_surface(&whole.compute(&*quick(name, 9)));
            let fine = parts.by_surface(&parts.compute(&*quick(name, 9)));
            for k in 0..coarse.form_factor.len() {
                let difference = (coarse.form_factor[k] - fine.form_factor[k]).abs();
                let error = coarse.error[k] + fine.error[k];
                // What the others state is a standard error; rays that rarely hit have longer tails than normal numbers.
                let sigmas = match name {
                    "exact" => 1.0,
                    "sr" => 5.0,
                    _ => 3.0,
                };
                assert!(difference <= sigmas * error + 1e-13, "{name} {k}: {difference:e} ± {error:e}");
            }
        }
    }

    /// Over the parts of the face that the light leaves, as far as sums over Gauss points add up; over those that it reaches, in full.
    #[test]
    fn form_factors_from_gauss_points_add_up_as_their_grids_do(room in room(0..2)) {
        let (whole, parts) = (Prepared::new(room.scene(), 1), Prepared::new(room.scene(), 3));
        let n = whole.mesh.n_patches();
        for q in [3, 5, 10] {
            let points = NonZeroUsize::new(q).expect("points");
            let [coarse, fine] = [(&whole, 9 * RAYS_OF_PART), (&parts, RAYS_OF_PART)].map(|(prepared, rays)| {
                let method = GaussShooting { points, rays, sequence: Sequence::Sobol, seed: 9 };
                prepared.by_surface(&prepared.compute(&method))
            });
            // A wall, and what was added last: a side of a box, a triangle, or another wall.
            for face in [0, n - 1] {
                let of_grids = [&whole, &parts].map(|prepared| of_gauss_points(prepared, face, q));
                for (j, (of_whole, of_parts)) in of_grids[0].iter().zip(&of_grids[1]).enumerate() {
                    let difference = coarse.form_factor[n * face + j] - fine.form_factor[n * face + j];
                    let of_grid = of_whole - of_parts;
                    let error = coarse.error[n * face + j] + fine.error[n * face + j];
                    // Rays that rarely hit have longer tails than normal numbers.
                    assert!((difference - of_grid).abs() <= 5.0 * error + 1e-12, "{q} {face} {j}: {difference:e}, {of_grid:e} ± {error:e}");
                }
            }
        }
    }

    #[test]
    fn form_factors_do_not_change_when_the_scene_is_moved_or_scaled(
        room in room(0..2), turn in 0.1..6.0, axis in between(0.1, 1.0), scale in 0.01..100.0, shift in between(-5.0, 5.0),
    ) {
        let here = Prepared::new(room.scene(), 2);
        let rotation = DQuat::from_axis_angle(axis.normalize(), turn);
        let turned = Prepared::new(moved(&here.scene, rotation, scale, scale * shift), 2);
        let shifted = Prepared::new(moved(&here.scene, DQuat::IDENTITY, scale, scale * shift), 2);
        for name in room.methods() {
            // Directions of rays are taken in a frame that does not turn with the scene.
            let turns_along = !["sr", "sg", "sg5", "sg10", "hemicube"].contains(&name);
            let there = if turns_along { &turned } else { &shifted };
            let (before, after) = (here.compute(&*quick(name, 11)), there.compute(&*quick(name, 11)));
            let n = before.n_rows();
            let mut n_different = 0;
            for_each(&after, n, |i, j, value, error| {
                let difference = (value - before.get(i, j)).abs();
                // One ray that passes an edge within f32's rounding may change sides.
                n_different += usize::from(difference > 1e-9 && name != "exact");
                // `exact` is held to what it states, here and there; its full pairs are right to 1e-10 of themselves.
                let known = if name == "exact" { 1e-9 * value + 1.000_001 * (error + before.std_error(i, j)) + 1e-14 } else { 1e-9 + 3.0 * error };
                assert!(difference <= known, "{name} {i} {j}: {difference:e} ± {error:e}");
            });
            assert!(n_different <= n * n / 100, "{name}: {n_different} of {} differ", n * n);
            if !turns_along {
                for_each(&turned.compute(&*quick(name, 13)), n, |i, j, value, error| {
                    let difference = (value - before.get(i, j)).abs();
                    // Other rays: seven standard errors of a difference.
                    let known = 5.0 * (error + before.std_error(i, j)) + 1e-9;
                    assert!(difference <= known, "{name} turned {i} {j}: {difference:e} ± {known:e}");
                });
            }
        }
    }
}

proptest! {
    #![proptest_config(cases(6, 6))]

    /// Light is neither made nor lost, a patch has at least what it emits, and none more than the furnace whose walls all emit the most and reflect the most.
    #[test]
    fn every_solver_keeps_the_energy_of_a_room_with_things_in_it(room in room(0..3), seed in 0..1000_u64) {
        let prepared = Prepared::new(room.scene(), 2);
        let factors = prepared.compute(&*quick("exact", 0));
        let n = factors.n_rows();
        let rho_max = 0.9;
        let (reflectance, exitance) = random_materials(n, rho_max, seed);
        let system = system(&factors, &reflectance, &exitance);
        let expected = solve_direct(&dense(&factors), &reflectance, &exitance);
        // By how much rows sum to more than 1, which makes light: the errors of the form factors.
        let excess = factors.row_sums().iter().fold(0.0_f64, |most, sum| most.max(sum - 1.0));
        for solver in all() {
            let name = solver.name();
            let solution = run(solver, &system, &l2(1e-10));
            prop_assert_eq!(solution.stop_reason, StopReason::Converged, "{}", name);
            let error = relative_error(factors.areas(), &solution.radiosity, &expected);
            let bound = solution.error_bound.expect("reflectances below 1");
            // Both solutions round.
            prop_assert!(error <= bound + 1e-13, "{name}: {error:e} > {bound:e}");
            // A residual of 1e-10 of E, ten reflections deep at ρ = 0.9.
            prop_assert!(error <= 1e-9, "{name}: {error:e}");
            for c in 0..3 {
                let (mut emitted, mut kept) = (0.0, 0.0);
                let highest = (0..n).map(|i| exitance.row(i)[c]).fold(0.0, f64::max) / (1.0 - rho_max * (1.0 + excess));
                for i in 0..n {
                    let (e, rho) = (exitance.row(i)[c], reflectance.row(i)[c]);
                    let (b, h) = (solution.radiosity.row(i)[c], solution.irradiance.row(i)[c]);
                    prop_assert!(b >= e - 1e-8 && b <= highest * (1.0 + 1e-8), "{name}: patch {i} has {b}");
                    // What the walls' openings in F take or make: 1 less the row's sum.
                    emitted += e * factors.areas()[i];
                    kept += ((1.0 - rho) * h + (1.0 - factors.row_sums()[i]) * b) * factors.areas()[i];
                }
                // Reciprocity makes this exact but for the residual, ten reflections deep.
                prop_assert!((kept / emitted - 1.0).abs() < 1e-8, "{name}: {kept} of {emitted}");
            }
        }
    }
}
