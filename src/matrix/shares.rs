//! Tests of passes in shares: every layout, any number of ranks.

use super::choice::{Layout, Place, Precision, Scratch, StorageChoice};
use super::form_factors::FormFactors;
use super::operator::{Block, LinearOperator as _};
use super::tile::{Entry, RowTally, RowTile};

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

#[test]
fn shares_of_a_pass_make_the_bytes_of_a_whole_one() {
    let n = 700;
    let directory = tempfile::tempdir().expect("a directory");
    let scratch = Scratch {
        directory: directory.path(),
        memory_byte: 1 << 20,
    };
    for place in [Place::default(), Place::Disk(scratch)] {
        for (layout, precision) in [(Layout::Dense, Precision::F64), (Layout::Auto, Precision::F32)] {
            let storage = StorageChoice {
                layout,
                precision,
                place,
            };
            let areas: Vec<f64> = (0..n).map(|i| 0.5 + (i % 13) as f64).collect();
            let symmetric = FormFactors::from_exchange_tiles(areas.clone(), [rows(n, true)], storage);
            let by_rows = FormFactors::from_tiles(areas, [rows(n, false)], storage);
            for factors in [symmetric, by_rows] {
                let factors = factors.expect("form factors");
                for n_channels in [1, 3] {
                    let values = (0..n * n_channels).map(|k| (k as f64 * 0.37).cos()).collect();
                    let x = Block::from_values(values, n_channels);
                    let (mut whole, mut shared) = (Block::zeros(n, n_channels), Block::zeros(n, n_channels));
                    factors.apply(&x, &mut whole);
                    for n_ranks in [1, 2, 3, 5, 64] {
                        let share = |rank| factors.entries.share_of_pass(&x, rank, n_ranks);
                        let shares: Vec<f64> = (0..n_ranks).flat_map(share).collect();
                        shared.values_mut().fill(f64::NAN);
                        factors.entries.end_pass(&shares, &mut shared);
                        let bits = |block: &Block| block.values().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                        assert!(bits(&shared) == bits(&whole), "{n_ranks} ranks, {storage:?}");
                    }
                }
            }
        }
    }
}
