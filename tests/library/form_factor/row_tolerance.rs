//! A tolerance of rows: the worst row keeps it, and less work is done than an equal tolerance of entries would need.

use radiosity::form_factor::{ExactMethod, MethodSettings, ROW_TOLERANCE, method, worst_row};
use radiosity::scene::builtin;

use crate::support::rooms::Prepared;

#[test]
fn rows_are_within_their_tolerance() {
    for (name, n) in [("room-box", 4), ("cornell-box", 2)] {
        let prepared = Prepared::new(builtin::build(name, None).unwrap().scene, n);
        let reference = prepared.compute(&ExactMethod {
            tolerance: 1e-8,
            ..ExactMethod::default()
        });
        for tolerance in [1e-2, 1e-4] {
            let settings = MethodSettings::default().with(&ROW_TOLERANCE, tolerance);
            let computed = prepared.try_compute(&*method("exact", &settings).unwrap()).unwrap();
            let worst = worst_row(&computed.factors);
            assert!(computed.tolerance_met && worst <= tolerance, "{name} {worst:e}");
            assert!(
                worst > 1e-4 * tolerance,
                "{name} {worst:e}: far more was done than asked for"
            );
            for i in 0..reference.n_rows() {
                let off = (computed.factors.row_sum(i) - reference.row_sum(i)).abs();
                assert!(off <= worst + worst_row(&reference), "{name} {i} {off:e}");
            }
        }
    }
}

/// Only pairs that put a row above the tolerance are computed again.
#[test]
fn only_pairs_of_rows_above_the_tolerance_are_computed_again() {
    let prepared = Prepared::new(builtin::build("room-box", None).unwrap().scene, 4);
    let tolerance = 1e-4;
    let once = prepared
        .try_compute(&ExactMethod {
            tolerance,
            ..ExactMethod::default()
        })
        .unwrap();
    let settings = MethodSettings::default().with(&ROW_TOLERANCE, tolerance);
    let rows = prepared.try_compute(&*method("exact", &settings).unwrap()).unwrap();
    let above = worst_row(&once.factors);
    assert!(above > tolerance, "{above:e}: nothing is left to do");
    let [first, all] = [&once, &rows].map(|computed| computed.pairs.unwrap());
    let n_again = all.clipped + all.by_rays - first.clipped - first.by_rays;
    assert_eq!(all.partial, first.partial);
    assert!((1..first.partial).contains(&n_again), "{n_again} of {}", first.partial);
    // An entry that was computed once is the same to the last bit.
    let n = once.factors.n_rows();
    let of_both = |i: usize, j: usize| [&once, &rows].map(|computed| computed.factors.get(i, j).to_bits());
    let n_changed = (0..n)
        .flat_map(|i| (i + 1..n).map(move |j| of_both(i, j)))
        .filter(|[a, b]| a != b)
        .count();
    assert!(n_changed as u64 <= n_again, "{n_changed} of {n_again}");
}

/// A tolerance above all that most pairs exchange: errors of entries do not fall with it at once.
#[test]
fn loose_tolerances_of_rows_of_small_patches_are_met() {
    let prepared = Prepared::new(builtin::build("room-box", None).unwrap().scene, 6);
    for tolerance in [1e-1, 3e-2, 1e-2] {
        let settings = MethodSettings::default().with(&ROW_TOLERANCE, tolerance);
        let computed = prepared.try_compute(&*method("exact", &settings).unwrap()).unwrap();
        let worst = worst_row(&computed.factors);
        assert!(computed.tolerance_met && worst <= tolerance, "{tolerance} {worst:e}");
    }
}

/// Below the digits of f64 no work helps: the best that there is, and an end.
#[test]
fn rows_that_cannot_be_within_it_are_told() {
    let prepared = Prepared::new(builtin::build("room-box", None).unwrap().scene, 1);
    let settings = MethodSettings::default().with(&ROW_TOLERANCE, 1e-14);
    let computed = prepared.try_compute(&*method("exact", &settings).unwrap()).unwrap();
    assert!(!computed.tolerance_met && worst_row(&computed.factors) > 1e-14);
    for wrong in [0.0, -1.0] {
        let refused = MethodSettings::default().with(&ROW_TOLERANCE, wrong);
        let error = prepared.try_compute(&*method("exact", &refused).unwrap()).unwrap_err();
        assert!(error.to_string().contains("give one above 0"), "{error}");
    }
}
