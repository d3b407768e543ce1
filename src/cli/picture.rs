//! What pictures and sequences of pictures share: names of files, watching.

use std::path::{Path, PathBuf};

use super::args::{PictureFileArgs, RenderArgs};
use super::failure::Failure;
use super::output;
use super::run::Run;
use super::view::AnyView;
use crate::render::display::{TevDisplay, Unwatched, Watcher};
use crate::render::{Image, RenderInput, RenderSettings, View};
use crate::workflow::{self, ImageFile, ImageRequest};

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

/// Returns how a picture is written.
fn file(args: PictureFileArgs) -> ImageFile {
    ImageFile {
        pixels: args.pixels.into(),
        parts: args.parts.into(),
    }
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
    let display = args
        .display
        .as_deref()
        .and_then(|address| connect(run, address, output, view));
    let watcher: &dyn Watcher = display.as_ref().map_or(&Unwatched, |tev| tev);
    let camera = any_view.camera_name();
    let request = ImageRequest {
        view,
        camera: camera.as_deref(),
        settings,
        file: file(args.file),
        output,
        preview,
    };
    let image = workflow::render_to_files(input, &request, watcher, &mut run.cx)?;
    if display.is_some_and(|tev| !tev.is_connected()) {
        run.warn("the viewer stopped taking pixels; the picture is whole all the same");
    }
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
