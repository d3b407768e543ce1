//! Images as a step of a study: defaults for their light, memory, rendering, audit and files, and reuse of images that an earlier run has written.

use std::path::Path;

use serde::Deserialize as _;
use sha2::{Digest as _, Sha256};

use super::{Context, Memory, Warning, WorkflowError};
use crate::audit;
use crate::mesh::Subdivision;
use crate::render::display::{TevDisplay, Unwatched, Watcher};
use crate::render::{
    Attributes, CameraRecord, GatherReport, Image, RenderInput, RenderSettings, View, ViewDescription, exr, png,
    render_watched,
};
use crate::report::memory_used_byte;
use crate::scene::Scene;

/// The default number of rays for each patch where the light is for an image: the noise of a patch is then invisible.
pub const IMAGE_RAYS: u64 = 16384;

/// The default tolerance of form factors where the light is for an image.
///
/// It is below a tenth of a typical factor between patches of the default size, which is 1/3000. Errors of both signs mostly cancel, and patches of that size have larger errors.
pub const IMAGE_TOLERANCE: f64 = 1e-5;

/// The number of patches of the default subdivision for an image.
const PATCHES: f64 = 3000.0;

/// Returns a subdivision into some 3000 patches of about equal size, and a few more where contact edges cut faces.
#[must_use]
pub fn image_patches(scene: &Scene) -> Subdivision {
    let area: f64 = scene.face_ids().map(|face| scene.area_vector(face).length()).sum();
    Subdivision::MaxEdge((area / PATCHES).sqrt())
}

/// Memory for a pixel while the image is rendered and written.
const PIXEL_BYTE: u64 = 512;

/// The same with final gather, which stores every pixel's sums until all are finished.
const GATHER_BYTE: u64 = 1536;

/// The format of an image file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImageFile {
    /// The kind of floats.
    pub pixels: exr::Pixels,
    /// The parts of the file.
    pub parts: exr::Parts,
}

/// The request for an image.
#[derive(Clone, Copy)]
pub struct ImageRequest<'a> {
    /// The view.
    pub view: &'a dyn View,
    /// The name of its camera in warnings; `None` for a view without one.
    pub camera: Option<&'a str>,
    /// The settings of the image.
    pub settings: RenderSettings,
    /// The format of the file.
    pub file: ImageFile,
    /// The OpenEXR file.
    pub output: &'a Path,
    /// Its preview, a PNG file.
    pub preview: &'a Path,
}

/// Returns the memory of an image, in bytes, for all layers and as much again for coding, if it fits the limit with the memory in use.
///
/// # Errors
/// [`WorkflowError::ImageMemory`].
pub fn image_byte(view: &dyn View, settings: &RenderSettings, memory: &Memory) -> Result<u64, WorkflowError> {
    let (width, height) = view.size();
    let gathers = settings.gather.is_some();
    let of_image = u64::from(width) * u64::from(height) * if gathers { GATHER_BYTE } else { PIXEL_BYTE };
    let limit = memory.limit();
    let needed = of_image.saturating_add(memory_used_byte().unwrap_or(0));
    if needed <= limit {
        return Ok(of_image);
    }
    Err(WorkflowError::ImageMemory {
        size: (width, height),
        needed,
        limit,
    })
}

/// Renders an image and writes it with its preview; one that an earlier run has written, according to the checkpoint, is read.
///
/// # Errors
/// [`WorkflowError::Render`], and [`WorkflowError::Interrupted`].
pub fn render_to_files(
    input: &RenderInput<'_>,
    request: &ImageRequest<'_>,
    watcher: &dyn Watcher,
    cx: &mut Context,
) -> Result<Image, WorkflowError> {
    let ImageRequest {
        view,
        settings,
        file,
        output,
        preview,
        ..
    } = *request;
    let kept = KeptImage::new(cx, input, view, &settings, file);
    if let Some(image) = kept.as_ref().and_then(|kept| kept.image(cx, output, preview)) {
        cx.audited(audit::picture(&image));
        warn_if_blank(&image, view, request.camera, cx);
        return Ok(image);
    }
    let (image, mut attributes) = rendered(input, (view, request.camera), settings, watcher, cx)?;
    attributes.pixels = file.pixels;
    cx.time("write", || {
        exr::write_parts(output, &image, &attributes, file.parts)?;
        png::write(preview, &image)
    })?;
    if let Some(kept) = kept {
        kept.keep(cx, output, preview);
    }
    Ok(image)
}

/// Renders an image, with the attributes of its file; warnings call its view `camera`.
///
/// # Errors
/// [`WorkflowError::Render`], and [`WorkflowError::Interrupted`].
pub fn rendered(
    input: &RenderInput<'_>,
    (view, camera): (&dyn View, Option<&str>),
    settings: RenderSettings,
    watcher: &dyn Watcher,
    cx: &mut Context,
) -> Result<(Image, Attributes), WorkflowError> {
    if cx.ranks.size() > 1 {
        cx.expect_same("light, view or version", &input.fingerprint(view, &settings))?;
    }
    let image = {
        let watch = cx.progress();
        cx.time("render", || render_watched(input, view, &settings, &watch, watcher))?
    };
    cx.audited(audit::picture(&image));
    warn_if_blank(&image, view, camera, cx);
    let offset = input.visibility.offset();
    let record = cx.settings.record().into();
    let attributes = Attributes::new(input.scene, view.description(), settings, offset, record);
    Ok((image, attributes))
}

/// Renders an image as [`render_to_files`] does, and shows it in the viewer tev at `address`, if there is one.
///
/// # Errors
/// As [`render_to_files`]; an unreachable or disconnected viewer causes a warning.
pub fn render_shown(
    input: &RenderInput<'_>,
    request: &ImageRequest<'_>,
    address: Option<&str>,
    cx: &mut Context,
) -> Result<Image, WorkflowError> {
    let shown = address.filter(|_| cx.ranks.is_first());
    let viewer = shown.and_then(|at| connect(at, request, cx));
    let watcher: &dyn Watcher = viewer.as_ref().map_or(&Unwatched, |tev| tev);
    let image = render_to_files(input, request, watcher, cx)?;
    if viewer.is_some_and(|tev| !tev.is_connected()) {
        cx.warn(Warning::ViewerGone);
    }
    Ok(image)
}

/// Opens an image in a viewer; returns `None` with a warning if it cannot be reached.
fn connect(address: &str, request: &ImageRequest<'_>, cx: &Context) -> Option<TevDisplay> {
    let name = request.output.file_name().unwrap_or_default().to_string_lossy();
    let (width, height) = request.view.size();
    match TevDisplay::connect(address, &name, width, height) {
        Ok(viewer) => Some(viewer),
        Err(error) => {
            cx.warn(Warning::NoViewer {
                address: address.to_owned(),
                reason: error.to_string(),
            });
            None
        }
    }
}

/// Returns the cost of final gather, and warns of pixels that stay above the noise.
#[must_use]
pub fn gathered(image: &Image, settings: RenderSettings, path: &Path, cx: &Context) -> Option<GatherReport> {
    let report = GatherReport::new(image, settings.gather?);
    if report.n_above > 0 {
        cx.warn(Warning::NoisyPixels {
            file: path.to_owned(),
            n_above: report.n_above,
            n_pixels: report.n_pixels,
            noise: report.noise,
        });
    }
    Some(report)
}

/// Warns if a camera sees no face from its front: backs are black.
pub fn warn_if_blank(image: &Image, view: &dyn View, camera: Option<&str>, cx: &Context) {
    let (Some(camera), ViewDescription::Perspective(parameters)) = (camera, view.description()) else {
        return;
    };
    let Ok(record) = CameraRecord::deserialize(&parameters) else {
        return;
    };
    if !image.shows_a_front(record.eye) {
        cx.warn(Warning::BlankImage {
            camera: camera.to_owned(),
        });
    }
}

/// The part of the checkpoint that lists the written images.
const PART: u32 = 1 << 21;

/// An image whose files a checkpoint may list.
struct KeptImage {
    /// A hash of all that its files depend on.
    key: [u8; 32],
    /// Its number: the first bytes of the key.
    piece: u64,
}

impl KeptImage {
    /// Returns `None` without a checkpoint, and for numbers that are rounded in the file, from which the results cannot be restored.
    fn new(
        cx: &Context,
        input: &RenderInput<'_>,
        view: &dyn View,
        settings: &RenderSettings,
        file: ImageFile,
    ) -> Option<Self> {
        cx.checkpoint()?;
        // All ranks take the same steps, but the files of one rank are not those of another.
        if cx.ranks.size() > 1 {
            return None;
        }
        if file.pixels != exr::Pixels::F32 {
            return None;
        }
        let mut hasher = Sha256::new();
        hasher.update(input.fingerprint(view, settings));
        hasher.update(format!("{file:?} {:?}", cx.settings.record()));
        let key: [u8; 32] = hasher.finalize().into();
        let [a, b, c, d, ..] = key;
        Some(Self {
            key,
            piece: u32::from_le_bytes([a, b, c, d]).into(),
        })
    }

    /// Returns the entry of the image in a checkpoint: the key and the hashes of its files.
    fn content(&self, output: &Path, preview: &Path) -> Option<Vec<u8>> {
        let mut content = self.key.to_vec();
        for file in [output, preview] {
            content.extend_from_slice(&Sha256::digest(std::fs::read(file).ok()?));
        }
        Some(content)
    }

    /// Returns the image if an earlier run wrote it and its files are unchanged.
    fn image(&self, cx: &Context, output: &Path, preview: &Path) -> Option<Image> {
        let checkpoint = cx.checkpoint()?;
        checkpoint.begin_part(PART, &[0; 32]);
        let kept = checkpoint.piece(self.piece)?;
        (Some(kept) == self.content(output, preview))
            .then(|| exr::read(output).ok())
            .flatten()
            .map(|(image, _)| image)
    }

    fn keep(&self, cx: &Context, output: &Path, preview: &Path) {
        if let (Some(checkpoint), Some(content)) = (cx.checkpoint(), self.content(output, preview)) {
            checkpoint.begin_part(PART, &[0; 32]);
            checkpoint.keep(self.piece, &content);
        }
    }
}
