#![expect(clippy::unwrap_used, reason = "a test may stop at bad reference data")]

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use serde_json::Value;

use super::*;
use crate::geometry::rectangle::tests::unit_cube;
use crate::geometry::sampling::{PointStream, Sequence};

/// Name, polygons and exchange area.
type Case = (String, Vec<DVec3>, Vec<DVec3>, f64);

/// Reads a list of cases; numbers may be given as text.
fn cases(text: &str, names: [&str; 3]) -> Vec<Case> {
    fn number(v: &Value) -> f64 {
        v.as_f64().unwrap_or_else(|| v.as_str().unwrap().parse().unwrap())
    }
    let polygon = |v: &Value| -> Vec<DVec3> {
        let corners = v.as_array().unwrap().iter();
        corners
            .map(|p| DVec3::new(number(&p[0]), number(&p[1]), number(&p[2])))
            .collect()
    };
    let list: Value = serde_json::from_str(text).unwrap();
    let list = list.as_array().unwrap().iter();
    list.map(|case| {
        let [p, q, value] = names.map(|name| &case[name]);
        (case["name"].to_string(), polygon(p), polygon(q), number(value))
    })
    .collect()
}

/// Certified values by another program, 25 digits.
fn certified() -> Vec<Case> {
    let text = include_str!("../../../tests/data/reference/polygon_pairs.json");
    cases(text, ["P", "Q", "AF"])
}

/// Touching, nearly coplanar, thin, far, tiny and cut pairs by mpmath, 20 digits: see the script beside the list.
fn hard() -> Vec<Case> {
    let text = include_str!("../../../tests/data/reference/polygon_pairs_hard.json");
    cases(text, ["p", "q", "exchange_area"])
}

fn assert_near(exchange: Exchange, exact: f64, relative: f64, name: &str) {
    let error = (exchange.value - exact).abs();
    assert!(error <= relative * exact, "{name}: {exchange:?} against {exact:e}");
    assert!(error <= exchange.error, "{name}: {exchange:?} against {exact:e}");
}

#[test]
fn agrees_with_certified_values() {
    let list = certified();
    assert_eq!(list.len(), 12);
    for (name, p, q, exact) in list {
        let (p, q) = (PreparedPolygon::new(&p), PreparedPolygon::new(&q));
        assert_near(exchange_area(&p, &q, Tolerance::default()), exact, 1e-14, &name);
        assert_near(exchange_area(&q, &p, Tolerance::default()), exact, 1e-14, &name);
        assert_near(contour_extended(&p, &q), exact, 5e-16, &name);
        // An estimate must hold for every rule, good or bad.
        for order in [1, 4, 9] {
            assert_near(gauss_product(&p, &q, order), exact, f64::INFINITY, &name);
            assert_near(gauss_lambert(&p, &q, order), exact, f64::INFINITY, &name);
        }
        assert_near(contour(&p, &q), exact, f64::INFINITY, &name);
    }
}

#[test]
fn agrees_with_mpmath_where_it_is_hard() {
    let list = hard();
    assert_eq!(list.len(), 60);
    for (name, p, q, exact) in list {
        let (p, q) = (PreparedPolygon::new(&p), PreparedPolygon::new(&q));
        for (a, b) in [(&p, &q), (&q, &p)] {
            assert_near(exchange_area(a, b, Tolerance::default()), exact, 1e-13, &name);
            assert_near(contour(a, b), exact, f64::INFINITY, &name);
            assert_near(contour_extended(a, b), exact, f64::INFINITY, &name);
        }
    }
}

/// Numbers from one stream.
struct Random(PointStream);

impl Random {
    fn new(seed: u64) -> Self {
        Self(PointStream::new(Sequence::Random, seed, 0))
    }

    /// Four numbers from 0 to 1.
    fn numbers(&mut self) -> [f64; 4] {
        self.0.next_point()
    }

    /// A point in the cube from −1 to 1.
    fn point(&mut self) -> DVec3 {
        let [x, y, z, _] = self.numbers();
        2.0 * DVec3::new(x, y, z) - 1.0
    }

    fn rotation(&mut self) -> DQuat {
        let [a, b, c, d] = self.numbers();
        DQuat::from_xyzw(a - 0.5, b - 0.5, c - 0.5, d - 0.5).normalize()
    }

    /// A triangle, or a convex or concave quad exactly in z = 0, of size 1 and sometimes thin.
    fn first_polygon(&mut self) -> Vec<DVec3> {
        let ([a, b, c, d], u, v) = (self.numbers(), self.point(), self.point());
        let (u, v) = (
            DVec3::new(u.x, u.y, 0.0),
            DVec3::new(v.x, v.y, 0.0) * if d < 0.5 { 1.0 } else { d * d },
        );
        match (4.0 * c).floor() {
            0.0 => vec![DVec3::ZERO, u, v],
            1.0 => vec![DVec3::ZERO, u, u + v, v],
            _ => vec![DVec3::ZERO, u, (0.1 + a) * u + (0.1 + b) * v, v],
        }
    }
}

/// Pairs at every distance from touching to far, with size ratios up to 1e4 and horizons across them.
fn random_pairs(seed: u64, n: usize) -> impl Iterator<Item = (PreparedPolygon, PreparedPolygon)> {
    let mut random = Random::new(seed);
    (0..n).filter_map(move |_| {
        let first = random.first_polygon();
        let [a, b, c, d] = random.numbers();
        let near = first[0] + a * (first[1] - first[0]) + b * (first[2] - first[0]);
        let centre = near + 10.0_f64.powf(5.0 * c - 3.0) * random.point();
        let size = 10.0_f64.powf(-4.0 * d * d);
        let second: Vec<DVec3> = (0..3).map(|_| centre + size * random.point()).collect();
        let pair = (PreparedPolygon::new(&first), PreparedPolygon::new(&second));
        (contour_extended(&pair.0, &pair.1).value > 0.0).then_some(pair)
    })
}

#[test]
fn rules_agree_within_their_estimates_and_the_tolerance_is_met() {
    let mut n_pairs = 0;
    let mut good = [0; 3];
    for (p, q) in random_pairs(1, 5000) {
        let exact = contour_extended(&p, &q).value;
        let plain = contour(&p, &q);
        assert_near(plain, exact, f64::INFINITY, "contour");
        good[0] += usize::from(plain.error < 1e-12 * exact);
        for order in [2, 3, 5, 8, 16] {
            let exchange = gauss_product(&p, &q, order);
            assert_near(exchange, exact, f64::INFINITY, "product");
            good[1] += usize::from(exchange.error < 1e-12 * exact);
            let other = gauss_lambert(&p, &q, order);
            assert_near(other, exact, f64::INFINITY, "Lambert");
            good[2] += usize::from(other.error < 1e-12 * exact);
        }
        for rel in [1e-4, 1e-8, 1e-12] {
            let exchange = exchange_area(&p, &q, Tolerance { rel, abs: 0.0 });
            assert_near(exchange, exact, rel, "tolerance");
            assert!(exchange.error <= rel * exchange.value, "{exchange:?}");
        }
        let exchange = exchange_area(&p, &q, Tolerance { rel: 0.0, abs: 1e-9 });
        assert!((exchange.value - exact).abs() <= exchange.error && exchange.error <= 1e-9);
        n_pairs += 1;
    }
    // The comparison must have met each rule where it is good.
    assert!(
        n_pairs > 2000 && good.into_iter().all(|n| n > 400),
        "{n_pairs} {good:?}"
    );
}

#[test]
fn symmetric_and_invariant() {
    let mut random = Random::new(2);
    let mut n_moved = 0;
    for (p, q) in random_pairs(3, 500) {
        let value = exchange_area(&p, &q, Tolerance::default()).value;
        let reverse = exchange_area(&q, &p, Tolerance::default()).value;
        assert!((value - reverse).abs() <= 1e-12 * value, "{value:e} {reverse:e}");
        // Powers of two change no digit, and so at most the cheap choice of a rule.
        for scale in [2.0_f64.powi(-20), 2.0_f64.powi(20)] {
            let [p, q] =
                [&p, &q].map(|p| PreparedPolygon::new(&p.corners().iter().map(|&v| scale * v).collect::<Vec<_>>()));
            let scaled = exchange_area(&p, &q, Tolerance::default()).value / (scale * scale);
            assert!((value - scaled).abs() <= 1e-15 * value, "{value:e} {scaled:e}");
        }
        // A motion rounds the corners to 1e-16 of their coordinates, which moves the contours: P ε at most, and h ε/h.
        let (turn, shift, scale) = (random.rotation(), random.point(), 3.0 + random.point().x);
        let [p2, q2] = [&p, &q].map(|p| {
            let corners: Vec<DVec3> = p.corners().iter().map(|&v| scale * (turn * v + shift)).collect();
            PreparedPolygon::new(&corners)
        });
        let moved = exchange_area(&p2, &q2, Tolerance::default()).value / (scale * scale);
        let reach = p.extent().max(q.extent()) + 1.0;
        let rounding = 1e-15 * reach * p.perimeter().min(q.perimeter());
        if rounding < 1e-10 * value {
            assert!((value - moved).abs() <= rounding, "{value:e} {moved:e}");
            n_moved += 1;
        }
    }
    assert!(n_moved > 100, "{n_moved}");
}

/// Both polygons are cut in two by a line through their middle; the parts' exchange areas add up.
#[test]
fn additive_under_subdivision() {
    let tolerance = Tolerance { rel: 1e-13, abs: 0.0 };
    let mut n_cases = 0;
    for (_, p, q, exact) in certified().into_iter().chain(hard()) {
        if p.len() != 3 || q.len() != 3 || exact < 1e-4 {
            continue;
        }
        let halves = |v: &[DVec3]| {
            // The rounding of this corner is the only error.
            let middle = 0.5 * (v[0] + v[1]);
            [[v[0], middle, v[2]], [middle, v[1], v[2]]].map(|half| PreparedPolygon::new(&half))
        };
        let mut sum = 0.0;
        for a in halves(&p) {
            for b in halves(&q) {
                sum += exchange_area(&a, &b, tolerance).value;
            }
        }
        assert!((sum - exact).abs() <= 1e-12 * exact, "{sum:e} against {exact:e}");
        n_cases += 1;
    }
    assert!(n_cases > 20);
}

/// Asserts that each face of a closed convex room sees only the others: Σ_j A_i F_ij = A_i.
fn assert_closed(faces: &[Vec<DVec3>], tolerance: f64) {
    let faces: Vec<PreparedPolygon> = faces.iter().map(|face| PreparedPolygon::new(face)).collect();
    for face in &faces {
        let sum: f64 = faces
            .iter()
            .map(|other| {
                exchange_area(
                    face,
                    other,
                    Tolerance {
                        rel: 1e-13,
                        abs: 1e-15 * face.area(),
                    },
                )
                .value
            })
            .sum();
        let error = (sum / face.area() - 1.0).abs();
        assert!(error < tolerance, "{error:e} in {faces:?}");
    }
}

#[test]
fn rows_of_a_turned_cube_sum_to_one() {
    let n = 6;
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 3.0).normalize(), 0.9);
    let mut faces = Vec::new();
    for wall in unit_cube() {
        let (u, v) = ((wall[1] - wall[0]) / f64::from(n), (wall[3] - wall[0]) / f64::from(n));
        for k in 0..n * n {
            let corner = wall[0] + f64::from(k / n) * u + f64::from(k % n) * v;
            let quad = [corner, corner + u, corner + u + v, corner + v].map(|p| turn * p);
            // Some patches as two triangles, which have no closed form.
            if k % 5 == 0 {
                faces.push(vec![quad[0], quad[1], quad[2]]);
                faces.push(vec![quad[0], quad[2], quad[3]]);
            } else {
                faces.push(quad.to_vec());
            }
        }
    }
    assert_closed(&faces, 1e-14);
}

/// The faces that two apexes make with a ring of corners, seen from inside.
fn bipyramid(ring: &[DVec3], apexes: [DVec3; 2]) -> Vec<Vec<DVec3>> {
    let n = ring.len();
    (0..n)
        .map(|k| (ring[k], ring[(k + 1) % n]))
        .flat_map(|(a, b)| [vec![b, a, apexes[0]], vec![a, b, apexes[1]]])
        .collect()
}

/// A convex ring around the z axis, counter-clockwise.
fn ring(random: &mut Random, n: u32) -> Vec<DVec3> {
    let [a, b, phase, _] = random.numbers();
    (0..n)
        .map(|k| TAU * (f64::from(k) + phase) / f64::from(n))
        .map(|angle| DVec3::new((0.3 + a) * angle.cos(), (0.3 + b) * angle.sin(), 0.0))
        .collect()
}

#[test]
fn rows_of_random_polyhedra_sum_to_one() {
    let mut random = Random::new(4);
    for trial in 0..150 {
        // Some so flat that opposite faces nearly touch and neighbours are nearly coplanar; their error is the corners' rounding.
        let [height, other, ..] = random.numbers();
        let (flat, tolerance) = [(1.0, 5e-15), (0.1, 2e-14), (1e-3, 1e-13)][trial % 3];
        let turn = random.rotation();
        let turned = |faces: Vec<Vec<DVec3>>| -> Vec<Vec<DVec3>> {
            faces
                .into_iter()
                .map(|face| face.into_iter().map(|v| turn * v).collect())
                .collect()
        };
        let base = ring(&mut random, 3 + u32::try_from(trial).unwrap() % 5);
        let apex = 0.1 * random.point();
        let up = DVec3::new(apex.x, apex.y, flat * (0.2 + height));
        let down = DVec3::new(apex.y, apex.x, -flat * (0.2 + other));
        assert_closed(&turned(bipyramid(&base, [up, down])), tolerance);

        // A pyramid, and a tetrahedron among these, has its base for a face.
        let n = base.len();
        let side = |k: usize| vec![base[(k + 1) % n], base[k], up];
        let mut pyramid: Vec<Vec<DVec3>> = (0..n).map(side).collect();
        pyramid.push(base.clone());
        assert_closed(&turned(pyramid), tolerance);

        // An oblique prism.
        let top: Vec<DVec3> = base.iter().map(|&v| v + up).collect();
        let wall = |k: usize| vec![base[(k + 1) % n], base[k], top[k], top[(k + 1) % n]];
        let mut prism: Vec<Vec<DVec3>> = (0..n).map(wall).collect();
        prism.push(base.clone());
        prism.push(top.iter().rev().copied().collect());
        assert_closed(&turned(prism), tolerance);
    }
}

#[test]
fn far_near_and_aligned_pairs_take_their_rules() {
    let square = |z: f64| {
        [
            DVec3::Z * z,
            DVec3::new(1.0, 0.0, z),
            DVec3::new(1.0, 1.0, z),
            DVec3::new(0.0, 1.0, z),
        ]
    };
    let floor = PreparedPolygon::new(&square(0.0));
    let rule = |mut corners: Vec<DVec3>| {
        corners.reverse();
        exchange_area(&floor, &PreparedPolygon::new(&corners), Tolerance::default()).rule
    };
    assert_eq!(rule(square(1e3).to_vec()), Rule::GaussProduct { orders: [2, 2] });
    assert_eq!(rule(square(0.01).to_vec()), Rule::Rectangles);
    assert_eq!(rule(square(0.01)[..3].to_vec()), Rule::Contour);
    let small: Vec<DVec3> = square(20.0).iter().map(|&v| 1e-2 * v + 0.1).collect();
    assert_eq!(rule(small), Rule::GaussLambert { order: 4 });
    let ridge = vec![DVec3::ZERO, DVec3::X, DVec3::new(0.5, -1.0, 1e-4)];
    assert_eq!(rule(ridge), Rule::ContourExtended);
}

#[test]
fn fronts_that_do_not_see_each_other_exchange_nothing() {
    let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let p = PreparedPolygon::new(&triangle);
    let unseen = |corners: &[DVec3]| {
        let q = PreparedPolygon::new(corners);
        for exchange in [
            exchange_area(&p, &q, Tolerance::default()),
            exchange_area(&q, &p, Tolerance::default()),
            contour(&p, &q),
            contour_extended(&p, &q),
            gauss_product(&p, &q, 3),
            gauss_lambert(&p, &q, 3),
        ] {
            assert_eq!(exchange, Exchange::UNSEEN, "{corners:?}");
        }
    };
    unseen(&triangle);
    unseen(&[DVec3::ZERO, DVec3::Y, DVec3::X]); // the other side of a sheet
    unseen(&triangle.map(|v| v + DVec3::Z)); // its back
    unseen(&triangle.map(|v| v - DVec3::X)); // the same plane
    unseen(&[DVec3::ZERO, DVec3::Y, DVec3::X].map(|v| v - DVec3::Z)); // below
    unseen(&[DVec3::ZERO, DVec3::X, DVec3::Z]); // a wall that faces away
    unseen(&[DVec3::ZERO, DVec3::X, DVec3::new(0.5, 0.5, 1e-17)]); // the same plane but for rounding
    unseen(&[]);
    unseen(&[DVec3::Z]);
    unseen(&[DVec3::Z, DVec3::X + DVec3::Z, 2.0 * DVec3::X + DVec3::Z]); // no area
    unseen(&[DVec3::Z, DVec3::splat(f64::NAN), DVec3::X]);
}

#[test]
fn doubled_corners_and_corners_on_edges_change_nothing() {
    for (name, p, q, exact) in certified() {
        let crowded = |v: &[DVec3]| -> Vec<DVec3> {
            let n = v.len();
            (0..n)
                .flat_map(|k| [v[k], v[k], 0.5 * (v[k] + v[(k + 1) % n])])
                .collect()
        };
        let exchange = exchange_area(
            &PreparedPolygon::new(&crowded(&p)),
            &PreparedPolygon::new(&crowded(&q)),
            Tolerance { rel: 1e-11, abs: 0.0 },
        );
        // The middle of an edge is rounded, up to 1e-16 of the coordinates.
        assert!((exchange.value - exact).abs() < 1e-12 * exact, "{name}: {exchange:?}");
    }
}
