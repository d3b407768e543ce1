//! `contour`: the double integral around both contours, times the visible fraction.

use std::num::NonZeroUsize;

use super::entry::{MethodEntry, Work};
use super::facing;
use super::pairs::Exchange;
use super::sampled::{self, Sampled};
use super::segments::{Independence, PairSums, Segments, VisibleFraction};
use super::settings::FIVE_POINTS;
use super::{ComputeResult, Computed, FormFactorError, FormFactorMethod, Input};
use crate::geometry::polygon_form_factor;
use crate::matrix::StorageChoice;
use crate::progress::Progress;

/// The contour integral of each pair, times the fraction of it that is visible.
///
/// A_i F_ij = v / (2π) ∮∮ ln r dr_i · dr_j, with v = Σ k V / Σ k over the rays between q × q points on both patches, one at random in each of q × q
/// cells of equal area, and k the integrand cos θ cos θ / r² of each ray.
///
/// Accuracy without occluders: rounding, which the sum of the contours loses to cancellation (see
/// [`contour`](polygon_form_factor::contour)). With occluders v is biased by O(1/q²), as a ratio of sums is, and has the standard error that each entry states: that of N^(7/4) independent rays
/// if N points of a patch see all of the exchange, and more where the kernel at the points misses some of it; at the border of
/// a shadow about q^(−3/2) of the entry. 0 ≤ A_i F_ij ≤ the exchange area without occluders.
///
/// Source: [`SPARROW_1963`](crate::references::SPARROW_1963), equation (8). Departures: the visible fraction.
#[derive(Clone, Copy, Debug)]
pub struct ContourIntegral {
    /// q, the number of cells along each side of both patches.
    pub points: NonZeroUsize,
    /// The seed of the points in the cells.
    pub seed: u64,
}

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "contour",
    summary: "The integral around both contours, times the visible fraction",
    settings: &[FIVE_POINTS],
    work: Work::Pairs,
    make: |s| {
        Some(Box::new(ContourIntegral {
            points: s.points()?,
            seed: s.seed,
        }))
    },
};

impl FormFactorMethod for ContourIntegral {
    fn name(&self) -> &'static str {
        "contour"
    }

    fn has_noisy_pairs(&self) -> bool {
        true
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let polygons = facing::prepared(input.mesh);
        let unoccluded = |[i, j]: [usize; 2]| {
            let exchange = polygon_form_factor::contour(&polygons[i], &polygons[j]);
            Ok(Exchange {
                area: exchange.value,
                error: exchange.error,
            })
        };
        times_visible(self.points, self.seed, unoccluded, input, storage, progress)
    }
}

/// Computes the value of `unoccluded` for each pair times the visible fraction of q × q stratified points on both patches.
pub(super) fn times_visible(
    points: NonZeroUsize,
    seed: u64,
    unoccluded: impl Fn([usize; 2]) -> Result<Exchange, FormFactorError> + Sync,
    input: Input<'_>,
    storage: StorageChoice,
    progress: &dyn Progress,
) -> Result<Computed, FormFactorError> {
    let points = if input.unoccluded {
        Vec::new()
    } else {
        sampled::stratified(input.mesh, points.get(), seed)
    };
    let method = Sampled {
        independence: Independence::SharedStrata,
        sample: |segments: &mut Segments<'_>, owner: usize, pair: [usize; 2]| {
            if !segments.is_known(owner) {
                sampled::join_all(segments, input.mesh, &points, owner, pair);
                sampled::join_parts_in_front(segments, input.mesh, owner, pair);
            }
        },
        exchange: |pair: [usize; 2], sums: PairSums, visible: VisibleFraction| {
            let whole = unoccluded(pair)?;
            Ok(whole.times(visible.beside(sums.by_kernel, whole.area)))
        },
    };
    method.compute(input, storage, progress)
}
