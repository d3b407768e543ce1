//! Which faces occlude two patches from each other.

use std::f64::consts::TAU;

use glam::DVec3;
use radiosity::geometry::polygon;
use radiosity::visibility::occluders::{OccluderId, OccluderIndex, PairVisibility};

use super::scenes::Random;
use super::shapes::{Polygon, cuboid, cut, in_triangles, random_polygon, random_rotation, rectangle, scene_of, turned};

/// A point inside a polygon.
fn inside(random: &mut Random, polygon: &Polygon) -> DVec3 {
    let weights: Vec<f64> = polygon.iter().map(|_| 0.01 + random.unit()).collect();
    let total: f64 = weights.iter().sum();
    polygon.iter().zip(&weights).map(|(&v, w)| v * (w / total)).sum()
}

fn crosses(occluder: &[DVec3], a: DVec3, b: DVec3) -> bool {
    let normal = polygon::area_vector(occluder).normalize();
    let (height_a, height_b) = (normal.dot(a - occluder[0]), normal.dot(b - occluder[0]));
    if height_a.abs().min(height_b.abs()) < 1e-9 || height_a * height_b > 0.0 {
        return false;
    }
    let point = a + (b - a) * (height_a / (height_a - height_b));
    (0..occluder.len()).all(|k| {
        let edge = occluder[(k + 1) % occluder.len()] - occluder[k];
        normal.cross(edge.normalize()).dot(point - occluder[k]) > 1e-9
    })
}

#[test]
fn nothing_stands_between_patches_of_a_convex_room_wherever_it_is() {
    let mut random = Random::new(41);
    for _ in 0..6 {
        let motion = random.motion();
        let mut walls = cuboid(DVec3::ZERO, DVec3::new(3.0, 2.0, 2.5), false);
        for wall in &mut walls {
            for v in wall {
                *v = motion.point(*v);
            }
        }
        let patches: Vec<(usize, Polygon)> = (0..6)
            .flat_map(|i| cut(&walls[i], 3, 4).into_iter().map(move |p| (i, p)))
            .collect();
        let faces: Vec<Polygon> = patches.iter().map(|(_, p)| p.clone()).collect();
        for variant in [in_triangles(&faces), faces] {
            let index = OccluderIndex::new(&scene_of(&variant));
            for (i, p) in &patches {
                for (j, q) in &patches {
                    let expected = if i == j {
                        PairVisibility::None
                    } else {
                        PairVisibility::Full
                    };
                    assert_eq!(index.classify(p, q), expected);
                }
            }
        }
    }
}

#[test]
fn flat_neighbours_are_joined_and_sheets_count_once() {
    let walls = cuboid(DVec3::ZERO, DVec3::new(3.0, 2.0, 2.5), false);
    let fine: Vec<Polygon> = walls.iter().flat_map(|wall| in_triangles(&cut(wall, 4, 3))).collect();
    let index = OccluderIndex::new(&scene_of(&fine));
    assert_eq!(index.n_occluders(), 6);
    for k in 0..6 {
        assert_eq!(index.corners(OccluderId(k)).len(), 4);
        assert_eq!(index.faces(OccluderId(k)).len(), 24);
    }
    let sheet = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let back: Polygon = sheet.iter().rev().copied().collect();
    assert_eq!(OccluderIndex::new(&scene_of(&[sheet, back])).n_occluders(), 1);
    // An L is not convex: two occluders.
    let corner = [
        rectangle(DVec3::ZERO, DVec3::X, DVec3::Y),
        rectangle(DVec3::X, DVec3::X, DVec3::Y),
        rectangle(DVec3::Y, DVec3::X, DVec3::Y),
    ];
    assert_eq!(OccluderIndex::new(&scene_of(&corner)).n_occluders(), 2);
}

#[test]
fn only_sides_of_convex_solids_seen_from_outside_are_one_sided() {
    let room = cuboid(DVec3::splat(-3.0), DVec3::splat(3.0), false);
    let solid = cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), true);
    let plate = rectangle(DVec3::new(-1.0, -1.0, 1.5), DVec3::X * 2.0, DVec3::Y * 2.0);
    let mut faces = room.clone();
    faces.extend(in_triangles(&solid));
    faces.push(plate.clone());
    let index = OccluderIndex::new(&scene_of(&faces));
    assert_eq!(index.n_occluders(), 13);
    let PairVisibility::Partial(ids) = index.classify(&room[4], &room[5]) else {
        panic!("solid and plate occlude floor and ceiling");
    };
    let occluders = index.occluders(&room[4], &room[5], &ids);
    assert_eq!(occluders.len(), 7);
    for occluder in &occluders {
        assert_eq!(occluder.one_sided, occluder.corners != plate);
    }
    // From inside of the solid its sides are not.
    let within = rectangle(DVec3::splat(-0.1), DVec3::X * 0.1, DVec3::Y * 0.1);
    assert!(
        index
            .occluders(&within, &room[5], &ids)
            .iter()
            .all(|occluder| !occluder.one_sided)
    );
}

#[test]
fn the_answers_agree_with_random_segments() {
    let mut random = Random::new(42);
    let (mut n_full, mut n_none, mut n_partial) = (0, 0, 0);
    for _ in 0..25 {
        let mut faces: Vec<Polygon> = Vec::new();
        for _ in 0..12 {
            let rotation = random_rotation(&mut random, TAU);
            let centre = 4.0 * random.point();
            let size = random.between(0.3, 1.2);
            if random.unit() < 0.5 {
                faces.push(random_polygon(&mut random, centre, rotation, size));
            } else {
                let half = DVec3::splat(0.5 * size);
                faces.extend(turned(cuboid(centre - half, centre + half, true), rotation, centre));
            }
        }
        let index = OccluderIndex::new(&scene_of(&faces));
        for (i, p) in faces.iter().enumerate() {
            for q in &faces[i + 1..] {
                let (normal_p, normal_q) = (polygon::area_vector(p), polygon::area_vector(q));
                let answer = index.classify(p, q);
                let allowed: Vec<&[DVec3]> = match &answer {
                    PairVisibility::Partial(ids) => ids.iter().map(|&id| index.corners(id)).collect(),
                    _ => Vec::new(),
                };
                for _ in 0..20 {
                    let (a, b) = (inside(&mut random, p), inside(&mut random, q));
                    if normal_p.dot(b - a) <= 1e-9 || normal_q.dot(a - b) <= 1e-9 {
                        continue;
                    }
                    let mut hit = faces.iter().filter(|face| crosses(face, a, b));
                    match &answer {
                        PairVisibility::Full => assert!(hit.next().is_none()),
                        PairVisibility::None => assert!(hit.next().is_some()),
                        PairVisibility::Partial(_) => assert!(hit.all(|face| allowed.contains(&face.as_slice()))),
                    }
                }
                match answer {
                    PairVisibility::Full => n_full += 1,
                    PairVisibility::None => n_none += 1,
                    PairVisibility::Partial(ids) => {
                        n_partial += 1;
                        assert_eq!(index.classify_among(p, q, &ids), PairVisibility::Partial(ids.clone()));
                    }
                }
            }
        }
    }
    assert!(
        n_full > 1000 && n_none > 1000 && n_partial > 1000,
        "{n_full} {n_none} {n_partial}"
    );
}

#[test]
fn a_wall_across_closes_the_way() {
    let mut faces = cuboid(DVec3::ZERO, DVec3::new(4.0, 1.0, 1.0), false);
    let wall = rectangle(DVec3::X * 2.0, DVec3::Y, DVec3::Z);
    faces.extend(cut(&wall, 3, 3));
    let index = OccluderIndex::new(&scene_of(&faces));
    assert_eq!(index.classify(&faces[0], &faces[1]), PairVisibility::None);
    assert_eq!(
        index.classify(&faces[0], &wall),
        PairVisibility::None,
        "the wall looks the other way"
    );
    let seen: Polygon = wall.iter().rev().copied().collect();
    assert_eq!(index.classify(&faces[0], &seen), PairVisibility::Full);
}

#[test]
fn a_solid_across_closes_the_way() {
    let motion = Random::new(43).motion();
    let solid = turned(
        cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), true),
        motion.rotation,
        DVec3::ZERO,
    );
    let index = OccluderIndex::new(&scene_of(&solid));
    let square = |height: f64, side: f64| {
        rectangle(
            DVec3::new(-0.5 * side, -0.5 * side, height),
            DVec3::X * side,
            DVec3::Y * side,
        )
    };
    let above = |height: f64, side: f64| square(height, side).into_iter().rev().collect::<Polygon>();
    // No single side covers the way, all of them together do.
    assert_eq!(
        index.classify(&square(-1.0, 0.6), &above(1.0, 0.6)),
        PairVisibility::None
    );
    assert!(matches!(
        index.classify(&square(-1.0, 2.0), &above(1.0, 2.0)),
        PairVisibility::Partial(_)
    ));
    // Inside of the solid nothing is in the way.
    assert_eq!(
        index.classify(&square(-0.2, 0.1), &above(0.2, 0.1)),
        PairVisibility::Full
    );
    // From the inside out its sides are.
    assert!(matches!(
        index.classify(&square(-0.2, 0.1), &above(2.0, 1.0)),
        PairVisibility::None | PairVisibility::Partial(_)
    ));
}

#[test]
fn an_empty_scene_has_no_occluders() {
    let index = OccluderIndex::new(&scene_of(&[]));
    let (p, q) = (
        rectangle(DVec3::ZERO, DVec3::X, DVec3::Y),
        rectangle(DVec3::Z, DVec3::Y, DVec3::X),
    );
    assert_eq!(index.classify(&p, &q), PairVisibility::Full);
}

#[test]
fn a_sheet_of_two_coincident_faces_hides_no_more_than_one_of_them() {
    let floor = rectangle(DVec3::ZERO, DVec3::X, DVec3::Y);
    let ceiling = rectangle(DVec3::Z, DVec3::Y, DVec3::X);
    let front = rectangle(DVec3::new(0.4, 0.4, 0.5), DVec3::X * 0.1, DVec3::Y * 0.1);
    let back: Polygon = front.iter().rev().copied().collect();
    for sheet in [vec![front.clone()], vec![back.clone()], vec![front, back]] {
        let index = OccluderIndex::new(&scene_of(&sheet));
        assert_eq!(
            index.classify(&floor, &ceiling),
            PairVisibility::Partial(vec![OccluderId(0)])
        );
    }
}
