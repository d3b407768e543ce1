#![expect(clippy::unwrap_used, reason = "a test may stop at bad reference data")]
use super::contour::contour_sum;
use super::double_double::DoubleDouble;
use super::facing::FacingPair;
use super::gauss_lambert::{distance_in_radii, lambert_sum};
use super::gauss_product::product_sum;
use super::prepared::PreparedPolygon;
use super::*;
use glam::DVec3;

fn reference() -> Vec<(String, Vec<DVec3>, Vec<DVec3>, f64)> {
    let text = include_str!("../../../tests/data/reference/polygon_pairs.json");
    let cases: serde_json::Value = serde_json::from_str(text).unwrap();
    let number = |v: &serde_json::Value| v.as_str().unwrap().parse::<f64>().unwrap();
    let polygon = |v: &serde_json::Value| -> Vec<DVec3> {
        v.as_array()
            .unwrap()
            .iter()
            .map(|p| DVec3::new(number(&p[0]), number(&p[1]), number(&p[2])))
            .collect()
    };
    cases
        .as_array()
        .unwrap()
        .iter()
        .map(|c| {
            (
                c["name"].as_str().unwrap().to_string(),
                polygon(&c["P"]),
                polygon(&c["Q"]),
                number(&c["AF"]),
            )
        })
        .collect()
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
        let e = exchange_area(&p, &q, Tolerance::default());
        println!("{:?} rel {:.1e}", e, e.value / exact - 1.0);
        let r = |x: f64| x / exact - 1.0;
        println!(
            "{name:25} {exact:.3e} cut {} f64 {:.1e} est {:.1e} {t1:?} | dd {:.1e} est {:.1e} {t2:?} | gp {:.1e} gl {:.1e} {:?}",
            pair.is_cut(),
            r(c.value),
            c.error / exact,
            r(d.value),
            d.error / exact,
            r(g),
            r(l),
            distance_in_radii(&pair).0
        );
    }
}

struct Lcg(u64);
impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64) / 2f64.powi(53)
    }
    fn vec(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }
}
fn random_polygon(g: &mut Lcg) -> Vec<DVec3> {
    let (u, v) = (g.vec(), g.vec());
    let (u, v) = (u.normalize(), v.normalize());
    let thin = if g.next() < 0.5 { 1.0 } else { g.next() };
    if g.next() < 0.5 {
        vec![DVec3::ZERO, u, v * thin]
    } else if g.next() < 0.5 {
        vec![DVec3::ZERO, u, u + v * thin, v * thin]
    } else {
        let (a, b) = (0.3 + g.next(), 0.3 + g.next());
        vec![DVec3::ZERO, u, u * a + v * b * thin, v * thin]
    }
}

#[test]
#[ignore]
fn calibrate_product() {
    let mut g = Lcg(5);
    let bins = 12;
    for q in 2..=10usize {
        let mut worst = vec![0.0f64; bins];
        let mut worst_rel = vec![0.0f64; bins];
        for _ in 0..20000 {
            let p1 = random_polygon(&mut g);
            let p2 = random_polygon(&mut g);
            let s = 10f64.powf(-g.next());
            let d = 10f64.powf(g.next() * 1.3) * 1.0;
            let dir = g.vec().normalize() * d;
            let p2: Vec<DVec3> = p2.iter().map(|v| *v * s + dir).collect();
            let (a, b) = (PreparedPolygon::new(&p1), PreparedPolygon::new(&p2));
            let Some(pair) = FacingPair::new(&a, &b) else { continue };
            if pair.is_cut() {
                continue;
            }
            let dist = (pair.shift() + b.centre() - a.centre()).length();
            let (r1, r2) = (a.radius(), b.radius());
            let dd = dist - r2;
            if dd < 1.2 * r1 || dist - r1 < 1.2 * r2 {
                continue;
            }
            let rho = dd / r1 + ((dd / r1).powi(2) - 1.0).sqrt();
            let qb = if s < 1.0 { 20 } else { 20 };
            let fine = product_sum(&pair, [20, qb]);
            let coarse = product_sum(&pair, [q, qb]);
            let h = |p: &super::facing::Part| (0..p.polygon.n_corners()).map(|k| p.heights.get(k)).fold(0.0, f64::max);
            let scale = a.area() * b.area() * h(&pair.first) * h(&pair.second) / dist.powi(4) / 3.14159;
            let err = (coarse - fine).abs();
            if err < 1e-15 * scale {
                continue;
            }
            let ratio = err / scale / rho.powi(-2 * q as i32);
            let k = ((rho.ln() / 0.35) as usize).min(bins - 1);
            worst[k] = worst[k].max(ratio);
            worst_rel[k] = worst_rel[k].max(err / fine / rho.powi(-2 * q as i32));
        }
        println!(
            "q {q}: {:?}",
            worst.iter().map(|x| format!("{x:.2}")).collect::<Vec<_>>().join(" ")
        );
        println!(
            "   rel {:?}",
            worst_rel
                .iter()
                .map(|x| format!("{x:.1}"))
                .collect::<Vec<_>>()
                .join(" ")
        );
    }
}

#[test]
#[ignore]
fn calibrate_lambert() {
    let mut g = Lcg(7);
    let bins = 12;
    for q in 2..=12usize {
        let mut worst = vec![0.0f64; bins];
        for _ in 0..10000 {
            let p1 = random_polygon(&mut g);
            let p2 = random_polygon(&mut g);
            let s = 10f64.powf(-2.0 * g.next());
            let at = p2[0] + (p2[1] - p2[0]) * g.next() + (p2[2] - p2[0]) * g.next();
            let d = 10f64.powf(g.next() * 3.0 - 2.5);
            let dir = at + g.vec().normalize() * d;
            let p1: Vec<DVec3> = p1.iter().map(|v| *v * s + dir).collect();
            let (a, b) = (PreparedPolygon::new(&p1), PreparedPolygon::new(&p2));
            let Some(pair) = FacingPair::new(&a, &b) else { continue };
            let (ratio, area) = distance_in_radii(&pair);
            if ratio < 1.1 {
                continue;
            }
            let rho = ratio + (ratio * ratio - 1.0).sqrt();
            let fine = lambert_sum(&pair, 20);
            let coarse = lambert_sum(&pair, q);
            let err = (coarse - fine).abs() / area;
            if err < 1e-14 {
                continue;
            }
            let k = ((rho.ln() / 0.35) as usize).min(bins - 1);
            worst[k] = worst[k].max(err / rho.powi(-2 * q as i32));
        }
        println!(
            "q {q}: {:?}",
            worst.iter().map(|x| format!("{x:.3}")).collect::<Vec<_>>().join(" ")
        );
    }
}
