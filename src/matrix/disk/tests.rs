//! Scratch files that others change.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::os::unix::fs::FileExt as _;

use super::*;
use crate::matrix::backend::Backend;
use crate::matrix::backend::Filling as _;
use crate::matrix::choice::{Layout, Place, Scratch, StorageChoice};
use crate::matrix::error::DiskError;
use crate::matrix::kernel::sizes::SIDE;
use crate::matrix::operator::Block;
use crate::matrix::tile::{RowTally, RowTile};

/// The rows 0 to n − 1 of the upper triangle of `n_blocks` rows of tiles, all of them but the last full.
fn file(layout: Layout) -> TileFile<f64> {
    let n = SIDE + 6;
    let scratch = Scratch {
        directory: &std::env::temp_dir(),
        memory_byte: 1 << 20,
    };
    let mut file = TileFile::create(n, scratch).unwrap();
    for rows in [0..SIDE, SIDE..n] {
        let mut tile = RowTile::new(rows.start);
        for i in rows {
            let columns = (i..n).filter(|j| (i + j) % 3 == 0);
            let entries: Vec<_> = columns
                .map(|j| (u32::try_from(j).unwrap(), 0.1 + j as f64, 0.5))
                .collect();
            tile.push_row(&entries, RowTally::default());
        }
        let row = tile.first_row() / SIDE;
        let squares = crate::matrix::symmetric::row_of_tiles(&tile, n, layout, row..n.div_ceil(SIDE)).unwrap();
        file.put_row(row, row, &squares).unwrap();
    }
    file
}

#[test]
fn damage_to_any_byte_is_noticed() {
    for layout in [Layout::Dense, Layout::Sparse] {
        let file = file(layout);
        let read_all = || {
            (0..2).try_for_each(|row| {
                file.for_each_tile(row, Part::All, |_, tile| {
                    assert!(tile.sizes().n_nonzero > 0);
                })
            })
        };
        read_all().unwrap();
        // Every byte of the sparse file; of the dense one a prime step meets all kinds of bytes.
        let step = if layout == Layout::Dense { 7 } else { 1 };
        for at in (0..file.n_byte(0..2) as u64).step_by(step) {
            let mut byte = [0];
            file.file().read_exact_at(&mut byte, at).unwrap();
            file.file().write_all_at(&[byte[0] ^ 0x10], at).unwrap();
            let error = read_all().unwrap_err();
            assert!(matches!(error, DiskError::Damaged { .. }), "{at}: {error}");
            assert!(error.to_string().contains(std::env::temp_dir().to_str().unwrap()));
            file.file().write_all_at(&byte, at).unwrap();
        }
        read_all().unwrap();
    }
}

#[test]
fn a_file_that_ends_too_soon_is_noticed() {
    let file = file(Layout::Auto);
    file.file().set_len(file.n_byte(0..2) as u64 - 1).unwrap();
    let error = file.read(1, 1..2, Part::All).unwrap_err();
    assert!(matches!(error, DiskError::Unreadable { .. }), "{error}");
}

/// After a failed read numbers are not a number, and the reason stays.
#[test]
fn a_failure_spoils_what_rests_on_it_and_is_kept() {
    let n = SIDE + 6;
    let mut tile = RowTile::new(0);
    for _ in 0..n {
        let columns = 0..u32::try_from(n).unwrap();
        let entries: Vec<_> = columns.map(|j| (j, 1.0 / n as f64, 0.0)).collect();
        tile.push_row(&entries, RowTally::default());
    }
    let scratch = Scratch {
        directory: &std::env::temp_dir(),
        memory_byte: 1 << 20,
    };
    let choice = StorageChoice {
        place: Place::Disk(scratch),
        ..StorageChoice::default()
    };
    let mut general = grid::Grid::<f64>::new(n, choice, scratch).unwrap();
    for rows in [0..SIDE, SIDE..n] {
        let mut block = RowTile::new(rows.start);
        rows.for_each(|i| block.push_row(tile.row(i), RowTally::default()));
        general.push(&block).unwrap();
    }
    general.file().write_all_at(&[0xFF; 8], 0).unwrap();
    let x = Block::from_values(vec![1.0; n], 1);
    let mut y = Block::zeros(n, 1);
    assert!(general.failure().is_none());
    general.apply(&x, &mut y);
    assert!(y.values()[..SIDE].iter().all(|sum| sum.is_nan()));
    assert!((y.values()[SIDE] - 1.0).abs() < 1e-14, "what could be read is right");
    let reason = general.failure().unwrap().clone();
    assert!(
        matches!(reason, DiskError::Damaged { row: 0, column: 0, .. }),
        "{reason}"
    );
    let mut sum = 0.0;
    general.for_each(3, 0..n, &mut |_, value, _| sum += value);
    assert!(sum.is_nan());
    let mut of_row = [0.0];
    assert!(general.dot_off_diagonal(3, &x, &mut of_row).is_nan() && of_row[0].is_nan());
    assert_eq!(general.failure(), Some(&reason));
}
