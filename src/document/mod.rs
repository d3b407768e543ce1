//! The JSON documents that the program prints: one typed structure for each command, with units and meaning at every key.
//!
//! Keys are sorted when a document is written. Lengths are in m, areas in m², powers in W, radiosities, irradiances and exitances in W·m⁻², times in s, memory in bytes; form factors, reflectances and
//! relative errors have no unit. Numbers that are not finite are written as null. `docs/schema.json` is the JSON Schema of all documents; a test holds it against these types.

mod form_factors;
mod heat;
mod image;
mod other;
#[cfg(all(test, feature = "cli"))]
mod schema;
mod solution;
mod sun_path;
mod surfaces;
mod voxel;

pub use form_factors::{FormFactorRecord, FormFactorsDocument, PlaceName, StorageRecord};
pub use heat::{HeatDocument, PointsDocument};
pub use image::{FieldDocument, FrameRecord, FramesDocument, PoseRecord, RenderDocument, UpdateRecord};
pub use other::{FailureDocument, FailureRecord, SceneDocument, VerifyDocument};
pub use solution::{LightingRecord, LightingsDocument, SolveDocument, SolverRecord};
pub use sun_path::{PathDocument, StepRecord};
pub use surfaces::{FieldSurface, VoxelSurface};
pub use voxel::{GapRecord, VoxelDocument, VoxelLightRecord, WallRecord};

use serde::Serialize;

use crate::audit::{Audit, Check, NotChecked};
use crate::plan::Decision;
use crate::report::{SCHEMA_VERSION, StageTimes, memory_peak_byte};
use crate::workflow::{Context, Leak, Model, Settings};
pub use crate::workflow::{LitSurface, Quality, SurfaceRecord};

/// The version of this crate.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The keys that the documents of all commands share, around a command's own result.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Document<'a, T> {
    /// The version of these documents; another one has other keys or meanings.
    pub schema_version: u32,
    /// The command.
    pub command: &'static str,
    /// The version of the program.
    pub version: &'static str,
    /// The settings of the result.
    pub settings: &'a Settings,
    /// Wall time of each stage, s, by `NAME_s`.
    #[cfg_attr(test, schemars(with = "std::collections::BTreeMap<String, f64>"))]
    pub stages: StageTimes,
    /// The sum of `stages`, s.
    pub total_s: f64,
    /// The most memory that the process has held, in bytes; null where the system does not tell.
    pub memory_peak_bytes: Option<u64>,
    /// The warnings, a line each.
    pub warnings: Vec<String>,
    /// The command's own result.
    #[serde(flatten)]
    pub result: T,
}

impl<'a, T> Document<'a, T> {
    /// Returns the document of a command; `warnings` are in the syntax of its users.
    #[must_use]
    pub fn new(command: &'static str, cx: &'a Context, warnings: Vec<String>, result: T) -> Self {
        let times = cx.times();
        Self {
            schema_version: SCHEMA_VERSION,
            command,
            version: VERSION,
            settings: &cx.settings,
            total_s: times.total_s(),
            stages: times,
            memory_peak_bytes: memory_peak_byte(),
            warnings,
            result,
        }
    }
}

/// The result of a command that prepared a scene, with what was left out and what was checked.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct OfScene<'a, T> {
    /// The steps that were left out because this scene does not need them, or because they do not fit.
    pub left_out: &'a [String],
    /// How many faces were cut at contact edges.
    pub n_cut_faces: usize,
    /// The light that leaks through patches that are not cut at contact edges; null where none is crossed.
    pub light_leak: Option<Leak>,
    /// The conservation checks.
    pub audit: AuditRecord<'a>,
    /// The choices, with their reasons; with `--explain`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decisions: Option<&'a [Decision]>,
    /// The command's own result.
    #[serde(flatten)]
    pub result: T,
}

/// How results stand against the conservation checks.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct AuditRecord<'a> {
    /// True if no check fails.
    pub passed: bool,
    /// The checks that were made.
    pub checks: &'a [Check],
    /// The checks that were not, and why.
    pub not_checked: &'a [NotChecked],
}

impl<'a> From<&'a Audit> for AuditRecord<'a> {
    fn from(audit: &'a Audit) -> Self {
        Self {
            passed: audit.passed(),
            checks: &audit.checks,
            not_checked: &audit.not_checked,
        }
    }
}

impl<'a, T> OfScene<'a, T> {
    /// Adds the account of a model and its study to a result; `explain` includes the decisions.
    #[must_use]
    pub fn new(model: &'a Model, cx: &'a Context, explain: bool, result: T) -> Self {
        Self {
            left_out: &model.plan.left_out,
            n_cut_faces: model.mesh.n_cut_faces(),
            light_leak: cx.leaks.worst,
            audit: (&cx.audit).into(),
            decisions: explain.then_some(&*model.plan.decisions),
            result,
        }
    }
}
