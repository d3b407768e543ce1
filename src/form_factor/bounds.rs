//! What form factors may be that no ray has hit, from the shapes of two patches.

use std::num::NonZeroUsize;
use std::sync::{Arc, OnceLock};

use super::pairs::Facing;
use super::segments::unseen_square;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};
use crate::geometry::quadrature::GaussProduct;
use crate::matrix::UpperBounds;
use crate::mesh::Mesh;

/// Form factors without occluders, to two digits and not below: computed when they are asked for.
#[derive(Debug)]
struct Unoccluded {
    facing: Facing,
    polygons: OnceLock<Vec<PreparedPolygon>>,
    points: Option<NonZeroUsize>,
    /// The points that all rays of a patch start from; `None` if they start anywhere on it.
    rule: Option<GaussProduct>,
}

/// Returns the bounds of a mesh, for rays from q × q Gauss points of each patch if `points` is q.
pub(crate) fn upper_bounds(mesh: &Mesh, points: Option<NonZeroUsize>) -> Arc<dyn UpperBounds> {
    Arc::new(Unoccluded {
        facing: Facing::new(mesh),
        polygons: OnceLock::new(),
        points,
        rule: points.map(GaussProduct::new),
    })
}

impl UpperBounds for Unoccluded {
    fn are_facing(&self, i: usize, j: usize) -> bool {
        self.facing.pair(i, j)
    }

    /// The factor without occluders, or less by the count. Points that see nothing of j leave open what they see too little of without occluders, and the part of the patch
    /// that as many independent ones miss.
    fn missed(&self, i: usize, j: usize, by_count: f64) -> f64 {
        let polygons = self.polygons.get_or_init(|| self.facing.polygons());
        let tolerance = Tolerance { rel: 1e-2, abs: 0.0 };
        let exact = exchange_area(&polygons[i], &polygons[j], tolerance);
        let most = (exact.value.max(0.0) + exact.error).min(polygons[j].area()) / polygons[i].area();
        // Not below it after rounding to f32, as errors are stored, either.
        let most = (most * (1.0 + 1e-6)).clamp(f64::from(f32::MIN_POSITIVE), 1.0);
        let by_points = self.rule.as_ref().map_or(0.0, |rule| {
            let (normal, corners) = (self.facing.normal(i), polygons[j].corners());
            let points = rule.on_polygon(polygons[i].corners());
            let seen: f64 = points
                .iter()
                .map(|point| point.weight * point_form_factor(point.position, normal, corners))
                .sum();
            (most - seen).abs() + unseen_square(points.len() as f64).sqrt() * most
        });
        most.min(by_count + by_points)
    }

    fn points(&self) -> Option<NonZeroUsize> {
        self.points
    }
}
