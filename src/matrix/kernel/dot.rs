//! The sum over the listed numbers of a row.

use super::scalar::Scalar;

/// Adds `factor` times Σ_k `values[k]` x[k] to `sum`, where x[k] is the row of `x` (row-major, one entry per channel) that `row_of(k)` names.
///
/// The order of the additions depends on the number of values alone: four sums over k = 0, 1, 2, 3 mod 4, then their sum.
/// A channel's sum is the same bytes whatever the number of channels.
pub(in crate::matrix) fn add_dot<T: Scalar>(
    values: &[T],
    row_of: impl Fn(usize) -> usize,
    factor: f64,
    x: &[f64],
    sum: &mut [f64],
) {
    match sum.len() {
        1 => add_dot_fixed::<T, 1>(values, row_of, factor, x, sum),
        3 => add_dot_fixed::<T, 3>(values, row_of, factor, x, sum),
        n_channels => {
            for c in 0..n_channels {
                let place_of = |k| row_of(k) * n_channels + c;
                add_dot_fixed::<T, 1>(values, place_of, factor, x, &mut sum[c..=c]);
            }
        }
    }
}

fn add_dot_fixed<T: Scalar, const C: usize>(
    values: &[T],
    row_of: impl Fn(usize) -> usize,
    factor: f64,
    x: &[f64],
    sum: &mut [f64],
) {
    let (rows, _) = x.as_chunks::<C>();
    let (fours, rest) = values.as_chunks::<4>();
    let mut lanes = [[0.0; C]; 4];
    let add = |lane: &mut [f64; C], value: T, k: usize| {
        let row = &rows[row_of(k)];
        for c in 0..C {
            lane[c] += value.to_f64() * row[c];
        }
    };
    for (block, four) in fours.iter().enumerate() {
        for l in 0..4 {
            add(&mut lanes[l], four[l], 4 * block + l);
        }
    }
    for (l, &value) in rest.iter().enumerate() {
        add(&mut lanes[l], value, 4 * fours.len() + l);
    }
    for c in 0..C {
        sum[c] += factor * ((lanes[0][c] + lanes[1][c]) + (lanes[2][c] + lanes[3][c]));
    }
}
