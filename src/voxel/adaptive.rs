//! Coarse and fine voxels together: cells that are cut where the light changes.

use glam::DVec3;

use super::cell_operator::{CellLinks, CellOperator};
use super::cells::{Cells, place};
use super::discretize::VoxelScene;
use super::operator::LeakPower;
use super::radiosity::{Form, propagate};
use super::sphere::DiscreteSphere;
use super::weights::RowWeights;
use crate::matrix::operator::Block;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::threads;

/// The cosine of normals of neighbouring surfels below which they meet at an edge, about 45°.
const ALIKE: f64 = 0.7;

/// The settings of the search for cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveSettings {
    /// The level of the largest cells: 2ˡ voxels wide, l at most [`MAX_CELL_LEVEL`](super::MAX_CELL_LEVEL).
    pub coarsest: u8,
    /// The greatest change of the irradiance from a cell to its neighbour on the same surface, as a share of the scene's mean, beyond which a cell is cut.
    pub tolerance: f64,
    /// Propagations for each set of cells.
    pub n_passes: usize,
    /// Whether rows are normalised.
    pub row_weights: RowWeights,
}

/// Radiosities of all surfels, found by way of cells.
#[derive(Clone, Debug)]
pub struct Adaptive {
    /// The last cells.
    pub cells: Cells,
    /// B, W·m⁻², \[`n_surfels`, c\].
    pub radiosity: Block,
    /// H, W·m⁻², \[`n_surfels`, c\].
    pub irradiance: Block,
    /// The number of cells before each round of cuts, and the last.
    pub n_cells: Vec<usize>,
    /// Links that were found, over all rounds.
    pub n_links: u64,
    /// The number of those links that end at a back face.
    pub n_backs: u64,
    /// The number of those links that leave the scene.
    pub n_escaped: u64,
    /// The memory of the links.
    pub link_byte: u64,
    /// See [`LinkOperator::leak_power`](super::LinkOperator::leak_power).
    pub leak_power: LeakPower,
    /// The changes of the last propagations; see [`Propagation::changes`](super::Propagation::changes).
    pub changes: Vec<f64>,
}

/// Solves the discrete equation on cells as fine as the changes of light require.
///
/// Cells begin 2^`coarsest` voxels wide, those at edges and beside emitters half as wide. Light is propagated on them. Then every cell is cut into those of the next lower level whose irradiance differs by more than the
/// tolerance from that of a neighbour on the same surface, in any channel, or whose surfels send too differently, until no such cell is wider than a voxel. Known links are used again.
/// Occlusion is that of the voxels throughout, so that a coarse cell sees fine objects and their shadows. It misses a shadow inside one coarse cell,
/// away from the surfel at which it gathers. At the end the irradiance is interpolated between cells, and B = E + ρ H on every surfel with its own material.
///
/// Work: links in proportion to the cells, not to the voxels. Equal arguments give equal bytes at any number of threads.
/// `reflectance`: ρ, `exitance`: E, W·m⁻², \[`n_surfels`, c\].
///
/// Source: the hierarchy that [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002) names as the next step, section 2.3 and conclusion; the paper gives no method.
///
/// # Panics
/// If the blocks differ in shape or have not one row per surfel, or `coarsest` is too large.
#[must_use]
#[track_caller]
pub fn solve_adaptively(
    scene: &Scene,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    reflectance: &Block,
    exitance: &Block,
    settings: &AdaptiveSettings,
    progress: &dyn Progress,
) -> Adaptive {
    assert!(
        reflectance.n_rows() == voxels.n_surfels() && exitance.n_rows() == voxels.n_surfels(),
        "one row per surfel"
    );
    let mut cells = Cells::new(voxels, scene, settings.coarsest);
    cells = cells.refined(voxels, scene, &at_edges(voxels, scene, &cells));
    let mut links = CellLinks::new(voxels, sphere);
    let mut n_cells = Vec::new();
    loop {
        n_cells.push(cells.n_cells());
        links.find(voxels, &cells, progress);
        let (rho, e) = (of_cells(&cells, reflectance), means_of_cells(&cells, exitance));
        let operator = CellOperator::new(voxels, sphere, &cells, &links, settings.row_weights);
        let solved = propagate(&operator, &rho, &e, Form::InPlace, settings.n_passes, progress);
        let neighbours = neighbours(voxels, scene, &cells);
        let limits = limits(&cells, &solved.irradiance, settings.tolerance);
        let is_cut = |cell: usize| {
            let here = solved.irradiance.row(cell);
            let changes = |&other: &u32| {
                let there = solved.irradiance.row(other as usize);
                here.iter()
                    .zip(there)
                    .zip(&limits)
                    .any(|((a, b), limit)| (a - b).abs() > *limit)
            };
            cells.level(cell) > 0
                && (is_uneven(&cells, cell, exitance, settings.tolerance) || neighbours[cell].iter().any(changes))
        };
        let marks: Vec<bool> = (0..cells.n_cells()).map(is_cut).collect();
        if marks.contains(&true) && !progress.is_cancelled() {
            cells = cells.refined(voxels, scene, &marks);
            continue;
        }
        let irradiance = onto_surfels(voxels, &cells, &neighbours, &solved.irradiance);
        let mut radiosity = exitance.clone();
        let terms = reflectance.values().iter().zip(irradiance.values());
        for (b, (r, h)) in radiosity.values_mut().iter_mut().zip(terms) {
            *b += r * h;
        }
        return Adaptive {
            radiosity,
            irradiance,
            n_cells,
            n_links: links.tally.n_links,
            n_backs: links.tally.n_backs,
            n_escaped: links.tally.n_escaped,
            link_byte: links.n_bytes(),
            leak_power: operator.leak_power(&solved.radiosity),
            changes: solved.changes,
            cells,
        };
    }
}

/// Returns for each channel the tolerated change: `tolerance` times the mean irradiance of the scene.
fn limits(cells: &Cells, irradiance: &Block, tolerance: f64) -> Vec<f64> {
    let total: f64 = cells.areas().iter().sum();
    let mut means = vec![0.0; irradiance.n_channels()];
    for (cell, area) in cells.areas().iter().enumerate() {
        for (mean, h) in means.iter_mut().zip(irradiance.row(cell)) {
            *mean += area * h / total;
        }
    }
    means.into_iter().map(|mean| tolerance * mean).collect()
}

/// Returns the values of the cells' representatives, as a cell has one material.
fn of_cells(cells: &Cells, values: &Block) -> Block {
    let rows = (0..cells.n_cells()).flat_map(|cell| values.row(cells.representative(cell)).iter().copied());
    Block::from_values(rows.collect(), values.n_channels())
}

/// Returns the means of values over the cells. The light that is sent differs within one material, as faces fill their voxels differently.
fn means_of_cells(cells: &Cells, values: &Block) -> Block {
    let mean = |cell: usize| {
        let members = cells.members(cell);
        let mut means = vec![0.0; values.n_channels()];
        for &member in members {
            for (mean, value) in means.iter_mut().zip(values.row(member as usize)) {
                *mean += value / members.len() as f64;
            }
        }
        means
    };
    Block::from_values((0..cells.n_cells()).flat_map(mean).collect(), values.n_channels())
}

/// Returns whether the light that the surfels of a cell send differs by more than `tolerance` times the most of one of them, in any channel.
fn is_uneven(cells: &Cells, cell: usize, exitance: &Block, tolerance: f64) -> bool {
    (0..exitance.n_channels()).any(|c| {
        let sent = cells
            .members(cell)
            .iter()
            .map(|&member| exitance.row(member as usize)[c]);
        let (low, high) = sent.fold((f64::INFINITY, 0.0_f64), |(low, high), e| (low.min(e), high.max(e)));
        high - low > tolerance * high
    })
}

/// Calls `work` with all other surfels in the 26 voxels around a surfel and in its own.
fn each_around(voxels: &VoxelScene, surfel: usize, mut work: impl FnMut(usize)) {
    voxels.each_rank_around(voxels.surfels[surfel].voxel(), |rank| {
        voxels.surfels_of(rank).filter(|&s| s != surfel).for_each(&mut work);
    });
}

/// Returns for each cell whether it touches another surface, another material (so all emitters' borders) or an edge.
fn at_edges(voxels: &VoxelScene, scene: &Scene, cells: &Cells) -> Vec<bool> {
    let key = |s: usize| {
        let face = &scene.faces[voxels.surfels[s].face.0 as usize];
        (face.surface, face.material)
    };
    let is_marked = |cell: usize| {
        cells.members(cell).iter().any(|&member| {
            let s = member as usize;
            let mut found = false;
            each_around(voxels, s, |t| {
                found |= key(t) != key(s) || voxels.normal(t).unit.dot(voxels.normal(s).unit) < ALIKE;
            });
            found
        })
    };
    threads::collect(cells.n_cells(), is_marked)
}

/// Returns for each cell the cells that touch it on the same surface, ascending.
fn neighbours(voxels: &VoxelScene, scene: &Scene, cells: &Cells) -> Vec<Vec<u32>> {
    let surface = |s: usize| scene.faces[voxels.surfels[s].face.0 as usize].surface;
    let of_cell = |cell: usize| {
        let mut found: Vec<u32> = Vec::new();
        for &member in cells.members(cell) {
            let s = member as usize;
            each_around(voxels, s, |t| {
                let other = cells.cell_of(t);
                let alike = voxels.normal(t).unit.dot(voxels.normal(s).unit) > ALIKE;
                if other != cell && alike && surface(t) == surface(s) && !voxels.are_parted(s, t) {
                    found.push(u32::try_from(other).expect("fewer cells than surfels"));
                }
            });
        }
        found.sort_unstable();
        found.dedup();
        found
    };
    threads::collect(cells.n_cells(), of_cell)
}

/// Interpolates values of cells at all surfels.
///
/// The mean over the cell and its neighbours, weighted by a product of hat functions as wide as the wider of the two cells: bilinear between equal cells of a flat surface.
/// A constant stays that constant. Cells of one voxel keep their own value.
fn onto_surfels(voxels: &VoxelScene, cells: &Cells, neighbours: &[Vec<u32>], values: &Block) -> Block {
    let n_channels = values.n_channels();
    let of_surfel = |surfel: usize| {
        let s = u32::try_from(surfel).expect("surfels are counted in 32 bits");
        let own = cells.cell_of(surfel);
        let mut sums = vec![0.0; n_channels];
        if cells.level(own) == 0 {
            sums.copy_from_slice(values.row(own));
            return sums;
        }
        let mut total = 0.0;
        let at = place(voxels, s);
        let side = |cell: usize| f64::from(1_u32 << cells.level(cell));
        for cell in std::iter::once(own).chain(neighbours[own].iter().map(|&c| c as usize)) {
            let representative = u32::try_from(cells.representative(cell)).expect("surfels are counted in 32 bits");
            let distance = (at - place(voxels, representative)).abs() / side(cell).max(side(own));
            let weight = (DVec3::ONE - distance)
                .max(DVec3::ZERO)
                .to_array()
                .iter()
                .product::<f64>();
            total += weight;
            for (sum, value) in sums.iter_mut().zip(values.row(cell)) {
                *sum += weight * value;
            }
        }
        if total > 0.0 {
            for sum in &mut sums {
                *sum /= total;
            }
        } else {
            sums.copy_from_slice(values.row(own));
        }
        sums
    };
    let rows = threads::collect_flat(voxels.n_surfels(), of_surfel);
    Block::from_values(rows, n_channels)
}
