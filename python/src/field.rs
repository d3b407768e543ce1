//! Fields: the form factor from every visible point to a surface.

use std::num::NonZeroU32;
use std::sync::Arc;

use pyo3::prelude::*;
use radiosity::document::FieldSurface;
use radiosity::geometry::sampling::Sequence;
use radiosity::render::RenderSettings;
use radiosity::scene::SurfaceId;
use radiosity::workflow::{FieldMethod, FieldRequest};

use crate::error::bad_argument;
use crate::image::{Image, Wanted, view};
use crate::model::{Shared, call};
use crate::options::Options;

/// Renders a field to the surface of a given number; returns it with the means of the surfaces, as the program prints them.
pub(crate) fn field(
    py: Python<'_>,
    shared: &Arc<Shared>,
    surface: u32,
    options: &Options<'_>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Image, String)> {
    let methods = [FieldMethod::Exact, FieldMethod::Sr, FieldMethod::Qmc].map(|method| (method.name(), method));
    let method = options.choice("method", &methods)?.unwrap_or_default();
    let rays = options.count("rays")?.map(NonZeroU32::try_from).transpose();
    let rays = rays.map_err(|_| bad_argument(py, "rays: more than 65536"))?;
    let sequences = [Sequence::Sobol, Sequence::Random].map(|sequence| (sequence.name(), sequence));
    let sequence = options.choice("sequence", &sequences)?;
    if method == FieldMethod::Exact && (rays.is_some() || sequence.is_some()) {
        return Err(bad_argument(py, "rays, sequence: of sr and qmc; exact traces no rays"));
    }
    if rays.is_some_and(|rays| rays.get() > 65_536) {
        return Err(bad_argument(py, "rays: more than 65536"));
    }
    let seen = view(options)?;
    let settings = RenderSettings {
        direct: method.direct(rays),
        sequence: sequence.unwrap_or_default(),
        ..Wanted::of(py, options, false)?.settings(seen.is_unfolded())
    };
    let memory = options.memory()?;
    options.finish()?;
    let call = crate::call::Call {
        memory,
        ..call(progress, &shared.settings)
    };
    let done = call.run(py, |cx| {
        let mut model = shared.lock();
        cx.settings.method = Some(method.name().to_owned());
        let view = seen.view(&model.file, &model.scene)?;
        let request = FieldRequest {
            surface: SurfaceId(surface),
            view: &view,
            settings,
        };
        let (found, attributes) = model.field(request, cx)?;
        let means = serde_json::to_string(&FieldSurface::of(&model, &found.means));
        Ok((found.image, attributes, means.unwrap_or_default()))
    })?;
    let (image, attributes, means) = done.value;
    let image = Image {
        image,
        attributes,
        warnings: done.warnings,
    };
    Ok((image, means))
}
