//! The text that the program prints about a study on voxels.
//!
//! Writing to a String cannot fail; the results of `write!` are dropped for that reason.

use std::fmt::Write as _;

use super::solution::{describe_means, solver_line};
use crate::scene::Scene;
use crate::voxel::VoxelScene;
use crate::workflow::{TotalError, VoxelLight, VoxelRequest, VoxelResult, VoxelStudy};

/// Describes voxels, links, walls, and the method that found the light.
pub(super) fn describe(text: &mut String, request: &VoxelRequest, study: &VoxelStudy) {
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
    describe_walls(text, voxels);
    let _ = writeln!(text, "{}", light_line(request, study));
}

/// Describes walls that are thinner than two voxels.
fn describe_walls(text: &mut String, voxels: &VoxelScene) {
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

/// Returns the line about the method that found the light.
fn light_line(request: &VoxelRequest, study: &VoxelStudy) -> String {
    let (passes, solver) = match &request.light {
        VoxelLight::Propagations { passes, .. } | VoxelLight::Cells { passes, .. } => (*passes, ""),
        VoxelLight::Solver { name, .. } => (0, name.as_str()),
    };
    match &study.result {
        VoxelResult::Propagations(changes) => {
            let last = changes.last().copied().unwrap_or(0.0);
            format!("{passes} propagations; the last one changed the radiosity by {last:.1e} of itself")
        }
        VoxelResult::Cells { n_by_round, .. } => format!(
            "{} cells in place of {} unknowns, after {} rounds of cuts; {passes} propagations on each",
            n_by_round.last().unwrap_or(&0),
            study.voxels.n_surfels(),
            n_by_round.len() - 1
        ),
        VoxelResult::Solver(solution) => solver_line(solver, solution, TotalError::Untold),
    }
}

/// The greatest number of surfaces in the text; the document has all.
const LISTED: usize = 40;

/// Adds the mean radiosity of each surface.
pub(super) fn describe_surfaces(text: &mut String, scene: &Scene, study: &VoxelStudy) {
    let means = study.voxels.surface_means(scene, &study.radiosity);
    let listed: Vec<Vec<f64>> = means.iter().take(LISTED).map(|mean| mean.value.clone()).collect();
    describe_means(text, scene, &listed);
    if means.len() > LISTED {
        let _ = writeln!(text, "... and {} more, all of them with --json", means.len() - LISTED);
    }
    let _ = writeln!(text);
}

fn mebibytes(bytes: f64) -> String {
    format!("{:.1} MiB", bytes / f64::from(1 << 20))
}
