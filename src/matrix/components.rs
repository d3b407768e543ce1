//! Which patches can exchange light at all, however many reflections it takes.

use super::FormFactors;
use super::operator::Components;

/// Returns the connected components of the graph with an edge wherever F_ij is not zero.
pub(super) fn connected(form_factors: &FormFactors) -> Components {
    let n = form_factors.n_rows();
    let mut parents: Vec<usize> = (0..n).collect();
    let mut n_components = n;
    for i in 0..n {
        if n_components == 1 {
            break;
        }
        form_factors.for_each_in_row(i, |j, value, _| {
            let (a, b) = (root(&mut parents, i), root(&mut parents, j));
            if value > 0.0 && a != b {
                // The smaller number is the root, so roots come in the order of first patches.
                parents[a.max(b)] = a.min(b);
                n_components -= 1;
            }
        });
    }
    let mut labels = vec![0; n];
    let mut next = 0;
    for i in 0..n {
        let root = root(&mut parents, i);
        if root == i {
            labels[i] = next;
            next += 1;
        } else {
            labels[i] = labels[root];
        }
    }
    Components { labels, n_components }
}

fn root(parents: &mut [usize], mut i: usize) -> usize {
    while parents[i] != i {
        parents[i] = parents[parents[i]]; // Halves the path for the next time.
        i = parents[i];
    }
    i
}
