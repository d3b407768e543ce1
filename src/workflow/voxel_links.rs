//! The memory of voxels and their links, estimated before it is allocated.

use super::voxel::{VoxelLight, VoxelRequest};
use super::{Context, Model, WorkflowError};
use crate::plan::{VoxelDemand, byte_text, voxel_byte};
use crate::report::memory_used_byte;
use crate::voxel::{DiscreteSphere, Grid, VoxelScene};

/// Bytes of a patch of the display: its light, and the contributions of surfels.
const PATCH_BYTE: u64 = 512;

/// The place of links between passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkPlace {
    /// Memory if all fits within the limit, else disk.
    Auto {
        /// True if they are on disk in any case, because their file was named.
        has_file: bool,
    },
    /// Memory.
    Memory,
    /// A checksummed file; an interrupted study continues from it.
    Disk,
    /// None: every pass computes them again.
    Recompute,
}

/// The remedy where voxels do not fit the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum VoxelRemedy {
    /// Fewer voxels.
    FewerVoxels,
    /// Another place of links.
    OtherLinks,
    /// Fewer threads, or links that are not stored.
    FewerThreads,
}

/// Refuses a resolution whose voxels alone do not fit the memory.
pub(super) fn expect_voxels(model: &Model, request: &VoxelRequest, cx: &Context) -> Result<(), WorkflowError> {
    let grid = Grid::new(&model.scene, request.n_voxels)?;
    let needed = voxel_byte(&model.scene, &grid).saturating_add(memory_used_byte().unwrap_or(0));
    let limit = cx.memory.limit();
    if needed <= limit {
        return Ok(());
    }
    Err(WorkflowError::VoxelMemory {
        what: format!(
            "{} voxels along the longest axis need up to {}",
            request.n_voxels,
            byte_text(needed)
        ),
        limit,
        remedy: VoxelRemedy::FewerVoxels,
    })
}

/// Chooses the place of the links, and records it in the plan.
pub(super) fn choose(
    model: &mut Model,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    request: &VoxelRequest,
    cx: &Context,
) -> Result<LinkPlace, WorkflowError> {
    let is_adaptive = matches!(request.light, VoxelLight::Cells { .. });
    let demand = VoxelDemand {
        n_surfels: voxels.n_surfels(),
        n_directions: sphere.directions().len(),
        n_channels: model.plan.n_channels,
        n_threads: rayon::current_num_threads(),
        solved: matches!(request.light, VoxelLight::Solver { .. }),
        written: request.is_written,
    };
    let of_patches = PATCH_BYTE.saturating_mul(model.mesh.n_patches() as u64);
    let picture = cx
        .demand
        .image_byte
        .saturating_add(if request.is_shown { of_patches } else { 0 });
    let limit = cx.memory.limit();
    let beside = memory_used_byte()
        .unwrap_or(0)
        .saturating_add(demand.vector_byte())
        .saturating_add(picture);
    let with = |links: u64| beside.saturating_add(links);
    let (in_memory, on_disk) = (with(demand.link_byte()), with(demand.link_window_byte()));
    // Cells are cut while light is exchanged between them, so their links stay in memory.
    let asked = if is_adaptive { LinkPlace::Memory } else { request.links };
    let (kept, needed, reason) = match asked {
        LinkPlace::Auto { has_file: false } if in_memory <= limit => (LinkPlace::Memory, in_memory, "they fit"),
        LinkPlace::Auto { has_file: false } => (LinkPlace::Disk, on_disk, "they do not fit into memory"),
        LinkPlace::Memory if is_adaptive => (LinkPlace::Memory, in_memory, "those of cells, as they are cut"),
        LinkPlace::Memory => (LinkPlace::Memory, in_memory, "asked for"),
        LinkPlace::Disk | LinkPlace::Auto { has_file: true } => (LinkPlace::Disk, on_disk, "asked for"),
        LinkPlace::Recompute => (LinkPlace::Recompute, beside, "asked for"),
    };
    if needed > limit {
        let remedy = match kept {
            LinkPlace::Memory if !is_adaptive => VoxelRemedy::OtherLinks,
            LinkPlace::Disk if beside <= limit => VoxelRemedy::FewerThreads,
            _ => VoxelRemedy::FewerVoxels,
        };
        let what = format!("{} surfels need {}", demand.n_surfels, byte_text(needed));
        return Err(WorkflowError::VoxelMemory { what, limit, remedy });
    }
    let choice = match kept {
        LinkPlace::Memory | LinkPlace::Auto { .. } => "memory",
        LinkPlace::Disk => "disk",
        LinkPlace::Recompute => "recompute",
    };
    let size = format!(
        "at most {}, {reason}; with all else {} of {}",
        byte_text(demand.link_byte()),
        byte_text(needed),
        byte_text(limit)
    );
    model.plan.decide("links", choice, size);
    Ok(kept)
}
