//! Rays between points of pairs of patches, and what they tell about how much of a pair is visible.
//!
//! Pairs that are known to be whole or hidden ([`Sights`]) need none: their visible fraction is 1 or 0 without an error.

use std::f64::consts::PI;

use glam::DVec3;

use super::sight::{Sight, Sights};
use super::{Input, PairCounts};
use crate::visibility::{Coherence, RayBatch};

/// Rays that are traced at once: enough to hide the call, few enough to stay in the first cache.
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

/// How much the rays of a pair have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Independence {
    /// Each ray has ends of its own.
    Independent,
    /// Every point of one patch is joined with every point of the other: N rays tell as much as N^(3/4) independent ones,
    /// because the border of a shadow that runs along the points' rows is met by whole rows at once.
    SharedEnds,
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
    /// Σ w over the segments that nothing blocks.
    pub(super) open: f64,
    /// What takes part without a segment of its own, in m²: visible like the rest of the pair.
    pub(super) untraced: f64,
    all_squared: f64,
    open_squared: f64,
    n_rays: u64,
    n_open: u64,
}

/// The visible fraction of a pair, weighted by the kernel, and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VisibleFraction {
    pub(super) fraction: f64,
    pub(super) error: f64,
}

impl PairSums {
    /// Returns v = Σ w V / Σ w and its error.
    ///
    /// error² = Σ w² (V − v)² / (Σ w)² + 2 / ((N + 2)(N + 3)), with N = (Σ w)² / Σ w² the number of equal rays. The first term is the variance of a
    /// ratio of sums; the second is what remains unknown where all rays agree, the mean square of a fraction that N rays
    /// miss if all fractions are equally likely beforehand (Laplace's rule of succession). With shared ends N^(3/4) stands for N in both terms.
    /// Pairs without a ray may be anything.
    fn visible(&self, independence: Independence) -> VisibleFraction {
        if self.all <= 0.0 {
            let (fraction, error) = (0.5, 0.5);
            return VisibleFraction { fraction, error };
        }
        let fraction = self.open / self.all;
        let n = self.all * self.all / self.all_squared;
        let effective = match independence {
            Independence::Independent => n,
            Independence::SharedEnds => n.powf(0.75),
        };
        let scatter = self.open_squared * (1.0 - 2.0 * fraction) + self.all_squared * fraction * fraction;
        let variance = scatter.max(0.0) / (self.all * self.all) * (n / effective);
        let error = (variance + unseen_square(effective)).sqrt();
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
        }
    }

    /// Returns whether it is known how much of the pair numbered `owner` is visible: no segment is then traced.
    pub(super) fn is_known(&self, owner: usize) -> bool {
        self.sights[owner] != Sight::Unknown
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

    /// Adds a part of a pair that no segment stands for, in m².
    pub(super) fn add_untraced(&mut self, owner: usize, area: f64) {
        self.sums[owner].untraced += area;
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

    /// Traces what is left of the row.
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

    /// Sums of rays of weight 1, of which the first `n_open` are open.
    fn equal(n_rays: u32, n_open: u32) -> PairSums {
        PairSums {
            all: f64::from(n_rays),
            open: f64::from(n_open),
            untraced: 0.0,
            all_squared: f64::from(n_rays),
            open_squared: f64::from(n_open),
            n_rays: n_rays.into(),
            n_open: n_open.into(),
        }
    }

    #[test]
    fn equal_rays_err_like_a_binomial_fraction() {
        let visible = equal(64, 16).visible(Independence::Independent);
        assert!((visible.fraction - 0.25).abs() < 1e-15);
        let expected = (0.25_f64 * 0.75 / 64.0 + 2.0 / (66.0 * 67.0)).sqrt();
        assert!((visible.error - expected).abs() < 1e-15);
        // 81 rays with shared ends count as 27.
        let shared = equal(81, 27).visible(Independence::SharedEnds);
        let of_27 = (2.0 / 9.0 / 27.0 + 2.0 / (29.0 * 30.0_f64)).sqrt();
        assert!((shared.error - of_27).abs() < 1e-15);
    }

    #[test]
    fn rays_that_agree_leave_a_doubt_and_no_rays_leave_all() {
        for n_open in [0, 64] {
            let visible = equal(64, n_open).visible(Independence::Independent);
            assert!((visible.fraction - f64::from(n_open) / 64.0).abs() < 1e-15);
            assert!((visible.error - (2.0 / (66.0 * 67.0_f64)).sqrt()).abs() < 1e-15);
        }
        let unknown = PairSums::default().visible(Independence::Independent);
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
