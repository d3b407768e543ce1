//! What pictures and sequences of pictures share: rendering, watching, writing.

use std::path::{Path, PathBuf};

use serde::Deserialize as _;
use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::args::RenderArgs;
use super::failure::Failure;
use super::output;
use super::render::AnyView;
use super::run::Run;
use crate::audit;
use crate::cli::args::PixelsName;
use crate::plan::byte_text;
use crate::printable::{counted, short};
use crate::render::display::{TevDisplay, Unwatched, Watcher};
use crate::render::{
    Attributes, CameraRecord, GatherReport, Image, RenderInput, RenderSettings, View, ViewDescription, exr, png,
    render_watched,
};
use crate::report::memory_used_byte;
use crate::workflow::Memory;

/// Memory for a pixel while the image is rendered and written.
const PIXEL_BYTE: u64 = 512;

/// The same with final gather, which keeps every pixel's sums until all are finished.
const GATHER_BYTE: u64 = 1536;

/// Returns the memory that a picture takes, if it is within the limit beside what is used already: all layers, and as much again while they are coded.
pub(super) fn image_byte(view: &AnyView, settings: &RenderSettings, memory: &Memory) -> Result<u64, Failure> {
    let (width, height) = view.as_view().size();
    let gathers = settings.gather.is_some();
    let of_image = u64::from(width) * u64::from(height) * if gathers { GATHER_BYTE } else { PIXEL_BYTE };
    let limit = memory.limit();
    let in_all = of_image.saturating_add(memory_used_byte().unwrap_or(0));
    if in_all <= limit {
        return Ok(of_image);
    }
    let (needed, limit) = (byte_text(in_all), byte_text(limit));
    Err(Failure::new(
        "memory_limit",
        format!(
            "a picture of {width} × {height} pixels and its scene need {needed} of memory, and the limit is {limit}; raise --memory-limit or give fewer pixels"
        ),
    ))
}

/// Returns the name of the preview beside a picture, if the picture can be written.
pub(super) fn preview_of(picture: &Path) -> Result<PathBuf, Failure> {
    let ending = picture.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    if ending.is_none_or(|ending| ending != "exr") {
        return Err(Failure::usage(format!(
            "{}: a picture is an OpenEXR file; give it the ending .exr (its preview gets .png)",
            picture.display()
        )));
    }
    output::expect_possible(picture)?;
    Ok(picture.with_extension("png"))
}

/// Renders a picture and writes it with its preview.
pub(super) fn shoot(
    run: &mut Run,
    input: &RenderInput<'_>,
    any_view: &AnyView,
    settings: RenderSettings,
    args: &RenderArgs,
    (output, preview): (&Path, &Path),
) -> Result<Image, Failure> {
    let view = any_view.as_view();
    let kept = KeptPicture::new(run, input, view, &settings, args);
    if let Some(image) = kept.as_ref().and_then(|kept| kept.image(run, output, preview)) {
        run.cx.audited(audit::picture(&image));
        warn_if_blank(run, &image, any_view);
        return Ok(image);
    }
    let display = args
        .display
        .as_deref()
        .and_then(|address| connect(run, address, output, view));
    let watcher: &dyn Watcher = display.as_ref().map_or(&Unwatched, |tev| tev);
    let image = run.cx.time("render", || {
        render_watched(input, view, &settings, &run.cx.progress(), watcher)
    })?;
    if display.is_some_and(|tev| !tev.is_connected()) {
        run.warn("the viewer stopped taking pixels; the picture is whole all the same");
    }
    run.cx.audited(audit::picture(&image));
    warn_if_blank(run, &image, any_view);
    let offset = input.visibility.offset();
    let mut attributes = Attributes::new(
        input.scene,
        view.description(),
        settings,
        offset,
        json!(run.cx.settings),
    );
    attributes.pixels = args.file.pixels.into();
    run.cx.time("write", || {
        exr::write_parts(output, &image, &attributes, args.file.parts.into())?;
        png::write(preview, &image)
    })?;
    if let Some(kept) = kept {
        kept.keep(run, output, preview);
    }
    Ok(image)
}

/// Returns what final gather took, and warns of pixels that stay above the noise.
pub(super) fn gathered(run: &Run, image: &Image, settings: RenderSettings, picture: &Path) -> Option<GatherReport> {
    let report = GatherReport::new(image, settings.gather?);
    if report.n_above > 0 {
        run.warn(&format!(
            "{}: {} of {} above the noise of {} after as many rays as --gather-rays lets them have; raise that, or --noise",
            picture.display(),
            report.n_above,
            counted(usize::try_from(report.n_pixels).unwrap_or(usize::MAX), "pixel"),
            short(report.noise)
        ));
    }
    Some(report)
}

/// Warns if a camera sees no face from its front: backs are black.
pub(super) fn warn_if_blank(run: &Run, image: &Image, view: &AnyView) {
    let (Some(origin), ViewDescription::Perspective(parameters)) = (view.origin(), view.as_view().description()) else {
        return;
    };
    let Ok(record) = CameraRecord::deserialize(&parameters) else {
        return;
    };
    if !image.shows_a_front(record.eye) {
        run.warn(&format!(
            "no pixel shows the front of a face: move the camera (--eye, --look-at; it is {}), or turn the faces with --flip (they see on the side from which their \
             corners run counter-clockwise)",
            origin.describe()
        ));
    }
}

/// The part of the checkpoint that says which pictures are written.
const PART: u32 = 1 << 21;

/// A picture of which a checkpoint may know that it is written.
struct KeptPicture {
    /// A hash of all that its files depend on.
    key: [u8; 32],
    /// Its number: the beginning of the key.
    piece: u64,
}

impl KeptPicture {
    /// `None` without a checkpoint, and for numbers that are rounded in the file: what is told of such a picture cannot be read from it.
    fn new(
        run: &Run,
        input: &RenderInput<'_>,
        view: &dyn View,
        settings: &RenderSettings,
        args: &RenderArgs,
    ) -> Option<Self> {
        run.cx.checkpoint()?;
        if args.file.pixels != PixelsName::F32 {
            return None;
        }
        let mut hasher = Sha256::new();
        hasher.update(input.fingerprint(view, settings));
        hasher.update(format!("{:?} {:?}", args.file, run.cx.settings));
        let key: [u8; 32] = hasher.finalize().into();
        let [a, b, c, d, ..] = key;
        Some(Self {
            key,
            piece: u32::from_le_bytes([a, b, c, d]).into(),
        })
    }

    /// Returns what a checkpoint keeps of the picture: the key and the hashes of its files.
    fn content(&self, output: &Path, preview: &Path) -> Option<Vec<u8>> {
        let mut content = self.key.to_vec();
        for file in [output, preview] {
            content.extend_from_slice(&Sha256::digest(std::fs::read(file).ok()?));
        }
        Some(content)
    }

    /// Returns the picture if an earlier run wrote it and it is still as it was.
    fn image(&self, run: &Run, output: &Path, preview: &Path) -> Option<Image> {
        let checkpoint = run.cx.checkpoint()?;
        checkpoint.begin_part(PART, &[0; 32]);
        let kept = checkpoint.piece(self.piece)?;
        (Some(kept) == self.content(output, preview))
            .then(|| exr::read(output).ok())
            .flatten()
            .map(|(image, _)| image)
    }

    fn keep(&self, run: &Run, output: &Path, preview: &Path) {
        if let (Some(checkpoint), Some(content)) = (run.cx.checkpoint(), self.content(output, preview)) {
            checkpoint.begin_part(PART, &[0; 32]);
            checkpoint.keep(self.piece, &content);
        }
    }
}

/// Opens the picture in a viewer; without one there is a warning, and nothing to watch.
fn connect(run: &Run, address: &str, picture: &Path, view: &dyn View) -> Option<TevDisplay> {
    let name = picture.file_name().unwrap_or_default().to_string_lossy();
    let (width, height) = view.size();
    match TevDisplay::connect(address, &name, width, height) {
        Ok(display) => Some(display),
        Err(error) => {
            run.warn(&format!(
                "no viewer at {address} ({error}); start tev there, or leave out --display"
            ));
            None
        }
    }
}
