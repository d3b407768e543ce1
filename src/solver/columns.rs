//! Columns of F, for methods that shoot light out instead of gathering it.

use super::error::SolverError;
use super::system::RadiositySystem;
use crate::matrix::operator::RowAccess;

/// Access to F column by column: F_ji, j = 1 ... n, the fraction of each patch's view that patch i fills.
pub(super) enum Columns<'a> {
    /// F_ji = F_ij A_i / A_j from row i, where A_i F_ij is symmetric.
    Reciprocal { rows: &'a dyn RowAccess, areas: &'a [f64] },
    /// A transposed copy, for form factors that are not reciprocal: 12 bytes for each entry that is not 0.
    Copied {
        /// Where each column begins in the two lists; the end after the last.
        starts: Vec<usize>,
        rows: Vec<u32>,
        values: Vec<f64>,
    },
}

impl<'a> Columns<'a> {
    /// Returns the columns of a system's form factors for the solver of this name.
    pub(super) fn new(system: &RadiositySystem<'a>, solver: &'static str) -> Result<Self, SolverError> {
        let rows = system.rows_for(solver)?;
        if let Some(areas) = system.operator().reciprocal_areas() {
            return Ok(Self::Reciprocal { rows, areas });
        }
        let n = system.n_patches();
        let mut starts = vec![0; n + 1];
        for i in 0..n {
            rows.visit_row(i, &mut |j, _| starts[j + 1] += 1);
        }
        for j in 0..n {
            starts[j + 1] += starts[j];
        }
        let mut ends = starts.clone();
        let (mut places, mut values) = (vec![0; starts[n]], vec![0.0; starts[n]]);
        for (i, row) in (0..n).zip(0_u32..) {
            rows.visit_row(i, &mut |j, value| {
                (places[ends[j]], values[ends[j]]) = (row, value);
                ends[j] += 1;
            });
        }
        Ok(Self::Copied {
            starts,
            rows: places,
            values,
        })
    }

    /// Returns the work of preparing them, in passes over F.
    pub(super) fn setup_work(&self) -> f64 {
        match self {
            Self::Reciprocal { .. } => 0.0,
            Self::Copied { .. } => 2.0,
        }
    }

    /// Calls `visit` with j and F_ji for every entry of column i that may not be 0, j ascending.
    pub(super) fn visit(&self, i: usize, mut visit: impl FnMut(usize, f64)) {
        match self {
            Self::Reciprocal { rows, areas } => {
                let area = areas[i];
                rows.visit_row(i, &mut |j, value| visit(j, value * (area / areas[j])));
            }
            Self::Copied { starts, rows, values } => {
                let range = starts[i]..starts[i + 1];
                for (&j, &value) in rows[range.clone()].iter().zip(&values[range]) {
                    visit(j as usize, value);
                }
            }
        }
    }
}
