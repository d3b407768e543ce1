//! The model problem: a room with walls of 2^l × 2^l patches.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::f64::consts::PI;

use crate::experiment::ExperimentError;
use crate::matrix::operator::Block;
use crate::matrix::{Entry, FormFactors, Layout, Precision, RowTally, RowTile, StorageChoice};
use crate::mesh::Hierarchy;
use crate::mesh::hierarchy::FaceShape;
use crate::threads;

/// The reflectances ρ of the walls x = 0, x = 1, y = 0, y = 1, z = 0, z = 1.
const REFLECTANCE: [f64; 6] = [0.2, 0.6, 0.4, 0.8, 1.0, 1.0];

/// The number of rows that are made at a time.
const ROWS_PER_TILE: usize = 64;

/// The patches of the room at a level, without their form factors.
///
/// Patch = wall m² + ia m + ib with m = 2^l, (a, b) the two free axes in ascending order. The hole \[1/4, 3/4\]² of the ceiling emits 1 W·m⁻², a patch
/// the mean over itself (0.25 at l = 0 and 1).
/// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), section 4. Departures: mean, not the integral of section 3; the hole reflects as the ceiling does.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// The level l.
    pub level: u32,
}

impl Room {
    /// Returns m, the number of patches along each edge of a wall.
    #[must_use]
    pub fn per_edge(self) -> usize {
        1 << self.level
    }

    /// Returns N = 6 · 4^l, the number of patches.
    #[must_use]
    pub fn n_patches(self) -> usize {
        6 * self.per_edge() * self.per_edge()
    }

    /// Returns the areas A, m², \[N\].
    #[must_use]
    pub fn areas(self) -> Vec<f64> {
        vec![self.area(); self.n_patches()]
    }

    fn area(self) -> f64 {
        ((self.per_edge() * self.per_edge()) as f64).recip()
    }

    /// Returns the reflectances ρ, \[N, 1\].
    #[must_use]
    pub fn reflectance(self) -> Block {
        let rho = |i: usize| REFLECTANCE[i / (self.per_edge() * self.per_edge())];
        Block::from_values((0..self.n_patches()).map(rho).collect(), 1)
    }

    /// Returns the exitances E, W·m⁻², \[N, 1\].
    #[must_use]
    pub fn exitance(self) -> Block {
        let m = self.per_edge();
        let covered = |k: usize| {
            let (low, high) = (k as f64 / m as f64, (k + 1) as f64 / m as f64);
            (high.min(0.75) - low.max(0.25)).max(0.0) * m as f64
        };
        let emitted = |i: usize| {
            let (wall, on_wall) = (i / (m * m), i % (m * m));
            if wall == 5 {
                covered(on_wall / m) * covered(on_wall % m)
            } else {
                0.0
            }
        };
        Block::from_values((0..self.n_patches()).map(emitted).collect(), 1)
    }

    /// Returns the levels l, l − 1, ..., 0.
    ///
    /// # Panics
    /// If there are 2³² patches along an edge or more; no memory holds their form factors.
    #[must_use]
    pub fn hierarchy(self) -> Hierarchy {
        let m = u32::try_from(self.per_edge()).expect("a level below 32");
        Hierarchy::of_faces(&[FaceShape::Quad { n_u: m, n_v: m }; 6], &self.areas())
    }

    /// Returns the centre of a patch.
    pub(super) fn centre(self, i: usize) -> [f64; 3] {
        let m = self.per_edge();
        let (wall, on_wall) = (i / (m * m), i % (m * m));
        let middle = |k: usize| (k as f64 + 0.5) / m as f64;
        let mut centre = [middle(on_wall / m), middle(on_wall % m), 0.0];
        let axis = wall / 2;
        centre[axis..].rotate_right(1);
        centre[axis] = (wall % 2) as f64;
        centre
    }

    /// Returns α F_ij of equation (5): A_j cos θ_i cos θ_j / (π r²) between the centres; `j_room` is the room at the level of j.
    pub(super) fn kernel(self, i: usize, j_room: Self, j: usize) -> f64 {
        let wall = |room: Self, k: usize| k / (room.per_edge() * room.per_edge());
        let (wall_i, wall_j) = (wall(self, i), wall(j_room, j));
        if wall_i == wall_j {
            return 0.0;
        }
        kernel(
            &self.centre(i),
            wall_i / 2,
            &j_room.centre(j),
            wall_j / 2,
            j_room.area(),
        )
    }

    /// Returns F by equation (5), each row divided by α, its sum.
    ///
    /// # Errors
    /// [`ExperimentError::Matrix`] if it cannot be stored.
    pub fn form_factors(self, precision: Precision) -> Result<FormFactors, ExperimentError> {
        self.rows(precision, true)
    }

    /// Returns F, with rows divided by their sums or not.
    pub(super) fn rows(self, precision: Precision, normalise: bool) -> Result<FormFactors, ExperimentError> {
        let n = self.n_patches();
        let (area, per_wall) = (self.area(), self.per_edge() * self.per_edge());
        let centres: Vec<[f64; 3]> = (0..n).map(|i| self.centre(i)).collect();
        let row = |i: usize| -> Vec<Entry> {
            let value = |j: usize| {
                if i / per_wall == j / per_wall {
                    0.0
                } else {
                    kernel(&centres[i], i / per_wall / 2, &centres[j], j / per_wall / 2, area)
                }
            };
            let values: Vec<f64> = (0..n).map(value).collect();
            let alpha: f64 = if normalise { values.iter().sum() } else { 1.0 };
            let entries = (0..).zip(values).filter(|(_, value)| *value > 0.0);
            entries.map(|(j, value)| (j, value / alpha, 0.0)).collect()
        };
        let tile = |first: usize| {
            let rows: Vec<Vec<Entry>> = threads::collect(ROWS_PER_TILE.min(n - first), |k| row(first + k));
            let mut tile = RowTile::new(first);
            for entries in &rows {
                tile.push_row(entries, RowTally::default());
            }
            tile
        };
        let storage = StorageChoice {
            layout: Layout::Dense,
            precision,
            ..StorageChoice::default()
        };
        let tiles = (0..n).step_by(ROWS_PER_TILE).map(tile);
        Ok(FormFactors::from_tiles(self.areas(), tiles, storage)?)
    }

    /// Returns the means of a vector over the walls x = 0, x = 1, y = 0, y = 1, z = 0, z = 1.
    #[must_use]
    pub fn wall_means(self, values: &[f64]) -> Vec<f64> {
        let walls = values.chunks(self.per_edge() * self.per_edge());
        walls.map(|wall| wall.iter().sum::<f64>() / wall.len() as f64).collect()
    }
}

fn kernel(x: &[f64; 3], axis_x: usize, y: &[f64; 3], axis_y: usize, area: f64) -> f64 {
    let d: [f64; 3] = std::array::from_fn(|k| y[k] - x[k]);
    let squared: f64 = d.iter().map(|d| d * d).sum();
    area * d[axis_x].abs() * d[axis_y].abs() / (PI * squared * squared)
}
