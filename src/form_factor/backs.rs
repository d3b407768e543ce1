//! The fraction of the light of each patch that back faces absorb.

mod candidates;
mod lying;

use glam::DVec3;

use super::Input;
use super::exact::Split;
use super::fraction::Fraction;
use super::partial::Whole;
use super::probe::Probe;
use super::sight::whole_where_grazing;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};
use crate::mesh::PatchId;
use crate::progress::Silent;
use crate::threads;
use crate::visibility::occluders::{OccluderId, OccluderIndex, PairVisibility};
use candidates::{Candidates, Seeing};
pub(super) use candidates::{Outline, Sheets, places_of_patches};
pub(super) use lying::shares_on_faces;

/// The most pairs of patches and back faces that are listed, for all patches together; rays do the rest.
const MAX_PAIRS: usize = 1 << 18;

/// The most work on the partially visible pairs of one patch, and of all, in squared counts of occluders; rays do the rest.
const MAX_WORK: usize = 1 << 11;
const MAX_WORK_IN_ALL: usize = 1 << 18;

/// The error of the exchange area of a partly hidden pair, as a part of the smaller area, and the evaluations after which it is left as it is.
const TOLERANCE: f64 = 1e-5;
const BUDGET: usize = 20_000;

/// The exchange area that rounding leaves of a hidden pair, as a part of the smaller area.
const NOISE: f64 = 1e-15;

/// Rays that take the place of pairs, for all patches together, and the least and the most for each.
const RAYS: usize = 1 << 24;
const MIN_RAYS: usize = 256;
const MAX_RAYS: usize = 1 << 18;

/// Returns the fraction of the light of each patch that back faces absorb, \[n\]; 0 for patches that are not `wanted`.
///
/// With `n_rays`, so many rays are counted from each patch that may see back faces. Without it, pairs of patches and back faces are computed where that is little work for a patch; elsewhere rays are counted.
pub(super) fn back_factors(input: Input<'_>, wanted: &[bool], n_rays: Option<usize>) -> Vec<Fraction> {
    let n = input.mesh.n_patches();
    let mut found = vec![Fraction::default(); n];
    if input.unoccluded || !wanted.contains(&true) {
        return found;
    }
    // Rays need no list of pairs.
    let candidates = Candidates::of(input, wanted, if n_rays.is_some() { 0 } else { MAX_PAIRS });
    let views = candidates.views.iter();
    let open: Vec<(usize, &Seeing)> = views
        .flat_map(|view| view.patches.iter().map(move |&patch| (patch, view)))
        .collect();
    if open.is_empty() {
        return found;
    }
    let computed: Vec<Option<Fraction>> = if n_rays.is_some() {
        vec![None; open.len()]
    } else {
        let pairs = Pairs {
            input,
            index: OccluderIndex::new(input.scene),
            n_patches: open.len(),
        };
        threads::collect_from(&open, |&(patch, view)| pairs.factor(patch, candidates.parts(view)?))
    };
    let n_left = computed.iter().filter(|fraction| fraction.is_none()).count();
    let n_rays = n_rays.unwrap_or(RAYS / n_left.max(1)).clamp(MIN_RAYS, MAX_RAYS);
    let fractions: Vec<Fraction> = threads::collect_with(open.len(), Probe::buffers, |buffers, k| {
        computed[k].unwrap_or_else(|| counted(&Probe::shoot(input, open[k].0, n_rays, buffers)))
    });
    for ((patch, _), fraction) in open.into_iter().zip(fractions) {
        found[patch] = fraction;
    }
    found
}

/// Returns the fraction of rays that met back faces.
fn counted(probe: &Probe) -> Fraction {
    let n = probe.n_rays as f64;
    // Laplace's rule: no count proves that there is nothing.
    let p = (probe.n_absorbed as f64 + 1.0) / (n + 2.0);
    Fraction {
        value: probe.n_absorbed as f64 / n,
        common: 0.0,
        variance: p * (1.0 - p) / n,
    }
}

/// A patch and a back face, with their occluders.
struct Pair<'a> {
    patch: usize,
    back: &'a [DVec3],
    most: f64,
    error: f64,
    among: Vec<OccluderId>,
    touched: bool,
}

/// Exchange areas of patches and back faces.
struct Pairs<'a> {
    input: Input<'a>,
    index: OccluderIndex,
    /// The number of patches that share the work.
    n_patches: usize,
}

impl Pairs<'_> {
    /// Returns the form factor from a patch to back faces; `None` if that is more work than its share.
    fn factor<'b>(&self, patch: usize, backs: impl Iterator<Item = &'b [DVec3]>) -> Option<Fraction> {
        let corners = self.input.mesh.polygon(PatchId::from_index(patch));
        let mut work = 0;
        let mut pairs = Vec::new();
        for pair in backs.filter_map(|back| self.looked_at(patch, &corners, back)) {
            work += self.index.count(&pair.among).pow(2);
            if work > MAX_WORK.min(MAX_WORK_IN_ALL / self.n_patches) {
                return None;
            }
            pairs.push(pair);
        }
        let area = self.input.mesh.patches[patch].area;
        let (mut value, mut error) = (0.0, 0.0);
        for pair in &pairs {
            let (own, own_error) = self.exchange(pair);
            value += own;
            error += own_error;
        }
        Some(Fraction {
            value: (value / area).clamp(0.0, 1.0),
            common: error / area,
            variance: 0.0,
        })
    }

    /// Classifies a pair; `None` if it exchanges nothing.
    fn looked_at<'b>(&self, patch: usize, corners: &[DVec3], back: &'b [DVec3]) -> Option<Pair<'b>> {
        let [own, other] = [corners, back].map(PreparedPolygon::new);
        let tolerance = Tolerance { rel: 1e-9, abs: 0.0 };
        let most = exchange_area(&own, &other, tolerance);
        if most.value <= 0.0 {
            return None;
        }
        let found = self.index.between(corners, back);
        let among = match whole_where_grazing(&self.index, found.visibility, corners, back) {
            PairVisibility::None => return None,
            PairVisibility::Full => Vec::new(),
            PairVisibility::Partial(among) => among,
        };
        Some(Pair {
            patch,
            back,
            most: most.value,
            error: most.error,
            among,
            touched: found.touched,
        })
    }

    /// Returns the exchange area of a pair and its error, m².
    fn exchange(&self, pair: &Pair<'_>) -> (f64, f64) {
        let corners = self.input.mesh.polygon(PatchId::from_index(pair.patch));
        let area = |polygon: &[DVec3]| polygon::area_vector(polygon).length();
        // Light that passes the border within the rounding of corners may be hidden: at most all light that leaves a strip of that width.
        let rounding = if pair.touched || !pair.among.is_empty() {
            (2.0 * self.index.slack() * (polygon::perimeter(&corners) + polygon::perimeter(pair.back))).min(pair.most)
        } else {
            0.0
        };
        if pair.among.is_empty() {
            return (pair.most, pair.error + rounding);
        }
        let split = Split {
            index: &self.index,
            budget: BUDGET,
            relative: f64::INFINITY,
            unlike_of_few: 1.0,
            progress: &Silent,
        };
        let goal = TOLERANCE * area(&corners).min(area(pair.back));
        let without = Whole {
            area: pair.most,
            error: pair.error,
        };
        let found = split.exchange_area(&corners, pair.back, &pair.among, goal, without);
        let is_noise = found.exchange_area <= NOISE * area(&corners).min(area(pair.back));
        let value = if is_noise {
            0.0
        } else {
            found.exchange_area.min(pair.most)
        };
        (value, (found.error + rounding).min(pair.most + pair.error))
    }
}
