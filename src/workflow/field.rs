//! Fields of form factors as a whole step of a study: rendering, files, and what there is to warn of.

use std::path::Path;

use super::{Context, ImageFile, ImageView, Model, WorkflowError, image_byte, warn_if_blank};
use crate::form_factor::{RAYS, SEQUENCE};
use crate::render::{Attributes, DirectMethod, Field, FieldInput, FieldRecord, RenderSettings, exr, field, png};
use crate::scene::SurfaceId;
use crate::visibility::Visibility as _;

/// A field that is wanted: the form factor from every visible point to a surface.
#[derive(Clone, Copy)]
pub struct FieldRequest<'a> {
    /// The surface.
    pub surface: SurfaceId,
    /// From where it is seen.
    pub view: &'a ImageView,
    /// How it is rendered.
    pub settings: RenderSettings,
    /// How it is written.
    pub file: ImageFile,
    /// The OpenEXR file.
    pub output: &'a Path,
    /// Its preview, a PNG file.
    pub preview: &'a Path,
}

impl Model {
    /// Renders a field and writes it with its preview.
    ///
    /// # Errors
    /// [`WorkflowError::ImageMemory`], [`WorkflowError::Render`] and [`WorkflowError::Interrupted`].
    pub fn field_to_files(&mut self, request: FieldRequest<'_>, cx: &mut Context) -> Result<Field, WorkflowError> {
        let (view, settings) = (request.view.as_view(), request.settings);
        image_byte(view, &settings, &cx.memory)?;
        let name = self.scene.surfaces[request.surface.0 as usize].name.clone();
        if let DirectMethod::CosineRays { n } | DirectMethod::Polygons { n } = settings.direct {
            cx.settings.own.set(&RAYS, u64::from(n.get()));
            cx.settings.own.set(&SEQUENCE, settings.sequence.name());
            self.warn_of_narrow_gaps(cx);
        } else {
            let nothing = "rays between points and the surface: what blocks is clipped away exactly";
            self.plan.left_out.push(nothing.into());
        }
        cx.settings.seed = Some(settings.seed);
        cx.settings.surface = Some(name.clone());
        request.view.note_left_out(self, cx);
        let input = FieldInput {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            surface: request.surface,
        };
        let found = cx.time("render", || field(&input, view, &settings, &cx.progress()))?;
        let camera = request.view.origin().map(|origin| origin.text(&cx.naming));
        warn_if_blank(&found.image, view, camera.as_deref(), cx);
        let (offset, solution) = (self.visibility.offset(), cx.settings.record().into());
        let mut attributes = Attributes::new(&self.scene, view.description(), settings, offset, solution)
            .with_field(FieldRecord { surface: name });
        attributes.pixels = request.file.pixels;
        cx.time("write", || {
            exr::write_parts(request.output, &found.image, &attributes, request.file.parts)?;
            png::write(request.preview, &found.image)
        })?;
        Ok(found)
    }
}
