//! The error that a result states for itself.

use crate::scenes::Random;
use crate::shapes::{area, exchange, random_case, two_sided};
use radiosity::form_factor::partial::{Accuracy, exchange_area};

#[test]
fn estimates_hold_against_much_tighter_runs() {
    expect_estimates_to_hold(17, 50);
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
        let (p, q, blockers) = random_case(&mut random);
        let exact = exchange(&p, &q, &blockers, 3e-8);
        let smaller = area(&p).min(area(&q));
        for tolerance in TOLERANCES {
            let result = exchange(&p, &q, &blockers, tolerance);
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

#[test]
fn a_spent_budget_is_said_and_its_error_still_holds() {
    let mut random = Random::new(18);
    let mut n_spent = 0;
    for _ in 0..40 {
        let (p, q, blockers) = random_case(&mut random);
        let exact = exchange(&p, &q, &blockers, 1e-7);
        let accuracy = Accuracy {
            tolerance: 1e-12,
            budget: 4_000,
        };
        let result = exchange_area(&p, &q, &two_sided(&blockers), accuracy);
        let error = (result.exchange_area - exact.exchange_area).abs();
        assert!(error <= result.error + exact.error, "{result:?} {error:e}");
        n_spent += usize::from(!result.reached);
        assert_eq!(result.reached, result.error <= 1e-12 * area(&p).min(area(&q)));
    }
    assert!(n_spent > 20, "{n_spent}");
}
