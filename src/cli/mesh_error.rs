//! What a coarser mesh tells of the error of the mesh, as numbers to print.

use std::fmt::Write as _;

use serde::Serialize;

use super::failure::Failure;
use super::pipeline::{Computed, Prepared, Run, go_on};
use crate::matrix::Place;
use crate::matrix::operator::Block;
use crate::mesh::Hierarchy;
use crate::printable::printable;
use crate::progress::Progress as _;
use crate::solver::{Coarsened, Solution, SolverError, StopReason, coarsened, relative_errors};

/// A surface whose mean radiosity is below this part of the most that a surface reflects in the mean is not looked at.
const DARK: f64 = 1e-6;

/// The change of a surface's mean radiosity, relative to itself, from which it is warned of.
const MUCH: f64 = 0.5;

/// How a solution would change with about a quarter of the patches.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct MeshError {
    /// The patches of the coarser mesh.
    n_patches: usize,
    /// The greatest relative change of a surface's mean radiosity, over all channels.
    surface_mean_max: f64,
    /// The surface that it is found on.
    surface: String,
    /// sqrt(Σ A (B − B̄)² / Σ A (B − E)²), the worst channel, with B̄ the mean over the coarser patch: a small lamp's own light is no measure of what it lights.
    patches_rms: f64,
}

impl MeshError {
    /// Adds the line that tells of it.
    pub(super) fn describe(&self, text: &mut String) {
        let Self {
            n_patches,
            surface_mean_max,
            surface,
            patches_rms,
        } = self;
        let surface = printable(surface);
        let _ = writeln!(
            text,
            "mesh: {n_patches} patches instead would change the mean radiosity of a surface by up to {surface_mean_max:.1e} of itself (`{surface}`), \
             that of a patch by {patches_rms:.1e} of what is reflected (root mean square)"
        );
    }
}

impl Run {
    /// Estimates the radiosities on a mesh of about a quarter of the patches, all channels at once; `None` where that is not known, or not worth its passes over the form factors.
    pub(super) fn coarsened(
        &mut self,
        prepared: &Prepared,
        computed: &Computed,
        reflectance: &Block,
        solution: &Solution,
    ) -> Result<Option<Coarsened>, Failure> {
        if matches!(computed.factors.storage().place, Place::Disk(_)) || self.progress.is_late() {
            return Ok(None);
        }
        let factors = &computed.factors;
        let found = self.times.time("mesh_error", || {
            let hierarchy = Hierarchy::of_mesh(&prepared.mesh);
            coarsened(factors, factors.areas(), &hierarchy, reflectance, solution, || {
                go_on(&self.progress)
            })
        });
        self.go_on()?;
        match found {
            Ok(coarse) => Ok(coarse),
            Err(error @ SolverError::Disk(_)) => Err(error.into()),
            // A room that reflects all light has no balanced difference: that is no reason to keep the light itself back.
            Err(_) => Ok(None),
        }
    }

    /// Makes numbers of what a coarser mesh would change in a solution for an `exitance`, and warns where that is nearly all of a surface's light.
    pub(super) fn mesh_error(
        &mut self,
        prepared: &Prepared,
        coarse: Option<&Coarsened>,
        (exitance, solution): (&Block, &Solution),
    ) -> Option<MeshError> {
        let found = MeshError::of(prepared, coarse?, exitance, solution)?;
        if found.surface_mean_max >= MUCH {
            self.warn_once(&format!(
                "the mesh is too coarse for `{}`: a quarter of the patches would change its mean radiosity by {:.1e} of itself; subdivide more",
                printable(&found.surface),
                found.surface_mean_max
            ));
        }
        Some(found)
    }
}

impl MeshError {
    /// Makes numbers of what a coarser mesh would change in a solution for an `exitance`; `None` of one that has not converged, or has no light.
    fn of(prepared: &Prepared, coarse: &Coarsened, exitance: &Block, solution: &Solution) -> Option<Self> {
        let is_dark = solution.radiosity.values().iter().all(|b| *b <= 0.0);
        if is_dark || solution.stop_reason != StopReason::Converged {
            return None;
        }
        let reflected = solution.reflected(exitance);
        let blocks = [&solution.radiosity, &coarse.change, &reflected];
        let [means, changes, reflected_means] = blocks.map(|block| prepared.surface_means(block));
        let brightest = reflected_means.iter().flatten().copied().fold(0.0, f64::max);
        let mut worst = (0.0, 0);
        for (k, (mean, change)) in means.iter().zip(&changes).enumerate() {
            for (b, d) in mean.iter().zip(change).filter(|(b, _)| **b > DARK * brightest) {
                worst = if d.abs() / b > worst.0 { (d.abs() / b, k) } else { worst };
            }
        }
        let spreads = relative_errors(&prepared.mesh.areas(), &coarse.spread, &reflected);
        Some(Self {
            n_patches: coarse.n_patches,
            surface_mean_max: worst.0,
            surface: prepared.scene.surfaces[worst.1].name.clone(),
            patches_rms: spreads.into_iter().fold(0.0, f64::max),
        })
    }
}
