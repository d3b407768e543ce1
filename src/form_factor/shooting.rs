//! The common part of the shooting methods: rays leave a patch with a cosine distribution and are tallied where they land.
//!
//! Source: Baranoski, Bramley and Shirley 1995, appendix A.

use glam::DVec3;

use super::Input;
use crate::geometry::sampling::{Frame, Sequence, cosine_direction};
use crate::matrix::{Entry, RayWeights, RowTally};
use crate::mesh::{Patch, PatchId};
use crate::scene::FaceId;
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// One ray to shoot: its starting point, the two numbers of its direction, and its share of the patch.
pub(super) struct Shot {
    /// The starting point on the patch, in world coordinates.
    pub(super) point: DVec3,
    /// The numbers that [`cosine_direction`] takes.
    pub(super) direction: [f64; 2],
    /// The share of the patch's light that this ray carries, up to a common factor.
    pub(super) weight: f64,
    /// The change of that share by coarser rules, relative to it.
    pub(super) coarser: [f64; 2],
}

/// Returns the number of nets of low-discrepancy points that the rays of a patch come from, if each of its points has one.
pub(super) fn n_nets(sequence: Sequence, n_points: usize) -> Option<usize> {
    match sequence {
        Sequence::Random => None,
        Sequence::Sobol => Some(n_points),
    }
}

/// The number of rays that are traced at once: enough to hide the call, few enough to stay in the first cache.
const BATCH: usize = 512;

/// The buffers of one thread, and the tally of one row at a time.
pub(super) struct Shooter<'a> {
    input: Input<'a>,
    n_nets: Option<usize>,
    rays: RayBatch,
    weights: Vec<f64>,
    coarser: Vec<[f64; 2]>,
    hits: HitBatch,
    /// Σ w of the rays that hit each patch in this row.
    sums: Vec<f64>,
    /// Σ w c and Σ (w c)² of them, for each of two coarser rules; empty if points are at random.
    changes: Vec<[[f64; 2]; 2]>,
    touched: Vec<u32>,
    entries: Vec<Entry>,
}

impl<'a> Shooter<'a> {
    /// `n_nets` as [`n_nets`] returns it; `by_rule` is true if shots differ in [`Shot::coarser`].
    pub(super) fn new(input: Input<'a>, n_nets: Option<usize>, by_rule: bool) -> Self {
        let n = input.mesh.n_patches();
        Self {
            input,
            n_nets,
            rays: RayBatch::default(),
            weights: Vec::new(),
            coarser: Vec::new(),
            hits: HitBatch::default(),
            sums: vec![0.0; n],
            changes: vec![<[[f64; 2]; 2]>::default(); if by_rule { n } else { 0 }],
            touched: Vec::new(),
            entries: Vec::new(),
        }
    }

    /// Shoots `shots` from a patch and returns its row: sorted entries (j, F_ij, standard error), and the tally of rays that hit no front.
    ///
    /// With weights scaled to a sum of 1, F_ij = Σ w over the rays that hit j from the front. The standard error is that of
    /// independent rays, sqrt(F (1 − F) Σ_all w²), for equal weights the binomial sqrt(F (1 − F) / N), and by Laplace's rule where most rays hit j; points of
    /// M nets have (N F / M)^(−1/8) of it. Each coarser rule adds the part of its distance |Σ w c| beyond twice the noise of that, sqrt(Σ (w c)²).
    pub(super) fn row(&mut self, patch: &Patch, shots: impl Iterator<Item = Shot>) -> (&mut [Entry], RowTally) {
        let visibility = self.input.visibility;
        let frame = Frame::from_normal(patch.normal);
        let lift = patch.normal * visibility.offset() - visibility.frame_origin();
        let mut tally = RowTally::default();
        let mut total = 0.0;
        let mut sums = RayWeights {
            escaped: 0.0,
            absorbed: 0.0,
            squared: 0.0,
        };
        for shot in shots {
            let direction = frame.to_world(cosine_direction(shot.direction[0], shot.direction[1]));
            self.rays.push_ray(shot.point + lift, direction);
            self.weights.push(shot.weight);
            self.coarser.push(shot.coarser);
            total += shot.weight;
            sums.squared += shot.weight * shot.weight;
            tally.n_rays += 1;
            if self.rays.len() == BATCH {
                self.trace(patch.face, &mut tally, &mut sums);
            }
        }
        self.trace(patch.face, &mut tally, &mut sums);
        sums.escaped /= total;
        sums.absorbed /= total;
        sums.squared /= total * total;
        tally.weights = Some(sums);
        self.touched.sort_unstable();
        self.entries.clear();
        for &j in &self.touched {
            let factor = std::mem::take(&mut self.sums[j as usize]) / total;
            let noise = match self.n_nets {
                Some(n_nets) => tally.noise_of_nets(factor, n_nets),
                None => tally.noise_of(factor),
            };
            let changes = self.changes.get_mut(j as usize).map(std::mem::take).unwrap_or_default();
            let bias = |[change, squared]: [f64; 2]| (change.abs() - 2.0 * squared.sqrt()).max(0.0) / total;
            self.entries
                .push((j, factor, noise + changes.into_iter().map(bias).sum::<f64>()));
        }
        self.touched.clear();
        (&mut self.entries, tally)
    }

    fn trace(&mut self, own: FaceId, tally: &mut RowTally, sums: &mut RayWeights) {
        self.input
            .visibility
            .closest_hits_from(own, &self.rays, Coherence::Incoherent, &mut self.hits);
        for (k, &weight) in self.weights.iter().enumerate() {
            match self.hits.face(k) {
                None => {
                    tally.n_escaped += 1;
                    sums.escaped += weight;
                }
                Some(hit) if hit.back => {
                    tally.n_absorbed += 1;
                    sums.absorbed += weight;
                }
                Some(hit) => {
                    let PatchId(j) =
                        self.input
                            .mesh
                            .patch_at(hit.face, f64::from(self.hits.u[k]), f64::from(self.hits.v[k]));
                    let of_patch = &mut self.sums[j as usize];
                    if *of_patch <= 0.0 {
                        self.touched.push(j);
                    }
                    *of_patch += weight;
                    if let Some(changes) = self.changes.get_mut(j as usize) {
                        for (change, coarser) in changes.iter_mut().zip(self.coarser[k]) {
                            change[0] += weight * coarser;
                            change[1] += (weight * coarser).powi(2);
                        }
                    }
                }
            }
        }
        self.rays.clear();
        self.weights.clear();
        self.coarser.clear();
    }
}
