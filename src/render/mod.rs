//! Images of a solved scene: views, interpolation, an optional direct pass, OpenEXR files and their check.

mod attributes;
mod direct;
mod direct_exact;
pub mod display;
mod error;
pub mod exr;
mod field;
mod fingerprint;
mod flat_surface;
mod gather;
mod image;
mod kept;
mod pixel;
pub mod png;
mod rare;
mod renderer;
mod shade;
pub mod tone_map;
mod unfolded;
pub mod verify;
mod view;

pub use attributes::{Attributes, PolygonRecord, SurfaceRecord};
pub use direct::DirectMethod;
pub use error::RenderError;
pub use field::{Field, FieldInput, FieldRecord, SurfaceMean, field};
pub use image::{Image, Layer, Samples};
pub use unfolded::{Tile, Unfolded, UnfoldedView};
pub use view::{CameraRecord, RayView, Sight, View, ViewDescription};

use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};

use crate::geometry::sampling::Sequence;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::visibility::Visibility;
use direct::DirectPass;
use display::{Unwatched, Watcher};
use gather::Gatherer;
/// The greatest exitance, in W·m⁻², of a scene for a picture: a thirtieth of what f32 holds, as reflected light comes on top.
pub const MAX_PICTURE_EXITANCE: f64 = 1e37;

pub use gather::{GatherReport, GatherSettings};
use renderer::{Renderer, SurfaceSums, sample_grid};
use shade::Shader;

/// The most pixels that an image may have.
const MAX_PIXELS: u64 = 1 << 31;

/// How an image is made from a solution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderSettings {
    /// Whether each patch is shown with its own constant value, not interpolated between patches.
    pub flat: bool,
    /// s: the colours of a pixel are the mean of s × s samples on a regular grid, the centre alone for 1.
    pub samples: NonZeroU32,
    /// The direct pass.
    pub direct: DirectMethod,
    /// Final gather, in place of interpolation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gather: Option<GatherSettings>,
    /// The numbers of the direct pass and of gathering.
    pub sequence: Sequence,
    /// The seed of these numbers.
    pub seed: u64,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            flat: false,
            samples: NonZeroU32::MIN,
            direct: DirectMethod::Off,
            gather: None,
            sequence: Sequence::Sobol,
            seed: 0,
        }
    }
}

/// A scene with a solution. Blocks have one row per patch and one (grey) or three channels.
#[derive(Clone, Copy)]
pub struct RenderInput<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its patches.
    pub mesh: &'a Mesh,
    /// Who sees whom.
    pub visibility: &'a dyn Visibility,
    /// B in W·m⁻².
    pub radiosity: &'a Block,
    /// H = F B in W·m⁻².
    pub irradiance: &'a Block,
    /// F (B − E): the irradiance but for what comes straight from the emitters. Wanted where there is a direct pass.
    pub indirect_irradiance: Option<&'a Block>,
    /// The estimated error of B, in W·m⁻².
    pub error: Option<&'a Block>,
}

/// Renders an image.
///
/// At each sample the irradiance H is interpolated between the patches' corners (continuous over a flat surface, sharp at
/// a crease), and the radiosity is B = E + ρ H with the face's own material. With `flat` both are those of the patch. With a direct
/// pass H = `direct` + the interpolated indirect irradiance, and B = E + ρ H, with `flat` too. With `gather` what the direct pass leaves of H is
/// gathered instead: H = `direct` + ∫ B′ cos θ / π dω over what is seen, B′ = ρ H of the solution there (with `flat` B − E of the patch; without a direct pass B),
/// by cosine-distributed rays, as many as each pixel needs (see below). Backs of faces are black.
///
/// Layers (f32 but for `patch`): `R,G,B` radiance L = B/π; `irradiance.*`, `radiosity.*`, `albedo.*` (ρ); `N.X/Y/Z` the unit normal of the
/// face, `P.X/Y/Z` the point, in world coordinates (f32: for exact points see [`Tile::point`]); `Z` the depth along the camera's
/// axis in m, 0 in an unfolded view; `patch` the [`PatchId`](crate::mesh::PatchId) as u32. With a direct pass also `direct.*`, the
/// irradiance from the emitters, and `direct_error.*`, its standard error as if all samples were independent. With `gather` also `variance.*`, the variance of `irradiance.*`, and `samples`,
/// the number of gathered rays (u32). With [`RenderInput::error`] also `error.*`, the estimated error of the patches' radiosity. Colours are means over the pixel's
/// samples, background counting as 0; `N`, `P`, `Z` and `patch` belong to the pixel's centre. Background is 0 in all
/// layers, and `u32::MAX` in `patch`.
///
/// # Final gather
///
/// The points of a pixel's rays are eight independently scrambled nets. All are continued to twice their length, round by round over the image, until the spread of
/// the nets' means says that the pixel's standard error is within `gather.noise` of its irradiance, or `gather.max_rays` would be exceeded.
/// Each pixel takes eight rays for each of its samples that sees a surface at least, whatever `gather.max_rays` says.
/// Unbiased with respect to the given solution but for stopping early where the first rays happen to agree; the error falls faster than n^(−1/2).
/// Where light comes from something small and bright, all first rays of a pixel may miss it, and agree on too little light. So the rays that the pixels of a block of 32 × 32 begin with, 64 a pixel
/// and 4096 in all at least, are pooled: no pixel of the block has a smaller variance than what n rays would have that meet the rarest 1/n of the pooled light by chance. What none of the pooled rays
/// met is not seen: light from less than some 5·10⁻⁵ of all directions, weighed by their cosines, in a whole block, and 7·10⁻⁴ in the smallest.
/// What is left is the error of the solution, averaged over the hemisphere.
///
/// Error of the irradiance against render time, `cornell-box`, 96 × 96 pixels of one sample, 1158 patches (`--max-edge 0.06`); the reference is final gather with a noise of 0.002; errors relative to the
/// mean (root mean square) and to the pixel (median). Times are processor times of the rendering, all threads together, measured once on a machine with other work: good for their ratios only:
///
/// | | processor time | root mean square | median |
/// |---|---|---|---|
/// | `--flat` | < 0.1 s | 10.2 % | 4.8 % |
/// | `--flat --direct exact` | < 0.1 s | 2.8 % | 1.6 % |
/// | `--direct exact` | < 0.1 s | 2.2 % | 1.0 % |
/// | `--direct polygons` | < 0.1 s | 2.4 % | 1.1 % |
/// | `--direct exact --final-gather --noise 0.05` | 0.4 s | 4.1 % | 2.2 % |
/// | the same, 0.02 | 1.2 s | 2.1 % | 1.0 % |
/// | the same, 0.01 | 2.9 s | 1.0 % | 0.5 % |
/// | the same, 0.002 | 21 s | | |
///
/// Interpolation costs nothing and is off by 2.2 %; gathering pays below that. `radiosity reproduce pictures` makes such a table again, with a plot and the pictures.
///
/// Whether the stated variance holds, one sample a pixel and a budget that is not reached, against references with a noise of 0.002 or 0.003 (as far as half a million rays a pixel bring it without a direct pass; their variance is added); "beyond" are pixels that are off by more than so many stated
/// standard errors in their brightest channel (of Student's t with 7 degrees of freedom, 2 % would be beyond 3 and 0.16 % beyond 5), and in brackets is what is found without the pooled rays:
///
/// | scene | noise | bias | beyond 3 | beyond 5 | rays a pixel |
/// |---|---|---|---|---|---|
/// | `cornell-box`, `--direct exact`, 96 × 96 | 0.05 | −0.1 % (−0.2 %) | 1.1 % (2.4 %) | 0 (0.2 %) | 174 (164) |
/// | | 0.02 | −0.1 % (−0.1 %) | 1.4 % (2.5 %) | < 0.1 % (0.1 %) | 535 (514) |
/// | | 0.01 | 0 (0) | 1.4 % (2.0 %) | < 0.1 % (0.1 %) | 1334 (1291) |
/// | the same, `--direct off`, 40 × 40 | 0.05 | 0.3 % (−11 %) | 1.9 % (26 %) | 0.1 % (22 %) | 8539 (2998) |
/// | | 0.02 | 0 (−1.9 %) | 2.0 % (11 %) | 0.1 % (8 %) | 25129 (13871) |
/// | room with an up-light 0.3 m below the ceiling, `exact`, 96 × 96 | 0.05 | 0.1 % (−2.5 %) | 0.7 % (16 %) | 0 (12 %) | 1541 (1042) |
/// | | 0.02 | 0 (−0.2 %) | 0.8 % (4 %) | 0 (2.2 %) | 4348 (3603) |
/// | | 0.01 | 0 (0) | 0.8 % (2.3 %) | < 0.1 % (0.9 %) | 9097 (7730) |
/// | the same, `off`, 40 × 40 | 0.05 | 0 (−17 %) | 0.8 % (35 %) | 0.1 % (31 %) | 27772 (1641) |
/// | | 0.02 | 0.1 % (−11 %) | 0.4 % (22 %) | 0 (20 %) | 78813 (10352) |
/// | a smaller one, 0.08 m below, `exact`, 40 × 40 | 0.05 | 0.2 % (−16 %) | 0.9 % (42 %) | 0 (40 %) | 7082 (2465) |
/// | | 0.02 | 0.1 % (−4 %) | 1.4 % (16 %) | 0 (15 %) | 20012 (12910) |
/// | | 0.01 | 0 (−0.5 %) | 1.6 % (6 %) | 0.3 % (4 %) | 44035 (34245) |
/// | a window of 0.3 m, `off`, 40 × 40 | 0.05 | 0.5 % (−33 %) | 1.8 % (55 %) | 0 (53 %) | 13106 (1263) |
/// | | 0.02 | 0.1 % (−23 %) | 1.9 % (43 %) | 0.3 % (43 %) | 42557 (11085) |
///
/// A room of 4 × 3 × 2.5 m, whose up-lights are squares of 0.2 m and 0.1 m. Emitters without a direct pass are what takes the most rays.
///
/// Source: the local pass of [`LISCHINSKI_1993`](crate::references::LISCHINSKI_1993). Departures: rays in randomised nets, with an error estimate.
///
/// Equal arguments give equal images at any number of threads. Where `progress` has a [checkpoint](Progress::checkpoint), final gather keeps every round of every block in
/// it (296 bytes for each pixel that is not finished, and 792 for its block) and goes on from there, to the same image, if [`RenderInput::fingerprint`] is the same.
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

/// Renders an image as [`render`] does, and shows its pixels to a watcher as they are found.
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

/// Renders an image, and sums over what it shows of each surface.
#[track_caller]
fn rendered(
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
    let direct_pass = || {
        let numbers = (settings.sequence, settings.seed);
        DirectPass::new(input.scene, input.mesh, input.visibility, settings.direct, numbers)
    };
    let nothing = Block::zeros(input.mesh.n_patches(), 1);
    let (irradiance, flat) = match (settings.gather, with_direct) {
        // Gathering finds what the direct pass leaves.
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
        direct: with_direct.then(direct_pass),
        gatherer: settings.gather.map(|gather| {
            let shader = Shader::new(input, input.irradiance, settings.flat, constant);
            let numbers = (settings.sequence, settings.seed);
            Gatherer::new(input, gather, numbers, shader, (direct_pass(), with_direct))
        }),
        samples: sample_grid(settings.samples.get()),
        size: (width, height),
        watcher,
    };
    renderer.image(progress)
}

/// Returns the size of an image if it has pixels, but not too many.
fn check_size(width: u64, height: u64) -> Result<(u32, u32), RenderError> {
    let too_large = || RenderError::TooLarge {
        width,
        height,
        limit: MAX_PIXELS,
    };
    if width == 0 || height == 0 {
        return Err(RenderError::Empty);
    }
    let side = |n: u64| i32::try_from(n).map_err(|_| too_large()).map(i32::unsigned_abs);
    let sides = (side(width)?, side(height)?);
    if width * height > MAX_PIXELS {
        return Err(too_large());
    }
    Ok(sides)
}
