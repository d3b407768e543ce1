//! `qmc`: rays between low-discrepancy points of both patches, the exact form factor as a control.

use super::entry::{MethodEntry, Work};
use super::facing;
use super::pairs::Exchange;
use super::sampled::Sampled;
use super::segments::{Independence, PairSums, Segments, VisibleFraction, kernel};
use super::settings::RAYS;
use super::{ComputeResult, FormFactorMethod, Input};
use crate::geometry::polygon_form_factor::{Tolerance, exchange_area};
use crate::geometry::sampling::{PointStream, Sequence, UniformOnPolygon};
use crate::matrix::StorageChoice;
use crate::progress::Progress;
use crate::setting::Value;

/// The exact exchange area without occluders, times the visible fraction of N rays between points of a scrambled Sobol sequence.
///
/// A_i F_ij = X Σ k V / Σ k, with X the exact exchange area, the 4 coordinates of each Sobol point on both patches, uniform by area, and k the integrand
/// cos θ cos θ / r² of each ray. A fully visible pair has no noise, and the ratio has a bounded variance although k
/// has none where patches touch. Each pair has a sequence of its own.
///
/// Bias: O(1/N) of the entry, that of a ratio of sums. Error of an entry: the standard error of that ratio for N^(5/4) independent rays, as many as N points of a net in four
/// dimensions are worth, with 2/((M + 2)(M + 3)), M = N^(9/8), in its square for what all rays may have missed. 0 ≤ A_i F_ij ≤ X.
///
/// Source: [`OWEN_1997`](crate::references::OWEN_1997) for the points; the ratio estimator is textbook statistics
/// (Cochran, *Sampling Techniques*, chapter 6). Departures: none.
#[derive(Clone, Copy, Debug)]
pub struct QuasiMonteCarlo {
    /// N, the number of rays of each pair.
    pub rays: u64,
    /// The seed of all sequences.
    pub seed: u64,
}

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "qmc",
    summary: "The exact factor times the visible fraction of low-discrepancy rays",
    settings: &[RAYS.or(Value::Count(64))],
    work: Work::Pairs,
    make: |s| {
        Some(Box::new(QuasiMonteCarlo {
            rays: s.rays()?,
            seed: s.seed,
        }))
    },
};

impl FormFactorMethod for QuasiMonteCarlo {
    fn name(&self) -> &'static str {
        "qmc"
    }

    fn has_noisy_pairs(&self) -> bool {
        true
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let patches = &input.mesh.patches;
        let polygons = facing::prepared(input.mesh);
        let maps = facing::polygons(input.mesh, UniformOnPolygon::new);
        let method = Sampled {
            independence: Independence::Net,
            sample: |segments: &mut Segments<'_>, owner: usize, [i, j]: [usize; 2]| {
                if segments.is_known(owner) {
                    return;
                }
                // A pair's sequence has the same number whatever other patches there are.
                let mut stream = PointStream::new(Sequence::Sobol, self.seed, ((i as u64) << 32) | j as u64);
                for _ in 0..self.rays {
                    let [s, t, u, v] = stream.next_point();
                    let (x, y) = (maps[i].point(s, t), maps[j].point(u, v));
                    let density = kernel((x, patches[i].normal), (y, patches[j].normal));
                    if density > 0.0 {
                        segments.add(owner, (i, x), (j, y), density);
                    }
                }
            },
            exchange: |[i, j]: [usize; 2], _: PairSums, visible: VisibleFraction| {
                let exact = exchange_area(&polygons[i], &polygons[j], Tolerance::default());
                let unoccluded = Exchange {
                    area: exact.value,
                    error: exact.error,
                };
                Ok(unoccluded.times(visible))
            },
        };
        method.compute(input, storage, progress)
    }
}
