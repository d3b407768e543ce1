//! The settings of the exact method.

use super::row_tolerance::{ExactRows, ROW_TOLERANCE};
use crate::form_factor::entry::{MethodEntry, Work};
use crate::form_factor::settings::TOLERANCE;
use crate::geometry::polygon_form_factor::Tolerance;
use crate::setting::{Kind, Setting, Value};

/// Exchange areas to a tolerance: the kernel of unoccluded polygons for fully visible pairs, clipping against the occluders for partially visible ones.
///
/// A_i F_ij = ∫_{A_i} ∫_{A_j} V cos θ_i cos θ_j / (π r²) dA_j dA_i in m², computed once for each pair and stored symmetric. The part of a patch
/// behind the other's plane takes no part; patches of one plane or back to back exchange exactly 0. A face sees on the side of its normal and
/// occludes on both; two coincident faces of opposite winding are a double-sided sheet.
///
/// - A tree of the boxes around corners and normals skips faces that see nothing of each other. The possible occluders between a face and the faces below a node are found once and handed down;
///   branches that nothing can occlude, or that one polygon or convex solid hides, are settled whole.
/// - Pairs are classified in f64 against all faces of the scene ([`OccluderIndex`](crate::visibility::occluders::OccluderIndex)): faces first, then runs of patches, then
///   patches, each only against the occluders of the larger ones. With [`Input::unoccluded`](crate::form_factor::Input::unoccluded) no index is made and nothing is classified.
/// - Full pairs: [`polygon_form_factor::exchange_area`](crate::geometry::polygon_form_factor::exchange_area) to a relative error of `tolerance`/10⁵, between 1e-12 and 1e-9;
///   for tolerances above 1e-6, an absolute error of A_i F_ij / min(A_i, A_j) below `tolerance`/10⁵ is enough.
///   Pairs with the same step between them are computed once where two faces are regular grids with a common step, or patches are faces of one plane that make such a grid in any order.
///   Where the faces are grids of rectangles with parallel edges and any steps, and the absolute error is enough, all pairs are differences of one closed form at the grids' corners.
/// - Hidden pairs are exactly 0.
/// - Partial pairs: [`partial::exchange_area`](crate::form_factor::partial::exchange_area), which follows the edges of the shadows, and subtracts the hidden part from the exchange area without occluders.
///   Two patches with many occluders are halved as long as that leaves fewer between the halves; where a wall stands in a narrow gap, both are cut along it.
/// - The part that a convex solid of seven or more sides hides is subtracted at once, by its silhouette.
/// - Pairs with five occluders or more, or three that are no sides of solids, are settled by rays where these take less time for the tolerance:
///   1/16 of the rays each from an independent scramble of Sobol points, until 4.5 standard errors of the mean and the part that all rays may have missed are within 3/10 of the tolerance;
///   [`PairCounts::by_rays`](crate::form_factor::PairCounts::by_rays) has their number. Their points depend on the two patches alone: results are the same bytes at any number of threads.
///
/// No ray starts off a surface or is traced in f32: pairs nearer than either allows need no special care.
///
/// Accuracy: of full pairs the kernel's own estimate. Of partial pairs |error| of A_i F_ij / min(A_i, A_j) ≤ `tolerance`, and below the entry's own estimate. Where the
/// budget is spent first, the estimate has the accuracy reached, [`PairCounts::n_above_tolerance`](crate::form_factor::PairCounts::n_above_tolerance) counts the pair,
/// and [`Computed::tolerance_met`](crate::form_factor::Computed::tolerance_met) is false.
/// Where two patches have fewer than five occluders (above a `tolerance` of 1e-6: and one is 25 times as large as the other),
/// or one patch is 1e4 times as large as the other, the error is also to be below 10³ `tolerance` (up to a `tolerance` of 1e-5) of the exchange area without occluders, as far as a hundredth of the budget goes: small and far
/// emitters keep their shadows. An occluder's border of 1e-10 of the width of the space between the two patches there is neglected, as
/// [`OccluderIndex`](crate::visibility::occluders::OccluderIndex) describes.
///
/// Rounded coordinates, as those of a file with six decimals, make faces that were meant to touch overlap or lie apart. A part that reaches in
/// between two patches by no more than that is left out, and the estimate then has the border of both patches that it may hide; bent quads have theirs too. Where the file
/// [shows that it was rounded](crate::scene::Written::shows_rounding), the estimate also has the change of A_i F_ij and the areas where corners and the edges of occluders move by half a unit of the last digit.
/// Patches that do not face each other there, but may do so as they were meant, have an entry of 0 with an error, down to a hundredth of the tolerance. Where that brings the estimate of a pair, full or partial, above
/// the tolerance, [`PairCounts::n_above_by_rounding`](crate::form_factor::PairCounts::n_above_by_rounding) counts the pair and
/// [`Computed::tolerance_met`](crate::form_factor::Computed::tolerance_met) is false as well: more work does not help there.
/// Below the tolerance, integrals leave room for it, up to half of the tolerance. 0 ≤ A_i F_ij ≤ the exchange area without occluders.
///
/// Growth: at one tolerance slightly faster than n for n patches of the same faces; in the end n², the number of pairs. With the number of faces, only pairs that may see each other count.
/// Times: `docs/performance.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactMethod {
    /// The tolerance of a partly visible pair, on A_i F_ij / min(A_i, A_j): the absolute error of the larger of F_ij and F_ji.
    pub tolerance: f64,
    /// The most evaluations of the inner form factor for one pair.
    pub budget: usize,
}

/// Evaluations, or rays, for one pair of patches after which the next one follows.
pub static BUDGET: Setting = Setting {
    name: "budget",
    help: "Evaluations, or rays, for one pair of patches after which the next one follows",
    letter: "N",
    kind: Kind::Count(usize::MAX as u64),
};

pub(in crate::form_factor) const ENTRY: MethodEntry = MethodEntry {
    name: "exact",
    summary: "Every pair to a tolerance, shadows by exact clipping",
    settings: &[
        TOLERANCE.or(Value::Number(ExactMethod::DEFAULT_TOLERANCE)),
        ROW_TOLERANCE.optional(),
        BUDGET.or(Value::Count(ExactMethod::DEFAULT_BUDGET as u64)),
    ],
    work: Work::Pairs,
    make: |s| {
        let budget = s.values.get(&BUDGET)?.size()?.get();
        if let Some(of_rows) = s.values.get(&ROW_TOLERANCE) {
            let row_tolerance = of_rows.number()?;
            return Some(Box::new(ExactRows { row_tolerance, budget }));
        }
        Some(Box::new(ExactMethod {
            tolerance: s.tolerance()?,
            budget,
        }))
    },
};

/// The tolerance up to which pairs without occluders keep their relative digits, however small they are.
const FULL_IS_RELATIVE: f64 = 1e-6;

/// The tolerance up to which partial pairs keep some relative digits.
const PARTIAL_IS_RELATIVE: f64 = 1e-5;

impl ExactMethod {
    /// The tolerance unless another is asked for.
    pub const DEFAULT_TOLERANCE: f64 = 1e-6;
    /// The budget unless another is asked for: some seconds for one pair.
    pub const DEFAULT_BUDGET: usize = 10_000_000;

    /// Returns the limit of a partial pair's error as a fraction of the unoccluded exchange area; infinity for loose tolerances.
    ///
    /// With it a sun whose form factor is as small as the tolerance still casts shadows.
    pub(super) fn relative_tolerance(&self) -> f64 {
        if self.tolerance <= PARTIAL_IS_RELATIVE {
            1e3 * self.tolerance
        } else {
            f64::INFINITY
        }
    }

    /// Returns the least ratio of two patches' areas at which the error of a pair with few occluders is to be relative too.
    pub(super) fn unlike_of_few(&self) -> f64 {
        if self.tolerance <= Self::DEFAULT_TOLERANCE {
            1.0
        } else {
            25.0
        }
    }

    /// Returns how far corners may be off, in m, for pairs of patches of at least a size, in m, to count as equal.
    ///
    /// The effect is below the accuracy of such pairs, or a hundredth of the tolerance where digits are not relative.
    pub(super) fn shared_off(&self, size: f64) -> f64 {
        let part = if self.tolerance > FULL_IS_RELATIVE {
            1e-3 * self.tolerance
        } else {
            0.1 * self.full_tolerance(1.0).rel
        };
        part * size
    }

    /// Returns the tolerance of pairs without occluders.
    pub(super) fn full_tolerance(&self, smaller_area: f64) -> Tolerance {
        Tolerance {
            rel: (1e-5 * self.tolerance).clamp(1e-12, 1e-9),
            abs: if self.tolerance > FULL_IS_RELATIVE {
                1e-5 * self.tolerance * smaller_area
            } else {
                0.0
            },
        }
    }
}

impl Default for ExactMethod {
    fn default() -> Self {
        Self {
            tolerance: Self::DEFAULT_TOLERANCE,
            budget: Self::DEFAULT_BUDGET,
        }
    }
}
