//! How fast form factors are applied, beside a plain parallel read of as many bytes.
//!
//! The ratio is the time of the read by the time of the application, both from the same run and in turn: 1 is as fast as memory.
#![expect(clippy::print_stdout, reason = "a benchmark prints its figures")]

use std::hint::black_box;
use std::time::Instant;

use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::matrix::{FormFactors, Layout, Precision, RowTally, RowTile, StorageChoice};
use rayon::prelude::*;

/// Patches: 288 MB of f64 in full, more than caches hold.
const N: usize = 6000;

/// Runs of each measurement; the median counts.
const N_RUNS: usize = 9;

fn main() {
    println!(
        "{:28} {:>8} {:>10} {:>10} {:>7}",
        "n = 6000", "MB", "read", "apply", "ratio"
    );
    for precision in [Precision::F64, Precision::F32] {
        for (layout, step) in [(Layout::Dense, 1), (Layout::Sparse, 10)] {
            let choice = StorageChoice {
                layout,
                precision,
                ..StorageChoice::default()
            };
            let rows = by_rows(choice, step);
            let symmetric = by_pairs(choice, step);
            for n_channels in [1, 3] {
                let name = format!("{layout:?} {precision:?}, {n_channels} channels");
                compare(&format!("{name}, rows"), &rows, n_channels);
                compare(&format!("{name}, pairs"), &symmetric, n_channels);
            }
        }
    }
}

fn compare(name: &str, factors: &FormFactors, n_channels: usize) {
    let words = vec![1_u64; factors.stored_byte() / 8];
    let x = Block::from_values(vec![0.5; N * n_channels], n_channels);
    let mut y = Block::zeros(N, n_channels);
    let (mut read, mut apply) = (Vec::new(), Vec::new());
    for _ in 0..N_RUNS {
        let start = Instant::now();
        let sum = |chunk: &[u64]| chunk.iter().fold(0_u64, |sum, word| sum ^ word);
        black_box(words.par_chunks(1 << 16).map(sum).reduce(|| 0, |a, b| a ^ b));
        read.push(start.elapsed().as_secs_f64());
        let after_read = Instant::now();
        factors.apply(black_box(&x), &mut y);
        black_box(&y);
        apply.push(after_read.elapsed().as_secs_f64());
    }
    let [read, apply] = [read, apply].map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[N_RUNS / 2]
    });
    println!(
        "{name:28} {:8.0} {:7.2} ms {:7.2} ms {:7.2}",
        factors.stored_byte() as f64 / 1e6,
        1e3 * read,
        1e3 * apply,
        read / apply
    );
}

/// Every `step`-th column of each row.
fn by_rows(choice: StorageChoice, step: usize) -> FormFactors {
    let tiles = (0..N)
        .step_by(16)
        .map(|first| tile(first..N.min(first + 16), step, |_| 0));
    FormFactors::from_tiles(vec![1.0; N], tiles, choice).expect("sound rows")
}

/// The same above the diagonal, and its mirror image below.
fn by_pairs(choice: StorageChoice, step: usize) -> FormFactors {
    let tiles = (0..N)
        .step_by(16)
        .map(|first| tile(first..N.min(first + 16), step, |i| i));
    FormFactors::from_exchange_tiles(vec![1.0; N], tiles, choice).expect("sound rows")
}

fn tile(rows: std::ops::Range<usize>, step: usize, first_column: impl Fn(usize) -> usize) -> RowTile {
    let mut tile = RowTile::new(rows.start);
    for i in rows {
        let columns = (first_column(i)..N).filter(|j| (i + j).is_multiple_of(step));
        let entry = |j| (u32::try_from(j).expect("a small number"), 1.0 / N as f64, 0.0);
        tile.push_row(&columns.map(entry).collect::<Vec<_>>(), RowTally::default());
    }
    tile
}
