//! What pictures and sequences of pictures share: rendering, watching, writing.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::args::RenderArgs;
use super::failure::Failure;
use super::output;
use super::pipeline::Run;
use super::render::AnyView;
use super::storage::limit_byte;
use crate::audit;
use crate::plan::byte_text;
use crate::render::display::{TevDisplay, Unwatched, Watcher};
use crate::render::{Attributes, Image, RenderInput, RenderSettings, View, exr, png, render_watched};

/// Memory for a pixel while the image is rendered and written.
const PIXEL_BYTE: u64 = 512;

/// The same with final gather, which keeps every pixel's sums until all are finished.
const GATHER_BYTE: u64 = 1536;

/// Returns the memory that a picture takes, if it is within the limit: all layers, and as much again while they are coded.
pub(super) fn image_byte(view: &AnyView, settings: &RenderSettings, memory_limit: Option<u64>) -> Result<u64, Failure> {
    let (width, height) = view.as_view().size();
    let gathers = settings.gather.is_some();
    let needed = u64::from(width) * u64::from(height) * if gathers { GATHER_BYTE } else { PIXEL_BYTE };
    let limit = limit_byte(memory_limit);
    if needed <= limit {
        return Ok(needed);
    }
    let (needed, limit) = (byte_text(needed), byte_text(limit));
    Err(Failure::new(
        "memory_limit",
        format!(
            "a picture of {width} × {height} pixels needs {needed} of memory, and the limit is {limit}; raise --memory-limit or give fewer pixels"
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
    view: &AnyView,
    settings: RenderSettings,
    args: &RenderArgs,
    (output, preview): (&Path, &Path),
) -> Result<Image, Failure> {
    let view = view.as_view();
    let display = args
        .display
        .as_deref()
        .and_then(|address| connect(run, address, output, view));
    let watcher: &dyn Watcher = display.as_ref().map_or(&Unwatched, |tev| tev);
    let image = run.times.time("render", || {
        render_watched(input, view, &settings, &run.progress, watcher)
    })?;
    if display.is_some_and(|tev| !tev.is_connected()) {
        run.warn("the viewer stopped taking pixels; the picture is whole all the same");
    }
    run.audited(audit::picture(&image));
    let offset = input.visibility.offset();
    let mut attributes = Attributes::new(input.scene, view.description(), settings, offset, json!(run.settings));
    attributes.pixels = args.file.pixels.into();
    run.times.time("write", || {
        exr::write_parts(output, &image, &attributes, args.file.parts.into())?;
        png::write(preview, &image)
    })?;
    Ok(image)
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
