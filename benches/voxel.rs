//! Measures how fast discrete lines are walked and links gathered, beside Embree's rays from the same voxels in the same directions.
//!
//! `cargo bench --bench voxel` measures in turns, so that changes of the machine's speed affect all rates alike. The sample is every 64th block of 64 surfels
//! of the living room on 315 × 315 × 190 voxels, R = 30: 1/64 of the paper's first experiment, so one thread needs 64 times the measured time for all of it.
#![expect(clippy::print_stdout, reason = "a table of rates is what a benchmark is for")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use glam::DVec3;
use radiosity::scene::builtin;
use radiosity::visibility::embree::EmbreeVisibility;
use radiosity::visibility::{Coherence, HitBatch, RayBatch, Visibility};
use radiosity::voxel::{Direction, DiscreteSphere, Sight, SolidAngle, VoxelScene};

const BLOCK: usize = 64;
const STRIDE: usize = 64;

fn main() {
    let scene = builtin::build("living-room", None).expect("a built-in scene").scene;
    let voxels = VoxelScene::new(&scene, 315).expect("a resolution in range");
    let sphere = DiscreteSphere::new(30, SolidAngle::Centre).expect("a radius in range");
    let visibility = EmbreeVisibility::new(&scene).expect("Embree builds the scene");
    let directions: Vec<Direction> = sphere.directions().iter().map(|d| Direction::new(d.vector)).collect();
    let (mut walking, mut bundled, mut tracing) = (Duration::ZERO, Duration::ZERO, Duration::ZERO);
    let (mut n_lines, mut n_seen, mut n_hits) = (0_u64, 0_u64, 0_u64);
    let mut rays = RayBatch::default();
    let mut hits = HitBatch::default();
    for block in (0..voxels.n_surfels() / BLOCK).step_by(STRIDE) {
        let surfels = block * BLOCK..(block + 1) * BLOCK;
        let start = Instant::now();
        for surfel in surfels.clone() {
            let normal = voxels.normal(surfel);
            for direction in directions.iter().filter(|d| normal.dot(d.vector()) > 0) {
                n_lines += 1;
                black_box(voxels.sight(surfel, direction));
            }
        }
        walking += start.elapsed();
        let middle = Instant::now();
        let sights = black_box(voxels.sights(surfels.clone(), &directions));
        bundled += middle.elapsed();
        n_seen += sights.iter().filter(|s| matches!(s, Some(Sight::Surfel(_)))).count() as u64;
        let begin = Instant::now();
        for surfel in surfels {
            let normal = voxels.normal(surfel);
            let centre = voxels.grid.centre(voxels.surfels[surfel].voxel());
            let origin = centre + normal.unit * voxels.grid.voxel_size - visibility.frame_origin();
            rays.clear();
            for direction in directions.iter().filter(|d| normal.dot(d.vector()) > 0) {
                rays.push_ray(origin, DVec3::from_array(direction.vector().map(f64::from)));
            }
            visibility.closest_hits(&rays, Coherence::Coherent, &mut hits);
            n_hits += (0..rays.len())
                .filter(|&k| hits.face(k).is_some_and(|h| !h.back))
                .count() as u64;
        }
        tracing += begin.elapsed();
    }
    let rate = |time: Duration| n_lines as f64 / time.as_secs_f64() / 1e6;
    println!("lines or rays          {n_lines}");
    println!(
        "discrete lines         {:.3} million/s one by one, {:.3} million/s in bundles, {n_seen} see a front",
        rate(walking),
        rate(bundled)
    );
    println!(
        "Embree's rays          {:.3} million/s, {n_hits} see a front",
        rate(tracing)
    );
    println!("ratio                  {:.3}", rate(bundled) / rate(tracing));
    println!("all lines, one thread  {:.0} s", bundled.as_secs_f64() * STRIDE as f64);
}
