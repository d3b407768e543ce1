//! The JSON documents about voxels.

use serde::Serialize;

use super::VoxelSurface;
use crate::scene::{Scene, SurfaceId};
use crate::solver::{ChoiceReason, HistoryEntry, StopReason};
use crate::voxel::Form;
use crate::workflow::{VoxelLight, VoxelRequest, VoxelResult, VoxelStudy};

/// The result of `voxel`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct VoxelDocument {
    /// Voxels that are surface.
    pub n_voxels: usize,
    /// Unknowns: a surfel for each surface in each voxel.
    pub n_surfels: usize,
    /// Voxels of the lattice along x, y and z.
    pub lattice: [i32; 3],
    /// The edge of a voxel, m.
    pub voxel_size_m: f64,
    /// Directions of the discrete sphere.
    pub n_directions: usize,
    /// Links.
    pub n_links: u64,
    /// Links that leave the scene; null where they were not counted.
    pub n_escaped: Option<u64>,
    /// Links that end at the back of a face; null where they were not counted.
    pub n_backs: Option<u64>,
    /// The size of the links, in bytes, in memory or on a disk.
    pub link_bytes: u64,
    /// The memory of the octree, in bytes.
    pub octree_bytes: usize,
    /// The memory of the surfels, in bytes.
    pub surfel_bytes: usize,
    /// Surfels of a closed scene that can be reached from outside.
    pub n_leaks: usize,
    /// The Hausdorff distance from the scene, in voxels; null where it is not known.
    pub hausdorff_distance_voxel: Option<f64>,
    /// Surfaces smaller than two voxels.
    pub n_small_surfaces: usize,
    /// Gaps narrower than two voxels.
    pub thin_gaps: Vec<GapRecord>,
    /// How many walls are thinner than two voxels.
    pub n_thin_walls: usize,
    /// The thickness of the thinnest of them, m.
    pub thin_wall_min_m: Option<f64>,
    /// These walls, the thinnest first.
    pub thin_walls: Vec<WallRecord>,
    /// Light that passes closed surfaces, W, in the channel where it is the greatest share.
    pub leak_power_w: f64,
    /// The part of what is emitted in that channel that it is.
    pub leak_share: f64,
    /// Light that is lost in a closed scene, at the backs and openings that voxels make, W, in the channel where it is the greatest share.
    pub lost_power_w: f64,
    /// The part of what is emitted in that channel that it is.
    pub lost_share: f64,
    /// The surfaces, in file order.
    pub surfaces: Vec<VoxelSurface>,
    /// How light was found.
    #[serde(flatten)]
    pub light: VoxelLightRecord,
    /// The file that was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<String>,
}

/// A gap narrower than two voxels.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct GapRecord {
    /// The surfaces on both sides.
    pub surfaces: [String; 2],
    /// Surfels that look into it.
    pub n_surfels: usize,
}

/// A wall thinner than two voxels.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct WallRecord {
    /// The surfaces of both sides.
    pub surfaces: [String; 2],
    /// The least distance between its sides, m.
    pub thickness_m: f64,
    /// Surfels that have the other side beside or behind them.
    pub n_surfels: usize,
}

/// How light was found on voxels.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum VoxelLightRecord {
    /// By propagations between cells.
    Cells {
        /// Propagations on each set of cells.
        n_passes: usize,
        /// The change of the radiosity in each propagation on the last cells, relative.
        changes: Vec<f64>,
        /// How many cells there are at last.
        n_cells: Option<usize>,
        /// These by their level: 2^level voxels wide.
        n_cells_by_level: Vec<usize>,
        /// Cells in each round of cuts.
        n_cells_by_round: Vec<usize>,
    },
    /// By propagations between voxels.
    Propagations {
        /// The input of each propagation.
        form: Form,
        /// How many there are.
        n_passes: usize,
        /// The change of the radiosity in each, relative.
        changes: Vec<f64>,
    },
    /// By a solver.
    Solver {
        /// The solver: the one that was asked for, or that `auto` chose.
        solver: String,
        /// Why `auto` chose it.
        #[cfg_attr(test, schemars(with = "Option<String>"))]
        why: Option<ChoiceReason>,
        /// Why it stopped.
        stop_reason: StopReason,
        /// Passes over the links.
        n_passes: usize,
        /// sqrt(Σ A r² / Σ A E²), the worst channel.
        #[cfg_attr(test, schemars(with = "Option<f64>"))]
        residual_l2: f64,
        /// max |r_i A_i|, W.
        #[cfg_attr(test, schemars(with = "Option<f64>"))]
        residual_max_power: f64,
        /// A bound on the relative error that the solver leaves in B, in the area-weighted L2 norm; null where none is proved.
        error_bound: Option<f64>,
        /// The state after each pass; 0 is the start.
        history: Vec<HistoryEntry>,
    },
}

impl VoxelDocument {
    /// Returns the document of a study for a `request`.
    #[must_use]
    pub fn new(scene: &Scene, request: &VoxelRequest, study: &VoxelStudy, output: Option<String>) -> Self {
        let VoxelStudy { voxels, links, .. } = study;
        let names = |ids: [SurfaceId; 2]| ids.map(|id| scene.surfaces[id.0 as usize].name.clone());
        let thin_gaps = study.gaps.iter().map(|gap| GapRecord {
            surfaces: names(gap.surfaces),
            n_surfels: gap.n_surfels,
        });
        let thin_walls = voxels.thin_walls.iter().map(|wall| WallRecord {
            surfaces: names(wall.surfaces),
            thickness_m: wall.thickness,
            n_surfels: wall.n_surfels,
        });
        let means = voxels.surface_means(scene, &study.radiosity);
        Self {
            n_voxels: voxels.octree.n_voxels(),
            n_surfels: voxels.n_surfels(),
            lattice: voxels.grid.n_voxels,
            voxel_size_m: voxels.grid.voxel_size,
            n_directions: study.sphere.directions().len(),
            n_links: links.n_links,
            n_escaped: links.n_escaped,
            n_backs: links.n_backs,
            link_bytes: links.n_bytes,
            octree_bytes: voxels.octree.n_bytes(),
            surfel_bytes: voxels.n_bytes() - voxels.octree.n_bytes(),
            n_leaks: study.reached.len(),
            hausdorff_distance_voxel: study.hausdorff,
            n_small_surfaces: study.small.len(),
            thin_gaps: thin_gaps.collect(),
            n_thin_walls: voxels.thin_walls.len(),
            thin_wall_min_m: voxels.thin_walls.first().map(|wall| wall.thickness),
            thin_walls: thin_walls.collect(),
            leak_power_w: study.leak.power,
            leak_share: study.leak.share,
            lost_power_w: study.leak.lost_power,
            lost_share: study.leak.lost_share,
            surfaces: VoxelSurface::of(scene, means),
            light: VoxelLightRecord::new(&request.light, &study.result),
            output,
        }
    }
}

impl VoxelLightRecord {
    fn new(asked: &VoxelLight, result: &VoxelResult) -> Self {
        let (n_passes, form, solver) = match asked {
            VoxelLight::Propagations { passes, form } => (*passes, *form, ""),
            VoxelLight::Cells { passes, .. } => (*passes, Form::default(), ""),
            VoxelLight::Solver { name, .. } => (0, Form::default(), name.as_str()),
        };
        match result {
            VoxelResult::Propagations(changes) => Self::Propagations {
                form,
                n_passes,
                changes: changes.clone(),
            },
            VoxelResult::Cells {
                changes,
                n_by_level,
                n_by_round,
            } => Self::Cells {
                n_passes,
                changes: changes.clone(),
                n_cells: n_by_round.last().copied(),
                n_cells_by_level: n_by_level.clone(),
                n_cells_by_round: n_by_round.clone(),
            },
            VoxelResult::Solver(solution) => Self::Solver {
                solver: solution.solver_name(solver).to_owned(),
                why: solution.choice.as_ref().map(|choice| choice.why),
                stop_reason: solution.stop_reason,
                n_passes: solution.n_passes,
                residual_l2: solution.residual_l2,
                residual_max_power: solution.residual_max_power,
                error_bound: solution.error_bound,
                history: solution.history.clone(),
            },
        }
    }
}
