//! Against plain random sampling with its own standard error.

use glam::DVec3;
use radiosity::geometry::polygon;
use radiosity::geometry::sampling::{PointStream, Sequence, UniformOnPolygon};

use super::scenes::Random;
use super::shapes::{Polygon, exchange, random_case};

/// Tells whether a segment crosses a convex polygon.
fn crosses(occluder: &Polygon, a: DVec3, b: DVec3) -> bool {
    let normal = polygon::area_vector(occluder);
    let (height_a, height_b) = (normal.dot(a - occluder[0]), normal.dot(b - occluder[0]));
    if height_a * height_b >= 0.0 {
        return false;
    }
    let point = a + (b - a) * (height_a / (height_a - height_b));
    (0..occluder.len()).all(|k| {
        let edge = occluder[(k + 1) % occluder.len()] - occluder[k];
        normal.cross(edge).dot(point - occluder[k]) >= 0.0
    })
}

/// Returns the estimate of the exchange area and its standard error.
fn sampled(p: &Polygon, q: &Polygon, occluders: &[Polygon], n: u32, stream: u64) -> (f64, f64) {
    let (normal_p, normal_q) = (polygon::area_vector(p), polygon::area_vector(q));
    let (from, to) = (UniformOnPolygon::new(p), UniformOnPolygon::new(q));
    let mut points = PointStream::new(Sequence::Random, 31, stream);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..n {
        let [s, t, u, v] = points.next_point();
        let (x, y) = (from.point(s, t), to.point(u, v));
        let r = y - x;
        let cosines = normal_p.dot(r).max(0.0) * (-normal_q.dot(r)).max(0.0);
        if cosines > 0.0 && !occluders.iter().any(|occluder| crosses(occluder, x, y)) {
            let value = cosines / (std::f64::consts::PI * r.length_squared().powi(2));
            sum += value;
            squares += value * value;
        }
    }
    let n = f64::from(n);
    (sum / n, ((squares / n - (sum / n).powi(2)) / n).sqrt())
}

#[test]
fn random_sampling_agrees_within_its_noise() {
    let mut random = Random::new(32);
    let mut n_partial = 0;
    for case in 0..40 {
        let (p, q, occluders) = random_case(&mut random);
        if p.iter().any(|v| q.contains(v)) {
            continue; // a kernel without variance
        }
        let exact = exchange(&p, &q, &occluders, 1e-5);
        let (value, deviation) = sampled(&p, &q, &occluders, 100_000, case);
        let difference = (value - exact.exchange_area).abs();
        assert!(
            difference <= 4.5 * deviation + exact.error,
            "{value} ± {deviation}, {exact:?}"
        );
        n_partial += usize::from(exact.exchange_area > 0.0 && deviation < 0.05 * exact.exchange_area);
    }
    assert!(n_partial >= 15, "{n_partial} cases with light and little noise");
}
