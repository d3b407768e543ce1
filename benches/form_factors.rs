//! `exact` on one core: a closed cube, and a room with a floating box at three sizes.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use radiosity::form_factor::{ExactMethod, FormFactorMethod, Input};
use radiosity::matrix::{FormFactors, StorageChoice};
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{Scene, builtin, topology};
use radiosity::visibility::brute_force::BruteForce;

struct Prepared {
    scene: Scene,
    mesh: Mesh,
    visibility: BruteForce,
}

impl Prepared {
    fn new(name: &str, n: u32) -> Self {
        let scene = builtin::build(name, None).expect("a built-in scene").scene;
        Self {
            mesh: Mesh::new(&scene, Subdivision::Uniform(n)).expect("a mesh"),
            visibility: BruteForce::new(&scene),
            scene,
        }
    }

    fn compute(&self, tolerance: f64) -> FormFactors {
        let method = ExactMethod {
            tolerance,
            ..ExactMethod::default()
        };
        let input = Input {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            unoccluded: topology::is_convex_and_empty(&self.scene),
        };
        let computed = method.compute(input, StorageChoice::default(), &Silent);
        computed.expect("any scene can be treated").factors
    }
}

/// Returns max_i Σ_j |F_ij − G_ij|.
fn greatest_row_error(factors: &FormFactors, reference: &FormFactors) -> f64 {
    let n = factors.n_rows();
    let row = |f: &FormFactors, i: usize| {
        let mut values = vec![0.0; n];
        f.for_each_in_row(i, |j, value, _| values[j] = value);
        values
    };
    (0..n)
        .map(|i| {
            let pairs = row(factors, i).into_iter().zip(row(reference, i));
            pairs.map(|(a, b)| (a - b).abs()).sum()
        })
        .fold(0.0, f64::max)
}

fn exact(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let mut group = criterion.benchmark_group("exact");
    group.sample_size(10);
    for (name, n, tolerance) in [
        ("cube", 13, 1e-6),
        ("room-box", 1, 1e-6),
        ("room-box", 3, 1e-6),
        ("room-box", 9, 1e-5),
        ("room-box", 19, 1e-5),
        ("room-box", 19, 1e-3),
    ] {
        let prepared = Prepared::new(name, n);
        let error = greatest_row_error(&prepared.compute(tolerance), &prepared.compute(1e-9));
        let id = format!("{name}, {} patches, {tolerance:e}", prepared.mesh.n_patches());
        eprintln!("{id}: max_i sum_j |F_ij - exact| = {error:.1e}");
        group.bench_function(BenchmarkId::from_parameter(id), |bencher| {
            bencher.iter(|| pool.install(|| black_box(prepared.compute(tolerance))));
        });
    }
    group.finish();
}

criterion_group!(benches, exact);
criterion_main!(benches);
