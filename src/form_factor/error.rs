//! Why form factors could not be computed.

use thiserror::Error;

use crate::matrix::MatrixError;
use crate::parameter::{Named, Parameter};

/// Why form factors could not be computed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FormFactorError {
    /// The results do not make a matrix.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// The method cannot treat this scene.
    #[error("the method `{method}` cannot be used here: {reason}")]
    NotApplicable {
        /// The method's name.
        method: &'static str,
        /// Why not, and what to use instead.
        reason: String,
    },
    /// The caller asked to stop.
    #[error("the form factors were interrupted")]
    Interrupted,
    /// There is no method of this name.
    #[error("there is no method `{name}`; there are {known}")]
    UnknownMethod {
        /// The name asked for.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// A setting was given that the method has no use for.
    #[error("{}", unused(.parameter.name(), .method, .used_by))]
    UnusedSetting {
        /// The setting.
        parameter: Parameter,
        /// The method's name.
        method: &'static str,
        /// The methods that use it.
        used_by: String,
    },
}

fn unused(setting: &str, method: &str, used_by: &str) -> String {
    format!("`{setting}` has no meaning with the method `{method}`; it is for {used_by}")
}

impl FormFactorError {
    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        match self {
            Self::Matrix(error) => error.text(named),
            Self::UnusedSetting {
                parameter,
                method,
                used_by,
            } => unused(&named(*parameter, None), method, used_by),
            other => other.to_string(),
        }
    }
}
