//! What is told of a run on voxels, to people and as a document.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::cli::run::Run;
use crate::cli::{cell, name_width};
use crate::matrix::operator::Block;
use crate::printable::printable;
use crate::scene::{Scene, SurfaceId};
use crate::voxel::{DiscreteSphere, Leak, MAX_VOXELS, ThinGap, ThinWall, VoxelScene};

/// What the checks of the discretisation found.
pub(super) struct Checked {
    /// Surfaces smaller than two voxels, and how large they are, m.
    pub(super) small: Vec<(SurfaceId, f64)>,
    pub(super) gaps: Vec<ThinGap>,
    /// Surfels that are reached from outside.
    pub(super) leaks: Vec<u32>,
    /// Light that passes closed surfaces.
    pub(super) leak: Leak,
    /// The Hausdorff distance from the scene, in voxels.
    pub(super) hausdorff: Option<f64>,
}

/// How many links there are, and what they take.
#[expect(clippy::struct_field_names, reason = "counts are named n_ everywhere")]
pub(super) struct LinkFigures {
    pub(super) n_links: u64,
    /// Links that end at a back, and that leave the scene, where they have been counted.
    pub(super) n_backs: Option<u64>,
    pub(super) n_escaped: Option<u64>,
    pub(super) n_bytes: u64,
}

pub(super) fn to_json(
    scene: &Scene,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    links: &LinkFigures,
    checked: &Checked,
) -> Value {
    json!({
        "n_voxels": voxels.octree.n_voxels(),
        "n_surfels": voxels.n_surfels(),
        "lattice": voxels.grid.n_voxels,
        "voxel_size_m": voxels.grid.voxel_size,
        "n_directions": sphere.directions().len(),
        "n_links": links.n_links,
        "n_escaped": links.n_escaped,
        "n_backs": links.n_backs,
        "link_byte": links.n_bytes,
        "octree_byte": voxels.octree.n_bytes(),
        "surfel_byte": voxels.n_bytes() - voxels.octree.n_bytes(),
        "n_leaks": checked.leaks.len(),
        "hausdorff_distance_voxel": checked.hausdorff,
        "n_small_surfaces": checked.small.len(),
        "thin_gaps": gaps_to_json(scene, &checked.gaps),
        "n_thin_walls": voxels.thin_walls.len(),
        "thin_wall_min_m": voxels.thin_walls.first().map(|wall| wall.thickness),
        "thin_walls": walls_to_json(scene, &voxels.thin_walls),
        "leak_power_w": checked.leak.power,
        "leak_share": checked.leak.share,
    })
}

pub(super) fn describe(text: &mut String, voxels: &VoxelScene, sphere: &DiscreteSphere, links: &LinkFigures) {
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

pub(super) fn warn_of_small_surfaces(run: &Run, scene: &Scene, small: &[(SurfaceId, f64)], voxels: &VoxelScene) {
    if let Some(&(surface, side)) = small.first() {
        let size = voxels.grid.voxel_size;
        let [x, y, z] = voxels.grid.n_voxels;
        let enough = (2.0 * size / side * f64::from(x.max(y).max(z))).ceil();
        let remedy = if enough <= f64::from(MAX_VOXELS) {
            format!("give --voxels {enough:.0}")
        } else {
            "use `solve`".to_owned()
        };
        run.warn(&format!(
            "{} surfaces are smaller than two voxels of {size:.2e} m, as {} of {side:.2e} m: their light and shadows are not resolved; {remedy}",
            small.len(),
            scene.surfaces[surface.0 as usize].name
        ));
    }
}

/// Names of the surfaces of at most three gaps: a line is for reading.
pub(super) fn warn_of_gaps(run: &Run, scene: &Scene, gaps: &[ThinGap], n: u32) {
    if gaps.is_empty() {
        return;
    }
    let name = |id: SurfaceId| scene.surfaces[id.0 as usize].name.as_str();
    let pair = |gap: &ThinGap| format!("{} and {}", name(gap.surfaces[0]), name(gap.surfaces[1]));
    let named: Vec<String> = gaps.iter().take(3).map(pair).collect();
    let more = gaps.len().saturating_sub(3);
    let others = if more > 0 {
        format!(" and {more} other pairs")
    } else {
        String::new()
    };
    run.warn(&format!(
        "at {n} voxels along the longest axis less than two voxels lie between {}{others}; the light in such gaps is not resolved, give --voxels a larger number",
        named.join(", ")
    ));
}

pub(super) fn warn_of_leaks(run: &Run, scene: &Scene, voxels: &VoxelScene, leaks: &[u32]) {
    if leaks.is_empty() {
        return;
    }
    let mut surfaces: Vec<u32> = leaks
        .iter()
        .map(|&s| scene.faces[voxels.surfels[s as usize].face.0 as usize].surface.0)
        .collect();
    surfaces.sort_unstable();
    surfaces.dedup();
    let names: Vec<&str> = surfaces
        .iter()
        .take(5)
        .map(|&s| scene.surfaces[s as usize].name.as_str())
        .collect();
    run.warn(&format!(
        "{} voxels of a closed scene can be reached from outside, on {}; it leaks there, give --voxels a larger number",
        leaks.len(),
        names.join(", ")
    ));
}

/// Warns of links that leave a closed scene: light is lost there, whether a way in from outside was found or not.
pub(super) fn warn_of_escapes(run: &Run, links: &LinkFigures, watertight: bool) {
    let n_escaped = links.n_escaped.unwrap_or(0);
    if watertight && n_escaped > 0 {
        let share = 100.0 * n_escaped as f64 / links.n_links.max(1) as f64;
        run.warn(&format!(
            "{n_escaped} links ({share:.2} %) leave a closed scene, and their light is lost; give --voxels a larger number"
        ));
    }
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

/// Warns of light that passes closed surfaces.
pub(super) fn warn_of_leak(run: &Run, voxels: &VoxelScene, leak: &Leak) {
    if leak.power <= 0.0 {
        return;
    }
    let (wall, remedy) = match voxels.thin_walls.first() {
        Some(wall) => {
            let n = voxels.n_voxels_for(wall);
            (
                format!(" walls as thin as {:.1e} m", wall.thickness),
                n.map_or_else(|| "larger".to_owned(), |n| n.to_string()),
            )
        }
        None => (" closed surfaces".to_owned(), "larger".to_owned()),
    };
    run.warn(&format!(
        "{:.1e} W, {:.1e} of what is emitted, passes{wall}; surfaces behind them are too bright; give --voxels {remedy}",
        leak.power, leak.share
    ));
}

/// Returns name, area, number of surfels and mean radiosity of each surface.
pub(super) fn surfaces(scene: &Scene, voxels: &VoxelScene, radiosity: &Block) -> Value {
    let (areas, counts, means) = surface_means(scene, voxels, radiosity);
    let surface = |(k, s): (usize, &crate::scene::Surface)| json!({"name": s.name, "area_m2": areas[k], "n_voxels": counts[k], "radiosity": means[k]});
    scene.surfaces.iter().enumerate().map(surface).collect()
}

fn surface_means(scene: &Scene, voxels: &VoxelScene, radiosity: &Block) -> (Vec<f64>, Vec<u64>, Vec<Vec<f64>>) {
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

pub(super) fn describe_surfaces(text: &mut String, scene: &Scene, voxels: &VoxelScene, radiosity: &Block) {
    let (_, _, means) = surface_means(scene, voxels, radiosity);
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
