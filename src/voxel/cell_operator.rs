//! The discrete equation with cells as unknowns.

use super::cells::Cells;
use super::discretize::VoxelScene;
use super::line::Direction;
use super::links::{Row, Tally, for_each_seen, prepared};
use super::operator::{Gather, LeakPower, add_leak, gather_row};
use super::sphere::DiscreteSphere;
use super::weights::{RowWeights, Weights};
use crate::matrix::operator::{Block, LinearOperator, RowAccess};
use crate::progress::Progress;
use crate::threads;

/// Rows that are one unit of work.
const ROWS: usize = 64;

/// The links of those surfels at which cells gather light; known links are kept when cells are cut.
#[derive(Debug)]
pub(super) struct CellLinks {
    directions: Vec<Direction>,
    /// By surfel; empty for surfels without known links.
    rows: Vec<Box<[u8]>>,
    pub(super) tally: Tally,
}

impl CellLinks {
    pub(super) fn new(voxels: &VoxelScene, sphere: &DiscreteSphere) -> Self {
        Self {
            directions: prepared(sphere),
            rows: vec![Box::default(); voxels.n_surfels()],
            tally: Tally::default(),
        }
    }

    /// Finds the links of all cells without known ones.
    pub(super) fn find(&mut self, voxels: &VoxelScene, cells: &Cells, progress: &dyn Progress) {
        let missing: Vec<usize> = (0..cells.n_cells())
            .map(|cell| cells.representative(cell))
            .filter(|&surfel| self.rows[surfel].is_empty())
            .collect();
        progress.begin("links", missing.len() as u64);
        let found: Vec<(Box<[u8]>, Tally)> = threads::collect_flat(missing.len(), |k| {
            let rows = Row::of(voxels, &self.directions, missing[k]..missing[k] + 1);
            progress.advance(1);
            rows.into_iter().map(|row| (row.bytes.into_boxed_slice(), row.tally))
        });
        for (surfel, (bytes, tally)) in missing.into_iter().zip(found) {
            self.rows[surfel] = bytes;
            self.tally = self.tally.plus(tally);
        }
    }

    pub(super) fn n_bytes(&self) -> u64 {
        let packed: usize = self.rows.iter().map(|row| row.len()).sum();
        (packed + self.rows.len() * size_of::<Box<[u8]>>()) as u64
    }
}

/// F of the discrete equation, one row and column for each cell.
pub(super) struct CellOperator<'a> {
    voxels: &'a VoxelScene,
    cells: &'a Cells,
    links: &'a CellLinks,
    weights: Weights<'a>,
}

impl<'a> CellOperator<'a> {
    pub(super) fn new(
        voxels: &'a VoxelScene,
        sphere: &'a DiscreteSphere,
        cells: &'a Cells,
        links: &'a CellLinks,
        row_weights: RowWeights,
    ) -> Self {
        Self {
            cells,
            links,
            voxels,
            weights: Weights::new(voxels, sphere, row_weights),
        }
    }

    /// Returns the power that links carry where none goes, W.
    ///
    /// It is that of [`LinkOperator::leak_power`](super::LinkOperator::leak_power), of cells.
    pub(super) fn leak_power(&self, radiosity: &Block) -> LeakPower {
        let n_channels = radiosity.n_channels();
        let n = if self.voxels.may_leak() {
            self.cells.n_cells()
        } else {
            0
        };
        let of_cell = |cell: usize| {
            let mut power = LeakPower::new(n_channels, 0.0);
            let surfel = self.cells.representative(cell);
            let (area, row) = (self.cells.areas()[cell], &self.links.rows[surfel]);
            let of_seen = |seen: usize| radiosity.row(self.cells.cell_of(seen));
            add_leak(self.voxels, &self.weights, surfel, row, area, of_seen, &mut power);
            power
        };
        LeakPower::sum(&threads::collect(n, of_cell), n_channels)
    }
}

impl LinearOperator for CellOperator<'_> {
    fn n_rows(&self) -> usize {
        self.cells.n_cells()
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        self.gather(0, x, y.values_mut());
    }

    fn rows(&self) -> Option<&dyn RowAccess> {
        Some(self)
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        None
    }
}

impl Gather for CellOperator<'_> {
    fn gather(&self, first: usize, x: &Block, sums: &mut [f64]) {
        let n_channels = x.n_channels();
        threads::for_each_chunk(true, sums, ROWS * n_channels, |k, rows| {
            for (cell, row) in (first + k * ROWS..).zip(rows.chunks_mut(n_channels)) {
                let surfel = self.cells.representative(cell);
                row.fill(0.0);
                let unknown = |seen: usize| self.cells.cell_of(seen);
                gather_row(&self.weights, surfel, &self.links.rows[surfel], unknown, x, row);
            }
        });
    }

    fn areas(&self) -> Vec<f64> {
        self.cells.areas().to_vec()
    }

    fn rows_at_once(&self) -> usize {
        ROWS
    }
}

impl RowAccess for CellOperator<'_> {
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let surfel = self.cells.representative(i);
        let row = &self.links.rows[surfel];
        gather_row(&self.weights, surfel, row, |seen| self.cells.cell_of(seen), x, sum);
        let mut own = 0.0;
        self.weights.with(surfel, |weights| {
            for_each_seen(row, surfel, |k, seen| {
                if self.cells.cell_of(seen) == i {
                    own += weights[k];
                }
            });
        });
        for (s, value) in sum.iter_mut().zip(x.row(i)) {
            *s -= own * value;
        }
        own
    }

    fn visit_row(&self, i: usize, visit: &mut dyn FnMut(usize, f64)) {
        let surfel = self.cells.representative(i);
        let mut entries: Vec<(usize, f64)> = Vec::new();
        self.weights.with(surfel, |weights| {
            let row = &self.links.rows[surfel];
            for_each_seen(row, surfel, |k, seen| {
                entries.push((self.cells.cell_of(seen), weights[k]));
            });
        });
        entries.sort_by_key(|entry| entry.0);
        for same in entries.chunk_by(|a, b| a.0 == b.0) {
            visit(same[0].0, same.iter().map(|entry| entry.1).sum());
        }
    }
}
