//! A Gauss rule over one polygon of the exact form factor to the other.

use glam::DVec3;

use super::facing::FacingPair;
use super::gauss_product::square_rule;
use super::prepared::PreparedPolygon;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon::distance_from_edges;

/// The part of smaller radius, which the Gauss points lie on, and the corners of the other one.
pub(super) struct Outer<'a> {
    polygon: &'a PreparedPolygon,
    /// From the other polygon's first corner to this one's.
    shift: DVec3,
    /// The other's corners, from its first one.
    target: Vec<DVec3>,
}

impl<'a> Outer<'a> {
    pub(super) fn new(pair: &'a FacingPair) -> Self {
        let (first, second) = (&*pair.first.polygon, &*pair.second.polygon);
        let (polygon, other, shift) = if first.radius() <= second.radius() {
            (first, second, -pair.shift)
        } else {
            (second, first, pair.shift)
        };
        let origin = other.exact_corner(0);
        Self {
            polygon,
            shift,
            target: (0..other.n_corners())
                .map(|k| other.exact_corner(k).minus(origin).to_f64())
                .collect(),
        }
    }

    pub(super) fn area(&self) -> f64 {
        self.polygon.area()
    }

    pub(super) fn n_points(&self, order: usize) -> usize {
        order * order * self.polygon.pieces().len()
    }

    /// Returns the distance of the polygon's middle from the other's edges, in radii of the polygon.
    pub(super) fn distance_in_radii(&self) -> f64 {
        let centre = self.shift + self.polygon.centre();
        distance_from_edges(centre, &self.target) / self.polygon.radius()
    }

    /// Returns the form factor from the polygon's middle.
    pub(super) fn middle_factor(&self) -> f64 {
        let middle = self.shift + self.polygon.centre();
        point_form_factor(middle, self.polygon.normal(), &self.target)
    }

    /// Returns Σ w_i F(x_i → other part) over the Gauss points.
    pub(super) fn lambert_sum(&self, order: usize) -> f64 {
        let rule = square_rule(order);
        let mut sum = 0.0;
        for piece in self.polygon.pieces() {
            let [element, element_s, element_t] = piece.elements;
            for (k, weight) in rule.weight.iter().enumerate() {
                let mut point = self.shift;
                for (shares, corner) in rule.shares.iter().zip(piece.offsets) {
                    point += shares[k] * corner;
                }
                let element = element + rule.s[k] * (element_s - element) + rule.t[k] * (element_t - element);
                sum += weight * element * point_form_factor(point, self.polygon.normal(), &self.target);
            }
        }
        sum
    }
}
