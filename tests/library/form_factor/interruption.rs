//! Form factors whose computation the caller stops, or gives a deadline, and their continuation by the next run.

use std::path::Path;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use radiosity::checkpoint::{Checkpoint, CheckpointError};
use radiosity::form_factor::{Computed, ExactMethod, FormFactorError, FormFactorMethod, Input};
use radiosity::matrix::{FormFactors, StorageChoice};
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::{Progress, Silent};
use radiosity::scene::{Scene, topology};
use radiosity::visibility::embree::EmbreeVisibility;

use crate::support::rooms::{self, Shapes, quick};

/// Asks to stop after a part of the work.
struct Stopper {
    part: f64,
    left: AtomicI64,
    checkpoint: Option<Checkpoint>,
}

impl Stopper {
    fn after(part: f64, checkpoint: Option<Checkpoint>) -> Self {
        Self {
            part,
            left: AtomicI64::new(i64::MAX),
            checkpoint,
        }
    }
}

impl Progress for Stopper {
    #[expect(clippy::cast_possible_truncation, reason = "a number of steps")]
    fn begin(&self, _stage: &str, total: u64) {
        self.left.store((self.part * total as f64) as i64, Ordering::SeqCst);
    }
    fn advance(&self, steps: u64) {
        self.left.fetch_sub(i64::try_from(steps).unwrap(), Ordering::SeqCst);
    }
    fn is_cancelled(&self) -> bool {
        self.left.load(Ordering::SeqCst) <= 0
    }
    fn checkpoint(&self) -> Option<&Checkpoint> {
        self.checkpoint.as_ref()
    }
}

fn room(with_box: bool) -> Scene {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.5), DQuat::IDENTITY, true);
    if with_box {
        let (low, high) = (DVec3::new(0.6, 0.3, 0.4), DVec3::new(1.1, 0.6, 0.9));
        shapes.cuboid(low, high, DQuat::IDENTITY, false);
    }
    shapes.scene()
}

/// All numbers of a matrix, to the last bit.
fn bits(factors: &FormFactors) -> Vec<(usize, usize, u64, u64)> {
    let mut all = Vec::new();
    for i in 0..factors.n_rows() {
        factors.for_each_in_row(i, |j, value, error| all.push((i, j, value.to_bits(), error.to_bits())));
    }
    all
}

/// Opens a checkpoint that this process has just closed: a process that another test is starting holds all open files, and their locks, until it is the program.
fn open(path: &Path) -> Checkpoint {
    loop {
        match Checkpoint::open(path, &[1; 32]) {
            Err(CheckpointError::InUse { .. }) => std::thread::sleep(Duration::from_millis(5)),
            opened => return opened.unwrap(),
        }
    }
}

/// Returns what a run to the end gives, and one that is stopped and goes on gives as well.
fn interrupted_and_resumed(method: &dyn FormFactorMethod, scene: &Scene, subdivide: u32, part: f64) -> Computed {
    let mesh = Mesh::new(scene, Subdivision::Uniform(subdivide)).unwrap();
    let visibility = EmbreeVisibility::new(scene).unwrap();
    let input = Input {
        scene,
        mesh: &mesh,
        visibility: &visibility,
        unoccluded: topology::is_convex_and_empty(scene),
    };
    let compute = |progress: &dyn Progress| method.compute(input, StorageChoice::default(), progress);
    let whole = compute(&Silent).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("checkpoint");
    let run = |share| {
        let progress = Stopper::after(share, Some(open(&path)));
        let computed = compute(&progress);
        (computed, progress.checkpoint.unwrap().n_pieces())
    };
    let (stopped, n_pieces) = run(part);
    assert!(
        matches!(stopped, Err(FormFactorError::Interrupted)),
        "{}",
        method.name()
    );
    assert!(n_pieces > 0, "{}: something is kept", method.name());
    let (resumed, n_in_all) = run(2.0);
    let resumed = resumed.unwrap();
    assert!(n_in_all > n_pieces, "{}", method.name());
    assert_eq!(bits(&resumed.factors), bits(&whole.factors), "{}", method.name());
    assert_eq!(resumed.factors.tallies(), whole.factors.tallies(), "{}", method.name());
    assert_eq!(
        (resumed.pairs, resumed.tolerance_met),
        (whole.pairs, whole.tolerance_met)
    );
    whole
}

#[test]
fn every_method_goes_on_to_the_same_bits() {
    for name in rooms::names().filter(|&name| name != "exact") {
        interrupted_and_resumed(&*quick(name, 3), &room(true), 3, 0.5);
    }
    // 2904 patches: 4.2 million pairs, of which this one keeps some 370,000 at a time.
    interrupted_and_resumed(&*quick("exact", 0), &room(false), 22, 0.5);
}

/// All pairs of a small scene are one piece, which may take hours: what is done of it is kept.
#[test]
fn pairs_inside_of_a_piece_are_kept() {
    let turned = rooms::moved(&room(true), DQuat::from_rotation_x(0.3), 1.0, DVec3::ZERO);
    let exact = ExactMethod {
        tolerance: 1e-5,
        ..ExactMethod::default()
    };
    interrupted_and_resumed(&exact, &turned, 4, 0.8);
}

/// Is late from the start.
struct Late;

impl Progress for Late {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn deadline(&self) -> Option<Instant> {
        Some(Instant::now())
    }
}

/// After the deadline pairs get bounds, which their errors state, and all else is as ever.
#[test]
fn late_work_states_what_is_not_known() {
    for with_box in [true, false] {
        let scene = rooms::moved(&room(with_box), DQuat::from_rotation_y(0.4), 1.0, DVec3::ZERO);
        let mesh = Mesh::new(&scene, Subdivision::Uniform(2)).unwrap();
        let visibility = EmbreeVisibility::new(&scene).unwrap();
        let unoccluded = topology::is_convex_and_empty(&scene);
        assert_eq!(unoccluded, !with_box);
        let input = Input {
            scene: &scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded,
        };
        let exact = ExactMethod::default();
        let compute = |progress: &dyn Progress| exact.compute(input, StorageChoice::default(), progress).unwrap();
        let (whole, late) = (compute(&Silent), compute(&Late));
        assert_eq!(late.tolerance_met, unoccluded);
        for i in 0..mesh.n_patches() {
            for j in 0..mesh.n_patches() {
                let off = (late.factors.get(i, j) - whole.factors.get(i, j)).abs();
                let stated = late.factors.std_error(i, j) + whole.factors.std_error(i, j);
                // Errors are stored in f32.
                assert!(
                    off <= stated * (1.0 + 1e-6) + 1e-12,
                    "{i} {j}: {off:e}, stated {stated:e}"
                );
            }
        }
    }
}

/// What is told of pairs above the tolerance is told of those that an earlier run computed, too.
#[test]
fn pairs_above_the_tolerance_are_counted_over_all_runs() {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.5), DQuat::IDENTITY, true);
    let (low, high) = (DVec3::new(0.6, 0.3, 0.0), DVec3::new(1.1, 0.6, 0.9));
    shapes.cuboid(low, high, DQuat::IDENTITY, false);
    let on_a_map = DVec3::new(500_000.0, 5_600_000.0, 100.0);
    let turned = rooms::moved(&shapes.scene(), DQuat::from_rotation_z(0.4), 1.0, on_a_map);
    let scene = rooms::with_decimals(3, &turned);
    let exact = ExactMethod {
        tolerance: 1e-4,
        ..ExactMethod::default()
    };
    // 1200 patches: 719,400 pairs, of which half a million make a batch.
    let whole = interrupted_and_resumed(&exact, &scene, 10, 0.85);
    let pairs = whole.pairs.unwrap();
    assert!(
        !whole.tolerance_met && pairs.n_above_by_rounding > 1000 && pairs.rounding_error_max > 1e-3,
        "{pairs:?}"
    );
}
