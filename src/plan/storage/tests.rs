use super::*;
use crate::matrix::{FormFactors, RowTally, RowTile, StorageChoice};

const GIB: u64 = 1 << 30;

/// Returns the demand of 20000 patches that all see each other: 3.2 GB of f64 and 1.6 GB of errors in full, half of that symmetric.
fn demand() -> StorageDemand {
    StorageDemand {
        n_patches: 20_000,
        n_channels: 1,
        n_threads: 2,
        by_rows: false,
        repaired: false,
        n_beside: 0,
        density: 1.0,
        used_byte: 50 << 20,
        working_byte: 0,
        image_byte: 0,
        accuracy: Some(Accuracy {
            absorption_min: 0.5,
            tolerance: 2e-6,
        }),
        limit_byte: 16 * GIB,
        n_ranks: 1,
        rows_for: None,
    }
}

#[test]
fn ranks_store_parts_unless_the_solver_goes_by_rows() {
    let matrix = |n_ranks, rows_for| {
        let demand = StorageDemand {
            n_ranks,
            rows_for,
            ..demand()
        };
        plan_storage(&demand, StorageWish::default())
            .unwrap()
            .memory
            .matrix_byte as f64
    };
    let alone = matrix(1, Some("sor"));
    for n_ranks in [2, 3, 4, 8] {
        let k = n_ranks as f64;
        let share = matrix(n_ranks, None) / alone;
        assert!(
            share <= 2.0 / k && share >= (2.0 / k - 1.0 / (k * k)) * 0.99,
            "{n_ranks}: {share}"
        );
        assert!(matrix(n_ranks, Some("sor")) > alone * (0.99 + share));
    }
    let rows = |n_ranks| {
        let by_rows = StorageDemand {
            n_ranks,
            by_rows: true,
            ..demand()
        };
        let plan = plan_storage(&by_rows, StorageWish::default()).unwrap();
        (plan.memory.matrix_byte as f64, plan.memory.rows_byte)
    };
    for n_ranks in [2, 3, 4, 8] {
        let share = rows(n_ranks).0 / rows(1).0;
        let least = 1.0 / n_ranks as f64;
        assert!(share >= least && share <= 1.03 * least + 0.01, "{n_ranks}: {share}");
        assert!(rows(n_ranks).1 > rows(1).1);
    }
    let tight = StorageDemand {
        n_ranks: 4,
        limit_byte: 2 * GIB,
        ..demand()
    };
    assert!(plan_storage(&tight, StorageWish::default()).is_ok());
    let by_rows = StorageDemand {
        rows_for: Some("sor"),
        ..tight
    };
    let text = plan_storage(&by_rows, StorageWish::default()).unwrap_err().to_string();
    assert!(
        text.contains("`sor`") && text.contains("3.4 GiB") && text.contains("`pcg`") && !text.contains("`direct`"),
        "{text}"
    );
}

fn chosen(demand: StorageDemand) -> (Precision, bool) {
    let plan = plan_storage(&demand, StorageWish::default()).unwrap();
    assert!(plan.memory.total_byte() <= demand.limit_byte, "{plan:?}");
    (plan.precision, plan.on_disk)
}

#[test]
fn memory_comes_first_then_f32_then_the_disk() {
    assert_eq!(chosen(demand()), (Precision::F64, false));
    let tight = StorageDemand {
        limit_byte: 9 * GIB / 4,
        ..demand()
    };
    assert_eq!(chosen(tight), (Precision::F32, false));
    // A tenth of this tolerance is below the measured effect of rounding equal patches.
    let near = StorageDemand {
        accuracy: Some(Accuracy {
            absorption_min: 0.5,
            tolerance: 5e-7,
        }),
        ..tight
    };
    assert_eq!(chosen(near), (Precision::F64, true));
    let little = StorageDemand {
        limit_byte: GIB,
        ..demand()
    };
    assert_eq!(chosen(little), (Precision::F64, true));
}

#[test]
fn what_is_near_singular_or_the_result_itself_stays_f64() {
    let tight = StorageDemand {
        limit_byte: 9 * GIB / 4,
        ..demand()
    };
    let result = StorageDemand {
        accuracy: None,
        ..tight
    };
    assert_eq!(chosen(result), (Precision::F64, true));
    for absorption_min in [1e-4, 0.0] {
        let accuracy = Some(Accuracy {
            absorption_min,
            tolerance: 1e-6,
        });
        let plan = plan_storage(&StorageDemand { accuracy, ..tight }, StorageWish::default()).unwrap();
        assert!(plan.on_disk && plan.precision == Precision::F64 && plan.reason.contains("1 − ρ"));
    }
}

#[test]
fn what_does_not_fit_is_refused_with_what_would() {
    let tiny = StorageDemand {
        limit_byte: 60 << 20,
        ..demand()
    };
    let error = plan_storage(&tiny, StorageWish::default()).unwrap_err();
    let StorageError::TooSmall { needed_byte, .. } = error else {
        panic!("{error}")
    };
    let enough = StorageDemand {
        limit_byte: needed_byte,
        ..demand()
    };
    assert!(plan_storage(&enough, StorageWish::default()).unwrap().on_disk);
    let in_memory = StorageWish {
        on_disk: Some(false),
        ..StorageWish::default()
    };
    let refused = plan_storage(
        &StorageDemand {
            limit_byte: GIB,
            ..demand()
        },
        in_memory,
    )
    .unwrap_err();
    assert!(refused.to_string().contains("storage=auto"), "{refused}");
}

#[test]
fn a_repair_and_rows_of_few_entries_count() {
    let rows = StorageDemand {
        by_rows: true,
        ..demand()
    };
    let total = |d: &StorageDemand| estimate(d, Layout::Auto, Precision::F64, false).matrix_byte;
    let repaired = StorageDemand { repaired: true, ..rows };
    let ratio = total(&repaired) as f64 / total(&rows) as f64;
    assert!((1.9..2.1).contains(&ratio), "{ratio}");
    let three = total(&StorageDemand { n_beside: 2, ..rows }) as f64 / total(&rows) as f64;
    assert!((2.9..3.1).contains(&three), "{three}");
    let sparse = StorageDemand { density: 0.1, ..rows };
    let share = total(&sparse) as f64 / total(&rows) as f64;
    // Rows that are half full take as much as full ones.
    assert!((0.20..0.25).contains(&share), "{share}");
}

#[test]
fn no_matrix_takes_more_than_the_estimate() {
    for (by_rows, full_to) in [(false, 0), (true, 0), (false, 256), (true, 256)] {
        for one_in in [100, 8, 3, 2, 1] {
            // The first columns are full, the others have one in `one_in` of their entries.
            let n = 512;
            let has = |i: usize, j: usize| j < full_to || (i * 31 + j * 17).is_multiple_of(one_in);
            let tiles = (0..n).step_by(64).map(|first| {
                let mut tile = RowTile::new(first);
                for i in first..first + 64 {
                    let columns = (if by_rows { 0 } else { i }..n).filter(|&j| has(i, j));
                    let entry = |j| (u32::try_from(j).unwrap(), 1.0 / n as f64, 1e-9);
                    tile.push_row(&columns.map(entry).collect::<Vec<_>>(), RowTally::default());
                }
                tile
            });
            let (areas, choice) = (vec![1.0; n], StorageChoice::default());
            let stored = if by_rows {
                FormFactors::from_tiles(areas, tiles, choice)
            } else {
                FormFactors::from_exchange_tiles(areas, tiles, choice)
            };
            let stored = stored.unwrap();
            let demand = StorageDemand {
                n_patches: n,
                by_rows,
                density: stored.density(),
                ..demand()
            };
            let told = estimate(&demand, Layout::Auto, Precision::F64, false).matrix_byte;
            let taken = stored.stored_byte() as u64;
            assert!(taken <= told, "{by_rows} {full_to} {one_in}: {taken} of {told}");
        }
    }
}

#[test]
fn bytes_are_readable() {
    assert_eq!(byte_text(1023), "1023 B");
    assert_eq!(byte_text(512 << 20), "512 MiB");
    assert_eq!(byte_text(5 * GIB / 2), "2.5 GiB");
}
