//! Chooses the tolerance of form factors by the error of the mesh.

use super::{Context, FormFactorRequest, FormFactorStudy, Model, SolveRequest, Use, WorkflowError};
use crate::form_factor::ROW_TOLERANCE;
use crate::matrix::Need;
use crate::mesh::{ContactEdges, Mesh, MeshOptions, Subdivision};

/// The least number of patches of a mesh for which a coarser one is solved.
const MIN_PATCHES: usize = 1000;

/// The ratio of the edges of that coarser mesh to those of the mesh.
const COARSER: u32 = 4;

/// The tolerance of the coarser mesh's form factors.
const COARSE_TOLERANCE: f64 = 1e-3;

/// The ratio of the tolerance to the least error of the mesh.
const PART: f64 = 0.1;

/// The greatest tolerance that is chosen.
const MAX_TOLERANCE: f64 = 1e-3;

impl Model {
    /// Computes the form factors for the light of the scene's own materials.
    ///
    /// If no tolerance is given, `exact` computes to a tenth of the least error of the mesh, if that is looser than the default. For this, a mesh with edges four times as long is solved, and the
    /// greatest change of a surface's mean radiosity with a quarter of *its* patches is found: second-order convergence divides it by 16 in the finer mesh, slower convergence by less. The tolerance
    /// is rounded down to 1, 2 or 5 times a power of ten, and is at most 1e-3. Without occluders it has no effect, and the default stays.
    ///
    /// # Errors
    /// As [`form_factors`](Self::form_factors).
    pub fn form_factors_for_light(
        &mut self,
        request: &FormFactorRequest,
        need: Need,
        cx: &mut Context,
    ) -> Result<FormFactorStudy, WorkflowError> {
        let Some(tolerance) = self.mesh_tolerance(request, cx)? else {
            return self.form_factors(request, need, cx);
        };
        let chosen = FormFactorRequest {
            default_tolerance: tolerance,
            tolerance_is_by_mesh: true,
            ..request.clone()
        };
        self.form_factors(&chosen, need, cx)
    }

    /// Returns a tolerance looser than the default, if the mesh allows one.
    fn mesh_tolerance(&self, request: &FormFactorRequest, cx: &Context) -> Result<Option<f64>, WorkflowError> {
        let is_given = request.settings.tolerance().is_some() || request.settings.values.get(&ROW_TOLERANCE).is_some();
        let is_open = request.method == "exact" && !is_given && request.time_limit.is_none();
        let n_patches = self.mesh.n_patches();
        if !is_open || self.plan.convex_and_empty || n_patches < MIN_PATCHES {
            return Ok(None);
        }
        let Some(options) = coarser(self.options) else {
            return Ok(None);
        };
        let contact_edges = ContactEdges::of(&self.scene);
        let n_coarse = Mesh::count(&contact_edges, options).unwrap_or(u64::MAX);
        // If faces are as small as patches, the coarser mesh has hardly fewer patches.
        if n_coarse.saturating_mul(u64::from(COARSER * COARSER)) > 2 * n_patches as u64 {
            return Ok(None);
        }
        drop(contact_edges);
        let change = cx.time("mesh_tolerance", || self.change_of(options, request, cx.aside()));
        cx.go_on()?;
        let Some(change) = change else { return Ok(None) };
        let of_mesh = change / f64::from(COARSER * COARSER);
        let tolerance = round_down(PART * of_mesh).min(MAX_TOLERANCE);
        Ok((tolerance > request.default_tolerance).then_some(tolerance))
    }

    /// Returns the greatest change of a surface's mean radiosity by a quarter of the patches of a mesh.
    ///
    /// Returns `None` if it is unknown: a failure here must not prevent the solution.
    fn change_of(&self, options: MeshOptions, request: &FormFactorRequest, mut cx: Context) -> Option<f64> {
        let mut coarse = Self::new(self.scene.clone(), &self.file, options, Use::Points, &mut cx).ok()?;
        let rough = FormFactorRequest {
            default_tolerance: COARSE_TOLERANCE,
            explain: false,
            ..request.clone()
        };
        let factors = coarse.form_factors(&rough, Need::Symmetry, &mut cx).ok()?;
        let solved = coarse.solve(&factors, &SolveRequest::default(), &mut cx).ok()?;
        Some(solved.mesh_error?.surface_mean_max)
    }
}

/// Returns the options of a mesh with edges [`COARSER`] times as long, if it still has patches to combine.
fn coarser(options: MeshOptions) -> Option<MeshOptions> {
    let subdivision = match options.subdivision {
        Subdivision::Uniform(n) if n >= 2 * COARSER => Subdivision::Uniform(n / COARSER),
        Subdivision::Uniform(_) => return None,
        Subdivision::MaxEdge(edge) => Subdivision::MaxEdge(edge * f64::from(COARSER)),
    };
    Some(MeshOptions { subdivision, ..options })
}

/// Returns the greatest of 1, 2 and 5 times a power of ten that is not above `value`; 0 for values that are not positive.
fn round_down(value: f64) -> f64 {
    if value.is_nan() || value <= 0.0 {
        return 0.0;
    }
    let power = 10.0_f64.powf(value.log10().floor());
    let digit = [5.0, 2.0].into_iter().find(|digit| digit * power <= value);
    digit.unwrap_or(1.0) * power
}
