//! Form factors made reciprocal, and balanced.

#![expect(
    clippy::shadow_unrelated,
    clippy::needless_range_loop,
    reason = "every step of a test names its own results, and i and j are places of a matrix"
)]

use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::matrix::{FormFactors, Layout, MatrixError, Precision, RowTally, RowTile, StorageChoice};

use crate::support::{
    LewisRoom, Uniform, all_storages, bits, dense, matrix, random_room, random_rows, relative_error, shoot,
    solve_direct, storage, tiles,
};

#[test]
fn symmetrised_exchange_areas_are_equal_to_the_last_bit() {
    let areas = [1.0, 0.3, 7e-5, 2.0];
    for choice in all_storages() {
        let f = FormFactors::from_tiles(areas.to_vec(), tiles(&random_rows(4, 0.8, 10), 2), choice).unwrap();
        assert!(f.reciprocal_areas().is_none());
        let symmetric = f.symmetrised().unwrap();
        assert_eq!(bits(symmetric.reciprocal_areas().unwrap()), bits(&areas));
        for i in 0..4 {
            for j in 0..4 {
                let mean = f64::midpoint(areas[i] * f.get(i, j), areas[j] * f.get(j, i));
                let tolerance = if choice.precision == Precision::F32 {
                    1e-7
                } else {
                    1e-15
                };
                assert!((areas[i] * symmetric.get(i, j) - mean).abs() <= tolerance * mean);
                // Through F_ij = a_ij / A_i each side is rounded twice more.
                let (there, back) = (areas[i] * symmetric.get(i, j), areas[j] * symmetric.get(j, i));
                assert!((there - back).abs() <= 8e-16 * there);
            }
        }
    }
}

#[test]
fn better_estimates_count_more() {
    let new = |tallies: [RowTally; 2], entries: [(f64, f64); 2]| {
        let mut tile = RowTile::new(0);
        tile.push_row(&[(1, entries[0].0, entries[0].1)], tallies[0]);
        tile.push_row(&[(0, entries[1].0, entries[1].1)], tallies[1]);
        let f = FormFactors::from_tiles(vec![2.0, 1.0], [tile], StorageChoice::default()).unwrap();
        let symmetric = f.symmetrised().unwrap();
        (2.0 * symmetric.get(0, 1), 2.0 * symmetric.std_error(0, 1))
    };
    let near = |(a, e): (f64, f64), exchange: f64, std_error: f64| {
        assert!(
            (a - exchange).abs() < 1e-14 && (e - std_error).abs() < 1e-8,
            "{a} ± {e}"
        );
    };
    let none = RowTally::default();
    // Exchange areas 0.4 ± 0.02 and 0.3 ± 0.01: weights 1 : 4.
    near(
        new([none; 2], [(0.2, 0.01), (0.3, 0.01)]),
        0.32,
        (0.004_f64.powi(2) + 0.008_f64.powi(2)).sqrt(),
    );
    // An unknown error proves nothing: half and half.
    near(new([none; 2], [(0.2, 0.0), (0.3, 0.01)]), 0.35, 0.005);
    // Rays: weights N / A = 100 / 2 and 200 / 1, whatever the counts say.
    let rays = |n_rays| RowTally { n_rays, ..none };
    near(
        new([rays(100), rays(200)], [(0.2, 0.01), (0.3, 0.01)]),
        0.32,
        (0.004_f64.powi(2) + 0.008_f64.powi(2)).sqrt(),
    );
}

/// Rare hits: weights taken from the counts themselves would make the mean too small.
#[test]
fn the_mean_of_counts_is_not_biased() {
    let room = random_room(20, 0.05, 11);
    let probabilities = dense(&room);
    let mut uniform = Uniform(12);
    let (n_runs, mut sum, mut squares) = (200, 0.0, 0.0);
    for _ in 0..n_runs {
        let f = shoot(&probabilities, room.areas(), 40, &mut uniform);
        let symmetric = f.symmetrised().unwrap();
        let total: f64 = (0..20).map(|i| room.areas()[i] * symmetric.row_sum(i)).sum();
        sum += total;
        squares += total * total;
    }
    let mean = sum / f64::from(n_runs);
    let std_error = ((squares / f64::from(n_runs) - mean * mean) / f64::from(n_runs)).sqrt();
    let truth: f64 = room.areas().iter().sum();
    assert!(std_error < 2e-3 * truth, "the test can see a bias of a per cent");
    assert!(
        (mean - truth).abs() < 4.0 * std_error,
        "{mean} ± {std_error} for {truth}"
    );
}

#[test]
fn balance_gives_the_rows_their_sums() {
    let n = 40;
    let mut uniform = Uniform(13);
    // Where few patches see each other, a large one may find too little area to send its light to.
    for (layout, density, area_min) in [
        (Layout::Dense, 1.0, 1e-4),
        (Layout::Sparse, 0.3, 0.3),
        (Layout::Auto, 0.3, 0.3),
    ] {
        let areas: Vec<f64> = (0..n).map(|_| f64::powf(area_min, uniform.next())).collect();
        let mut rows = random_rows(n, density, 14);
        for (i, row) in rows.iter_mut().enumerate() {
            row.iter_mut().zip(&areas).for_each(|(f, a)| *f *= a / areas[i].max(*a));
        }
        let f = FormFactors::from_tiles(areas.clone(), tiles(&rows, 7), storage(layout, Precision::F64)).unwrap();
        let f = f.symmetrised().unwrap();
        let targets: Vec<f64> = (0..n).map(|i| if i % 3 == 0 { 0.6 } else { 1.0 }).collect();
        let (balanced, report) = f.balanced(&targets, 1e-12, 2000).unwrap();
        assert!(
            report.converged && report.row_error_max <= 1e-12,
            "{layout:?} {report:?}"
        );
        assert!(balanced.is_symmetric() && balanced.checks(true).reciprocity_error_max < 1e-13);
        for i in 0..n {
            assert!((balanced.row_sum(i) - targets[i]).abs() < 2e-12);
            for j in 0..n {
                let (before, after) = (f.get(i, j), balanced.get(i, j));
                assert_eq!(before > 0.0, after > 0.0, "zeros stay, and nothing else becomes zero");
            }
        }
        let (_, cut_short) = f.balanced(&targets, 1e-12, 3).unwrap();
        assert!(!cut_short.converged && cut_short.n_passes == 3 && cut_short.row_error_max > 1e-12);
        let (kept, report) = balanced.balanced(&targets, 1e-11, 10).unwrap();
        assert_eq!(report.n_passes, 1);
        assert_eq!(
            bits(&dense(&kept).concat()),
            bits(&dense(&balanced).concat()),
            "nothing to do"
        );
    }
}

/// What a row lacks may be the fault of one entry: the others may have been right.
#[test]
fn balance_adds_the_steps_that_it_makes_to_errors() {
    let n = 24;
    let mut tile = RowTile::new(0);
    for row in random_rows(n, 1.0, 5) {
        let entries: Vec<(u32, f64, f64)> = (0..).zip(row).map(|(j, f)| (j, f, 1e-9 * f)).collect();
        tile.push_row(&entries, RowTally::default());
    }
    let rows = FormFactors::from_tiles(vec![1.0; n], [tile], StorageChoice::default()).unwrap();
    let room = rows.symmetrised().unwrap();
    let (balanced, report) = room.balanced(&vec![0.8; n], 1e-12, 1000).unwrap();
    assert!(report.converged);
    for i in 0..n {
        for j in 0..n {
            let step = (balanced.get(i, j) - room.get(i, j)).abs();
            let (before, after) = (room.std_error(i, j), balanced.std_error(i, j));
            // Errors are stored in f32.
            assert!(
                after * (1.0 + 1e-6) >= before.max(step),
                "{i} {j}: {before} {step} {after}"
            );
        }
    }
}

#[test]
fn balance_says_what_it_cannot_do() {
    let plates = |areas: [f64; 2]| {
        let f = matrix(&areas, &[vec![0.0, 0.1], vec![0.1, 0.0]]);
        f.symmetrised().unwrap().balanced(&[1.0; 2], 1e-12, 100).unwrap()
    };
    let (equal, report) = plates([2.0, 2.0]);
    assert!(report.converged && (equal.get(0, 1) - 1.0).abs() < 1e-12);
    let (_, report) = plates([1.0, 2.0]);
    assert!(
        !report.converged && report.row_error_max > 0.1,
        "the larger plate cannot send all to the smaller"
    );
    // Patch 2 sees nothing, and stays so.
    let rows = [vec![0.0, 0.5, 0.0], vec![0.5, 0.0, 0.0], vec![0.0; 3]];
    let lonely = matrix(&[1.0; 3], &rows);
    assert_eq!(
        lonely.balanced(&[1.0; 3], 1e-12, 10).unwrap_err(),
        MatrixError::NotSymmetric
    );
    let lonely = lonely.symmetrised().unwrap();
    let (balanced, report) = lonely.balanced(&[1.0; 3], 1e-12, 100).unwrap();
    assert!(report.converged && report.n_empty_rows == 1);
    assert_eq!(bits(&[balanced.row_sum(2)]), [0]);
    let error = lonely.balanced(&[1.0, -0.5, 1.0], 1e-12, 10).unwrap_err();
    assert_eq!(error, MatrixError::Target { row: 1, target: -0.5 });
}

/// In a room with ρ = 0.999 and 200 rays a patch the mean with the transpose alone makes the light worse, and the
/// balance after it mends it.
#[test]
fn balanced_noise_gives_better_light_than_symmetrised_noise() {
    let lewis = LewisRoom::new(2);
    let f = matrix(&lewis.areas, &lewis.rows).symmetrised().unwrap();
    let n = lewis.areas.len();
    let (room, report) = f.balanced(&vec![1.0; n], 1e-13, 1000).unwrap();
    assert!(report.converged);
    let noisy = shoot(&dense(&room), &lewis.areas, 200, &mut Uniform(15));
    let symmetric = noisy.symmetrised().unwrap();
    let (balanced, report) = symmetric.balanced(noisy.row_targets(true), 1e-12, 1000).unwrap();
    assert!(report.converged);
    let reflectance = Block::from_values(vec![0.999; n], 1);
    let light = |f: &FormFactors| solve_direct(&dense(f), &reflectance, &lewis.exitance);
    let truth = light(&room);
    let errors = [&noisy, &symmetric, &balanced].map(|f| relative_error(&lewis.areas, &light(f), &truth));
    assert!(errors[1] > 0.05 && errors[2] < 1e-3, "{errors:?}");
}

/// Rows of rays that were counted: hits of each patch by each, out of so many.
fn counted(areas: &[f64], hits: &[Vec<u32>], n_rays: u64) -> FormFactors {
    let mut tile = RowTile::new(0);
    for row in hits {
        let share = |count: u32| f64::from(count) / n_rays as f64;
        let entry = |(j, &count): (u32, &u32)| {
            (
                j,
                share(count),
                (share(count) * (1.0 - share(count)) / n_rays as f64).sqrt(),
            )
        };
        let n_hits: u64 = row.iter().map(|&count| u64::from(count)).sum();
        let tally = RowTally {
            n_rays,
            n_escaped: n_rays - n_hits,
            ..RowTally::default()
        };
        tile.push_row(&(0..).zip(row).map(entry).collect::<Vec<_>>(), tally);
    }
    FormFactors::from_tiles(areas.to_vec(), [tile], StorageChoice::default()).unwrap()
}

/// A lamp of 1 m² and a sensor of 0.01 m², 5 m apart: 53 rays of 4096 find the lamp, and none the sensor.
#[test]
fn a_patch_that_all_rays_missed_is_still_seen() {
    let raw = counted(&[1.0, 0.01], &[vec![0, 0], vec![53, 0]], 4096);
    let symmetric = raw.symmetrised().unwrap();
    let targets = raw.row_targets(false);
    for (name, (repaired, report)) in [
        ("balanced", symmetric.balanced(&targets, 1e-10, 200).unwrap()),
        ("closed", symmetric.closed(&targets, 1e-10, 200).unwrap()),
    ] {
        assert!(report.converged && report.n_empty_rows == 0, "{name} {report:?}");
        for (i, j) in [(0, 1), (1, 0)] {
            let (before, after) = (symmetric.get(i, j), repaired.get(i, j));
            let error = symmetric.std_error(i, j);
            assert!(
                (after - before).abs() < 0.1 * error,
                "{name}: {before} ± {error} became {after}"
            );
            assert!(repaired.std_error(i, j) >= error, "{name}: errors do not shrink");
        }
        // The closed form is 1.2558e-4.
        assert!(
            (repaired.get(0, 1) - 1.2558e-4).abs() < 3.0 * repaired.std_error(0, 1),
            "{name}"
        );
    }
}

/// The sums of two plates whose rays contradict each other can be met, as what escaped is no better known than what arrived.
#[test]
fn rows_that_contradict_each_other_are_reconciled() {
    let raw = counted(&[1.0; 2], &[vec![0, 819], vec![822, 0]], 4096);
    let symmetric = raw.symmetrised().unwrap();
    let (balanced, report) = symmetric.balanced(raw.row_targets(false), 1e-10, 200).unwrap();
    assert!(report.converged, "{report:?}");
    assert!((balanced.row_sum(0) - 820.5 / 4096.0).abs() < 1e-6);
    // What is given as certain still has to be met as it is.
    let sums = [819.0 / 4096.0, 822.0 / 4096.0];
    let (_, report) = symmetric.balanced(&sums, 1e-10, 200).unwrap();
    assert!(!report.converged);
}

/// A bright room with windows: the light of balanced noise is nearer to the truth than that of noise as it comes or made symmetric alone, and no entry goes further than its
/// noise explains.
#[test]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of rays")]
fn balanced_noise_gives_better_light_in_an_open_room_too() {
    let lewis = LewisRoom::new(2);
    let n = lewis.areas.len();
    let f = matrix(&lewis.areas, &lewis.rows).symmetrised().unwrap();
    let (room, _) = f.balanced(&vec![1.0; n], 1e-13, 1000).unwrap();
    // Every seventh patch is a window.
    let kept: Vec<usize> = (0..n).filter(|i| i % 7 != 3).collect();
    let areas: Vec<f64> = kept.iter().map(|&i| lewis.areas[i]).collect();
    let n_rays = 400;
    let truth_rows: Vec<Vec<f64>> = kept
        .iter()
        .map(|&i| kept.iter().map(|&j| room.get(i, j)).collect())
        .collect();
    let reflectance = Block::from_values(vec![0.9; kept.len()], 1);
    let exitance = Block::from_values(vec![1.0; kept.len()], 1);
    let light = |rows: &[Vec<f64>]| solve_direct(rows, &reflectance, &exitance);
    let truth = light(&truth_rows);
    let (mut errors, mut furthest) = ([0.0; 3], 0.0_f64);
    for seed in 0..8 {
        let all = shoot(&dense(&room), &lewis.areas, n_rays, &mut Uniform(50 + seed));
        let count = |i: usize, j: usize| (all.get(i, j) * n_rays as f64).round() as u32;
        let hits: Vec<Vec<u32>> = kept
            .iter()
            .map(|&i| kept.iter().map(|&j| count(i, j)).collect())
            .collect();
        let raw = counted(&areas, &hits, n_rays);
        let symmetric = raw.symmetrised().unwrap();
        let (balanced, report) = symmetric.balanced(raw.row_targets(false), 1e-10, 200).unwrap();
        assert!(report.converged, "{seed} {report:?}");
        for (sum, f) in errors.iter_mut().zip([&raw, &symmetric, &balanced]) {
            *sum += relative_error(&areas, &light(&dense(f)), &truth) / 8.0;
        }
        for i in 0..kept.len() {
            symmetric.for_each_in_row(i, |j, value, error| {
                furthest = furthest.max((balanced.get(i, j) - value).abs() / error);
            });
        }
    }
    assert!(errors[2] < 0.8 * errors[1] && errors[2] < errors[0], "{errors:?}");
    assert!(furthest < 3.0, "{furthest} standard errors");
}

/// A symmetric room, and what is left of it when some of its exchange areas, those that say so, are wrong.
fn wrong_where_it_says_so(n: usize, seed: u64) -> (FormFactors, FormFactors) {
    let mut uniform = Uniform(seed);
    let room = random_room(n, 0.6, seed);
    let areas = room.areas().to_vec();
    let mut rows = vec![Vec::new(); n];
    for i in 0..n {
        for j in i..n {
            let exchange = areas[i] * room.get(i, j);
            let error = exchange * if (i + j) % 3 == 0 { 0.1 * uniform.next() } else { 0.0 };
            let off = error * (2.0 * uniform.next() - 1.0);
            rows[i].push((u32::try_from(j).unwrap(), exchange + off, error));
        }
    }
    let mut tile = RowTile::new(0);
    for row in &rows {
        tile.push_row(row, RowTally::default());
    }
    let wrong = FormFactors::from_exchange_tiles(areas, [tile], StorageChoice::default()).unwrap();
    (room, wrong)
}

#[test]
fn closure_moves_entries_by_their_variance_and_no_others() {
    for seed in 30..36 {
        let n = 40;
        let (room, wrong) = wrong_where_it_says_so(n, seed);
        let targets: Vec<f64> = (0..n).map(|i| room.row_sum(i)).collect();
        let (closed, report) = wrong.closed(&targets, 1e-12, 500).unwrap();
        assert!(
            report.converged && report.row_error_max <= 1e-12 && report.n_empty_rows == 0,
            "{report:?}"
        );
        assert!(closed.is_symmetric());
        // In units of the errors: what is nearest to the wrong ones among all that meet the targets is nearer to the truth, which meets them too.
        let (mut before, mut after) = (0.0, 0.0);
        for i in 0..n {
            assert!((closed.row_sum(i) - targets[i]).abs() < 2e-12, "{seed} {i}");
            for j in i..n {
                let (x, a, s) = (closed.get(i, j), wrong.get(i, j), wrong.std_error(i, j));
                let rounding = 1e-15 * a;
                assert!(
                    x >= 0.0 && (s > 0.0 || (x - a).abs() <= rounding),
                    "{seed} {i} {j}: {a} ± {s} became {x}"
                );
                let covered = 1.000_001 * closed.std_error(i, j) + rounding;
                assert!((x - a).abs() <= covered, "the error covers the step");
                let (there, back) = (closed.areas()[i] * x, closed.areas()[j] * closed.get(j, i));
                assert!((there - back).abs() <= 8e-16 * there);
                if s > 0.0 {
                    before += ((a - room.get(i, j)) / s).powi(2);
                    after += ((x - room.get(i, j)) / s).powi(2);
                }
            }
        }
        assert!(after < before, "{seed}: {before} {after}");
        let (kept, report) = closed.closed(&targets, 1e-11, 10).unwrap();
        assert!(report.converged && report.n_passes <= 2);
        assert_eq!(
            bits(&dense(&kept).concat()),
            bits(&dense(&closed).concat()),
            "nothing to do"
        );
    }
}

#[test]
fn closure_stops_at_zero_and_says_what_it_cannot_do() {
    // Row 0 sees too much; what it sees least of has the largest error and would become negative.
    let exchange = |entries: &[(usize, usize, f64, f64)], n: usize| {
        let mut tile = RowTile::new(0);
        for i in 0..n {
            let row: Vec<(u32, f64, f64)> = entries
                .iter()
                .filter(|e| e.0 == i)
                .map(|&(_, j, a, s)| (u32::try_from(j).unwrap(), a, s))
                .collect();
            tile.push_row(&row, RowTally::default());
        }
        FormFactors::from_exchange_tiles(vec![1.0; n], [tile], StorageChoice::default()).unwrap()
    };
    let crowded = exchange(
        &[
            (0, 1, 0.9, 0.01),
            (0, 2, 0.05, 0.5),
            (0, 3, 0.2, 0.02),
            (1, 2, 0.3, 0.1),
            (1, 3, 0.1, 0.1),
            (2, 3, 0.4, 0.2),
        ],
        4,
    );
    let targets = [1.0, 1.2, 0.8, 0.9];
    let (closed, report) = crowded.closed(&targets, 1e-12, 500).unwrap();
    assert!(report.converged, "{report:?}");
    for i in 0..4 {
        assert!((closed.row_sum(i) - targets[i]).abs() < 2e-12);
        assert!((0..4).all(|j| closed.get(i, j) >= 0.0));
    }
    assert!(closed.get(0, 2).abs() < 1e-300, "{}", closed.get(0, 2));
    // What has no error does not move, whatever the sums are.
    let certain = exchange(&[(0, 1, 0.5, 0.0)], 2);
    let (same, report) = certain.closed(&[1.0; 2], 1e-12, 50).unwrap();
    assert!(!report.converged && (report.row_error_max - 0.5).abs() < 1e-15);
    assert_eq!(bits(&dense(&same).concat()), bits(&dense(&certain).concat()));
    // It does not keep the others from their sums either.
    let partly = exchange(&[(0, 1, 0.5, 0.0), (2, 3, 0.7, 0.1)], 4);
    let (better, report) = partly.closed(&[1.0; 4], 1e-12, 50).unwrap();
    assert!(!report.converged && (report.row_error_max - 0.5).abs() < 1e-15);
    assert!((better.get(2, 3) - 1.0).abs() < 1e-11 && (better.get(0, 1) - 0.5).abs() < 1e-15);
    let rows = matrix(&[1.0; 2], &[vec![0.0, 0.5], vec![0.5, 0.0]]);
    assert_eq!(
        rows.closed(&[1.0; 2], 1e-12, 10).unwrap_err(),
        MatrixError::NotSymmetric
    );
}

/// Rows keep their sums, small patches are found by their own rays, and patches of equal size mostly by their own.
#[test]
fn pooled_rows_keep_their_sums_and_borrow_where_the_reverse_is_better() {
    let mut uniform = Uniform(77);
    let lewis = LewisRoom::new(1);
    let n = lewis.areas.len();
    // One patch is a hundredth of the others.
    let mut areas = lewis.areas.clone();
    areas[0] *= 0.01;
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| lewis.rows[i][j] * if j == 0 { 0.01 } else { 1.0 })
                .collect()
        })
        .collect();
    let room = matrix(&areas, &rows).symmetrised().unwrap();
    let (room, _) = room.balanced(&vec![1.0; n], 1e-13, 1000).unwrap();
    let (mut to_small, mut equal) = ([0.0; 2], [0.0; 2]);
    for _ in 0..20 {
        let raw = shoot(&dense(&room), &areas, 500, &mut uniform);
        let pooled = raw.pooled().unwrap();
        assert!(!pooled.is_symmetric());
        for i in 0..n {
            assert!((pooled.row_sum(i) - raw.row_sum(i)).abs() < 1e-12, "{i}");
            for (k, f) in [&raw, &pooled].into_iter().enumerate() {
                f.for_each_in_row(i, |_, value, error| assert!(value >= 0.0 && error > 0.0, "{i}"));
                let off = |j: usize| (f.get(i, j) - room.get(i, j)).powi(2);
                to_small[k] += off(0);
                equal[k] += (1..n).filter(|_| i > 0).map(off).sum::<f64>();
            }
        }
    }
    // Of independent rays all are better known; the small one nearly as its own rays know it, to a hundredth of the variance.
    assert!(to_small[1] < 0.05 * to_small[0], "{to_small:?}");
    assert!(equal[1] < 0.8 * equal[0], "{equal:?}");
    assert!(room.pooled().unwrap().is_symmetric());
}
