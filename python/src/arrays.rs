//! Converts between NumPy's arrays and the library's blocks.

use numpy::{PyArray1, PyArray2, PyArrayMethods as _, PyReadonlyArray2, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use radiosity::matrix::operator::Block;

use crate::error::bad_argument;

/// An array of numbers, \[n, c\].
pub(crate) type Numbers<'py> = Bound<'py, PyArray2<f64>>;

/// Returns numbers, row by row, as an array of `n_columns` columns.
pub(crate) fn table(py: Python<'_>, values: Vec<f64>, n_columns: usize) -> PyResult<Numbers<'_>> {
    let n_rows = values.len().checked_div(n_columns).unwrap_or(0);
    PyArray1::from_vec(py, values).reshape([n_rows, n_columns])
}

/// Returns a block as an array.
pub(crate) fn array<'py>(py: Python<'py>, block: &Block) -> PyResult<Numbers<'py>> {
    table(py, block.values().to_vec(), block.n_channels())
}

/// Returns an array as a block of `n_rows` rows; errors call it `name`.
pub(crate) fn block(py: Python<'_>, name: &str, values: &PyReadonlyArray2<'_, f64>, n_rows: usize) -> PyResult<Block> {
    let &[found, n_channels] = values.shape() else {
        return Err(bad_argument(py, &format!("{name}: not two-dimensional")));
    };
    if found != n_rows || n_channels == 0 {
        let text = format!("{name}: shape ({found}, {n_channels}), where there are {n_rows} patches");
        return Err(bad_argument(py, &text));
    }
    Ok(Block::from_values(
        values.as_array().iter().copied().collect(),
        n_channels,
    ))
}

/// Returns rows of three numbers.
pub(crate) fn triples(py: Python<'_>, name: &str, values: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; 3]>> {
    if values.shape()[1] != 3 {
        return Err(bad_argument(py, &format!("{name}: not three numbers in each row")));
    }
    let rows = values.as_array();
    Ok(rows.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}
