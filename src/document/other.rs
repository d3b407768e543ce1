//! Documents of commands that prepare no scene, and of those that fail.

use serde::Serialize;

use super::VERSION;
use crate::render::verify::VerifyReport;
use crate::report::{SCHEMA_VERSION, StageTimes, memory_peak_byte};

/// The document of `scene`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SceneDocument {
    /// The version of these documents; another one has other keys or meanings.
    pub schema_version: u32,
    /// The command.
    pub command: &'static str,
    /// The version of the program.
    pub version: &'static str,
    /// The name of the built-in scene.
    pub scene: String,
    /// The level of refinement that was asked for.
    pub level: Option<u32>,
    /// The OBJ file.
    pub output: String,
    /// The camera file, if one was written.
    pub camera: Option<String>,
    /// The camera file that was there already and was left.
    pub camera_left: Option<String>,
    /// How many faces the scene has.
    pub n_faces: usize,
    /// How many surfaces the scene has.
    pub n_surfaces: usize,
}

/// The document of `verify`.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct VerifyDocument {
    /// The version of these documents; another one has other keys or meanings.
    pub schema_version: u32,
    /// The command.
    pub command: &'static str,
    /// The version of the program.
    pub version: &'static str,
    /// The image that was verified.
    pub image: String,
    /// Wall time of each stage, s, by `NAME_s`.
    #[cfg_attr(test, schemars(with = "std::collections::BTreeMap<String, f64>"))]
    pub stages: StageTimes,
    /// The most memory that the process has held, in bytes; null where the system does not tell.
    pub memory_peak_bytes: Option<u64>,
    /// The findings.
    #[serde(flatten)]
    pub report: VerifyReport,
}

impl VerifyDocument {
    /// Returns the document of a verified image.
    #[must_use]
    pub fn new(image: String, stages: StageTimes, report: VerifyReport) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            command: "verify",
            version: VERSION,
            image,
            stages,
            memory_peak_bytes: memory_peak_byte(),
            report,
        }
    }
}

/// The document of a command that ends without a result.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FailureDocument {
    /// The version of these documents; another one has other keys or meanings.
    pub schema_version: u32,
    /// The fault.
    pub error: FailureRecord,
}

/// Why a command ended without a result.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FailureRecord {
    /// A stable name of the kind, in snake case.
    pub kind: &'static str,
    /// One line: what is wrong, where, and the remedy.
    pub message: String,
    /// The file that is at fault, if it is one.
    pub file: Option<String>,
    /// The line of that file, from 1.
    pub line: Option<u32>,
}
