//! Benchmarks form factors behind occluders: a closed room with a floating box, all pairs of patches.

mod timing;

use std::hint::black_box;

use glam::DVec3;
use radiosity::form_factor::partial::{Accuracy, exchange_area};
use radiosity::visibility::occluders::{OccluderId, OccluderIndex, PairVisibility};
use shapes::{Polygon, cuboid, cut, scene_of};
use timing::measure;

#[path = "../tests/library/embree/scenes.rs"]
#[allow(dead_code, reason = "made for rays; only the builder is used here")]
mod scenes;

#[path = "../tests/library/occlusion/shapes.rs"]
#[allow(dead_code, reason = "made for tests")]
mod shapes;

/// The pairs of patches that may be occluded.
type Pairs = Vec<(Polygon, Polygon, Vec<OccluderId>)>;

/// Classifies all pairs of patches, those of faces first.
fn classify(index: &OccluderIndex, faces: &[Polygon], patches: &[Vec<Polygon>]) -> Pairs {
    let mut partial = Vec::new();
    for (i, face) in faces.iter().enumerate() {
        for (j, other) in faces.iter().enumerate().skip(i + 1) {
            let PairVisibility::Partial(among) = index.classify(face, other) else {
                continue;
            };
            for p in &patches[i] {
                for q in &patches[j] {
                    if let PairVisibility::Partial(ids) = index.classify_among(p, q, &among) {
                        partial.push((p.clone(), q.clone(), ids));
                    }
                }
            }
        }
    }
    partial
}

fn main() {
    let mut faces = cuboid(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0), false);
    faces.extend(cuboid(DVec3::new(1.0, 1.5, 0.5), DVec3::new(2.2, 3.0, 1.7), true));
    let index = OccluderIndex::new(&scene_of(&faces));
    for n in [1, 3, 4] {
        let patches: Vec<Vec<Polygon>> = faces.iter().map(|face| cut(face, n, n)).collect();
        let n_patches = 12 * n * n;
        measure(&format!("classify, {n_patches} patches"), 1, || {
            classify(&index, &faces, &patches)
        });
        let pairs = classify(&index, &faces, &patches);
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let name = format!("{n_patches} patches, {} partial pairs, {tolerance:e}", pairs.len());
            let accuracy = Accuracy {
                tolerance,
                budget: 10_000_000,
            };
            measure(&name, 1, || {
                for (p, q, ids) in &pairs {
                    black_box(exchange_area(p, q, &index.occluders(p, q, ids), accuracy));
                }
            });
        }
    }
}
