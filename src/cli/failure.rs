//! Failures of a command: one line, one exit code, one JSON document.

use std::path::PathBuf;

use super::exit_code::ExitCode;
use crate::checkpoint::CheckpointError;
use crate::document::{FailureDocument, FailureRecord};
use crate::experiment::ExperimentError;
use crate::form_factor::FormFactorError;
use crate::matrix::{DiskError, MatrixError};
use crate::printable::printable_message;
use crate::render::RenderError;
use crate::report::{ReportError, SCHEMA_VERSION};
use crate::scene::{SceneError, SceneErrorKind};
use crate::solver::SolverError;
use crate::voxel::VoxelError;
use crate::workflow::{Parameter, WorkflowError};

/// An error for the user.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    /// A stable name of the kind, snake_case.
    pub(super) kind: &'static str,
    /// One line: the fault, the place, and the remedy.
    pub(super) message: String,
    /// The file at fault.
    pub(super) file: Option<PathBuf>,
    /// The line of that file.
    pub(super) line: Option<u32>,
    /// The exit code.
    pub(super) code: ExitCode,
}

impl Failure {
    /// Returns an error of the input or at run time (exit code 1).
    pub(super) fn new(kind: &'static str, message: impl Into<String>) -> Self {
        Self {
            kind,
            message: printable_message(&message.into()),
            file: None,
            line: None,
            code: ExitCode::Error,
        }
    }

    /// Returns a usage error (exit code 2).
    pub(super) fn usage(message: impl Into<String>) -> Self {
        Self {
            code: ExitCode::Usage,
            ..Self::new("usage", message)
        }
    }

    /// Returns the failure of work that a signal stopped; [`Interrupt`](super::interrupt::Interrupt) provides the signal.
    pub(super) fn interrupted() -> Self {
        Self {
            code: ExitCode::Interrupted,
            ..Self::new("interrupted", "no output was written")
        }
    }

    /// Adds the file at fault.
    #[must_use]
    pub(super) fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        self.file = Some(file.into());
        self
    }

    /// Returns the JSON document of the error.
    pub(super) fn document(&self) -> FailureDocument {
        FailureDocument {
            schema_version: SCHEMA_VERSION,
            error: FailureRecord {
                kind: self.kind,
                message: self.message.clone(),
                file: self.file.as_ref().map(|file| file.display().to_string()),
                line: self.line,
            },
        }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let code = match error.kind {
            // These concern the value of a flag or an argument, and no file.
            SceneErrorKind::UnknownBuiltin { .. }
            | SceneErrorKind::NoLevels { .. }
            | SceneErrorKind::LevelTooHigh { .. }
            | SceneErrorKind::UnknownSurface { .. } => ExitCode::Usage,
            _ => ExitCode::Error,
        };
        Self {
            file: error.file().map(Into::into),
            line: error.line(),
            code,
            ..Self::new(error.kind(), error.text(&flag))
        }
    }
}

impl From<FormFactorError> for Failure {
    fn from(error: FormFactorError) -> Self {
        match error {
            FormFactorError::Matrix(error) => error.into(),
            FormFactorError::Interrupted => Self::interrupted(),
            FormFactorError::UnknownMethod { .. } | FormFactorError::UnusedSetting { .. } => {
                Self::usage(error.text(&flag))
            }
            other => Self::new("form_factors", other.text(&flag)),
        }
    }
}

impl From<MatrixError> for Failure {
    fn from(error: MatrixError) -> Self {
        match error {
            MatrixError::Disk(error) => error.into(),
            other => Self::new("form_factors", other.to_string()),
        }
    }
}

impl From<DiskError> for Failure {
    fn from(error: DiskError) -> Self {
        Self::new("scratch", error.text(&flag)).in_file(error.directory())
    }
}

impl From<SolverError> for Failure {
    fn from(error: SolverError) -> Self {
        let kind = match error {
            SolverError::NoFiniteSolution { .. } => "no_finite_solution",
            SolverError::Disk(error) => return error.into(),
            SolverError::Tolerance { .. }
            | SolverError::UnknownSolver { .. }
            | SolverError::Omega { .. }
            | SolverError::UnusedSetting { .. } => return Self::usage(error.text(&flag)),
            _ => "solver",
        };
        Self::new(kind, error.to_string())
    }
}

impl From<VoxelError> for Failure {
    fn from(error: VoxelError) -> Self {
        match error {
            VoxelError::Resolution { .. } | VoxelError::Radius { .. } => Self::usage(error.to_string()),
            VoxelError::LinkFile { ref path, .. } => {
                let path = path.clone();
                Self::new("link_file", error.to_string()).in_file(path)
            }
            VoxelError::Interrupted => Self {
                message: "the finished links are stored; the same command continues from them".to_owned(),
                ..Self::interrupted()
            },
            VoxelError::TooMany { .. } => Self::new("voxel", error.to_string()),
        }
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        match error {
            ReportError::UnknownFormat { .. } | ReportError::BadSetting { .. } => Self::usage(error.text(&flag)),
            ReportError::BadTable { line, .. } => Self {
                line: u32::try_from(line).ok(),
                ..Self::new(error.kind(), error.text(&flag)).in_file(error.path())
            },
            _ => Self::new(error.kind(), error.text(&flag)).in_file(error.path()),
        }
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match &error {
            RenderError::Io { path, .. } => Self::new("io", error.to_string()).in_file(path),
            RenderError::Interrupted => Self::interrupted(),
            RenderError::TooLarge { .. } => Self::new("too_large", error.to_string()),
            _ => Self::new("render", error.to_string()),
        }
    }
}

impl From<ExperimentError> for Failure {
    fn from(error: ExperimentError) -> Self {
        match error {
            ExperimentError::TooFewSeeds { .. } => Self::usage(error.to_string()),
            ExperimentError::Plot(error) => Self::new("plot", error.to_string()),
            other => Self::new("experiment", other.text(&flag)),
        }
    }
}

impl From<CheckpointError> for Failure {
    fn from(error: CheckpointError) -> Self {
        Self::new("checkpoint", error.to_string()).in_file(error.path())
    }
}

/// Returns a parameter in the syntax of the command line.
pub(super) fn flag(parameter: Parameter, value: Option<&str>) -> String {
    match (parameter, value) {
        (Parameter::CutAtWalls, _) => "--no-cut".to_owned(),
        (Parameter::AngularRadius, _) => "--sun-radius".to_owned(),
        (Parameter::Flip, Some(surface)) => format!("--flip={surface}"),
        (Parameter::Output, Some(file)) => format!("-o {file}"),
        (_, Some(value)) => format!("--{} {value}", parameter.name().replace('_', "-")),
        (_, None) => format!("--{}", parameter.name().replace('_', "-")),
    }
}

impl From<WorkflowError> for Failure {
    fn from(error: WorkflowError) -> Self {
        let (text, place) = (error.text(&flag), error.place());
        match error {
            WorkflowError::Scene(error) => error.into(),
            WorkflowError::Motion(_) => Self::new("bad_frames", text),
            WorkflowError::Mesh { file, .. } => Self::new("mesh", text).in_file(file),
            WorkflowError::Embree { file, .. } => Self::new("embree", text).in_file(file),
            WorkflowError::MemoryLimit { file, .. } => Self::new("memory_limit", text).in_file(file),
            WorkflowError::FormFactor(error) => error.into(),
            WorkflowError::Matrix(error) => error.into(),
            WorkflowError::NotClosed { file, .. } => Self::new("not_closed", text).in_file(file),
            WorkflowError::Solver(error) => error.into(),
            WorkflowError::NoFiniteSolution { file, .. } => Self::new("no_finite_solution", text).in_file(file),
            WorkflowError::Report(error) => error.into(),
            WorkflowError::OtherGeometry { file, .. } => Self::new("other_geometry", text).in_file(file),
            WorkflowError::Render(error) => error.into(),
            WorkflowError::Voxel(error) => error.into(),
            WorkflowError::Heat { file, line, .. } => Self {
                line,
                ..Self::new("no_temperature", text).in_file(file)
            },
            WorkflowError::Storage(_) | WorkflowError::VoxelMemory { .. } | WorkflowError::ImageMemory { .. } => {
                Self::new("memory_limit", text)
            }
            WorkflowError::Checkpoint(error) => error.into(),
            WorkflowError::RanksDiffer { .. } => Self::new("ranks", text),
            WorkflowError::Unsuited(_) => Self::usage(text),
            WorkflowError::InFrame { error, .. } | WorkflowError::AtTime { error, .. } => {
                let failure = Self::from(*error);
                Self {
                    message: format!("{}{place}", failure.message),
                    ..failure
                }
            }
            WorkflowError::Interrupted => Self::interrupted(),
        }
    }
}
