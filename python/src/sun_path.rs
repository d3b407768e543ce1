//! Light and heat along a path of the sun.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use numpy::ndarray::IxDyn;
use numpy::{PyArray, PyArray1, PyArrayMethods as _, PyReadonlyArray2, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use radiosity::document::PathDocument;
use radiosity::heat::{Boundary, SunPath, SunPlace};
use radiosity::report::series::{SeriesBlock, SeriesQuantity};
use radiosity::report::sun_path;
use radiosity::workflow::{BlockSink, Context, Demand, Model, SkyRequest, SolveRequest, WorkflowError};

use crate::call::Call;
use crate::error::{bad_argument, raised};
use crate::factors::{FormFactors, Study};
use crate::heat::{Given, lit, read};
use crate::model::{Shared, call};
use crate::options::Options;

/// Times, times as texts, the document as the program prints it, and the quantities of the patches; those that vary have a first axis for the times.
pub(crate) type Along<'py> = (
    Bound<'py, PyArray1<f64>>,
    Vec<String>,
    String,
    Vec<(String, Bound<'py, PyArray<f64, IxDyn>>)>,
);

/// A table of the sun's positions: a file, or rows of time, x, y, z and irradiance.
pub(crate) type Table<'py> = (Option<PathBuf>, Option<PyReadonlyArray2<'py, f64>>);

/// The results along a path.
struct Work<'a> {
    study: &'a Study,
    path: &'a SunPath,
    boundary: Option<&'a Boundary>,
    sky: Option<SkyRequest>,
    request: &'a SolveRequest,
}

pub(crate) fn along<'py>(
    py: Python<'py>,
    (shared, factors): (&Arc<Shared>, &FormFactors),
    table: Table<'py>,
    boundary: Option<Given>,
    options: &Options<'py>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Along<'py>> {
    let boundary = boundary
        .map(|text| lit(py, read(py, shared, text)?, options))
        .transpose()?;
    let up = boundary
        .as_ref()
        .and_then(|own| own.sky)
        .map_or(DVec3::Z, |sky| sky.up());
    let sky = if boundary.is_none() { options.sky(up)? } else { None };
    let path = path_of(py, table, options, up)?;
    let request = options.solver()?;
    let checkpoint = options.take::<PathBuf>("checkpoint")?;
    options.finish()?;
    let call = Call {
        checkpoint,
        demand: Demand {
            tolerance: Some(request.tolerance),
            ..Demand::default()
        },
        ..call(progress, &factors.of.settings)
    };
    let work = Work {
        study: &factors.of,
        path: &path,
        boundary: boundary.as_ref(),
        sky,
        request: &request,
    };
    let done = call.run(py, |cx| work.done(&mut shared.lock(), cx))?;
    let (document, values) = done.value;
    let k = path.steps.len();
    let n = values.n_patches;
    let array_of = |own: SeriesQuantity, first: Option<usize>| {
        let shape: Vec<usize> = first.into_iter().chain([n]).chain(own.channels).collect();
        let array = PyArray1::from_vec(py, own.values).reshape(IxDyn(&shape))?;
        Ok((own.name, array))
    };
    let changing = values.all.quantities.into_iter().map(|own| array_of(own, Some(k)));
    let constant = values.all.constants.into_iter().map(|own| array_of(own, None));
    let arrays: PyResult<Vec<_>> = changing.chain(constant).collect();
    Ok((PyArray1::from_vec(py, path.times()), path.texts(), document, arrays?))
}

fn path_of(py: Python<'_>, (file, rows): Table<'_>, options: &Options<'_>, up: DVec3) -> PyResult<SunPath> {
    let radius = options.take("angular_radius")?.unwrap_or(0.0);
    let north: [f64; 3] = options.take("north")?.unwrap_or([0.0, 1.0, 0.0]);
    let axes = [DVec3::from_array(north), up];
    if let Some(file) = file {
        return sun_path::read(&file, radius, axes).map_err(|error| raised(py, &WorkflowError::Report(error)));
    }
    let mut path = SunPath::new(Path::new("sun_path"), radius, axes);
    let Some(rows) = rows.filter(|rows| rows.shape()[1] == 5 && rows.shape()[0] > 0) else {
        let text = "sun_path: expected rows of time, x, y, z and irradiance, or a file";
        return Err(bad_argument(py, text));
    };
    for (k, row) in rows.as_array().rows().into_iter().enumerate() {
        let place = SunPlace::Direction(DVec3::new(row[1], row[2], row[3]));
        path.push(k, &format!("{:?}", row[0]), place, row[4])
            .map_err(|(key, wrong)| match key {
                "angular_radius_deg" => bad_argument(py, &format!("angular_radius: {wrong}")),
                _ => bad_argument(py, &format!("sun_path: row {k}: {key}: {wrong}")),
            })?;
    }
    Ok(path)
}

/// The values of all patches at all times.
#[derive(Default)]
struct Values {
    n_patches: usize,
    all: SeriesBlock,
}

impl Values {
    fn take(&mut self, block: &SeriesBlock) {
        if self.all.quantities.is_empty() {
            self.all = block.clone();
            return;
        }
        for (own, more) in self.all.quantities.iter_mut().zip(&block.quantities) {
            own.values.extend_from_slice(&more.values);
        }
    }
}

impl Work<'_> {
    /// Returns the document and the values of the patches.
    fn done(&self, model: &mut Model, cx: &mut Context) -> Result<(String, Values), WorkflowError> {
        let mut values = Values {
            n_patches: model.mesh.n_patches(),
            ..Values::default()
        };
        let mut sink = |block: &SeriesBlock| {
            values.take(block);
            Ok(())
        };
        let sink: Option<BlockSink<'_>> = Some(&mut sink);
        let study = &self.study.study;
        let text = if let Some(boundary) = self.boundary {
            let found = model.heat_along_sun_path(study, (self.path, boundary), self.request, sink, cx)?;
            serde_json::to_string(&PathDocument::new(model, study, self.path, found))
        } else {
            let found = model.solve_along_sun_path(study, (self.path, self.sky), self.request, sink, cx)?;
            serde_json::to_string(&PathDocument::new(model, study, self.path, found))
        };
        Ok((text.unwrap_or_default(), values))
    }
}
