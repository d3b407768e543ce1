//! Fields of form factors as a step of a study: rendering, files, and warnings.

use std::num::NonZeroU32;
use std::path::Path;

use super::{Context, ImageFile, ImageView, Model, WorkflowError, image_byte, warn_if_blank};
use crate::form_factor::{RAYS, SEQUENCE};
use crate::render::{
    Attributes, DirectMethod, FIELD_SHADOW_RAYS, Field, FieldInput, FieldRecord, RenderSettings, exr, field, png,
};
use crate::scene::SurfaceId;
use crate::visibility::Visibility as _;

/// How the form factor of a point is found: the methods of form factors that need no patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum FieldMethod {
    /// The exact form factor to the visible part of the surface, by clipping; no rays
    #[default]
    Exact,
    /// Rays from the point, with a standard error for every pixel
    Sr,
    /// The exact form factor, times the visible fraction of low-discrepancy rays
    Qmc,
}

impl FieldMethod {
    /// Returns its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Sr => "sr",
            Self::Qmc => "qmc",
        }
    }

    /// Returns the direct method that computes the form factor at each sample.
    ///
    /// `rays` are for each sample with [`Sr`](Self::Sr), by default [`DirectMethod::RAYS`], and for each face of the surface with [`Qmc`](Self::Qmc), by default [`FIELD_SHADOW_RAYS`].
    #[must_use]
    pub fn direct(self, rays: Option<NonZeroU32>) -> DirectMethod {
        match self {
            Self::Exact => DirectMethod::Exact,
            Self::Sr => DirectMethod::CosineRays {
                n: rays.unwrap_or(DirectMethod::RAYS),
            },
            Self::Qmc => DirectMethod::Polygons {
                n: rays.unwrap_or(FIELD_SHADOW_RAYS),
            },
        }
    }
}

/// The request for a field: the form factor from every visible point to a surface.
#[derive(Clone, Copy)]
pub struct FieldRequest<'a> {
    /// The surface.
    pub surface: SurfaceId,
    /// The view.
    pub view: &'a ImageView,
    /// The settings of the image.
    pub settings: RenderSettings,
}

impl Model {
    /// Renders a field, and returns it with the attributes of its file.
    ///
    /// # Errors
    /// [`WorkflowError::ImageMemory`], [`WorkflowError::Render`] and [`WorkflowError::Interrupted`].
    pub fn field(&mut self, request: FieldRequest<'_>, cx: &mut Context) -> Result<(Field, Attributes), WorkflowError> {
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
        let attributes = Attributes::new(&self.scene, view.description(), settings, offset, solution)
            .with_field(FieldRecord { surface: name });
        Ok((found, attributes))
    }

    /// Renders a field and writes it as OpenEXR to `output`, with its preview as PNG.
    ///
    /// # Errors
    /// As [`field`](Self::field).
    pub fn field_to_files(
        &mut self,
        request: FieldRequest<'_>,
        file: ImageFile,
        [output, preview]: [&Path; 2],
        cx: &mut Context,
    ) -> Result<Field, WorkflowError> {
        let (found, mut attributes) = self.field(request, cx)?;
        attributes.pixels = file.pixels;
        cx.time("write", || {
            exr::write_parts(output, &found.image, &attributes, file.parts)?;
            png::write(preview, &found.image)
        })?;
        Ok(found)
    }
}
