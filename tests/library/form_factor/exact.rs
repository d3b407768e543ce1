//! `exact` as a whole: certified values, laws that hold in any scene, and scenes where things touch.

#![expect(clippy::shadow_unrelated, reason = "a scene in its places is still that scene")]

use glam::{DQuat, DVec3};
use radiosity::form_factor::partial::{Accuracy, exchange_area};
use radiosity::form_factor::registry;
use radiosity::form_factor::{
    ClosedForm, Computed, ExactMethod, FormFactorMethod, Input, MethodSettings, RAYS, RandomShooting, closed_rows,
};
use radiosity::geometry::sampling::Sequence;
use radiosity::matrix::StorageChoice;
use radiosity::mesh::{Mesh, MeshOptions, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{Corners, Face, Scene, builtin};
use radiosity::visibility::brute_force::BruteForce;
use radiosity::visibility::occluders::{OccluderIndex, PairVisibility};
use serde_json::Value;
use std::num::NonZeroUsize;

use crate::support::rooms::{Prepared, Shapes, moved, with_decimals};
use crate::support::{Uniform, n_above, n_cases};

fn exact(tolerance: f64) -> ExactMethod {
    ExactMethod {
        tolerance,
        ..ExactMethod::default()
    }
}

fn compute(prepared: &Prepared, tolerance: f64) -> Computed {
    let computed = prepared.try_compute(&exact(tolerance)).unwrap();
    // What rounded corners leave open is another matter: `rounded` looks at that.
    assert!(computed.pairs.unwrap().n_above_tolerance == 0 && computed.factors.is_symmetric());
    computed
}

fn builtin_scene(name: &str) -> Scene {
    builtin::build(name, None).unwrap().scene
}

/// A room of 4 m × 5 m × 3 m that faces inwards.
fn room() -> Shapes {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0), DQuat::IDENTITY, true);
    shapes
}

fn direction(uniform: &mut Uniform) -> DVec3 {
    DVec3::new(uniform.next() - 0.5, uniform.next() - 0.5, uniform.next() - 0.5).normalize()
}

/// A room with two boxes turned at random, which may pierce each other, and a sheet of two faces.
fn random_scene(seed: u64) -> Scene {
    let mut uniform = Uniform(seed);
    let mut shapes = room();
    for _ in 0..2 {
        let half = DVec3::new(uniform.next(), uniform.next(), uniform.next()) * 0.4 + 0.2;
        let middle = DVec3::new(uniform.next() * 2.0, uniform.next() * 3.0, uniform.next()) + 1.0;
        let turn = DQuat::from_axis_angle(direction(&mut uniform), uniform.next() * 3.0);
        shapes.cuboid(middle - half, middle + half, turn, false);
    }
    let corner = DVec3::new(uniform.next() + 1.0, uniform.next() + 1.0, uniform.next() + 0.5);
    let (a, b) = (direction(&mut uniform), direction(&mut uniform));
    let sheet = [corner, corner + a, corner + a + b, corner + b];
    shapes.face(&sheet);
    shapes.face(&[sheet[0], sheet[3], sheet[2], sheet[1]]);
    shapes.scene()
}

/// Scenes that are the same but for where they stand and how large they are.
fn places(scene: &Scene) -> Vec<Scene> {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    vec![
        scene.clone(),
        moved(scene, turn, 1.0, DVec3::ZERO),
        moved(scene, turn, 1.0, DVec3::new(1e3, -1e3, 1e3)),
        moved(scene, turn, 1e-6, DVec3::ZERO),
        moved(scene, turn.inverse(), 1e6, DVec3::ZERO),
    ]
}

#[test]
fn a_room_with_a_floating_box_is_within_tolerance_and_estimate_of_its_certified_factors() {
    let text = include_str!("../../data/reference/occluded.json");
    let expected: Value = serde_json::from_str(text).unwrap();
    let expected = &expected["room_box_12"]["F"];
    for scene in places(&builtin_scene("room-box")) {
        let prepared = Prepared::new(scene, 1);
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let factors = compute(&prepared, tolerance).factors;
            let areas = factors.areas();
            for i in 0..12 {
                for j in 0..12 {
                    let error = (factors.get(i, j) - expected[i][j].as_f64().unwrap()).abs();
                    let most = tolerance * areas[i].min(areas[j]) / areas[i];
                    // The values are certified to 1e-10; estimates are stored as f32.
                    assert!(error <= most + 2e-10, "{i} {j} {tolerance:e}: {error:e}");
                    assert!(
                        error <= 1.000_001 * factors.std_error(i, j) + 2e-10,
                        "{i} {j}: {error:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_cube_is_exact_to_rounding() {
    for scene in places(&builtin_scene("cube")).into_iter().take(2) {
        let prepared = Prepared::new(scene, 6);
        let computed = compute(&prepared, 1e-6);
        let closed_form = prepared.compute(&ClosedForm {
            points: NonZeroUsize::MIN,
            seed: 0,
        });
        assert_eq!(computed.pairs.unwrap().partial, 0);
        for i in 0..216 {
            for j in 0..216 {
                let off = (computed.factors.get(i, j) - closed_form.get(i, j)).abs();
                assert!(off < 1e-13, "{i} {j}: {off:e}");
            }
            assert!((computed.factors.row_sum(i) - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn closed_scenes_lose_nothing_and_a_tighter_tolerance_agrees() {
    tolerances_agree(0..2, 2);
}

#[test]
#[ignore = "a minute"]
fn more_closed_scenes_lose_nothing_and_a_tighter_tolerance_agrees() {
    tolerances_agree(2..7, 3);
}

/// Compares tolerances on random rooms, the first of them in `n_places` places.
fn tolerances_agree(seeds: std::ops::Range<u64>, n_places: usize) {
    let first = seeds.start;
    for seed in seeds {
        let scene = random_scene(seed);
        for (place, scene) in places(&scene)
            .into_iter()
            .enumerate()
            .take(if seed == first { n_places } else { 1 })
        {
            let prepared = Prepared::new(scene, 1);
            let loose = compute(&prepared, 1e-5).factors;
            let tight = compute(&prepared, 1e-7).factors;
            let n = loose.n_rows();
            for i in 0..n {
                let (mut sum, mut error) = (0.0, 0.0);
                for j in 0..n {
                    let off = (loose.get(i, j) - tight.get(i, j)).abs();
                    let known = loose.std_error(i, j) + tight.std_error(i, j);
                    assert!(
                        off <= 1.000_001 * known + 1e-12,
                        "{seed} {place} {i} {j}: {off:e} {known:e}"
                    );
                    sum += tight.get(i, j);
                    error += tight.std_error(i, j);
                }
                // Six walls face a closed room in which only fronts can be seen, unless a box or the sheet pierces another.
                assert!(sum <= 1.0 + error + 1e-12, "{seed} {place} {i}: {sum}");
            }
        }
    }
}

#[test]
fn random_scenes_agree_with_rays_in_f64() {
    // Independent cosine-distributed rays from whole faces, against the same faces in f64.
    let n_rays = 20_000;
    let (mut worst, mut n_compared) = (0.0_f64, 0);
    for seed in 10..14 {
        let scene = random_scene(seed);
        let prepared = Prepared::new(scene.clone(), 1);
        let factors = compute(&prepared, 1e-6).factors;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(1)).unwrap();
        let visibility = BruteForce::new(&scene);
        let shooting = RandomShooting {
            rays: n_rays,
            sequence: Sequence::Random,
            seed,
        };
        let input = Input {
            scene: &scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded: false,
        };
        let sampled = shooting
            .compute(input, StorageChoice::default(), &Silent)
            .unwrap()
            .factors;
        for i in 0..factors.n_rows() {
            for j in 0..factors.n_rows() {
                let f = factors.get(i, j);
                let sigma = (f * (1.0 - f) / n_rays as f64).sqrt();
                let off = (sampled.get(i, j) - f).abs();
                // One hit where none is expected is no proof of the contrary; offsets of ray ends bend f32 rays by 1e-4 at most.
                if f * n_rays as f64 > 10.0 {
                    worst = worst.max((off - 1e-6).max(0.0) / sigma);
                    n_compared += 1;
                } else {
                    assert!(off < 30.0 / n_rays as f64, "{seed} {i} {j}: {f:e} {off:e}");
                }
            }
        }
    }
    // Of 1000 standard normal numbers one is above 5 in fewer than one case of 1000.
    assert!(n_compared > 300 && worst < 5.0, "{worst} of {n_compared}");
}

#[test]
fn parts_sum_to_the_whole() {
    expect_parts_to_sum_to_the_whole(&builtin_scene("room-box"));
}

/// Side 8 of a box sees wall 3 down to its own horizon, on which the outline of the other box crosses a corner of what is left of the wall.
#[test]
fn parts_sum_to_the_whole_among_intersecting_boxes() {
    expect_parts_to_sum_to_the_whole(&random_scene(3));
}

fn expect_parts_to_sum_to_the_whole(scene: &Scene) {
    let whole = Prepared::new(scene.clone(), 1);
    let whole = whole.by_surface(&compute(&whole, 1e-7).factors);
    let cuts = [(2, false), (4, true), (1, true), (5, false)];
    for &(n, cut_at_walls) in &cuts[..n_cases(2, cuts.len())] {
        let options = MeshOptions {
            subdivision: Subdivision::Uniform(n),
            cut_at_walls,
        };
        let parts = Prepared::with(scene.clone(), options);
        for tolerance in [1e-4, 1e-6] {
            let by_surface = parts.by_surface(&compute(&parts, tolerance).factors);
            for k in 0..whole.form_factor.len() {
                let off = (whole.form_factor[k] - by_surface.form_factor[k]).abs();
                let known = whole.error[k] + by_surface.error[k];
                assert!(
                    off <= 1.000_001 * known + 1e-13,
                    "{n} {cut_at_walls} {tolerance:e} {k}: {off:e} {known:e}"
                );
            }
        }
    }
}

#[test]
fn an_occluder_takes_light_and_never_adds_any() {
    let empty = Prepared::new(room().scene(), 2);
    let without = compute(&empty, 1e-6).factors;
    for seed in 0..3 {
        let prepared = Prepared::new(random_scene(seed), 2);
        let with = compute(&prepared, 1e-6).factors;
        let mut taken = 0.0;
        for i in 0..24 {
            for j in 0..24 {
                let (f, most) = (with.get(i, j), without.get(i, j));
                assert!(f <= most * (1.0 + 1e-11), "{seed} {i} {j}: {f} {most}");
                taken += most - f;
            }
        }
        assert!(taken > 0.1, "{taken}");
    }
}

/// A room with a box that stands on the floor, in a corner if `in_corner`, without the sides that touch a wall if `open`.
fn room_with_a_standing_box(in_corner: bool, open: bool) -> Scene {
    let low = if in_corner {
        DVec3::ZERO
    } else {
        DVec3::new(1.0, 1.0, 0.0)
    };
    let high = low + DVec3::new(2.0, 2.5, 1.0);
    let mut shapes = room();
    let mut block = Shapes::default();
    block.cuboid(low, high, DQuat::IDENTITY, false);
    let block = block.scene();
    for face in block.face_ids() {
        let corners = block.polygon(face);
        let touches = (0..3).any(|axis| corners.iter().all(|v| v[axis].abs() < 1e-12));
        if !(open && touches) {
            shapes.face(&corners);
        }
    }
    shapes.scene()
}

#[test]
fn patches_under_a_box_see_nothing_and_the_others_lose_nothing() {
    for (in_corner, open) in [(false, false), (false, true), (true, false), (true, true)] {
        let scene = room_with_a_standing_box(in_corner, open);
        for (place, scene) in places(&scene).into_iter().enumerate().take(3) {
            let prepared = Prepared::new(scene, 8);
            let factors = compute(&prepared, 1e-5).factors;
            let (mut n_hidden, mut n_whole) = (0, 0);
            for (i, patch) in prepared.mesh.patches.iter().enumerate() {
                let sum = factors.row_sum(i);
                let mut error = 0.0;
                factors.for_each_in_row(i, |_, _, e| error += e);
                assert!(sum <= 1.0 + error + 1e-9, "{place} {i} {sum}");
                let is_floor = patch.surface.0 == 4;
                let touches_box = !is_floor && (sum - 1.0).abs() > error + 1e-9;
                if is_floor && sum < 0.5 && !in_corner {
                    n_hidden += usize::from(sum.to_bits() == 0);
                }
                n_whole += usize::from(!touches_box);
            }
            if !in_corner {
                // The floor's cells are 0.5 by 0.625 m: 4 by 4 of them lie wholly under the box.
                assert!(n_hidden >= 4 * 2, "{in_corner} {open} {place}: {n_hidden}");
            }
            // In the corner 192 patches are sides of the box that touch walls, or lie under them.
            assert!(n_whole > prepared.mesh.n_patches() * 2 / 3, "{n_whole}");
        }
    }
}

/// A wall and its upper part make one plane but for a lean of any size: as one occluder they would stand before the lower part.
#[test]
fn a_wall_whose_upper_part_leans_a_little_sees_what_it_saw() {
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let mut random = Uniform(3);
    let mut n = 0;
    for exponent in 0..17 {
        for turned in [false, true] {
            let turn = if turned {
                DQuat::from_axis_angle(at(1.0, 2.0, 2.0) / 3.0, random.between(0.1, 3.0))
            } else {
                DQuat::IDENTITY
            };
            let factors = |leans: [f64; 2]| {
                let mut shapes = Shapes::default();
                let mut face = |corners: [DVec3; 4]| shapes.face(&corners.map(|v| turn * v));
                face([
                    at(1.5, 0.0, 0.0),
                    at(1.5, 2.4, 0.0),
                    at(1.5, 2.4, 3.3),
                    at(1.5, 0.0, 3.3),
                ]);
                face([
                    at(3.8, 3.4, 2.0),
                    at(3.8, 5.9, 2.0),
                    at(3.8, 5.9, 0.0),
                    at(3.8, 3.4, 0.0),
                ]);
                let [near, far] = leans.map(|lean| 3.8 - lean);
                face([
                    at(near, 3.4, 3.3),
                    at(far, 5.9, 3.3),
                    at(3.8, 5.9, 2.0),
                    at(3.8, 3.4, 2.0),
                ]);
                let found = compute(&Prepared::new(shapes.scene(), 1), 1e-6);
                [(1, 0), (2, 0), (0, 1)].map(|(i, j)| (found.factors.get(i, j), found.factors.std_error(i, j)))
            };
            let lean = 1e-15 * 10.0_f64.powf(0.25 * f64::from(exponent)) * random.between(1.0, 1.7);
            let upright = factors([0.0; 2]);
            for leans in [[lean, 0.3 * lean], [-lean, -0.2 * lean], [lean, -lean]] {
                for ((value, stated), (expected, own)) in factors(leans).into_iter().zip(upright) {
                    let off = (value - expected).abs();
                    assert!(
                        off <= stated + own + 1e-9,
                        "{leans:?} {turned}: {value}, not {expected}"
                    );
                    n += usize::from(expected > 0.01);
                }
            }
        }
    }
    assert!(n > 200, "{n}");
}

/// A patch lies under a box that stands askew, or outside of it, and loses nothing there: none does both where faces end at its walls.
#[test]
fn faces_that_end_at_walls_lie_on_one_side_of_them() {
    let (low, high) = (DVec3::new(1.0, 1.0, 0.0), DVec3::new(2.0, 3.1, 1.0));
    let mut shapes = room();
    shapes.cuboid(low, high, DQuat::from_rotation_z(0.4), false);
    let scene = shapes.scene();
    for (place, scene) in places(&scene).into_iter().enumerate() {
        let of = |cut_at_walls| {
            let options = MeshOptions {
                subdivision: Subdivision::Uniform(6),
                cut_at_walls,
            };
            let prepared = Prepared::with(scene.clone(), options);
            let factors = compute(&prepared, 1e-6).factors;
            let rows = prepared.mesh.patches.iter().enumerate().map(|(i, patch)| {
                let mut error = 0.0;
                factors.for_each_in_row(i, |_, _, e| error += e);
                let sum = factors.row_sum(i);
                let is_whole = (sum - 1.0).abs() <= error + 1e-9;
                (is_whole, sum.abs() <= error + 1e-9, patch.area)
            });
            rows.collect::<Vec<_>>()
        };
        let (cut, whole) = (of(true), of(false));
        let on_both = |rows: &[(bool, bool, f64)]| rows.iter().filter(|row| !row.0 && !row.1).count();
        assert_eq!(on_both(&cut), 0, "{place}");
        assert!(on_both(&whole) > 8, "{place}");
        // The underside of the box, and what it covers of the floor, of all in this place's unit.
        let area = |is_of: fn(&(bool, bool, f64)) -> bool| -> f64 {
            cut.iter().filter(|row| is_of(row)).map(|row| row.2).sum()
        };
        let hidden = area(|row| row.1) / area(|_| true);
        let expected = 2.0 * 2.1 / (2.0 * (20.0 + 12.0 + 15.0) + 2.0 * (2.1 + 1.0 + 2.1));
        assert!((hidden / expected - 1.0).abs() < 1e-9, "{place}: {hidden} {expected}");
    }
}

/// `closed_rows` names no row whose light in part meets backs, under a box or in one, and leaves out few others.
#[test]
fn rows_that_are_known_to_sum_to_1_do() {
    let sunk = {
        let mut shapes = room();
        let turn = DQuat::from_axis_angle(DVec3::Y, 0.3);
        shapes.cuboid(DVec3::new(1.0, 1.0, -0.5), DVec3::new(2.0, 3.0, 0.5), turn, false);
        shapes.scene()
    };
    for scene in [room_with_a_standing_box(false, false), sunk] {
        for scene in places(&scene) {
            let prepared = Prepared::new(scene, 8);
            let closed = closed_rows(prepared.input());
            let factors = compute(&prepared, 1e-5).factors;
            let mut n_short = 0;
            for (i, closed) in closed.iter().enumerate() {
                let mut error = 1e-9;
                factors.for_each_in_row(i, |_, _, e| error += e);
                let is_short = (factors.row_sum(i) - 1.0).abs() > error;
                assert!(!(*closed && is_short), "{i}: {}", factors.row_sum(i));
                n_short += usize::from(is_short);
            }
            let n_closed = closed.iter().filter(|closed| **closed).count();
            // Those that touch the box's sides without lying under it are few.
            assert!(n_short > 64 && n_closed > 768 - 3 * n_short, "{n_closed} {n_short}");
        }
    }
    let alone = Prepared::new(builtin_scene("cube"), 2);
    assert_eq!(closed_rows(alone.input()), [true; 24]);
}

#[test]
fn both_sides_of_a_sheet_see_their_own_half() {
    let mut shapes = room();
    let sheet = [
        DVec3::new(0.0, 2.0, 0.0),
        DVec3::new(4.0, 2.0, 0.0),
        DVec3::new(4.0, 2.0, 3.0),
        DVec3::new(0.0, 2.0, 3.0),
    ];
    shapes.face(&sheet);
    shapes.face(&[sheet[0], sheet[3], sheet[2], sheet[1]]);
    let prepared = Prepared::new(shapes.scene(), 3);
    let factors = compute(&prepared, 1e-6).factors;
    for (i, patch) in prepared.mesh.patches.iter().enumerate() {
        // What the sheet cuts in two is lit from both halves: every row of a closed room sums to 1.
        let mut error = 0.0;
        factors.for_each_in_row(i, |_, _, e| error += e);
        assert!((factors.row_sum(i) - 1.0).abs() <= error + 1e-11, "{i}");
        let side = patch.centroid.y - 2.0;
        for (j, other) in prepared.mesh.patches.iter().enumerate() {
            let other_side = other.centroid.y - 2.0;
            if side.abs() > 0.9 && other_side.abs() > 0.9 && side * other_side < 0.0 {
                assert_eq!(factors.get(i, j).to_bits(), 0, "{i} {j}");
            }
        }
    }
}

#[test]
fn a_sphere_of_many_facets_closes_its_room() {
    let prepared = Prepared::new(builtin_scene("sphere-room-r1"), 1);
    let computed = compute(&prepared, 1e-5);
    assert!(computed.pairs.unwrap().partial > 1000);
    for i in 0..computed.factors.n_rows() {
        let mut error = 0.0;
        computed.factors.for_each_in_row(i, |_, _, e| error += e);
        let sum = computed.factors.row_sum(i);
        assert!((sum - 1.0).abs() <= error + 1e-11, "{i}: {sum} {error}");
    }
}

#[test]
fn equal_bytes_at_any_number_of_threads() {
    let prepared = Prepared::new(random_scene(1), 3);
    let values = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let computed = pool.install(|| compute(&prepared, 1e-5));
        let n = computed.factors.n_rows();
        let bits = |k: usize| computed.factors.get(k / n, k % n).to_bits();
        (computed.pairs, (0..n * n).map(bits).collect::<Vec<_>>())
    };
    let one = values(1);
    assert!(one == values(3) && one == values(7));
}

#[test]
fn a_spent_budget_is_told_and_the_estimates_still_hold() {
    let prepared = Prepared::new(builtin_scene("room-box"), 1);
    let method = ExactMethod {
        tolerance: 1e-10,
        budget: 300,
    };
    let spent = prepared.try_compute(&method).unwrap();
    assert!(!spent.tolerance_met && spent.pairs.unwrap().n_above_tolerance > 0);
    let tight = compute(&prepared, 1e-8).factors;
    for i in 0..12 {
        for j in 0..12 {
            let off = (spent.factors.get(i, j) - tight.get(i, j)).abs();
            assert!(
                off <= 1.000_001 * spent.factors.std_error(i, j) + 1e-8,
                "{i} {j}: {off:e}"
            );
        }
    }
}

/// Above 1e-6 pairs of grids whose steps differ, such as those of the box and the walls, are differences of values at corners.
#[test]
fn grids_of_different_steps_keep_what_they_promise_at_loose_tolerances() {
    for scene in places(&builtin_scene("room-box")) {
        let prepared = Prepared::new(scene, 4);
        let input = Input {
            unoccluded: true,
            ..prepared.input()
        };
        let at = |tolerance: f64| {
            let computed = exact(tolerance).compute(input, StorageChoice::default(), &Silent);
            computed.unwrap().factors
        };
        let tight = at(1e-7);
        for tolerance in [1e-5, 1e-3] {
            let loose = at(tolerance);
            let areas = loose.areas();
            for i in 0..loose.n_rows() {
                for j in 0..loose.n_rows() {
                    let off = (loose.get(i, j) - tight.get(i, j)).abs();
                    let most = 1e-5 * tolerance * areas[i].min(areas[j]) / areas[i];
                    // Or 1e-9 of the value, and what the reference is off by.
                    assert!(off <= most.max(1e-9 * tight.get(i, j)) + 2e-12, "{i} {j}: {off:e}");
                    let known = loose.std_error(i, j) + tight.std_error(i, j);
                    assert!(off <= 1.000_001 * known + 1e-15, "{i} {j}: {off:e} {known:e}");
                }
            }
        }
    }
}

/// Rows are computed some at a time, and those of one face may be cut anywhere: also where the last few have too few pairs with a small face to be computed together.
#[test]
fn rows_may_be_cut_within_a_face_beside_one_of_a_single_patch() {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::ONE, DQuat::IDENTITY, true);
    let dot = DVec3::new(0.5, 0.47, 0.6);
    shapes.cuboid(dot, dot + 0.03, DQuat::IDENTITY, false);
    let scene = shapes.scene();
    for length in [0.08, 0.07, 0.06] {
        let mesh = Mesh::new(&scene, Subdivision::MaxEdge(length)).unwrap();
        let input = Input {
            scene: &scene,
            mesh: &mesh,
            visibility: &BruteForce::new(&scene),
            unoccluded: false,
        };
        let computed = exact(1e-3).compute(input, StorageChoice::default(), &Silent);
        let factors = computed.unwrap().factors;
        for i in 0..factors.n_rows() {
            // Each of the dot's six patches may be off by the tolerance, in the terms of the smaller of two areas.
            let shares = (0..factors.n_rows()).map(|j| factors.get(i, j));
            let known: f64 = (0..factors.n_rows()).map(|j| factors.std_error(i, j)).sum();
            let off = (shares.sum::<f64>() - 1.0).abs();
            assert!(off <= known + 1e-9 && known < 6e-3, "{length} {i}: {off:e} {known:e}");
        }
    }
}

/// A ball of 20480 triangles over a floor: of 2 · 10⁸ pairs of faces only those of the floor and the ball's underside see each other.
#[test]
#[ignore = "ten seconds, and as much to build the scene"]
fn twenty_thousand_faces_of_a_ball_see_the_floor_as_the_sphere_does() {
    let mut shapes = Shapes::default();
    let (height, half) = (1.5, 2.0);
    let corner = |x: f64, y: f64| DVec3::new(x * half, y * half, 0.0);
    shapes.face(&[
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ]);
    shapes.ball(DVec3::Z * height, 1.0, 5);
    let prepared = Prepared::new(shapes.scene(), 1);
    let computed = compute(&prepared, 1e-6);
    let n = 20_481_u64;
    assert_eq!(computed.factors.n_rows() as u64, n);
    let pairs = computed.pairs.unwrap();
    // All triangles that have a corner of the floor before them; nothing else occludes.
    let floor = prepared.mesh.polygon(radiosity::mesh::PatchId(0));
    let sees_floor =
        |patch: &&radiosity::mesh::Patch| floor.iter().any(|&v| patch.normal.dot(v - patch.centroid) > 0.0);
    let n_seeing = prepared.mesh.patches[1..].iter().filter(sees_floor).count();
    assert_eq!(pairs.full, n_seeing as u64);
    assert_eq!((pairs.partial, pairs.hidden), (0, 0));
    assert_eq!(pairs.full + pairs.not_facing, n * (n - 1) / 2);
    // Each point of the floor sees a sphere by cos θ (R/d)²: over the floor that is R² times the solid angle of the floor from the centre.
    let solid_angle = 4.0 * (half * half / (height * (2.0 * half * half + height * height).sqrt())).atan();
    let (seen, sphere) = (computed.factors.row_sum(0) * 4.0 * half * half, solid_angle);
    // The ball lies in the sphere and around the largest one inside of it: it is seen less than the first, and more than the second.
    let centre = DVec3::Z * height;
    let heights = prepared.mesh.patches[1..]
        .iter()
        .map(|patch| patch.normal.dot(patch.centroid - centre));
    let inner = heights.fold(1.0, f64::min);
    assert!(inner > 0.9995, "{inner}");
    assert!(seen < sphere && seen > sphere * inner * inner, "{seen} {sphere}");
}

#[test]
fn without_occluders_nothing_is_classified() {
    let prepared = Prepared::new(builtin_scene("cube"), 4);
    let pairs = compute(&prepared, 1e-6).pairs.unwrap();
    assert_eq!((pairs.partial, pairs.hidden, pairs.n_rays), (0, 0, 0));
    assert_eq!(pairs.full + pairs.not_facing, 96 * 95 / 2);
    assert_eq!(pairs.full, 15 * 16 * 16);
}

/// Two rooms with a wall between them, of a face for each, and a box that stands on a floor; turned, so that no coordinate is a round number.
fn adjoining_rooms(turn: DQuat, in_triangles: bool) -> Scene {
    let mut shapes = Shapes::default();
    let mut face = |corners: [DVec3; 4]| {
        let [a, b, c, d] = corners.map(|v| turn * v);
        if in_triangles {
            shapes.face(&[a, b, c]);
            shapes.face(&[a, c, d]);
        } else {
            shapes.face(&[a, b, c, d]);
        }
    };
    let mut cuboid = |low: DVec3, high: DVec3, inwards: bool| {
        let d = high - low;
        let (x, y, z) = (DVec3::X * d.x, DVec3::Y * d.y, DVec3::Z * d.z);
        for (corner, a, b) in [
            (low, y, z),
            (low + x, z, y),
            (low, z, x),
            (low + y, x, z),
            (low, x, y),
            (low + z, y, x),
        ] {
            let (a, b) = if inwards { (a, b) } else { (b, a) };
            face([corner, corner + a, corner + a + b, corner + b]);
        }
    };
    cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), true);
    cuboid(DVec3::new(4.0, -0.5, 0.0), DVec3::new(9.0, 3.0, 3.0), true);
    cuboid(DVec3::new(1.0, 0.75, 0.0), DVec3::new(2.25, 1.75, 1.0), false);
    shapes.scene()
}

#[test]
fn rounded_coordinates_neither_hide_what_touches_nor_let_the_sides_of_a_sheet_see_each_other() {
    let mut uniform = Uniform(5);
    for (round, in_triangles) in [(0, false), (1, true), (2, false), (3, true)] {
        let turn = DQuat::from_axis_angle(direction(&mut uniform), 0.5 + f64::from(round));
        let scene = adjoining_rooms(turn, in_triangles);
        let rounded = Prepared::new(with_decimals(6, &scene), 2);
        let meant = Prepared::new(scene, 2);
        let [expected, found] = [&meant, &rounded].map(|prepared| compute(prepared, 1e-6));
        let n = rounded.mesh.n_patches();
        for i in 0..n {
            for j in 0..n {
                let (a, b) = (expected.factors.get(i, j), found.factors.get(i, j));
                // Corners are off by 9e-7 m at most, patches are 0.5 m wide and more.
                assert!((a - b).abs() < 1e-5, "{round} {i} {j}: {a} {b}");
            }
            let error: f64 = (0..n).map(|j| found.factors.std_error(i, j)).sum();
            let [sum, meant] = [&found, &expected].map(|computed| computed.factors.row_sum(i));
            assert!((sum - meant).abs() < 5e-6, "{round} {i}: {sum} {meant}");
            // What is closed stays closed, but for what the errors say.
            let is_closed = (meant - 1.0).abs() < 1e-6;
            assert!(
                !is_closed || (sum - 1.0).abs() < error + 1e-6,
                "{round} {i}: {sum}, {error:e}"
            );
        }
        // Sides of a sheet that rounding may have parted count, slits between them known or not.
        let pairs = found.pairs.unwrap();
        let n_counted = pairs.n_above_by_rounding + pairs.n_above_tolerance;
        assert_eq!(n_above(&found.factors, 1e-6), n_counted, "{round}");
        assert_eq!(found.tolerance_met, n_counted == 0, "{round}");
        // What is meant to touch is hardly ever in the way.
        let [of_meant, of_rounded] = [&expected, &found].map(|computed| computed.pairs.unwrap());
        assert!(
            4 * of_rounded.partial <= 5 * of_meant.partial,
            "{round}: {of_rounded:?} {of_meant:?}"
        );
    }
}

/// A partition over a floor, or standing on it, and a roof; both sides are cut, each elsewhere or not at all.
fn partition(uniform: &mut Uniform) -> Scene {
    let turn = DQuat::from_axis_angle(direction(uniform), 6.0 * uniform.next());
    let shift = DVec3::new(uniform.next(), uniform.next(), uniform.next());
    let (width, height) = (0.5 + 2.5 * uniform.next(), 0.5 + 2.5 * uniform.next());
    let low = if uniform.next() < 0.5 { 0.0 } else { 0.1 };
    let mut shapes = Shapes::default();
    let mut face = |corners: [[f64; 3]; 4], is_turned: bool| {
        let mut corners = corners.map(|v| turn * DVec3::from_array(v) + shift);
        if is_turned {
            corners.reverse();
        }
        shapes.face(&corners);
    };
    for is_back in [false, true] {
        let is_upright = uniform.next() < 0.5;
        let length = if is_upright { width } else { height };
        let mut cuts = vec![0.0, length];
        for _ in 0..2 {
            if uniform.next() < 0.5 {
                cuts.push(length * (0.02 + 0.96 * uniform.next()));
            }
        }
        cuts.sort_by(f64::total_cmp);
        for ends in cuts.windows(2) {
            let ([x0, x1], [z0, z1]) = if is_upright {
                ([ends[0], ends[1]], [0.0, height])
            } else {
                ([0.0, width], [ends[0], ends[1]])
            };
            let (z0, z1) = (low + z0, low + z1);
            face([[x0, 0.0, z0], [x1, 0.0, z0], [x1, 0.0, z1], [x0, 0.0, z1]], is_back);
        }
    }
    let floor = |z: f64| [[-4.0, -4.0, z], [4.0, -4.0, z], [4.0, 4.0, z], [-4.0, 4.0, z]];
    face(floor(0.0), false);
    face(floor(4.0), true);
    shapes.scene()
}

#[test]
fn a_rounded_partition_neither_hides_nor_sees_its_own_other_side() {
    let mut uniform = Uniform(11);
    for round in 0..n_cases(6, 20) {
        let scene = partition(&mut uniform);
        let n = scene.faces.len();
        let normals: Vec<DVec3> = scene.face_ids().map(|face| scene.area_vector(face)).collect();
        let is_upright = |i: usize| normals[i].normalize().dot(normals[n - 1].normalize()).abs() < 0.5;
        let meant = compute(&Prepared::new(scene.clone(), 1), 1e-6);
        for places in [6, 8, 10] {
            let found = compute(&Prepared::new(with_decimals(places, &scene), 1), 1e-6);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let (a, b) = (meant.factors.get(i, j), found.factors.get(i, j));
                if is_upright(i) && is_upright(j) {
                    // But for what strips that rounding leans see along the edges of others.
                    assert!(a == 0.0 && b < 1e-9, "{round} {places} {i} {j}: {a} {b}");
                }
                let error = meant.factors.std_error(i, j) + found.factors.std_error(i, j);
                assert!(
                    (a - b).abs() < error + 1e-5,
                    "{round} {places} {i} {j}: {a} {b} {error:e}"
                );
            }
        }
    }
}

#[test]
fn a_rounded_sheet_alone_sees_nothing() {
    let mut uniform = Uniform(3);
    for round in 0..24 {
        let turn = DQuat::from_axis_angle(direction(&mut uniform), 6.0 * uniform.next());
        let corners = [[0.0, 0.0], [1.7, 0.0], [1.7, 1.1], [0.0, 1.1]].map(|[x, y]| turn * DVec3::new(x, y, 0.3));
        let mut back = corners;
        back.reverse();
        back.rotate_left(round % 4);
        let mut shapes = Shapes::default();
        shapes.face(&corners);
        shapes.face(&back);
        let found = compute(&Prepared::new(with_decimals(6, &shapes.scene()), 1), 1e-6);
        let seen = found.factors.get(0, 1);
        assert!(seen == 0.0, "{round}: {seen}");
    }
}

#[test]
fn the_error_of_rounding_stays_small_where_a_middle_lies_on_the_other_plane() {
    let mut uniform = Uniform(9);
    let mut most = 0.0_f64;
    for round in 0..12 {
        let turn = DQuat::from_axis_angle(direction(&mut uniform), 0.3 + f64::from(round));
        let mut shapes = Shapes::default();
        // A roof at half of the height of a wall that it does not touch.
        let roof = [[2.0, 0.0, 6.0], [10.0, 0.0, 6.0], [10.0, 8.0, 6.0], [2.0, 8.0, 6.0]];
        let wall = [[0.0, 0.0, 3.0], [0.0, 12.0, 3.0], [0.0, 12.0, 9.0], [0.0, 0.0, 9.0]];
        for corners in [roof, wall] {
            shapes.face(&corners.map(|v| turn * DVec3::from_array(v)));
        }
        let scene = shapes.scene();
        let rounded = with_decimals(6, &scene);
        let [meant, found] = [scene, rounded].map(|scene| compute(&Prepared::new(scene, 1), 1e-9).factors);
        for (i, j) in [(0, 1), (1, 0)] {
            let (a, b, error) = (meant.get(i, j), found.get(i, j), found.std_error(i, j));
            assert!(a > 0.05 && (a - b).abs() < 1e-6, "{round}: {a} {b}");
            assert!(error < 1e-4 * b, "{round}: {b} {error:e}");
            most = most.max(error);
        }
    }
    // What reaches in between by no more than rounding is left out, and stated.
    assert!(most > 1e-8, "{most:e}");
}

/// Expects the stated errors to hold between a floor and a ceiling with a plate between them, at the origin and in a file with two decimals a kilometre off, where its edge is nearer to
/// those of patches than rounding tells.
fn expect_errors_to_hold_a_kilometre_off(plate: [[f64; 3]; 4]) {
    let mut shapes = Shapes::default();
    let level = |z: f64| [[0.0, 0.0, z], [4.0, 0.0, z], [4.0, 4.0, z], [0.0, 4.0, z]];
    shapes.face(&level(0.0).map(DVec3::from_array));
    let mut ceiling = level(2.0);
    ceiling.reverse();
    shapes.face(&ceiling.map(DVec3::from_array));
    shapes.face(&plate.map(DVec3::from_array));
    // Without a slanted face all would lie along the axes, and count as meant.
    shapes.face(&[[10.0, 0.0, 0.0], [11.0, 0.0, 0.5], [11.0, 1.0, 0.25]].map(DVec3::from_array));
    let scene = shapes.scene();
    let far = with_decimals(2, &moved(&scene, DQuat::IDENTITY, 1.0, DVec3::new(1000.0, 1000.0, 0.0)));
    let [near, far] = [scene, far].map(|scene| compute(&Prepared::new(scene, 4), 1e-6).factors);
    let pairs = (0..64).flat_map(|i| (0..64).map(move |j| (i, j)));
    let mut most = 0.0_f64;
    for (i, j) in pairs {
        let (a, b) = (near.get(i, j), far.get(i, j));
        let error = near.std_error(i, j) + far.std_error(i, j);
        // Errors are kept in f32.
        assert!(
            (a - b).abs() <= (1.0 + 1e-6) * error + 1e-12,
            "{i} {j}: {a} {b} {error:e}"
        );
        most = most.max((a - b).abs());
    }
    assert!(most > 1e-5, "{most:e}");
}

#[test]
fn what_is_left_out_between_patches_alone_is_stated() {
    expect_errors_to_hold_a_kilometre_off([[1.01, 0.0, 0.0], [1.01, 4.0, 0.0], [1.01, 4.0, 2.0], [1.01, 0.0, 2.0]]);
}

#[test]
fn pairs_with_much_in_between_are_what_they_are_as_a_whole() {
    // Houses on a ground, and a ceiling.
    let mut uniform = Uniform(2);
    let mut shapes = Shapes::default();
    let level = |z: f64| [(0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0)].map(|(x, y)| DVec3::new(x, y, z));
    shapes.face(&level(0.0));
    let mut ceiling = level(70.0);
    ceiling.reverse();
    shapes.face(&ceiling);
    for k in 0..n_cases(6, 9) {
        let low = DVec3::new(4.0 + 20.0 * f64::from(k % 3), 4.0 + 20.0 * f64::from(k / 3), 0.0);
        let size = DVec3::new(
            10.0 + 3.0 * uniform.next(),
            10.0 + 3.0 * uniform.next(),
            5.0 + 35.0 * uniform.next(),
        );
        shapes.cuboid(low, low + size, DQuat::IDENTITY, false);
    }
    let prepared = Prepared::new(shapes.scene(), 1);
    let tolerance = n_cases(1e-4, 1e-5);
    let found = compute(&prepared, tolerance).factors;
    let index = OccluderIndex::new(&prepared.scene);
    let polygon = |i: usize| prepared.scene.polygon(prepared.mesh.patches[i].face);
    let (mut n_checked, n_to_check) = (0, n_cases(2, 6));
    let n = prepared.mesh.n_patches();
    for (i, j) in (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))) {
        let (p, q) = (polygon(i), polygon(j));
        let PairVisibility::Partial(among) = index.classify(&p, &q) else {
            continue;
        };
        if among.len() < 12 || n_checked == n_to_check {
            continue;
        }
        n_checked += 1;
        let smaller_area = found.areas()[i].min(found.areas()[j]);
        let accuracy = Accuracy {
            tolerance,
            budget: ExactMethod::DEFAULT_BUDGET,
        };
        let whole = exchange_area(&p, &q, &index.occluders(&p, &q, &among), accuracy);
        let area = found.areas()[i];
        let (split, error) = (area * found.get(i, j), area * found.std_error(i, j));
        assert!(
            whole.reached && error <= tolerance * smaller_area,
            "{i} {j}: {whole:?} {error}"
        );
        let difference = (split - whole.exchange_area).abs();
        assert!(difference <= error + whole.error, "{i} {j}: {split} {error} {whole:?}");
    }
    assert_eq!(n_checked, n_to_check);
}

#[test]
fn rays_take_the_sides_of_a_rounded_sheet_for_what_they_are() {
    // Rounding parts the two faces of the wall by up to 1e-5 m, ten times what f32 does in a scene of this size.
    let mut uniform = Uniform(7);
    for round in 0..4 {
        let turn = DQuat::from_axis_angle(direction(&mut uniform), 0.7 + f64::from(round));
        let prepared = Prepared::new(with_decimals(5, &adjoining_rooms(turn, true)), 2);
        let settings = MethodSettings::default().with(&RAYS, 2000_u64).seeded(1);
        let shot = prepared.compute(&*registry::method("sr", &settings).unwrap());
        let expected = compute(&prepared, 1e-5).factors;
        for (i, tally) in shot.tallies().iter().enumerate() {
            // Under the box the floor sees backs alone, and the bottom of the box what is below the floor.
            let lost = 1.0 - expected.row_sum(i);
            let taken = tally.absorbed().unwrap() + tally.escaped().unwrap();
            assert!((taken - lost).abs() < 0.05, "{round} {i}: {tally:?} {lost}");
        }
    }
}

#[test]
fn no_method_lets_a_bent_quad_hide_its_own_patches() {
    // Two parallel plates, turned, with six decimals: their quads are bent by less than the loader minds.
    let plate = |corners: [[f64; 3]; 4]| corners.map(DVec3::from_array);
    let mut shapes = Shapes::default();
    shapes.face(&plate([
        [0.0, 0.0, 0.0],
        [0.023_299, -1.965_844, -3.483_521],
        [2.390_618, -4.767_026, -1.886_905],
        [2.367_319, -2.801_182, 1.596_615],
    ]));
    shapes.face(&plate([
        [-1.612_084, -1.035_476, 0.573_564],
        [0.755_235, -3.836_657, 2.170_180],
        [0.778_534, -5.802_501, -1.313_341],
        [-1.588_785, -3.001_319, -2.909_956],
    ]));
    let prepared = Prepared::new(with_decimals(6, &shapes.scene()), 4);
    for name in ["exact", "contour", "qmc", "gauss-lambert", "pdm", "centre", "sr", "sg"] {
        let settings = MethodSettings::default().seeded(1);
        let factors = prepared.compute(&*registry::method(name, &settings).unwrap());
        let found = prepared.by_surface(&factors).form_factor[1];
        // 4 m × 4 m, 2 m apart: the closed form of parallel squares.
        let limit = match name {
            "centre" => 0.02,
            "sr" | "sg" => 0.01,
            "pdm" | "gauss-lambert" => 1e-3,
            _ => 1e-5,
        };
        assert!((found - 0.415_253_27).abs() < limit, "{name}: {found}");
    }
}

/// Two boxes in a room of a metre, turned, which face each other across a gap.
fn boxes_across(gap: f64, turn: DQuat) -> Scene {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::ONE, DQuat::IDENTITY, true);
    shapes.cuboid(DVec3::splat(0.2), DVec3::splat(0.5), DQuat::IDENTITY, false);
    let low = DVec3::new(0.5 + gap, 0.25, 0.3);
    shapes.cuboid(low, DVec3::new(0.8, 0.6, 0.7), DQuat::IDENTITY, false);
    moved(&shapes.scene(), turn, 1.0, DVec3::ZERO)
}

#[test]
fn what_stands_a_hair_in_front_of_a_patch_hides_all_behind() {
    let turn = DQuat::from_axis_angle(DVec3::new(0.36, 0.48, -0.8), 1.3);
    for turn in [DQuat::IDENTITY, turn] {
        let wide = compute(&Prepared::new(boxes_across(1e-7, turn), 1), 1e-5).factors;
        for gap in [1e-9, 1e-10, 1e-11, 1e-12, 1e-13] {
            let narrow = compute(&Prepared::new(boxes_across(gap, turn), 1), 1e-5).factors;
            for i in 0..narrow.n_rows() {
                for j in 0..narrow.n_rows() {
                    let difference = (narrow.get(i, j) - wide.get(i, j)).abs();
                    // The gap itself lets some light out, by its own width over that of the boxes.
                    let error = narrow.std_error(i, j) + wide.std_error(i, j) + 1e-6;
                    assert!(difference <= error, "{gap} {i} {j}: {difference} {error}");
                }
            }
        }
    }
}

/// Turns with which these boxes let through up to 4 % of a row once, where corners stood out of a neighbour's plane by more than was allowed for.
#[test]
fn boxes_that_touch_let_no_light_through_however_their_coordinates_are_rounded() {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::ONE, DQuat::IDENTITY, true);
    for (low, high) in [
        ([0.2, 0.2, 0.2], [0.5, 0.5, 0.5]),
        ([0.5, 0.25, 0.3], [0.8, 0.6, 0.7]),
        ([0.0, 0.62, 0.0], [0.3, 0.9, 0.5]),
    ] {
        shapes.cuboid(DVec3::from(low), DVec3::from(high), DQuat::IDENTITY, false);
    }
    let upright = shapes.scene();
    let turns = [
        [
            -0.250_473_970_011_033_94,
            -0.202_713_194_438_759_07,
            0.621_284_741_066_046,
            -0.714_265_652_027_200_3,
        ],
        [
            0.690_950_185_612_084_4,
            0.044_814_665_234_561_464,
            0.318_117_067_986_983,
            0.647_596_338_653_875_9,
        ],
        [
            0.519_616_447_658_824_1,
            0.332_089_380_579_201_57,
            -0.772_134_605_540_081_3,
            0.153_373_862_037_864_35,
        ],
        [
            -0.021_233_424_077_350_592,
            -0.449_033_683_604_610_9,
            0.536_416_322_481_507,
            -0.714_265_652_027_200_3,
        ],
    ];
    for turn in turns.into_iter().take(n_cases(2, turns.len())) {
        let meant = moved(&upright, DQuat::from_array(turn), 1.0, DVec3::ZERO);
        for places in [6, 9, 10, 11] {
            let found = compute(&Prepared::new(with_decimals(places, &meant), 1), 1e-4).factors;
            for i in 0..found.n_rows() {
                let error: f64 = (0..found.n_rows()).map(|j| found.std_error(i, j)).sum();
                let sum = found.row_sum(i);
                assert!(sum <= 1.0 + error + 1e-9, "{places} {turn:?} {i}: {sum} {error}");
            }
        }
    }
}

#[test]
fn a_thin_gap_that_was_meant_is_one_however_it_is_rounded() {
    // A plate before a part of another one, three units of the last digit off: turned and rounded to six digits.
    let rectangle = |x: f64, y: [f64; 2], z: [f64; 2]| {
        [(y[0], z[0]), (y[1], z[0]), (y[1], z[1]), (y[0], z[1])].map(|(y, z)| DVec3::new(x, y, z))
    };
    let mut uniform = Uniform(3);
    for round in 0..8 {
        let mut shapes = Shapes::default();
        shapes.face(&rectangle(0.0, [0.0, 1.0], [0.0, 1.0]));
        for (x, range) in [(1.0, [[0.0, 1.0], [0.0, 1.0]]), (3e-6, [[-0.2, 0.5], [-0.2, 0.7]])] {
            let mut facing = rectangle(x, range[0], range[1]);
            facing.reverse();
            shapes.face(&facing);
        }
        let turn = DQuat::from_axis_angle(direction(&mut uniform), 0.3 + f64::from(round));
        let scene = moved(&shapes.scene(), turn, 1.0, DVec3::ZERO);
        let found = compute(&Prepared::new(with_decimals(6, &scene), 1), 1e-6).factors;
        let (to_wall, to_plate) = (found.get(0, 1), found.get(0, 2));
        let (hidden, seen) = ((to_wall - 0.128_336).abs() < 1e-5, (to_plate - 0.35).abs() < 1e-5);
        // Either the plate is there, and takes what goes its way, or it touches, and takes nothing.
        let touches = (to_wall - 0.199_825).abs() < 1e-5 && to_plate <= 0.0;
        assert!(hidden && seen || touches, "{round}: {to_wall} {to_plate}");
    }
}

/// A box on the floor of a room, a plate that stands there and one that leans on a wall, all turned; in files of few digits nothing touches any more.
fn room_with_what_stands_in_it(uniform: &mut Uniform) -> Scene {
    let mut shapes = room();
    let about_z = |uniform: &mut Uniform| DQuat::from_rotation_z(6.0 * uniform.next());
    let low = DVec3::new(0.8 + uniform.next(), 0.8 + uniform.next(), 0.0);
    shapes.cuboid(low, low + DVec3::new(0.9, 0.7, 1.1), about_z(uniform), false);
    let (foot, turn) = (DVec3::new(2.0, 3.5, 0.0), about_z(uniform));
    let plate = [
        DVec3::ZERO,
        DVec3::X,
        DVec3::new(1.0, 0.0, 1.4),
        DVec3::new(0.0, 0.0, 1.4),
    ]
    .map(|v| foot + turn * v);
    let leaning =
        [(3.2, 1.0, 0.0), (3.2, 1.9, 0.0), (4.0, 1.9, 1.5), (4.0, 1.0, 1.5)].map(|(x, y, z)| DVec3::new(x, y, z));
    for [a, b, c, d] in [plate, leaning] {
        shapes.face(&[a, b, c, d]);
        shapes.face(&[a, d, c, b]);
    }
    let turn = DQuat::from_axis_angle(direction(uniform), 0.4 + 2.0 * uniform.next());
    moved(&shapes.scene(), turn, 1.0, DVec3::ZERO)
}

/// Where rounding has parted what touches, integrals do not look for what shines through: they stay within a budget that they need anyway, and within what they state.
#[test]
fn rounding_of_what_touches_spends_no_budget() {
    let mut uniform = Uniform(11);
    let method = ExactMethod {
        tolerance: 1e-6,
        budget: 400_000,
    };
    for round in 0..n_cases(2, 6) {
        let quads = room_with_what_stands_in_it(&mut uniform);
        // Quads of five digits are bent too much to stay.
        for (places, unit, scene) in [(6, 1e-6, quads.clone()), (5, 1e-5, in_triangles(&quads))] {
            let prepared = Prepared::new(with_decimals(places, &scene), 1);
            let rounded = prepared.try_compute(&method).unwrap();
            assert_eq!(rounded.pairs.unwrap().n_above_tolerance, 0, "{round} {places}");
            let meant = compute(&Prepared::new(scene, 1), 1e-6).factors;
            let n = meant.n_rows();
            for i in 0..n {
                for j in 0..n {
                    let off = (rounded.factors.get(i, j) - meant.get(i, j)).abs();
                    // Faces are about a metre wide, and their corners are off by up to 0.9 units.
                    let known = rounded.factors.std_error(i, j) + meant.std_error(i, j) + unit;
                    assert!(off <= known, "{round} {places} {i} {j}: {off:e} {known:e}");
                }
            }
        }
    }
}

fn in_triangles(scene: &Scene) -> Scene {
    let mut triangles = scene.clone();
    triangles.faces = scene
        .faces
        .iter()
        .flat_map(|face| {
            let corners = face.corners.as_slice().to_vec();
            (1..corners.len() - 1).map(move |k| Face {
                corners: Corners::Triangle([corners[0], corners[k], corners[k + 1]]),
                ..*face
            })
        })
        .collect();
    triangles
}
