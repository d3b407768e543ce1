//! Form factors after objects have moved: kept entries equal the former ones, and all equal those computed anew.

use glam::{DQuat, DVec3};
use radiosity::form_factor::{Before, Change, Computed, ExactMethod, FormFactorMethod, Input};
use radiosity::matrix::{FormFactors, StorageChoice};
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{Motion, Names, Pose, Scene, builtin, topology};
use radiosity::visibility::embree::EmbreeVisibility;

use crate::support::rooms::{Shapes, moved, quick, with_decimals};
use crate::support::{n_above, worst_error};

/// A scene with its patches.
struct Posed {
    scene: Scene,
    mesh: Mesh,
    visibility: EmbreeVisibility,
}

impl Posed {
    fn new(scene: Scene, mesh: Mesh) -> Self {
        let visibility = EmbreeVisibility::new(&scene).unwrap();
        Self {
            scene,
            mesh,
            visibility,
        }
    }

    fn input(&self) -> Input<'_> {
        Input {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            unoccluded: topology::is_convex_and_empty(&self.scene),
        }
    }

    fn moved(&self, motions: &[Motion]) -> Self {
        let mut pose = Pose::default();
        for motion in motions {
            pose.push(&self.scene, motion).unwrap();
        }
        let scene = self.scene.posed(&pose).unwrap();
        let mesh = self.mesh.posed(&pose, &scene);
        Self::new(scene, mesh)
    }

    fn compute(&self, method: &dyn FormFactorMethod) -> Computed {
        method.compute(self.input(), StorageChoice::default(), &Silent).unwrap()
    }

    fn update(&self, method: &dyn FormFactorMethod, before: &Self, known: &Computed) -> Computed {
        let change = Change::between(&before.scene, &self.scene);
        let known_before = Before {
            factors: &known.factors,
            tolerance_met: known.tolerance_met,
            change: &change,
        };
        method
            .update(self.input(), known_before, StorageChoice::default(), &Silent)
            .unwrap()
    }
}

fn motion(surfaces: &[String]) -> Motion {
    Motion {
        surface: Names::Many(surfaces.to_vec()),
        rotate: None,
        axis: None,
        about: None,
        translate: None,
    }
}

/// A room of 4 m × 3 m × 2.5 m with a box, and a sheet that stays; returns the names of the box's sides too.
fn room() -> (Scene, Vec<String>) {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), DQuat::IDENTITY, true);
    let (low, high) = (DVec3::new(0.4, 0.5, 0.3), DVec3::new(1.0, 1.2, 0.8));
    shapes.cuboid(low, high, DQuat::from_rotation_z(0.3), false);
    let sheet = [
        DVec3::new(2.5, 1.0, 0.5),
        DVec3::new(3.1, 1.2, 0.6),
        DVec3::new(3.0, 1.3, 1.5),
        DVec3::new(2.4, 1.1, 1.4),
    ];
    shapes.face(&[sheet[0], sheet[1], sheet[2]]);
    shapes.face(&[sheet[2], sheet[1], sheet[0]]);
    (shapes.scene(), (6..12).map(|k| format!("face{k}")).collect())
}

/// Poses of the box: a short way, a long way, turned, out of the room, into a wall, and touching the floor.
fn poses(sides: &[String]) -> Vec<Vec<Motion>> {
    let shifted = |by: [f64; 3]| Motion {
        translate: Some(by),
        ..motion(sides)
    };
    let turned = Motion {
        rotate: Some(35.0),
        axis: Some([1.0, 2.0, 0.5]),
        ..motion(sides)
    };
    vec![
        vec![shifted([0.05, 0.0, 0.0])],
        vec![shifted([2.2, 1.1, 1.0])],
        vec![turned.clone()],
        vec![turned, shifted([0.5, 0.5, 0.2])],
        vec![shifted([10.0, 0.0, 0.0])],
        vec![shifted([-0.7, 0.0, 0.0])],
        vec![shifted([0.0, 0.0, -0.3])],
    ]
}

/// The greatest difference in units of what the two estimates of the error allow, and how many numbers are the same to the last bit.
fn compared(a: &FormFactors, b: &FormFactors) -> (f64, usize) {
    let n = a.n_rows();
    let (mut worst, mut n_same) = (0.0_f64, 0);
    for i in 0..n {
        for j in 0..n {
            let off = (a.get(i, j) - b.get(i, j)).abs();
            // 1e-9: the neglected borders of occluders, which depend on the level that a pair is classified on.
            let known = 1.000_001 * (a.std_error(i, j) + b.std_error(i, j)) + 1e-9;
            worst = worst.max(off / known);
            n_same += usize::from(a.get(i, j).to_bits() == b.get(i, j).to_bits());
        }
    }
    (worst, n_same)
}

#[test]
fn a_moved_box_gives_what_a_full_computation_gives() {
    let (scene, sides) = room();
    let exact = ExactMethod {
        tolerance: 1e-5,
        ..ExactMethod::default()
    };
    let mesh = Mesh::new(&scene, Subdivision::Uniform(4)).unwrap();
    let before = Posed::new(scene, mesh);
    let known = before.compute(&exact);
    let mut shares = Vec::new();
    for motions in poses(&sides) {
        let after = before.moved(&motions);
        assert_eq!(after.mesh.areas(), before.mesh.areas());
        let full = after.compute(&exact);
        let updated = after.update(&exact, &before, &known);
        let (worst, n_same) = compared(&updated.factors, &full.factors);
        assert!(worst <= 1.0, "{motions:?}: {worst}");
        // The same code computes the same pair; a few are classified on another level.
        let n = full.factors.n_rows();
        assert!(n_same * 1000 >= n * n * 999, "{n_same} of {}", n * n);
        let [new, all] = [updated.pairs.unwrap(), full.pairs.unwrap()];
        let n_recomputed = new.full + new.partial + new.hidden;
        assert_eq!(n_recomputed + new.kept, all.full + all.partial + all.hidden);
        assert_eq!((new.not_facing, all.kept), (all.not_facing, 0));
        shares.push(n_recomputed as f64 / (n_recomputed + new.kept) as f64);
        // The way back leads to where it began.
        let back = before.update(&exact, &after, &updated);
        assert!(compared(&back.factors, &known.factors).0 <= 1.0);
    }
    // 0.56 after a short way of the box, 0.74 after the longest: the room's patches are as large as the box.
    assert!(shares[0] < 0.6 && shares[1] < 0.8, "{shares:?}");
    assert!(
        shares.iter().all(|share| *share > 0.3),
        "the box's own pairs at least: {shares:?}"
    );
}

#[test]
fn kept_numbers_are_those_of_before_and_everything_else_is_looked_at() {
    // Numbers that no computation gives show which ones were taken over.
    let (scene, sides) = room();
    let exact = ExactMethod::default();
    let mesh = Mesh::new(&scene, Subdivision::Uniform(2)).unwrap();
    let before = Posed::new(scene, mesh);
    let known = before.compute(&exact);
    let after = before.moved(&poses(&sides)[0]);
    let full = after.compute(&exact);
    let mut marked = known.clone();
    let half: Vec<f64> = known.factors.areas().to_vec();
    let tiles = (0..half.len()).map(|i| {
        let mut tile = radiosity::matrix::RowTile::new(i);
        let mut row = Vec::new();
        known.factors.for_each_in_row(i, |j, value, _| {
            if j > i {
                row.push((u32::try_from(j).unwrap(), 0.5 * value * half[i], 0.0));
            }
        });
        tile.push_row(&row, radiosity::matrix::RowTally::default());
        tile
    });
    marked.factors = FormFactors::from_exchange_tiles(half.clone(), tiles, StorageChoice::default()).unwrap();
    let updated = after.update(&exact, &before, &marked);
    let is_moved = |i: usize| {
        let surface = after.mesh.patches[i].surface;
        sides.contains(&after.scene.surfaces[surface.0 as usize].name)
    };
    let mut n_kept = 0;
    for i in 0..half.len() {
        for j in 0..half.len() {
            let (new, all) = (updated.factors.get(i, j), full.factors.get(i, j));
            if all <= 0.0 {
                continue;
            }
            let is_kept = (new - 0.5 * all).abs() < 1e-12;
            assert!(
                is_kept || (new - all).abs() <= full.factors.std_error(i, j) + 1e-9,
                "{i} {j}: {new} {all}"
            );
            assert!(!(is_kept && (is_moved(i) || is_moved(j))), "{i} {j}");
            n_kept += u64::from(is_kept && i < j);
        }
    }
    assert!(n_kept > 20 && n_kept <= updated.pairs.unwrap().kept, "{n_kept}");
}

/// Pairs that are taken over are above the tolerance still, and told by what makes them so.
#[test]
fn kept_pairs_above_the_tolerance_are_counted() {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), DQuat::IDENTITY, true);
    // The first stands on the floor, and stays.
    for (low, high) in [
        (DVec3::new(2.5, 1.5, 0.0), DVec3::new(3.3, 2.2, 1.0)),
        (DVec3::new(0.4, 0.5, 0.3), DVec3::new(1.0, 1.2, 0.8)),
    ] {
        shapes.cuboid(low, high, DQuat::from_rotation_z(0.2), false);
    }
    let turned = moved(&shapes.scene(), DQuat::from_rotation_z(0.4), 1.0, DVec3::ZERO);
    let sides: Vec<String> = (12..18).map(|k| format!("face{k}")).collect();
    for (scene, tolerance, budget, is_rounded) in [
        (with_decimals(6, &turned), 1e-6, ExactMethod::DEFAULT_BUDGET, true),
        (turned, 1e-9, 200, false),
    ] {
        let exact = ExactMethod { tolerance, budget };
        let mesh = Mesh::new(&scene, Subdivision::Uniform(2)).unwrap();
        let before = Posed::new(scene, mesh);
        let known = before.compute(&exact);
        assert!(!known.tolerance_met);
        let after = before.moved(&poses(&sides)[0]);
        let updated = after.update(&exact, &before, &known);
        let n = n_above(&updated.factors, tolerance);
        let pairs = updated.pairs.unwrap();
        let expected = if is_rounded { (n, 0) } else { (0, n) };
        assert_eq!((pairs.n_above_by_rounding, pairs.n_above_tolerance), expected);
        assert!(!updated.tolerance_met && pairs.kept > 0);
        assert_eq!(pairs.rounding_error_max > 0.0, is_rounded);
        assert!(pairs.rounding_error_max <= worst_error(&updated.factors) * (1.0 + 1e-6));
        // Some are kept ones: without them there would be fewer.
        let areas = updated.factors.areas();
        let is_above = |i: usize, j: usize| {
            let error = updated.factors.std_error(i, j);
            let is_same = error.to_bits() == known.factors.std_error(i, j).to_bits();
            is_same && error * areas[i] > tolerance * areas[i].min(areas[j])
        };
        assert!((0..areas.len()).any(|i| (i + 1..areas.len()).any(|j| is_above(i, j))));
    }
}

#[test]
fn what_could_not_be_blocked_before_can_be_after_and_the_reverse() {
    // A cube whose ceiling is lowered into the middle of the walls, and back.
    let scene = builtin::build("cube", None).unwrap().scene;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(3)).unwrap();
    let before = Posed::new(scene, mesh);
    let exact = ExactMethod::default();
    let known = before.compute(&exact);
    let lowered = Motion {
        translate: Some([0.0, 0.0, -0.4]),
        ..motion(&["z1".to_owned()])
    };
    let after = before.moved(&[lowered]);
    assert!(topology::is_convex_and_empty(&before.scene) && !topology::is_convex_and_empty(&after.scene));
    let full = after.compute(&exact);
    let updated = after.update(&exact, &before, &known);
    assert!(compared(&updated.factors, &full.factors).0 <= 1.0);
    assert!(updated.pairs.unwrap().kept > 0 && full.pairs.unwrap().hidden > 0);
    let back = before.update(&exact, &after, &updated);
    assert!(compared(&back.factors, &known.factors).0 <= 1.0);
}

#[test]
fn other_methods_compute_everything_anew() {
    let (scene, sides) = room();
    let mesh = Mesh::new(&scene, Subdivision::Uniform(1)).unwrap();
    let before = Posed::new(scene, mesh);
    let after = before.moved(&poses(&sides)[1]);
    for name in ["sr", "qmc", "hemicube"] {
        let method = quick(name, 7);
        let known = before.compute(&*method);
        let updated = after.update(&*method, &before, &known);
        let full = after.compute(&*method);
        let n = full.factors.n_rows();
        assert_eq!(compared(&updated.factors, &full.factors).1, n * n, "{name}");
        assert_eq!(updated.pairs, full.pairs);
    }
}
