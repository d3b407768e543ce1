//! Errors of the library as exceptions of the package, which `radiosity/_errors.py` defines.

use pyo3::prelude::*;
use radiosity::workflow::WorkflowError;

/// Returns an exception or warning class of the package.
pub(crate) fn class<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("radiosity._errors")?.getattr(name)
}

/// Returns the exception of an error.
pub(crate) fn raised(py: Python<'_>, error: &WorkflowError) -> PyErr {
    let name = match error {
        WorkflowError::Scene(_)
        | WorkflowError::Motion(_)
        | WorkflowError::Mesh { .. }
        | WorkflowError::NotClosed { .. } => "SceneError",
        WorkflowError::MemoryLimit { .. }
        | WorkflowError::Storage(_)
        | WorkflowError::ImageMemory { .. }
        | WorkflowError::VoxelMemory { .. } => "MemoryLimitError",
        WorkflowError::FormFactor(_) | WorkflowError::Matrix(_) => "FormFactorError",
        WorkflowError::Solver(_) | WorkflowError::NoFiniteSolution { .. } => "SolverError",
        WorkflowError::Report(_) | WorkflowError::OtherGeometry { .. } | WorkflowError::Checkpoint(_) => "FileError",
        WorkflowError::Render(_) => "RenderError",
        WorkflowError::Heat { .. } | WorkflowError::AtTime { .. } => "HeatError",
        WorkflowError::Unsuited(_) => "ArgumentError",
        _ => "RadiosityError",
    };
    with_text(py, name, &error.to_string())
}

/// Returns the exception of a wrong argument.
pub(crate) fn bad_argument(py: Python<'_>, text: &str) -> PyErr {
    with_text(py, "ArgumentError", text)
}

fn with_text(py: Python<'_>, name: &str, text: &str) -> PyErr {
    let made = class(py, name).and_then(|class| class.call1((text,)));
    made.map_or_else(|error| error, PyErr::from_value)
}
