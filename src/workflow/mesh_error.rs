//! The error of the mesh, estimated from a coarser one.

use serde::{Deserialize, Serialize};

use super::{Context, FormFactorStudy, Model, Warning, WorkflowError, go_on};
use crate::matrix::Place;
use crate::matrix::operator::{Block, LinearOperator};
use crate::mesh::Hierarchy;
use crate::progress::Progress as _;
use crate::solver::{Coarsened, Solution, SolverError, StopReason, coarsened, relative_errors};

/// The mean radiosity, relative to the greatest mean reflected one, below which a surface is ignored.
const DARK: f64 = 1e-6;

/// The relative change of a surface's mean radiosity above which there is a warning.
const MUCH: f64 = 0.5;

/// How a solution would change with about a quarter of the patches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct MeshError {
    /// The patches of the coarser mesh.
    pub n_patches: usize,
    /// The greatest relative change of a surface's mean radiosity, over all channels.
    pub surface_mean_max: f64,
    /// The surface that it is found on.
    pub surface: String,
    /// sqrt(Σ A (B − B̄)² / Σ A (B − E)²), the worst channel, with B̄ the mean over the coarser patch. A small lamp's own light is no measure of what it lights.
    pub patches_rms: f64,
}

impl Model {
    /// Estimates the radiosities on a mesh of about a quarter of the patches, all channels at once.
    ///
    /// Returns `None` where they are unknown, or not worth their passes over the form factors.
    ///
    /// # Errors
    /// [`WorkflowError::Matrix`] where form factors on a disk cannot be read, and [`WorkflowError::Interrupted`].
    ///
    /// `operator`: the form factors, or what is made of them.
    pub fn coarsened(
        &self,
        study: &FormFactorStudy,
        operator: &dyn LinearOperator,
        reflectance: &Block,
        solution: &Solution,
        cx: &Context,
    ) -> Result<Option<Coarsened>, WorkflowError> {
        let factors = &study.factors;
        let watch = cx.progress();
        if matches!(factors.storage().place, Place::Disk(_)) || watch.is_late() {
            return Ok(None);
        }
        let found = cx.time("mesh_error", || {
            let hierarchy = Hierarchy::of_mesh(&self.mesh);
            coarsened(operator, factors.areas(), &hierarchy, reflectance, solution, || {
                go_on(&watch)
            })
        });
        cx.go_on()?;
        match found {
            Ok(coarse) => Ok(coarse),
            Err(error @ SolverError::Disk(_)) => Err(error.into()),
            // A room that reflects all light has no balanced difference, but the light itself is still valid.
            Err(_) => Ok(None),
        }
    }

    /// Returns figures of the change by a coarser mesh, for an `exitance`, and warns where it is nearly all of a surface's light.
    #[must_use]
    pub fn mesh_error(
        &self,
        coarse: Option<&Coarsened>,
        (exitance, solution): (&Block, &Solution),
        cx: &Context,
    ) -> Option<MeshError> {
        let found = MeshError::of(self, coarse?, exitance, solution)?;
        if found.surface_mean_max >= MUCH {
            cx.warn_once(Warning::CoarseMesh {
                surface: found.surface.clone(),
                change: found.surface_mean_max,
            });
        }
        Some(found)
    }
}

impl MeshError {
    /// Returns figures of the change by a coarser mesh, for an `exitance`; `None` for a solution that has not converged, or has no light.
    fn of(model: &Model, coarse: &Coarsened, exitance: &Block, solution: &Solution) -> Option<Self> {
        let is_dark = solution.radiosity.values().iter().all(|b| *b <= 0.0);
        if is_dark || solution.stop_reason != StopReason::Converged {
            return None;
        }
        let reflected = solution.reflected(exitance);
        let blocks = [&solution.radiosity, &coarse.change, &reflected];
        let [means, changes, reflected_means] = blocks.map(|block| model.surface_means(block));
        let brightest = reflected_means.iter().flatten().copied().fold(0.0, f64::max);
        let mut worst = (0.0, 0);
        for (k, (mean, change)) in means.iter().zip(&changes).enumerate() {
            for (b, d) in mean.iter().zip(change).filter(|(b, _)| **b > DARK * brightest) {
                worst = if d.abs() / b > worst.0 { (d.abs() / b, k) } else { worst };
            }
        }
        let spreads = relative_errors(&model.mesh.areas(), &coarse.spread, &reflected);
        Some(Self {
            n_patches: coarse.n_patches,
            surface_mean_max: worst.0,
            surface: model.scene.surfaces[worst.1].name.clone(),
            patches_rms: spreads.into_iter().fold(0.0, f64::max),
        })
    }
}
