//! What the methods are measured against.

use std::num::NonZeroUsize;

use rayon::prelude::*;
use serde::Serialize;

use super::ExperimentError;
use super::known;
use crate::form_factor::{ClosedForm, FormFactorError, FormFactorMethod, Input, QuasiMonteCarlo};
use crate::matrix::{FormFactors, StorageChoice};
use crate::mesh::Mesh;
use crate::progress::Progress;

/// Where a reference comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceKind {
    /// The closed form for rectangles with parallel edges, pair by pair.
    ClosedForm,
    /// The exchange area of each pair of polygons to a tolerance far below any error that is measured.
    Polygons,
    /// Certified numbers between whole surfaces.
    Certified,
    /// The exchange area of each pair times a visible fraction from many rays.
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
    /// Its greatest absolute error, a bound, or for a long run the greatest standard error of an entry.
    pub error_max: f64,
    /// Its root-mean-square error, as [`Reference::errors`] defines it: a bound, or for a long run that of its standard errors.
    pub error_rms: f64,
    /// The rays of each pair, of a long run.
    pub rays: Option<u64>,
}

/// The greatest seed of references: the last that a comparison would come to.
const SEED: u64 = u64::MAX;

/// A long run is made of so many independent ones, whose spread is its error.
const REPLICATES: u64 = 8;

impl Reference {
    /// Finds or computes the reference for a scene.
    ///
    /// Where nothing blocks, or `input.unoccluded` says not to look: the closed form if all patches are rectangles with parallel edges, else the exchange
    /// area of each pair of polygons, both without rays. Else certified numbers, if the scene has them. Else `qmc` with `rays` rays a pair, in eight runs with
    /// seeds outside of those that are compared: their mean, with the standard errors that their spread shows.
    ///
    /// # Errors
    /// [`ExperimentError::Reference`] if a method fails.
    pub fn find(
        input: Input<'_>,
        occluders_exist: bool,
        rays: u64,
        progress: &dyn Progress,
    ) -> Result<Self, ExperimentError> {
        let between_patches = |method: &dyn FormFactorMethod, unoccluded, kind| {
            let input = Input { unoccluded, ..input };
            let computed = method.compute(input, StorageChoice::default(), progress)?;
            Ok(Self::between_patches(&computed.factors, kind))
        };
        let qmc = |rays_of_pair, seed| QuasiMonteCarlo {
            rays: rays_of_pair,
            seed,
        };
        if input.unoccluded || !occluders_exist {
            let closed_form = ClosedForm {
                points: NonZeroUsize::MIN,
                seed: SEED,
            };
            let reference = match between_patches(&closed_form, true, ReferenceKind::ClosedForm) {
                Err(FormFactorError::NotApplicable { .. }) => {
                    between_patches(&qmc(1, SEED), true, ReferenceKind::Polygons)
                }
                reference => reference,
            };
            return reference.map_err(ExperimentError::Reference);
        }
        if let Some(known) = known::surface_form_factors(input.scene) {
            return Ok(Self {
                kind: ReferenceKind::Certified,
                level: ReferenceLevel::Surfaces,
                n: input.scene.surfaces.len(),
                values: known.values,
                error_max: known.error,
                error_rms: known.error,
                rays: None,
            });
        }
        let rays_of_run = rays.div_ceil(REPLICATES);
        let run = |k| between_patches(&qmc(rays_of_run, SEED - k), false, ReferenceKind::LongRun);
        Self::mean((0..REPLICATES).map(run), REPLICATES * rays_of_run).map_err(ExperimentError::Reference)
    }

    fn between_patches(factors: &FormFactors, kind: ReferenceKind) -> Self {
        let n = factors.n_rows();
        let (mut values, mut errors) = (vec![0.0; n * n], Vec::new());
        for i in 0..n {
            factors.for_each_in_row(i, |j, value, error| {
                values[i * n + j] = value;
                errors.push(error);
            });
        }
        let n_errors = errors.len().max(1) as f64;
        Self {
            kind,
            level: ReferenceLevel::Patches,
            n,
            values,
            error_max: errors.iter().copied().fold(0.0, f64::max),
            error_rms: (errors.iter().map(|e| e * e).sum::<f64>() / n_errors).sqrt(),
            rays: None,
        }
    }

    /// Returns the mean of independent runs, with the standard errors that their spread shows.
    ///
    /// A method's own statement of its error must hold for any pair, and is far too careful for most; the spread is what the noise is.
    fn mean(runs: impl Iterator<Item = Result<Self, FormFactorError>>, rays: u64) -> Result<Self, FormFactorError> {
        let (mut mean, mut squares, mut n, mut n_runs) = (Vec::new(), Vec::new(), 0, 0.0);
        for run in runs {
            let run = run?;
            mean.resize(run.values.len(), 0.0);
            squares.resize(run.values.len(), 0.0);
            n = run.n;
            n_runs += 1.0;
            // Welford's recurrence: nothing cancels.
            for ((m, s), value) in mean.iter_mut().zip(&mut squares).zip(run.values) {
                let off = value - *m;
                *m += off / n_runs;
                *s += off * (value - *m);
            }
        }
        let variance_of_mean = |s: &f64| s / ((n_runs - 1.0) * n_runs);
        let n_nonzero = mean.iter().filter(|v| **v != 0.0).count().max(1) as f64;
        Ok(Self {
            kind: ReferenceKind::LongRun,
            level: ReferenceLevel::Patches,
            n,
            error_max: squares.iter().map(variance_of_mean).fold(0.0, f64::max).sqrt(),
            error_rms: (squares.iter().map(variance_of_mean).sum::<f64>() / n_nonzero).sqrt(),
            values: mean,
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
        (Reference::find(input, occluders, 64, &Silent).unwrap(), mesh)
    }

    fn builtin_scene(name: &str) -> Scene {
        builtin::build(name, None).unwrap().scene
    }

    #[test]
    fn each_scene_has_the_best_reference_there_is() {
        let (cube, _) = find(&builtin_scene("cube"), 1, false, false);
        assert_eq!(
            (cube.kind, cube.level),
            (ReferenceKind::ClosedForm, ReferenceLevel::Patches)
        );
        assert!((cube.values[1] - 0.199_824_895_698_387_4).abs() < 1e-14 && cube.error_max < 1e-13);
        assert!((cube.density() - 5.0 / 6.0).abs() < 1e-15);
        let (room, _) = find(&builtin_scene("room-box"), 1, false, true);
        assert_eq!(
            (room.kind, room.level),
            (ReferenceKind::Certified, ReferenceLevel::Surfaces)
        );
        let (corridor, _) = find(&builtin_scene("corridor"), 1, true, true);
        assert_eq!(corridor.kind, ReferenceKind::ClosedForm);
        assert!((corridor.values[1] - 0.205_860_159_188_717_36).abs() < 1e-12);
        let (cornell, _) = find(&builtin_scene("cornell-box"), 1, true, true);
        assert_eq!(cornell.kind, ReferenceKind::Polygons);
        assert!(cornell.error_max < 1e-6, "{}", cornell.error_max);
        let (long_run, _) = find(&builtin_scene("cornell-box"), 1, false, true);
        assert_eq!((long_run.kind, long_run.rays), (ReferenceKind::LongRun, Some(64)));
        assert!(long_run.error_rms > 0.0 && long_run.error_rms < long_run.error_max);
        assert!(long_run.values.iter().all(|f| (0.0..=1.0).contains(f)));
    }

    #[test]
    fn the_spread_of_runs_is_the_error_of_their_mean() {
        let run = |value: f64| {
            Ok(Reference {
                kind: ReferenceKind::LongRun,
                level: ReferenceLevel::Patches,
                n: 2,
                values: vec![0.0, value, 0.5, 0.0],
                error_max: 0.0,
                error_rms: 0.0,
                rays: None,
            })
        };
        let mean = Reference::mean([0.1, 0.2, 0.4, 0.5].map(run).into_iter(), 64).unwrap();
        assert!((mean.values[1] - 0.3).abs() < 1e-15 && (mean.values[2] - 0.5).abs() < 1e-15);
        // The sum of squares is 0.1, the variance of the mean of four 0.1 / 3 / 4; two entries are not 0.
        assert!((mean.error_max - (0.1_f64 / 12.0).sqrt()).abs() < 1e-15);
        assert!((mean.error_rms - (0.1_f64 / 24.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn errors_are_counted_where_they_are() {
        let (reference, mesh) = find(&builtin_scene("cube"), 1, false, false);
        let mut tile = RowTile::new(0);
        for i in 0..6u32 {
            let exact = &reference.values[6 * i as usize..][..6];
            let off = |j: u32| match (i, j) {
                (0, 1) => 0.03,
                (2, 2) => -0.04, // where the reference is 0
                _ => 0.0,
            };
            let entries: Vec<_> = (0..6).zip(exact).map(|(j, value)| (j, value + off(j), 0.0)).collect();
            tile.push_row(&entries, RowTally::default());
        }
        let factors = FormFactors::from_tiles(mesh.areas(), [tile], StorageChoice::default()).unwrap();
        let (max, rms) = reference.errors(&factors, &mesh);
        assert!((max - 0.04).abs() < 1e-15);
        // Thirty entries are not 0.
        assert!((rms - 0.05 / 30f64.sqrt()).abs() < 1e-15, "{rms}");
    }
}
