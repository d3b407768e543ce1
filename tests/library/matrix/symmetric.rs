//! Symmetric matrices: half is stored, all of it is there.

#![expect(
    clippy::needless_range_loop,
    clippy::shadow_unrelated,
    reason = "every step of a test names its own results, and i and j are places of a matrix"
)]

use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::matrix::{FormFactors, Layout, MatrixError, Precision, RowTally, RowTile, StorageChoice};

use crate::support::{Uniform, all_storages, bits, dense, n_cases, storage};

/// Returns sizes around the side of a tile, 64.
fn sizes() -> &'static [usize] {
    n_cases::<&[usize]>(&[1, 64, 65, 131], &[1, 5, 63, 64, 65, 128, 131, 203])
}

struct Exchange {
    areas: Vec<f64>,
    /// a_ij and its error for j ≥ i, zero below.
    upper: Vec<Vec<(f64, f64)>>,
}

impl Exchange {
    /// Areas from 0.5 to 1; a share `density` of the entries is not zero, and a third of these have an error.
    fn new(n: usize, density: f64, seed: u64) -> Self {
        let mut uniform = Uniform(seed);
        let areas = (0..n).map(|_| 0.5 + 0.5 * uniform.next()).collect();
        let mut upper = vec![vec![(0.0, 0.0); n]; n];
        for i in 0..n {
            for j in i..n {
                if uniform.next() < density {
                    let error = if uniform.next() < 0.3 {
                        1e-3 * uniform.next()
                    } else {
                        0.0
                    };
                    upper[i][j] = (uniform.next() / n as f64, error);
                }
            }
        }
        Self { areas, upper }
    }

    fn at(&self, i: usize, j: usize) -> (f64, f64) {
        self.upper[i.min(j)][i.max(j)]
    }

    fn tiles(&self, rows_per_tile: usize) -> Vec<RowTile> {
        let mut tiles = Vec::new();
        for (t, rows) in self.upper.chunks(rows_per_tile).enumerate() {
            let mut tile = RowTile::new(t * rows_per_tile);
            for (k, row) in rows.iter().enumerate() {
                let i = t * rows_per_tile + k;
                let entries: Vec<_> = (0..).zip(row).skip(i).map(|(j, &(a, e))| (j, a, e)).collect();
                tile.push_row(&entries, RowTally::default());
            }
            tiles.push(tile);
        }
        tiles
    }

    fn store(&self, choice: StorageChoice) -> FormFactors {
        FormFactors::from_exchange_tiles(self.areas.clone(), self.tiles(7), choice).unwrap()
    }
}

fn random_block(n: usize, n_channels: usize, seed: u64) -> Block {
    let mut uniform = Uniform(seed);
    Block::from_values((0..n * n_channels).map(|_| uniform.next()).collect(), n_channels)
}

#[test]
fn both_halves_give_back_what_was_stored() {
    for &n in sizes() {
        for density in [0.02, 0.4, 1.0] {
            let exchange = Exchange::new(n, density, n as u64);
            for choice in all_storages() {
                let f = exchange.store(choice);
                let tolerance = if choice.precision == Precision::F32 {
                    7e-8
                } else {
                    4e-16
                };
                for i in 0..n {
                    let mut seen = vec![(0.0, 0.0); n];
                    let mut last = None;
                    f.for_each_in_row(i, |j, value, error| {
                        assert!(last < Some(j), "ascending");
                        last = Some(j);
                        seen[j] = (value, error);
                    });
                    for j in 0..n {
                        let (a, e) = exchange.at(i, j);
                        let (expected, error) = (a / exchange.areas[i], e / exchange.areas[i]);
                        assert!(
                            (seen[j].0 - expected).abs() <= tolerance * expected,
                            "{n} {choice:?} {i} {j}"
                        );
                        assert!((seen[j].1 - error).abs() <= 7e-8 * error);
                        assert_eq!(bits(&[seen[j].0, seen[j].1]), bits(&[f.get(i, j), f.std_error(i, j)]));
                    }
                }
                let n_nonzero = (0..n * n).filter(|k| exchange.at(k / n, k % n).0 > 0.0).count();
                assert!((f.density() * (n * n) as f64 - n_nonzero as f64).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn applies_what_is_stored() {
    for &n in sizes() {
        for density in [0.02, 1.0] {
            for choice in all_storages() {
                let f = Exchange::new(n, density, 3).store(choice);
                let rows = dense(&f);
                for n_channels in [1, 2, 3] {
                    let x = random_block(n, n_channels, 4);
                    let mut y = Block::from_values(vec![f64::NAN; n * n_channels], n_channels);
                    f.apply(&x, &mut y);
                    for i in 0..n {
                        let mut off_diagonal = vec![1.0; n_channels];
                        let diagonal = f.rows().unwrap().dot_off_diagonal(i, &x, &mut off_diagonal);
                        assert_eq!(diagonal.to_bits(), rows[i][i].to_bits());
                        for c in 0..n_channels {
                            let sum: f64 = (0..n).map(|j| rows[i][j] * x.row(j)[c]).sum();
                            assert!((y.row(i)[c] - sum).abs() <= 2e-14 * sum, "{n} {choice:?}");
                            let without = sum - diagonal * x.row(i)[c];
                            assert!((off_diagonal[c] - 1.0 - without).abs() <= 2e-14);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_channel_is_summed_alike_alone_and_in_company_on_any_number_of_threads() {
    let n = 500;
    for density in [0.02, 0.1, 1.0] {
        let f = Exchange::new(n, density, 5).store(StorageChoice::default());
        let x = random_block(n, 5, 6);
        let apply = |channels: &[usize]| {
            let picked = (0..n).flat_map(|i| channels.iter().map(|&c| x.row(i)[c]).collect::<Vec<_>>());
            let picked = Block::from_values(picked.collect(), channels.len());
            let mut y = Block::zeros(n, channels.len());
            f.apply(&picked, &mut y);
            let mut rows = Block::zeros(n, channels.len());
            for i in 0..n {
                f.rows().unwrap().dot_off_diagonal(i, &picked, rows.row_mut(i));
            }
            let first = |block: &Block| (0..n).map(|i| block.row(i)[0]).collect::<Vec<_>>();
            (bits(&first(&y)), bits(&first(&rows)))
        };
        let alone = apply(&[2]);
        for channels in [&[2, 0][..], &[2, 3, 1], &[2, 1, 0, 3, 4]] {
            assert_eq!(apply(channels), alone, "{channels:?}");
        }
        for n_threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            assert_eq!(pool.install(|| apply(&[2, 3, 1])), alone);
        }
    }
}

/// Eight rows of tiles: 36 tiles of 64 by 64 instead of 64.
#[test]
fn half_of_the_memory_is_enough() {
    let n = 512;
    let mut exchange = Exchange::new(n, 1.0, 7);
    exchange.upper.iter_mut().flatten().for_each(|entry| entry.1 = 0.0);
    for (precision, byte) in [(Precision::F64, 8), (Precision::F32, 4)] {
        let stored = exchange.store(storage(Layout::Auto, precision)).stored_byte();
        assert_eq!(stored, 36 * (64 * 64 * byte + 16));
    }
    let mut sparse = Exchange::new(n, 0.05, 8);
    sparse.upper.iter_mut().flatten().for_each(|entry| entry.1 = 0.0);
    // Strips of sixteen columns, of the tiles that are stored.
    let n_in = |i: usize, strip: usize| {
        (16 * strip..16 * (strip + 1))
            .filter(|&j| sparse.at(i, j).0 > 0.0)
            .count()
    };
    let (mut n_entries, mut n_rows, mut n_strips) = (0, 0, 0);
    for first in (0..n).step_by(64) {
        for strip in first / 16..n / 16 {
            let of_rows: Vec<usize> = (first..first + 64).map(|i| n_in(i, strip)).collect();
            n_entries += of_rows.iter().sum::<usize>();
            n_rows += of_rows.iter().filter(|&&n| n > 0).count();
            n_strips += usize::from(of_rows.iter().any(|&n| n > 0));
        }
    }
    let stored = sparse.store(StorageChoice::default()).stored_byte();
    assert!(n_rows < n_entries && n_rows < 36 * 512);
    // 16 bytes for each strip, 2 for each of its rows that has entries, and 16 for each tile.
    assert_eq!(stored, 8 * n_entries + 2 * n_rows + 16 * n_strips + 36 * 16);
}

#[test]
fn rows_that_are_missing_or_too_many_are_refused() {
    let exchange = Exchange::new(100, 0.5, 9);
    let store = |tiles: Vec<RowTile>| {
        let f = FormFactors::from_exchange_tiles(exchange.areas.clone(), tiles, StorageChoice::default());
        f.map(drop)
    };
    let tiles = exchange.tiles(30);
    assert_eq!(store(tiles.clone()), Ok(()));
    let order = MatrixError::TileOrder {
        expected: 30,
        found: 60,
    };
    assert_eq!(store([&tiles[..1], &tiles[2..]].concat()), Err(order));
    let (expected, found) = (100, 90);
    assert_eq!(
        store(tiles[..3].to_vec()),
        Err(MatrixError::RowCount { expected, found })
    );
    let mut more = RowTile::new(100);
    more.push_row(&[], RowTally::default());
    let (expected, found) = (100, 101);
    assert_eq!(
        store([tiles, vec![more]].concat()),
        Err(MatrixError::RowCount { expected, found })
    );
}
