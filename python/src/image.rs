//! Rendered images.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::prelude::*;
use radiosity::render::display::Unwatched;
use radiosity::render::verify::{VerifyError, verify as verified};
use radiosity::render::{Attributes, DirectMethod, GatherSettings, RenderInput, RenderSettings, Samples, exr, png};
use radiosity::workflow::{CameraChoice, ViewRequest, image_byte, rendered};

use crate::call::Call;
use crate::error::{bad_argument, with_text};
use crate::model::{Shared, call};
use crate::options::Options;
use crate::solution::Solution;

#[pyclass(frozen, module = "radiosity._core")]
#[expect(
    clippy::struct_field_names,
    reason = "an image of the library, with what belongs to it"
)]
pub(crate) struct Image {
    pub(crate) image: radiosity::render::Image,
    pub(crate) attributes: Attributes,
    pub(crate) warnings: Vec<String>,
}

/// Takes the options of the view of an image.
pub(crate) fn view(options: &Options<'_>) -> PyResult<ViewRequest> {
    let vector = |name: &str| Ok::<_, PyErr>(options.take::<[f64; 3]>(name)?.map(DVec3::from_array));
    Ok(ViewRequest {
        camera: match options.take::<PathBuf>("camera")? {
            None => CameraChoice::OfScene,
            Some(name) => CameraChoice::of_list(std::path::Path::new(""), &name),
        },
        eye: vector("eye")?,
        look_at: vector("look_at")?,
        up: vector("up")?,
        fov: options.take("fov")?,
        width: options.take("width")?,
        height: options.take("height")?,
    })
}

/// The settings of an image, for any view.
pub(crate) struct Wanted {
    flat: bool,
    direct: Option<DirectMethod>,
    samples: Option<NonZeroU32>,
    gather: Option<GatherSettings>,
    seed: u64,
}

impl Wanted {
    /// Takes the options of an image; with `is_own`, its light can only be shown patch by patch.
    pub(crate) fn of(py: Python<'_>, options: &Options<'_>, is_own: bool) -> PyResult<Self> {
        let flat = options.take::<bool>("flat")?;
        if is_own && flat == Some(false) {
            let text = "flat: a solution for reflectances or exitances of single patches is shown patch by patch; leave it out";
            return Err(bad_argument(py, text));
        }
        let flat = flat.unwrap_or(is_own);
        let rays = DirectMethod::CosineRays { n: DirectMethod::RAYS };
        let polygons = DirectMethod::Polygons {
            n: DirectMethod::SHADOW_RAYS,
        };
        let known = [
            ("off", DirectMethod::Off),
            ("rays", rays),
            ("polygons", polygons),
            ("exact", DirectMethod::Exact),
        ];
        let direct = options.choice("direct", &known)?;
        if flat && direct.is_some_and(|direct| direct != DirectMethod::Off) {
            return Err(bad_argument(py, "direct: not along with flat=True"));
        }
        let noise = options.positive("noise")?;
        let final_gather = options.take::<bool>("final_gather")?.unwrap_or(noise.is_some());
        let default = GatherSettings::default();
        Ok(Self {
            flat,
            direct,
            samples: options.take::<u32>("samples")?.and_then(NonZeroU32::new),
            gather: final_gather.then_some(GatherSettings {
                noise: noise.unwrap_or(default.noise),
                ..default
            }),
            seed: options.take("seed")?.unwrap_or(0),
        })
    }

    /// Returns the settings for a view of light without a direct part.
    pub(crate) fn settings_without_direct(&self, is_unfolded: bool) -> RenderSettings {
        RenderSettings {
            direct: DirectMethod::Off,
            ..self.settings(is_unfolded)
        }
    }

    /// Returns the settings for a view.
    pub(crate) fn settings(&self, is_unfolded: bool) -> RenderSettings {
        let suited = || DirectMethod::suited(is_unfolded, self.flat);
        RenderSettings {
            flat: self.flat,
            samples: self.samples.unwrap_or(RenderSettings::default_samples(is_unfolded)),
            adaptive: true,
            gather: self.gather,
            direct: self.direct.unwrap_or_else(suited),
            seed: self.seed,
            ..RenderSettings::default()
        }
    }
}

pub(crate) fn render(
    py: Python<'_>,
    shared: &Arc<Shared>,
    solution: &Solution,
    options: &Options<'_>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Image> {
    let n_channels = solution.study.solution.radiosity.n_channels();
    if ![1, 3].contains(&n_channels) {
        let text =
            format!("solution: it has {n_channels} channels, and an image shows one or three; solve for one lighting");
        return Err(bad_argument(py, &text));
    }
    let request = view(options)?;
    let settings = Wanted::of(py, options, solution.is_own)?.settings(request.is_unfolded());
    options.finish()?;
    let call = Call {
        ..call(progress, &solution.settings)
    };
    let done = call.run(py, |cx| {
        let mut model = shared.lock();
        let file = model.file.clone();
        let view = request.view(&file, &model.scene)?;
        image_byte(view.as_view(), &settings, &cx.memory)?;
        view.note_left_out(&mut model, cx);
        let (study, factors) = (&solution.study, &solution.factors.study.factors);
        let indirect = (settings.direct != DirectMethod::Off).then(|| {
            study
                .direct
                .indirect_irradiance(factors, &solution.exitance, &study.solution)
        });
        let input = RenderInput {
            scene: &model.scene,
            mesh: &model.mesh,
            visibility: &model.visibility,
            radiosity: &study.solution.radiosity,
            irradiance: &study.solution.irradiance,
            indirect_irradiance: indirect.as_ref(),
            error: study.carried.as_ref(),
            outdoors: solution.daylight.outdoors(),
        };
        let camera = view.origin().map(|origin| origin.text(&cx.naming));
        rendered(&input, (view.as_view(), camera.as_deref()), settings, &Unwatched, cx)
    })?;
    let (image, attributes) = done.value;
    Ok(Image {
        image,
        attributes,
        warnings: done.warnings,
    })
}

/// Checks an image against the analytic answer of its scene; returns the report as the program prints it.
#[pyfunction]
pub(crate) fn verify(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let found = py.detach(|| verified(&path)).map_err(|error| match error {
        // Errors of reading name the file themselves.
        VerifyError::Read(_) => with_text(py, "RenderError", &error.to_string()),
        _ => with_text(py, "RenderError", &format!("{}: {error}", path.display())),
    })?;
    Ok(serde_json::to_string(&found).unwrap_or_default())
}

#[pymethods]
impl Image {
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.image.width(), self.image.height())
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.image.layers().iter().map(|layer| layer.name.clone()).collect()
    }

    /// Returns a layer of floats, \[h, w\]; `None` for one of another kind.
    fn floats<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let samples = self.image.f32(name);
        let size = [self.image.height(), self.image.width()];
        samples
            .map(|samples| PyArray1::from_slice(py, samples).reshape(size))
            .transpose()
    }

    /// Returns a layer of ids, \[h, w\]; `None` for one of another kind. Background has the greatest number.
    fn ids<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyArray2<u32>>>> {
        let layer = self.image.layers().iter().find(|layer| layer.name == name);
        let size = [self.image.height(), self.image.width()];
        match layer.map(|layer| &layer.samples) {
            Some(Samples::U32(samples)) => PyArray1::from_slice(py, samples).reshape(size).map(Some),
            _ => Ok(None),
        }
    }

    /// Writes an OpenEXR file with all layers, or a PNG file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let ending = ending.to_ascii_lowercase();
        if !["exr", "png"].contains(&&*ending) {
            return Err(bad_argument(py, "path: an image is written as .exr or .png"));
        }
        Call::default().run(py, |_| {
            match &*ending {
                "exr" => exr::write(&path, &self.image, &self.attributes)?,
                _ => png::write(&path, &self.image)?,
            }
            Ok(())
        })?;
        Ok(())
    }
}
