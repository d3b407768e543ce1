//! The references for the errors of methods.

use std::num::NonZeroUsize;

use serde::Serialize;

use super::ExperimentError;
use super::known;
use crate::form_factor::{ClosedForm, ExactMethod, FormFactorError, FormFactorMethod, Input};
use crate::matrix::{DiskError, FormFactors, StorageChoice};
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::threads;

/// Where a reference comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceKind {
    /// The closed form for rectangles with parallel edges, pair by pair.
    ClosedForm,
    /// The exchange area of each pair of polygons to a tolerance far below any error that is measured.
    Polygons,
    /// Certified numbers between whole surfaces.
    Certified,
    /// [`ExactMethod`] at a tolerance far below any error that is measured.
    Exact,
}

/// The elements between which a reference is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceLevel {
    /// Every pair of patches.
    Patches,
    /// Every pair of surfaces.
    Surfaces,
}

/// The form factors of a reference.
#[derive(Clone, Debug)]
pub enum ReferenceValues {
    /// Between patches, in the requested storage.
    Patches(FormFactors),
    /// Between n surfaces: F, row-major \[n, n\].
    Surfaces(Vec<f64>),
}

/// Form factors that are more accurate than any that are compared with them, or as accurate as possible.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Their source.
    pub kind: ReferenceKind,
    /// The numbers.
    pub values: ReferenceValues,
    /// The greatest estimate of an entry's absolute error.
    pub error_max: f64,
    /// The root mean square of these estimates over the entries that are not 0, or a bound of it.
    pub error_rms: f64,
    /// The tolerance of [`ExactMethod`], if it computed them.
    pub tolerance: Option<f64>,
}

/// The seed of references: the greatest, which no comparison reaches.
const SEED: u64 = u64::MAX;

impl Reference {
    /// Finds or computes the reference for a scene.
    ///
    /// Without occluders, or if `input.unoccluded` ignores them: the closed form if all patches are rectangles with parallel edges, else the exchange area of each pair of polygons. Otherwise
    /// certified numbers, if the scene has them, else [`ExactMethod`] at `tolerance`. None uses rays, except [`ExactMethod`] for pairs whose clipping would take far longer. Factors between patches
    /// are stored in `storage`.
    ///
    /// # Errors
    /// [`ExperimentError::Reference`] if a method fails.
    pub fn find(
        input: Input<'_>,
        occluders_exist: bool,
        tolerance: f64,
        storage: StorageChoice<'_>,
        progress: &dyn Progress,
    ) -> Result<Self, ExperimentError> {
        let between_patches = |method: &dyn FormFactorMethod, unoccluded, kind| {
            let input = Input { unoccluded, ..input };
            let computed = method.compute(input, storage, progress)?;
            Ok(Self::between_patches(computed.factors, kind))
        };
        let exact = ExactMethod {
            tolerance,
            ..ExactMethod::default()
        };
        if input.unoccluded || !occluders_exist {
            let closed_form = ClosedForm {
                points: NonZeroUsize::MIN,
                seed: SEED,
            };
            let reference = match between_patches(&closed_form, true, ReferenceKind::ClosedForm) {
                Err(FormFactorError::NotApplicable { .. }) => between_patches(&exact, true, ReferenceKind::Polygons),
                reference => reference,
            };
            return reference.map_err(ExperimentError::Reference);
        }
        if let Some(known) = known::surface_form_factors(input.scene) {
            return Ok(Self {
                kind: ReferenceKind::Certified,
                values: ReferenceValues::Surfaces(known.values),
                error_max: known.error,
                error_rms: known.error,
                tolerance: None,
            });
        }
        let reference = between_patches(&exact, false, ReferenceKind::Exact).map_err(ExperimentError::Reference)?;
        Ok(Self {
            tolerance: Some(tolerance),
            ..reference
        })
    }

    fn between_patches(factors: FormFactors, kind: ReferenceKind) -> Self {
        let (mut error_max, mut sum, mut n_entries) = (0.0_f64, 0.0, 0_u64);
        for i in 0..factors.n_rows() {
            factors.for_each_in_row(i, |_, _, error| {
                error_max = error_max.max(error);
                sum += error * error;
                n_entries += 1;
            });
        }
        Self {
            kind,
            values: ReferenceValues::Patches(factors),
            error_max,
            error_rms: (sum / n_entries.max(1) as f64).sqrt(),
            tolerance: None,
        }
    }

    /// Returns the elements between which the form factors are known.
    #[must_use]
    pub fn level(&self) -> ReferenceLevel {
        match self.values {
            ReferenceValues::Patches(_) => ReferenceLevel::Patches,
            ReferenceValues::Surfaces(_) => ReferenceLevel::Surfaces,
        }
    }

    /// Returns the number of entries that are not zero.
    fn n_nonzero(&self) -> f64 {
        match &self.values {
            ReferenceValues::Patches(factors) => (factors.density() * (factors.n_rows() as f64).powi(2)).round(),
            ReferenceValues::Surfaces(values) => values.iter().filter(|v| **v != 0.0).count() as f64,
        }
    }

    /// Returns the greatest and the root-mean-square absolute error of form factors: max |F − F*| over all entries, and sqrt(Σ (F − F*)² / m).
    ///
    /// The sum is over all entries, and m is the number of those with F* ≠ 0, so that mutually hidden pairs do not lower the error.
    /// The errors are those between patches or, for such a reference, between surfaces
    /// ([`surface_form_factors`](FormFactors::surface_form_factors)).
    ///
    /// # Errors
    /// [`DiskError`] if form factors on a disk cannot be read.
    ///
    /// # Panics
    /// If `factors` are not those of `mesh`, or the reference is that of another scene.
    #[track_caller]
    pub fn errors(&self, factors: &FormFactors, mesh: &Mesh) -> Result<(f64, f64), DiskError> {
        assert_eq!(factors.n_rows(), mesh.n_patches(), "one row per patch");
        let row_errors = |row: &[f64], reference: &[f64]| {
            row.iter().zip(reference).fold((0.0_f64, 0.0), |(max, sum), (f, r)| {
                let error = (f - r).abs();
                (max.max(error), sum + error * error)
            })
        };
        let errors: Vec<(f64, f64)> = match &self.values {
            ReferenceValues::Patches(reference) => {
                let n = reference.n_rows();
                assert_eq!(factors.n_rows(), n, "a reference for as many patches");
                let of_row = |rows: &mut [Vec<f64>; 2], i: usize| {
                    for (row, matrix) in rows.iter_mut().zip([factors, reference]) {
                        row.fill(0.0);
                        matrix.for_each_in_row(i, |j, value, _| row[j] = value);
                    }
                    row_errors(&rows[0], &rows[1])
                };
                let rows = || [vec![0.0; n], vec![0.0; n]];
                let errors = threads::collect_with(n, rows, of_row);
                reference.if_readable(errors)?
            }
            ReferenceValues::Surfaces(values) => {
                let surfaces: Vec<u32> = mesh.patches.iter().map(|p| p.surface.0).collect();
                let n = values.len().isqrt();
                let whole = factors.surface_form_factors(&surfaces, n).form_factor;
                whole
                    .chunks(n)
                    .zip(values.chunks(n))
                    .map(|(row, reference)| row_errors(row, reference))
                    .collect()
            }
        };
        // Summation in the order of the rows makes the result independent of the threads.
        let (max, sum) = errors.iter().fold((0.0_f64, 0.0), |(m, s), (a, b)| (m.max(*a), s + b));
        factors.if_readable((max, (sum / self.n_nonzero().max(1.0)).sqrt()))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::matrix::{RowTally, RowTile};
    use crate::mesh::Subdivision;
    use crate::progress::Silent;
    use crate::scene::{Scene, builtin};
    use crate::visibility::embree::EmbreeVisibility;

    fn find(scene: &Scene, n: u32, unoccluded: bool, occluders: bool) -> (Reference, Mesh) {
        let mesh = Mesh::new(scene, Subdivision::Uniform(n)).unwrap();
        let visibility = EmbreeVisibility::new(scene).unwrap();
        let input = Input {
            scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded,
        };
        let reference = Reference::find(input, occluders, 1e-7, StorageChoice::default(), &Silent).unwrap();
        (reference, mesh)
    }

    fn entry(reference: &Reference, i: usize, j: usize) -> f64 {
        match &reference.values {
            ReferenceValues::Patches(factors) => factors.get(i, j),
            ReferenceValues::Surfaces(values) => values[i * values.len().isqrt() + j],
        }
    }

    fn builtin_scene(name: &str) -> Scene {
        builtin::build(name, None).unwrap().scene
    }

    #[test]
    fn each_scene_has_the_best_reference_there_is() {
        let (cube, _) = find(&builtin_scene("cube"), 1, false, false);
        assert_eq!(
            (cube.kind, cube.level()),
            (ReferenceKind::ClosedForm, ReferenceLevel::Patches)
        );
        assert!((entry(&cube, 0, 1) - 0.199_824_895_698_387_4).abs() < 1e-14 && cube.error_max < 1e-13);
        assert!((cube.n_nonzero() - 30.0).abs() < 0.5);
        let (room, _) = find(&builtin_scene("room-box"), 1, false, true);
        assert_eq!(
            (room.kind, room.level()),
            (ReferenceKind::Certified, ReferenceLevel::Surfaces)
        );
        let (corridor, _) = find(&builtin_scene("corridor"), 1, true, true);
        assert_eq!(corridor.kind, ReferenceKind::ClosedForm);
        assert!((entry(&corridor, 0, 1) - 0.205_860_159_188_717_36).abs() < 1e-12);
        let (cornell, _) = find(&builtin_scene("cornell-box"), 1, true, true);
        assert_eq!(cornell.kind, ReferenceKind::Polygons);
        assert!(cornell.error_max < 1e-11, "{}", cornell.error_max);
        let (exact, _) = find(&builtin_scene("cornell-box"), 1, false, true);
        assert_eq!((exact.kind, exact.tolerance), (ReferenceKind::Exact, Some(1e-7)));
        // Factors from the larger of two patches are more accurate; those from the smaller have the tolerance.
        assert!(exact.error_rms > 0.0 && exact.error_rms < exact.error_max && exact.error_max <= 1e-7);
        let ReferenceValues::Patches(factors) = &exact.values else {
            panic!("between patches")
        };
        for i in 0..factors.n_rows() {
            factors.for_each_in_row(i, |_, value, _| assert!((0.0..=1.0).contains(&value)));
        }
    }

    #[test]
    fn errors_are_counted_where_they_are() {
        let (reference, mesh) = find(&builtin_scene("cube"), 1, false, false);
        let mut tile = RowTile::new(0);
        for i in 0..6u32 {
            let off = |j: u32| match (i, j) {
                (0, 1) => 0.03,
                (2, 2) => -0.04, // where the reference is 0
                _ => 0.0,
            };
            let exact = |j: u32| entry(&reference, i as usize, j as usize);
            let entries: Vec<_> = (0..6).map(|j| (j, exact(j) + off(j), 0.0)).collect();
            tile.push_row(&entries, RowTally::default());
        }
        let factors = FormFactors::from_tiles(mesh.areas(), [tile], StorageChoice::default()).unwrap();
        let (max, rms) = reference.errors(&factors, &mesh).unwrap();
        assert!((max - 0.04).abs() < 1e-15);
        // Thirty entries are not 0.
        assert!((rms - 0.05 / 30f64.sqrt()).abs() < 1e-15, "{rms}");
    }
}
