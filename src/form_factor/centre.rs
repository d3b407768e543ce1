//! `centre`: the integrand between the patches' centres.

use super::entry::{MethodEntry, Work};
use super::{ComputeResult, FormFactorError, FormFactorMethod, Input, Reciprocity, sampled};
use crate::geometry::quadrature::WeightedPoint;
use crate::matrix::{FormFactors, MatrixError, RowTally, RowTile, StorageChoice};
use crate::mesh::{Patch, PatchId};
use crate::progress::Progress;
use crate::setting::{Kind, Setting, Value};

/// The integrand between the centroids, times the areas: the coarsest rule of all.
///
/// A_i F_ij = A_i A_j V cos θ_i cos θ_j / (π r²), V by one ray between the centroids. Symmetric, or with `normalise` divided
/// by α_i = Σ_j F_ij, so that rows sum to 1: then not symmetric.
///
/// Order: second in the patches' size over their distance; first in the distance where patches touch. Bias: the error of the rule, positive between patches
/// that touch (0.318 instead of 0.200 for two unit squares at right angles); A_i F_ij may exceed the smaller area, and row sums may exceed 1.
/// Error of an entry: its distance from the exact form factor without occluders (two digits of it), plus 0.41 of that where something may occlude, as one
/// ray says so little. With `normalise`, the least of three: that, and its part of the row's sum of errors, divided by α_i; that, and the step from the entry
/// as it was; and the step from the entry to the farther end of [0, 1].
///
/// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), equation (5). Departures: visibility is traced, not assumed; normalising is a choice.
#[derive(Clone, Copy, Debug, Default)]
pub struct CentrePoint {
    /// Whether each row is divided by its sum.
    pub normalise: bool,
}

/// Whether rows are divided by their sums.
pub static NORMALISE: Setting = Setting {
    name: "normalise",
    help: "Divide each row by its sum",
    letter: "",
    kind: Kind::Flag,
};

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "centre",
    summary: "One ray between the centres (Lewis)",
    settings: &[NORMALISE.or(Value::Flag(false))],
    work: Work::Pairs,
    make: |s| {
        let normalise = s.values.is_on(&NORMALISE);
        Some(Box::new(CentrePoint { normalise }))
    },
};

impl FormFactorMethod for CentrePoint {
    fn name(&self) -> &'static str {
        "centre"
    }

    fn reciprocity(&self) -> Reciprocity {
        if self.normalise {
            Reciprocity::NotPromised
        } else {
            Reciprocity::Exact
        }
    }

    fn errs_by_rule(&self) -> bool {
        true
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let centre = |patch: &Patch| -> Vec<WeightedPoint> {
            vec![WeightedPoint {
                position: patch.centroid,
                weight: 1.0,
            }]
        };
        let points: Vec<Vec<WeightedPoint>> = input.mesh.patches.iter().map(centre).collect();
        let mut computed = sampled::quadrature(&points, input, storage, progress)?;
        if self.normalise {
            computed.factors = normalised(&computed.factors, storage)?;
        }
        Ok(computed)
    }
}

/// Returns F_ij / Σ_k F_ik; rows that see nothing stay as they are, with the errors that the rule states of their zeros.
fn normalised(factors: &FormFactors, storage: StorageChoice) -> Result<FormFactors, FormFactorError> {
    let rows = (0..factors.n_rows()).map(|i| {
        let alpha = factors.row_sum(i);
        let mut tile = RowTile::new(i);
        let mut entries = Vec::new();
        if alpha > 0.0 {
            let mut error_sum = 0.0;
            factors.for_each_in_row(i, |_, _, error| error_sum += error);
            factors.for_each_in_row(i, |j, value, error| {
                let scaled = value / alpha;
                let of_both = (error + scaled * error_sum) / alpha;
                let of_step = error + (scaled - value).abs();
                let most = scaled.max(1.0 - scaled);
                entries.push((PatchId::from_index(j).0, scaled, of_both.min(of_step).min(most)));
            });
        } else {
            factors.for_each_in_row(i, |j, value, error| {
                entries.push((PatchId::from_index(j).0, value, error));
            });
        }
        tile.push_row(&entries, RowTally::default());
        tile
    });
    let stored = FormFactors::from_tiles(factors.areas().to_vec(), rows, storage)?;
    Ok(factors.if_readable(stored).map_err(MatrixError::from)?)
}
