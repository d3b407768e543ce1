//! Benchmarks `exact` on one core: a closed cube, a room with a floating box at three sizes, and the room after a move of the box.
//!
//! After the move all factors are computed, or only those that can have changed.

mod timing;

use radiosity::form_factor::{Before, Change, Computed, ExactMethod, FormFactorMethod, Input};
use radiosity::matrix::{FormFactors, StorageChoice};
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{Motion, Names, Pose, Scene, builtin, topology};
use radiosity::visibility::brute_force::BruteForce;
use timing::{is_wanted, measure};

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

    /// Returns the scene with the surfaces of the given prefix moved.
    fn moved(&self, prefix: &str, translate: [f64; 3]) -> Self {
        let names = self.scene.surfaces.iter().map(|surface| surface.name.clone());
        let motion = Motion {
            surface: Names::Many(names.filter(|name| name.starts_with(prefix)).collect()),
            rotate: None,
            axis: None,
            about: None,
            translate: Some(translate),
        };
        let mut pose = Pose::default();
        pose.push(&self.scene, &motion).expect("surfaces of the scene");
        let scene = self.scene.posed(&pose).expect("a scene");
        Self {
            mesh: self.mesh.posed(&pose, &scene),
            visibility: BruteForce::new(&scene),
            scene,
        }
    }

    fn input(&self) -> Input<'_> {
        Input {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            unoccluded: topology::is_convex_and_empty(&self.scene),
        }
    }

    fn compute(&self, tolerance: f64) -> FormFactors {
        let computed = exact_to(tolerance).compute(self.input(), StorageChoice::default(), &Silent);
        computed.expect("any scene can be treated").factors
    }

    fn update(&self, before: &Self, known: &FormFactors, tolerance: f64) -> Computed {
        let change = Change::between(&before.scene, &self.scene);
        let known_before = Before {
            factors: known,
            tolerance_met: true,
            change: &change,
        };
        let updated = exact_to(tolerance).update(self.input(), known_before, StorageChoice::default(), &Silent);
        updated.expect("any scene can be treated")
    }
}

fn exact_to(tolerance: f64) -> ExactMethod {
    ExactMethod {
        tolerance,
        ..ExactMethod::default()
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

fn one_thread() -> rayon::ThreadPool {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("a thread")
}

fn exact() {
    let pool = one_thread();
    for (name, n, tolerance) in [
        ("cube", 13, 1e-6),
        ("room-box", 1, 1e-6),
        ("room-box", 3, 1e-6),
        ("room-box", 9, 1e-5),
        ("room-box", 19, 1e-5),
        ("room-box", 19, 1e-3),
    ] {
        let prepared = Prepared::new(name, n);
        let id = format!("exact, {name}, {} patches, {tolerance:e}", prepared.mesh.n_patches());
        if !is_wanted(&id) {
            continue;
        }
        let error = greatest_row_error(&prepared.compute(tolerance), &prepared.compute(1e-9));
        eprintln!("{id}: max_i sum_j |F_ij - exact| = {error:.1e}");
        measure(&id, 1, || pool.install(|| prepared.compute(tolerance)));
    }
}

/// Measures the two ways after a move; their ratio is the saving by keeping factors, and the second includes the choice of these.
fn moved() {
    let pool = one_thread();
    let tolerance = 1e-5;
    for (name, prefix, n, translate) in [
        ("room-box", "box", 9, [0.1, 0.0, 0.0]),
        ("cornell-box", "short_block", 8, [0.02, 0.0, 0.0]),
    ] {
        let before = Prepared::new(name, n);
        let id = format!("exact after a move, {name}, {} patches", before.mesh.n_patches());
        if !is_wanted(&id) {
            continue;
        }
        let after = before.moved(prefix, translate);
        let known = before.compute(tolerance);
        let pairs = after
            .update(&before, &known, tolerance)
            .pairs
            .expect("exact looks at pairs");
        let anew = pairs.full + pairs.hidden + pairs.partial;
        eprintln!("{id}: {anew} of {} facing pairs anew", anew + pairs.kept);
        measure(&format!("{id}, all anew"), 1, || {
            pool.install(|| after.compute(tolerance))
        });
        measure(&format!("{id}, update"), 1, || {
            pool.install(|| after.update(&before, &known, tolerance))
        });
    }
}

fn main() {
    exact();
    moved();
}
