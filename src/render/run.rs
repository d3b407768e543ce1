//! Renders an image of a solved scene.

use super::direct::{DirectMethod, DirectPass};
use super::display::{Unwatched, Watcher};
use super::error::RenderError;
use super::gather::Gatherer;
use super::image::{Image, check_size};
use super::input::RenderInput;
use super::renderer::{Renderer, SurfaceSums};
use super::samples::PixelSamples;
use super::settings::RenderSettings;
use super::shade::Shader;
use super::view::View;
use crate::matrix::operator::Block;
use crate::progress::Progress;

/// Renders an image.
///
/// At each sample the irradiance H is interpolated between the patches' corners (continuous over a flat surface, sharp at
/// a crease), and the radiosity is B = E + ρ H with the face's own material. With `flat` both are those of the patch. With a direct
/// pass H = `direct` + the interpolated indirect irradiance, and B = E + ρ H, with `flat` too. With `gather` the rest of H beside the direct pass is
/// gathered instead: H = `direct` + ∫ B′ cos θ / π dω over the visible hemisphere, B′ = B − E of the patch that is met (without a direct pass B),
/// by cosine-distributed rays, as many as each pixel needs (see below). B′ is constant over each patch, as in the equations that the solution solves: interpolation
/// does not preserve the mean of a patch, and makes points near contact edges and creases too bright or too dark. Backs of faces are black.
///
/// Layers (f32 but for `patch`):
///
/// - `R,G,B` the radiance L = B/π; `irradiance.*`, `radiosity.*`, `albedo.*` (ρ);
/// - `N.X/Y/Z` the unit normal of the face; `P.X/Y/Z` the point, in world coordinates (f32: for exact points see [`Tile::point`](super::Tile::point));
/// - `Z` the depth along the camera's axis in m, 0 in an unfolded view; `patch` the [`PatchId`](crate::mesh::PatchId) as u32;
/// - with a direct pass `direct.*`, the irradiance from the emitters, and `direct_error.*`, its standard error as if all samples were independent;
/// - with `gather` `variance.*`, the variance of `irradiance.*`, and `samples`, the number of gathered rays (u32);
/// - where the [samples are adaptive](RenderSettings::adaptive) `pixel_samples`, the number of samples of each pixel (u32);
/// - with [`RenderInput::error`] `error.*`, the estimated error of the patches' radiosity.
///
/// Colours are means over the pixel's samples, background counting as 0; `N`, `P`, `Z` and `patch` belong to the pixel's centre. Background is 0 in all
/// layers, and `u32::MAX` in `patch`; where a sky shines, `R,G,B` and `radiosity.*` show it.
/// The sun of [`Outdoors`](super::Outdoors) is a part of the direct pass, by one ray from each sample, or 16 into its disc; the light of the sky is interpolated between patches, or gathered.
///
/// # Final gather
///
/// Pilot rays determine the number of rays of a pixel, and its mean is taken over others: a mean over the deciding rays would be too low, as it ends early where few of them met a bright part. The
/// points of a pixel's rays are sixteen independently scrambled nets. Pilot rays are doubled, round by round over the image, until the spread of their nets' means predicts that four times as many
/// will have a standard error within `gather.noise` of the pixel's irradiance, or `gather.max_rays` would be exceeded. A pixel whose error then is more than twice as large takes four times as many
/// new rays again. The stated variance is that of the nets' means, increased so that three standard errors of Student's t with 15 degrees of freedom are exceeded as rarely as those of a normal
/// distribution. Each pixel takes at least sixteen rays for each of its samples that sees a surface, whatever `gather.max_rays` is, and at least a quarter as many pilot rays. Unbiased with respect to
/// the given solution, except for less than 1e-4 by the pixels that take new rays; the error falls faster than n^(−1/2).
///
/// Where light comes from a small bright part, all first rays of a pixel may miss it, and agree on too little light. So the first rays of the pixels of a block of 32 × 32, at least 64 a pixel
/// and 4096 in all, are pooled: no pixel of the block has a smaller variance than n rays that meet the rarest 1/n of the pooled light by chance. Light that none of the pooled rays
/// met is missed: from less than some 5·10⁻⁵ of all directions, weighted by their cosines, in a whole block, and 7·10⁻⁴ in the smallest.
/// The remaining error is that of the solution, averaged over the hemisphere.
///
/// Error of the irradiance, `cornell-box`, 96 × 96 pixels of one sample, 1158 patches (`--max-edge 0.06`); the reference is final gather with a noise of 0.002; errors relative to the
/// mean (root mean square) and to the pixel (median):
///
/// | | rays a pixel | root mean square | median |
/// |---|---|---|---|
/// | `--flat` | | 10.2 % | 4.8 % |
/// | `--direct off` | | 9.0 % | 3.2 % |
/// | `--flat --direct exact` | | 2.8 % | 1.5 % |
/// | `--direct exact` | | 2.3 % | 1.0 % |
/// | `--direct exact --final-gather --noise 0.1` | 255 | 2.6 % | 1.4 % |
/// | the same, 0.05 | 347 | 2.4 % | 1.3 % |
/// | the same, 0.02 | 969 | 1.6 % | 0.8 % |
///
/// `radiosity reproduce pictures` makes this table again, with times, a plot and the pictures.
///
/// Against independent rays over the same solution, in points that are uniform over all surfaces (`tests/library/render/gathered_points.rs`); "beyond" is the share of values that are off by more than
/// three stated errors:
///
/// | scene | places | rays a place | mean deviation, of the mean irradiance | beyond |
/// |---|---|---|---|---|
/// | `cornell-box`, patches of 0.2 m | 600 | 1050 | −3e-4 | 0.2 % |
/// | the same, patches of 0.1 m, the lowest 2.8 cm of `short_block` | 400 | 1519 | 3e-4 | 0.4 % |
/// | `room-box`, patches of 1.5 m | 600 | 535 | 2e-4 | 0.3 % |
/// | `living-room`, patches of 1 m | 600 | 4184 | 1e-3 | 0.2 % |
///
/// Independent errors of 2 % leave a statistical error of 8e-4 in the mean of 600 places.
///
/// Source: the local pass of [`LISCHINSKI_1993`](crate::references::LISCHINSKI_1993). Departures: rays in randomised nets, with an error estimate.
///
/// Equal arguments give equal images at any number of threads. Where `progress` has a [checkpoint](Progress::checkpoint), final gather stores every round of every block in
/// it (488 bytes for each pixel that is not finished, and 792 for its block) and continues from there, to the same image, if [`RenderInput::fingerprint`] is the same.
///
/// # Errors
/// [`RenderError::MissingIndirect`] (a direct pass without gathering), [`RenderError::Empty`], [`RenderError::TooLarge`].
///
/// # Panics
/// If a block does not have one row per patch and one or three channels.
#[track_caller]
pub fn render(
    input: &RenderInput<'_>,
    view: &dyn View,
    settings: &RenderSettings,
    progress: &dyn Progress,
) -> Result<Image, RenderError> {
    render_watched(input, view, settings, progress, &Unwatched)
}

/// Renders an image as [`render`] does, and passes its pixels to a watcher as they are found.
///
/// # Errors
/// As [`render`].
///
/// # Panics
/// As [`render`].
#[track_caller]
pub fn render_watched(
    input: &RenderInput<'_>,
    view: &dyn View,
    settings: &RenderSettings,
    progress: &dyn Progress,
    watcher: &dyn Watcher,
) -> Result<Image, RenderError> {
    rendered(input, view, settings, progress, watcher).map(|(image, _)| image)
}

/// Renders an image, and sums over the visible part of each surface.
#[track_caller]
pub(super) fn rendered(
    input: &RenderInput<'_>,
    view: &dyn View,
    settings: &RenderSettings,
    progress: &dyn Progress,
    watcher: &dyn Watcher,
) -> Result<(Image, SurfaceSums), RenderError> {
    let more = [input.indirect_irradiance, input.error];
    for block in [Some(input.radiosity), Some(input.irradiance)]
        .into_iter()
        .chain(more)
        .flatten()
    {
        assert_eq!(block.n_rows(), input.mesh.n_patches(), "one row per patch");
        assert!(matches!(block.n_channels(), 1 | 3), "one channel or three");
    }
    let (width, height) = view.size();
    check_size(u64::from(width), u64::from(height))?;
    let with_direct = settings.direct != DirectMethod::Off;
    // Without a direct pass the patches include the sun's light, unless rays gather all indirect light.
    let sun = input.outdoors.sun.filter(|_| with_direct || settings.gather.is_some());
    let direct_pass = || {
        let numbers = (settings.sequence, settings.seed);
        DirectPass::new(input.scene, input.mesh, input.visibility, settings.direct, numbers, sun)
    };
    let nothing = Block::zeros(input.mesh.n_patches(), 1);
    let (irradiance, flat) = match (settings.gather, with_direct) {
        // Gathering finds the rest of the light beside the direct pass.
        (Some(_), _) => (&nothing, true),
        (None, true) => (
            input.indirect_irradiance.ok_or(RenderError::MissingIndirect)?,
            settings.flat,
        ),
        (None, false) => (input.irradiance, settings.flat),
    };
    let constant = settings.flat.then_some(input.radiosity);
    let of_patches = constant.filter(|_| !with_direct && settings.gather.is_none());
    let renderer = Renderer {
        input,
        view,
        settings,
        shader: Shader::new(input, irradiance, flat, of_patches),
        direct: (with_direct || sun.is_some()).then(direct_pass),
        gatherer: settings.gather.map(|gather| {
            // Interpolation does not preserve the mean of a patch: along creases and contact edges the light would be too bright or too dark.
            let shader = Shader::new(input, input.irradiance, true, Some(input.radiosity));
            let numbers = (settings.sequence, settings.seed);
            Gatherer::new(input, gather, numbers, shader, (direct_pass(), with_direct))
        }),
        samples: PixelSamples::new(settings, &view.description()),
        size: (width, height),
        watcher,
    };
    renderer.image(progress)
}
