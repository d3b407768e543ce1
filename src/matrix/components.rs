//! Connected components: the sets of patches that exchange light after any number of reflections.

use std::ops::Range;

use super::form_factors::FormFactors;
use super::operator::{Block, Components, LinearOperator, RowAccess};
use crate::disjoint_sets::DisjointSets;

/// Returns the connected components of the graph with an edge wherever F_ij is not zero.
pub(crate) fn connected(operator: &dyn LinearOperator, rows: &dyn RowAccess) -> Components {
    let n = operator.n_rows();
    let mut sets = DisjointSets::new(n);
    let mut n_components = n;
    let mut n_alone = 0;
    for i in 0..n {
        if n_components <= n_alone + 1 {
            break;
        }
        if i == ROWS_BEFORE && operator.reciprocal_areas().is_some() {
            n_alone = count_alone(operator);
        }
        rows.visit_row(i, &mut |j, value| {
            if value > 0.0 && sets.join(i, j) {
                n_components -= 1;
            }
        });
    }
    numbered(sets, n)
}

/// Returns the sets of n patches, numbered in the order of their first members.
fn numbered(mut sets: DisjointSets, n: usize) -> Components {
    let mut labels = vec![0; n];
    let mut next = 0;
    for i in 0..n {
        let first = sets.find(i);
        if first == i {
            labels[i] = next;
            next += 1;
        } else {
            labels[i] = labels[first];
        }
    }
    Components {
        labels,
        n_components: next as usize,
    }
}

impl FormFactors {
    /// Returns the connected components where this rank stores the rows `held`, by joining those of all ranks' rows. Collective.
    pub(super) fn components_of_parts(&self, held: Range<usize>) -> Components {
        let n = self.n_rows();
        let n_alone = if self.is_symmetric() { count_alone(self) } else { 0 };
        let mut sets = DisjointSets::new(n);
        let mut n_components = n;
        for i in held {
            if n_components <= n_alone + 1 {
                break;
            }
            self.for_each_number(i, 0..n, &mut |j, value, _| {
                if value > 0.0 && sets.join(i, j) {
                    n_components -= 1;
                }
            });
        }
        let firsts = (0..n).map(|i| sets.find(i) as f64).collect();
        let mut all = DisjointSets::new(n);
        for (k, first) in self.gathered(firsts).into_iter().enumerate() {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a row number")]
            all.join(k % n, first as usize);
        }
        numbered(all, n)
    }
}

/// The number of rows after which patches without any exchange are counted by a pass.
///
/// By then all patches that see one another mostly are one component. The rest are patches that see nothing, such as the underside of a box on the floor: a pass finds them
/// many times as fast as a visit of the entries.
const ROWS_BEFORE: usize = 64;

/// Returns the number of patches that see nothing; as the matrix is symmetric, none sees them.
fn count_alone(operator: &dyn LinearOperator) -> usize {
    let ones = Block::from_values(vec![1.0; operator.n_rows()], 1);
    let mut row_sums = Block::zeros(operator.n_rows(), 1);
    operator.apply(&ones, &mut row_sums);
    row_sums.values().iter().filter(|sum| sum.abs() <= 0.0).count()
}
