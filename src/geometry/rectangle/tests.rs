#![expect(clippy::unwrap_used, reason = "a test may stop at bad reference data")]

use std::num::NonZeroUsize;

use glam::{DQuat, DVec3};

use super::*;
use crate::geometry::gauss_legendre::rounded_rule;
use crate::geometry::point_form_factor::point_form_factor;

const REFERENCE: &str = include_str!("../../../tests/data/reference/cube_patches.txt");

fn rectangle(c: DVec3, a: DVec3, b: DVec3) -> [DVec3; 4] {
    [c, c + a, c + a + b, c + b]
}

/// The inward-facing walls x=0, x=1, y=0, y=1, z=0, z=1 of the unit cube.
pub(crate) fn unit_cube() -> [[DVec3; 4]; 6] {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    [
        rectangle(DVec3::ZERO, y, z),
        rectangle(x, z, y),
        rectangle(DVec3::ZERO, z, x),
        rectangle(y, x, z),
        rectangle(DVec3::ZERO, x, y),
        rectangle(z, y, x),
    ]
}

#[test]
fn the_unit_cube() {
    let walls = unit_cube();
    for i in 0..6 {
        for j in 0..6 {
            let exact = match (i == j, i / 2 == j / 2) {
                (true, _) => 0.0,
                (_, true) => 0.199_824_895_698_387_4,
                _ => 0.200_043_776_075_403_15,
            };
            let value = rectangle_exchange_area(&walls[i], &walls[j]).unwrap();
            assert!((value - exact).abs() < 1e-14, "{i} {j}: {value}");
        }
    }
}

/// 6 × 6 patches a face: every offset, touching edges among them, in the walls' frame and in a rotated one.
#[test]
fn patches_of_the_cube() {
    let turn = DQuat::from_axis_angle(DVec3::new(3.0, -1.0, 2.0).normalize(), 1.1);
    let shift = DVec3::new(5.0, -3.0, 0.7);
    let h = 1.0 / 6.0;
    let mut n_cases = 0;
    for line in REFERENCE.lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split(' ').collect();
        let k: Vec<f64> = words[1..4]
            .iter()
            .map(|word| h * word.parse::<f64>().unwrap())
            .collect();
        let exact: f64 = words[4].parse::<f64>().unwrap() * h * h;
        let (a, b) = if words[0] == "parallel" {
            (
                rectangle(DVec3::ZERO, DVec3::X * h, DVec3::Y * h),
                rectangle(DVec3::new(k[0], k[1], 1.0), DVec3::Y * h, DVec3::X * h),
            )
        } else {
            (
                rectangle(DVec3::new(k[0], 0.0, 0.0), DVec3::X * h, DVec3::Y * h),
                rectangle(DVec3::new(0.0, k[2], k[1]), DVec3::Y * h, DVec3::Z * h),
            )
        };
        let value = rectangle_exchange_area(&a, &b).unwrap();
        assert!((value - exact).abs() < 3e-15, "{line}: {value:e} against {exact:e}");
        let reverse = rectangle_exchange_area(&b, &a).unwrap();
        assert!((reverse - exact).abs() < 3e-15, "{line}, reversed: {reverse:e}");
        let motion = |v: DVec3| turn * v + shift;
        let moved = rectangle_exchange_area(&a.map(motion), &b.map(motion)).unwrap();
        assert!((moved - exact).abs() < 1e-14, "{line}, moved: {moved:e}");
        n_cases += 1;
    }
    assert_eq!(n_cases, 36 + 216);
}

/// The mean of the point form factor, by Gauss quadrature where it is smooth.
#[test]
fn agrees_with_the_integrated_point_form_factor() {
    let rule = rounded_rule(NonZeroUsize::new(32).unwrap());
    let integrate = |low: f64, high: f64, f: &dyn Fn(f64) -> f64| -> f64 {
        let width = high - low;
        rule.iter()
            .map(|&(x, weight)| width * weight * f(low + width * x))
            .sum()
    };
    let floor = rectangle(DVec3::new(0.4, -1.0, 0.0), DVec3::X * 1.5, DVec3::Y * 2.5);
    let others = [
        rectangle(DVec3::new(-0.7, 0.3, 1.2), DVec3::Y * 2.0, DVec3::X * 3.0),
        rectangle(DVec3::new(-0.5, -0.2, 0.8), DVec3::Y * 1.1, DVec3::Z * 0.6),
        rectangle(DVec3::new(0.9, 2.0, 0.5), DVec3::X * 0.3, DVec3::Z * 4.0),
    ];
    for other in others {
        let integral = integrate(0.4, 1.9, &|x| {
            integrate(-1.0, 1.5, &|y| {
                point_form_factor(DVec3::new(x, y, 0.0), DVec3::Z, &other)
            })
        });
        let value = rectangle_exchange_area(&floor, &other).unwrap();
        assert!(
            value > 0.01 && (value - integral).abs() < 1e-12,
            "{value} against {integral}"
        );
    }
}

#[test]
fn horizons_cut_both_rectangles() {
    let floor = rectangle(DVec3::ZERO, DVec3::X * 2.0, DVec3::Y);
    let wall = rectangle(DVec3::ZERO, DVec3::Y, DVec3::Z);
    let exact = rectangle_exchange_area(&floor, &wall).unwrap();
    let long_floor = rectangle(DVec3::new(-3.0, 0.0, 0.0), DVec3::X * 5.0, DVec3::Y);
    let deep_wall = rectangle(DVec3::new(0.0, 0.0, -2.0), DVec3::Y, DVec3::Z * 3.0);
    let cut = rectangle_exchange_area(&long_floor, &deep_wall).unwrap();
    assert!(exact > 0.2 && (cut - exact).abs() < 1e-13, "{cut} against {exact}");
}

#[test]
fn additive_under_subdivision() {
    let a = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y * 2.0);
    let whole = rectangle(DVec3::new(0.0, 0.0, 0.0), DVec3::Y * 2.0, DVec3::Z * 1.5);
    let low = rectangle(DVec3::ZERO, DVec3::Y * 2.0, DVec3::Z * 0.3);
    let high = rectangle(DVec3::new(0.0, 0.0, 0.3), DVec3::Y * 2.0, DVec3::Z * 1.2);
    let area = |b: &[DVec3; 4]| rectangle_exchange_area(&a, b).unwrap();
    assert!((area(&whole) - area(&low) - area(&high)).abs() < 2e-14);
}

#[test]
fn backs_and_common_planes_give_zero_and_other_shapes_none() {
    let floor = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let zero = |other: [DVec3; 4]| assert_eq!(rectangle_exchange_area(&floor, &other).unwrap().to_bits(), 0);
    zero(rectangle(DVec3::Z, DVec3::X, DVec3::Y)); // its back
    zero(rectangle(-DVec3::Z, DVec3::Y, DVec3::X)); // below
    zero(rectangle(DVec3::X, DVec3::X, DVec3::Y)); // the same plane
    zero(rectangle(DVec3::ZERO, DVec3::Y, DVec3::X)); // the other side of a sheet
    zero(rectangle(DVec3::X, DVec3::Y, DVec3::Z)); // a wall that faces away
    zero(rectangle(-DVec3::Z, DVec3::Y, DVec3::Z)); // a wall below

    let none = |other: &[DVec3]| assert_eq!(rectangle_exchange_area(&floor, other), None);
    none(&rectangle(DVec3::Z, DVec3::new(0.0, 1.0, 0.1), DVec3::X));
    none(&rectangle(
        DVec3::Z,
        DVec3::new(0.1, 1.0, 0.0),
        DVec3::new(1.0, -0.1, 0.0),
    ));
    none(&[DVec3::Z, DVec3::Z + DVec3::Y, DVec3::Z + DVec3::X]);
    none(&rectangle(DVec3::Z, DVec3::Y, DVec3::new(1.0, 0.2, 0.0)));
    none(&[DVec3::Z; 4]);
}
