//! The settings of the exact method.

use super::row_tolerance::{ExactRows, ROW_TOLERANCE};
use crate::form_factor::entry::{MethodEntry, Work};
use crate::form_factor::settings::TOLERANCE;
use crate::geometry::polygon_form_factor::Tolerance;
use crate::setting::{Kind, Setting, Value};

/// Exact exchange areas: the kernel of unoccluded polygons where two patches see each other whole, clipping against the occluders where they do not.
///
/// A_i F_ij = ∫_{A_i} ∫_{A_j} V cos θ_i cos θ_j / (π r²) dA_j dA_i in m², computed once for each pair and stored symmetric. What
/// of a patch lies behind the other's plane takes no part; patches of one plane or back to back exchange exactly 0. A face sees on the side of its normal and
/// blocks on both; two coincident faces of opposite winding are a sheet that both sides see from.
///
/// - Faces that see nothing of each other are left out by a tree of the boxes around corners and normals. What may occlude the faces below one of its nodes from a face is found once and handed down;
///   branches that nothing can occlude, or that one polygon or convex solid hides, are settled whole.
/// - Pairs are classified in f64 against all faces of the scene ([`OccluderIndex`](crate::visibility::occluders::OccluderIndex)): faces first, then runs of patches, then
///   patches, each only against what stood between the larger ones. With [`Input::unoccluded`](crate::form_factor::Input::unoccluded) no index is made and nothing is classified.
/// - Full pairs: [`polygon_form_factor::exchange_area`](crate::geometry::polygon_form_factor::exchange_area) to a relative error of `tolerance`/10⁵, but not above 1e-9 or below 1e-12;
///   for tolerances above 1e-6, an absolute error of A_i F_ij / min(A_i, A_j) below `tolerance`/10⁵ is enough. Where two faces are
///   regular grids with a common step, or patches are faces of one plane that make such a grid in any order, pairs with the same step between them are computed once; where they are grids of rectangles with parallel edges, whatever
///   their steps, and the absolute error is enough, all pairs are differences of one closed form at the grids' corners.
/// - Hidden pairs are exactly 0.
/// - Partial pairs: [`partial::exchange_area`](crate::form_factor::partial::exchange_area), which follows the edges of the shadows, and subtracts what is hidden from the exchange area without occluders. Two patches with
///   many occluders are halved as long as that leaves fewer between the halves; where a wall stands in a narrow gap, both are cut along it. Where the tolerance is more than thirty times a pair's exchange area without occluders, three or four points of each part of it are all,
///   and its error is certain: all that seems visible or all that seems hidden, whichever is more.
///
/// - Of a convex solid with seven or more sides in the way, what its silhouette hides is taken away at once.
/// - Pairs with five occluders or more, or three that are no sides of solids, for which clipping is going to cost four times as much, are settled by rays: 1/16 of them each from an independent scramble of Sobol points, until 4.5 standard
///   errors of the mean and what all rays may have missed are within 3/10 of the tolerance; [`PairCounts::by_rays`](crate::form_factor::PairCounts::by_rays) has their number. Their points are a matter of the two patches: results are the same bytes at any number of threads.
///
/// No ray starts off a surface or is traced in f32: pairs nearer than either allows need no special care.
///
/// Accuracy: of full pairs the kernel's own estimate. Of partial pairs |error| of A_i F_ij / min(A_i, A_j) ≤ `tolerance`, and below the entry's own estimate; where the
/// budget is spent before, the estimate says what was reached, the pair is one of [`PairCounts::n_above_tolerance`](crate::form_factor::PairCounts::n_above_tolerance) and [`Computed::tolerance_met`](crate::form_factor::Computed::tolerance_met) is false. Where two patches have less than five occluders (above a `tolerance` of 1e-6: and one is 25 times as large as the other),
/// or one patch is 1e4 times as large as the other, the error is also to be below 10³ `tolerance` (up to a `tolerance` of 1e-5) of the exchange area without occluders, as far as a hundredth of the budget goes: small and far
/// emitters keep their shadows. An occluder's border of 1e-10 of the width of the space between the two patches there is neglected, as
/// [`OccluderIndex`](crate::visibility::occluders::OccluderIndex) says. Where coordinates were rounded, as those of a file with six decimals, faces that were meant to touch reach into each other or lie apart: what reaches in
/// between two patches by no more than that explains is left out, and the estimate then has the border of both patches that this may hide; quads that are bent have theirs too. Where the file [shows that it was rounded](crate::scene::Written::shows_rounding),
/// the estimate has what its last digits leave open, too: how far A_i F_ij and the areas change where corners and the edges of occluders move by half a unit. Patches that do not face each other there, but may do so as they were meant, have an entry of 0 with an error, down to a hundredth of the tolerance. Where that brings the estimate of a pair, full or partial, above
/// the tolerance, the pair is one of [`PairCounts::n_above_by_rounding`](crate::form_factor::PairCounts::n_above_by_rounding) and [`Computed::tolerance_met`](crate::form_factor::Computed::tolerance_met) is false as well: more work does not help there. Below the tolerance, integrals leave room for it, up to half of the tolerance. 0 ≤ A_i F_ij ≤ the exchange area without occluders.
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

/// Evaluations for one pair of patches after which the next one follows.
pub static BUDGET: Setting = Setting {
    name: "budget",
    help: "Evaluations for one pair of patches after which the next one follows",
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

/// Up to this tolerance pairs without occluders keep their relative digits, however small they are.
const FULL_IS_RELATIVE: f64 = 1e-6;

/// Up to this tolerance partial pairs keep some relative digits.
const PARTIAL_IS_RELATIVE: f64 = 1e-5;

impl ExactMethod {
    /// The tolerance unless another is asked for.
    pub const DEFAULT_TOLERANCE: f64 = 1e-6;
    /// The budget unless another is asked for: some seconds for one pair.
    pub const DEFAULT_BUDGET: usize = 10_000_000;

    /// Returns the fraction of the unoccluded exchange area that the error of a partial pair must not exceed either: a sun whose form factor is as small as the tolerance still casts shadows.
    ///
    /// Where that would be loose, it is not asked for.
    pub(super) fn relative_tolerance(&self) -> f64 {
        if self.tolerance <= PARTIAL_IS_RELATIVE {
            1e3 * self.tolerance
        } else {
            f64::INFINITY
        }
    }

    /// Returns how many times as large one patch is as the other, at least, where the error of a pair with few occluders is to be relative too.
    pub(super) fn unlike_of_few(&self) -> f64 {
        if self.tolerance <= Self::DEFAULT_TOLERANCE {
            1.0
        } else {
            25.0
        }
    }

    /// Returns how far corners may be off, in m, for pairs of patches of a size, in m, or more to count as equal: what that changes is below what such pairs are computed to, or a hundredth of the tolerance where digits are not relative.
    pub(super) fn shared_off(&self, size: f64) -> f64 {
        let part = if self.tolerance > FULL_IS_RELATIVE {
            1e-3 * self.tolerance
        } else {
            0.1 * self.full_tolerance(1.0).rel
        };
        part * size
    }

    /// Returns what pairs without occluders are computed to.
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
