//! Careless meshes, with cracks, slivers, touching or intersecting solids, separate vertices for each face and inverted facets: against rays.

use glam::{DQuat, DVec3};
use radiosity::form_factor::ExactMethod;
use radiosity::geometry::polygon::planarity_error;
use radiosity::matrix::FormFactors;
use radiosity::scene::{FaceId, Scene, SceneBuilder};
use rayon::prelude::*;

use super::scenes::Random;
use crate::support::rooms::{Prepared, Shapes};

const N_MESHES: u64 = 200;
const RAYS: u32 = 4096;
const TOLERANCE: f64 = 1e-3;

/// Returns a mesh; `None` where it is refused.
fn mesh(seed: u64) -> Option<Scene> {
    let mut random = Random::new(seed);
    let mut shapes = Shapes::default();
    let is = |numbers: &mut Random, chance: f64| numbers.unit() < chance;
    let own_turn = |numbers: &mut Random| {
        if numbers.unit() < 0.5 {
            DQuat::IDENTITY
        } else {
            DQuat::from_axis_angle(numbers.direction(), numbers.between(0.0, 3.0))
        }
    };
    if is(&mut random, 0.7) {
        shapes.cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.0), DQuat::IDENTITY, true);
    }
    let mut low = DVec3::new(0.5, 0.6, 0.0);
    for _ in 0..2 {
        let size = 0.4 + random.point();
        let inwards = is(&mut random, 0.1);
        shapes.cuboid(low, low + size, own_turn(&mut random), inwards);
        // Side by side, into each other, or apart.
        low.x += size.x
            * if is(&mut random, 0.4) {
                1.0
            } else {
                random.between(0.5, 1.5)
            };
    }
    if is(&mut random, 0.3) {
        shapes.ball(DVec3::new(2.0, 1.5, 1.0), random.between(0.2, 0.7), 0);
    }
    for _ in 0..4 {
        let (at, along) = (DVec3::new(3.6, 2.6, 1.6) * random.point() + 0.2, random.direction());
        let thin = 10.0_f64.powf(random.between(-6.0, 0.0));
        let across = along.cross(random.direction()).normalize_or_zero() * thin;
        let triangle = [at, at + 0.3 * along, at + 0.15 * along + 0.3 * across];
        shapes.face(&triangle);
        if is(&mut random, 0.5) {
            shapes.face(&[triangle[2], triangle[1], triangle[0]]);
        }
    }
    let crack = is(&mut random, 0.4).then(|| 10.0_f64.powf(random.between(-9.0, -2.0)));
    let bends = is(&mut random, 0.5);
    built(&shapes.scene(), bends && crack.is_some(), |corners| {
        if random.unit() < 0.03 {
            corners.reverse();
        }
        let Some(crack) = crack else { return };
        let mut shift = crack * random.direction();
        for corner in corners {
            *corner += shift;
            if bends {
                shift = crack * random.direction();
            }
        }
    })
}

/// Returns a scene with changed faces as a reader makes it, which cuts those that lie on others out of these.
fn built(scene: &Scene, in_triangles: bool, mut change: impl FnMut(&mut [DVec3])) -> Option<Scene> {
    let mut builder = SceneBuilder::new();
    let material = builder.material(scene.materials[0].clone()).expect("a grey one");
    for (face, number) in scene.faces.iter().zip(0..) {
        let surface = builder.surface(format!("face{number}")).expect("few surfaces");
        let at = |&vertex: &u32| scene.vertices[vertex as usize];
        let corners: Vec<DVec3> = face.corners.as_slice().iter().map(at).collect();
        let outlines = match *corners {
            // A quad with moved corners would be bent, which counts as rounding.
            [a, b, c, d] if in_triangles => vec![vec![a, b, c], vec![a, c, d]],
            _ => vec![corners],
        };
        for mut outline in outlines {
            change(&mut outline);
            builder.face(&outline, surface, material, number).ok()?;
        }
    }
    Some(builder.build().ok()?.scene)
}

/// A triangle of a face, as rays meet it.
struct Part {
    face: usize,
    corners: [DVec3; 3],
}

/// The faces of a scene and their triangles, for rays in f64 that look at every triangle.
struct Faces {
    outlines: Vec<Vec<DVec3>>,
    parts: Vec<Part>,
}

/// Heights and distances up to this, m, are those of faces in one plane: a patch sees past what lies in its plane.
const FLAT: f64 = 1e-12;

impl Faces {
    fn of(scene: &Scene) -> Self {
        let outlines: Vec<Vec<DVec3>> = (0..scene.faces.len())
            .map(|k| scene.polygon(FaceId(u32::try_from(k).expect("a small scene"))))
            .collect();
        let parts = outlines.iter().enumerate().flat_map(|(face, corners)| {
            (2..corners.len()).map(move |k| Part {
                face,
                corners: [corners[0], corners[k - 1], corners[k]],
            })
        });
        Self {
            parts: parts.collect(),
            outlines,
        }
    }

    fn double_area(&self, face: usize) -> DVec3 {
        let own = self.parts.iter().filter(|part| part.face == face);
        own.map(|Part { corners: [a, b, c], .. }| (b - a).cross(c - a)).sum()
    }

    /// Tells whether a face is no farther from the plane of another than `most`, m.
    fn is_within(&self, face: usize, of: usize, most: f64) -> bool {
        let (normal, at) = (self.double_area(of).normalize(), self.outlines[of][0]);
        self.outlines[face].iter().all(|&v| normal.dot(v - at).abs() <= most)
    }

    /// Counts the rays from the front of a face, as light leaves it, that meet the front of each other face first.
    fn row(&self, face: usize, random: &mut Random) -> Vec<u32> {
        let normal = self.double_area(face).normalize();
        let along = normal.any_orthonormal_vector();
        let across = normal.cross(along);
        let outline = &self.outlines[face];
        // The plane of a sliver leans by rounding.
        let reach = outline.iter().map(|v| v.distance(outline[0])).fold(0.0, f64::max);
        let width = self.double_area(face).length() / reach;
        let flat = FLAT.max(4.0 * f64::EPSILON * reach / width);
        let is_off = |&v: &DVec3| normal.dot(v - outline[0]).abs() > flat;
        let others: Vec<&Part> = self
            .parts
            .iter()
            .filter(|part| part.face != face && part.corners.iter().any(is_off))
            .collect();
        let own: Vec<[DVec3; 3]> = self
            .parts
            .iter()
            .filter(|p| p.face == face)
            .map(|p| p.corners)
            .collect();
        let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
        let share = area(own[0]) / own.iter().copied().map(area).sum::<f64>();
        let mut counts = vec![0; self.outlines.len()];
        for _ in 0..RAYS {
            let [a, b, c] = own[usize::from(own.len() > 1 && random.unit() >= share)];
            let (u, v) = (random.unit().sqrt(), random.unit());
            let from = a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v);
            let (sine, turn) = (random.unit().sqrt(), std::f64::consts::TAU * random.unit());
            let direction = sine * (turn.cos() * along + turn.sin() * across) + (1.0 - sine * sine).sqrt() * normal;
            let mut nearest = (f64::INFINITY, false, 0);
            for part in &others {
                if let Some((distance, is_front)) = part.meets(from, direction)
                    && (distance < nearest.0 - FLAT || distance < nearest.0 + FLAT && is_front && !nearest.1)
                {
                    nearest = (distance, is_front, part.face);
                }
            }
            counts[nearest.2] += u32::from(nearest.1);
        }
        counts
    }
}

impl Part {
    /// Returns how far off a ray meets the triangle, and whether in front.
    fn meets(&self, from: DVec3, direction: DVec3) -> Option<(f64, bool)> {
        let [a, b, c] = self.corners.map(|v| v - from);
        let sides = [a.cross(b), b.cross(c), c.cross(a)].map(|side| side.dot(direction));
        if sides.iter().any(|&s| s < 0.0) && sides.iter().any(|&s| s > 0.0) {
            return None;
        }
        let normal = (b - a).cross(c - a);
        let distance = normal.dot(a) / normal.dot(direction);
        (distance > 0.0).then_some((distance, normal.dot(direction) < 0.0))
    }
}

#[test]
#[ignore = "three minutes on one core"]
fn exact_agrees_with_rays_on_careless_meshes() {
    let wrong: Vec<String> = (0..N_MESHES)
        .into_par_iter()
        .filter_map(|seed| {
            let prepared = Prepared::new(mesh(seed)?, 1);
            let exact = prepared.compute(&ExactMethod {
                tolerance: TOLERANCE,
                budget: 20_000,
            });
            let faces = Faces::of(&prepared.scene);
            assert_eq!(faces.outlines.len(), prepared.mesh.n_patches());
            let mut random = Random::new(seed);
            // Quads of which others were cut out may be bent, which counts as rounding.
            let slack = 2.0
                * faces
                    .outlines
                    .iter()
                    .map(|outline| planarity_error(outline))
                    .fold(0.0, f64::max);
            let n = prepared.mesh.n_patches();
            let row = |factors: &FormFactors, i: usize| {
                let mut row = vec![(0.0, 0.0); n];
                factors.for_each_in_row(i, |j, value, error| row[j] = (value, error));
                row
            };
            for i in 0..n {
                let (mut sum, mut sum_of_rays, mut stated) = (0.0, 0.0, 0.0);
                let counts = faces.row(i, &mut random);
                // Faces that touch, but for what bent ones show of rounding, see nothing of each other, and past each other.
                let touching = |j: usize| faces.is_within(j, i, 4.0 * slack) || faces.is_within(i, j, 4.0 * slack);
                let touches = slack > FLAT && (0..n).any(|j| j != i && touching(j));
                for (j, ((value, error), count)) in row(&exact, i).into_iter().zip(counts).enumerate() {
                    let seen = f64::from(count) / f64::from(RAYS);
                    (sum, sum_of_rays, stated) = (sum + value, sum_of_rays + seen, stated + error);
                    let off = (value - seen).abs();
                    if !touches && off > error + noise(value) {
                        return Some(format!("{seed}: F({i}, {j}) {value} ± {error}, by rays {seen}"));
                    }
                }
                if !touches && (sum - sum_of_rays).abs() > stated + noise(sum) {
                    return Some(format!("{seed}: row {i} {sum} ± {stated}, by rays {sum_of_rays}"));
                }
            }
            None
        })
        .collect();
    assert!(wrong.is_empty(), "{} of {N_MESHES}:\n{}", wrong.len(), wrong.join("\n"));
}

/// Returns how far the share of rays may be from a probability, in one case of 10⁷.
fn noise(probability: f64) -> f64 {
    let n = f64::from(RAYS);
    let p = probability.clamp(0.0, 1.0);
    5.5 * (p * (1.0 - p) / n).sqrt() + 12.0 / n
}
