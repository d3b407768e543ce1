//! The exchange area as a double integral around the two contours.

use std::f64::consts::TAU;

use super::edge_pair::{Edge, logarithm_integral};
use super::facing::FacingPair;
use super::prepared::PreparedPolygon;
use super::real::{Real, Vector};

/// A value and a bound of its error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) error: f64,
}

/// Returns 1/(2π) Σ (e_i · e_j) ∬ ln r over the pairs of edges, with `digits` digits of each integral.
pub(super) fn contour_sum<T: Real>(pair: &FacingPair, digits: f64) -> Estimate {
    let (first, second) = (&*pair.first.polygon, &*pair.second.polygon);
    // Logarithms of lengths near 1 cancel best, and the sum around closed contours does not depend on the unit.
    let middle = pair.shift + second.centre() - first.centre();
    let unit = (middle.length().max(first.radius()).max(second.radius()))
        .log2()
        .round()
        .exp2();
    let origin = first.exact_corner(0);
    let edges = |polygon: &PreparedPolygon| -> Vec<Edge<T>> {
        let n = polygon.n_corners();
        let corners: Vec<Vector<T>> = (0..n)
            .map(|k| polygon.exact_corner(k).minus(origin).scale(1.0 / unit).round())
            .collect();
        (0..n)
            .filter_map(|k| Edge::new(corners[k], corners[(k + 1) % n]))
            .collect()
    };
    let (first_edges, second_edges) = (edges(first), edges(second));
    let mut sum = T::new(0.0);
    let mut size = 0.0;
    for a in &first_edges {
        for b in &second_edges {
            let product = a.vector.dot(b.vector);
            if product.to_f64().abs() > T::EPSILON * a.length() * b.length() {
                let integral = logarithm_integral(a, b, digits);
                sum = sum + product * integral.value;
                size += product.to_f64().abs() * (integral.value.to_f64().abs() + integral.size);
            }
        }
    }
    let scale = unit * unit / TAU;
    Estimate {
        value: sum.to_f64() * scale,
        error: size * scale * (1.5 * T::EPSILON + 10.0_f64.powf(-digits)),
    }
}
