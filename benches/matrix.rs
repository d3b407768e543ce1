//! Measures how fast form factors are applied, beside a plain parallel read of as many bytes.
//!
//! `cargo bench --bench matrix` prints a table of rates and ratios. All of a row of the table were measured in turns, so that changes of the
//! machine's speed affect all of them; medians count. The ratio is the time of the read over the time of the pass: 1
//! is as fast as memory. `cargo bench --bench matrix -- "dense f32"` measures the rows whose names contain that, and a number, as in `-- sparse 768`, sets the number of patches: few
//! patches show the time of a pass in the caches. `-- sparse 1/16` has one in sixteen of the entries of a sparse matrix, in place of one in
//! four. The matrices on a disk were written just before, so the system has them in memory: the program's own work is measured.
#![expect(clippy::print_stdout, reason = "a table of rates is what a benchmark is for")]

use std::hint::black_box;
use std::time::Instant;

use pulp::Arch;
use radiosity::matrix::operator::{Block, LinearOperator, RowAccess};
use radiosity::matrix::{FormFactors, Layout, Place, Precision, RowTally, RowTile, Scratch, StorageChoice};
use rayon::prelude::*;

/// The default number of patches: 151 MB of f32 in full, more than caches hold.
const N: usize = 6144;

/// The number of runs of each measurement.
const N_ROUNDS: usize = 21;

/// The default ratio of all entries of a sparse matrix to its stored ones.
const ONE_IN: u64 = 4;

/// The columns of a run of entries.
///
/// In `room-box`, `corridor` and `sphere-room-r1`, shadows by `exact` leave runs of 20 to 40 on average, and 82 to 91 % of all
/// chunks of eight entries lie in one.
const RUN: usize = 32;

/// The number of words that one task of the plain read adds up.
const WORDS_PER_TASK: usize = 1 << 16;

fn main() {
    let n = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(N);
    let one_in = std::env::args().find_map(|argument| argument.strip_prefix("1/")?.parse().ok());
    let one_in = one_in.unwrap_or(ONE_IN);
    println!(
        "n = {n}, one in {one_in} entries where they are listed, times in ms, rates in GB/s, medians of {N_ROUNDS} rounds"
    );
    println!(
        "{:27} {:>7} {:>5} {:>7} | {:>7} {:>7} {:>5} | {:>7} {:>7} {:>5} {:>6} | {:>7} {:>7}",
        "matrix",
        "threads",
        "MB",
        "read",
        "1 ch",
        "rate",
        "ratio",
        "3 ch",
        "rate",
        "ratio",
        "/ 1 ch",
        "rows 1",
        "rows 3"
    );
    let wanted = std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with(['-', '1', '2', '3', '4', '5', '6', '7', '8', '9']));
    let read = vec![1_u64; n * n];
    let scratch = std::env::temp_dir();
    let disk = Place::Disk(Scratch {
        directory: &scratch,
        memory_byte: 1 << 26,
    });
    let kinds = [
        (Pattern::Full, false, Place::default()),
        (Pattern::Full, true, Place::default()),
        (Pattern::Runs, false, Place::default()),
        (Pattern::Runs, true, Place::default()),
        (Pattern::Scattered, false, Place::default()),
        (Pattern::Scattered, true, Place::default()),
        (Pattern::Full, false, disk),
        (Pattern::Full, true, disk),
        (Pattern::Runs, true, disk),
        (Pattern::Scattered, true, disk),
    ];
    let both =
        |(pattern, pairs, place)| [Precision::F32, Precision::F64].map(|precision| (pattern, pairs, place, precision));
    for (pattern, pairs, place, precision) in kinds.into_iter().flat_map(both) {
        let kind = if pairs { "symmetric" } else { "rows" };
        let on_disk = if place.is_on_disk() { ", disk" } else { "" };
        let (layout, of_entries) = match pattern {
            Pattern::Full => (Layout::Dense, ""),
            Pattern::Runs => (Layout::Sparse, ", runs"),
            Pattern::Scattered => (Layout::Sparse, ""),
        };
        let name = format!("{layout:?} {precision:?} {kind}{of_entries}{on_disk}").to_lowercase();
        if wanted.as_ref().is_some_and(|wanted| !name.contains(wanted)) {
            continue;
        }
        let factors = factors(
            n,
            StorageChoice {
                layout,
                precision,
                place,
                ranks: None,
            },
            pairs,
            |i, j| pattern.has(i, j, one_in),
        );
        for n_threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build();
            let line = || compare(&name, n_threads, &factors, &read[..factors.stored_byte() / 8]);
            pool.expect("threads start").install(line);
        }
    }
}

/// The pattern of the entries of a matrix.
#[derive(Clone, Copy)]
enum Pattern {
    /// Everywhere.
    Full,
    /// In runs of [`RUN`] columns, of which one in `one_in` has entries, with another start in every row.
    Runs,
    /// At scattered places.
    Scattered,
}

impl Pattern {
    fn has(self, i: usize, j: usize, one_in: u64) -> bool {
        match self {
            Self::Full => true,
            Self::Runs => scattered(i / RUN, (j + i) / RUN).is_multiple_of(one_in),
            Self::Scattered => scattered(i, j).is_multiple_of(one_in),
        }
    }
}

fn compare(name: &str, n_threads: usize, factors: &FormFactors, words: &[u64]) {
    let n = factors.n_rows();
    let blocks = [1, 3].map(|n_channels| {
        let values = (0..n * n_channels).map(|k| 1.0 + (k % 7) as f64);
        Block::from_values(values.collect(), n_channels)
    });
    let mut results = [1, 3].map(|n_channels| Block::zeros(n, n_channels));
    let mut times: [Vec<f64>; 5] = Default::default();
    let mut measure = |k: usize, run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        times[k].push(1e3 * start.elapsed().as_secs_f64());
    };
    for _ in 0..N_ROUNDS {
        measure(0, &mut || {
            black_box(plain_read(black_box(words)));
        });
        for (k, (x, y)) in blocks.iter().zip(&mut results).enumerate() {
            measure(1 + k, &mut || factors.apply(black_box(x), black_box(y)));
        }
    }
    // The read is measured separately, since it leaves other data in the caches than passes do.
    if n_threads == 1 && !factors.storage().place.is_on_disk() {
        for _ in 0..N_ROUNDS {
            for (k, (x, y)) in blocks.iter().zip(&mut results).enumerate() {
                measure(3 + k, &mut || by_rows(factors, black_box(x), black_box(y)));
            }
        }
    }
    let [read, one, three, rows_one, rows_three] = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times.get(N_ROUNDS / 2).copied().unwrap_or(f64::NAN)
    });
    let megabyte = factors.stored_byte() as f64 / 1e6;
    println!(
        "{name:27} {n_threads:7} {megabyte:5.0} {read:7.2} | {one:7.2} {:7.1} {:5.2} | {three:7.2} {:7.1} {:5.2} {:6.2} | {rows_one:7.2} {rows_three:7.2}",
        megabyte / one,
        read / one,
        megabyte / three,
        read / three,
        three / one
    );
}

/// Applies row after row, as Gauss-Seidel sweeps.
fn by_rows(factors: &FormFactors, x: &Block, y: &mut Block) {
    for i in 0..factors.n_rows() {
        let sums = y.row_mut(i);
        sums.fill(0.0);
        factors.dot_off_diagonal(i, x, sums);
    }
}

/// Adds up all words with the widest instructions of the processor, in four streams for each thread, which is faster than one.
fn plain_read(words: &[u64]) -> u64 {
    let sum = |chunk: &[u64]| {
        Arch::new().dispatch(|| {
            let (eights, rest) = chunk.as_chunks::<8>();
            let (front, back) = eights.split_at(eights.len() / 2);
            let ((a, b), (c, d)) = (front.split_at(front.len() / 2), back.split_at(front.len() / 2));
            let mut lanes = [[0_u64; 8]; 4];
            for (((p, q), r), s) in a.iter().zip(b).zip(c).zip(d) {
                add(&mut lanes[0], p);
                add(&mut lanes[1], q);
                add(&mut lanes[2], r);
                add(&mut lanes[3], s);
            }
            // A few words of the last chunk are omitted if its length is not a multiple of 32.
            lanes
                .as_flattened()
                .iter()
                .chain(rest)
                .fold(0_u64, |sum, word| sum.wrapping_add(*word))
        })
    };
    let chunks = words.par_chunks(WORDS_PER_TASK);
    chunks.map(sum).reduce(|| 0, u64::wrapping_add)
}

#[expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]
#[inline(always)]
fn add(lanes: &mut [u64; 8], words: &[u64; 8]) {
    for (lane, word) in lanes.iter_mut().zip(words) {
        *lane = lane.wrapping_add(*word);
    }
}

/// Returns a matrix by rows, or the same above the diagonal and its mirror image below.
fn factors(n: usize, choice: StorageChoice, pairs: bool, has: impl Fn(usize, usize) -> bool) -> FormFactors {
    let firsts: Vec<usize> = (0..n).step_by(16).collect();
    let tiles = firsts.into_iter().map(|first| {
        let mut tile = RowTile::new(first);
        for i in first..n.min(first + 16) {
            let columns = (if pairs { i } else { 0 }..n).filter(|&j| has(i, j));
            let entry = |j| (u32::try_from(j).expect("a small number"), 1.0 / n as f64, 0.0);
            tile.push_row(&columns.map(entry).collect::<Vec<_>>(), RowTally::default());
        }
        tile
    });
    let areas = vec![1.0; n];
    let made = if pairs {
        FormFactors::from_exchange_tiles(areas, tiles, choice)
    } else {
        FormFactors::from_tiles(areas, tiles, choice)
    };
    made.expect("sound rows")
}

/// Returns a number that seems unrelated to i and j.
fn scattered(i: usize, j: usize) -> u64 {
    let mixed = ((i as u64) << 32 | j as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 33
}
