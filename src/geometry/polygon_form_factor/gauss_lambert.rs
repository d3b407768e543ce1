//! A Gauss rule over one polygon of the exact form factor to the other.

use glam::DVec3;

use super::facing::{FacingPair, Part};
use super::gauss_product::square_rule;
use crate::geometry::point_form_factor::point_form_factor;

/// Returns Σ w_i F(x_i → other part) over the Gauss points of the part of smaller radius.
pub(super) fn lambert_sum(pair: &FacingPair, order: usize) -> f64 {
    let (near, far, shift) = outer_first(pair);
    let origin = far.polygon.exact_corner(0);
    let target: Vec<DVec3> = (0..far.polygon.n_corners())
        .map(|k| far.polygon.exact_corner(k).minus(origin).to_f64())
        .collect();
    let normal = near.polygon.normal();
    let mut sum = 0.0;
    let rule = square_rule(order);
    for piece in near.polygon.pieces() {
        let [element, element_s, element_t] = piece.elements;
        for (k, weight) in rule.weight.iter().enumerate() {
            let mut point = -shift;
            for (shares, corner) in rule.shares.iter().zip(piece.offsets) {
                point += shares[k] * corner;
            }
            let element = element + rule.s[k] * (element_s - element) + rule.t[k] * (element_t - element);
            sum += weight * element * point_form_factor(point, normal, &target);
        }
    }
    sum
}

/// Returns the part to integrate over, the other one, and the vector between their first corners.
fn outer_first<'a, 'b>(pair: &'b FacingPair<'a>) -> (&'b Part<'a>, &'b Part<'a>, DVec3) {
    if pair.first.polygon.radius() <= pair.second.polygon.radius() {
        (&pair.first, &pair.second, pair.shift)
    } else {
        (&pair.second, &pair.first, -pair.shift)
    }
}

/// Returns how far the outer polygon's middle is from the other's edges, in radii of the outer one, and the outer one's area.
pub(super) fn distance_in_radii(pair: &FacingPair) -> (f64, f64) {
    let (near, far, shift) = outer_first(pair);
    let centre = near.polygon.centre() - shift;
    let origin = far.polygon.exact_corner(0);
    let n = far.polygon.n_corners();
    let corner = |k: usize| far.polygon.exact_corner(k % n).minus(origin).to_f64() - centre;
    let distance = (0..n)
        .map(|k| {
            let (a, edge) = (corner(k), corner(k + 1) - corner(k));
            let t = (-a.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            (a + t * edge).length()
        })
        .fold(f64::INFINITY, f64::min); // ignores NaN, from edges of no length
    (distance / near.polygon.radius(), near.polygon.area())
}
