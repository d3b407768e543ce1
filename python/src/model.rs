//! A scene with its patches.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::DVec3;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use radiosity::heat::{PointQuery, PointView, Stated};
use radiosity::mesh::{Mesh, MeshOptions};
use radiosity::report::form_factors::FormFactorFile;
use radiosity::scene::{Arrays, Scene};
use radiosity::workflow::{
    self, Afterwards, Context, Daylight, Demand, Settings, Use, WorkflowError, load, load_arrays, mesh_options,
};

use crate::arrays::{Numbers, block, table, triples};
use crate::call::Call;
use crate::error::bad_argument;
use crate::factors::{FormFactors, Study};
use crate::heat::{Given, Heat};
use crate::image::Image;
use crate::options::Options;
use crate::solution::Solution;
use crate::sun_path::{Along, Table};
use crate::voxels::VoxelSolution;

/// A model that calls share, one at a time.
pub(crate) struct Shared {
    model: Mutex<workflow::Model>,
    /// The settings of results from it.
    pub(crate) settings: Settings,
}

impl Shared {
    pub(crate) fn lock(&self) -> MutexGuard<'_, workflow::Model> {
        self.model.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pyclass(frozen, module = "radiosity._core")]
pub(crate) struct Model {
    pub(crate) shared: Arc<Shared>,
}

/// Returns the context of a call about a model.
pub(crate) fn call(progress: Option<Py<PyAny>>, settings: &Settings) -> Call {
    Call {
        progress,
        settings: settings.clone(),
        ..Call::default()
    }
}

fn made(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    options: MeshOptions,
    name: &str,
    scene: impl FnOnce(&Context) -> Result<Scene, WorkflowError> + Send + 'static,
) -> PyResult<Model> {
    let name = name.to_owned();
    let done = call(progress, &Settings::default()).run_apart(py, move |cx| {
        let scene = scene(cx)?;
        cx.settings.note_mesh(options);
        workflow::Model::new(scene, &name, options, Use::Light, cx)
    })?;
    let shared = Shared {
        model: Mutex::new(done.value),
        settings: done.settings,
    };
    Ok(Model {
        shared: Arc::new(shared),
    })
}

#[pymethods]
impl Model {
    /// Makes a model from arrays.
    ///
    /// `ends` are the ends of the corners of each face; `names` are those of the surfaces, none to divide faces at creases.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "one for each array")]
    fn from_arrays(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        corners: PyReadonlyArray1<'_, u32>,
        ends: PyReadonlyArray1<'_, u64>,
        names: Vec<String>,
        surfaces: PyReadonlyArray1<'_, u32>,
        reflectance: PyReadonlyArray2<'_, f64>,
        exitance: PyReadonlyArray2<'_, f64>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let options = Options::new(options)?;
        let (reading, mesh) = (options.reading()?, options.mesh()?);
        options.finish()?;
        let vertices = triples(py, "vertices", &vertices)?;
        let (reflectance, exitance) = (
            triples(py, "reflectance", &reflectance)?,
            triples(py, "exitance", &exitance)?,
        );
        let ends: Vec<usize> = ends
            .as_array()
            .iter()
            .map(|&end| usize::try_from(end).unwrap_or(usize::MAX))
            .collect();
        let (corners, surfaces) = (corners.as_array().to_vec(), surfaces.as_array().to_vec());
        made(py, progress, mesh, "scene", move |cx| {
            let arrays = Arrays {
                vertices: &vertices,
                corners: &corners,
                ends: &ends,
                surface_names: &names,
                surfaces: &surfaces,
                reflectance: &reflectance,
                exitance: &exitance,
            };
            load_arrays(&arrays, &reading, cx, |_| false)
        })
    }

    /// Reads a model from a scene file of any format.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, options: &Bound<'_, PyDict>, progress: Option<Py<PyAny>>) -> PyResult<Self> {
        let options = Options::new(options)?;
        let (reading, mesh) = (options.reading()?, options.mesh()?);
        options.finish()?;
        let name = path.to_string_lossy().into_owned();
        made(py, progress, mesh, &name, move |cx| {
            load(&path, &reading, cx, |_| false)
        })
    }

    /// Makes a model of a built-in scene.
    #[staticmethod]
    fn builtin(
        py: Python<'_>,
        name: &str,
        level: Option<u32>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let options = Options::new(options)?;
        let mesh = options.mesh()?;
        options.finish()?;
        let of_scene = name.to_owned();
        made(py, progress, mesh, name, move |_| {
            Ok(radiosity::scene::builtin::build(&of_scene, level)?.scene)
        })
    }

    #[getter]
    fn n_patches(&self) -> usize {
        self.shared.lock().mesh.n_patches()
    }

    #[getter]
    fn surface_names(&self) -> Vec<String> {
        let model = self.shared.lock();
        model
            .scene
            .surfaces
            .iter()
            .map(|surface| surface.name.clone())
            .collect()
    }

    #[getter]
    fn surface_area<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.shared.lock().surface_areas())
    }

    #[getter]
    fn patch_area<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.shared.lock().mesh.areas())
    }

    #[getter]
    fn patch_surface<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let model = self.shared.lock();
        let surfaces = model.mesh.patches.iter().map(|patch| i64::from(patch.surface.0));
        PyArray1::from_vec(py, surfaces.collect())
    }

    /// Returns centroids and normals of the patches, \[n, 3\] each.
    #[getter]
    fn patch_frame<'py>(&self, py: Python<'py>) -> PyResult<(Numbers<'py>, Numbers<'py>)> {
        let model = self.shared.lock();
        let column = |of: fn(&radiosity::mesh::Patch) -> DVec3| {
            let patches = model.mesh.patches.iter();
            patches.flat_map(|patch| of(patch).to_array()).collect::<Vec<f64>>()
        };
        let (centroids, normals) = (column(|patch| patch.centroid), column(|patch| patch.normal));
        Ok((table(py, centroids, 3)?, table(py, normals, 3)?))
    }

    /// Returns vertices \[v, 3\], the corners of all patches one after another, and the end of the corners of each.
    #[expect(clippy::type_complexity, reason = "three arrays")]
    fn geometry<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Numbers<'py>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>)> {
        let model = self.shared.lock();
        let Mesh { vertices, patches, .. } = &model.mesh;
        let vertices = vertices.iter().flat_map(DVec3::to_array).collect();
        let corners = patches.iter().flat_map(|patch| patch.corners.as_slice());
        let corners = corners.map(|&corner| i64::from(corner)).collect();
        let mut end = 0_i64;
        let ends = patches.iter().map(|patch| {
            end += i64::try_from(patch.corners.as_slice().len()).unwrap_or(0);
            end
        });
        let ends = ends.collect();
        Ok((
            table(py, vertices, 3)?,
            PyArray1::from_vec(py, corners),
            PyArray1::from_vec(py, ends),
        ))
    }

    /// Returns ρ and E of the patches, \[n, c\].
    fn materials<'py>(&self, py: Python<'py>) -> PyResult<(Numbers<'py>, Numbers<'py>)> {
        let (reflectance, exitance) = self.shared.lock().materials();
        Ok((
            crate::arrays::array(py, &reflectance)?,
            crate::arrays::array(py, &exitance)?,
        ))
    }

    /// Computes form factors.
    fn form_factors(
        &self,
        py: Python<'_>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<FormFactors> {
        let options = Options::new(options)?;
        let (request, memory) = (options.form_factors(Afterwards::Nothing)?, options.memory()?);
        let checkpoint = options.take("checkpoint")?;
        options.finish()?;
        let call = Call {
            memory,
            checkpoint,
            ..call(progress, &self.shared.settings)
        };
        let shared = &self.shared;
        let done = call.run(py, |cx| {
            let mut model = shared.lock();
            // Errors and reciprocity fit the solvers, so the same form factors serve all later steps.
            let study = model.form_factors(&request, radiosity::matrix::Need::Light { gains: true }, cx)?;
            cx.judge_leaking_exchange();
            Ok(study)
        })?;
        Ok(FormFactors::new(Study {
            study: done.value,
            model: Arc::clone(shared),
            settings: done.settings,
            warnings: done.warnings,
        }))
    }

    /// Reads form factors of these patches from a file.
    fn load_form_factors(
        &self,
        py: Python<'_>,
        path: PathBuf,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<FormFactors> {
        let options = Options::new(options)?;
        let (request, memory) = (options.form_factors(Afterwards::Nothing)?, options.memory()?);
        options.finish()?;
        let call = Call {
            memory,
            ..call(progress, &self.shared.settings)
        };
        let shared = &self.shared;
        let done = call.run(py, |cx| {
            let file = FormFactorFile::open(&path)?;
            let mut model = shared.lock();
            mesh_options(
                &file,
                Some(model.options.subdivision),
                !model.options.cut_at_walls,
                model.options,
            )?;
            model.form_factors_of(&file, &request, radiosity::matrix::Need::Light { gains: true }, cx)
        })?;
        Ok(FormFactors::new(Study {
            study: done.value,
            model: Arc::clone(shared),
            settings: done.settings,
            warnings: done.warnings,
        }))
    }

    /// Solves for the light of the scene, or for given reflectances and exitances of the patches, \[n, c\].
    fn solve(
        &self,
        py: Python<'_>,
        factors: &FormFactors,
        materials: Option<(PyReadonlyArray2<'_, f64>, PyReadonlyArray2<'_, f64>)>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Solution> {
        let options = Options::new(options)?;
        let request = options.solver()?;
        let (sun, sky) = (options.sun(DVec3::Z)?, options.sky(DVec3::Z)?);
        options.finish()?;
        if materials.is_some() && (sun.is_some() || sky.is_some()) {
            return Err(bad_argument(
                py,
                "sun, sky: not along with reflectance or exitance of patches",
            ));
        }
        self.expect_own(py, factors)?;
        let n = self.n_patches();
        let materials = materials
            .map(|(rho, e)| Ok::<_, PyErr>((block(py, "reflectance", &rho, n)?, block(py, "exitance", &e, n)?)))
            .transpose()?;
        let call = Call {
            demand: Demand {
                tolerance: Some(request.tolerance),
                ..Demand::default()
            },
            ..call(progress, &factors.of.settings)
        };
        let (shared, of) = (&self.shared, &factors.of);
        let (is_own, daylight) = (materials.is_some(), Daylight { sun, sky });
        let done = call.run(py, |cx| {
            let mut model = shared.lock();
            if let Some((rho, e)) = materials {
                return Ok((model.solve_with(&of.study, (&rho, &e), &request, cx)?, rho, e));
            }
            let study = if daylight.shines() {
                model.solve_in_daylight(&of.study, &request, &daylight, cx)?
            } else {
                model.solve(&of.study, &request, cx)?
            };
            let (rho, e) = model.materials();
            Ok((study, rho, e))
        })?;
        let (study, reflectance, exitance) = done.value;
        Ok(Solution {
            study,
            reflectance,
            exitance,
            factors: Arc::clone(of),
            solver: request.solver,
            is_own,
            daylight,
            settings: done.settings,
            warnings: done.warnings,
        })
    }

    /// Renders a solution.
    fn render(
        &self,
        py: Python<'_>,
        solution: &Solution,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Image> {
        if !Arc::ptr_eq(&self.shared, &solution.factors.model) {
            return Err(bad_argument(py, "solution: it is of another model"));
        }
        crate::image::render(py, &self.shared, solution, &Options::new(options)?, progress)
    }

    /// Renders the form factor from every visible point to a surface; returns it with the means of the surfaces.
    fn field(
        &self,
        py: Python<'_>,
        surface: u32,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Image, String)> {
        crate::field::field(py, &self.shared, surface, &Options::new(options)?, progress)
    }

    /// Renders a sequence of images into files; returns the document as the program prints it.
    fn render_frames(
        &self,
        py: Python<'_>,
        frames: (String, String),
        output: PathBuf,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<String> {
        let options = Options::new(options)?;
        crate::frames::render(py, &self.shared, frames, &output, &options, progress)
    }

    /// Solves for light on voxels.
    fn voxels(
        &self,
        py: Python<'_>,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<VoxelSolution> {
        crate::voxels::solve(py, &self.shared, &Options::new(options)?, progress)
    }

    /// Computes temperatures and net fluxes; `boundary` has its entries in TOML with their names for messages.
    fn heat(
        &self,
        py: Python<'_>,
        factors: &FormFactors,
        boundary: Given,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Heat> {
        self.expect_own(py, factors)?;
        crate::heat::heat(py, &self.shared, factors, boundary, &Options::new(options)?, progress)
    }

    /// Computes light, or with `boundary` heat, at every time of a path of the sun.
    fn along_sun_path<'py>(
        &self,
        py: Python<'py>,
        factors: &FormFactors,
        table: Table<'py>,
        boundary: Option<Given>,
        options: &Bound<'py, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Along<'py>> {
        self.expect_own(py, factors)?;
        let options = Options::new(options)?;
        crate::sun_path::along(py, (&self.shared, factors), table, boundary, &options, progress)
    }

    /// Returns Gebhart factors and conductors between the nodes of a thermal network, the surroundings last.
    #[expect(clippy::type_complexity, reason = "arrays with the names of their rows")]
    fn exchange_factors<'py>(
        &self,
        py: Python<'py>,
        factors: &FormFactors,
        boundary: Given,
        by_patches: bool,
        options: &Bound<'_, PyDict>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(
        Vec<String>,
        Bound<'py, PyArray1<f64>>,
        Numbers<'py>,
        Numbers<'py>,
        Numbers<'py>,
    )> {
        self.expect_own(py, factors)?;
        let options = Options::new(options)?;
        crate::heat::exchange_factors(py, (&self.shared, factors), boundary, by_patches, &options, progress)
    }

    /// Returns the views from free points.
    #[expect(clippy::type_complexity, reason = "columns by name")]
    fn points<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'_, f64>,
        normals: Option<PyReadonlyArray2<'_, f64>>,
        heat: Option<&Heat>,
        with_person: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(
        Numbers<'py>,
        Numbers<'py>,
        Vec<&'static str>,
        Vec<(&'static str, Bound<'py, PyArray1<f64>>)>,
    )> {
        let positions = triples(py, "xyz", &positions)?;
        let normals = normals.map(|normals| triples(py, "normals", &normals)).transpose()?;
        let query = |(k, position): (usize, [f64; 3])| PointQuery {
            position: DVec3::from_array(position),
            normal: normals.as_ref().map(|normals| DVec3::from_array(normals[k])),
        };
        let queries: Vec<PointQuery> = positions.into_iter().enumerate().map(query).collect();
        let shared = &self.shared;
        let done = call(progress, &shared.settings).run(py, |cx| {
            let known = heat.map(|heat| (&heat.study, &heat.boundary));
            shared.lock().points(&queries, known, with_person, cx)
        })?;
        let views = done.value;
        let n_surfaces = shared.lock().scene.surfaces.len();
        let of_surfaces = |of: fn(&Stated) -> f64| {
            let all = views.iter().flat_map(|view| &view.surfaces);
            table(py, all.map(of).collect(), n_surfaces)
        };
        let status = views.iter().map(|view| view.status.name()).collect();
        Ok((
            of_surfaces(|stated| stated.value)?,
            of_surfaces(|stated| stated.error)?,
            status,
            columns(&views)
                .into_iter()
                .map(|(name, values)| (name, PyArray1::from_vec(py, values)))
                .collect(),
        ))
    }
}

impl Model {
    fn expect_own(&self, py: Python<'_>, factors: &FormFactors) -> PyResult<()> {
        if Arc::ptr_eq(&self.shared, &factors.of.model) {
            return Ok(());
        }
        Err(bad_argument(py, "form_factors: they are of another model"))
    }
}

/// Returns the results of points besides those of surfaces, by name; NaN if unknown.
fn columns(views: &[PointView]) -> Vec<(&'static str, Vec<f64>)> {
    type Pick = fn(&PointView) -> Option<Stated>;
    let picks: [(&str, &str, Pick); 7] = [
        ("surroundings", "surroundings_error", |view| Some(view.surroundings)),
        ("backs", "backs_error", |view| Some(view.backs)),
        ("irradiance", "irradiance_error", |view| {
            view.heat.map(|heat| heat.irradiance)
        }),
        ("solar", "solar_error", |view| view.heat.map(|heat| heat.solar)),
        ("sun", "sun_error", |view| view.heat.map(|heat| heat.sun)),
        ("sunlit", "sunlit_error", |view| view.heat.and_then(|heat| heat.sunlit)),
        ("mean_radiant_temperature", "mean_radiant_temperature_error", |view| {
            view.heat.and_then(|heat| heat.mean_radiant)
        }),
    ];
    let column = |pick: Pick, of: fn(Stated) -> f64| {
        let values = views.iter().map(|view| pick(view).map_or(f64::NAN, of));
        values.collect::<Vec<f64>>()
    };
    picks
        .into_iter()
        .flat_map(|(name, error, pick)| {
            [
                (name, column(pick, |stated| stated.value)),
                (error, column(pick, |stated| stated.error)),
            ]
        })
        .collect()
}
