//! Form factors on a disk work like those in memory.

use std::ops::ControlFlow;
use std::path::Path;

use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::matrix::{
    DiskError, FormFactors, Layout, MatrixError, Place, Precision, RowTally, RowTile, Scratch, StorageChoice,
};
use radiosity::solver::registry::SOLVERS;
use radiosity::solver::{RadiositySystem, Solution, SolveOptions, SolverError};

use crate::support::solving::by_name;
use crate::support::{all_storages, bits, dense, on_disk, random_room, random_rows, storage, tiles};

/// The upper triangle of a room's exchange areas, tile by tile.
fn exchange_tiles(room: &FormFactors) -> Vec<RowTile> {
    let n = room.n_rows();
    let tile = |i: usize| {
        let mut tile = RowTile::new(i);
        let columns = (i..n).map(|j| (u32::try_from(j).unwrap(), room.areas()[i] * room.get(i, j), 1e-9));
        tile.push_row(&columns.collect::<Vec<_>>(), RowTally::default());
        tile
    };
    (0..n).map(tile).collect()
}

fn solved(name: &str, factors: &FormFactors) -> Result<Solution, SolverError> {
    let n = factors.n_rows();
    let channel = |k: usize| (0..2).map(move |c| 0.2 + 0.3 * ((k + c) % 3) as f64);
    let reflectance = Block::from_values((0..n).flat_map(channel).collect(), 2);
    let exitance = Block::from_values((0..2 * n).map(|k| if k < 20 { 1.0 } else { 0.0 }).collect(), 2);
    let system = RadiositySystem::new(factors, factors.areas().to_vec(), reflectance, exitance)?;
    let solver = by_name(name);
    solver.solve(&system, &SolveOptions::default(), &mut |_| ControlFlow::Continue(()))
}

fn relative_difference(a: &Solution, b: &Solution) -> f64 {
    let pairs = a.radiosity.values().iter().zip(b.radiosity.values());
    pairs.map(|(x, y)| (x - y).abs() / y).fold(0.0, f64::max)
}

#[test]
fn every_solver_finds_the_same_in_every_storage() {
    let room = random_room(150, 0.1, 1);
    let upper = exchange_tiles(&room);
    for name in SOLVERS.iter().map(|entry| entry.name) {
        let reference = solved(name, &room).unwrap();
        for choice in all_storages() {
            let factors = FormFactors::from_exchange_tiles(room.areas().to_vec(), upper.clone(), choice).unwrap();
            let solution = solved(name, &factors).unwrap();
            // Both are within the solver's tolerance, 1e-6; f32 adds up to 6e-8 of each form factor.
            assert!(relative_difference(&solution, &reference) < 2e-6, "{name} {choice:?}");
            if choice.place.is_on_disk() {
                let memory = StorageChoice {
                    place: Place::default(),
                    ..choice
                };
                let kept = FormFactors::from_exchange_tiles(room.areas().to_vec(), upper.clone(), memory).unwrap();
                let other = solved(name, &kept).unwrap();
                // The same sums in the same order.
                assert_eq!(
                    bits(solution.radiosity.values()),
                    bits(other.radiosity.values()),
                    "{name}"
                );
                assert_eq!(solution.n_passes, other.n_passes);
            }
        }
    }
}

#[test]
fn rows_on_a_disk_are_solved_repaired_and_checked_like_rows_in_memory() {
    let n = 150;
    let rows: Vec<Vec<f64>> = random_rows(n, 0.6, 3);
    let areas: Vec<f64> = (0..n).map(|k| 1.0 + (k % 7) as f64).collect();
    for (layout, precision) in [(Layout::Auto, Precision::F64), (Layout::Sparse, Precision::F32)] {
        let store = |choice| FormFactors::from_tiles(areas.clone(), tiles(&rows, 16), choice).unwrap();
        let memory = store(storage(layout, precision));
        let disk = store(on_disk(storage(layout, precision)));
        assert_eq!(disk.storage(), on_disk(storage(layout, precision)));
        let bits_of = |f: &FormFactors| bits(&dense(f).concat());
        assert_eq!(bits_of(&memory), bits_of(&disk));
        assert_eq!(memory.checks(false), disk.checks(false));
        assert_eq!(memory.density().to_bits(), disk.density().to_bits());
        let (a, b) = (
            solved("gauss-seidel", &memory).unwrap(),
            solved("gauss-seidel", &disk).unwrap(),
        );
        // Sums over 150 terms in another order.
        assert!(relative_difference(&a, &b) < 1e-13);
        let repaired = |f: &FormFactors| {
            let symmetric = f.symmetrised().unwrap();
            symmetric.balanced(&vec![0.5; n], 1e-12, 200).unwrap().0
        };
        let (in_memory, on_a_disk) = (repaired(&memory), repaired(&disk));
        assert!(on_a_disk.storage().place.is_on_disk());
        assert_eq!(bits_of(&in_memory), bits_of(&on_a_disk));
        assert_eq!(in_memory.checks(false), on_a_disk.checks(false));
    }
}

#[test]
fn passes_are_the_same_bytes_on_any_number_of_threads() {
    let rows = random_rows(200, 0.9, 5);
    let room = random_room(200, 0.5, 6);
    let choice = on_disk(StorageChoice::default());
    let general = FormFactors::from_tiles(vec![1.0; 200], tiles(&rows, 16), choice).unwrap();
    let symmetric = FormFactors::from_exchange_tiles(room.areas().to_vec(), exchange_tiles(&room), choice).unwrap();
    for factors in [general, symmetric] {
        let x = Block::from_values((0..600).map(|k| 1.0 / (1.0 + f64::from(k))).collect(), 3);
        let applied = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            let mut y = Block::zeros(200, 3);
            pool.install(|| factors.apply(&x, &mut y));
            bits(y.values())
        };
        assert_eq!(applied(1), applied(2));
        assert_eq!(applied(1), applied(4));
    }
}

#[test]
fn a_single_patch_has_a_matrix_and_no_patch_has_none() {
    let choice = on_disk(StorageChoice::default());
    let mut tile = RowTile::new(0);
    tile.push_row(&[(0, 0.25, 0.0)], RowTally::default());
    let one = FormFactors::from_tiles(vec![2.0], [tile.clone()], choice).unwrap();
    let symmetric = FormFactors::from_exchange_tiles(vec![2.0], [tile], choice).unwrap();
    assert_eq!(one.get(0, 0).to_bits(), 0.25_f64.to_bits());
    assert_eq!(symmetric.get(0, 0).to_bits(), 0.125_f64.to_bits());
    let none = FormFactors::from_tiles(Vec::new(), [], choice).unwrap_err();
    assert_eq!(none, MatrixError::Empty);
    assert_eq!(
        FormFactors::from_exchange_tiles(Vec::new(), [], choice).unwrap_err(),
        MatrixError::Empty
    );
}

#[test]
fn a_place_that_is_no_directory_is_named() {
    for directory in ["/no/such/directory", "/dev/null"] {
        let place = Place::Disk(Scratch {
            directory: Path::new(directory),
            memory_byte: 1 << 20,
        });
        let choice = StorageChoice {
            place,
            ..StorageChoice::default()
        };
        let mut tile = RowTile::new(0);
        tile.push_row(&[(0, 0.25, 0.0)], RowTally::default());
        let error = FormFactors::from_tiles(vec![1.0], [tile], choice).unwrap_err();
        assert!(
            matches!(error, MatrixError::Disk(DiskError::Unwritable { .. })),
            "{error}"
        );
        assert!(error.to_string().starts_with(directory), "{error}");
    }
}
