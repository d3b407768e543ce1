//! Invariants for any occluders.

use std::f64::consts::TAU;

use glam::DVec3;
use radiosity::form_factor::partial::{Accuracy, exchange_area};

use super::scenes::Random;
use super::shapes::{
    Polygon, area, cut, exchange, in_triangles, random_case, random_polygon, random_rotation, rectangle,
};
use crate::support::n_cases;

const TOLERANCE: f64 = 1e-6;

#[test]
fn the_order_of_the_two_polygons_does_not_matter() {
    let mut random = Random::new(21);
    for _ in 0..20 {
        let (p, q, occluders) = random_case(&mut random);
        let there = exchange(&p, &q, &occluders, TOLERANCE);
        let back = exchange(&q, &p, &occluders, TOLERANCE);
        assert_eq!(there.exchange_area.to_bits(), back.exchange_area.to_bits());
    }
}

#[test]
fn parts_add_up() {
    let mut random = Random::new(22);
    for _ in 0..15 {
        let (p, q, occluders) = random_case(&mut random);
        let whole = exchange(&p, &q, &occluders, TOLERANCE);
        let parts = |polygon: &Polygon| match polygon.len() {
            4 => cut(polygon, 2, 1),
            _ => in_triangles(&[vec![
                polygon[0],
                polygon[1],
                polygon[1].midpoint(polygon[2]),
                polygon[2],
            ]]),
        };
        let (of_p, of_q) = (parts(&p), parts(&q));
        let (mut sum, mut error) = (0.0, whole.error);
        for a in &of_p {
            for b in &of_q {
                let part = exchange(a, b, &occluders, TOLERANCE);
                sum += part.exchange_area;
                error += part.error;
            }
        }
        assert!((sum - whole.exchange_area).abs() <= error, "{sum} {whole:?}");
    }
}

#[test]
fn occluders_in_pieces_block_as_whole_ones_do() {
    let mut random = Random::new(23);
    for _ in 0..n_cases(2, 6) {
        let (p, q, occluders) = random_case(&mut random);
        let whole = exchange(&p, &q, &occluders, TOLERANCE);
        let pieces: Vec<Polygon> = occluders
            .iter()
            .flat_map(|b| {
                if b.len() == 4 {
                    cut(b, 2, 2)
                } else {
                    in_triangles(&[vec![b[0], b[1], b[1].midpoint(b[2]), b[2]]])
                }
            })
            .collect();
        let cut_up = exchange(&p, &q, &pieces, TOLERANCE);
        let difference = (cut_up.exchange_area - whole.exchange_area).abs();
        assert!(difference <= whole.error + cut_up.error, "{whole:?} {cut_up:?}");
    }
}

#[test]
fn one_more_occluder_never_lets_more_through() {
    let mut random = Random::new(24);
    for _ in 0..30 {
        let (p, q, mut occluders) = random_case(&mut random);
        let before = exchange(&p, &q, &occluders, TOLERANCE);
        let centre = p[0].lerp(q[0], random.unit());
        let rotation = random_rotation(&mut random, TAU);
        occluders.push(random_polygon(&mut random, centre, rotation, 0.7));
        let after = exchange(&p, &q, &occluders, TOLERANCE);
        assert!(after.exchange_area <= before.exchange_area + after.error + before.error);
        assert!(after.exchange_area >= 0.0 && after.exchange_area <= area(&p).min(area(&q)));
    }
}

#[test]
fn motions_and_scales_change_nothing_but_the_unit() {
    let mut random = Random::new(25);
    for scale in [1e-3, 1.0, 1e4] {
        for _ in 0..n_cases(2, 5) {
            let (p, q, occluders) = random_case(&mut random);
            let motion = random.motion();
            let moved = |polygon: &Polygon| polygon.iter().map(|&v| motion.point(v) * scale).collect::<Polygon>();
            let before = exchange(&p, &q, &occluders, TOLERANCE);
            let after = exchange(
                &moved(&p),
                &moved(&q),
                &occluders.iter().map(moved).collect::<Vec<_>>(),
                TOLERANCE,
            );
            let difference = (after.exchange_area / (scale * scale) - before.exchange_area).abs();
            assert!(
                difference <= before.error + after.error / (scale * scale),
                "{before:?} {after:?}"
            );
        }
    }
}

#[test]
fn polygons_without_an_area_exchange_nothing() {
    let q = rectangle(DVec3::Z, DVec3::Y, DVec3::X);
    let p = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let line = vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
    let degenerate: [&[DVec3]; 3] = [&[], &p[..2], &line];
    let open = exchange(&p, &q, &[], TOLERANCE).exchange_area;
    for corners in degenerate {
        assert!(exchange(corners, &q, &[], TOLERANCE).exchange_area.abs() < f64::MIN_POSITIVE);
        assert!(exchange(&q, corners, &[], TOLERANCE).exchange_area.abs() < f64::MIN_POSITIVE);
        let raised: Polygon = corners.iter().map(|&v| v + DVec3::new(0.2, 0.3, 0.5)).collect();
        assert!((exchange(&p, &q, &[raised], TOLERANCE).exchange_area - open).abs() < 2.0 * TOLERANCE);
    }
}

#[test]
fn coordinates_that_are_no_numbers_come_back_as_such() {
    let mut p = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let q = rectangle(DVec3::Z, DVec3::Y, DVec3::X);
    p[1].x = f64::NAN;
    let accuracy = Accuracy {
        tolerance: TOLERANCE,
        budget: 1000,
    };
    let result = exchange_area(&p, &q, &[], accuracy);
    assert!(result.exchange_area.is_nan() && !result.reached, "{result:?}");
}

#[test]
fn a_closed_way_gives_zero_exactly() {
    let (p, q) = (
        rectangle(DVec3::ZERO, DVec3::X, DVec3::Y),
        rectangle(DVec3::Z, DVec3::Y, DVec3::X),
    );
    // A screen of four slanted, touching pieces.
    let screen = rectangle(
        DVec3::new(-1.0, -1.0, 0.3),
        DVec3::new(3.0, 0.0, 0.4),
        DVec3::new(0.1, 3.0, 0.0),
    );
    let result = exchange(&p, &q, &cut(&screen, 2, 2), 1e-10);
    assert!(
        result.exchange_area.abs() < f64::MIN_POSITIVE && result.error < 1e-15,
        "{result:?}"
    );
    assert!(result.n_evaluations < 5_000, "{result:?}");
}

#[test]
fn a_slit_between_two_plates_lets_through_what_a_slit_must() {
    // Two half-planes in effect, with a slit of width w: F is that of the open pair times the share of the lines that pass; to first order in w,
    // dF/dw is the same for all small w.
    let (p, q) = (
        rectangle(DVec3::ZERO, DVec3::X, DVec3::Y),
        rectangle(DVec3::Z, DVec3::Y, DVec3::X),
    );
    let through = |width: f64| {
        let plates = [
            rectangle(
                DVec3::new(-4.0, -4.0, 0.5),
                DVec3::X * (4.4 - 0.5 * width),
                DVec3::Y * 9.0,
            ),
            rectangle(DVec3::new(0.4 + 0.5 * width, -4.0, 0.5), DVec3::X * 4.0, DVec3::Y * 9.0),
        ];
        exchange(&p, &q, &plates, 1e-10).exchange_area / width
    };
    let (wide, narrow) = (through(1e-3), through(1e-4));
    assert!(narrow > 0.2, "{narrow}");
    assert!((wide - narrow).abs() < 1e-4 * narrow, "{wide} {narrow}");
}
