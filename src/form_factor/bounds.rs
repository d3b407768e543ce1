//! Form factors without occluders: bounds of entries that no ray has hit, and the errors of rules that rays start from.

use std::num::NonZeroUsize;
use std::sync::{Arc, OnceLock};

use super::facing::Facing;
use super::segments::unseen_square;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{self, PreparedPolygon, Tolerance, exchange_area};
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::matrix::UpperBounds;
use crate::mesh::Mesh;

/// Form factors without occluders, rounded up to two digits, and computed when first read.
#[derive(Debug)]
pub(crate) struct Unoccluded {
    facing: Facing,
    polygons: OnceLock<Vec<PreparedPolygon>>,
    points: Option<NonZeroUsize>,
    /// The points that all rays of a patch start from; `None` if they start anywhere on it.
    rule: Option<GaussProduct>,
}

/// Returns the bounds of a mesh, for rays from q × q Gauss points of each patch if `points` is q.
pub(crate) fn upper_bounds(mesh: &Mesh, points: Option<NonZeroUsize>) -> Arc<Unoccluded> {
    Arc::new(Unoccluded {
        facing: Facing::new(mesh),
        polygons: OnceLock::new(),
        points,
        rule: points.map(GaussProduct::new),
    })
}

impl Unoccluded {
    fn polygons(&self) -> &[PreparedPolygon] {
        self.polygons.get_or_init(|| self.facing.polygons())
    }

    /// Returns A_i F_ij without occluders.
    fn exchange(&self, i: usize, j: usize, rel: f64) -> polygon_form_factor::Exchange {
        let polygons = self.polygons();
        exchange_area(&polygons[i], &polygons[j], Tolerance { rel, abs: 0.0 })
    }

    /// Returns F_ij without occluders by a rule on patch i, Σ w F(point, j).
    fn by_rule(&self, i: usize, j: usize, points: &[WeightedPoint]) -> f64 {
        let (normal, corners) = (self.facing.normal(i), self.polygons()[j].corners());
        let of_point = |point: &WeightedPoint| point.weight * point_form_factor(point.position, normal, corners);
        points.iter().map(of_point).sum()
    }

    /// Returns the error of a rule on patch i in an entry that its rays found: its distance from F_ij without occluders, as far as the pair is visible.
    ///
    /// Work: none, and an error of 0, where the rule is good to 1e-3 of F_ij: i lies in front of j's plane, and j is farther away than 3 / q of the radius of i.
    pub(super) fn rule_error(&self, i: usize, j: usize, points: &[WeightedPoint], found: f64) -> f64 {
        let [own, other] = [i, j].map(|k| &self.polygons()[k]);
        let centre = own.corners()[0] + own.centre();
        let gap = polygon::distance(centre, other.corners()) - own.radius();
        let q = (points.len() as f64).sqrt();
        if gap > 3.0 / q * own.radius() && self.facing.is_in_front(j, i) {
            return 0.0;
        }
        let exact = self.exchange(i, j, 1e-3).value / own.area();
        let seen = self.by_rule(i, j, points);
        let visible = if found < seen { found / seen } else { 1.0 };
        visible * (exact - seen).abs()
    }
}

impl UpperBounds for Unoccluded {
    fn are_facing(&self, i: usize, j: usize) -> bool {
        self.facing.pair(i, j)
    }

    /// Returns the factor without occluders, or less by the count.
    ///
    /// Points that see too little of j leave open their own error without occluders, and the part of the patch that as many independent points miss.
    fn missed(&self, i: usize, j: usize, by_count: f64) -> f64 {
        let polygons = self.polygons();
        let exact = self.exchange(i, j, 1e-2);
        let most = (exact.value.max(0.0) + exact.error).min(polygons[j].area()) / polygons[i].area();
        // Not below it after rounding to f32 either, as errors are stored in f32.
        let most = (most * (1.0 + 1e-6)).clamp(f64::from(f32::MIN_POSITIVE), 1.0);
        let by_points = self.rule.as_ref().map_or(0.0, |rule| {
            let points = rule.on_polygon(polygons[i].corners());
            let seen = self.by_rule(i, j, &points);
            (most - seen).abs() + unseen_square(points.len() as f64).sqrt() * most
        });
        most.min(by_count + by_points)
    }

    fn points(&self) -> Option<NonZeroUsize> {
        self.points
    }
}
