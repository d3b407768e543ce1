//! Rays between points of pairs of patches, and the visible fraction of a pair from them.
//!
//! Pairs that are certainly fully visible or hidden ([`Sights`]) need none: their visible fraction is 1 or 0 without an error.

use std::f64::consts::PI;

use glam::DVec3;

use super::sight::{Sight, Sights};
use super::{Input, PairCounts};
use crate::geometry::quadrature::WeightedPoint;
use crate::visibility::{Coherence, RayBatch};

/// The number of rays that are traced at once: enough to hide the call, few enough to stay in the first cache.
const BATCH: usize = 512;

/// Returns the integrand of the exchange area, cos θ_x cos θ_y / (π r²) in m⁻², or 0 where one point is behind the other's plane.
pub(super) fn kernel((x, normal_x): (DVec3, DVec3), (y, normal_y): (DVec3, DVec3)) -> f64 {
    let between = y - x;
    let (height_y, height_x) = (normal_x.dot(between), -normal_y.dot(between));
    if height_x <= 0.0 || height_y <= 0.0 {
        return 0.0;
    }
    let r_squared = between.length_squared();
    height_x * height_y / (PI * r_squared * r_squared)
}

/// How independent the rays of a pair are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Independence {
    /// Each ray has ends of its own, by the points of a net in four dimensions.
    ///
    /// At the border of a shadow N of them are worth N^(5/4) independent rays, as it passes through about N^(3/4) of the net's cells. For the part that all miss they are worth N^(9/8).
    Net,
    /// Every point of one patch is joined with every point of the other: the rays are worth N^(5/4) independent ones.
    ///
    /// N = (Σ w)² / Σ_p (Σ_s w_ps)² is the number of equal points, on the patch where it is less.
    /// The shadow of an occluder close to a patch is the same from all points of the other, so that rays show no more of it than the points of that patch do; and where
    /// the patches are near each other, most of the exchange may pass through few points of the larger one. Beside the border of a shadow
    /// neighbouring points see the same, which makes N points of a grid worth up to N^(3/2) random ones, or N where the border runs along their rows.
    /// With 5/4, 0.1 % of the errors were above three stated ones in 4000 random triples of two patches and an occluder near one of them or in between (5 × 5 points), 1 to 2 % with 3/2;
    /// the median was 0.1 to 0.3 of the stated error.
    SharedEnds,
    /// As [`SharedEnds`](Self::SharedEnds), with one point at random in each cell of a grid: N points are worth N^(7/4).
    ///
    /// No row of them runs along the border of a shadow. For the part that all miss they are worth N^(3/2).
    SharedStrata,
}

/// Returns the mean square of a fraction that n independent rays miss, 2 / ((n + 2)(n + 3)).
pub(super) fn unseen_square(n: f64) -> f64 {
    2.0 / ((n + 2.0) * (n + 3.0))
}

/// Sums over the segments of one pair; w is a segment's weight, in m².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PairSums {
    /// Σ w.
    pub(super) all: f64,
    /// Σ w over the unoccluded segments.
    pub(super) open: f64,
    /// The exchange area from the kernel at the points, Σ A_i A_j w_p w_s k_ps in m².
    pub(super) by_kernel: f64,
    all_squared: f64,
    open_squared: f64,
    /// Σ_p (Σ_s w_ps)² over the points of the patch where it is larger; 0 where no ends are shared.
    by_point_squared: f64,
    n_rays: u64,
    n_open: u64,
}

/// The visible fraction of a pair, weighted by the kernel, and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VisibleFraction {
    pub(super) fraction: f64,
    pub(super) error: f64,
}

impl VisibleFraction {
    /// Adds to the error the unknown part of an exchange area that the kernel at the points misses, `by_kernel` instead of `exact`.
    ///
    /// error² + u² / 3 with u = 1 − `by_kernel` / `exact`: no ray stands for the part u, as where patches are nearer to each other than the points of one of them.
    /// Fractions that are known without rays stay without an error.
    pub(super) fn beside(self, by_kernel: f64, exact: f64) -> Self {
        if self.error <= 0.0 || by_kernel >= exact {
            return self;
        }
        let missed = 1.0 - by_kernel / exact;
        let most = self.fraction.max(1.0 - self.fraction);
        let error = (self.error * self.error + missed * missed * unseen_square(0.0)).sqrt();
        Self {
            error: error.min(most),
            ..self
        }
    }
}

impl PairSums {
    /// Returns v = Σ w V / Σ w and its error.
    ///
    /// error² = Σ w² (V − v)² / (Σ w)² + 2 / ((N + 2)(N + 3)), with N = (Σ w)² / Σ w² the number of equal rays. The first term is the variance of a
    /// ratio of sums; the second is the uncertainty where all rays agree, the mean square of a fraction that N rays
    /// miss if all fractions are equally likely beforehand (Laplace's rule of succession). With [shared ends](Independence::SharedEnds) the number of equal points to the power
    /// of 5/4 stands for N in both terms.
    /// Pairs without a ray may have any fraction.
    fn visible(&self, independence: Independence) -> VisibleFraction {
        if self.all <= 0.0 {
            let (fraction, error) = (0.5, 0.5);
            return VisibleFraction { fraction, error };
        }
        let fraction = self.open / self.all;
        let n = self.all * self.all / self.all_squared;
        let n_points = self.all * self.all / self.by_point_squared;
        let (effective, unseen) = match independence {
            Independence::Net => (n.powf(1.25), n.powf(1.125)),
            Independence::SharedEnds => (n_points.powf(1.25).min(n), n_points.powf(1.25).min(n)),
            Independence::SharedStrata => (n_points.powf(1.75).min(n), n_points.powf(1.5).min(n)),
        };
        let scatter = self.open_squared * (1.0 - 2.0 * fraction) + self.all_squared * fraction * fraction;
        let variance = scatter.max(0.0) / (self.all * self.all) * (n / effective);
        let error = (variance + unseen_square(unseen)).sqrt();
        VisibleFraction { fraction, error }
    }
}

/// The segments of one row of pairs: collected, traced in batches, and summed pair by pair.
pub(super) struct Segments<'a> {
    input: Input<'a>,
    known: &'a Sights<'a>,
    sights: Vec<Sight>,
    independence: Independence,
    rays: RayBatch,
    owners: Vec<usize>,
    weights: Vec<f64>,
    blocked: Vec<bool>,
    sums: Vec<PairSums>,
    counts: PairCounts,
    /// Weights of the segments from one point, and of those to each point of the other patch.
    from_point: Vec<f64>,
    to_point: Vec<f64>,
}

impl<'a> Segments<'a> {
    pub(super) fn new(input: Input<'a>, known: &'a Sights<'a>, independence: Independence) -> Self {
        Self {
            input,
            known,
            sights: Vec::new(),
            independence,
            rays: RayBatch::default(),
            owners: Vec::new(),
            weights: Vec::new(),
            blocked: Vec::new(),
            sums: Vec::new(),
            counts: PairCounts::default(),
            from_point: Vec::new(),
            to_point: Vec::new(),
        }
    }

    /// Returns whether the visible fraction of the pair numbered `owner` is known: then no segment is traced.
    pub(super) fn is_known(&self, owner: usize) -> bool {
        self.sights[owner] != Sight::Unknown
    }

    /// Returns whether the pair numbered `owner` has a segment with a weight.
    pub(super) fn has_segment(&self, owner: usize) -> bool {
        self.sums[owner].all > 0.0
    }

    /// Forgets the last row and makes room for the next: patch `i` with each of `others`.
    pub(super) fn begin(&mut self, i: usize, others: &[usize]) {
        self.known.row(i, others, &mut self.sights);
        self.sums.clear();
        self.sums.resize(others.len(), PairSums::default());
    }

    /// Adds a segment from a point of patch i to a point of patch j, in m, with its weight, to the pair numbered `owner` in this row.
    pub(super) fn add(&mut self, owner: usize, (i, x): (usize, DVec3), (j, y): (usize, DVec3), weight: f64) {
        let sums = &mut self.sums[owner];
        sums.all += weight;
        match self.sights[owner] {
            Sight::Whole => sums.open += weight,
            Sight::Hidden => {}
            Sight::Unknown => self.push(owner, (i, x), (j, y), weight),
        }
    }

    /// Adds the segments from every point of patch i to every point of patch j to the pair numbered `owner`.
    ///
    /// `weigh` appends the exchange areas by the kernel, in m², of the segments from a point of i to all those of j, and returns the factor from these to
    /// their weights; those without a weight are left out.
    pub(super) fn join(
        &mut self,
        owner: usize,
        (i, from): (usize, &[WeightedPoint]),
        (j, to): (usize, &[WeightedPoint]),
        weigh: impl Fn(&WeightedPoint, &mut Vec<f64>) -> f64,
    ) {
        let mut weights = std::mem::take(&mut self.from_point);
        let mut to_point = std::mem::take(&mut self.to_point);
        to_point.clear();
        to_point.resize(to.len(), 0.0);
        let mut from_squared = 0.0;
        for x in from {
            weights.clear();
            let scale = weigh(x, &mut weights);
            let (mut by_kernel, mut from_point) = (0.0, 0.0);
            for ((y, &by_segment), sum) in to.iter().zip(&weights).zip(&mut to_point) {
                by_kernel += by_segment;
                let weight = scale * by_segment;
                if weight > 0.0 {
                    from_point += weight;
                    *sum += weight;
                    self.add(owner, (i, x.position), (j, y.position), weight);
                }
            }
            self.sums[owner].by_kernel += by_kernel;
            from_squared += from_point * from_point;
        }
        let to_squared: f64 = to_point.iter().map(|weight| weight * weight).sum();
        self.sums[owner].by_point_squared = to_squared.max(from_squared);
        (self.from_point, self.to_point) = (weights, to_point);
    }

    fn push(&mut self, owner: usize, (i, x): (usize, DVec3), (j, y): (usize, DVec3), weight: f64) {
        self.sums[owner].all_squared += weight * weight;
        let visibility = self.input.visibility;
        let patches = &self.input.mesh.patches;
        let lift = |k: usize, point: DVec3| point + patches[k].normal * visibility.offset() - visibility.frame_origin();
        self.rays.push_segment(lift(i, x), lift(j, y));
        self.owners.push(owner);
        self.weights.push(weight);
        if self.rays.len() == BATCH {
            self.trace();
        }
    }

    fn trace(&mut self) {
        let visibility = self.input.visibility;
        visibility.occluded(&self.rays, Coherence::Coherent, &mut self.blocked);
        for ((&owner, &weight), &blocked) in self.owners.iter().zip(&self.weights).zip(&self.blocked) {
            let sums = &mut self.sums[owner];
            sums.n_rays += 1;
            if !blocked {
                sums.n_open += 1;
                sums.open += weight;
                sums.open_squared += weight * weight;
            }
        }
        self.rays.clear();
        self.owners.clear();
        self.weights.clear();
    }

    /// Traces the remaining segments of the row.
    pub(super) fn finish(&mut self) {
        if !self.rays.is_empty() {
            self.trace();
        }
    }

    /// Returns the sums of a pair of the finished row and its visible fraction, and counts the pair.
    pub(super) fn result(&mut self, owner: usize) -> (PairSums, VisibleFraction) {
        let sums = self.sums[owner];
        let fraction = match self.sights[owner] {
            Sight::Whole => Some(1.0),
            Sight::Hidden => Some(0.0),
            Sight::Unknown => None,
        };
        if let Some(fraction) = fraction {
            let n = if fraction > 0.0 {
                &mut self.counts.full
            } else {
                &mut self.counts.hidden
            };
            *n += 1;
            return (sums, VisibleFraction { fraction, error: 0.0 });
        }
        self.counts.n_rays += sums.n_rays;
        if sums.n_rays == 0 || (sums.n_open > 0 && sums.n_open < sums.n_rays) {
            self.counts.partial += 1;
        } else if sums.n_open > 0 {
            self.counts.full += 1;
        } else {
            self.counts.hidden += 1;
        }
        (sums, sums.visible(self.independence))
    }

    pub(super) fn counts(&self) -> PairCounts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of rays of weight 1, of which the first `n_open` are open, between as many points on both patches.
    fn equal(n_rays: u32, n_open: u32) -> PairSums {
        PairSums {
            all: f64::from(n_rays),
            open: f64::from(n_open),
            by_kernel: f64::from(n_rays),
            by_point_squared: f64::from(n_rays).powf(1.5),
            all_squared: f64::from(n_rays),
            open_squared: f64::from(n_open),
            n_rays: n_rays.into(),
            n_open: n_open.into(),
        }
    }

    /// The square of what 64 rays of a net may all miss: as 107.6 independent ones.
    fn unseen_by_64() -> f64 {
        2.0 / (109.634_741_152_475 * 110.634_741_152_475)
    }

    #[test]
    fn equal_rays_err_like_a_binomial_fraction_of_more() {
        let visible = equal(64, 16).visible(Independence::Net);
        assert!((visible.fraction - 0.25).abs() < 1e-15);
        let expected = (0.25_f64 * 0.75 / 64_f64.powf(1.25) + unseen_by_64()).sqrt();
        assert!((visible.error - expected).abs() < 1e-12);
        // 16 points on each of both patches count as 32 independent rays.
        let shared = equal(256, 64).visible(Independence::SharedEnds);
        let of_32 = (0.25 * 0.75 / 32.0 + 2.0 / (34.0 * 35.0_f64)).sqrt();
        assert!((shared.error - of_32).abs() < 1e-15);
    }

    #[test]
    fn rays_to_one_point_tell_no_more_than_one() {
        // 16 points joined with one, or with several of which one has nearly all the weight.
        let to_one = PairSums {
            by_point_squared: 256.0,
            ..equal(16, 16)
        };
        let visible = to_one.visible(Independence::SharedEnds);
        assert!((visible.error - (2.0 / 12.0_f64).sqrt()).abs() < 1e-15, "{visible:?}");
        // Each point joined with a single one of its own: no more than there are rays.
        let paired = PairSums {
            by_point_squared: 16.0,
            ..equal(16, 4)
        };
        let shared = paired.visible(Independence::SharedEnds).error;
        let independent = (0.25 * 0.75 / 16.0 + 2.0 / (18.0 * 19.0_f64)).sqrt();
        assert!((shared - independent).abs() < 1e-15, "{shared} {independent}");
    }

    #[test]
    fn what_no_point_stands_for_may_be_anything() {
        let visible = equal(64, 64).visible(Independence::Net);
        assert_eq!(visible.beside(2.0, 1.0), visible);
        // Three quarters of the exchange have no ray.
        let expected = (unseen_by_64() + 0.75 * 0.75 / 3.0).sqrt();
        assert!((visible.beside(0.25, 1.0).error - expected).abs() < 1e-12);
        let half = equal(4, 2).visible(Independence::Net);
        assert!(half.beside(0.0, 1.0).error <= 0.5);
        let known = VisibleFraction {
            fraction: 1.0,
            error: 0.0,
        };
        assert_eq!(known.beside(0.0, 1.0), known);
    }

    #[test]
    fn rays_that_agree_leave_a_doubt_and_no_rays_leave_all() {
        for n_open in [0, 64] {
            let visible = equal(64, n_open).visible(Independence::Net);
            assert!((visible.fraction - f64::from(n_open) / 64.0).abs() < 1e-15);
            assert!((visible.error - unseen_by_64().sqrt()).abs() < 1e-12);
        }
        let unknown = PairSums::default().visible(Independence::Net);
        assert!((unknown.fraction - 0.5).abs() < 1e-15 && (unknown.error - 0.5).abs() < 1e-15);
    }

    #[test]
    fn the_kernel_is_that_of_facing_points_and_zero_behind() {
        let up = (DVec3::ZERO, DVec3::Z);
        let down = |z: f64| (DVec3::new(0.0, 0.0, z), -DVec3::Z);
        assert!((kernel(up, down(2.0)) - 1.0 / (4.0 * PI)).abs() < 1e-16);
        assert!(kernel(up, down(-2.0)).abs() < 1e-300);
        assert!(kernel(up, (DVec3::Z, DVec3::Z)).abs() < 1e-300);
        // cos 45° at both ends of a segment of length √2.
        let across = (DVec3::new(1.0, 0.0, 1.0), -DVec3::X);
        assert!((kernel(up, across) - 0.25 / PI).abs() < 1e-16);
    }
}
