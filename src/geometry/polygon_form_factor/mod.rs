//! The exchange area A₁F₁₂ of two unoccluded planar polygons, to nearly the last digit.
//!
//! Polygons are simple, with three corners or more, convex or not, and see along the normal of their winding (counter-clockwise
//! from the front). Each is first cut at the plane of the other: only the parts in front of both planes count, so
//! that polygons in one plane or back to back exchange exactly 0. These parts are integrated by one of the following rules, from far to near:
//!
//! | rule | formula | where | error |
//! |---|---|---|---|
//! | [`gauss_product`] | Σ w_i w_j h_i h_j / (π r⁴) over Gauss points of both | apart by more than their sizes | the bound below, 1e-15 to 2e-13 of the value |
//! | rectangles | [closed form](super::rectangle::rectangle_exchange_area) | rectangles with parallel edges | 3e-15 of the diameter² |
//! | [`gauss_lambert`] | Σ w_i F(x_i → polygon), exact F | one polygon small against its distance from the other's edges | A₁ρ^(1−2q)/4, 8e-15 of A₁ |
//! | [`contour`] | 1/(2π) ∮∮ ln r dr₁·dr₂, inner integral exact | anywhere | 3e-16 of its terms without signs |
//! | [`contour_extended`] | the same with 31 digits | anywhere | 2e-31 of its terms without signs |
//!
//! For q points a side, the error of a product rule on one of the polygons is at most twice
//! S e_q C_2q κ^(2q−2) (κ + v)(κ + j), where S = A₁A₂h₁h₂/(πr⁴) with the highest corners and the distance of the middles; κ < 1 is half of the
//! longest line of points over the distance from its middle to the sphere around the other polygon; v and j are half of the relative variations of the height and
//! of the area element along a line; e_q is the rule's error on x^2q, and C_2q the largest coefficient of x^2q in (1 − 2x cos φ + x²)⁻²
//! for all possible directions φ. This is the first term of the error's series; the error was at most 0.7 of it, not 2, in 20 000 random pairs
//! for each q, and 0.1 of it in the mean. For `gauss_lambert`, ρ = d + √(d² − 1) with d the distance of the outer polygon's middle from the other's edges in
//! radii of the outer one; the form is that of Trefethen, *Approximation Theory and Approximation Practice*, theorem 19.3, the constant is measured in the same way.
//!
//! The contour sum cancels: about log₁₀(10¹⁶ X/(P₁P₂)) of its 16 digits remain, with X = A₁F₁₂ and P the perimeters. Relative errors, measured:
//!
//! | pair | `contour` | `contour_extended` |
//! |---|---|---|
//! | sharing an edge at 0.001°, 30°, 90° | 3e-16 | 3e-16 |
//! | sharing an edge at 179°, 179.9°, 179.999° | 7e-13, 2e-11, 2e-6 | 3e-16 |
//! | facing, gap 1e-3, 1e-6, 1e-9 | 3e-16 | 3e-16 |
//! | side by side, gap 1e-6, 1e-9 | 4e-10, 3e-7 | 3e-16 |
//! | sliver 1e-4, 1e-6 on a shared edge | 7e-13, 2e-10 | 3e-16 |
//! | size ratio 1e-3, 1e-6 in a corner | 3e-11, 5e-5 | 3e-16 |
//! | facing at 1e3, 1e6 diameters | 2e-9, 2e-3 | 3e-16 |
//! | grazing at 1e3, 1e6 diameters | 6e-5, all | 3e-16, 6e-9 (`gauss_product`: 7e-15, 5e-14) |
//!
//! [`exchange_area`] chooses the cheapest rule whose error is below the tolerance, and returns which. The extended sum costs some forty times the plain one.
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
mod edge_pair;
mod facing;
mod gauss_lambert;
mod gauss_product;
mod prepared;
mod real;
mod select;

use crate::geometry::double_double::DoubleDouble;
use contour::contour_sum;
use facing::FacingPair;
pub use gauss_product::LARGEST_ORDER;
pub use prepared::PreparedPolygon;

/// The allowed error of a result: |error| ≤ max(`rel` · value, `abs`).
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
    /// Returns the allowed error of a value.
    fn of(self, value: f64) -> f64 {
        (self.rel * value).max(self.abs)
    }
}

/// An exchange area with its error and the rule that computed it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exchange {
    /// A₁F₁₂ = A₂F₂₁, in m².
    pub value: f64,
    /// An upper estimate of the absolute error, in m², without the rounding of the given corners.
    pub error: f64,
    /// The rule.
    pub rule: Rule,
}

/// The rule that computed an exchange area.
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
/// to reach it, down to about 2e-15 relative; below that the result is the best possible, and `error` states its accuracy.
/// Corners must be finite and lengths between 1e-60 and 1e60 m; a corner nearer to the other polygon's plane than 8 ulps of the
/// largest coordinate counts as in it.
///
/// Source: Sparrow (1963), equation (8), for the contours; for the other rules see the [module](self). Departures: none.
#[must_use]
#[doc(alias = "view factor")]
pub fn exchange_area(from: &PreparedPolygon, to: &PreparedPolygon, tolerance: Tolerance) -> Exchange {
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| {
        select::exchange_area(from, to, &pair, tolerance)
    })
}

/// Returns A₁F₁₂ from Gauss points on both polygons, `order`² of them on each triangle or quad of their division.
///
/// X = Σ w_i w_j h_i h_j / (π r_ij⁴), with h the heights over the other's plane. For the bound of the error see the
/// [module](self); where there is no bound, the error is the largest possible one. Departures: none.
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
/// X = 1/(2π) Σ_i Σ_j (e_i · e_j) ∫₀¹∫₀¹ ln r ds dt over the edges e of both. Edges that share a corner have a closed form; otherwise the integral
/// over the longer edge is exact and that over the shorter one a Gauss rule on pieces graded towards the points where the edges come near.
/// The error is an estimate of rounding: 3e-16 of the sum of all terms without their signs. Source: Sparrow (1963), equation (8). Departures: none.
#[must_use]
pub fn contour(from: &PreparedPolygon, to: &PreparedPolygon) -> Exchange {
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| {
        select::checked(&pair, contour_sum::<f64>(&pair, select::DIGITS), Rule::Contour)
    })
}

/// Returns A₁F₁₂ as [`contour`] does, with 31 digits in every step.
///
/// The result is exact to rounding, as long as it is above 1e-15 of the product of the perimeters.
#[must_use]
pub fn contour_extended(from: &PreparedPolygon, to: &PreparedPolygon) -> Exchange {
    FacingPair::new(from, to).map_or(Exchange::UNSEEN, |pair| {
        let estimate = contour_sum::<DoubleDouble>(&pair, select::EXTENDED_DIGITS);
        select::checked(&pair, estimate, Rule::ContourExtended)
    })
}

#[cfg(test)]
mod tests;
