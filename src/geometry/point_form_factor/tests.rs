#![expect(clippy::unwrap_used, reason = "a test may stop at bad reference data")]

use std::f64::consts::PI;
use std::num::NonZeroUsize;

use glam::{DQuat, DVec3};

use super::*;
use crate::geometry::gauss_legendre::rounded_rule;

const REFERENCE: &str = include_str!("../../../tests/data/reference/point_form_factors.txt");

/// A rectangle c + s a + t b with the normal a × b.
fn rectangle(c: DVec3, a: DVec3, b: DVec3) -> [DVec3; 4] {
    [c, c + a, c + a + b, c + b]
}

#[test]
fn agrees_with_fifty_digits_at_every_size_and_distance() {
    let mut n_cases = 0;
    for line in REFERENCE.lines().filter(|line| !line.starts_with('#')) {
        let (kind, numbers) = line.split_once(' ').unwrap();
        let x: Vec<f64> = numbers.split(' ').map(|word| word.parse().unwrap()).collect();
        let corners: Vec<DVec3> = x[7..x.len() - 1].chunks(3).map(DVec3::from_slice).collect();
        let exact = *x.last().unwrap();
        let value = point_form_factor(DVec3::from_slice(&x[..3]), DVec3::from_slice(&x[3..6]), &corners);
        let tolerance = if kind == "far" { 1e-14 * exact } else { 1e-15 };
        assert!((value - exact).abs() <= tolerance, "{line}: {value:e}");
        n_cases += 1;
    }
    assert_eq!(n_cases, 64);
}

/// Howell's catalogue, B-3: a rectangle parallel to the element, one corner on its normal.
#[test]
fn closed_form_of_a_parallel_rectangle() {
    for (a, b, h) in [(1.0, 1.0, 1.0), (0.3, 5.0, 0.7), (100.0, 2.0, 0.01)] {
        let (x, y): (f64, f64) = (a / h, b / h);
        let (rx, ry) = (x.hypot(1.0), y.hypot(1.0));
        let exact = (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / (2.0 * PI);
        let facing_down = rectangle(DVec3::new(0.0, 0.0, h), DVec3::Y * b, DVec3::X * a);
        let value = point_form_factor(DVec3::ZERO, DVec3::Z, &facing_down);
        assert!((value - exact).abs() < 1e-15, "{a} {b} {h}: {value} against {exact}");
    }
}

/// Howell's catalogue, B-4: a rectangle in a plane perpendicular to the element's.
#[test]
fn closed_form_of_a_perpendicular_rectangle() {
    for (height, width, distance) in [(1.0, 1.0, 1.0), (4.0, 0.2, 0.5), (0.1, 3.0, 1e-3)] {
        let (x, y): (f64, f64) = (height / width, distance / width);
        let r = x.hypot(y);
        let exact = ((1.0 / y).atan() - y / r * (1.0 / r).atan()) / (2.0 * PI);
        let wall = rectangle(DVec3::new(distance, 0.0, 0.0), DVec3::Z * height, DVec3::Y * width);
        assert!(polygon::area_vector(&wall).x < 0.0, "the wall faces the element");
        let value = point_form_factor(DVec3::ZERO, DVec3::Z, &wall);
        assert!(
            (value - exact).abs() < 1e-15,
            "{height} {width} {distance}: {value} against {exact}"
        );
        // The part below the horizon adds nothing.
        let sunk = rectangle(
            DVec3::new(distance, 0.0, -7.0),
            DVec3::Z * (height + 7.0),
            DVec3::Y * width,
        );
        let cut = point_form_factor(DVec3::ZERO, DVec3::Z, &sunk);
        assert!((cut - exact).abs() < 1e-15, "{cut} against {exact}");
    }
}

/// A disc of radius R at height h on the element's axis: R²/(R² + h²), between its inscribed and circumscribed polygons.
#[test]
fn polygons_enclose_the_disc() {
    let (radius, height, n) = (0.8_f64, 1.1_f64, 2048);
    let polygon = |r: f64| -> Vec<DVec3> {
        (0..n)
            .map(|k| -2.0 * PI * f64::from(k) / f64::from(n))
            .map(|angle| DVec3::new(r * angle.cos(), r * angle.sin(), height))
            .collect()
    };
    let disc = radius * radius / (radius * radius + height * height);
    let inner = point_form_factor(DVec3::ZERO, DVec3::Z, &polygon(radius));
    let outer = point_form_factor(DVec3::ZERO, DVec3::Z, &polygon(radius / (PI / f64::from(n)).cos()));
    assert!(inner < disc && disc < outer, "{inner} {disc} {outer}");
    assert!(outer - inner < 2e-6);
}

#[test]
fn agrees_with_gauss_quadrature_of_the_kernel() {
    let rule = rounded_rule(NonZeroUsize::new(40).unwrap());
    let integrate = |f: &dyn Fn(f64) -> f64| -> f64 { rule.iter().map(|&(x, weight)| weight * f(x)).sum() };
    let (point, normal) = (DVec3::new(0.2, -0.1, 0.3), DVec3::new(1.0, 2.0, 3.0).normalize());
    let (corner, a, b) = (
        DVec3::new(1.5, 0.2, 2.0),
        DVec3::new(-1.0, -0.2, 0.6),
        DVec3::new(-0.3, 1.4, 0.1),
    );
    let facing = a.cross(b);
    assert!(facing.dot(point - corner) > 0.0, "the front faces the point");
    let quadrature = integrate(&|s| {
        integrate(&|t| {
            let r = corner + a * s + b * t - point;
            normal.dot(r) * -facing.dot(r) / (PI * r.length_squared().powi(2))
        })
    });
    let polygon = rectangle(corner, a, b);
    let value = point_form_factor(point, normal, &polygon);
    assert!((value - quadrature).abs() < 1e-14, "{value} against {quadrature}");
    let vector = point_form_factor_vector(point, &polygon);
    assert!((normal.dot(vector) - value).abs() < 1e-16);
}

#[test]
fn backs_planes_and_horizons_give_zero() {
    let up = rectangle(DVec3::new(-1.0, -1.0, 0.0), DVec3::X * 2.0, DVec3::Y * 2.0);
    let below = DVec3::new(0.1, 0.2, -1.0);
    assert!(point_form_factor(below, DVec3::Z, &up).to_bits() == 0, "a back");
    assert!(
        point_form_factor(DVec3::new(0.1, 0.2, 0.0), -DVec3::Z, &up).to_bits() == 0,
        "in the plane"
    );
    assert!(
        point_form_factor(-below, DVec3::Z, &up).to_bits() == 0,
        "below the horizon"
    );
    assert!(
        point_form_factor(DVec3::new(1.0, 0.0, 0.0), DVec3::X, &up).to_bits() == 0,
        "on an edge"
    );
    assert!(point_form_factor(up[0], DVec3::X, &up).to_bits() == 0, "on a corner");
    assert!(point_form_factor(-below, DVec3::Z, &[]).to_bits() == 0, "no polygon");
    assert!(
        point_form_factor(DVec3::ZERO, DVec3::Z, &up[..2]).to_bits() == 0,
        "no area"
    );
    // An element that touches a sheet sees nothing but it.
    let close = point_form_factor(DVec3::new(0.1, 0.2, 1e-9), -DVec3::Z, &up);
    assert!((1.0 - 1e-15..=1.0).contains(&close), "{close}");
}

#[test]
fn degenerate_edges_change_nothing() {
    let square = rectangle(DVec3::new(-1.0, -0.5, 2.0), DVec3::Y, DVec3::X);
    let middle = 0.5 * (square[0] + square[1]);
    let doubled = [square[0], square[0], middle, square[1], square[2], square[2], square[3]];
    let point = DVec3::new(0.1, 0.1, 0.0);
    for normal in [DVec3::Z, DVec3::new(0.6, 0.0, -0.8), DVec3::new(-0.6, 0.0, 0.8)] {
        let (a, b) = (
            point_form_factor(point, normal, &square),
            point_form_factor(point, normal, &doubled),
        );
        assert!((a - b).abs() < 1e-16, "{a} against {b}");
    }
}

#[test]
fn scaling_by_powers_of_two_is_exact_and_motions_cost_only_rounding() {
    let polygon = rectangle(
        DVec3::new(1.0, 0.3, -0.4),
        DVec3::new(0.1, 0.2, 1.7),
        DVec3::new(0.3, 1.9, 0.2),
    );
    let (point, normal) = (DVec3::new(-0.5, 0.25, 0.125), DVec3::new(2.0, 1.0, 2.0) / 3.0);
    let value = point_form_factor(point, normal, &polygon);
    assert!(value > 0.05);
    for exponent in [-100, -20, 3, 100] {
        let scale = 2.0_f64.powi(exponent);
        let scaled = point_form_factor(point * scale, normal, &polygon.map(|v| v * scale));
        assert_eq!(scaled.to_bits(), value.to_bits(), "2^{exponent}");
    }
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -3.0).normalize(), 0.7);
    let moved = point_form_factor(turn * point, turn * normal, &polygon.map(|v| turn * v));
    assert!((moved - value).abs() < 1e-15);
}

/// A closed room is seen whole from every point on its walls: the factors sum to 1.
#[test]
fn the_other_walls_of_a_cube_sum_to_one() {
    let walls = crate::geometry::rectangle::tests::unit_cube();
    for (u, v) in [(0.5, 0.5), (0.1, 0.93), (1e-6, 0.4), (1e-9, 1e-9)] {
        let floor = walls[4];
        let point = floor[0] + (floor[1] - floor[0]) * u + (floor[3] - floor[0]) * v;
        let sum: f64 = walls.iter().map(|wall| point_form_factor(point, DVec3::Z, wall)).sum();
        assert!((sum - 1.0).abs() < 2e-15, "{u} {v}: {sum}");
    }
}
