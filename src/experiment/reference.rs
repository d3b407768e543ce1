//! What the methods are measured against.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::ExperimentError;
use super::known;
use crate::form_factor::{FormFactorMethod, Input, RandomShooting};
use crate::geometry::rectangle::rectangle_exchange_area;
use crate::geometry::sampling::Sequence;
use crate::matrix::{FormFactors, StorageChoice, Weighting};
use crate::mesh::{Mesh, PatchId};
use crate::progress::Progress;

/// Where a reference comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceKind {
    /// The closed form for rectangles with parallel edges, pair by pair.
    ClosedForm,
    /// Certified numbers between whole surfaces.
    Certified,
    /// A long run of shooting, each pair averaged with its reverse.
    LongRun,
}

/// What a reference is known between.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceLevel {
    /// Every pair of patches.
    Patches,
    /// Every pair of surfaces.
    Surfaces,
}

/// Form factors that are known better than any that are compared with them, or as well as could be had.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Where they come from.
    pub kind: ReferenceKind,
    /// What they are known between.
    pub level: ReferenceLevel,
    /// The number of patches or surfaces.
    pub n: usize,
    /// F, row-major \[n, n\].
    pub values: Vec<f64>,
    /// Its greatest absolute error: a bound, or for a long run the greatest standard error of an entry.
    pub error_max: f64,
    /// Its root-mean-square error, as [`Reference::errors`] defines it: a bound, or for a long run an estimate.
    pub error_rms: f64,
    /// The rays of each patch, of a long run.
    pub rays: Option<u64>,
}

impl Reference {
    /// Finds or computes the reference for a scene.
    ///
    /// In this order: the closed form, if nothing blocks (or `input.unoccluded` says not to look) and all patches are rectangles with
    /// parallel edges; certified numbers, if the scene is one that has them and occluders count; a run of `sr` with `rays` rays a patch (its seed is
    /// outside of those that are compared), each pair averaged with its reverse. `None` where occluders are to be looked through and there is no closed
    /// form: rays cannot look through them.
    ///
    /// # Errors
    /// [`ExperimentError::Reference`] if the long run fails.
    pub fn find(
        input: Input<'_>,
        occluders_exist: bool,
        rays: u64,
        progress: &dyn Progress,
    ) -> Result<Option<Self>, ExperimentError> {
        if (input.unoccluded || !occluders_exist)
            && let Some(reference) = Self::closed_form(input.mesh)
        {
            return Ok(Some(reference));
        }
        if input.unoccluded && occluders_exist {
            return Ok(None);
        }
        if !input.unoccluded
            && let Some(known) = known::surface_form_factors(input.scene)
        {
            return Ok(Some(Self {
                kind: ReferenceKind::Certified,
                level: ReferenceLevel::Surfaces,
                n: input.scene.surfaces.len(),
                values: known.values,
                error_max: known.error,
                error_rms: known.error,
                rays: None,
            }));
        }
        Self::long_run(input, rays, progress).map(Some)
    }

    /// Returns the closed form between all patches, or `None` if two of them are not rectangles with parallel edges.
    #[must_use]
    pub fn closed_form(mesh: &Mesh) -> Option<Self> {
        let n = mesh.n_patches();
        let polygons: Vec<_> = (0..n).map(|i| mesh.polygon(PatchId::from_index(i))).collect();
        let row = |i: usize| -> Option<Vec<f64>> {
            let area = mesh.patches[i].area;
            let other = |j: usize| match i == j {
                true => Some(0.0),
                // One evaluation for both directions: the two agree to the last bit of the exchange area.
                false => Some(rectangle_exchange_area(&polygons[i.min(j)], &polygons[i.max(j)])? / area),
            };
            (0..n).map(other).collect()
        };
        let rows: Option<Vec<Vec<f64>>> = (0..n).into_par_iter().map(row).collect();
        let everything = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = mesh
            .vertices
            .iter()
            .fold(everything, |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        let squared_diameter = (high - low).length_squared();
        let least_area = mesh.patches.iter().map(|p| p.area).fold(f64::INFINITY, f64::min);
        let error = 3e-15 * squared_diameter / least_area;
        Some(Self {
            kind: ReferenceKind::ClosedForm,
            level: ReferenceLevel::Patches,
            n,
            values: rows?.concat(),
            error_max: error,
            error_rms: error,
            rays: None,
        })
    }

    fn long_run(input: Input<'_>, rays: u64, progress: &dyn Progress) -> Result<Self, ExperimentError> {
        let method = RandomShooting {
            rays,
            sequence: Sequence::Sobol,
            seed: u64::MAX,
        };
        let computed = method
            .compute(input, StorageChoice::default(), progress)
            .map_err(ExperimentError::Reference)?;
        let factors = computed.factors.symmetrised(Weighting::default())?;
        let n = factors.n_rows();
        let (mut values, mut errors) = (vec![0.0; n * n], Vec::new());
        for i in 0..n {
            factors.for_each_in_row(i, |j, value, error| {
                values[i * n + j] = value;
                errors.push(error);
            });
        }
        let n_errors = errors.len().max(1) as f64;
        Ok(Self {
            kind: ReferenceKind::LongRun,
            level: ReferenceLevel::Patches,
            n,
            values,
            error_max: errors.iter().copied().fold(0.0, f64::max),
            error_rms: (errors.iter().map(|e| e * e).sum::<f64>() / n_errors).sqrt(),
            rays: Some(rays),
        })
    }

    /// Returns the share of the entries that are not zero.
    #[must_use]
    pub fn density(&self) -> f64 {
        self.n_nonzero() / (self.n as f64).powi(2)
    }

    fn n_nonzero(&self) -> f64 {
        self.values.iter().filter(|v| **v != 0.0).count() as f64
    }

    /// Returns the greatest and the root-mean-square absolute error of form factors: max |F − F*| over all entries, and
    /// sqrt(Σ (F − F*)² / m), the sum over all entries and m the number of those with F* ≠ 0, so that pairs that cannot see
    /// each other do not make a method look better.
    ///
    /// Between patches or, where the reference is such, between surfaces
    /// ([`surface_form_factors`](FormFactors::surface_form_factors)).
    ///
    /// # Panics
    /// If `factors` are not those of `mesh`, or the reference is not of this scene.
    #[must_use]
    #[track_caller]
    pub fn errors(&self, factors: &FormFactors, mesh: &Mesh) -> (f64, f64) {
        assert_eq!(factors.n_rows(), mesh.n_patches(), "one row per patch");
        let row_errors = |row: &[f64], reference: &[f64]| {
            row.iter().zip(reference).fold((0.0_f64, 0.0), |(max, sum), (f, r)| {
                let error = (f - r).abs();
                (max.max(error), sum + error * error)
            })
        };
        let reference_row = |i: usize| &self.values[i * self.n..(i + 1) * self.n];
        let errors: Vec<(f64, f64)> = match self.level {
            ReferenceLevel::Patches => {
                assert_eq!(factors.n_rows(), self.n, "a reference for as many patches");
                let of_row = |i: usize| {
                    let mut row = vec![0.0; self.n];
                    factors.for_each_in_row(i, |j, value, _| row[j] = value);
                    row_errors(&row, reference_row(i))
                };
                (0..self.n).into_par_iter().map(of_row).collect()
            }
            ReferenceLevel::Surfaces => {
                let surfaces: Vec<u32> = mesh.patches.iter().map(|p| p.surface.0).collect();
                let whole = factors.surface_form_factors(&surfaces, self.n).form_factor;
                let of_row = |i: usize| row_errors(&whole[i * self.n..(i + 1) * self.n], reference_row(i));
                (0..self.n).map(of_row).collect()
            }
        };
        // In the order of the rows, so that the sum does not depend on the threads.
        let (max, sum) = errors.iter().fold((0.0_f64, 0.0), |(m, s), (a, b)| (m.max(*a), s + b));
        (max, (sum / self.n_nonzero().max(1.0)).sqrt())
    }
}
