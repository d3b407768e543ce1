//! The view and the settings of an image by flags.

use std::fmt::Write as _;
use std::num::NonZeroU32;

use super::args::{DirectName, GatherArgs, ImageArgs, RenderArgs, ViewArgs};
use super::failure::{Failure, flag};
use super::run::Run;
use crate::render::{DirectMethod, GatherSettings, RenderSettings};
use crate::workflow::ImageView;

/// Refuses flags of the direct pass that do not fit together.
pub(super) fn expect_sensible(image: &ImageArgs) -> Result<(), Failure> {
    let direct = image.direct.or(image.flat.then_some(DirectName::Off));
    match (direct, image.direct_samples) {
        (Some(DirectName::Off), Some(_)) => Err(Failure::usage(
            "--direct-samples has no use without a direct pass; leave out --flat or --direct off",
        )),
        (Some(DirectName::Exact), Some(_)) => Err(Failure::usage(
            "--direct exact traces no rays; leave out --direct-samples",
        )),
        _ => Ok(()),
    }
}

/// Returns the settings of an image; the defaults depend on the view.
pub(super) fn render_settings(args: &RenderArgs, is_unfolded: bool) -> RenderSettings {
    let image = &args.image;
    let direct = match image.direct {
        None => DirectMethod::suited(is_unfolded, image.flat),
        Some(DirectName::Off) => DirectMethod::Off,
        Some(DirectName::Exact) => DirectMethod::Exact,
        Some(DirectName::Rays) => DirectMethod::CosineRays { n: DirectMethod::RAYS },
        Some(DirectName::Polygons) => DirectMethod::Polygons {
            n: DirectMethod::SHADOW_RAYS,
        },
    };
    let n = image.direct_samples.and_then(NonZeroU32::new);
    RenderSettings {
        flat: image.flat,
        samples: samples(&image.view, is_unfolded),
        adaptive: true,
        gather: args.gather.final_gather.then(|| gather_settings(args.gather)),
        direct: n.and_then(|n| direct.with_rays(n)).unwrap_or(direct),
        sequence: args.method.sequence(),
        seed: args.method.seed,
    }
}

fn gather_settings(args: GatherArgs) -> GatherSettings {
    let default = GatherSettings::default();
    GatherSettings {
        noise: args.noise.unwrap_or(default.noise),
        max_rays: args.gather_rays.and_then(NonZeroU32::new).unwrap_or(default.max_rays),
    }
}

/// Returns the number of samples along each side of a pixel.
pub(super) fn samples(view: &ViewArgs, is_unfolded: bool) -> NonZeroU32 {
    let asked = view.samples.and_then(NonZeroU32::new);
    asked.unwrap_or(RenderSettings::default_samples(is_unfolded))
}

/// Adds the camera of an image to the text and the settings of the document, after the image is written, whose attributes name no files.
pub(super) fn tell_camera(view: &ImageView, run: &mut Run, text: &mut String) {
    let camera = view.camera_text(&flag);
    let _ = writeln!(text, "camera: {camera}");
    run.cx.settings.camera = Some(camera);
}
