//! The fractions of each patch's light that escape, and that back faces absorb.

use super::backs::{back_factors, shares_on_faces};
use super::fraction::Fraction;
use super::{Enclosed, Input, Reciprocity};
use crate::matrix::{FormFactors, RowTally};
use crate::mesh::Mesh;
use crate::threads;

/// The fractions of the light of patches, or of surfaces, that front faces receive, that escapes, and that back faces absorb.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkyFactors {
    /// The fraction that escapes.
    pub sky: Vec<Fraction>,
    /// The fraction that black back faces absorb.
    pub back: Vec<Fraction>,
    /// The fraction that front faces receive: Σ_j F_ij, the row sum.
    pub received: Vec<Fraction>,
}

/// Returns the fractions of each patch's light that escape, that back faces absorb and that fronts receive, \[n\].
///
/// These are the sky factor, the back factor and the sum of its row: sky = 1 − Σ_j F_ij − back.
/// In a scene that is closed for certain nothing escapes, and back faces absorb the part missing from a row; where that was stated by the user, or faces miss each other by up to 1e-8 of their size,
/// the error has the difference of a row from 1. Rays that leave a patch all over are counted, where the
/// method has such ([`Reciprocity::ToNoise`]). Otherwise back is 0 where faces hide all back faces, as the outsides of solids do, or the sum of the form factors to the backs of the faces that may be seen from
/// behind, each computed like one between two fronts, to 1e-5. For patches that see backs past many faces it is the share of rays that meet them: 2^18 rays from each, or 2^24 in all; where
/// the method shoots rays from a rule's points, as many as it shoots.
/// Where a patch of a closed piece lies on a face of an open one, as the bottom of a block on a ground, nothing escapes: that light counts as absorbed by backs.
///
/// Errors: of counted rays sqrt(p (1 − p) / N), with p = (N f + 1) / (N + 2) of a fraction f of N rays; otherwise the sum of the errors of the row's entries (of rays from a rule's points: beyond
/// their noise, and that of the row), and that of back. They are zero where nothing can be seen. The error of a row's sum is the sum of its entries' errors, and its noise: errors of one row may have one sign.
///
/// Work: a pass over the rows, O(n log n), and where back faces may be seen the pairs of patches and faces at worst.
///
/// # Panics
/// If the mesh has not one patch for every row.
#[must_use]
#[track_caller]
pub fn sky_factors(
    input: Input<'_>,
    factors: &FormFactors,
    reciprocity: Reciprocity,
    enclosed: &Enclosed,
) -> SkyFactors {
    let tallies = factors.tallies();
    let n = input.mesh.n_patches();
    assert_eq!(n, tallies.len(), "one patch per row");
    let is_known = enclosed.closed && enclosed.certain;
    // Points that stand for a patch may miss the view from the rest of it.
    let counts = |tally: &RowTally| tally.n_rays > 0 && reciprocity == Reciprocity::ToNoise;
    let wanted: Vec<bool> = tallies.iter().map(|tally| !is_known && !counts(tally)).collect();
    let n_rays = tallies.iter().map(|tally| tally.n_rays).max().filter(|most| *most > 0);
    let n_rays = n_rays.map(|most| usize::try_from(most).unwrap_or(usize::MAX));
    let backs = back_factors(input, &wanted, n_rays);
    let lying = if is_known { vec![0.0; n] } else { shares_on_faces(input) };
    let sums = factors.numbers_of_rows(|i| {
        let mut sums = [0.0; 2];
        factors.for_each_in_row(i, |_, value, error| {
            sums[0] += value;
            sums[1] += factors.beyond_noise(i, value, error);
        });
        sums
    });
    let of_row = |i: usize| {
        let tally = &tallies[i];
        let counted = |value: Option<f64>| Fraction {
            value: value.unwrap_or(0.0),
            common: 0.0,
            variance: tally.variance_of(value.unwrap_or(0.0)),
        };
        let mut received = Fraction {
            value: sums[i][0],
            common: sums[i][1],
            variance: 0.0,
        };
        if tally.n_rays > 0 {
            received.variance = tally.variance_of(received.value);
        }
        let left_by = |back: Fraction| Fraction {
            value: (1.0 - received.value - back.value).clamp(0.0, 1.0),
            common: f64::min(received.common + back.common, 1.0),
            variance: received.variance + back.variance,
        };
        let nothing = Fraction::default();
        // The difference of a row from 1 may have escaped where that cannot be ruled out.
        let at_most = |missed: f64| Fraction {
            common: missed.min(enclosed.may_escape[i]),
            ..nothing
        };
        let missed = || {
            let left = left_by(nothing);
            at_most(left.value + left.error())
        };
        let (sky, back) = match (is_known, counts(tally)) {
            (true, _) if enclosed.rows[i] && enclosed.may_escape[i] > 0.0 => (missed(), missed()),
            (true, _) if enclosed.rows[i] => (nothing, nothing),
            (true, true) => (at_most(tally.escaped().unwrap_or(0.0)), counted(tally.absorbed())),
            (true, false) => {
                let (sky, back) = (missed(), left_by(nothing));
                let common = back.common + sky.common;
                (sky, Fraction { common, ..back })
            }
            (false, true) => held_back(counted(tally.escaped()), counted(tally.absorbed()), lying[i]),
            (false, false) => held_back(left_by(backs[i]), backs[i], lying[i]),
        };
        ((sky, back), received)
    };
    let ((sky, back), received) = threads::collect(n, of_row).into_iter().unzip();
    SkyFactors { sky, back, received }
}

/// Returns the fractions that escape and that backs absorb, where a share of the patch lies on a face.
fn held_back(sky: Fraction, back: Fraction, share: f64) -> (Fraction, Fraction) {
    let held = sky.share(share);
    let kept = Fraction {
        value: back.value + held.value,
        common: back.common + held.common,
        variance: back.variance + held.variance,
    };
    // The rest of the patch may lose more than its part lets out.
    let unequal = sky.value * share.min(1.0 - share);
    let free = sky.share(1.0 - share);
    let common = free.common + unequal;
    (Fraction { common, ..free }, kept)
}

impl SkyFactors {
    /// Returns the area means over each surface, \[n_surfaces\]; 0 for a surface without patches.
    #[must_use]
    pub fn of_surfaces(&self, mesh: &Mesh, n_surfaces: usize) -> Self {
        let mut areas = vec![0.0; n_surfaces];
        for patch in &mesh.patches {
            areas[patch.surface.0 as usize] += patch.area;
        }
        let means = |of_patches: &[Fraction]| {
            let mut means = vec![Fraction::default(); n_surfaces];
            for (patch, own) in mesh.patches.iter().zip(of_patches) {
                let k = patch.surface.0 as usize;
                let weight = patch.area / areas[k];
                means[k].value += weight * own.value;
                means[k].common += weight * own.common;
                means[k].variance += weight * weight * own.variance;
            }
            means
        };
        let fractions = |of_patches: &[Fraction]| {
            let mut means = means(of_patches);
            for mean in &mut means {
                // A sum of weights may be above 1 by rounding.
                mean.value = mean.value.min(1.0);
            }
            means
        };
        Self {
            sky: fractions(&self.sky),
            back: fractions(&self.back),
            received: means(&self.received),
        }
    }
}
