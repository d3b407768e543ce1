//! Images of the temperature in false colour.

use std::path::Path;

use crate::cli::args::HeatArgs;
use crate::cli::failure::Failure;
use crate::cli::run::Run;
use crate::report::false_colour::FalseColour;
use crate::workflow::{HeatStudy, Model, ViewRequest};

/// The default size of an image, which the sheet shows pixel by pixel.
const SIZE: (u32, u32) = (720, 508);

/// Returns the view that the flags request.
pub(super) fn request(args: &HeatArgs) -> ViewRequest {
    let mut request = args.view.request();
    if !request.is_unfolded() && request.width.is_none() && request.height.is_none() {
        (request.width, request.height) = (Some(SIZE.0), Some(SIZE.1));
    }
    request
}

/// Refuses a name that is not that of a PNG.
pub(super) fn expect_png(path: &Path) -> Result<(), Failure> {
    let ending = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    if ending.is_some_and(|ending| ending == "png") {
        return Ok(());
    }
    let message = format!("{}: the picture is a PNG; give it the ending .png", path.display());
    Err(Failure::usage(message))
}

/// Draws the temperature of each patch and writes it.
pub(super) fn write(
    path: &Path,
    args: &HeatArgs,
    (model, study): (&mut Model, &HeatStudy),
    run: &mut Run,
) -> Result<(), Failure> {
    let view = request(args).view(&args.scene, &model.scene)?;
    view.note_left_out(model, &run.cx);
    let of_patches = study.heat.patches.iter().find(|(name, _)| *name == "temperature_k");
    let kelvin = of_patches.map(|(_, values)| values.as_slice()).unwrap_or_default();
    let (width, values) = run.cx.time("render", || model.picture_of(&view, kelvin, &run.cx))?;
    let picture = FalseColour {
        title: "Temperature".to_owned(),
        subtitle: format!("{}, {} patches", args.scene.display(), model.mesh.n_patches()),
        label: "K".to_owned(),
        width,
        values,
    };
    Ok(run.cx.time("write", || picture.write(path))?)
}
