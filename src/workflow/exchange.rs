//! Exchange factors of a thermal network.

use super::solve::Known;
use super::{Context, FormFactorStudy, Model, SolveRequest, WorkflowError, expect_room};
use crate::heat::{Boundary, ExchangeFactors, Gathered, Network, Nodes};

/// The residual that the solver aims at, if it can be reached.
const AIM: f64 = 1e-12;

/// Bytes of an entry while factors are computed and written: sums, factors and errors, script-F and conductors.
const ENTRY_BYTE: u64 = 48;

/// The number of columns that are solved for in the same passes over the form factors.
const COLUMNS: usize = 32;

/// The nodes of exchange factors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum ExchangeNodes {
    /// Surfaces, averaged over their patches with weights ε A
    #[default]
    #[cfg_attr(feature = "cli", value(name = "surface"))]
    Surfaces,
    /// Patches
    #[cfg_attr(feature = "cli", value(name = "patch"))]
    Patches,
}

impl Model {
    /// Computes the exchange factors of surfaces, averaged over their patches with weights ε A, or of patches.
    ///
    /// Temperatures and heats of the conditions have no effect.
    ///
    /// # Errors
    /// [`WorkflowError::Heat`] for conditions that do not fit the scene; those of [`solve_system`](Self::solve_system).
    pub fn exchange_factors(
        &mut self,
        study: &FormFactorStudy,
        boundary: &Boundary,
        by: ExchangeNodes,
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<ExchangeFactors, WorkflowError> {
        let network = Network::new(&self.scene, &self.mesh, boundary)
            .map_err(|error| WorkflowError::heat(boundary, error, &self.scene))?;
        let n_nodes = match by {
            ExchangeNodes::Surfaces => self.scene.surfaces.len(),
            ExchangeNodes::Patches => self.mesh.n_patches(),
        };
        let needed = ENTRY_BYTE.saturating_mul((n_nodes as u64 + 1).pow(2));
        let what = format!("for exchange factors of {n_nodes} nodes");
        expect_room(&self.file, &what, needed, &cx.memory, "or ask for those of surfaces")?;
        let mut gathered = Gathered::new(&network, study.enclosure(), self.nodes(by));
        let n_columns = gathered.n_columns();
        for first in (0..n_columns).step_by(COLUMNS) {
            let columns = first..n_columns.min(first + COLUMNS);
            let (reflectance, exitance) = gathered.system(&columns);
            let known = Known {
                aim: Some(AIM),
                ..study.known()
            };
            let materials = (&reflectance, &exitance);
            let solution = self.solve_system(&study.factors, request, materials, known, cx)?;
            let carried = study.carried_error(materials, None, &solution, cx)?;
            gathered.take(&columns, &solution, carried.as_ref());
            cx.go_on()?;
        }
        study.factors.if_readable(())?;
        Ok(gathered.factors())
    }

    fn nodes(&self, by: ExchangeNodes) -> Nodes {
        let surfaces = &self.scene.surfaces;
        let patches = self.mesh.patches.iter();
        match by {
            ExchangeNodes::Surfaces => Nodes {
                names: surfaces.iter().map(|surface| surface.name.clone()).collect(),
                of_patch: patches.map(|patch| patch.surface.0 as usize).collect(),
            },
            ExchangeNodes::Patches => Nodes {
                names: patches
                    .enumerate()
                    .map(|(i, patch)| format!("{}:{i}", surfaces[patch.surface.0 as usize].name))
                    .collect(),
                of_patch: (0..self.mesh.n_patches()).collect(),
            },
        }
    }
}
