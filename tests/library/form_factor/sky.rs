//! Sky factors and back factors of open scenes, against rays that are tested against each face in f64.

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use radiosity::form_factor::{Closure, Enclosed, FormFactorMethod, Fraction, Input, SkyFactors, enclosed, sky_factors};
use radiosity::matrix::{FormFactors, StorageChoice};
use radiosity::progress::Silent;
use radiosity::scene::topology::is_watertight;
use radiosity::scene::{Scene, builtin};
use radiosity::visibility::brute_force::BruteForce;

use crate::support::rooms::{Prepared, Shapes, moved, quick};

/// Rays of the oracle from each patch.
const RAYS: u64 = 3000;

fn open(n: usize) -> Enclosed {
    Enclosed {
        closed: false,
        certain: false,
        rows: vec![false; n],
        may_escape: vec![0.0; n],
    }
}

/// Returns the sky factors of form factors, with what the scene tells about openings.
pub(super) fn sky(prepared: &Prepared, factors: &FormFactors, method: &dyn FormFactorMethod) -> SkyFactors {
    let input = prepared.input();
    let found = enclosed(
        input,
        is_watertight(&prepared.scene),
        factors.tallies(),
        Closure::Detect,
    )
    .unwrap();
    sky_factors(input, factors, method.reciprocity(), &found)
}

/// Counts what becomes of rays that are tested against each face.
fn counted(prepared: &Prepared) -> SkyFactors {
    let oracle = BruteForce::new(&prepared.scene);
    let input = Input {
        visibility: &oracle,
        ..prepared.input()
    };
    let settings = radiosity::form_factor::MethodSettings::default()
        .with(&radiosity::form_factor::RAYS, RAYS)
        .seeded(3);
    let method = radiosity::form_factor::method("sr", &settings).unwrap();
    let factors = method
        .compute(input, StorageChoice::default(), &Silent)
        .unwrap()
        .factors;
    let found = open(prepared.mesh.n_patches());
    sky_factors(input, &factors, method.reciprocity(), &found)
}

/// Asserts that sky and back factors are those of rays, within so many errors of the method as cover them, and the noise of both.
#[track_caller]
fn assert_counted(
    name: &str,
    prepared: &Prepared,
    (method, n_errors): (&dyn FormFactorMethod, f64),
    by_rays: &SkyFactors,
) -> SkyFactors {
    let factors = prepared.compute(method);
    let found = sky(prepared, &factors, method);
    let pairs = |of: &SkyFactors| -> Vec<[Fraction; 2]> {
        of.sky
            .iter()
            .copied()
            .zip(of.back.iter().copied())
            .map(<[_; 2]>::from)
            .collect()
    };
    for (i, (both, rays)) in pairs(&found).into_iter().zip(pairs(by_rays)).enumerate() {
        for (what, own, oracle) in [("sky", both[0], rays[0]), ("back", both[1], rays[1])] {
            let off = (own.value - oracle.value).abs();
            // Few rays that happen to meet a back say little of how far their number is off: the share itself says more.
            let expected = own.value.clamp(0.0, 1.0);
            let of_rays = oracle.variance.max(expected * (1.0 - expected) / RAYS as f64);
            assert!(
                off <= n_errors * own.common + 5.0 * (own.variance + of_rays).sqrt(),
                "{name} {} {i}: {what} {own:?}, by rays {oracle:?}",
                method.name()
            );
        }
        // A rule's points may send more than all light, and an error is no more than all of it.
        let all = factors.row_sum(i).min(1.0) + both[0].value + both[1].value;
        assert!(
            (all - 1.0).abs() <= both[0].error() + both[1].error() + 1e-9,
            "{name} {i}: {all}"
        );
    }
    found
}

/// A closed block on a ground of four parts around it, as a house stands in a plan.
fn house() -> Shapes {
    let mut shapes = Shapes::default();
    let quad = |low: [f64; 2], high: [f64; 2]| {
        [
            [low[0], low[1]],
            [high[0], low[1]],
            [high[0], high[1]],
            [low[0], high[1]],
        ]
        .map(|[x, y]| DVec3::new(x, y, 0.0))
    };
    shapes.face(&quad([-50.0, -50.0], [-5.0, 50.0]));
    shapes.face(&quad([5.0, -50.0], [50.0, 50.0]));
    shapes.face(&quad([-5.0, -50.0], [5.0, -5.0]));
    shapes.face(&quad([-5.0, 5.0], [5.0, 50.0]));
    shapes.cuboid(
        DVec3::new(-5.0, -5.0, 0.0),
        DVec3::new(5.0, 5.0, 8.0),
        DQuat::IDENTITY,
        false,
    );
    shapes
}

#[test]
fn around_a_house_the_sky_is_all_that_faces_leave() {
    let turn = DQuat::from_axis_angle(DVec3::new(2.0, 1.0, 2.0) / 3.0, 0.9);
    let plain = house().scene();
    for scene in [
        plain.clone(),
        moved(&plain, turn, 1.0, DVec3::new(3.0, -2.0, 9.0)),
        moved(&plain, turn, 1e-3, DVec3::ZERO),
    ] {
        let prepared = Prepared::new(scene, 1);
        let method = quick("exact", 0);
        let found = sky(&prepared, &prepared.compute(&*method), &*method);
        for (k, expected) in [0.988_784, 0.988_784, 0.951_741, 0.951_741].into_iter().enumerate() {
            let sky = found.sky[k];
            assert!(
                (sky.value - expected).abs() < 1e-6 + sky.error() && sky.error() < 1e-5,
                "{k}: {sky:?}"
            );
        }
        assert!(
            found.back.iter().all(|back| *back == Fraction::default()),
            "{:?}",
            found.back
        );
    }
}

/// Ground and two walls of different height, with ground behind them, or closed blocks for walls.
fn canyon(heights: [f64; 2], are_blocks: bool) -> Shapes {
    let mut shapes = Shapes::default();
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    for [from, to] in [[-4.0, 0.0], [0.0, 3.0], [3.0, 7.0]] {
        shapes.face(&[
            at(from, 0.0, 0.0),
            at(to, 0.0, 0.0),
            at(to, 8.0, 0.0),
            at(from, 8.0, 0.0),
        ]);
    }
    for (x, height, inner) in [(0.0, heights[0], true), (3.0, heights[1], false)] {
        if are_blocks {
            let (low, high) = if inner { (x - 1.5, x) } else { (x, x + 1.5) };
            shapes.cuboid(at(low, 1.0, 0.0), at(high, 7.0, height), DQuat::IDENTITY, false);
        } else {
            let mut wall = [at(x, 0.0, 0.0), at(x, 8.0, 0.0), at(x, 8.0, height), at(x, 0.0, height)];
            if !inner {
                wall.reverse();
            }
            shapes.face(&wall);
        }
    }
    shapes
}

/// A ground of n × n squares of two triangles each, with heights.
fn field(heights: &[f64], n: usize) -> Shapes {
    let mut shapes = Shapes::default();
    let at = |i: usize, j: usize| DVec3::new(i as f64, j as f64, heights[i * (n + 1) + j]);
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        shapes.face(&[at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        shapes.face(&[at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    shapes
}

/// Rows of panels of one side over a ground, tilted by an angle.
fn panels(n: usize, tilt: f64, step: f64) -> Shapes {
    let mut shapes = Shapes::default();
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let length = n as f64 * step + 2.0;
    shapes.face(&[
        at(-2.0, -2.0, 0.0),
        at(length, -2.0, 0.0),
        at(length, 5.0, 0.0),
        at(-2.0, 5.0, 0.0),
    ]);
    for k in 0..n {
        let x = k as f64 * step;
        let (run, rise) = (1.2 * tilt.cos(), 1.2 * tilt.sin());
        shapes.face(&[
            at(x, 0.0, 0.4),
            at(x, 3.0, 0.4),
            at(x + run, 3.0, 0.4 + rise),
            at(x + run, 0.0, 0.4 + rise),
        ]);
    }
    shapes
}

/// The lower half of a ball in a ground, seen from above.
fn bowl(n: usize, depth: f64) -> Shapes {
    let mut shapes = Shapes::default();
    let ring = |level: f64, k: usize| {
        let angle = std::f64::consts::TAU * (k % n) as f64 / n as f64;
        let out = 0.5 * std::f64::consts::PI * level;
        DVec3::new(out.sin() * angle.cos(), out.sin() * angle.sin(), -depth * out.cos())
    };
    for k in 0..n {
        shapes.face(&[DVec3::new(0.0, 0.0, -depth), ring(0.5, k), ring(0.5, k + 1)]);
        // Two triangles, as the quad is not flat.
        shapes.face(&[ring(0.5, k), ring(1.0, k), ring(1.0, k + 1)]);
        shapes.face(&[ring(0.5, k), ring(1.0, k + 1), ring(0.5, k + 1)]);
        let far = |next: usize| ring(1.0, next) * 2.5;
        shapes.face(&[ring(1.0, k), far(k), far(k + 1), ring(1.0, k + 1)]);
    }
    shapes
}

fn turn() -> impl Strategy<Value = DQuat> {
    (prop::array::uniform3(-1.0..1.0), 0.0..3.0).prop_map(|(axis, angle)| {
        let axis = DVec3::from(axis) + DVec3::new(0.0, 0.0, 1.5);
        DQuat::from_axis_angle(axis.normalize(), angle)
    })
}

fn scene() -> impl Strategy<Value = (&'static str, Scene)> {
    let canyons = (prop::array::uniform2(0.5..4.0), any::<bool>())
        .prop_map(|(heights, blocks)| ("canyon", canyon(heights, blocks)));
    let fields = prop::collection::vec(0.0..1.5, 25).prop_map(|heights| ("field", field(&heights, 4)));
    let rows = (2..4_usize, 0.2..1.2, 0.9..2.0).prop_map(|(n, tilt, step)| ("panels", panels(n, tilt, step)));
    let bowls = (4..8_usize, 0.3..1.2).prop_map(|(n, depth)| ("bowl", bowl(n, depth)));
    (prop_oneof![canyons, fields, rows, bowls], turn())
        .prop_map(|((name, shapes), turn)| (name, moved(&shapes.scene(), turn, 1.0, DVec3::new(1.0, -2.0, 0.5))))
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..ProptestConfig::with_cases(24)
    })]

    #[test]
    fn what_escapes_and_what_backs_take_is_what_rays_say((name, scene) in scene()) {
        let prepared = Prepared::new(scene, 1);
        let by_rays = counted(&prepared);
        for method in ["exact", "gauss-lambert", "qmc"] {
            assert_counted(name, &prepared, (&*quick(method, 1), 1.0), &by_rays);
        }
    }
}

#[test]
fn backs_are_seen_where_there_are_any_and_only_there() {
    let total = |shapes: Shapes, parts: u32| {
        let prepared = Prepared::new(shapes.scene(), parts);
        let found = assert_counted("backs", &prepared, (&*quick("exact", 1), 1.0), &counted(&prepared));
        found.back.iter().map(|back| back.value).sum::<f64>()
    };
    assert!(total(panels(3, 0.6, 1.4), 2) > 0.1);
    assert!(total(canyon([2.0, 3.0], false), 2) > 0.1);
    let nothing = [
        field(&[0.0, 0.9, 0.3, 0.2, 1.0, 0.1, 0.8, 0.0, 0.4], 2),
        bowl(6, 0.8),
        canyon([2.0, 3.0], true),
    ];
    // The blocks of the canyon stand on the ground, which runs on under them.
    for (shapes, is_none) in nothing.into_iter().zip([true, true, false]) {
        assert_eq!(total(shapes, 1) <= 0.0, is_none);
    }
    let mut sheet = Shapes::default();
    let corners = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]].map(DVec3::from);
    sheet.face(&corners);
    sheet.face(&[corners[3], corners[2], corners[1], corners[0]]);
    sheet.face(&corners.map(|v| 3.0 * v - DVec3::new(1.0, 1.0, 3.0)));
    assert!(total(sheet.clone(), 1) <= 0.0, "a sheet has no backs");
    // Its lower side covers half of the upper one from behind.
    let mut half = Shapes::default();
    half.face(&corners);
    half.face(&[
        corners[3],
        corners[2].lerp(corners[3], 0.5),
        corners[1].lerp(corners[0], 0.5),
        corners[0],
    ]);
    half.face(&corners.map(|v| 3.0 * v - DVec3::new(1.0, 1.0, 3.0)));
    assert!(total(half, 2) > 0.01);
}

/// Methods that shoot from all of a patch count both; the others find the same, also those that shoot from points.
#[test]
fn every_method_knows_the_sky() {
    for (step, parts) in [(1.5, 2), (1.1, 1)] {
        let prepared = Prepared::new(panels(3, 0.7, step).scene(), parts);
        let by_rays = counted(&prepared);
        for name in crate::support::rooms::names() {
            let method = quick(name, 2);
            if prepared.try_compute(&*method).is_ok() {
                // Errors of points that stand for patches are estimates: one covers most entries, two nearly all.
                assert_counted(&format!("panels by {name}"), &prepared, (&*method, 2.0), &by_rays);
            }
        }
    }
}

/// A sheet that is folded so that it pierces itself shows its own back to its front, although it ends at the outside of the scene alone.
#[test]
fn a_sheet_that_pierces_itself_does_not_hide_its_back() {
    let outline = [
        [-3.0, 0.0],
        [-1.5, 0.15],
        [1.0, 0.4],
        [1.5, 2.0],
        [-1.5, 2.0],
        [-1.0, 0.4],
        [3.0, 0.0],
    ];
    let mut shapes = Shapes::default();
    for k in 1..outline.len() {
        let [[a, b], [c, d]] = [outline[k - 1], outline[k]];
        shapes.face(&[[a, 0.0, b], [c, 0.0, d], [c, 4.0, d], [a, 4.0, b]].map(DVec3::from));
    }
    let prepared = Prepared::new(shapes.scene(), 1);
    let found = assert_counted("loop", &prepared, (&*quick("exact", 1), 1.0), &counted(&prepared));
    assert!(found.back[0].value > 0.1, "{:?}", found.back);
}

#[test]
fn a_room_has_no_sky_and_its_blocks_without_a_bottom_have_backs() {
    let prepared = Prepared::new(builtin::build("room-box", None).unwrap().scene, 2);
    let method = quick("exact", 0);
    let found = sky(&prepared, &prepared.compute(&*method), &*method);
    assert!(found.sky.iter().all(|sky| *sky == Fraction::default()));
    let cornell = Prepared::new(builtin::build("cornell-box", None).unwrap().scene, 2);
    assert_counted("cornell-box", &cornell, (&*quick("exact", 0), 1.0), &counted(&cornell));
}
