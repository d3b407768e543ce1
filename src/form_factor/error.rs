//! Why form factors could not be computed.

use thiserror::Error;

use crate::matrix::MatrixError;

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
}
