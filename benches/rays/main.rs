//! Measures how fast rays are traced and their hits counted by face, beside a bare C loop and embree4-rs on the same rays.
//!
//! `cargo bench --bench rays` prints a table of rates and ratios that were measured in turns, so that changes of the machine's speed affect all of a row.
#![expect(clippy::print_stdout, reason = "a table of rates is what a benchmark is for")]

mod bare;
#[expect(dead_code, reason = "shared with the tests, which use more of it")]
#[path = "../../tests/library/embree/scenes.rs"]
mod scenes;

use std::hint::black_box;
use std::time::Instant;

use embree4_rs::geometry::TriangleMeshGeometry;
use embree4_sys::{RTCBuildQuality, RTCRay, RTCSceneFlags};
use glam::DVec3;
use radiosity::scene::Corners;
use radiosity::visibility::embree::EmbreeVisibility;
use radiosity::visibility::{Coherence, HitBatch, RayBatch, Visibility};

use bare::BareScene;
use scenes::Random;

const RAYS_PER_BATCH: usize = 4096;
const BATCHES_PER_THREAD: usize = 16;
const MAX_THREADS: usize = 2;

/// The same scene three times.
struct Contenders {
    radiosity: EmbreeVisibility,
    bare: BareScene,
    embree4_rs: embree4_rs::CommittedScene,
    n_faces: usize,
}

/// The same rays in batches, and once more for embree4-rs.
struct Rays {
    name: &'static str,
    coherence: Coherence,
    batches: Vec<RayBatch>,
    single: Vec<Vec<RTCRay>>,
}

/// The programs that are compared.
#[derive(Clone, Copy)]
enum Contender {
    Radiosity,
    Bare,
    Embree4Rs,
}

impl Contenders {
    fn new() -> Self {
        let scene = scenes::room_and_sphere();
        let radiosity = EmbreeVisibility::new(&scene).expect("Embree builds the scene");
        let rounded = |v: &DVec3| (*v - radiosity.frame_origin()).as_vec3();
        let vertices: Vec<[f32; 3]> = scene.vertices.iter().map(|v| rounded(v).to_array()).collect();
        let triangles: Vec<[u32; 3]> = scene
            .faces
            .iter()
            .filter_map(|face| match face.corners {
                Corners::Triangle(corners) => Some(corners),
                Corners::Quad(_) => None,
            })
            .collect();
        assert_eq!(triangles.len(), 14_288);

        let device = embree4_rs::Device::try_new(None).expect("Embree opens");
        let as_tuples: Vec<(f32, f32, f32)> = vertices.iter().map(|&v| v.into()).collect();
        let corners: Vec<(u32, u32, u32)> = triangles.iter().map(|&v| v.into()).collect();
        let geometry = TriangleMeshGeometry::try_new(&device, &as_tuples, &corners).expect("the triangles are good");
        let options = embree4_rs::SceneOptions {
            build_quality: RTCBuildQuality::HIGH,
            flags: RTCSceneFlags::ROBUST,
        };
        let reference = embree4_rs::Scene::try_new(device, options).expect("Embree makes a scene");
        reference.attach_geometry(&geometry).expect("the geometry is good");
        Self {
            radiosity,
            bare: BareScene::new(&vertices, &triangles),
            embree4_rs: reference.commit().expect("Embree builds the scene"),
            n_faces: triangles.len(),
        }
    }

    /// Returns random rays from below the sphere.
    fn incoherent(&self) -> Rays {
        let mut random = Random::new(1);
        self.rays("incoherent", Coherence::Incoherent, || {
            let from = random.point() * DVec3::new(1.0, 1.0, 0.15);
            vec![(from, random.direction())]
        })
    }

    /// Returns packets of 16 rays from a point below the sphere to points of a small square.
    fn coherent(&self) -> Rays {
        let mut random = Random::new(2);
        self.rays("bundles of 16", Coherence::Coherent, || {
            let from = random.point() * DVec3::new(1.0, 1.0, 0.15);
            let corner = from + random.direction();
            (0..16).map(|_| (from, corner + 0.05 * random.point() - from)).collect()
        })
    }

    fn rays(&self, name: &'static str, coherence: Coherence, mut bundle: impl FnMut() -> Vec<(DVec3, DVec3)>) -> Rays {
        let batches: Vec<RayBatch> = (0..MAX_THREADS * BATCHES_PER_THREAD)
            .map(|_| {
                let mut batch = RayBatch::default();
                while batch.len() < RAYS_PER_BATCH {
                    for (origin, direction) in bundle() {
                        batch.push_ray(origin - self.radiosity.frame_origin(), direction);
                    }
                }
                batch
            })
            .collect();
        let single = |batch: &RayBatch| {
            let ray = |k: usize| RTCRay {
                org_x: batch.origin[0][k],
                org_y: batch.origin[1][k],
                org_z: batch.origin[2][k],
                dir_x: batch.direction[0][k],
                dir_y: batch.direction[1][k],
                dir_z: batch.direction[2][k],
                ..RTCRay::default()
            };
            (0..batch.len()).map(ray).collect()
        };
        Rays {
            name,
            coherence,
            single: batches.iter().map(single).collect(),
            batches,
        }
    }

    /// Traces a thread's share of the batches `n_times`, and returns the number of hits of each face.
    fn trace(&self, who: Contender, rays: &Rays, thread: usize, n_times: usize) -> Vec<u32> {
        let mut counts = vec![0; self.n_faces];
        let share = thread * BATCHES_PER_THREAD..(thread + 1) * BATCHES_PER_THREAD;
        let mut hits = HitBatch::default();
        for _ in 0..n_times {
            for i in share.clone() {
                match who {
                    Contender::Radiosity => {
                        self.radiosity.closest_hits(&rays.batches[i], rays.coherence, &mut hits);
                        for &code in &hits.face_and_side {
                            if code != HitBatch::MISS {
                                counts[(code >> 1) as usize] += 1;
                            }
                        }
                    }
                    Contender::Bare => {
                        self.bare
                            .trace(&rays.batches[i], rays.coherence == Coherence::Coherent, &mut counts);
                    }
                    Contender::Embree4Rs => {
                        for &ray in &rays.single[i] {
                            if let Ok(Some(found)) = self.embree4_rs.intersect_1(ray, None) {
                                counts[found.hit.primID as usize] += 1;
                            }
                        }
                    }
                }
            }
        }
        counts
    }

    /// Traces on `n_threads` threads, each its own share.
    fn trace_on(&self, who: Contender, rays: &Rays, n_threads: usize, n_times: usize) {
        if n_threads == 1 {
            black_box(self.trace(who, rays, 0, n_times));
            return;
        }
        std::thread::scope(|scope| {
            for thread in 0..n_threads {
                scope.spawn(move || black_box(self.trace(who, rays, thread, n_times)));
            }
        });
    }

    /// Returns the rate in million rays a second.
    fn rate(&self, who: Contender, rays: &Rays, n_threads: usize, n_times: usize) -> f64 {
        let start = Instant::now();
        self.trace_on(who, rays, n_threads, n_times);
        let n_rays = n_threads * BATCHES_PER_THREAD * RAYS_PER_BATCH * n_times;
        1e-6 * n_rays as f64 / start.elapsed().as_secs_f64()
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Prints the table: medians over rounds in which all three trace in turns.
fn summarise(contenders: &Contenders, all_rays: &[Rays]) {
    const ROUNDS: usize = 31;
    println!("| rays, threads | radiosity | bare C loop | embree4-rs | radiosity / bare | radiosity / embree4-rs |");
    println!("|---|---|---|---|---|---|");
    for rays in all_rays {
        for n_threads in 1..=MAX_THREADS {
            let n_times = if rays.coherence == Coherence::Coherent { 8 } else { 2 };
            let [mut radiosity, mut bare, mut single, mut to_bare, mut to_single] = [const { Vec::new() }; 5];
            for _ in 0..ROUNDS {
                let rate = |who| contenders.rate(who, rays, n_threads, n_times);
                let (r, b, s) = (
                    rate(Contender::Radiosity),
                    rate(Contender::Bare),
                    rate(Contender::Embree4Rs),
                );
                radiosity.push(r);
                bare.push(b);
                single.push(s);
                to_bare.push(r / b);
                to_single.push(r / s);
            }
            println!(
                "| {}, {n_threads} | {:.1} | {:.1} | {:.1} | {:.3} | {:.2} |",
                rays.name,
                median(radiosity),
                median(bare),
                median(single),
                median(to_bare),
                median(to_single)
            );
        }
    }
}

fn main() {
    let contenders = Contenders::new();
    let all_rays = [contenders.incoherent(), contenders.coherent()];
    for rays in &all_rays {
        let [ours, theirs] = [Contender::Radiosity, Contender::Bare].map(|who| contenders.trace(who, rays, 0, 1));
        assert_eq!(ours.iter().sum::<u32>(), theirs.iter().sum::<u32>(), "all hit as much");
    }
    summarise(&contenders, &all_rays);
}
