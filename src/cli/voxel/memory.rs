//! What a voxel run takes, told before it is taken.

use super::super::args::{LinksName, VoxelArgs};
use super::super::failure::Failure;
use super::super::picture::image_byte;
use super::super::render;
use super::{Format, render_settings};
use crate::plan::{VoxelDemand, byte_text, voxel_byte};
use crate::report::memory_used_byte;
use crate::voxel::{DiscreteSphere, Grid, VoxelScene};
use crate::workflow::{Memory, Model};

/// Bytes of a patch of the display: its light, and what the surfels give to it.
const PATCH_BYTE: u64 = 512;

/// Refuses a resolution whose voxels alone do not fit the memory.
pub(super) fn expect_voxels(model: &Model, args: &VoxelArgs, memory: &Memory) -> Result<(), Failure> {
    let grid = Grid::new(&model.scene, args.voxels)?;
    let needed = voxel_byte(&model.scene, &grid).saturating_add(memory_used_byte().unwrap_or(0));
    let limit = memory.limit();
    if needed <= limit {
        return Ok(());
    }
    Err(too_small(
        &format!(
            "{} voxels along the longest axis need up to {}",
            args.voxels,
            byte_text(needed)
        ),
        limit,
        "use fewer --voxels, or raise --memory-limit",
    ))
}

/// Decides where the links go, and notes it in the plan.
pub(super) fn choose_links(
    model: &mut Model,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    args: &VoxelArgs,
    format: Option<Format>,
    memory: &Memory,
) -> Result<LinksName, Failure> {
    let demand = VoxelDemand {
        n_surfels: voxels.n_surfels(),
        n_directions: sphere.directions().len(),
        n_channels: model.plan.n_channels,
        n_threads: rayon::current_num_threads(),
        solved: args.solver.is_some(),
        written: format == Some(Format::Vtu),
    };
    let picture = if format == Some(Format::Image) {
        let view = render::view(&args.image.view, &args.scene, &model.scene)?;
        let settings = render_settings(args);
        image_byte(&view, &settings, memory)?.saturating_add(PATCH_BYTE.saturating_mul(model.mesh.n_patches() as u64))
    } else {
        0
    };
    let limit = memory.limit();
    let beside = memory_used_byte()
        .unwrap_or(0)
        .saturating_add(demand.vector_byte())
        .saturating_add(picture);
    let with = |links: u64| beside.saturating_add(links);
    let (in_memory, on_disk) = (with(demand.link_byte()), with(demand.link_window_byte()));
    // Cells are cut while light is exchanged between them: their links stay in memory.
    let asked = match args.links {
        _ if args.adaptive.is_some() => LinksName::Memory,
        // Who names their file wants them there.
        LinksName::Auto if args.link_file.is_some() => LinksName::Disk,
        links => links,
    };
    let (kept, needed, reason) = match asked {
        LinksName::Auto if in_memory <= limit => (LinksName::Memory, in_memory, "they fit"),
        LinksName::Auto => (LinksName::Disk, on_disk, "they do not fit into memory"),
        LinksName::Memory if args.adaptive.is_some() => {
            (LinksName::Memory, in_memory, "those of cells, as they are cut")
        }
        LinksName::Memory => (LinksName::Memory, in_memory, "asked for"),
        LinksName::Disk => (LinksName::Disk, on_disk, "asked for"),
        LinksName::Recompute => (LinksName::Recompute, beside, "asked for"),
    };
    if needed > limit {
        let remedy = match kept {
            LinksName::Memory if args.adaptive.is_none() => "use --links auto or disk, or raise --memory-limit",
            LinksName::Disk if beside <= limit => "use fewer --threads or --links recompute, or raise --memory-limit",
            _ => "use fewer --voxels, or raise --memory-limit",
        };
        let what = format!("{} surfels need {}", demand.n_surfels, byte_text(needed));
        return Err(too_small(&what, limit, remedy));
    }
    let choice = match kept {
        LinksName::Memory | LinksName::Auto => "memory",
        LinksName::Disk => "disk",
        LinksName::Recompute => "recompute",
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

fn too_small(what: &str, limit: u64, remedy: &str) -> Failure {
    let limit = byte_text(limit);
    Failure::new(
        "memory_limit",
        format!("{what} of memory, and the limit is {limit}; {remedy}"),
    )
}
