//! Solutions of the radiosity system.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use radiosity::document::SolverRecord;
use radiosity::matrix::operator::Block;
use radiosity::workflow::{Daylight, Settings, SolutionStudy};

use crate::arrays::{Numbers, array, table};
use crate::call::Call;
use crate::factors::Study;

#[pyclass(frozen, module = "radiosity._core")]
pub(crate) struct Solution {
    pub(crate) study: SolutionStudy,
    pub(crate) reflectance: Block,
    pub(crate) exitance: Block,
    pub(crate) factors: Arc<Study>,
    /// The name of the requested solver.
    pub(crate) solver: String,
    /// True if reflectance and exitance are not those of the scene.
    pub(crate) is_own: bool,
    /// Sun and sky, as far as they shine.
    pub(crate) daylight: Daylight,
    pub(crate) settings: Settings,
    pub(crate) warnings: Vec<String>,
}

#[pymethods]
impl Solution {
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    #[getter]
    fn settings(&self) -> String {
        serde_json::Value::from(self.settings.record()).to_string()
    }

    #[getter]
    fn is_own(&self) -> bool {
        self.is_own
    }

    #[getter]
    fn radiosity<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        array(py, &self.study.solution.radiosity)
    }

    #[getter]
    fn irradiance<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        array(py, &self.study.solution.irradiance)
    }

    #[getter]
    fn reflectance<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        array(py, &self.reflectance)
    }

    #[getter]
    fn exitance<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        array(py, &self.exitance)
    }

    /// Returns the error of the radiosity by form factors, without that of the solver.
    #[getter]
    fn error<'py>(&self, py: Python<'py>) -> PyResult<Option<Numbers<'py>>> {
        self.study.carried.as_ref().map(|error| array(py, error)).transpose()
    }

    /// Returns the report of the solver, as the program prints it.
    #[getter]
    fn record(&self) -> String {
        let model = self.factors.model.lock();
        let record = SolverRecord::new(&model, &self.solver, &self.study.solution, self.study.error);
        serde_json::to_string(&record).unwrap_or_default()
    }

    /// Returns the flows of power of each channel, as the program prints them.
    #[getter]
    fn energy(&self) -> String {
        serde_json::to_string(&self.study.solution.energy).unwrap_or_default()
    }

    /// Returns the change by a coarser mesh, as the program prints it.
    #[getter]
    fn mesh_error(&self) -> String {
        serde_json::to_string(&self.study.mesh_error).unwrap_or_default()
    }

    /// Returns the area mean of the radiosity of each surface, \[s, c\].
    fn surface_means<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        let radiosity = &self.study.solution.radiosity;
        let means = self.factors.model.lock().surface_means(radiosity);
        table(py, means.concat(), radiosity.n_channels())
    }

    /// Returns the lit fraction of each patch with its error, and the irradiance straight from the sun with its error, \[n, c\].
    #[expect(clippy::type_complexity, reason = "four arrays")]
    fn sunlit<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<
        Option<(
            Bound<'py, PyArray1<f64>>,
            Bound<'py, PyArray1<f64>>,
            Numbers<'py>,
            Numbers<'py>,
        )>,
    > {
        let Some(sunlit) = &self.study.direct.sun else {
            return Ok(None);
        };
        Ok(Some((
            PyArray1::from_slice(py, &sunlit.light.fraction),
            PyArray1::from_slice(py, &sunlit.light.fraction_error),
            array(py, &sunlit.irradiance)?,
            array(py, &sunlit.error)?,
        )))
    }

    /// Writes a file, in the format of its ending.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let call = Call {
            settings: self.settings.clone(),
            ..Call::default()
        };
        call.run(py, |cx| {
            let model = self.factors.model.lock();
            let materials = (&self.reflectance, &self.exitance);
            model.write_solution(&path, Some(&self.factors.study), materials, &self.study, cx)
        })?;
        Ok(())
    }
}
