//! Eigenvalues of a symmetric matrix.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::Arch;

/// Sweeps for one eigenvalue after which the iteration is given up; two are usual.
const MAX_SWEEPS: usize = 50;

/// Returns the eigenvalues of a symmetric matrix, ascending; `values`: \[n, n\].
///
/// Reflections A ← H A H, H = I − 2 v vᵀ / vᵀ v, make it tridiagonal, and implicit QL steps with
/// Wilkinson's shift make that diagonal. Accuracy: 1e-13 of the norm. Work: n³ multiplications, on
/// one thread. Returns nothing if the iteration does not converge, as with entries that are not
/// finite.
///
/// Source: Golub and Van Loan, "Matrix Computations", 4th edition, algorithms 8.3.1 and 8.3.3; the
/// QL step is `imtql1` of Wilkinson and Reinsch, "Handbook for Automatic Computation", volume 2,
/// 1971. Departures: an entry beside the diagonal counts as 0 if it is below rounding of the norm,
/// not of its neighbours.
pub(super) fn eigenvalues(mut values: Vec<f64>, n: usize) -> Option<Vec<f64>> {
    debug_assert_eq!(values.len(), n * n);
    let (mut diagonal, beside) = Arch::new().dispatch(|| tridiagonal(&mut values, n));
    diagonalise(&mut diagonal, beside)?;
    diagonal.sort_by(f64::total_cmp);
    Some(diagonal)
}

/// Returns a tridiagonal matrix with the same eigenvalues.
///
/// They are its diagonal, \[n\], and the entries beside it, \[n\], of which the last is 0.
#[inline(always)]
fn tridiagonal(values: &mut [f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut diagonal, mut beside) = (vec![0.0; n], vec![0.0; n]);
    for k in 0..n {
        let (done, rest) = values.split_at_mut((k + 1) * n);
        diagonal[k] = done[k * n + k];
        let v = &mut done[k * n + k + 1..];
        if let Some(reflected) = reflection(v) {
            beside[k] = reflected;
            reflect(rest, n, v);
        } else {
            beside[k] = v.first().copied().unwrap_or(0.0);
        }
    }
    (diagonal, beside)
}

/// Replaces x by the vector v, vᵀ v = 2, whose reflection takes x to a multiple of the first axis.
///
/// Returns the multiple, or nothing if x is one already.
#[inline(always)]
fn reflection(x: &mut [f64]) -> Option<f64> {
    let scale = x.iter().skip(1).fold(0.0_f64, |scale, x| scale.max(x.abs()));
    if scale == 0.0 {
        return None;
    }
    let scale = scale.max(x[0].abs());
    for x in x.iter_mut() {
        *x /= scale;
    }
    let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let reflected = -norm.copysign(x[0]);
    // vᵀ v = 2 norm (norm + |x₀|).
    let length = (norm * (norm + x[0].abs())).sqrt();
    x[0] -= reflected;
    for x in x.iter_mut() {
        *x /= length;
    }
    Some(reflected * scale)
}

/// Replaces A by H A H, H = I − v vᵀ, where A is the last rows and columns, as many as `v` has.
///
/// H A H = A − v wᵀ − w vᵀ, w = A v − ½ (vᵀ A v) v.
#[inline(always)]
fn reflect(rows: &mut [f64], n: usize, v: &[f64]) {
    let begin = n - v.len();
    let mut w = vec![0.0; v.len()];
    for (row, v) in rows.chunks_exact(n).zip(v) {
        for (w, a) in w.iter_mut().zip(&row[begin..]) {
            *w += a * v;
        }
    }
    let half = 0.5 * v.iter().zip(&w).map(|(v, w)| v * w).sum::<f64>();
    w.iter_mut().zip(v).for_each(|(w, v)| *w -= half * v);
    for ((row, v_i), w_i) in rows.chunks_exact_mut(n).zip(v).zip(&w) {
        for ((a, v), w) in row[begin..].iter_mut().zip(v).zip(&w) {
            *a -= v_i * w + w_i * v;
        }
    }
}

/// Makes a tridiagonal matrix diagonal.
fn diagonalise(diagonal: &mut [f64], mut beside: Vec<f64>) -> Option<()> {
    let entries = || diagonal.iter().chain(&beside);
    if !entries().all(|x| x.is_finite()) {
        return None;
    }
    let negligible = f64::EPSILON * entries().fold(0.0_f64, |greatest, x| greatest.max(x.abs()));
    for first in 0..diagonal.len() {
        let mut n_sweeps = 0;
        loop {
            let last = first + beside[first..].iter().take_while(|x| x.abs() > negligible).count();
            if last == first {
                break;
            }
            n_sweeps += 1;
            if n_sweeps > MAX_SWEEPS {
                return None;
            }
            sweep(&mut diagonal[first..=last], &mut beside[first..=last]);
        }
    }
    Some(())
}

/// Makes one implicit QL step of a tridiagonal matrix, whose entries beside the diagonal are not 0.
fn sweep(diagonal: &mut [f64], beside: &mut [f64]) {
    let last = diagonal.len() - 1;
    let half_gap = (diagonal[1] - diagonal[0]) / (2.0 * beside[0]);
    let shift = diagonal[0] - beside[0] / (half_gap + half_gap.hypot(1.0).copysign(half_gap));
    let (mut sine, mut cosine, mut moved) = (1.0, 1.0, 0.0);
    let mut bulge = diagonal[last] - shift;
    for i in (0..last).rev() {
        let (f, b) = (sine * beside[i], cosine * beside[i]);
        let length = f.hypot(bulge);
        beside[i + 1] = length;
        if length == 0.0 {
            // The matrix falls in two.
            diagonal[i + 1] -= moved;
            beside[last] = 0.0;
            return;
        }
        (sine, cosine) = (f / length, bulge / length);
        let corner = diagonal[i + 1] - moved;
        let turned = (diagonal[i] - corner) * sine + 2.0 * cosine * b;
        moved = sine * turned;
        diagonal[i + 1] = corner + moved;
        bulge = cosine * turned - b;
    }
    diagonal[0] -= moved;
    beside[0] = bulge;
    beside[last] = 0.0;
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// Checks the eigenvalues of the matrix of some entries against known ones, ascending.
    fn check(expected: &[f64], entry: impl Fn(usize, usize) -> f64) {
        let n = expected.len();
        let values: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        let norm = expected.iter().fold(0.0_f64, |norm, x| norm.max(x.abs()));
        let found = eigenvalues(values, n).unwrap();
        assert_eq!(found.len(), n);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() <= 1e-13 * norm, "{n}: {found} {expected}");
        }
    }

    #[test]
    fn small_matrices_have_those_of_the_closed_form() {
        check(&[], |_, _| 1.0);
        check(&[-3.0], |_, _| -3.0);
        for [a, b, c] in [
            [1.0_f64, 2.0, -1.0],
            [2.0, 0.0, 1.0],
            [1e-200, 3e-200, 2e-200],
            [5.0, 1e-3, 5.0],
        ] {
            let (mean, radius) = (0.5 * (a + c), f64::hypot(0.5 * (a - c), b));
            check(&[mean - radius, mean + radius], |i, j| [a, b, c][i + j]);
        }
        check(&[0.0; 3], |_, _| 0.0);
    }

    #[test]
    fn second_differences_have_cosines() {
        for n in [3, 10, 101] {
            let angle = |k: usize| k as f64 * std::f64::consts::PI / (n + 1) as f64;
            let expected: Vec<f64> = (1..=n).map(|k| 2.0 - 2.0 * angle(k).cos()).collect();
            check(&expected, |i, j| [2.0, -1.0].get(i.abs_diff(j)).copied().unwrap_or(0.0));
            // In other axes: reflected at the vector of ones, which fills the matrix.
            let second = |i: usize, j: usize| [2.0, -1.0].get(i.abs_diff(j)).copied().unwrap_or(0.0);
            let row: Vec<f64> = (0..n).map(|i| (0..n).map(|j| second(i, j)).sum()).collect();
            let all: f64 = row.iter().sum();
            let m = n as f64;
            check(&expected, |i, j| {
                second(i, j) - 2.0 / m * (row[i] + row[j]) + 4.0 / (m * m) * all
            });
        }
    }

    #[test]
    fn equal_eigenvalues_stay_equal() {
        let n = 60;
        let v = |i: usize| (i % 7) as f64 - 2.5;
        let squared: f64 = (0..n).map(|i| v(i) * v(i)).sum();
        for factor in [1.0, 1e-3, 1e-14] {
            let mut expected = vec![1.0; n];
            expected[n - 1] += factor * squared;
            check(&expected, |i, j| f64::from(u8::from(i == j)) + factor * v(i) * v(j));
        }
    }

    #[test]
    fn trace_and_squares_are_kept() {
        for n in [5, 64, 150] {
            let number =
                |i: usize, j: usize| ((i.min(j) * 7919 + i.max(j) * 104_729 + i * j) % 1009) as f64 / 1009.0 - 0.5;
            let values: Vec<f64> = (0..n * n).map(|k| number(k / n, k % n)).collect();
            let (trace, squares) = (
                (0..n).map(|i| number(i, i)).sum::<f64>(),
                values.iter().map(|x| x * x).sum::<f64>(),
            );
            let found = eigenvalues(values, n).unwrap();
            let norm = squares.sqrt();
            assert!((found.iter().sum::<f64>() - trace).abs() < 1e-13 * norm * n as f64);
            assert!((found.iter().map(|x| x * x).sum::<f64>() - squares).abs() < 1e-13 * squares);
        }
    }

    #[test]
    fn entries_that_are_not_finite_have_none() {
        for value in [f64::NAN, f64::INFINITY] {
            let mut values = vec![1.0; 25];
            values[7] = value;
            values[11] = value;
            assert!(eigenvalues(values, 5).is_none(), "{value}");
        }
    }
}
