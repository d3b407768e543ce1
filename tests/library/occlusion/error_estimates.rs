//! The error that a result states for itself.

use glam::DVec3;
use radiosity::form_factor::partial::{Accuracy, exchange_area};
use radiosity::visibility::occluders::{OccluderIndex, PairVisibility};

use super::scenes::Random;
use super::shapes::{BUDGET, area, cuboid, cut, exchange, random_case, random_rotation, scene_of, turned, two_sided};
use crate::support::n_cases;

#[test]
fn estimates_hold_against_much_tighter_runs() {
    expect_estimates_to_hold(17, n_cases(15, 50));
}

#[test]
#[ignore = "two minutes: as the test above, of many more cases"]
fn estimates_hold_in_many_cases() {
    expect_estimates_to_hold(19, 400);
}

fn expect_estimates_to_hold(seed: u64, n_cases: usize) {
    const TOLERANCES: [f64; 3] = [1e-3, 1e-5, 1e-6];
    let mut random = Random::new(seed);
    let (mut n, mut failures) = (0, Vec::new());
    for case in 0..n_cases {
        let (p, q, occluders) = random_case(&mut random);
        let exact = exchange(&p, &q, &occluders, 3e-8);
        let smaller = area(&p).min(area(&q));
        for tolerance in TOLERANCES {
            let result = exchange(&p, &q, &occluders, tolerance);
            let error = (result.exchange_area - exact.exchange_area).abs();
            let excess = error / (result.error + exact.error);
            assert!(result.error <= tolerance * smaller);
            n += 1;
            if excess > 1.0 {
                failures.push((case, tolerance, excess));
            }
        }
    }
    // An estimate is no bound; but it must hold nearly always, and never be far off.
    assert!(failures.len() * 100 <= n, "{failures:?} of {n}");
    assert!(failures.iter().all(|&(_, _, excess)| excess < 10.0), "{failures:?}");
}

/// A turned box in a room: the parts of its walls that see each other partly, at tolerances above all that they exchange.
#[test]
fn where_the_tolerance_is_above_everything_the_error_is_still_told_and_small() {
    let mut random = Random::new(31);
    let (mut n, mut worst, mut sum) = (0, 0.0_f64, 0.0);
    for _ in 0..6 {
        let room = cuboid(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0), false);
        let half = 0.2 + 0.5 * random.point();
        let middle = DVec3::new(2.0, 2.5, 1.5) + 0.3 * random.direction();
        let occluder = turned(
            cuboid(middle - half, middle + half, true),
            random_rotation(&mut random, 3.0),
            middle,
        );
        let faces: Vec<_> = room.iter().chain(&occluder).cloned().collect();
        let index = OccluderIndex::new(&scene_of(&faces));
        let parts: Vec<_> = room.iter().map(|wall| cut(wall, 7, 9)).collect();
        for k in 0..6 * 5 * 63 {
            let (wall, other) = (k % 6, (k + 1 + k / 6 % 5) % 6);
            let (p, q) = (&parts[wall][k / 30], &parts[other][(k * 17 + k / 30) % 63]);
            let PairVisibility::Partial(ids) = index.classify(p, q) else {
                continue;
            };
            let occluders = index.occluders(p, q, &ids);
            assert!(occluders.iter().all(|side| side.one_sided));
            let whole = exchange(p, q, &[], 1e-10).exchange_area;
            let at = |tolerance: f64| {
                exchange_area(
                    p,
                    q,
                    &occluders,
                    Accuracy {
                        tolerance,
                        budget: BUDGET,
                    },
                )
            };
            let tight = at(1e-3 * whole / area(p).min(area(q)));
            for factor in [1.05, 3.0, 30.0] {
                let loose = at(factor * whole / area(p).min(area(q)));
                let off = (loose.exchange_area - tight.exchange_area).abs();
                assert!(
                    loose.reached && off <= loose.error + tight.error,
                    "{off:e} {loose:?} {tight:?}"
                );
                assert!(loose.error <= factor * whole);
                worst = worst.max((off - tight.error) / whole);
                sum += off / whole;
                n += 1;
            }
        }
    }
    // The view is analytic in each of the cells, and three or four points see most of what it holds.
    assert!(
        n > 1000 && worst < 0.02 && sum < 1e-3 * f64::from(n),
        "{n} {worst:e} {sum:e}"
    );
}

#[test]
fn a_spent_budget_is_said_and_its_error_still_holds() {
    let mut random = Random::new(18);
    let mut n_spent = 0;
    for _ in 0..40 {
        let (p, q, occluders) = random_case(&mut random);
        let exact = exchange(&p, &q, &occluders, 1e-7);
        let accuracy = Accuracy {
            tolerance: 1e-12,
            budget: 4_000,
        };
        let result = exchange_area(&p, &q, &two_sided(&occluders), accuracy);
        let error = (result.exchange_area - exact.exchange_area).abs();
        assert!(error <= result.error + exact.error, "{result:?} {error:e}");
        n_spent += usize::from(!result.reached);
        assert_eq!(result.reached, result.error <= 1e-12 * area(&p).min(area(&q)));
    }
    assert!(n_spent > 20, "{n_spent}");
}
