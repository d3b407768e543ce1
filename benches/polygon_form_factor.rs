//! Benchmarks exchange areas of polygon pairs, in time per pair: all pairs of patches of the cube, and one pair for each rule.

mod timing;

use std::hint::black_box;

use radiosity::geometry::DVec3;
use radiosity::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, contour, contour_extended, exchange_area};
use timing::measure;

/// Returns the inward-facing walls of the unit cube, n × n patches each, turned so that no edge is along an axis.
fn cube(n: u32) -> [Vec<PreparedPolygon>; 6] {
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let walls = [
        (DVec3::ZERO, y, z),
        (x, z, y),
        (DVec3::ZERO, z, x),
        (y, x, z),
        (DVec3::ZERO, x, y),
        (z, y, x),
    ];
    walls.map(|(corner, u, v)| {
        let (u, v) = (u / f64::from(n), v / f64::from(n));
        (0..n * n)
            .map(|k| {
                let start = corner + f64::from(k / n) * u + f64::from(k % n) * v;
                PreparedPolygon::new(&[start, start + u, start + u + v, start + v].map(|p| turn * p))
            })
            .collect()
    })
}

fn sum_over_cube(walls: &[Vec<PreparedPolygon>; 6], tolerance: Tolerance) -> f64 {
    let mut sum = 0.0;
    for (k, wall) in walls.iter().enumerate() {
        for other in &walls[k + 1..] {
            for from in wall {
                sum += other
                    .iter()
                    .map(|to| exchange_area(from, to, tolerance).value)
                    .sum::<f64>();
            }
        }
    }
    sum
}

fn cube_pairs() {
    let n = 13;
    let walls = cube(n);
    let n_pairs = 15 * u64::from(n).pow(4);
    for (name, rel, abs) in [
        ("abs 1e-12", 0.0, 1e-12),
        ("abs 1e-14", 0.0, 1e-14),
        ("rel 1e-10", 1e-10, 0.0),
    ] {
        let tolerance = Tolerance { rel, abs };
        measure(&format!("cube, {name}"), n_pairs, || {
            sum_over_cube(black_box(&walls), tolerance)
        });
    }
}

fn contours() {
    let triangle = [DVec3::ZERO, DVec3::X, DVec3::new(0.3, 0.8, 0.0)].map(|p| p + 0.1);
    let first = PreparedPolygon::new(&triangle);
    let meeting = [triangle[1], triangle[0], DVec3::new(0.6, 0.3, 0.7)];
    let near = [
        DVec3::new(0.1, 0.2, 0.101),
        DVec3::new(0.9, 0.1, 0.3),
        DVec3::new(0.5, 0.9, 0.4),
    ];
    for (name, corners) in [("shared edge", meeting), ("near", near)] {
        let second = PreparedPolygon::new(&corners);
        let name = format!("contour, {name}");
        measure(&name, 1, || contour(black_box(&first), &second));
        measure(&format!("{name}, extended"), 1, || {
            contour_extended(black_box(&first), &second)
        });
    }
}

fn main() {
    cube_pairs();
    contours();
}
