//! Prints a table of the time and the error of `exact` on several meshes.
//!
//! `cargo run --release --example error_against_time` makes the table of `docs/performance.md`, with meshes of its own and the living room, in about four hours;
//! `cargo run --release --example error_against_time -- 1e-2,1e-3 1e-5 SCENE ...` uses these tolerances and a reference at 1e-5 on other scenes: files, or meshes such as `city:8`.
//!
//! Columns: the processor time of one thread; the largest error of A_i F_ij / min(A_i, A_j), and that of the sum of a row; stated over true error of partially visible pairs; pairs by treatment.
//! The stated error is that of the result and of the reference together; true and stated errors below a hundredth of the tolerance count as that.
//! `first` is the time until the first factor of a mesh.

#![expect(clippy::print_stdout, reason = "a program that prints")]

mod meshes;

use std::error::Error;
use std::sync::OnceLock;
use std::time::Instant;

use radiosity::form_factor::{Computed, ExactMethod, FormFactorError, FormFactorMethod, Input};
use radiosity::matrix::StorageChoice;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::{Progress, Silent};
use radiosity::scene::{self, Scene, topology};
use radiosity::visibility::brute_force::BruteForce;

/// The least value of a true or stated error, as a part of the tolerance.
const LEAST: f64 = 0.01;

/// Scenes, tolerances, and the tolerance of the reference.
const TABLE: &[(&str, &[f64], f64)] = &[
    ("cube:13", &[1e-6], 1e-8),
    ("room:19", &[1e-4], 1e-6),
    ("sphere:24", &[1e-3, 1e-4, 1e-5, 1e-6], 1e-8),
    ("globe:6", &[1e-4], 1e-6),
    ("globe:8", &[1e-4], 1e-6),
    ("tubes:12", &[1e-4], 1e-6),
    ("duct:12", &[1e-3, 1e-4], 1e-6),
    ("quads:4", &[1e-4], 1e-6),
    ("gap:5", &[1e-4], 1e-6),
    ("body:44", &[1e-4], 1e-6),
    ("tree:40", &[1e-2, 1e-3], 1e-5),
    ("tree:150", &[1e-1, 1e-2, 1e-3], 1e-4),
    ("height:16", &[1e-3, 1e-4], 1e-6),
    ("height:32", &[1e-3, 1e-4], 1e-5),
    ("height:64", &[1e-3, 1e-4], 1e-5),
    ("city:7", &[1e-3, 1e-4], 1e-5),
    ("city:12", &[1e-3, 1e-4], 1e-5),
    ("city:23", &[1e-3, 1e-4], 3e-5),
    ("scenes/living-room/scene.obj", &[1e-2], 2e-3),
];

/// Meshes of 100,352 and 1,000,000 triangles, of which only the first factor is computed.
const LARGE: [&str; 2] = ["height:224", "height:707"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    println!(
        "| scene | faces | tolerance | s | e_max | e_row | stated / true: least | 0.1 % | 50 % | 90 % | clipped | by rays |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    let mut all = Vec::new();
    if let Some(tolerances) = arguments.next() {
        let tolerances = tolerances.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let usage = "give tolerances, that of the reference, and scenes, as in 1e-2,1e-4 1e-6 city:8";
        let reference = arguments.next().and_then(|of| of.parse().ok()).ok_or(usage)?;
        arguments.try_for_each(|name| print_scene(&name, &tolerances, reference, &mut all))?;
    } else {
        for (name, tolerances, reference) in TABLE {
            print_scene(name, tolerances, *reference, &mut all)?;
        }
        LARGE.iter().try_for_each(|name| print_first(name))?;
    }
    all.sort_by(f64::total_cmp);
    println!("| all | | | | | | {} | | |", quantiles(&all));
    let n_beyond = all.partition_point(|ratio| *ratio < 1.0);
    println!(
        "\n{} partly visible pairs, of which {n_beyond} are off by more than is stated.",
        all.len()
    );
    Ok(())
}

/// Prints the rows of a scene, and adds its stated over true errors to `all`.
fn print_scene(name: &str, tolerances: &[f64], reference: f64, all: &mut Vec<f64>) -> Result<(), Box<dyn Error>> {
    let scene = load(name)?;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(1))?;
    let reference = compute(&scene, &mesh, reference, &Silent)?.0;
    for &tolerance in tolerances {
        let (found, seconds) = compute(&scene, &mesh, tolerance, &Silent)?;
        let against = Against::new(&found, &reference, &mesh, tolerance);
        let pairs = found.pairs.unwrap_or_default();
        println!(
            "| {name} | {} | {tolerance:e} | {seconds:.2} | {:.1e} | {:.1e} | {} | {} | {} |",
            mesh.n_patches(),
            against.of_entry,
            against.of_row,
            quantiles(&against.ratios),
            pairs.clipped,
            pairs.by_rays
        );
        all.extend(against.ratios);
    }
    Ok(())
}

/// Returns the least of some numbers in order, and the quantiles 1/1,000, 1/2 and 9/10.
fn quantiles(ordered: &[f64]) -> String {
    let Some(last) = ordered.len().checked_sub(1) else {
        return " | | | ".into();
    };
    let [least, thousandth, half, nine_tenths] = [0, 1, 500, 900].map(|part| ordered[part * last / 1000]);
    format!("{least:.2} | {thousandth:.2} | {half:.1} | {nine_tenths:.1}")
}

/// Prints the time until the first rows of form factors are finished.
fn print_first(name: &str) -> Result<(), Box<dyn Error>> {
    let scene = load(name)?;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(1))?;
    let first = First(OnceLock::new());
    // The work ends as interrupted.
    let _ = compute(&scene, &mesh, 1e-4, &first);
    let seconds = first.0.get().copied().unwrap_or(f64::NAN);
    println!("| {name} | {} | 1e-4 | first: {seconds:.2} |", mesh.n_patches());
    Ok(())
}

fn load(name: &str) -> Result<Scene, Box<dyn Error>> {
    Ok(match meshes::made(name) {
        Some(made) => made?.scene,
        None => scene::load(name)?.scene,
    })
}

/// Returns form factors and the processor time on one thread, in s.
fn compute(
    scene: &Scene,
    mesh: &Mesh,
    tolerance: f64,
    progress: &dyn Progress,
) -> Result<(Computed, f64), Box<dyn Error>> {
    let method = ExactMethod {
        tolerance,
        ..ExactMethod::default()
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(|| {
        let begun = processor_time();
        let visibility = BruteForce::new(scene);
        let input = Input {
            scene,
            mesh,
            visibility: &visibility,
            unoccluded: topology::is_convex_and_empty(scene),
        };
        let found = method.compute(input, StorageChoice::default(), progress)?;
        Ok::<_, FormFactorError>((found, processor_time() - begun))
    })?)
}

/// Returns the processor time of this thread, in s, or the wall time if the system does not provide it.
fn processor_time() -> f64 {
    static CLOCK: OnceLock<Instant> = OnceLock::new();
    let clock = CLOCK.get_or_init(Instant::now);
    let of_thread = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = of_thread.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| clock.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// Ends work at its first step, and stores the processor time of its thread.
struct First(OnceLock<f64>);

impl Progress for First {
    fn begin(&self, _: &str, _: u64) {}

    fn advance(&self, steps: u64) {
        if steps > 0 {
            let _ = self.0.set(processor_time());
        }
    }

    fn is_cancelled(&self) -> bool {
        self.0.get().is_some()
    }
}

/// The comparison of a result with a better one.
struct Against {
    /// The largest error of A_i F_ij / min(A_i, A_j).
    of_entry: f64,
    /// The largest error of Σ_j F_ij.
    of_row: f64,
    /// The ratios of stated to true errors, in order.
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
                // The errors of fully visible pairs are far smaller.
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
}

/// Returns F and its error for each column of a row.
fn row(of: &Computed, i: usize, n: usize) -> Vec<[f64; 2]> {
    let mut row = vec![[0.0; 2]; n];
    of.factors.for_each_in_row(i, |j, value, error| row[j] = [value, error]);
    row
}
