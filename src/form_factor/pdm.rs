//! `pdm`: Gauss points on both patches.

use std::num::NonZeroUsize;

use super::entry::{MethodEntry, Work};
use super::facing;
use super::settings::FIVE_POINTS;
use super::{ComputeResult, FormFactorMethod, Input, sampled};
use crate::geometry::quadrature::GaussProduct;
use crate::matrix::StorageChoice;
use crate::progress::Progress;

/// The parametric differential method: q × q Gauss points on both patches, and a ray between any two of them.
///
/// A_i F_ij = A_i A_j Σ_p Σ_s w_p w_s V_ps cos θ_p cos θ_s / (π r_ps²), q⁴ rays a pair.
///
/// Order: 2q between patches apart from each other, with an error that falls like (size / distance)^(2q); about 1 / q where patches touch, because
/// of the integrand's singularity there. Bias: the error of the rule, positive where patches touch, so that A_i F_ij may exceed the smaller area and row sums may exceed 1;
/// at the border of a shadow about q^(−3/2) of the entry.
/// Error of an entry: the rule's distance from the exact form factor without occluders (two digits of it), plus the error of the visible fraction.
///
/// Source: [`BARANOSKI_1995`](crate::references::BARANOSKI_1995), appendix A, equation (29). Departures: the analytic treatment of the
/// singularity that the paper mentions is not described there, and not done; row sums are 1.051 where the paper prints 1.014 (cube of 216 patches).
#[derive(Clone, Copy, Debug)]
pub struct ParametricDifferential {
    /// q, the number of Gauss points along each side of both patches.
    pub points: NonZeroUsize,
}

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "pdm",
    summary: "Gauss points on both patches (parametric differential method)",
    settings: &[FIVE_POINTS],
    work: Work::Pairs,
    make: |s| Some(Box::new(ParametricDifferential { points: s.points()? })),
};

impl FormFactorMethod for ParametricDifferential {
    fn name(&self) -> &'static str {
        "pdm"
    }

    fn errs_by_rule(&self) -> bool {
        true
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let rule = GaussProduct::new(self.points);
        let points = facing::polygons(input.mesh, |corners| rule.on_polygon(corners));
        sampled::quadrature(&points, input, storage, progress)
    }
}
