//! The Pareto front of error and run time.

/// Returns for each (cost, error) whether it is on the Pareto front of the set: no other is as good in both and better in one.
///
/// Equal pairs are on the front together; a pair that holds a NaN is never on it.
pub(super) fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let beaten = |(cost, error): (f64, f64)| {
        let better = |&(c, e): &(f64, f64)| c <= cost && e <= error && (c < cost || e < error);
        points.iter().any(better)
    };
    let usable = |(cost, error): (f64, f64)| !cost.is_nan() && !error.is_nan();
    points.iter().map(|&p| usable(p) && !beaten(p)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nothing_beats_is_on_the_front() {
        let points = [
            (1.0, 9.0),
            (2.0, 9.0),
            (3.0, 1.0),
            (2.0, 4.0),
            (2.0, 4.0),
            (9.0, 2.0),
            (f64::NAN, 0.0),
        ];
        assert_eq!(front(&points), [true, false, true, true, true, false, false]);
        assert!(front(&[]).is_empty());
    }
}
