//! Meshes as people bring them, with cracks, slivers, solids that touch or pierce each other, vertices of their own for each face and facets turned the wrong way: against rays.

use glam::{DQuat, DVec3};
use radiosity::form_factor::{ExactMethod, RandomShooting};
use radiosity::geometry::sampling::Sequence;
use radiosity::matrix::FormFactors;
use radiosity::scene::{Corners, Scene};
use rayon::prelude::*;

use super::scenes::Random;
use crate::support::rooms::{Prepared, Shapes};

const N_MESHES: u64 = 200;
const RAYS: u32 = 2048;
const TOLERANCE: f64 = 1e-3;

fn mesh(seed: u64) -> Scene {
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
    let mut scene = shapes.scene();
    for face in &mut scene.faces {
        if random.unit() < 0.03 {
            match &mut face.corners {
                Corners::Triangle(corners) => corners.reverse(),
                Corners::Quad(corners) => corners.reverse(),
            }
        }
    }
    if is(&mut random, 0.4) {
        let crack = 10.0_f64.powf(random.between(-9.0, -2.0));
        let moves_apart = is(&mut random, 0.5);
        let vertices = std::mem::take(&mut scene.vertices);
        for face in &mut scene.faces {
            let shift = if moves_apart {
                crack * random.direction()
            } else {
                DVec3::ZERO
            };
            let mut own = |corners: &mut [u32]| {
                for corner in corners {
                    scene.vertices.push(vertices[*corner as usize] + shift);
                    *corner = u32::try_from(scene.vertices.len() - 1).expect("a small scene");
                }
            };
            match &mut face.corners {
                Corners::Triangle(corners) => own(corners),
                Corners::Quad(corners) => own(corners),
            }
        }
    }
    scene
}

#[test]
#[ignore = "a minute or more; it fails: entries of some meshes differ from rays by more than both errors, which is not explained yet"]
fn exact_agrees_with_rays_on_careless_meshes() {
    let wrong: Vec<String> = (0..N_MESHES)
        .into_par_iter()
        .filter_map(|seed| {
            let prepared = Prepared::new(mesh(seed), 1);
            let exact = prepared.compute(&ExactMethod {
                tolerance: TOLERANCE,
                budget: 20_000,
            });
            let rays = prepared.compute(&RandomShooting {
                rays: RAYS.into(),
                sequence: Sequence::Random,
                seed,
            });
            let n = prepared.mesh.n_patches();
            let row = |factors: &FormFactors, i: usize| {
                let mut row = vec![(0.0, 0.0); n];
                factors.for_each_in_row(i, |j, value, error| row[j] = (value, error));
                row
            };
            for i in 0..n {
                let (mut sum, mut sum_of_rays, mut stated) = (0.0, 0.0, 0.0);
                for (j, ((value, error), (seen, _))) in row(&exact, i).into_iter().zip(row(&rays, i)).enumerate() {
                    (sum, sum_of_rays, stated) = (sum + value, sum_of_rays + seen, stated + error);
                    let off = (value - seen).abs();
                    if off > error + noise(value) {
                        return Some(format!("{seed}: F({i}, {j}) {value} ± {error}, by rays {seen}"));
                    }
                }
                if (sum - sum_of_rays).abs() > stated + noise(sum) {
                    return Some(format!("{seed}: row {i} {sum} ± {stated}, by rays {sum_of_rays}"));
                }
            }
            None
        })
        .collect();
    assert!(wrong.is_empty(), "{} of {N_MESHES}:\n{}", wrong.len(), wrong.join("\n"));
}

/// Returns how far the share of rays may be from a probability, in one case of 10⁷ and where rays begin off the faces.
fn noise(probability: f64) -> f64 {
    let n = f64::from(RAYS);
    let p = probability.clamp(0.0, 1.0);
    5.5 * (p * (1.0 - p) / n).sqrt() + 12.0 / n + 1e-4
}
