//! Light on voxels.

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use radiosity::document::VoxelDocument;
use radiosity::report::voxels::write_vtu;
use radiosity::voxel::{Form, RowWeights, SolidAngle, Surfel};
use radiosity::workflow::{
    LinkPlace, Settings, SolveRequest, VoxelImageRequest, VoxelLight, VoxelRequest, VoxelStudy, image_byte,
};

use crate::arrays::{Numbers, array, table};
use crate::call::Call;
use crate::error::bad_argument;
use crate::image::{Image, Wanted, view};
use crate::model::{Shared, call};
use crate::options::Options;

#[pyclass(frozen, module = "radiosity._core")]
pub(crate) struct VoxelSolution {
    study: VoxelStudy,
    request: VoxelRequest,
    shared: Arc<Shared>,
    settings: Settings,
    warnings: Vec<String>,
}

/// Takes the method that finds light.
fn light(py: Python<'_>, options: &Options<'_>) -> PyResult<VoxelLight> {
    let forms = [("jacobi", Form::Jacobi), ("in-place", Form::InPlace)];
    let (passes, form) = (options.count("passes")?, options.choice("form", &forms)?);
    let (cells, coarsest) = (options.positive("adaptive")?, options.take::<u8>("coarsest")?);
    let (solver, tolerance) = (options.take::<String>("solver")?, options.take::<f64>("tolerance")?);
    let n_passes = passes.map_or(VoxelRequest::PASSES, std::num::NonZero::get);
    let wrong = |text: &str| Err(bad_argument(py, text));
    if solver.is_none() && tolerance.is_some() {
        return wrong("tolerance: only along with a solver");
    }
    if cells.is_none() && coarsest.is_some() {
        return wrong("coarsest: only along with adaptive");
    }
    match (cells, solver) {
        (Some(_), Some(_)) => wrong("solver: not along with adaptive"),
        (Some(_), None) if form.is_some() => wrong("form: not along with adaptive"),
        (Some(change), None) => Ok(VoxelLight::Cells {
            passes: n_passes,
            tolerance: change,
            coarsest: match coarsest {
                Some(7..) => return wrong("coarsest: 2^L voxels, with L up to 6"),
                known => known.unwrap_or(VoxelRequest::COARSEST),
            },
        }),
        (None, Some(_)) if passes.is_some() || form.is_some() => {
            wrong("passes, form: of propagations, not along with a solver")
        }
        (None, Some(name)) => {
            let tolerance = tolerance.unwrap_or(SolveRequest::TOLERANCE);
            if !SolveRequest::TOLERANCES.contains(&tolerance) {
                return wrong(&format!("tolerance: {tolerance} is outside [1e-300, 1)"));
            }
            Ok(VoxelLight::Solver { name, tolerance })
        }
        (None, None) => Ok(VoxelLight::Propagations {
            passes: n_passes,
            form: form.unwrap_or_default(),
        }),
    }
}

fn request(py: Python<'_>, options: &Options<'_>, shared: &Shared) -> PyResult<VoxelRequest> {
    let light = light(py, options)?;
    let link_file = options.take::<PathBuf>("link_file")?;
    let places = [
        (
            "auto",
            LinkPlace::Auto {
                has_file: link_file.is_some(),
            },
        ),
        ("memory", LinkPlace::Memory),
        ("disk", LinkPlace::Disk),
        ("recompute", LinkPlace::Recompute),
    ];
    let place = options.choice("links", &places)?;
    if matches!(light, VoxelLight::Cells { .. }) && (place.is_some() || link_file.is_some()) {
        return Err(bad_argument(py, "links, link_file: not along with adaptive"));
    }
    if link_file.is_some() && matches!(place, Some(LinkPlace::Memory | LinkPlace::Recompute)) {
        return Err(bad_argument(
            py,
            "link_file: for links on a disk; leave it out, or links",
        ));
    }
    Ok(VoxelRequest {
        n_voxels: options.take("n")?.unwrap_or(VoxelRequest::VOXELS),
        radius: options.take("radius")?.unwrap_or(VoxelRequest::RADIUS),
        solid_angle: if options.take("exact_solid_angles")?.unwrap_or(false) {
            SolidAngle::Exact
        } else {
            SolidAngle::Centre
        },
        row_weights: if options.take("unnormalised")?.unwrap_or(false) {
            RowWeights::Plain
        } else {
            RowWeights::Normalised
        },
        plain_emission: options.take("plain_emission")?.unwrap_or(false),
        light,
        links: place.unwrap_or(places[0].1),
        link_file: link_file.unwrap_or_else(|| shared.lock().file.with_extension("links")),
        closure: options.closure()?,
        is_written: true,
        is_shown: true,
    })
}

pub(crate) fn solve(
    py: Python<'_>,
    shared: &Arc<Shared>,
    options: &Options<'_>,
    progress: Option<Py<PyAny>>,
) -> PyResult<VoxelSolution> {
    let (request, memory) = (request(py, options, shared)?, options.memory()?);
    options.finish()?;
    let call = Call {
        memory,
        ..call(progress, &shared.settings)
    };
    let done = call.run(py, |cx| shared.lock().solve_on_voxels(&request, cx))?;
    Ok(VoxelSolution {
        study: done.value,
        request,
        shared: Arc::clone(shared),
        settings: done.settings,
        warnings: done.warnings,
    })
}

impl VoxelSolution {
    /// Returns three numbers of each surfel, \[n, 3\].
    fn vectors<'py>(&self, py: Python<'py>, of: impl Fn(&Surfel) -> DVec3) -> PyResult<Numbers<'py>> {
        let surfels = self.study.voxels.surfels.iter();
        table(py, surfels.flat_map(|surfel| of(surfel).to_array()).collect(), 3)
    }
}

#[pymethods]
impl VoxelSolution {
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Returns voxels, links and surfaces, as the program prints them.
    #[getter]
    fn record(&self) -> String {
        let model = self.shared.lock();
        let document = VoxelDocument::new(&model.scene, &self.request, &self.study, None);
        serde_json::to_string(&document).unwrap_or_default()
    }

    /// Returns the centres of the surfels' voxels, \[n, 3\].
    #[getter]
    fn centre<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        let grid = &self.study.voxels.grid;
        self.vectors(py, |surfel| grid.centre(surfel.voxel()))
    }

    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        let normals = &self.study.voxels.normals;
        self.vectors(py, |surfel| normals[surfel.normal as usize].unit)
    }

    #[getter]
    fn area<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let surfels = self.study.voxels.surfels.iter();
        PyArray1::from_vec(py, surfels.map(|surfel| surfel.area).collect())
    }

    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let model = self.shared.lock();
        let surfels = self.study.voxels.surfels.iter();
        let surfaces = surfels.map(|surfel| i64::from(model.scene.faces[surfel.face.0 as usize].surface.0));
        PyArray1::from_vec(py, surfaces.collect())
    }

    #[getter]
    fn radiosity<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        array(py, &self.study.radiosity)
    }

    #[getter]
    fn irradiance<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        array(py, &self.study.irradiance)
    }

    /// Renders the surfaces that the voxels represent, or the voxels themselves.
    fn render(&self, py: Python<'_>, options: &Bound<'_, PyDict>, progress: Option<Py<PyAny>>) -> PyResult<Image> {
        let options = Options::new(options)?;
        let seen = view(&options)?;
        let show_voxels = options.take("show_voxels")?.unwrap_or(false);
        let settings = Wanted::of(py, &options, false)?.settings_without_direct(seen.is_unfolded());
        options.finish()?;
        let done = call(progress, &self.settings).run(py, |cx| {
            let mut model = self.shared.lock();
            let view = seen.view(&model.file, &model.scene)?;
            image_byte(view.as_view(), &settings, &cx.memory)?;
            view.note_left_out(&mut model, cx);
            let request = VoxelImageRequest {
                view: &view,
                settings,
                show_voxels,
            };
            model.render_voxels(&self.study, request, cx)
        })?;
        let (image, attributes) = done.value;
        Ok(Image {
            image,
            attributes,
            warnings: done.warnings,
        })
    }

    /// Writes the voxels as VTK's `.vtu`.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        if path
            .extension()
            .is_none_or(|ending| !ending.eq_ignore_ascii_case("vtu"))
        {
            return Err(bad_argument(
                py,
                "path: voxels are written as .vtu; render() makes an image",
            ));
        }
        let call = Call {
            settings: self.settings.clone(),
            ..Call::default()
        };
        call.run(py, |cx| {
            let model = self.shared.lock();
            let (radiosity, irradiance) = (&self.study.radiosity, &self.study.irradiance);
            let record = cx.settings.record();
            Ok(write_vtu(
                &path,
                &model.scene,
                &self.study.voxels,
                radiosity,
                irradiance,
                &record,
            )?)
        })?;
        Ok(())
    }
}
