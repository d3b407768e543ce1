//! Objects that pierce, touch and overlap each other and the patches: the stated errors must hold there too.

use glam::{DQuat, DVec3};
use radiosity::form_factor::partial::{Accuracy, Partial, exchange_area};
use radiosity::geometry::polygon;
use radiosity::visibility::occluders::{OccluderIndex, PairVisibility};

use super::scenes::Random;
use super::shapes::{BUDGET, Polygon, area, cuboid, cut, random_rotation, rectangle, scene_of, turned};

/// Two to four boxes, plates and triangles around one place in a room of 4 m × 5 m × 3 m, so that most of them pierce each other and some a wall.
///
/// A quarter of them are not turned, so that planes are parallel or the same.
fn heap(random: &mut Random) -> Vec<Polygon> {
    let mut faces = cuboid(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0), false);
    let place = 1.0 + DVec3::new(2.0, 3.0, 1.0) * random.point();
    let more = [1.0 / 3.0, 2.0 / 3.0]
        .iter()
        .filter(|&&share| random.unit() > share)
        .count();
    for _ in 0..2 + more {
        let middle = place + 0.5 * random.unit() * random.direction();
        let turn = if random.unit() < 0.25 {
            DQuat::IDENTITY
        } else {
            random_rotation(random, 3.0)
        };
        let kind = random.unit();
        if kind < 0.4 {
            let half = 0.1 + 0.4 * random.point();
            faces.extend(turned(cuboid(middle - half, middle + half, true), turn, middle));
            continue;
        }
        let (a, b) = (
            turn * DVec3::X * random.between(0.3, 1.3),
            turn * DVec3::Y * random.between(0.3, 1.3),
        );
        let mut sheet = rectangle(middle - 0.5 * (a + b), a, b);
        if kind > 0.7 {
            sheet.pop();
        }
        faces.push(sheet.clone());
        sheet.reverse();
        faces.push(sheet);
    }
    faces
}

fn pair(index: &OccluderIndex, p: &[DVec3], q: &[DVec3], tolerance: f64) -> Partial {
    let occluders = match index.classify(p, q) {
        PairVisibility::None => {
            return exchange_area(
                &[],
                q,
                &[],
                Accuracy {
                    tolerance,
                    budget: BUDGET,
                },
            );
        }
        PairVisibility::Full => Vec::new(),
        PairVisibility::Partial(ids) => index.occluders(p, q, &ids),
    };
    let accuracy = Accuracy {
        tolerance,
        budget: BUDGET,
    };
    let result = exchange_area(p, q, &occluders, accuracy);
    assert!(result.reached, "{result:?}");
    result
}

/// Calls `check` with an index and the partly visible pairs of a heap's faces, every `step`-th of them.
fn each_partial_pair(
    seeds: std::ops::Range<u64>,
    step: usize,
    mut check: impl FnMut(u64, &OccluderIndex, &[DVec3], &[DVec3]),
) {
    for seed in seeds {
        let faces = heap(&mut Random::new(seed));
        let index = OccluderIndex::new(&scene_of(&faces));
        let mut n = 0;
        for (i, p) in faces.iter().enumerate() {
            for q in &faces[i + 1..] {
                if matches!(index.classify(p, q), PairVisibility::Partial(_)) {
                    n += 1;
                    if n % step == 0 {
                        check(seed, &index, p, q);
                    }
                }
            }
        }
    }
}

/// What rounding may leave, in units of the smaller area.
const ROUNDING: f64 = 1e-13;

#[test]
fn a_hundredth_of_the_tolerance_agrees() {
    // Most pairs coarsely, and some finely, which takes longer.
    for (tolerance, seeds, step, least) in [(1e-3, 100..112, 3, 150), (1e-5, 120..124, 40, 3)] {
        let mut n = 0;
        each_partial_pair(seeds, step, |seed, index, p, q| {
            let [loose, tight] = [tolerance, 0.01 * tolerance].map(|t| pair(index, p, q, t));
            let smaller = area(p).min(area(q));
            let off = (loose.exchange_area - tight.exchange_area).abs();
            let known = loose.error + tight.error + ROUNDING * smaller;
            assert!(off <= known, "{seed}: {off:e} {loose:?} {tight:?}");
            assert!(off <= tolerance * smaller, "{seed}: {off:e} {loose:?} {tight:?}");
            n += 1;
        });
        assert!(n >= least, "{n}");
    }
}

#[test]
fn parts_of_both_patches_add_up() {
    let (mut n, tolerance) = (0, 1e-5);
    each_partial_pair(200..210, 12, |seed, index, p, q| {
        let parts = |polygon: &[DVec3]| match polygon.len() {
            4 => cut(polygon, 2, 2),
            n_corners => {
                let middle = polygon::centroid(polygon);
                let part = |k: usize| vec![middle, polygon[k], polygon[(k + 1) % n_corners]];
                (0..n_corners).map(part).collect()
            }
        };
        let whole = pair(index, p, q, tolerance);
        let (mut sum, mut error) = (0.0, 0.0);
        let of_q = parts(q);
        for a in parts(p) {
            for b in &of_q {
                let part = pair(index, &a, b, tolerance);
                sum += part.exchange_area;
                error += part.error;
            }
        }
        let off = (sum - whole.exchange_area).abs();
        let smaller = area(p).min(area(q));
        assert!(
            off <= whole.error + error + ROUNDING * smaller,
            "{seed}: {off:e} {error:e} {whole:?}"
        );
        n += 1;
    });
    assert!(n >= 30, "{n}");
}

#[test]
fn corners_on_the_horizon_pass_each_other() {
    // A floor, a wall that it sees from the foot up, and a tent that stands on the floor between them: from the floor its foot passes the wall's.
    let p = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let q = rectangle(DVec3::new(0.2, 3.0, 0.0), DVec3::Z, DVec3::X * 0.6);
    let tent = vec![
        DVec3::new(0.3, 1.8, 0.0),
        DVec3::new(0.71, 2.1, 0.0),
        DVec3::new(0.5, 2.0, 1.2),
    ];
    let faces = [p.clone(), q.clone(), tent.clone(), tent.into_iter().rev().collect()];
    let index = OccluderIndex::new(&scene_of(&faces));
    let tight = pair(&index, &p, &q, 1e-10);
    for tolerance in [1e-4, 1e-6, 1e-8] {
        let loose = pair(&index, &p, &q, tolerance);
        let off = (loose.exchange_area - tight.exchange_area).abs();
        assert!(off <= loose.error + tight.error, "{tolerance:e}: {off:e} {loose:?}");
    }
    let of_parts: f64 = cut(&p, 3, 3)
        .iter()
        .map(|part| pair(&index, part, &q, 1e-10).exchange_area)
        .sum();
    assert!(
        (of_parts - tight.exchange_area).abs() < 1e-9 * area(&q),
        "{of_parts} {tight:?}"
    );
}
