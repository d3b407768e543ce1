//! The exchange area A₁F₁₂ of two planar polygons that see each other unoccluded, to nearly the last digit.
//!
//! Polygons are simple, with three corners or more, convex or not, and see along the normal of their winding (counter-clockwise
//! from the front). Each is first cut at the plane of the other: only what lies in front of both takes part, so
//! that polygons in one plane or back to back exchange exactly 0. What is left is integrated by one of these, from far to near:
//!
//! | rule | formula | where | error |
//! |---|---|---|---|
//! | [`gauss_product`] | Σ w_i w_j h_i h_j / (π r⁴) over Gauss points of both | spheres around the polygons apart | 4 S ρ^(2−2q) each, 1e-15 of the value |
//! | rectangles | [closed form](super::rectangle::rectangle_exchange_area) | rectangles with parallel edges | 3e-15 of the diameter² |
//! | [`gauss_lambert`] | Σ w_i F(x_i → polygon), exact F | one polygon small against its distance from the other's edges | A₁ρ^(1−2q)/4, 2e-15 of A₁ |
//! | [`contour`] | 1/(2π) ∮∮ ln r dr₁·dr₂, inner integral exact | anywhere | 5e-16 of the contours' sum without its signs |
//! | [`contour_extended`] | the same with 31 digits | anywhere | 1e-30 of it |
//!
//! with ρ = d + √(d² − 1), d the distance of the nearest singularity from the polygon's middle in radii of the polygon, and S = A₁A₂h₁h₂/(πr⁴) at
//! the highest corners and the middles' distance. The bounds of the Gauss rules have the form of the theory (Trefethen, *Approximation Theory
//! and Approximation Practice*, theorem 19.3); their constants are measured: the worst of 20 000 random pairs an order, rounded up.
//!
//! The contour sum cancels: what is left of its 16 digits at X = A₁F₁₂ is 16 − log₁₀(P₁P₂/X), P the perimeters. That is 1e-15 for polygons
//! that meet at right angles, 1e-12 for a triangle 1e4 times longer than wide, 1e-9 at a distance of 1000 diameters or at a size ratio of 1e6, and
//! nothing for planes that differ by 1e-7. The sum with 31 digits has 15 more, which is enough for all of these, at forty times the cost.
//! [`exchange_area`] takes the cheapest rule whose error is below the tolerance, and says which.
//!
//! ```
//! use radiosity::geometry::DVec3;
//! use radiosity::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};
//!
//! let floor = PreparedPolygon::new(&[DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]);
//! let wall = PreparedPolygon::new(&[DVec3::ZERO, DVec3::Y, DVec3::Y + DVec3::Z, DVec3::Z]);
//! let exchange = exchange_area(&floor, &wall, Tolerance::default());
//! assert!((exchange.value - 0.200_043_776_075_403_15).abs() <= exchange.error);
//! assert!(exchange.error < 1e-13);
//! ```

mod contour;
mod double_double;
mod edge_pair;
mod facing;
mod gauss_lambert;
mod gauss_product;
mod prepared;
mod real;
mod select;

use contour::contour_sum;
use double_double::DoubleDouble;
use facing::FacingPair;
pub use gauss_product::LARGEST_ORDER;
pub use prepared::PreparedPolygon;

/// The error that a result may have: |error| ≤ max(`rel` · value, `abs`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Relative to the exchange area.
    pub rel: f64,
    /// Absolute, in m².
    pub abs: f64,
}

impl Default for Tolerance {
    /// Twelve digits of the exchange area, however small it is.
    fn default() -> Self {
        Self { rel: 1e-12, abs: 0.0 }
    }
}

impl Tolerance {
    /// Returns the error that a value may have.
    fn of(self, value: f64) -> f64 {
        (self.rel * value).max(self.abs)
    }
}

/// An exchange area with its error and the rule that it comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exchange {
    /// A₁F₁₂ = A₂F₂₁, in m².
    pub value: f64,
    /// An estimate of the absolute error from above, in m²; rounding of the given corners is not in it.
    pub error: f64,
    /// The rule.
    pub rule: Rule,
}

/// How an exchange area was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rule {
    /// The fronts do not see each other: exactly 0.
    Unseen,
    /// Gauss points on both polygons.
    GaussProduct {
        /// Points along each side of the first and of the second polygon's pieces.
        orders: [usize; 2],
    },
    /// The closed form of two rectangles with parallel edges.
    Rectangles,
    /// Gauss points on the smaller polygon, exact form factors to the other.
    GaussLambert {
        /// Points along each side of the smaller polygon's pieces.
        order: usize,
    },
    /// The integral around both contours.
    Contour,
    /// The same with 31 digits.
    ContourExtended,
}

impl Exchange {
    const UNSEEN: Self = Self {
        value: 0.0,
        error: 0.0,
        rule: Rule::Unseen,
    };
}

/// Returns A₁F₁₂ of two unoccluded polygons with an error below the tolerance, by the cheapest of the rules that reaches it.
///
/// X = 1/π ∫∫ cos θ₁ cos θ₂ / r² dA₁ dA₂ in m², symmetric in its arguments. The tolerance is met wherever 31 digits are enough
/// to reach it, down to about 2e-15 relative: a tolerance below that gives the best that there is, with an `error` that says so.
/// Corners must be finite and lengths between 1e-60 and 1e60 m; a corner nearer to the other polygon's plane than 8 ulps of the
/// largest coordinate counts as in it.
///
/// Source: Sparrow (1963), equation (8), for the contours; the other rules as the [module](self) says. Departures: none.
#[must_use]
#[doc(alias = "view factor")]
pub fn exchange_area(from: &PreparedPolygon, to: &PreparedPolygon, tolerance: Tolerance) -> Exchange {
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| {
        select::exchange_area(from, to, &pair, tolerance)
    })
}

/// Returns A₁F₁₂ from Gauss points on both polygons, `order`² of them on each triangle or quad that they are cut into.
///
/// X = Σ w_i w_j h_i h_j / (π r_ij⁴), with h the heights over the other's plane. The error estimate is infinite nowhere: where the
/// spheres around the polygons touch, it is all that the value can be wrong by. Departures: none.
///
/// # Panics
/// If the order is 0 or above [`LARGEST_ORDER`].
#[must_use]
#[track_caller]
pub fn gauss_product(from: &PreparedPolygon, to: &PreparedPolygon, order: usize) -> Exchange {
    check_order(order);
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| select::product(&pair, [order, order]))
}

/// Returns A₁F₁₂ from `order`² Gauss points on the smaller polygon (each triangle or quad of it) and the exact form factors from these to the other.
///
/// X = Σ w_i F(x_i), with F by [`point_form_factor`](super::point_form_factor::point_form_factor). Error estimate and departures as for [`gauss_product`].
///
/// # Panics
/// If the order is 0 or above [`LARGEST_ORDER`].
#[must_use]
#[track_caller]
pub fn gauss_lambert(from: &PreparedPolygon, to: &PreparedPolygon, order: usize) -> Exchange {
    check_order(order);
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| select::lambert(&pair, order))
}

#[track_caller]
fn check_order(order: usize) {
    assert!(
        (1..=LARGEST_ORDER).contains(&order),
        "a Gauss rule has 1 to {LARGEST_ORDER} points a side, not {order}"
    );
}

/// Returns A₁F₁₂ from the integral around both contours, in `f64`.
///
/// X = 1/(2π) Σ_i Σ_j (e_i · e_j) ∫₀¹∫₀¹ ln r ds dt over the edges e of both. Edges that share a corner have a closed form; else the integral
/// over the longer edge is exact and that over the shorter one a Gauss rule on pieces graded towards the places where the edges come near.
/// The estimate is of rounding, 5e-16 of the sum without signs. Source: Sparrow (1963), equation (8). Departures: none.
#[must_use]
pub fn contour(from: &PreparedPolygon, to: &PreparedPolygon) -> Exchange {
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| {
        select::checked(&pair, contour_sum::<f64>(&pair, select::DIGITS), Rule::Contour)
    })
}

/// Returns A₁F₁₂ as [`contour`] does, with 31 digits in every step: to rounding of the result, as long as this is above 1e-15 of the product of the perimeters.
#[must_use]
pub fn contour_extended(from: &PreparedPolygon, to: &PreparedPolygon) -> Exchange {
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| {
        let estimate = contour_sum::<DoubleDouble>(&pair, select::EXTENDED_DIGITS);
        select::checked(&pair, estimate, Rule::ContourExtended)
    })
}

#[cfg(test)]
mod tests;
