//! Matrices, random numbers and a direct solver for the tests.

#[path = "../../support/cases.rs"]
mod cases;
pub(crate) mod rooms;
pub(crate) mod solving;

pub(crate) use cases::n_cases;

use std::path::PathBuf;
use std::sync::LazyLock;

use radiosity::matrix::operator::Block;
use radiosity::matrix::{Entry, FormFactors, Layout, Place, Precision, RowTally, RowTile, Scratch, StorageChoice};

/// A small generator of uniform numbers in [0, 1): SplitMix64.
pub(crate) struct Uniform(pub(crate) u64);

impl Uniform {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    /// Returns a number whose logarithm is uniform.
    pub(crate) fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }
}

/// Wraps the rows of a matrix as tiles of `rows_per_tile` rows, without rays.
pub(crate) fn tiles(rows: &[Vec<f64>], rows_per_tile: usize) -> Vec<RowTile> {
    let mut tiles = Vec::new();
    for (t, chunk) in rows.chunks(rows_per_tile).enumerate() {
        let mut tile = RowTile::new(t * rows_per_tile);
        for row in chunk {
            tile.push_row(&exact(row), RowTally::default());
        }
        tiles.push(tile);
    }
    tiles
}

/// A row as entries without errors.
pub(crate) fn exact(row: &[f64]) -> Vec<Entry> {
    row.iter().zip(0..).map(|(&f, j)| (j, f, 0.0)).collect()
}

pub(crate) fn matrix(areas: &[f64], rows: &[Vec<f64>]) -> FormFactors {
    FormFactors::from_tiles(areas.to_vec(), tiles(rows, 5), StorageChoice::default()).expect("a valid matrix")
}

/// A symmetric closed room of `n` patches that all see all (themselves too), with areas from `area_min` to 1.
pub(crate) fn random_room(n: usize, area_min: f64, seed: u64) -> FormFactors {
    let mut uniform = Uniform(seed);
    let areas: Vec<f64> = (0..n).map(|_| area_min.powf(uniform.next())).collect();
    let mut entry = |i: usize, j: usize| uniform.next() * areas[j] / areas[i].max(areas[j]);
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    let symmetric = matrix(&areas, &rows).symmetrised().expect("finite");
    let (room, report) = symmetric.balanced(&vec![1.0; n], 1e-14, 1000).expect("symmetric");
    assert!(report.converged, "{report:?}");
    room
}

/// Returns the stated errors of all pairs of patches, of A_i F_ij / min(A_i, A_j).
fn pair_errors(factors: &FormFactors) -> impl Iterator<Item = f64> + '_ {
    let areas = factors.areas();
    let n = areas.len();
    (0..n).flat_map(move |i| (i + 1..n).map(move |j| factors.std_error(i, j) * areas[i] / areas[i].min(areas[j])))
}

/// Returns the number of pairs whose stated error is above a tolerance, by more than rounding.
pub(crate) fn n_above(factors: &FormFactors, tolerance: f64) -> u64 {
    pair_errors(factors)
        .filter(|error| *error > tolerance * (1.0 + 1e-12))
        .count() as u64
}

/// Returns the greatest stated error of a pair.
pub(crate) fn worst_error(factors: &FormFactors) -> f64 {
    pair_errors(factors).fold(0.0, f64::max)
}

/// Reads a matrix back, entry by entry.
pub(crate) fn dense(form_factors: &FormFactors) -> Vec<Vec<f64>> {
    let n = form_factors.n_rows();
    let row = |i: usize| (0..n).map(|j| form_factors.get(i, j)).collect();
    (0..n).map(row).collect()
}

/// Solves (I − diag(ρ) F) B = E by Gaussian elimination with partial pivoting.
pub(crate) fn solve_direct(f: &[Vec<f64>], reflectance: &Block, exitance: &Block) -> Block {
    let n = f.len();
    let mut solution = exitance.clone();
    for c in 0..exitance.n_channels() {
        let coefficient = |i: usize, j: usize| f64::from(u8::from(i == j)) - reflectance.row(i)[c] * f[i][j];
        let mut g: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| coefficient(i, j)).collect()).collect();
        for (i, row) in g.iter_mut().enumerate() {
            row.push(exitance.row(i)[c]);
        }
        for k in 0..n {
            let pivot = (k..n)
                .max_by(|&a, &b| g[a][k].abs().total_cmp(&g[b][k].abs()))
                .expect("rows are left");
            g.swap(k, pivot);
            let (above, below) = g.split_at_mut(k + 1);
            let pivot_row = &above[k];
            for row in below {
                let factor = row[k] / pivot_row[k];
                for (x, p) in row[k..].iter_mut().zip(&pivot_row[k..]) {
                    *x -= factor * p;
                }
            }
        }
        for k in (0..n).rev() {
            let known: f64 = (k + 1..n).map(|j| g[k][j] * solution.row(j)[c]).sum();
            solution.row_mut(k)[c] = (g[k][n] - known) / g[k][k];
        }
    }
    solution
}

/// sqrt(Σ A (x − y)² / Σ A y²), the worst channel.
pub(crate) fn relative_error(areas: &[f64], x: &Block, y: &Block) -> f64 {
    let mut worst: f64 = 0.0;
    for c in 0..y.n_channels() {
        let sum =
            |term: &dyn Fn(usize) -> f64| -> f64 { areas.iter().enumerate().map(|(i, a)| a * term(i).powi(2)).sum() };
        let difference = sum(&|i| x.row(i)[c] - y.row(i)[c]);
        let size = sum(&|i| y.row(i)[c]);
        worst = worst.max(if size > 0.0 {
            (difference / size).sqrt()
        } else {
            difference.sqrt()
        });
    }
    worst
}

/// Lewis's model room (Lewis 1992, section 4) with 2^l by 2^l patches a wall: form factors between the patches'
/// centres by equation (5), rows normalised to 1.
///
/// Walls x=0, x=1, y=0, y=1, z=0, z=1; patch = wall m² + ia m + ib over the two free axes in ascending order.
pub(crate) struct LewisRoom {
    pub(crate) areas: Vec<f64>,
    pub(crate) rows: Vec<Vec<f64>>,
    /// The factors by which the rows were divided.
    pub(crate) alpha: Vec<f64>,
    pub(crate) reflectance: Block,
    pub(crate) exitance: Block,
    pub(crate) patches_per_wall: usize,
}

impl LewisRoom {
    pub(crate) fn new(l: u32) -> Self {
        let m = 1_usize << l;
        let (mut centres, mut axes) = (Vec::new(), Vec::new());
        for wall in 0..6 {
            let axis = wall / 2;
            for ia in 0..m {
                for ib in 0..m {
                    let middle = |k: usize| (k as f64 + 0.5) / m as f64;
                    let mut centre = [middle(ia), middle(ib), 0.0];
                    centre[axis..].rotate_right(1);
                    centre[axis] = (wall % 2) as f64;
                    centres.push(centre);
                    axes.push(axis);
                }
            }
        }
        let n = centres.len();
        let area = 1.0 / (m * m) as f64;
        let mut rows = Vec::with_capacity(n);
        let mut alpha = Vec::with_capacity(n);
        for i in 0..n {
            let kernel = |j: usize| {
                let d: [f64; 3] = std::array::from_fn(|k| centres[j][k] - centres[i][k]);
                let squared: f64 = d.iter().map(|x| x * x).sum();
                if i / (m * m) == j / (m * m) {
                    0.0
                } else {
                    area * d[axes[i]].abs() * d[axes[j]].abs() / (std::f64::consts::PI * squared * squared)
                }
            };
            let row: Vec<f64> = (0..n).map(kernel).collect();
            let sum: f64 = row.iter().sum();
            rows.push(row.iter().map(|f| f / sum).collect());
            alpha.push(sum);
        }
        let reflectance = (0..n).map(|i| [0.2, 0.6, 0.4, 0.8, 1.0, 1.0][i / (m * m)]).collect();
        let covered = |k: usize| {
            let (low, high) = (k as f64 / m as f64, (k + 1) as f64 / m as f64);
            (high.min(0.75) - low.max(0.25)).max(0.0) * m as f64
        };
        let emitted = |i: usize| {
            let on_wall = i % (m * m);
            if i / (m * m) == 5 {
                covered(on_wall / m) * covered(on_wall % m)
            } else {
                0.0
            }
        };
        Self {
            areas: vec![area; n],
            rows,
            alpha,
            reflectance: Block::from_values(reflectance, 1),
            exitance: Block::from_values((0..n).map(emitted).collect(), 1),
            patches_per_wall: m * m,
        }
    }

    pub(crate) fn form_factors(&self) -> FormFactors {
        matrix(&self.areas, &self.rows)
    }
}

/// The rows of a closed room as fractions of `n_rays` rays each, which hit patches with the probabilities F_ij.
pub(crate) fn shoot(probabilities: &[Vec<f64>], areas: &[f64], n_rays: u64, uniform: &mut Uniform) -> FormFactors {
    let mut tile = RowTile::new(0);
    for row in probabilities {
        let mut counts = vec![0_u32; row.len()];
        for _ in 0..n_rays {
            let mut left = uniform.next() * row.iter().sum::<f64>();
            let hit = row.iter().position(|p| {
                left -= p;
                left < 0.0
            });
            counts[hit.unwrap_or(row.len() - 1)] += 1;
        }
        let entry = |(j, &count): (u32, &u32)| {
            let p = f64::from(count) / n_rays as f64;
            (j, p, (p * (1.0 - p) / n_rays as f64).sqrt())
        };
        let entries: Vec<_> = (0..).zip(&counts).map(entry).collect();
        tile.push_row(
            &entries,
            RowTally {
                n_rays,
                ..RowTally::default()
            },
        );
    }
    FormFactors::from_tiles(areas.to_vec(), [tile], StorageChoice::default()).expect("a valid matrix")
}

pub(crate) fn storage(layout: Layout, precision: Precision) -> StorageChoice<'static> {
    StorageChoice {
        layout,
        precision,
        ..StorageChoice::default()
    }
}

/// A choice with its numbers in a scratch file. The little memory means that few rows wait to be written.
pub(crate) fn on_disk(choice: StorageChoice<'static>) -> StorageChoice<'static> {
    static DIRECTORY: LazyLock<PathBuf> = LazyLock::new(std::env::temp_dir);
    let place = Place::Disk(Scratch {
        directory: &DIRECTORY,
        memory_byte: 1 << 16,
    });
    StorageChoice { place, ..choice }
}

/// Every layout in both precisions, in memory and on a disk.
pub(crate) fn all_storages() -> impl Iterator<Item = StorageChoice<'static>> {
    let layouts = [Layout::Auto, Layout::Dense, Layout::Sparse];
    layouts.into_iter().flat_map(|layout| {
        [Precision::F32, Precision::F64].into_iter().flat_map(move |precision| {
            let in_memory = storage(layout, precision);
            [in_memory, on_disk(in_memory)]
        })
    })
}

/// Rows with a share `density` of entries that are not zero, values in [0, 1 / n].
pub(crate) fn random_rows(n: usize, density: f64, seed: u64) -> Vec<Vec<f64>> {
    let mut uniform = Uniform(seed);
    let mut entry = || {
        if uniform.next() < density {
            uniform.next() / n as f64
        } else {
            0.0
        }
    };
    (0..n).map(|_| (0..n).map(|_| entry()).collect()).collect()
}

pub(crate) fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}
