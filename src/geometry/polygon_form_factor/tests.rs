#![expect(clippy::unwrap_used, reason = "a test may stop at bad reference data")]
use glam::DVec3;
use super::contour::contour_sum;
use super::double_double::DoubleDouble;
use super::facing::FacingPair;
use super::gauss_lambert::{lambert_sum, distance_in_radii};
use super::gauss_product::product_sum;
use super::prepared::PreparedPolygon;

fn reference() -> Vec<(String, Vec<DVec3>, Vec<DVec3>, f64)> {
    let text = include_str!("../../../tests/data/reference/polygon_pairs.json");
    let cases: serde_json::Value = serde_json::from_str(text).unwrap();
    let number = |v: &serde_json::Value| v.as_str().unwrap().parse::<f64>().unwrap();
    let polygon = |v: &serde_json::Value| -> Vec<DVec3> {
        v.as_array().unwrap().iter().map(|p| DVec3::new(number(&p[0]), number(&p[1]), number(&p[2]))).collect()
    };
    cases.as_array().unwrap().iter().map(|c| (c["name"].as_str().unwrap().to_owned(), polygon(&c["P"]), polygon(&c["Q"]), number(&c["AF"]))).collect()
}

#[test]
fn try_all() {
    for (name, p, q, exact) in reference() {
        let (p, q) = (PreparedPolygon::new(&p), PreparedPolygon::new(&q));
        let pair = FacingPair::new(&p, &q).unwrap();
        let t = std::time::Instant::now();
        let c = contour_sum::<f64>(&pair, 17.0);
        let t1 = t.elapsed();
        let t = std::time::Instant::now();
        let _ = contour_sum::<DoubleDouble>(&pair, 30.0);
        let d = contour_sum::<DoubleDouble>(&pair, 30.0);
        let t2 = t.elapsed() / 2;
        let g = product_sum(&pair, [8, 8]);
        let l = lambert_sum(&pair, 8);
        let r = |x: f64| x / exact - 1.0;
        println!("{name:25} {exact:.3e} cut {} f64 {:.1e} est {:.1e} {t1:?} | dd {:.1e} est {:.1e} {t2:?} | gp {:.1e} gl {:.1e} {:?}", pair.is_cut(), r(c.value), c.error/exact, r(d.value), d.error/exact, r(g), r(l), distance_in_radii(&pair).0);
    }
}
