//! The compiled part of the Python package `radiosity`: the typed calls of `radiosity::workflow` on NumPy's arrays.
//!
//! `radiosity/*.py` checks shapes and values, and has the documentation; nothing here is public by itself. As in the library, row i of a matrix of form factors is from patch i.

mod arrays;
mod call;
mod error;
mod factors;
mod field;
mod frames;
mod heat;
mod image;
mod model;
mod options;
mod solution;
mod sun_path;
mod voxels;

use pyo3::pymodule;

/// The compiled part of the package `radiosity`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::call::set_threads;
    #[pymodule_export]
    use crate::factors::FormFactors;
    #[pymodule_export]
    use crate::heat::Heat;
    #[pymodule_export]
    use crate::image::Image;
    #[pymodule_export]
    use crate::image::verify;
    #[pymodule_export]
    use crate::model::Model;
    #[pymodule_export]
    use crate::solution::Solution;
    #[pymodule_export]
    use crate::voxels::VoxelSolution;

    use pyo3::types::PyModuleMethods as _;
    use pyo3::{Bound, PyResult, types::PyModule};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
