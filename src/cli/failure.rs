//! How a command ends when it does not end well: one line, one exit code, one JSON document.

use std::path::PathBuf;

use serde_json::json;

use super::exit_code::ExitCode;
use crate::matrix::MatrixError;
use crate::scene::SceneError;
use crate::solver::SolverError;

/// An error as the user sees it.
#[derive(Clone, Debug)]
pub struct Failure {
    /// A stable name of the kind, snake_case.
    pub kind: &'static str,
    /// One line: what is wrong, where, and what to do.
    pub message: String,
    /// The file that is at fault.
    pub file: Option<PathBuf>,
    /// The line of that file.
    pub line: Option<u32>,
    /// The exit code.
    pub code: ExitCode,
}

impl Failure {
    /// Returns an error of the input or at run time (exit code 1).
    pub fn new(kind: &'static str, message: impl ToString) -> Self {
        Self {
            kind,
            message: message.to_string(),
            file: None,
            line: None,
            code: ExitCode::Error,
        }
    }

    /// Returns a usage error (exit code 2).
    pub fn usage(message: impl ToString) -> Self {
        Self {
            code: ExitCode::Usage,
            ..Self::new("usage", message)
        }
    }

    /// Adds the file that is at fault.
    #[must_use]
    pub fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        self.file = Some(file.into());
        self
    }

    /// Returns the JSON document of the error.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        json!({
            "schema_version": super::SCHEMA_VERSION,
            "error": {
                "kind": self.kind,
                "message": self.message,
                "file": self.file.as_ref().map(|f| f.display().to_string()),
                "line": self.line,
            }
        })
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self {
            file: error.file().map(Into::into),
            line: error.line(),
            ..Self::new(error.kind(), &error)
        }
    }
}

impl From<MatrixError> for Failure {
    fn from(error: MatrixError) -> Self {
        Self::new("form_factors", error)
    }
}

impl From<SolverError> for Failure {
    fn from(error: SolverError) -> Self {
        let kind = match error {
            SolverError::NoFiniteSolution { .. } => "no_finite_solution",
            SolverError::Tolerance { .. } => return Self::usage(error),
            _ => "solver",
        };
        Self::new(kind, error)
    }
}
