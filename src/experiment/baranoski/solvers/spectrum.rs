//! The eigenvalues of figures 2 and 3.

use super::symmetric;
use crate::matrix::FormFactors;
use crate::matrix::operator::Block;

/// Returns the eigenvalues of G = I − diag(ρ) F, ascending.
///
/// With symmetric exchange areas they are those of the symmetric matrix I − diag(ρ A)^½ F diag(ρ / A)^½. One channel. Memory: 8 n² bytes. Accuracy: 1e-13.
/// Source: Baranoski, Bramley and Shirley 1995, sections 2.1 and 5.2. Departures: none. Returns an empty list if the method does not converge.
pub(super) fn eigenvalues(factors: &FormFactors, reflectance: &Block) -> Vec<f64> {
    let n = factors.n_rows();
    let areas = factors.areas();
    let rho = |i: usize| reflectance.row(i)[0];
    let mut matrix = vec![0.0; n * n];
    for i in 0..n {
        matrix[i * n + i] = 1.0;
        factors.for_each_in_row(i, |j, f, _| {
            if j <= i {
                let product = (rho(i) * rho(j) * areas[i] / areas[j]).sqrt() * f;
                matrix[i * n + j] -= product;
                matrix[j * n + i] = matrix[i * n + j];
            }
        });
    }
    symmetric::eigenvalues(matrix, n).unwrap_or_default()
}
