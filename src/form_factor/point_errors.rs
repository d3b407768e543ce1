//! Errors of methods that sample a few points of a patch: the visibility of the points against that of the patch.

use super::Input;
use super::facing::{self, Facing};
use super::segments::unseen_square;
use super::sight::{Sight, Sights};
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};
use crate::geometry::quadrature::WeightedPoint;

/// A form factor from points of patch i, and the number of their rays that hit j.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    pub(super) factor: f64,
    pub(super) n_rays: u64,
}

/// Estimates the errors of rows that a few points of a patch stand for.
///
/// Without an occluder the closed form gives the error, to two digits. Where something may occlude, n points of the patch show little of the border of a shadow on it: even where all of them agree,
/// sqrt(2/((n + 2)(n + 3))) of the form factor is unknown, 0.41 from one point, however many
/// rays each of them shoots; where they see a fraction v, sqrt(v(1 − v)/n) is added. Patches that are certainly hidden from each other have their value as the error.
pub(super) struct PointErrors<'a> {
    input: Input<'a>,
    sights: Sights<'a>,
    facing: Facing,
    polygons: Vec<PreparedPolygon>,
}

impl<'a> PointErrors<'a> {
    pub(super) fn new(input: Input<'a>) -> Self {
        Self {
            input,
            sights: Sights::new(input),
            facing: Facing::new(input.mesh),
            polygons: facing::prepared(input.mesh),
        }
    }

    /// Returns an error for every entry of row i, as its points found them; work: n closed forms, and as many searches for occluders.
    pub(super) fn of_row(&self, i: usize, points: &[WeightedPoint], found: &[Found]) -> Vec<f64> {
        // An entry where nothing can be exchanged is all error.
        let mut errors: Vec<f64> = found.iter().map(|f| f.factor).collect();
        let others: Vec<usize> = (0..found.len()).filter(|&j| j != i && self.facing.pair(i, j)).collect();
        let mut sights = Vec::with_capacity(others.len());
        self.sights.row(i, &others, &mut sights);
        for (&j, &sight) in others.iter().zip(&sights) {
            if sight != Sight::Hidden {
                errors[j] = self.of_pair((i, j), points, found[j], sight);
            }
        }
        errors
    }

    fn of_pair(&self, (i, j): (usize, usize), points: &[WeightedPoint], found: Found, sight: Sight) -> f64 {
        let patch = &self.input.mesh.patches[i];
        let tolerance = Tolerance { rel: 1e-2, abs: 0.0 };
        let exact = exchange_area(&self.polygons[i], &self.polygons[j], tolerance);
        let (whole, whole_error) = (exact.value.max(0.0) / patch.area, exact.error / patch.area);
        // With a margin for errors that are stored in f32.
        let from_whole = 1.01 * (found.factor - whole).abs() + whole_error;
        if sight == Sight::Whole {
            return from_whole;
        }
        let corners = self.polygons[j].corners();
        let of_point = |p: &WeightedPoint| p.weight * point_form_factor(p.position, patch.normal, corners);
        let seen: f64 = points.iter().map(of_point).sum();
        let visible = if seen > 0.0 {
            (found.factor / seen).min(1.0)
        } else {
            0.0
        };
        let aliasing = (found.n_rays.max(1) as f64).sqrt().recip();
        let n_points = points.len() as f64;
        let unseen = unseen_square(n_points);
        if found.n_rays > 0 && 1.0 - visible <= aliasing {
            return from_whole + unseen.sqrt() * whole;
        }
        let shadow = (visible * (1.0 - visible) / n_points + unseen).sqrt();
        (seen - whole).abs() + whole_error + aliasing * found.factor + shadow * whole
    }
}
