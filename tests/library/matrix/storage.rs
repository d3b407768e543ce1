//! Form factors: storage, checks, sums over surfaces and repairs.

#![expect(
    clippy::shadow_unrelated,
    clippy::needless_range_loop,
    reason = "every step of a test names its own results, and i and j are places of a matrix"
)]

use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::matrix::{FormFactors, Layout, MatrixError, Precision, RayWeights, RowTally, RowTile, StorageChoice};

use crate::support::{
    Uniform, all_storages, bits, dense, exact, matrix, random_room, random_rows, relative_error, shoot, solve_direct,
    storage, tiles,
};

fn random_block(n: usize, n_channels: usize, seed: u64) -> Block {
    let mut uniform = Uniform(seed);
    Block::from_values((0..n * n_channels).map(|_| uniform.next()).collect(), n_channels)
}

#[test]
fn every_storage_gives_back_what_was_stored() {
    let n = 37;
    for density in [0.05, 0.5, 1.0] {
        let rows = random_rows(n, density, 1);
        let errors = random_rows(n, 0.5, 2);
        let mut stored = Vec::new();
        for (i, (row, errors)) in rows.iter().zip(&errors).enumerate() {
            let mut tile = RowTile::new(i);
            let entries: Vec<_> = (0..).zip(row).zip(errors).map(|((j, f), e)| (j, *f, *e)).collect();
            tile.push_row(
                &entries,
                RowTally {
                    n_rays: i as u64,
                    ..RowTally::default()
                },
            );
            stored.push(tile);
        }
        for choice in all_storages() {
            let f = FormFactors::from_tiles(vec![1.0; n], stored.clone(), choice).unwrap();
            let tolerance = if choice.precision == Precision::F32 { 6e-8 } else { 0.0 };
            let near = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance * b;
            for i in 0..n {
                let mut visited = vec![(0.0, 0.0); n];
                let mut last = None;
                f.for_each_in_row(i, |j, value, std_error| {
                    assert!(
                        last < Some(j) && (value > 0.0 || std_error > 0.0),
                        "ascending, and not zero"
                    );
                    last = Some(j);
                    visited[j] = (value, std_error);
                });
                for j in 0..n {
                    assert!(near(f.get(i, j), rows[i][j], tolerance) && near(f.std_error(i, j), errors[i][j], 6e-8));
                    assert_eq!(
                        bits(&[visited[j].0, visited[j].1]),
                        bits(&[f.get(i, j), f.std_error(i, j)])
                    );
                }
                assert!(near(f.row_sum(i), rows[i].iter().sum(), tolerance + 1e-15));
                assert_eq!(f.tallies()[i].n_rays, i as u64);
            }
            let n_nonzero = rows.iter().flatten().filter(|x| **x > 0.0).count();
            assert!((f.density() - n_nonzero as f64 / (n * n) as f64).abs() < 1e-15);
        }
    }
}

#[test]
fn storage_takes_the_memory_it_promises() {
    let n = 64;
    for (density, precision, layout, per_entry) in [
        (1.0, Precision::F64, Layout::Dense, 8),
        (1.0, Precision::F32, Layout::Dense, 4),
        (0.1, Precision::F64, Layout::Sparse, 12),
        (0.1, Precision::F32, Layout::Sparse, 8),
    ] {
        let rows = random_rows(n, density, 3);
        let whole = |choice| {
            FormFactors::from_tiles(vec![1.0; n], tiles(&rows, n), choice)
                .unwrap()
                .stored_byte()
        };
        let n_nonzero = rows.iter().flatten().filter(|x| **x > 0.0).count();
        let begins = if layout == Layout::Sparse { (n + 1) * 8 } else { 0 };
        assert_eq!(whole(storage(layout, precision)), n_nonzero * per_entry + begins);
        assert_eq!(
            whole(storage(Layout::Auto, precision)),
            n_nonzero * per_entry + begins,
            "chosen by density"
        );
    }
}

#[test]
fn applies_every_storage_and_any_number_of_channels() {
    for n in [1, 2, 3, 7, 50, 63, 64, 65] {
        for density in [0.1, 1.0] {
            let rows = random_rows(n, density, n as u64);
            for choice in all_storages() {
                let f =
                    FormFactors::from_tiles(vec![1.0; n], tiles(&rows, if n < 50 { 3 } else { 37 }), choice).unwrap();
                let rows = dense(&f);
                for n_channels in 1..=5 {
                    let x = random_block(n, n_channels, 4);
                    let mut y = Block::from_values(vec![f64::NAN; n * n_channels], n_channels);
                    f.apply(&x, &mut y);
                    for i in 0..n {
                        let mut off_diagonal = vec![1.0; n_channels];
                        let diagonal = f.rows().unwrap().dot_off_diagonal(i, &x, &mut off_diagonal);
                        assert_eq!(diagonal.to_bits(), rows[i][i].to_bits());
                        for c in 0..n_channels {
                            let sum: f64 = (0..n).map(|j| rows[i][j] * x.row(j)[c]).sum();
                            assert!((y.row(i)[c] - sum).abs() <= 1e-14 * sum);
                            let without = sum - diagonal * x.row(i)[c];
                            assert!((off_diagonal[c] - 1.0 - without).abs() <= 1e-14);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_channel_is_summed_alike_alone_and_in_company_on_any_number_of_threads() {
    let n = 101;
    for density in [0.1, 1.0] {
        let rows = random_rows(n, density, 5);
        for (choice, rows_per_tile) in all_storages().flat_map(|choice| [(choice, 3), (choice, 40)]) {
            let f = FormFactors::from_tiles(vec![1.0; n], tiles(&rows, rows_per_tile), choice).unwrap();
            let x = random_block(n, 5, 6);
            let apply = |channels: &[usize]| {
                let picked = (0..n).flat_map(|i| channels.iter().map(|&c| x.row(i)[c]).collect::<Vec<_>>());
                let mut y = Block::zeros(n, channels.len());
                f.apply(&Block::from_values(picked.collect(), channels.len()), &mut y);
                (0..n).map(|i| y.row(i)[0]).collect::<Vec<_>>()
            };
            let alone = bits(&apply(&[2]));
            for channels in [&[2, 0][..], &[2, 3, 1], &[2, 3, 1, 0], &[2, 1, 0, 3, 4]] {
                assert_eq!(bits(&apply(channels)), alone, "{channels:?}");
            }
            for n_threads in [1, 2, 4, 7] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
                assert_eq!(bits(&pool.install(|| apply(&[2, 3, 1]))), alone);
            }
        }
    }
}

#[test]
fn bad_matrices_are_refused() {
    let new = |areas: &[f64], tiles: Vec<RowTile>| {
        FormFactors::from_tiles(areas.to_vec(), tiles, StorageChoice::default())
            .map(|_| ())
            .unwrap_err()
    };
    let tile = |first_row: usize, rows: &[&[(u32, f64, f64)]]| {
        let mut tile = RowTile::new(first_row);
        for row in rows {
            tile.push_row(row, RowTally::default());
        }
        tile
    };
    assert_eq!(new(&[], vec![]), MatrixError::Empty);
    assert_eq!(new(&[1.0, -2.0], vec![]), MatrixError::Area { row: 1, area: -2.0 });
    assert!(matches!(new(&[f64::NAN], vec![]), MatrixError::Area { row: 0, .. }));
    let order = MatrixError::TileOrder { expected: 1, found: 2 };
    assert_eq!(new(&[1.0; 3], vec![tile(0, &[&[]]), tile(2, &[&[]])]), order);
    let missing = MatrixError::RowCount { expected: 3, found: 2 };
    assert_eq!(new(&[1.0; 3], vec![tile(0, &[&[], &[]])]), missing);
    let too_many = MatrixError::RowCount { expected: 1, found: 2 };
    assert_eq!(new(&[1.0], vec![tile(0, &[&[], &[]])]), too_many);
    let column = MatrixError::Column {
        row: 1,
        column: 2,
        n_rows: 2,
    };
    assert_eq!(new(&[1.0; 2], vec![tile(0, &[&[], &[(2, 0.5, 0.0)]])]), column);
    for (value, std_error) in [
        (f64::NAN, 0.0),
        (f64::INFINITY, 0.0),
        (0.5, f64::NAN),
        (0.5, -0.1),
        (0.5, 1e300),
    ] {
        let refused = MatrixError::Value { row: 0, column: 1 };
        assert_eq!(new(&[1.0; 2], vec![tile(0, &[&[(1, value, std_error)], &[]])]), refused);
    }
    let large = vec![tile(0, &[&[(0, 1e300, 0.0)]])];
    let f32_only = FormFactors::from_tiles(vec![1.0], large, storage(Layout::Dense, Precision::F32));
    assert_eq!(f32_only.unwrap_err(), MatrixError::Value { row: 0, column: 0 });
}

#[test]
#[should_panic(expected = "columns are strictly ascending")]
fn columns_that_repeat_are_a_programming_error() {
    RowTile::new(0).push_row(&[(1, 0.1, 0.0), (1, 0.2, 0.0)], RowTally::default());
}

/// Patches of 2, 1 and 1 m²; row 1 loses 0.1 to the sky and 0.2 to backs, and is counted with 10 rays.
#[test]
fn checks_find_what_was_put_in() {
    let rows = [[0.0, 0.5, 0.5], [0.7, 0.0, 0.0], [1.0, 0.25, -0.001]];
    let tallies = [
        RowTally::default(),
        RowTally {
            n_rays: 10,
            n_escaped: 1,
            n_absorbed: 1,
            weights: None,
        },
        RowTally::default(),
    ];
    let weighted = RayWeights {
        escaped: 0.1,
        absorbed: 0.2,
        squared: 0.125,
    };
    let with_weights = RowTally {
        weights: Some(weighted),
        ..tallies[1]
    };
    let new = |middle: RowTally| {
        let mut tile = RowTile::new(0);
        for (row, tally) in rows.iter().zip([tallies[0], middle, tallies[2]]) {
            tile.push_row(&exact(row), tally);
        }
        FormFactors::from_tiles(vec![2.0, 1.0, 1.0], [tile], StorageChoice::default()).unwrap()
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} for {b}");
    let checks = new(tallies[1]).checks(true);
    near(checks.row_sum.min, 0.7);
    near(checks.row_sum.max, 1.249);
    near(checks.closure_error_max.unwrap(), 0.3);
    // The pair (1, 2): nothing one way, 0.25 the other way. The pair (0, 1) is off by 2 · 0.5 − 0.7.
    near(checks.reciprocity_error_max, 0.3);
    near(checks.exchange_ratio_max, 1.0);
    assert_eq!(
        (checks.n_negative, checks.n_rays, checks.n_escaped, checks.n_absorbed),
        (1, 10, 1, 1)
    );
    near(new(tallies[1]).checks(false).closure_error_max.unwrap(), 0.1);
    near(new(with_weights).checks(false).closure_error_max.unwrap(), 0.0);
    assert_eq!(
        new(tallies[0]).checks(false).closure_error_max,
        None,
        "nothing is known about what left"
    );
    near(with_weights.escaped().unwrap(), 0.1);
    assert_eq!(tallies[0].escaped(), None, "without rays");
    near(with_weights.effective_rays().unwrap(), 8.0);
    let targets = new(with_weights).row_targets(false);
    // What a row of rays lost gives way; a row without rays keeps its sum.
    near(targets.sums[0], 1.0);
    near(targets.sums[1], 1.0);
    near(targets.lost[1], 0.3);
    let p = (8.0 * 0.3 + 1.0) / 10.0;
    near(targets.lost_variance[1], p * (1.0 - p) / 8.0);
    near(targets.sums[2], 1.249);
    near(targets.lost[2], 0.0);
    let closed = new(tallies[0]).row_targets(true);
    assert_eq!((closed.sums, closed.lost), (vec![1.0; 3], vec![0.0; 3]));
}

#[test]
fn a_good_matrix_passes_its_checks() {
    let checks = random_room(70, 1e-4, 7).checks(true);
    assert!(checks.closure_error_max.unwrap() < 1e-13);
    assert!(checks.reciprocity_error_max < 1e-13);
    assert!(checks.exchange_ratio_max <= 1.0);
    assert_eq!(checks.n_negative, 0);
}

/// Patches 0 and 1 are surface 1, patch 2 is surface 0, surface 2 is empty.
#[test]
fn surfaces_are_area_weighted_sums() {
    let mut tile = RowTile::new(0);
    let rays = |n_rays, n_escaped| RowTally {
        n_rays,
        n_escaped,
        ..RowTally::default()
    };
    tile.push_row(&[(1, 0.25, 0.0), (2, 0.5, 0.0)], rays(100, 25));
    tile.push_row(&[(0, 0.5, 0.0), (2, 0.25, 0.0)], rays(400, 100));
    tile.push_row(&[(0, 0.2, 0.01), (1, 0.3, 0.02)], RowTally::default());
    let f = FormFactors::from_tiles(vec![1.0, 3.0, 2.0], [tile], StorageChoice::default()).unwrap();
    let surfaces = f.surface_form_factors(&[1, 1, 0], 3);
    let near = |found: &[f64], expected: &[f64]| {
        assert!(found.len() == expected.len());
        let errors = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(errors.fold(0.0, f64::max) < 1e-9, "{found:?} for {expected:?}");
    };
    near(&surfaces.areas, &[2.0, 4.0, 0.0]);
    near(
        &surfaces.form_factor,
        &[0.0, 0.5, 0.0, 0.3125, 0.4375, 0.0, 0.0, 0.0, 0.0],
    );
    near(&surfaces.lost_factor, &[0.5, 0.25, 0.0]);
    let variance = |hits: f64, n: f64| (hits + 1.0) / (n + 2.0) * (1.0 - (hits + 1.0) / (n + 2.0)) / n;
    let error = |hits_0, hits_1| (variance(hits_0, 100.0) / 16.0 + 9.0 / 16.0 * variance(hits_1, 400.0)).sqrt();
    near(&surfaces.error[..3], &[0.0, 0.03, 0.0]);
    near(
        &surfaces.error[3..6],
        &[error(50.0, 100.0), error(25.0, 200.0), error(0.0, 0.0)],
    );
}

/// The error of a surface's form factor is the spread of repeated runs. 400 runs show it to 3.5 %; the entries' errors,
/// added as if independent, would be 29 % too large where half of the light goes to one surface.
#[test]
fn surface_errors_are_the_spread_of_repeated_runs() {
    let room = random_room(12, 0.2, 8);
    let patch_surface = [0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 2];
    let truth = room.surface_form_factors(&patch_surface, 3);
    let probabilities = dense(&room);
    let mut uniform = Uniform(9);
    let n_runs = 400;
    let (mut squared_deviation, mut squared_error) = ([0.0; 9], [0.0; 9]);
    for _ in 0..n_runs {
        let run = shoot(&probabilities, room.areas(), 200, &mut uniform).surface_form_factors(&patch_surface, 3);
        for k in 0..9 {
            squared_deviation[k] += (run.form_factor[k] - truth.form_factor[k]).powi(2) / f64::from(n_runs);
            squared_error[k] += run.error[k].powi(2) / f64::from(n_runs);
        }
    }
    for k in 0..9 {
        let ratio = (squared_error[k] / squared_deviation[k]).sqrt();
        assert!((ratio - 1.0).abs() < 0.12, "{k}: {ratio}");
    }
}

/// The figure that the documentation of `Precision::F32` gives.
#[test]
fn f32_storage_changes_radiosities_by_rounding_only() {
    let f = random_room(400, 0.1, 16);
    let rows = dense(&f);
    let narrow = FormFactors::from_tiles(
        f.areas().to_vec(),
        tiles(&rows, 9),
        storage(Layout::Dense, Precision::F32),
    );
    let narrow = dense(&narrow.unwrap());
    let mut emission = vec![0.0; 400];
    emission[11] = 1.0;
    let exitance = Block::from_values(emission, 1);
    for (rho, documented) in [(0.5, 5e-10), (0.99, 2e-9), (0.9999, 5e-8)] {
        let reflectance = Block::from_values(vec![rho; 400], 1);
        let change = relative_error(
            f.areas(),
            &solve_direct(&narrow, &reflectance, &exitance),
            &solve_direct(&rows, &reflectance, &exitance),
        );
        assert!((change / documented).ln().abs() < 0.3, "ρ = {rho}: {change:e}");
    }
}

#[test]
fn components_are_what_light_can_reach() {
    let n = 9;
    let mut rows = vec![vec![0.0; n]; n];
    // 0 - 4 - 2, 1 alone, 3 - 8 (seen from one side only), 5 - 6 - 7.
    for (i, j) in [(0, 4), (4, 2), (8, 3), (7, 5), (7, 6)] {
        rows[i][j] = 0.5;
    }
    let components = matrix(&[1.0; 9], &rows).components().unwrap();
    assert_eq!(components.n_components, 4);
    assert_eq!(components.labels, [0, 1, 0, 2, 0, 3, 3, 3, 2]);
    assert_eq!(random_room(20, 0.1, 17).components().unwrap().n_components, 1);
}
