//! What is told of a run on voxels, to people and as a document.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::cli::{cell, name_width};
use crate::printable::printable;
use crate::scene::{Scene, SurfaceId};
use crate::voxel::{ThinGap, ThinWall, VoxelScene};
use crate::workflow::VoxelStudy;

pub(super) fn to_json(scene: &Scene, study: &VoxelStudy) -> Value {
    let VoxelStudy { voxels, links, .. } = study;
    json!({
        "n_voxels": voxels.octree.n_voxels(),
        "n_surfels": voxels.n_surfels(),
        "lattice": voxels.grid.n_voxels,
        "voxel_size_m": voxels.grid.voxel_size,
        "n_directions": study.sphere.directions().len(),
        "n_links": links.n_links,
        "n_escaped": links.n_escaped,
        "n_backs": links.n_backs,
        "link_byte": links.n_bytes,
        "octree_byte": voxels.octree.n_bytes(),
        "surfel_byte": voxels.n_bytes() - voxels.octree.n_bytes(),
        "n_leaks": study.reached.len(),
        "hausdorff_distance_voxel": study.hausdorff,
        "n_small_surfaces": study.small.len(),
        "thin_gaps": gaps_to_json(scene, &study.gaps),
        "n_thin_walls": voxels.thin_walls.len(),
        "thin_wall_min_m": voxels.thin_walls.first().map(|wall| wall.thickness),
        "thin_walls": walls_to_json(scene, &voxels.thin_walls),
        "leak_power_w": study.leak.power,
        "leak_share": study.leak.share,
    })
}

pub(super) fn describe(text: &mut String, study: &VoxelStudy) {
    let VoxelStudy {
        voxels, sphere, links, ..
    } = study;
    let [x, y, z] = voxels.grid.n_voxels;
    let _ = writeln!(
        text,
        "{x} × {y} × {z} voxels of {:.4e} m, {} of them surface, {} unknowns, octree {}",
        voxels.grid.voxel_size,
        voxels.octree.n_voxels(),
        voxels.n_surfels(),
        mebibytes(voxels.octree.n_bytes() as f64)
    );
    let _ = write!(
        text,
        "{} directions, {} links",
        sphere.directions().len(),
        links.n_links
    );
    if links.n_bytes > 0 {
        let byte_per_link = links.n_bytes as f64 / links.n_links.max(1) as f64;
        let _ = write!(
            text,
            " in {} ({byte_per_link:.2} bytes a link)",
            mebibytes(links.n_bytes as f64)
        );
    }
    if let (Some(n_backs), Some(n_escaped)) = (links.n_backs, links.n_escaped) {
        let _ = write!(text, "; {n_backs} end at backs, {n_escaped} leave the scene");
    }
    text.push('\n');
}

fn gaps_to_json(scene: &Scene, gaps: &[ThinGap]) -> Value {
    let name = |id: SurfaceId| scene.surfaces[id.0 as usize].name.as_str();
    gaps.iter()
        .map(|gap| json!({"surfaces": gap.surfaces.map(name), "n_surfels": gap.n_surfels}))
        .collect()
}

fn walls_to_json(scene: &Scene, walls: &[ThinWall]) -> Value {
    let name = |id: SurfaceId| scene.surfaces[id.0 as usize].name.as_str();
    let wall = |wall: &ThinWall| json!({"surfaces": wall.surfaces.map(name), "thickness_m": wall.thickness, "n_surfels": wall.n_surfels});
    walls.iter().map(wall).collect()
}

/// Says how thin walls are, if any are thinner than two voxels.
pub(super) fn describe_walls(text: &mut String, voxels: &VoxelScene) {
    if let Some(wall) = voxels.thin_walls.first() {
        let _ = writeln!(
            text,
            "{} thin walls (pairs of surfaces), the thinnest {:.2e} m, {:.2} voxels; their sides exchange no light",
            voxels.thin_walls.len(),
            wall.thickness,
            wall.thickness / voxels.grid.voxel_size
        );
    }
}

/// Returns name, area, number of surfels and mean radiosity of each surface.
pub(super) fn surfaces(scene: &Scene, study: &VoxelStudy) -> Value {
    let (areas, counts, means) = surface_means(scene, study);
    let surface = |(k, s): (usize, &crate::scene::Surface)| json!({"name": s.name, "area_m2": areas[k], "n_voxels": counts[k], "radiosity": means[k]});
    scene.surfaces.iter().enumerate().map(surface).collect()
}

fn surface_means(scene: &Scene, study: &VoxelStudy) -> (Vec<f64>, Vec<u64>, Vec<Vec<f64>>) {
    let VoxelStudy { voxels, radiosity, .. } = study;
    let n = scene.surfaces.len();
    let (mut areas, mut counts) = (vec![0.0; n], vec![0; n]);
    let mut means = vec![vec![0.0; radiosity.n_channels()]; n];
    for (i, surfel) in voxels.surfels.iter().enumerate() {
        let k = scene.faces[surfel.face.0 as usize].surface.0 as usize;
        areas[k] += surfel.area;
        counts[k] += 1;
        for (mean, value) in means[k].iter_mut().zip(radiosity.row(i)) {
            *mean += surfel.area * value;
        }
    }
    for (mean, area) in means.iter_mut().zip(&areas) {
        if *area > 0.0 {
            for channel in mean {
                *channel /= area;
            }
        }
    }
    (areas, counts, means)
}

/// The most surfaces that are listed for people; the document has all.
const LISTED: usize = 40;

pub(super) fn describe_surfaces(text: &mut String, scene: &Scene, study: &VoxelStudy) {
    let (_, _, means) = surface_means(scene, study);
    let _ = writeln!(text, "\nmean radiosity by surface, W/m²");
    let width = name_width(scene.surfaces.iter().map(|s| s.name.as_str()));
    for (surface, mean) in scene.surfaces.iter().zip(&means).take(LISTED) {
        let _ = write!(text, "{:width$}", printable(&surface.name));
        for value in mean {
            let _ = write!(text, " {}", cell(*value));
        }
        let _ = writeln!(text);
    }
    if means.len() > LISTED {
        let _ = writeln!(text, "... and {} more, all of them with --json", means.len() - LISTED);
    }
    let _ = writeln!(text);
}

fn mebibytes(bytes: f64) -> String {
    format!("{:.1} MiB", bytes / f64::from(1 << 20))
}
