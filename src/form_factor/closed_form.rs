//! `closed-form`: rectangles with parallel edges, times the visible fraction.

use std::num::NonZeroUsize;

use super::contour::times_visible;
use super::entry::{MethodEntry, Work};
use super::facing;
use super::pairs::Exchange;
use super::settings::FIVE_POINTS;
use super::{ComputeResult, FormFactorError, FormFactorMethod, Input};
use crate::geometry::polygon_form_factor::PreparedPolygon;
use crate::geometry::rectangle::rectangle_exchange_area;
use crate::matrix::StorageChoice;
use crate::progress::Progress;

/// The closed form between rectangles with parallel edges, times the fraction of it that is visible.
///
/// Accuracy without occluders: 3e-15 of the squared diameter of the pair, absolute; see
/// [`rectangle_exchange_area`]. With occluders as [`ContourIntegral`](super::ContourIntegral), whose visible fraction this is.
/// A pair that faces each other and is not of this kind is a [`FormFactorError::NotApplicable`].
///
/// Source: as [`rectangle_exchange_area`]. Departures: the visible fraction.
#[derive(Clone, Copy, Debug)]
pub struct ClosedForm {
    /// q, the number of cells along each side of both patches.
    pub points: NonZeroUsize,
    /// The seed of the points in the cells.
    pub seed: u64,
}

/// The closed form's error in squared diameters of the pair.
const ACCURACY: f64 = 3e-15;

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "closed-form",
    summary: "Rectangles with parallel edges, times the visible fraction",
    settings: &[FIVE_POINTS],
    work: Work::Pairs,
    make: |s| {
        Some(Box::new(ClosedForm {
            points: s.points()?,
            seed: s.seed,
        }))
    },
};

impl FormFactorMethod for ClosedForm {
    fn name(&self) -> &'static str {
        "closed-form"
    }

    fn has_noisy_pairs(&self) -> bool {
        true
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let patches = &input.mesh.patches;
        let polygons = facing::prepared(input.mesh);
        let corners: Vec<&[glam::DVec3]> = polygons.iter().map(PreparedPolygon::corners).collect();
        let unoccluded = |[i, j]: [usize; 2]| {
            let Some(area) = rectangle_exchange_area(corners[i], corners[j]) else {
                return Err(self.not_applicable(input, [i, j], &corners));
            };
            let distance = patches[i].centroid.distance(patches[j].centroid);
            let diameter = distance + 2.0 * (polygons[i].radius() + polygons[j].radius());
            Ok(Exchange {
                area,
                error: ACCURACY * diameter * diameter,
            })
        };
        times_visible(self.points, self.seed, unoccluded, input, storage, progress)
    }
}

impl ClosedForm {
    /// Returns why two patches have no closed form: one is no rectangle, or their edges are not parallel.
    fn not_applicable(&self, input: Input<'_>, pair: [usize; 2], corners: &[&[glam::DVec3]]) -> FormFactorError {
        let name = |k: usize| {
            let surface = input.mesh.patches[k].surface;
            &input.scene.surfaces[surface.0 as usize].name
        };
        // A rectangle is parallel to itself.
        let odd = pair
            .into_iter()
            .find(|&k| rectangle_exchange_area(corners[k], corners[k]).is_none());
        let what = match (odd, pair) {
            (Some(k), _) => format!("surface `{}` has a patch that is not a rectangle", name(k)),
            (None, [i, j]) => format!(
                "edges of surfaces `{}` and `{}` are not parallel to each other",
                name(i),
                name(j)
            ),
        };
        FormFactorError::NotApplicable {
            method: self.name(),
            reason: format!("{what}; `contour` takes any polygons"),
        }
    }
}
