//! The choice of the cheapest rule that is accurate enough.

use std::f64::consts::PI;

use glam::DVec3;

use super::contour::{Estimate, contour_sum};
use super::facing::{FacingPair, Part};
use super::gauss_lambert::Outer;
use super::gauss_product::{LARGEST_ORDER, product_sum};
use super::prepared::PreparedPolygon;
use super::{Exchange, Rule, Tolerance};
use crate::geometry::double_double::DoubleDouble;
use crate::geometry::rectangle::rectangle_exchange_area;

/// Digits of the contour's Gauss rules in `f64`.
pub(super) const DIGITS: f64 = 17.0;
/// The same in double-double numbers.
pub(super) const EXTENDED_DIGITS: f64 = 31.0;

/// The most kernel evaluations for which a product rule costs less than a closed form (some 500 ns) or a contour (some 10 µs).
const CHEAPER_THAN_CLOSED_FORM: usize = 500;
const CHEAPER_THAN_CONTOUR: usize = 8000;
/// The most points with exact form factors (some 50 ns an edge) that cost less than a contour.
const POINTS_CHEAPER_THAN_CONTOUR: usize = 81;

pub(super) fn exchange_area(
    from: &PreparedPolygon,
    to: &PreparedPolygon,
    pair: &FacingPair,
    tolerance: Tolerance,
) -> Exchange {
    let good = |exchange: &Exchange| exchange.error <= tolerance.of(exchange.value);
    let bound = ProductBound::new(pair);
    let plan = bound.orders(tolerance);
    let try_product = |limit: usize| {
        plan.filter(|&orders| evaluations(pair, orders) <= limit)
            .map(|orders| product_with(pair, &bound, orders))
            .filter(good)
    };
    let near = || {
        rectangles(from, to, pair)
            .filter(good)
            .or_else(|| try_product(CHEAPER_THAN_CONTOUR))
            .or_else(|| try_lambert(pair, tolerance).filter(good))
    };
    if let Some(exchange) = try_product(CHEAPER_THAN_CLOSED_FORM).or_else(near) {
        return exchange;
    }
    let first = checked(pair, contour_sum::<f64>(pair, DIGITS), Rule::Contour);
    if good(&first) {
        return first;
    }
    if let Some(exchange) = try_product(usize::MAX) {
        return exchange;
    }
    // The first error is proportional to the size of the terms; where its value is accurate enough, both give the digits needed.
    let wanted = if first.value > 2.0 * first.error {
        0.1 * tolerance.of(first.value) * f64::EPSILON / first.error
    } else {
        0.0
    };
    let digits = (-wanted.log10()).clamp(DIGITS, EXTENDED_DIGITS);
    let second = checked(pair, contour_sum::<DoubleDouble>(pair, digits), Rule::ContourExtended);
    if good(&second) || digits >= EXTENDED_DIGITS {
        return second;
    }
    let estimate = contour_sum::<DoubleDouble>(pair, EXTENDED_DIGITS);
    checked(pair, estimate, Rule::ContourExtended)
}

/// Keeps a value between 0 and the smaller area, and adds its own rounding to its error.
pub(super) fn checked(pair: &FacingPair, estimate: Estimate, rule: Rule) -> Exchange {
    let most = pair.first.polygon.area().min(pair.second.polygon.area());
    let value = estimate.value.max(0.0).min(most);
    Exchange {
        value,
        error: (estimate.error + 2.0 * f64::EPSILON * value).min(most),
        rule,
    }
}

/// The convergence of product rules for a pair.
struct ProductBound {
    /// The sum's size: A₁A₂h₁h₂/(πr⁴) at the highest corners, areas without their signs.
    size: f64,
    /// The value, roughly.
    value: f64,
    /// Relative rounding of the value, most of it from low heights.
    rounding: f64,
    /// Of each polygon; `None` if they are too near for a bound.
    convergence: Option<[Convergence; 2]>,
}

/// The variables of the error of a Gauss rule over one polygon.
#[derive(Clone, Copy)]
struct Convergence {
    /// Half of the longest line of points, against the distance of its middle from the other's sphere; below 1.
    step: f64,
    /// Half of the relative variation of the height and of the area element along a line.
    variation: f64,
    element_variation: f64,
    /// The sine of the least angle between a line of points and the direction to the other polygon: at least that to the polygon's plane.
    sine: f64,
}

impl Convergence {
    /// Returns `None` where a singularity may lie on a line of points.
    fn new(own: &Part, other: &Part, distance: f64) -> Option<Self> {
        let (polygon, other_polygon) = (&*own.polygon, &*other.polygon);
        let nearest = distance - other_polygon.radius() - polygon.reach();
        (nearest > polygon.half_edge()).then(|| Self {
            step: polygon.half_edge() / nearest,
            variation: 0.5 * own.heights.variation(),
            element_variation: if polygon.is_parallelogram() { 0.0 } else { 1.0 },
            sine: other.heights.lowest() / (distance + polygon.radius() + other_polygon.radius()),
        })
    }

    /// Returns the errors of the rules of order 2, 3, ..., as parts of the sum's size.
    fn errors(self) -> impl Iterator<Item = f64> {
        let Self {
            step,
            variation,
            element_variation,
            sine,
        } = self;
        let mut power = (step + variation) * (step + element_variation) / 3.0;
        (2_u32..).map(move |order| {
            let q = f64::from(order);
            // The error of the q-point rule on x^2q, from that of the rule before.
            power *= step * step * q * q / ((2.0 * q - 1.0) * (2.0 * q + 1.0));
            // The coefficient of x^2q in (1 − 2x cos φ + x²)⁻², a Gegenbauer polynomial of cos φ.
            let n = 2.0 * q;
            let along = (n + 3.0) * (n + 2.0) * (n + 1.0) / 6.0;
            let aslant = 0.5 * (n + 2.0 + 1.0 / sine) / (sine * sine);
            power * along.min(aslant)
        })
    }
}

impl ProductBound {
    fn new(pair: &FacingPair) -> Self {
        let (first, second) = (&*pair.first.polygon, &*pair.second.polygon);
        let middle = pair.shift + second.centre() - first.centre();
        let distance_squared = middle.length_squared();
        let distance = distance_squared.sqrt();
        let (heights, others) = (&pair.first.heights, &pair.second.heights);
        let scale = first.unsigned_area() * second.unsigned_area() / (PI * distance_squared * distance_squared);
        let convergence = |own, other| Convergence::new(own, other, distance);
        let slope = |part: &Part| (distance / part.heights.mean()).min(100.0);
        Self {
            size: scale * heights.highest() * others.highest(),
            value: scale * heights.mean() * others.mean(),
            rounding: 4.0 * f64::EPSILON * (2.0 + slope(&pair.first) + slope(&pair.second)),
            convergence: convergence(&pair.first, &pair.second)
                .zip(convergence(&pair.second, &pair.first))
                .map(<[_; 2]>::from),
        }
    }

    /// Returns the orders that reach a tolerance, if there are such.
    fn orders(&self, tolerance: Tolerance) -> Option<[usize; 2]> {
        // Half of the tolerance for each polygon; the value may turn out smaller.
        let wanted = 0.25 * tolerance.of(self.value);
        let [first, second] = self.convergence?.map(|convergence| {
            let enough = convergence
                .errors()
                .take(LARGEST_ORDER - 1)
                .position(|error| 2.0 * self.size * error <= wanted);
            enough.map(|k| k + 2)
        });
        Some([first?, second?])
    }

    /// Returns the bound of the error of a sum, given its value.
    fn error(&self, orders: [usize; 2], value: f64) -> f64 {
        let Some(convergence) = self.convergence else {
            return f64::INFINITY;
        };
        let term = |k: usize| {
            // There is no bound for the rule of one point.
            let order = orders[k].checked_sub(2);
            order
                .and_then(|n| convergence[k].errors().nth(n))
                .unwrap_or(f64::INFINITY)
        };
        2.0 * self.size * (term(0) + term(1)) + self.rounding * value
    }
}

fn evaluations(pair: &FacingPair, orders: [usize; 2]) -> usize {
    let points = (orders[0] * orders[1]).pow(2);
    points * pair.first.polygon.pieces().len() * pair.second.polygon.pieces().len()
}

pub(super) fn product(pair: &FacingPair, orders: [usize; 2]) -> Exchange {
    product_with(pair, &ProductBound::new(pair), orders)
}

fn product_with(pair: &FacingPair, bound: &ProductBound, orders: [usize; 2]) -> Exchange {
    let value = product_sum(pair, orders);
    bounded(pair, value, bound.error(orders, value), Rule::GaussProduct { orders })
}

/// Limits an error to the largest possible one of a value.
fn bounded(pair: &FacingPair, value: f64, error: f64, rule: Rule) -> Exchange {
    let most = pair.first.polygon.area().min(pair.second.polygon.area());
    Exchange {
        value: value.max(0.0),
        error: (error + 8.0 * f64::EPSILON * value).min(value.max(most)),
        rule,
    }
}

/// Returns the closed form where it applies, its error with that of edges off their directions.
fn rectangles(from: &PreparedPolygon, to: &PreparedPolygon, pair: &FacingPair) -> Option<Exchange> {
    let (first, second) = (from.corners(), to.corners());
    let value = rectangle_exchange_area(first, second)?;
    let skew = {
        let axes = |corners: &[DVec3]| [corners[1] - corners[0], corners[3] - corners[0]].map(DVec3::normalize);
        let ([x, y], others) = (axes(first), axes(second));
        let frame = [x, y, from.normal()];
        others
            .into_iter()
            .map(|axis| {
                let mut cosines = frame.map(|f| axis.dot(f).abs());
                cosines.sort_by(f64::total_cmp);
                cosines[0] + cosines[1]
            })
            .fold(x.dot(y).abs() + others[0].dot(others[1]).abs(), f64::max)
    };
    let radii = from.radius() + to.radius();
    let middle = second[0] - first[0] + to.centre() - from.centre();
    let diameter = middle.length() + radii;
    let perimeter = from.perimeter().min(to.perimeter());
    let error = 3e-15 * diameter * diameter + skew * radii * perimeter;
    Some(bounded(pair, value, error, Rule::Rectangles))
}

fn try_lambert(pair: &FacingPair, tolerance: Tolerance) -> Option<Exchange> {
    let outer = Outer::new(pair);
    let (ratio, area) = (outer.distance_in_radii(), outer.area());
    let cheap = |order: usize| outer.n_points(order) <= POINTS_CHEAPER_THAN_CONTOUR;
    // The factor from the middle, a rule of one point, is a rough estimate of the value.
    let wanted = 0.5 * tolerance.of(area * outer.middle_factor());
    let order = (2..=LARGEST_ORDER)
        .take_while(|&order| cheap(order))
        .find(|&order| lambert_error(ratio, area, order) <= wanted)?;
    Some(lambert_from(pair, &outer, order))
}

pub(super) fn lambert(pair: &FacingPair, order: usize) -> Exchange {
    lambert_from(pair, &Outer::new(pair), order)
}

fn lambert_from(pair: &FacingPair, outer: &Outer, order: usize) -> Exchange {
    let error = lambert_error(outer.distance_in_radii(), outer.area(), order);
    bounded(pair, outer.lambert_sum(order), error, Rule::GaussLambert { order })
}

/// Returns the bound A ρ^(1−2q)/4 with rounding; its constant is measured.
fn lambert_error(ratio: f64, area: f64, order: usize) -> f64 {
    if ratio <= 1.0 {
        return f64::INFINITY;
    }
    let rho = ratio + (ratio * ratio - 1.0).sqrt();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "an order is below 21"
    )]
    let power = 1 - 2 * order as i32;
    area * (0.25 * rho.powi(power) + 8e-15)
}
