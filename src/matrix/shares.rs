//! Tests of matrices that ranks share: every layout, any number of ranks.

use std::sync::Arc;

use super::choice::{Among, Layout, Place, Precision, Scratch, StorageChoice};
use super::form_factors::FormFactors;
use super::operator::{Block, LinearOperator as _, RowAccess as _};
use super::team::Team;
use super::tile::{Entry, RowTally, RowTile};
use crate::ranks::threads::on_ranks;

/// Rows with holes, of which those above the diagonal are exchange areas.
fn rows(n: usize, is_upper: bool) -> RowTile {
    let mut tile = RowTile::new(0);
    for i in 0..n {
        let first = if is_upper { i + 1 } else { 0 };
        let columns = (first..n).filter(|j| (i * 7 + j * 5) % 11 < 6 && i != *j);
        let entry = |j: usize| -> Entry {
            let value = ((i * 31 + 7) as f64 * (j + 1) as f64).sin().abs() / n as f64;
            (u32::try_from(j).expect("small"), value, 0.0)
        };
        let row: Vec<Entry> = columns.map(entry).collect();
        tile.push_row(&row, RowTally::default());
    }
    tile
}

/// All values that are read of form factors, as bits.
fn read(factors: &FormFactors) -> Vec<u64> {
    let n = factors.n_rows();
    let values = (0..n * 2).map(|k| (k as f64 * 0.37).cos()).collect();
    let x = Block::from_values(values, 2);
    let mut y = Block::zeros(n, 2);
    factors.apply(&x, &mut y);
    let mut numbers = y.values().to_vec();
    numbers.extend(factors.row_sums());
    numbers.extend([factors.density(), factors.stored_byte() as f64]);
    let checks = factors.checks(true);
    numbers.extend([checks.row_sum.min, checks.row_sum.max, checks.exchange_ratio_max]);
    numbers.extend([checks.closure_error_max.expect("rows"), checks.reciprocity_error_max]);
    numbers.push(checks.n_negative as f64);
    let components = factors.components().expect("rows");
    numbers.extend(components.labels.iter().map(|label| f64::from(*label)));
    let surfaces: Vec<u32> = (0..).take(n).map(|i: u32| i * 7 % 5).collect();
    let table = factors.surface_form_factors(&surfaces, 5);
    for of in [&table.form_factor, &table.error, &table.lost_factor] {
        numbers.extend(of);
    }
    numbers.into_iter().map(f64::to_bits).collect()
}

/// All entries, in order.
fn entries(factors: &FormFactors) -> Vec<u64> {
    let mut bits = Vec::new();
    for i in 0..factors.n_rows() {
        factors.for_each_in_row(i, |j, value, error| {
            bits.extend([j as u64, value.to_bits(), error.to_bits()]);
        });
    }
    bits
}

#[test]
fn ranks_that_store_parts_read_and_repair_as_one_process() {
    let n = 700;
    let directory = tempfile::tempdir().expect("a directory");
    let scratch = Scratch {
        directory: directory.path(),
        memory_byte: 1 << 20,
    };
    let areas: Vec<f64> = (0..n).map(|i| 0.5 + (i % 13) as f64).collect();
    for (place, layout, is_upper) in [
        (Place::default(), Layout::Dense, true),
        (Place::default(), Layout::Sparse, true),
        (Place::default(), Layout::Auto, false),
        (Place::default(), Layout::Dense, false),
        (Place::Disk(scratch), Layout::Auto, true),
        (Place::Disk(scratch), Layout::Auto, false),
    ] {
        let made = |ranks: Option<Among<'_>>| {
            let storage = StorageChoice {
                layout,
                precision: Precision::F32,
                place,
                ranks,
            };
            let mut tile = rows(n, is_upper);
            // A patch that sees nothing is a component by itself.
            assert!(tile.row(n - 1).is_empty() || !is_upper);
            tile = with_errors(&tile);
            let factors = if is_upper {
                FormFactors::from_exchange_tiles(areas.clone(), [tile], storage)
            } else {
                FormFactors::from_tiles(areas.clone(), in_tiles(&tile, 11), storage)
            };
            factors.expect("form factors")
        };
        let all = |factors: &FormFactors| {
            let symmetric = factors.symmetrised().expect("symmetric");
            let targets = vec![1.0; n];
            let (balanced, report) = symmetric.balanced(&targets, 1e-3, 5).expect("balanced");
            let (closed, of_closed) = symmetric.closed(&targets, 1e-3, 9).expect("closed");
            let reports = format!("{report:?} {of_closed:?}");
            let pooled = factors.pooled().expect("pooled");
            ([factors, &symmetric, &balanced, &closed, &pooled].map(read), reports)
        };
        let whole = made(None);
        let (expected, every_entry) = (all(&whole), entries(&whole));
        for n_ranks in [1, 2, 3, 5, 13] {
            on_ranks(n_ranks, |ranks| {
                // The first rows have the most work.
                let team = Arc::new(Team::new(&ranks, &[3.0, 2.0, 1.0, 1.0]));
                let factors = made(Some(Among(&team)));
                assert!(all(&factors) == expected, "{n_ranks} ranks, {layout:?}, {place:?}");
                assert!(factors.held_rows().is_some());
                let read = factors.by_first(|| entries(&factors));
                assert_eq!(read.is_some(), ranks.is_first());
                assert!(read.is_none_or(|read| read == every_entry));
                // A second time, and from one row to the next.
                let one = factors.by_first(|| factors.get(n - 1, 3).to_bits());
                assert!(one.is_none_or(|bits| bits == whole.get(n - 1, 3).to_bits()));
                let by_rows = factors.rows().expect("rows");
                let mut sum = [0.0];
                let x = Block::from_values((0..n).map(|k| (k as f64).sin()).collect(), 1);
                by_rows.dot_off_diagonal(n / 3, &x, &mut sum);
                let mut of_whole = [0.0];
                whole.dot_off_diagonal(n / 3, &x, &mut of_whole);
                assert!(sum.map(f64::to_bits) == of_whole.map(f64::to_bits));
                assert!(entries(&factors) == every_entry, "gathered on {n_ranks} ranks");
            });
        }
    }
}

/// The same rows with a standard error for each entry.
fn with_errors(tile: &RowTile) -> RowTile {
    let mut made = RowTile::new(tile.first_row());
    for k in 0..tile.n_rows() {
        let row: Vec<Entry> = tile
            .row(k)
            .iter()
            .map(|&(j, value, _)| (j, value, 0.1 * value))
            .collect();
        let tally = RowTally {
            n_rays: 1000 + k as u64,
            ..RowTally::default()
        };
        made.push_row(&row, tally);
    }
    made
}

/// The same rows in tiles of a few, which begin and end anywhere in those of ranks.
fn in_tiles(tile: &RowTile, n_rows: usize) -> Vec<RowTile> {
    let starts = (0..tile.n_rows()).step_by(n_rows);
    let part = |start: usize| {
        let mut part = RowTile::new(start);
        for k in start..tile.n_rows().min(start + n_rows) {
            part.push_row(tile.row(k), tile.tallies()[k]);
        }
        part
    };
    starts.map(part).collect()
}

/// A rank that reads a row of another without its help is stopped: no number is taken for zero.
#[test]
fn a_row_of_another_rank_is_not_read_as_zeros() {
    let areas = vec![1.0; 200];
    let read = on_ranks(2, |ranks| {
        let team = Arc::new(Team::new(&ranks, &[]));
        let storage = StorageChoice {
            ranks: Some(Among(&team)),
            ..StorageChoice::default()
        };
        let factors =
            FormFactors::from_exchange_tiles(areas.clone(), [rows(200, true)], storage).expect("form factors");
        let of_other = if ranks.is_first() { 199 } else { 0 };
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| factors.row_sum(of_other))).is_err()
    });
    assert_eq!(read, [true, true]);
}
