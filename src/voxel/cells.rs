//! Coarse and fine cells over the surface voxels: the leaves of an octree in which voxels of one surface share an unknown.

use glam::DVec3;
use rayon::prelude::*;

use super::discretize::VoxelScene;
use super::grid::{Voxel, to_u32};
use crate::scene::{MaterialId, Scene, SurfaceId};
use crate::threads;

/// The greatest level of a cell: 2⁶ voxels wide.
pub const MAX_CELL_LEVEL: u8 = 6;

/// The cosine of the angle between normals, about 25°, beyond which surfels do not share a cell.
const ALIKE: f64 = 0.9;

/// The greatest distance of a cell of side 1 from the plane of its first surfel, in voxels, and its growth with each voxel of the side.
///
/// The growth allows a bulge of an eighth.
const THICKNESS: (f64, f64) = (1.5, 0.125);

/// A partition of the surfels into cells: cubes of 2ˡ voxels a side, at multiples of their side.
///
/// The surfels of a cell are of one surface, one material, and one plane or nearly so, and no closed surface separates them.
///
/// Visibility is still decided on the voxels; a cell has one radiosity, and gathers light at one of its surfels, the one nearest to its middle.
/// Cells are numbered by their first surfels.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// Surfels by cell, ascending in each.
    members: Vec<u32>,
    /// The end of each cell in `members`.
    ends: Vec<u32>,
    levels: Vec<u8>,
    /// By surfel.
    cell_of: Vec<u32>,
    representatives: Vec<u32>,
    areas: Vec<f64>,
}

/// The properties that surfels of one cell share.
type Key = (Voxel, SurfaceId, MaterialId, Option<u32>);

impl Cells {
    /// Groups the surfels of each cube of 2^`level` voxels.
    ///
    /// # Panics
    /// If `level` is above [`MAX_CELL_LEVEL`], or `voxels` is not of `scene`.
    #[must_use]
    #[track_caller]
    pub fn new(voxels: &VoxelScene, scene: &Scene, level: u8) -> Self {
        assert!(
            level <= MAX_CELL_LEVEL,
            "cells of at most 2^{MAX_CELL_LEVEL} voxels a side"
        );
        let all: Vec<u32> = (0..to_u32(voxels.n_surfels())).collect();
        let cells = grouped(voxels, scene, &all, level);
        Self::from_lists(voxels, cells.into_iter().map(|cell| (level, cell)).collect())
    }

    /// Cuts every cell for which `is_cut` is true into those of the next lower level; cells of level 0 stay.
    ///
    /// # Panics
    /// If there is not one entry of `is_cut` for each cell.
    #[must_use]
    #[track_caller]
    pub fn refined(&self, voxels: &VoxelScene, scene: &Scene, is_cut: &[bool]) -> Self {
        assert_eq!(is_cut.len(), self.n_cells(), "one mark per cell");
        let parts = |cell: usize| -> Vec<(u8, Vec<u32>)> {
            let (level, members) = (self.levels[cell], self.members(cell));
            if is_cut[cell] && level > 0 {
                let parts = grouped(voxels, scene, members, level - 1);
                parts.into_iter().map(|part| (level - 1, part)).collect()
            } else {
                vec![(level, members.to_vec())]
            }
        };
        let lists = threads::collect_flat(self.n_cells(), parts);
        Self::from_lists(voxels, lists)
    }

    fn from_lists(voxels: &VoxelScene, mut lists: Vec<(u8, Vec<u32>)>) -> Self {
        lists.par_sort_unstable_by_key(|(_, members)| members[0]);
        let mut cells = Self {
            members: Vec::with_capacity(voxels.n_surfels()),
            ends: Vec::with_capacity(lists.len()),
            levels: Vec::with_capacity(lists.len()),
            cell_of: vec![0; voxels.n_surfels()],
            representatives: Vec::with_capacity(lists.len()),
            areas: Vec::with_capacity(lists.len()),
        };
        for (cell, (level, members)) in (0..).zip(&lists) {
            for &surfel in members {
                cells.cell_of[surfel as usize] = cell;
            }
            let area_of = |s: &u32| voxels.surfels[*s as usize].area;
            let area: f64 = members.iter().map(area_of).sum();
            let middle: DVec3 = members.iter().map(|s| area_of(s) * place(voxels, *s)).sum::<DVec3>() / area;
            let distance = |s: u32| place(voxels, s).distance_squared(middle);
            let nearest = members
                .iter()
                .copied()
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            cells.representatives.extend(nearest);
            cells.areas.push(area);
            cells.levels.push(*level);
            cells.members.extend(members);
            cells.ends.push(to_u32(cells.members.len()));
        }
        cells
    }

    /// Returns the number of cells: the unknowns.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.ends.len()
    }

    /// Returns the surfels of a cell, ascending.
    #[must_use]
    pub fn members(&self, cell: usize) -> &[u32] {
        let start = if cell == 0 { 0 } else { self.ends[cell - 1] };
        &self.members[start as usize..self.ends[cell] as usize]
    }

    /// Returns the cell of a surfel.
    #[must_use]
    pub fn cell_of(&self, surfel: usize) -> usize {
        self.cell_of[surfel] as usize
    }

    /// Returns the surfel at which a cell gathers light.
    #[must_use]
    pub fn representative(&self, cell: usize) -> usize {
        self.representatives[cell] as usize
    }

    /// Returns the level of a cell: it is 2ˡ voxels wide.
    #[must_use]
    pub fn level(&self, cell: usize) -> u8 {
        self.levels[cell]
    }

    /// Returns the areas of all cells, m².
    #[must_use]
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Returns the number of cells of each level, 0 first.
    #[must_use]
    pub fn n_by_level(&self) -> Vec<usize> {
        let top = self.levels.iter().copied().max().unwrap_or(0);
        let mut counts = vec![0; usize::from(top) + 1];
        for &level in &self.levels {
            counts[usize::from(level)] += 1;
        }
        counts
    }
}

/// Returns the position of a surfel, in voxels.
pub(super) fn place(voxels: &VoxelScene, surfel: u32) -> DVec3 {
    DVec3::from_array(voxels.surfels[surfel as usize].voxel().map(f64::from))
}

/// Sorts surfels into cells of a level.
fn grouped(voxels: &VoxelScene, scene: &Scene, surfels: &[u32], level: u8) -> Vec<Vec<u32>> {
    let key = |s: u32| -> Key {
        let surfel = &voxels.surfels[s as usize];
        let face = &scene.faces[surfel.face.0 as usize];
        let region = voxels
            .regions
            .as_ref()
            .and_then(|regions| regions.of_surfel(s as usize));
        (surfel.voxel().map(|c| c >> level), face.surface, face.material, region)
    };
    let mut keyed: Vec<(Key, u32)> = surfels.iter().map(|&s| (key(s), s)).collect();
    keyed.par_sort_unstable();
    let reach = THICKNESS.0 + THICKNESS.1 * f64::from(1_u32 << level);
    let mut cells = Vec::new();
    for same in keyed.chunk_by(|a, b| a.0 == b.0) {
        let first_cell = cells.len();
        for &(_, s) in same {
            let normal = voxels.normal(s as usize).unit;
            let fits = |cell: &&mut Vec<u32>| {
                let first = voxels.normal(cell[0] as usize).unit;
                let height = first.dot(place(voxels, s) - place(voxels, cell[0]));
                first.dot(normal) > ALIKE && height.abs() < reach
            };
            match cells[first_cell..].iter_mut().find(fits) {
                Some(cell) => cell.push(s),
                None => cells.push(vec![s]),
            }
        }
    }
    cells
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn cells_are_a_partition_at_every_level() {
        let scene = builtin::build("room-box", None).unwrap().scene;
        let voxels = VoxelScene::new(&scene, 30).unwrap();
        let mut cells = Cells::new(&voxels, &scene, 3);
        let total: f64 = voxels.areas().iter().sum();
        let mut sizes = vec![cells.n_cells()];
        for level in (0..3).rev() {
            // Every other cell, then the rest.
            let every_other: Vec<bool> = (0..cells.n_cells()).map(|k| k % 2 == 0).collect();
            let half = cells.refined(&voxels, &scene, &every_other);
            let rest: Vec<bool> = (0..half.n_cells()).map(|k| half.level(k) > level).collect();
            cells = half.refined(&voxels, &scene, &rest);
            sizes.push(cells.n_cells());
            // The rounding of a sum of some thousand terms.
            assert!((cells.areas().iter().sum::<f64>() / total - 1.0).abs() < 1e-12);
            for cell in 0..cells.n_cells() {
                assert_eq!(cells.level(cell), level);
                let members = cells.members(cell);
                assert!(members.is_sorted() && members.contains(&to_u32(cells.representative(cell))));
                let of = |member: u32| &scene.faces[voxels.surfels[member as usize].face.0 as usize];
                for &s in members {
                    assert_eq!(cells.cell_of(s as usize), cell);
                    assert_eq!(of(s).surface, of(members[0]).surface);
                    let cube = |member: u32| voxels.surfels[member as usize].voxel().map(|c| c >> level);
                    assert_eq!(cube(s), cube(members[0]));
                }
            }
        }
        assert!(sizes.is_sorted_by(|a, b| a < b), "{sizes:?}");
        assert_eq!(cells.n_cells(), voxels.n_surfels());
        assert_eq!(cells.n_by_level(), [voxels.n_surfels()]);
    }
}
