//! Prints what `exact` takes on meshes, and how far off it is: for each scene and tolerance the processor time, the largest errors of an entry and of the sum of a row against a run at a hundredth of the least tolerance, stated over true error, and
//! how many pairs were clipped or settled by rays.
//!
//! `cargo run --release --example error_against_time -- 1e-2,1e-3,1e-4 scenes/cornell-box/scene.obj ...`
//!
//! Stated over true: of partly visible pairs, whose true errors below a hundredth of the tolerance count as that, and stated ones as no less; the least, and what 1 in 1,000, 1 in 2 and 9 in 10 are below.

#![expect(clippy::print_stdout, reason = "a program that prints")]

use std::error::Error;
use std::time::Instant;

use radiosity::form_factor::{Computed, ExactMethod, FormFactorMethod, Input};
use radiosity::matrix::StorageChoice;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{self, topology};
use radiosity::visibility::brute_force::BruteForce;

/// What a true or stated error counts as at least, as a part of the tolerance.
const LEAST: f64 = 0.01;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let tolerances = arguments
        .next()
        .ok_or("give tolerances, as in 1e-2,1e-4, then scenes")?;
    let mut tolerances = tolerances.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    tolerances.sort_by(|a, b| b.total_cmp(a));
    println!(
        "| scene | tolerance | s | e_max | e_row | stated / true: least | 0.1 % | 50 % | 90 % | clipped | by rays |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for path in arguments {
        print_scene(&path, &tolerances)?;
    }
    Ok(())
}

fn print_scene(path: &str, tolerances: &[f64]) -> Result<(), Box<dyn Error>> {
    let scene = scene::load(path)?.scene;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(1))?;
    let visibility = BruteForce::new(&scene);
    let input = Input {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        unoccluded: topology::is_convex_and_empty(&scene),
    };
    let least = tolerances.last().copied().unwrap_or(1e-4);
    let reference = compute(input, LEAST * least)?.0;
    for &tolerance in tolerances {
        let (found, seconds) = compute(input, tolerance)?;
        let against = Against::new(&found, &reference, &mesh, tolerance);
        let pairs = found.pairs.unwrap_or_default();
        let [lowest, thousandth, half, nine_tenths] = [0, 1, 500, 900].map(|part| against.ratio(part));
        println!(
            "| {path} | {tolerance:e} | {seconds:.2} | {:.1e} | {:.1e} | {lowest:.2} | {thousandth:.2} | {half:.1} | {nine_tenths:.1} | {} | {} |",
            against.of_entry, against.of_row, pairs.clipped, pairs.by_rays
        );
    }
    Ok(())
}

/// Returns form factors and the processor time on one thread, in s.
fn compute(input: Input<'_>, tolerance: f64) -> Result<(Computed, f64), Box<dyn Error>> {
    let method = ExactMethod {
        tolerance,
        ..ExactMethod::default()
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let begun = Instant::now();
    let found = pool.install(|| method.compute(input, StorageChoice::default(), &Silent))?;
    Ok((found, begun.elapsed().as_secs_f64()))
}

/// One result against a better one.
struct Against {
    /// The largest error of A_i F_ij / min(A_i, A_j).
    of_entry: f64,
    /// The largest error of Σ_j F_ij.
    of_row: f64,
    /// Stated over true errors, in order.
    ratios: Vec<f64>,
}

impl Against {
    fn new(found: &Computed, reference: &Computed, mesh: &Mesh, tolerance: f64) -> Self {
        let areas = mesh.areas();
        let mut against = Self {
            of_entry: 0.0,
            of_row: 0.0,
            ratios: Vec::new(),
        };
        for i in 0..areas.len() {
            let [row, better] = [found, reference].map(|of| row(of, i, areas.len()));
            let mut off_row = 0.0;
            for j in 0..areas.len() {
                let unit = areas[i] / areas[i].min(areas[j]);
                let off = (row[j][0] - better[j][0]) * unit;
                against.of_entry = against.of_entry.max(off.abs());
                off_row += row[j][0] - better[j][0];
                let stated = (row[j][1] + better[j][1]) * unit;
                // Pairs that see each other whole are known far better.
                if j > i && stated > 1e-3 * tolerance {
                    let least = LEAST * tolerance;
                    against.ratios.push(stated.max(least) / off.abs().max(least));
                }
            }
            against.of_row = against.of_row.max(f64::abs(off_row));
        }
        against.ratios.sort_by(f64::total_cmp);
        against
    }

    /// Returns the ratio that so many thousandths are below.
    fn ratio(&self, thousandths: usize) -> f64 {
        let last = self.ratios.len().saturating_sub(1);
        self.ratios.get(thousandths * last / 1000).copied().unwrap_or(f64::NAN)
    }
}

/// Returns F and its error for each column of a row.
fn row(of: &Computed, i: usize, n: usize) -> Vec<[f64; 2]> {
    let mut row = vec![[0.0; 2]; n];
    of.factors.for_each_in_row(i, |j, value, error| row[j] = [value, error]);
    row
}
