//! Boxes, random polygons, and the whole way from a scene to its form factors.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use radiosity::form_factor::partial::{Accuracy, Partial, exchange_area};
use radiosity::geometry::polygon;
use radiosity::scene::Scene;
use radiosity::visibility::occluders::{Occluder, OccluderIndex, PairVisibility};

use super::scenes::{Builder, Random};

pub(crate) type Polygon = Vec<DVec3>;

pub(crate) fn rectangle(corner: DVec3, a: DVec3, b: DVec3) -> Polygon {
    vec![corner, corner + a, corner + a + b, corner + b]
}

/// The six sides of a box in the order x−, x+, y−, y+, z−, z+, looking outwards or inwards.
pub(crate) fn cuboid(low: DVec3, high: DVec3, outwards: bool) -> Vec<Polygon> {
    let d = high - low;
    let (x, y, z) = (DVec3::X * d.x, DVec3::Y * d.y, DVec3::Z * d.z);
    let mut sides = vec![
        rectangle(low, y, z),
        rectangle(low + x, z, y),
        rectangle(low, z, x),
        rectangle(low + y, x, z),
        rectangle(low, x, y),
        rectangle(low + z, y, x),
    ];
    if outwards {
        for side in &mut sides {
            side[1..].reverse();
        }
    }
    sides
}

pub(crate) fn turned(polygons: Vec<Polygon>, rotation: DQuat, about: DVec3) -> Vec<Polygon> {
    let turn = |v: DVec3| about + rotation * (v - about);
    polygons
        .into_iter()
        .map(|polygon| polygon.into_iter().map(turn).collect())
        .collect()
}

pub(crate) fn in_triangles(polygons: &[Polygon]) -> Vec<Polygon> {
    let triangles = |p: &Polygon| (1..p.len() - 1).map(|k| vec![p[0], p[k], p[k + 1]]).collect::<Vec<_>>();
    polygons.iter().flat_map(triangles).collect()
}

/// Cuts a quad bilinearly into n × m parts.
pub(crate) fn cut(quad: &[DVec3], n: u32, m: u32) -> Vec<Polygon> {
    let at = |i: u32, j: u32| {
        let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(m));
        quad[0].lerp(quad[1], s).lerp(quad[3].lerp(quad[2], s), t)
    };
    (0..n * m)
        .map(|k| (k % n, k / n))
        .map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        .collect()
}

pub(crate) fn area(polygon: &[DVec3]) -> f64 {
    polygon::area_vector(polygon).length()
}

pub(crate) fn scene_of(faces: &[Polygon]) -> Scene {
    let mut builder = Builder::default();
    for face in faces {
        builder.face(face);
    }
    builder.finish()
}

/// A convex polygon of three or four corners on an ellipse around `centre`; its normal is that of the rotated xy plane.
pub(crate) fn random_polygon(random: &mut Random, centre: DVec3, rotation: DQuat, size: f64) -> Polygon {
    let n = if random.unit() < 0.3 { 3 } else { 4 };
    let (a, b) = (size * random.between(0.4, 1.0), size * random.between(0.4, 1.0));
    (0..n)
        .map(|k| (f64::from(k) + random.between(0.0, 0.6)) * TAU / f64::from(n))
        .map(|angle| centre + rotation * DVec3::new(a * angle.cos(), b * angle.sin(), 0.0))
        .collect()
}

pub(crate) fn random_rotation(random: &mut Random, largest_angle: f64) -> DQuat {
    DQuat::from_axis_angle(random.direction(), random.between(0.0, largest_angle))
}

/// Two polygons that face each other, and one to three plates and boxes that stand, overlap and pierce each other between them.
pub(crate) fn random_case(random: &mut Random) -> (Polygon, Polygon, Vec<Polygon>) {
    let facing = DQuat::from_axis_angle(DVec3::X, TAU / 2.0);
    let size = if random.unit() < 0.5 { 1.0 } else { 0.4 };
    let (p, q) = if random.unit() < 0.25 {
        (
            rectangle(DVec3::ZERO, DVec3::X, DVec3::Y),
            rectangle(DVec3::ZERO, DVec3::Y, DVec3::Z),
        )
    } else {
        let centre = DVec3::new(
            random.between(-1.0, 1.0),
            random.between(-1.0, 1.0),
            random.between(1.0, 3.0),
        );
        let tilt = random_rotation(random, 1.0);
        (
            random_polygon(random, DVec3::ZERO, DQuat::IDENTITY, size),
            random_polygon(random, centre, tilt * facing, size),
        )
    };
    let (from, to) = (polygon::centroid(&p), polygon::centroid(&q));
    let mut occluders = Vec::new();
    let n = 1 + [1.0 / 3.0, 2.0 / 3.0]
        .iter()
        .filter(|&&share| random.unit() > share)
        .count();
    for _ in 0..n {
        let centre = from.lerp(to, random.between(0.2, 0.8)) + random.direction() * 0.1 * size;
        let rotation = random_rotation(random, TAU);
        if random.unit() < 0.5 {
            occluders.push(random_polygon(random, centre, rotation, 0.5 * size));
        } else {
            let half = 0.25 * size * (random.point() + 0.3);
            occluders.extend(turned(cuboid(centre - half, centre + half, true), rotation, centre));
        }
    }
    (p, q, occluders)
}

pub(crate) fn two_sided(polygons: &[Polygon]) -> Vec<Occluder<'_>> {
    let mut occluders = Vec::new();
    for corners in polygons {
        occluders.push(Occluder {
            corners: corners.into(),
            one_sided: false,
            body: None,
        });
    }
    occluders
}

pub(crate) const BUDGET: usize = 20_000_000;

pub(crate) fn exchange(p: &[DVec3], q: &[DVec3], occluders: &[Polygon], tolerance: f64) -> Partial {
    let accuracy = Accuracy {
        tolerance,
        budget: BUDGET,
    };
    let result = exchange_area(p, q, &two_sided(occluders), accuracy);
    assert!(result.reached, "{result:?}");
    result
}

/// Returns the exchange areas of all pairs of faces, with the occluders that the index finds.
pub(crate) fn all_pairs(faces: &[Polygon], tolerance: f64) -> Vec<Vec<f64>> {
    let index = OccluderIndex::new(&scene_of(faces));
    let mut areas = vec![vec![0.0; faces.len()]; faces.len()];
    for (i, p) in faces.iter().enumerate() {
        for (j, q) in faces.iter().enumerate().skip(i + 1) {
            let occluders = match index.classify(p, q) {
                PairVisibility::None => continue,
                PairVisibility::Full => Vec::new(),
                PairVisibility::Partial(ids) => index.occluders(p, q, &ids),
            };
            let accuracy = Accuracy {
                tolerance,
                budget: BUDGET,
            };
            let result = exchange_area(p, q, &occluders, accuracy);
            assert!(result.reached, "faces {i} and {j}: {result:?}");
            areas[i][j] = result.exchange_area;
            areas[j][i] = result.exchange_area;
        }
    }
    areas
}
