//! Converts errors of the library to exceptions of the package, which `radiosity/_errors.py` defines.

use pyo3::prelude::*;
use radiosity::voxel::VoxelError;
use radiosity::workflow::WorkflowError;

/// Returns an exception or warning class of the package.
pub(crate) fn class<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("radiosity._errors")?.getattr(name)
}

/// Returns the exception of an error.
pub(crate) fn raised(py: Python<'_>, error: &WorkflowError) -> PyErr {
    with_text(py, name_of(error), &error.to_string())
}

fn name_of(error: &WorkflowError) -> &'static str {
    match error {
        WorkflowError::InFrame { error, .. } => name_of(error),
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
        WorkflowError::Report(_)
        | WorkflowError::OtherGeometry { .. }
        | WorkflowError::Checkpoint(_)
        | WorkflowError::Voxel(VoxelError::LinkFile { .. }) => "FileError",
        WorkflowError::Render(_) => "RenderError",
        WorkflowError::Heat { .. } | WorkflowError::AtTime { .. } => "HeatError",
        WorkflowError::Unsuited(_) | WorkflowError::Voxel(_) => "ArgumentError",
        _ => "RadiosityError",
    }
}

/// Returns the exception of a wrong argument.
pub(crate) fn bad_argument(py: Python<'_>, text: &str) -> PyErr {
    with_text(py, "ArgumentError", text)
}

/// Returns an exception of the package by its name.
pub(crate) fn with_text(py: Python<'_>, name: &str, text: &str) -> PyErr {
    let made = class(py, name).and_then(|class| class.call1((text,)));
    made.map_or_else(|error| error, PyErr::from_value)
}
