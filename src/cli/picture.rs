//! Files of images named by flags.

use std::path::{Path, PathBuf};

use super::args::PictureFileArgs;
use super::failure::Failure;
use super::output;
use crate::workflow::ImageFile;

/// Returns the name of the preview beside an image, if the image can be written.
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

/// Returns the format of an image file.
pub(super) fn image_file(args: PictureFileArgs) -> ImageFile {
    ImageFile {
        pixels: args.pixels,
        parts: args.parts,
    }
}
