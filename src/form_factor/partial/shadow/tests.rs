use super::*;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::sampling::Random;

fn rectangle(corner: DVec3, a: DVec3, b: DVec3) -> Vec<DVec3> {
    vec![corner, corner + a, corner + a + b, corner + b]
}

fn ceiling() -> Vec<DVec3> {
    rectangle(DVec3::Z, DVec3::Y, DVec3::X)
}

fn shadows(occluders: &[(Vec<DVec3>, bool)]) -> Shadows {
    let receiver = Receiver::new(rectangle(DVec3::ZERO, DVec3::X, DVec3::Y), DVec3::Z);
    let mut list = Vec::new();
    for (corners, one_sided) in occluders {
        list.push(Occluder {
            corners: corners.into(),
            one_sided: *one_sided,
            body: None,
        });
    }
    Shadows::new(&receiver, &ceiling(), &list)
}

fn factor(occluders: &[(Vec<DVec3>, bool)], point: DVec3) -> f64 {
    shadows(occluders).visible_and_hidden(point)[0]
}

const POINT: DVec3 = DVec3::new(0.25, 0.5, 0.0);

#[test]
fn without_occluders_it_is_the_whole_target() {
    let exact = point_form_factor(POINT, DVec3::Z, &ceiling());
    assert!((factor(&[], POINT) - exact).abs() < 1e-15);
}

#[test]
fn a_plate_takes_away_what_is_behind_it() {
    // The plate at half height hides twice its size; its image is [0.25, 0.75] × [0, 0.5].
    let plate = rectangle(DVec3::new(0.25, 0.25, 0.5), DVec3::X * 0.25, DVec3::Y * 0.25);
    let image = rectangle(DVec3::new(0.25, 0.0, 1.0), DVec3::Y * 0.5, DVec3::X * 0.5);
    let exact = point_form_factor(POINT, DVec3::Z, &ceiling()) - point_form_factor(POINT, DVec3::Z, &image);
    let turned: Vec<DVec3> = plate.iter().rev().copied().collect();
    let beyond: Vec<DVec3> = plate.iter().map(|&v| v + DVec3::Z).collect();
    for occluders in [
        vec![(plate.clone(), false)],
        vec![(turned.clone(), false)],
        vec![(turned.clone(), true)],
        vec![(plate.clone(), false), (turned.clone(), false), (beyond, false)],
    ] {
        assert!((factor(&occluders, POINT) - exact).abs() < 1e-15, "{occluders:?}");
    }
    // Its front looks up: one-sided it hides nothing from below.
    let whole = point_form_factor(POINT, DVec3::Z, &ceiling());
    assert!((factor(&[(plate, true)], POINT) - whole).abs() < 1e-15);
}

#[test]
fn a_plate_through_the_target_hides_only_what_is_behind_the_part_before_it() {
    // A wall in the plane x = 0.5 whose lower edge is at half height: from x = 0.25 it hides the ceiling from 0.5 to 0.75, and its part
    // above the ceiling hides no more.
    let seen = [
        rectangle(DVec3::Z, DVec3::Y, DVec3::X * 0.5),
        rectangle(DVec3::new(0.75, 0.0, 1.0), DVec3::Y, DVec3::X * 0.25),
    ];
    let exact: f64 = seen.iter().map(|part| point_form_factor(POINT, DVec3::Z, part)).sum();
    for height in [0.5, 4.0] {
        let wall = rectangle(DVec3::new(0.5, -1.0, 0.5), DVec3::Y * 3.0, DVec3::Z * height);
        let value = factor(&[(wall, false)], POINT);
        assert!((value - exact).abs() < 1e-15, "{value} {exact}");
    }
}

#[test]
fn several_bodies_are_told_from_sides_of_one() {
    let may_hide = |occluders: &[(Vec<DVec3>, bool)]| {
        let mut shadows = shadows(occluders);
        shadows.find_bodies();
        shadows.several_may_hide(POINT)
    };
    let plate = |x: f64, z: f64| (rectangle(DVec3::new(x, 0.4, z), DVec3::X * 0.1, DVec3::Y * 0.1), false);
    assert!(!may_hide(&[plate(0.2, 0.5)]));
    assert!(may_hide(&[plate(0.2, 0.5), plate(0.35, 0.5)]));
    // One wholly in the other's shadow, whichever hides more, and one that hides no part of the target.
    assert!(may_hide(&[plate(0.2, 0.3), plate(0.22, 0.4)]));
    assert!(!may_hide(&[plate(0.2, 0.5), plate(0.8, 0.3)]));
    // The lower side of a box and the one that looks along −x: both hide something.
    let (low, high) = (DVec3::new(0.4, 0.3, 0.3), DVec3::new(0.6, 0.6, 0.6));
    let size = high - low;
    let below = rectangle(low, DVec3::Y * size.y, DVec3::X * size.x);
    let beside = rectangle(low, DVec3::Z * size.z, DVec3::Y * size.y);
    assert!(!may_hide(&[(below.clone(), true), (beside.clone(), true)]));
    assert!(may_hide(&[(below, false), (beside, false)]));
}

#[test]
fn nothing_is_left_behind_a_screen_of_pieces() {
    let mut screen = Vec::new();
    for k in 0..9 {
        let corner = DVec3::new(f64::from(k % 3) * 1.1 - 1.2, f64::from(k / 3) * 1.1 - 1.2, 0.4);
        screen.push((rectangle(corner, DVec3::X * 1.1, DVec3::Y * 1.1), false));
    }
    assert!(factor(&screen, POINT).abs() < f64::MIN_POSITIVE);
    screen.remove(4);
    assert!(factor(&screen, POINT) > 0.1);
}

#[test]
fn a_plate_seen_edge_on_hides_nothing() {
    let plate = rectangle(DVec3::new(0.25, -1.0, 0.2), DVec3::Y * 3.0, DVec3::Z * 0.5);
    let whole = point_form_factor(POINT, DVec3::Z, &ceiling());
    assert!((factor(&[(plate, false)], POINT) - whole).abs() < 1e-15);
}

/// A ball with dents, or what is left of one without its `lost` first facets, by rings of triangles.
fn dented_ball(next: &mut impl FnMut() -> f64, dent: f64, lost: usize) -> Vec<(Vec<DVec3>, bool)> {
    const N: [usize; 2] = [9, 6];
    let corners: Vec<Vec<DVec3>> = (0..=N[1])
        .map(|ring| {
            let polar = std::f64::consts::PI * ring as f64 / N[1] as f64;
            let pole = next();
            let of_ring = (0..N[0]).map(|k| {
                let angle = TAU * k as f64 / N[0] as f64;
                let way = DVec3::new(polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos());
                let share = if ring % N[1] == 0 { pole } else { next() };
                DVec3::new(0.5, 0.4, 0.45) + way * (0.3 - dent * share)
            });
            of_ring.collect()
        })
        .collect();
    let mut facets = Vec::new();
    for ring in 0..N[1] {
        for k in 0..N[0] {
            let [a, b] = [k, (k + 1) % N[0]].map(|k| corners[ring][k]);
            let [d, c] = [k, (k + 1) % N[0]].map(|k| corners[ring + 1][k]);
            if ring > 0 {
                facets.push((vec![a, d, b], false));
            }
            if ring + 1 < N[1] {
                facets.push((vec![b, d, c], false));
            }
        }
    }
    facets.split_off(lost)
}

#[test]
fn the_triangles_of_an_outline_hide_what_the_facets_do() {
    let mut random = Random(1);
    let mut next = || random.unit();
    let mut n_by_triangles = 0;
    for case in 0..60 {
        let dent = [0.0, 1e-3, 0.03, 0.15][case % 4];
        let ball = dented_ball(&mut next, dent, [0, 17, 40][case % 3]);
        let mut with = shadows(&ball);
        let mut without = shadows(&ball);
        assert_eq!(with.groups.len(), 1);
        without.groups.clear();
        without.casters.iter_mut().for_each(|caster| caster.group = None);
        for _ in 0..20 {
            let point = DVec3::new(next(), next(), 0.0);
            let [found, expected] = [&mut with, &mut without].map(|shadows| {
                shadows.n_cuts = 0;
                shadows.visible_and_hidden(point)
            });
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-13, "{case} {point}: {found} {expected}");
            }
            n_by_triangles += usize::from(2 * with.n_cuts < without.n_cuts);
        }
    }
    assert!(n_by_triangles > 500, "{n_by_triangles}");
}
