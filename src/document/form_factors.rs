//! The JSON documents about form factors.

use serde::Serialize;

use super::SurfaceRecord;
use crate::form_factor::{Fraction, PairCounts};
use crate::matrix::{BalanceReport, Layout, MinMax, Place, Precision, StorageChoice};
use crate::workflow::{FormFactorStudy, Model, SurfaceTable};

/// Form factors: their checks, their rays, their storage.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FormFactorRecord {
    /// True if light cannot leave the scene.
    pub closed: bool,
    /// The least and the greatest Σ_j F_ij.
    pub row_sum: MinMax,
    /// How far the row sums are from what they should be, at most; null where that is not known.
    pub closure_error_max: Option<f64>,
    /// max |A_i F_ij − A_j F_ji| / min(A_i, A_j).
    pub reciprocity_error_max: f64,
    /// max A_i F_ij / min(A_i, A_j): above 1, more light would arrive than can.
    pub exchange_ratio_max: f64,
    /// Rays in all.
    pub n_rays: u64,
    /// Rays that hit nothing.
    pub n_escaped: u64,
    /// Rays that hit the back of a face.
    pub n_absorbed: u64,
    /// The fraction of entries that are stored.
    pub density: f64,
    /// Their size, in bytes, in memory or on a disk.
    pub stored_bytes: u64,
    /// How they are stored.
    pub storage: StorageRecord,
    /// The effect of a repair; null without one.
    pub balance: Option<BalanceReport>,
    /// How the pairs of patches were treated; null of methods that do not look at pairs.
    pub pairs: Option<PairCounts>,
    /// True if the stated error of every pair is within the tolerance.
    pub tolerance_met: bool,
}

/// How form factors are stored.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StorageRecord {
    /// The stored places of a tile.
    pub layout: Layout,
    /// The digits.
    pub precision: Precision,
    /// Where they are.
    pub place: PlaceName,
}

/// Where numbers are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PlaceName {
    /// In memory.
    Memory,
    /// In a scratch file.
    Disk,
}

impl From<StorageChoice<'_>> for StorageRecord {
    fn from(choice: StorageChoice<'_>) -> Self {
        Self {
            layout: choice.layout,
            precision: choice.precision,
            place: match choice.place {
                Place::Memory { .. } => PlaceName::Memory,
                Place::Disk(_) => PlaceName::Disk,
            },
        }
    }
}

impl From<&FormFactorStudy> for FormFactorRecord {
    fn from(study: &FormFactorStudy) -> Self {
        let checks = &study.checks;
        Self {
            closed: study.closed,
            row_sum: checks.row_sum,
            closure_error_max: checks.closure_error_max,
            reciprocity_error_max: checks.reciprocity_error_max,
            exchange_ratio_max: checks.exchange_ratio_max,
            n_rays: checks.n_rays + study.pairs.map_or(0, |pairs| pairs.n_rays),
            n_escaped: checks.n_escaped,
            n_absorbed: checks.n_absorbed,
            density: study.factors.density(),
            stored_bytes: study.factors.stored_byte() as u64,
            storage: study.factors.storage().into(),
            balance: study.balance,
            pairs: study.pairs,
            tolerance_met: study.tolerance_met,
        }
    }
}

/// The result of `form-factors`: row i and column j of a table are from surface i to surface j, area means over the patches of i.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FormFactorsDocument<'a> {
    /// The form factors.
    #[serde(flatten)]
    pub form_factors: FormFactorRecord,
    /// How many patches there are.
    pub n_patches: usize,
    /// How many surfaces there are.
    pub n_surfaces: usize,
    /// The surfaces, in file order.
    pub surfaces: Vec<SurfaceRecord>,
    /// F from each surface to each; null above 200 surfaces unless `--full` asks for it, and where they do not fit into memory.
    pub surface_form_factor: Option<Vec<&'a [f64]>>,
    /// An estimate of the absolute error of each; null where they are.
    pub surface_error: Option<Vec<&'a [f64]>>,
    /// 1 − Σ_j F_ij of each surface: what no front receives of its light.
    pub lost_factor: Option<Vec<f64>>,
    /// Σ_j F_ij of each surface: what fronts receive of its light.
    pub row_sum_of_surface: Vec<f64>,
    /// The absolute error of each: the area mean over its patches of the sum of the errors of a row's entries, which may have one sign. Null where the errors of the form factors are not known.
    pub row_sum_error: Option<Vec<f64>>,
    /// The fraction of the light of each surface that escapes.
    pub sky_factor: Vec<f64>,
    /// The absolute error of each; null where the errors of the form factors are not known.
    pub sky_factor_error: Option<Vec<f64>>,
    /// The fraction of the light of each surface that black backs take.
    pub back_factor: Vec<f64>,
    /// The absolute error of each; null where the errors of the form factors are not known.
    pub back_factor_error: Option<Vec<f64>>,
    /// The file that was written.
    pub output: Option<String>,
}

impl<'a> FormFactorsDocument<'a> {
    /// Returns the document of form factors, with those between surfaces.
    #[must_use]
    pub fn new(model: &Model, study: &FormFactorStudy, table: &'a SurfaceTable, output: Option<String>) -> Self {
        let n = model.scene.surfaces.len();
        let sky = study.sky.of_surfaces(&model.mesh, n);
        let values = |of: &[Fraction]| of.iter().map(|fraction| fraction.value).collect();
        let errors = |of: &[Fraction]| {
            let known = study.errors_known;
            known.then(|| of.iter().map(|fraction| fraction.error()).collect())
        };
        let rows = table.rows();
        Self {
            form_factors: study.into(),
            n_patches: model.mesh.n_patches(),
            n_surfaces: n,
            surfaces: SurfaceRecord::of(model),
            surface_form_factor: rows.map(|rows| rows.iter().map(|row| &*row.form_factor).collect()),
            surface_error: rows.map(|rows| rows.iter().map(|row| &*row.error).collect()),
            lost_factor: table.lost_factors(),
            row_sum_of_surface: values(&sky.received),
            row_sum_error: errors(&sky.received),
            sky_factor: values(&sky.sky),
            sky_factor_error: errors(&sky.sky),
            back_factor: values(&sky.back),
            back_factor_error: errors(&sky.back),
            output,
        }
    }
}
