//! Temperatures and net fluxes.

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use numpy::PyArray1;
use pyo3::prelude::*;
use radiosity::document::HeatDocument;
use radiosity::heat::Boundary;
use radiosity::report::heat::HeatReport;
use radiosity::workflow::{Demand, ExchangeNodes, HeatStudy, Settings, SolveRequest, is_grey};

use crate::arrays::{Numbers, table};
use crate::call::Call;
use crate::error::{bad_argument, raised};
use crate::factors::{FormFactors, Study};
use crate::model::{Shared, call};
use crate::options::Options;

#[pyclass(frozen, module = "radiosity._core")]
pub(crate) struct Heat {
    pub(crate) study: HeatStudy,
    pub(crate) boundary: Boundary,
    factors: Arc<Study>,
    settings: Settings,
    warnings: Vec<String>,
}

/// The entries of boundary conditions, each with its name for messages and its text in TOML, and the name of the whole; without entries, that of their file.
pub(crate) type Given = (Option<Vec<(PathBuf, String)>>, String);

/// Reads boundary conditions.
pub(crate) fn read(py: Python<'_>, shared: &Shared, (parts, name): Given) -> PyResult<Boundary> {
    let model = shared.lock();
    let read = match parts {
        None => Boundary::load(&name, &model.scene),
        Some(parts) => Boundary::parse_parts(parts, name, &model.scene),
    };
    read.map_err(|error| raised(py, &error.into()))
}

/// Replaces sun and sky of the conditions by those of a call.
pub(crate) fn lit(py: Python<'_>, mut boundary: Boundary, options: &Options<'_>) -> PyResult<Boundary> {
    let up = boundary.sky.map_or(DVec3::Z, |sky| sky.up());
    if let Some(request) = options.sun(up)? {
        if !is_grey(request.irradiance) {
            return Err(bad_argument(
                py,
                "sun: irradiance: heat has one solar band; give one number",
            ));
        }
        boundary.sun = Some(request.sun);
    }
    if let Some(request) = options.sky(up)? {
        if !is_grey(request.irradiance) {
            return Err(bad_argument(py, "sky: heat has one solar band; give one number"));
        }
        boundary.sky = Some(request.sky);
    }
    Ok(boundary)
}

fn solver_call(progress: Option<Py<PyAny>>, factors: &FormFactors, request: &SolveRequest) -> Call {
    Call {
        demand: Demand {
            tolerance: Some(request.tolerance),
            ..Demand::default()
        },
        ..call(progress, &factors.of.settings)
    }
}

pub(crate) fn heat(
    py: Python<'_>,
    shared: &Arc<Shared>,
    factors: &FormFactors,
    boundary: Given,
    options: &Options<'_>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Heat> {
    let boundary = lit(py, read(py, shared, boundary)?, options)?;
    let request = options.solver()?;
    options.finish()?;
    let of = &factors.of;
    let conditions = &boundary;
    let done = solver_call(progress, factors, &request)
        .run(py, |cx| shared.lock().heat(&of.study, conditions, &request, cx))?;
    Ok(Heat {
        study: done.value,
        boundary,
        factors: Arc::clone(of),
        settings: done.settings,
        warnings: done.warnings,
    })
}

#[expect(clippy::type_complexity, reason = "arrays with the names of their rows")]
pub(crate) fn exchange_factors<'py>(
    py: Python<'py>,
    (shared, factors): (&Arc<Shared>, &FormFactors),
    boundary: Given,
    by_patches: bool,
    options: &Options<'_>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(
    Vec<String>,
    Bound<'py, PyArray1<f64>>,
    Numbers<'py>,
    Numbers<'py>,
    Numbers<'py>,
)> {
    let boundary = lit(py, read(py, shared, boundary)?, options)?;
    let request = options.solver()?;
    options.finish()?;
    let by = if by_patches {
        ExchangeNodes::Patches
    } else {
        ExchangeNodes::Surfaces
    };
    let done = solver_call(progress, factors, &request).run(py, |cx| {
        let mut model = shared.lock();
        model.exchange_factors(&factors.of.study, &boundary, by, &request, cx)
    })?;
    let found = done.value;
    let m = found.n_nodes();
    let conductances = found.conductance();
    Ok((
        found.names,
        PyArray1::from_vec(py, found.emissivity),
        table(py, found.gebhart, m)?,
        table(py, found.gebhart_error, m)?,
        table(py, conductances, m)?,
    ))
}

#[pymethods]
impl Heat {
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Returns surfaces, balance and quality, as the program prints them.
    #[getter]
    fn record(&self) -> String {
        let model = self.factors.model.lock();
        let document = HeatDocument::new(&model, &self.factors.study, &self.study);
        serde_json::to_string(&document).unwrap_or_default()
    }

    /// Returns the quantities of each patch, by name.
    fn patches<'py>(&self, py: Python<'py>) -> Vec<(&'static str, Bound<'py, PyArray1<f64>>)> {
        let columns = self.study.heat.patches.iter();
        columns
            .map(|(name, values)| (*name, PyArray1::from_slice(py, values)))
            .collect()
    }

    /// Writes a file, in the format of its ending.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let call = Call {
            settings: self.settings.clone(),
            ..Call::default()
        };
        call.run(py, |cx| {
            let model = self.factors.model.lock();
            let report = HeatReport {
                scene: &model.scene,
                mesh: &model.mesh,
                heat: &self.study.heat,
                settings: &cx.settings.record(),
            };
            Ok(report.write(&path)?)
        })?;
        Ok(())
    }
}
