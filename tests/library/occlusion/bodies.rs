//! Convex solids of many sides, which occlude by their silhouettes: against the same sides one by one, and in closed rooms.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use radiosity::form_factor::partial::{Accuracy, VisibleFactor, exchange_area};
use radiosity::geometry::polygon;
use radiosity::visibility::occluders::{Occluder, OccluderIndex, PairVisibility};

use super::scenes::Random;
use super::shapes::{
    BUDGET, Polygon, all_pairs, area, cuboid, exchange, random_polygon, random_rotation, rectangle, scene_of, turned,
};

/// An ellipsoid of `n` rings of `2 n` facets, which look outwards; triangles at the poles.
fn ellipsoid(centre: DVec3, radii: DVec3, n: u32) -> Vec<Polygon> {
    ellipsoid_cut(centre, radii, n, 0.0)
}

/// The same with the angle `cut` from the lower pole cut off.
fn ellipsoid_cut(centre: DVec3, radii: DVec3, n: u32, cut: f64) -> Vec<Polygon> {
    let at = |i: u32, j: u32| {
        if i == n || i == 0 && cut == 0.0 {
            return centre + radii * DVec3::Z * if i == 0 { -1.0 } else { 1.0 };
        }
        let (polar, around) = (
            (PI * f64::from(i) / f64::from(n)).max(cut),
            PI * f64::from(j % (2 * n)) / f64::from(n),
        );
        centre + radii * DVec3::new(polar.sin() * around.cos(), polar.sin() * around.sin(), -polar.cos())
    };
    let facet = |(i, j)| {
        let mut corners = vec![at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
        corners.dedup();
        if corners.first() == corners.last() {
            corners.pop();
        }
        corners
    };
    let part_of_bottom = |k: u32| vec![at(0, 0), at(0, k + 2), at(0, k + 1), at(0, k)];
    let bottom = (1..2 * n - 1).step_by(2).filter(|_| cut > 0.0);
    (0..n)
        .flat_map(|i| (0..2 * n).map(move |j| (i, j)))
        .map(facet)
        .chain(bottom.map(part_of_bottom))
        .collect()
}

/// A tube of `n` sides without ends.
fn tube(low: DVec3, high: DVec3, radius: f64, n: u32) -> Vec<Polygon> {
    let at = |end: DVec3, k: u32| {
        let around = TAU * f64::from(k % n) / f64::from(n);
        end + radius * DVec3::new(around.cos(), around.sin(), 0.0)
    };
    (0..n)
        .map(|k| vec![at(low, k), at(low, k + 1), at(high, k + 1), at(high, k)])
        .collect()
}

/// A solid and two polygons on different sides of it that see each other partly, with the sides of the solid between them.
fn cases(seed: u64, n: usize, mut visit: impl FnMut(&Polygon, &Polygon, Vec<Occluder<'_>>, &mut Random)) {
    let mut random = Random::new(seed);
    let mut n_found = 0;
    for _ in 0..40 * n {
        let radii = 0.3 * (random.point() + 0.5);
        let body = turned(
            ellipsoid(DVec3::ZERO, radii, 4),
            random_rotation(&mut random, TAU),
            DVec3::ZERO,
        );
        let index = OccluderIndex::new(&scene_of(&body));
        let up = random_rotation(&mut random, TAU);
        let mut place = |side: f64| {
            let tilt = random_rotation(&mut random, 0.7);
            let centre = DVec3::Z * side * random.between(0.4, 1.2) + 0.3 * random.direction();
            let facing = if side < 0.0 {
                DQuat::IDENTITY
            } else {
                DQuat::from_rotation_x(PI)
            };
            let size = random.between(0.3, 3.0);
            random_polygon(&mut random, up * centre, up * tilt * facing, size)
        };
        let (p, q) = (place(-1.0), place(1.0));
        let PairVisibility::Partial(ids) = index.classify(&p, &q) else {
            continue;
        };
        let occluders = index.occluders(&p, &q, &ids);
        if occluders.iter().filter(|side| side.body.is_some()).count() < 7 {
            continue;
        }
        visit(&p, &q, occluders, &mut random);
        n_found += 1;
        if n_found == n {
            return;
        }
    }
    panic!("{n_found} of {n} cases");
}

/// The same polygons, of which nothing is known.
fn loose<'a>(occluders: &[Occluder<'a>]) -> Vec<Occluder<'a>> {
    let mut found = occluders.to_vec();
    for side in &mut found {
        (side.one_sided, side.body) = (false, None);
    }
    found
}

#[test]
fn a_silhouette_hides_what_the_sides_hide() {
    let (mut n_partly, mut n_cut) = (0, 0);
    cases(3, 300, |p, q, occluders, random| {
        let normal = polygon::area_vector(p).normalize();
        let mut by_silhouette = VisibleFactor::new(p, normal, q, &occluders);
        let mut by_sides = VisibleFactor::new(p, normal, q, &loose(&occluders));
        let mut whole = VisibleFactor::new(p, normal, q, &[]);
        for _ in 0..20 {
            let weights: Vec<f64> = p.iter().map(|_| random.unit()).collect();
            let sum: f64 = weights.iter().sum();
            let point = p.iter().zip(&weights).map(|(&v, w)| v * (w / sum)).sum();
            let [seen, expected, all] = [&mut by_silhouette, &mut by_sides, &mut whole].map(|f| f.at(point));
            assert!((seen - expected).abs() < 1e-13, "{seen} {expected} of {all}");
            n_partly += usize::from(seen > 0.0 && seen < all - 1e-9);
        }
        let cuts = |side: &Occluder<'_>| {
            let up = polygon::area_vector(&side.corners);
            let heights = || q.iter().map(|&v| up.dot(v - side.corners[0]));
            heights().any(|h| h > 0.0) && heights().any(|h| h < 0.0)
        };
        n_cut += usize::from(occluders.iter().any(cuts));
    });
    assert!(n_partly > 1500 && n_cut > 100, "{n_partly} {n_cut}");
}

#[test]
fn integrals_past_bodies_agree_with_those_along_their_lines() {
    cases(5, 12, |p, q, occluders, _| {
        let with = |list: &[Occluder<'_>], tolerance: f64| {
            let accuracy = Accuracy {
                tolerance,
                budget: BUDGET,
            };
            let result = exchange_area(p, q, list, accuracy);
            assert!(result.reached, "{result:?}");
            result
        };
        let sides: Vec<Occluder<'_>> = occluders
            .iter()
            .map(|side| Occluder {
                body: None,
                ..side.clone()
            })
            .collect();
        let expected = with(&sides, 1e-6);
        for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
            let found = with(&occluders, tolerance);
            let off = (found.exchange_area - expected.exchange_area).abs();
            assert!(
                off <= found.error + expected.error,
                "{tolerance}: {off:e} {found:?} {expected:?}"
            );
            assert!(found.error > 0.005 * tolerance * area(p).min(area(q)));
        }
    });
}

/// A globe that floats, one whose seam has two corners in one place, and a pillar from floor to ceiling, which stand and close nothing by themselves.
#[test]
fn rooms_with_round_things_are_closed() {
    let room = cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.5), false);
    let globe = ellipsoid(DVec3::new(1.4, 1.6, 1.3), DVec3::new(0.7, 0.6, 0.8), 5);
    let mut seam = globe.clone();
    for corner in seam.iter_mut().step_by(10).flatten() {
        *corner += DVec3::new(1e-16, -2e-16, 1e-16);
    }
    let pillar = tube(DVec3::new(2.9, 1.4, 0.0), DVec3::new(2.9, 1.4, 2.5), 0.4, 9);
    for (body, n_ends) in [(&globe, 0), (&seam, 0), (&pillar, 2)] {
        let mut faces = room.clone();
        faces.extend(body.iter().cloned());
        // Inside of the pillar, its ends see each other.
        let end = |k: usize| pillar.iter().map(|side| side[k]).collect::<Polygon>();
        let (foot, mut head) = (end(0), end(3));
        head.reverse();
        let hidden = area(&foot) - exchange(&foot, &head, &[], 1e-9).exchange_area;
        for tolerance in [1e-3, 1e-5] {
            for (i, row) in all_pairs(&faces, tolerance).iter().enumerate() {
                let stands = n_ends > 0 && (i == 4 || i == 5);
                let expected = area(&faces[i]) - if stands { hidden } else { 0.0 };
                let sum: f64 = row.iter().sum();
                let off = (sum - expected).abs() / area(&faces[i]);
                assert!(
                    off < 3.0 * tolerance,
                    "row {i} of {} at {tolerance}: {off:e}",
                    faces.len()
                );
            }
        }
    }
}

/// A globe in the middle of a globe: pairs are their own mirror images, so that either polygon may receive, and tight tolerances look for lines after all.
#[test]
fn globes_in_globes_are_closed() {
    let mut faces = ellipsoid(DVec3::ZERO, DVec3::splat(0.5), 3);
    let mut shell = ellipsoid(DVec3::ZERO, DVec3::ONE, 2);
    for face in &mut shell {
        face.reverse();
    }
    faces.extend(shell);
    for tolerance in [1e-3, 1e-5, 1e-7] {
        for (i, row) in all_pairs(&faces, tolerance).iter().enumerate() {
            let off = (row.iter().sum::<f64>() / area(&faces[i]) - 1.0).abs();
            assert!(off < 10.0 * tolerance, "row {i} at {tolerance}: {off:e}");
        }
    }
}

/// A thing of which one corner touches the floor hides what is behind it, and nothing under it.
#[test]
fn a_body_may_stand_on_a_corner() {
    let body = ellipsoid(DVec3::new(0.0, 0.0, 0.5), DVec3::splat(0.5), 4);
    let floor = rectangle(DVec3::new(-3.0, -3.0, 0.0), DVec3::X * 6.0, DVec3::Y * 6.0);
    let wall = rectangle(DVec3::new(-3.0, -1.0, 0.0), DVec3::Y * 2.0, DVec3::Z * 2.0);
    let index = OccluderIndex::new(&scene_of(&body));
    let PairVisibility::Partial(ids) = index.classify(&floor, &wall) else {
        panic!("the body hides a part of the floor");
    };
    let occluders = index.occluders(&floor, &wall, &ids);
    let accuracy = Accuracy {
        tolerance: 1e-4,
        budget: BUDGET,
    };
    let [past, by_sides] = [&occluders, &loose(&occluders)].map(|list| exchange_area(&floor, &wall, list, accuracy));
    let off = (past.exchange_area - by_sides.exchange_area).abs();
    assert!(
        past.reached && off <= past.error + by_sides.error,
        "{past:?} {by_sides:?}"
    );
}

/// A facet so small that its corners count as one has no edges, and no part in a silhouette.
#[test]
fn a_side_may_be_a_point() {
    let (centre, radii) = (DVec3::new(0.0, 0.0, 0.5), DVec3::splat(0.4));
    let floor = rectangle(DVec3::new(-1.0, -1.0, -0.5), DVec3::X * 2.0, DVec3::Y * 2.0);
    let roof = rectangle(DVec3::new(-1.0, -1.0, 1.5), DVec3::Y * 2.0, DVec3::X * 2.0);
    let accuracy = Accuracy {
        tolerance: 1e-6,
        budget: BUDGET,
    };
    let [whole, cut] = [(0.0, 32), (1e-13, 35)].map(|(cut, n_sides)| {
        let body = ellipsoid_cut(centre, radii, 4, cut);
        assert_eq!(body.len(), n_sides);
        let index = OccluderIndex::new(&scene_of(&body));
        let PairVisibility::Partial(ids) = index.classify(&floor, &roof) else {
            panic!("the body hides a part of the roof");
        };
        let occluders = index.occluders(&floor, &roof, &ids);
        assert!(occluders.iter().all(|side| side.body.is_some()));
        let past = exchange_area(&floor, &roof, &occluders, accuracy);
        assert!(past.reached, "{past:?}");
        past
    });
    let off = (whole.exchange_area - cut.exchange_area).abs();
    assert!(off <= whole.error + cut.error, "{whole:?} {cut:?}");
}
