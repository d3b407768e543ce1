//! Images of a solved scene: views, interpolation, an optional direct pass, OpenEXR files and their check.

mod attributes;
mod direct;
mod error;
pub mod exr;
mod flat_surface;
mod image;
mod pixel;
pub mod png;
mod shade;
pub mod tone_map;
mod unfolded;
pub mod verify;
mod view;

pub use attributes::{Attributes, PolygonRecord, SurfaceRecord};
pub use direct::DirectMethod;
pub use error::RenderError;
pub use image::{Image, Layer, Samples};
pub use unfolded::{Tile, Unfolded, UnfoldedView};
pub use view::{RayView, Sight, View, ViewDescription};

use std::num::NonZeroU32;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::sampling::Sequence;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::visibility::{Coherence, HitBatch, RayBatch, Visibility};
use direct::{DirectEstimate, DirectPass, DirectPoint, Scratch};
use pixel::{Canvas, Pixel};
use shade::{Shader, SurfacePoint};

/// Side of the square blocks of pixels that are the unit of parallel work.
const BLOCK_SIDE: u32 = 32;

/// How many blocks are rendered before their pixels are stored.
const BLOCKS_AT_A_TIME: usize = 256;

/// The most pixels that an image may have.
const MAX_PIXELS: u64 = 1 << 31;

/// How an image is made from a solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RenderSettings {
    /// Whether each patch is shown with its own constant value, not interpolated between patches.
    pub flat: bool,
    /// s: the colours of a pixel are the mean of s × s samples on a regular grid, the centre alone for 1.
    pub samples: NonZeroU32,
    /// The direct pass.
    pub direct: DirectMethod,
    /// The numbers of the direct pass.
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
}

/// Renders an image.
///
/// At each sample the irradiance H is interpolated between the patches' corners (continuous over a flat surface, sharp at
/// a crease), and the radiosity is B = E + ρ H with the face's own material. With `flat` both are those of the patch. With a direct
/// pass H = `direct` + the interpolated indirect irradiance, and B = E + ρ H, with `flat` too. Backs of faces are black.
///
/// Layers (f32 but for `patch`): `R,G,B` radiance L = B/π; `irradiance.*`, `radiosity.*`, `albedo.*` (ρ); `N.X/Y/Z` the unit normal of the
/// face, `P.X/Y/Z` the point, in world coordinates (f32: for exact points see [`Tile::point`]); `Z` the depth along the camera's
/// axis in m, 0 in an unfolded view; `patch` the [`PatchId`](crate::mesh::PatchId) as u32. With a direct pass also `direct.*`, the
/// irradiance from the emitters, and `direct_error.*`, its standard error as if all samples were independent. Colours are means over the pixel's
/// samples, background counting as 0; `N`, `P`, `Z` and `patch` belong to the pixel's centre. Background is 0 in all
/// layers, and `u32::MAX` in `patch`.
///
/// Equal arguments give equal images at any number of threads.
///
/// # Errors
/// [`RenderError::MissingIndirect`], [`RenderError::Empty`], [`RenderError::TooLarge`].
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
    for block in [Some(input.radiosity), Some(input.irradiance), input.indirect_irradiance]
        .into_iter()
        .flatten()
    {
        assert_eq!(block.n_rows(), input.mesh.n_patches(), "one row per patch");
        assert!(matches!(block.n_channels(), 1 | 3), "one channel or three");
    }
    let (width, height) = view.size();
    check_size(u64::from(width), u64::from(height))?;
    let with_direct = settings.direct != DirectMethod::Off;
    let irradiance = if with_direct {
        input.indirect_irradiance.ok_or(RenderError::MissingIndirect)?
    } else {
        input.irradiance
    };
    let constant = (settings.flat && !with_direct).then_some(input.radiosity);
    let renderer = Renderer {
        input,
        view,
        shader: Shader::new(input, irradiance, settings.flat, constant),
        direct: with_direct.then(|| {
            let (method, sequence) = (settings.direct, settings.sequence);
            DirectPass::new(input.scene, input.visibility, method, sequence, settings.seed)
        }),
        samples: sample_grid(settings.samples.get()),
        width,
    };
    let blocks: Vec<[u32; 4]> = (0..height.div_ceil(BLOCK_SIDE))
        .flat_map(|j| (0..width.div_ceil(BLOCK_SIDE)).map(move |i| [i * BLOCK_SIDE, j * BLOCK_SIDE]))
        .map(|[x, y]| [x, y, (x + BLOCK_SIDE).min(width), (y + BLOCK_SIDE).min(height)])
        .collect();
    progress.begin("render", blocks.len() as u64);
    let mut canvas = Canvas::new(width as usize, height as usize, with_direct);
    // Blocks at a time, so that pixels in f64 never fill the memory.
    for batch in blocks.chunks(BLOCKS_AT_A_TIME) {
        if progress.is_cancelled() {
            return Err(RenderError::Interrupted);
        }
        let rendered: Vec<Vec<Pixel>> = batch
            .par_iter()
            .map(|&block| {
                let pixels = renderer.block(block);
                progress.advance(1);
                pixels
            })
            .collect();
        for (&block, pixels) in batch.iter().zip(&rendered) {
            for ((x, y), pixel) in positions(block).zip(pixels) {
                canvas.set(x, y, pixel);
            }
        }
    }
    Ok(canvas.into_image())
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

/// A place inside a pixel and its share of the pixel's colour.
#[derive(Clone, Copy)]
struct Sample {
    x: f64,
    y: f64,
    share: f64,
    /// Whether this is the pixel's centre.
    central: bool,
}

/// The places of the s × s samples inside a pixel, row by row; verification computes the same points.
fn sample_places(s: u32) -> impl Iterator<Item = (f64, f64)> {
    let place = move |i: u32| (f64::from(i) + 0.5) / f64::from(s);
    (0..s).flat_map(move |j| (0..s).map(move |i| (place(i), place(j))))
}

/// The samples of a pixel: the grid, and the centre where no sample of the grid is there.
fn sample_grid(s: u32) -> Vec<Sample> {
    let share = 1.0 / (f64::from(s) * f64::from(s));
    let centre = (s * s / 2) as usize;
    let mut samples: Vec<Sample> = sample_places(s)
        .enumerate()
        .map(|(k, (x, y))| Sample {
            x,
            y,
            share,
            central: s % 2 == 1 && k == centre,
        })
        .collect();
    if s.is_multiple_of(2) {
        samples.push(Sample {
            x: 0.5,
            y: 0.5,
            share: 0.0,
            central: true,
        });
    }
    samples
}

/// The pixels of a block, row by row.
fn positions([x0, y0, x1, y1]: [u32; 4]) -> impl Iterator<Item = (u32, u32)> {
    (y0..y1).flat_map(move |y| (x0..x1).map(move |x| (x, y)))
}

struct Renderer<'a> {
    input: &'a RenderInput<'a>,
    view: &'a dyn View,
    shader: Shader<'a>,
    direct: Option<DirectPass<'a>>,
    samples: Vec<Sample>,
    width: u32,
}

impl Renderer<'_> {
    fn block(&self, block: [u32; 4]) -> Vec<Pixel> {
        let mut rays = RayBatch::default();
        let mut sights = Vec::new();
        for (x, y) in positions(block) {
            for sample in &self.samples {
                let sight = self.view.sight(f64::from(x) + sample.x, f64::from(y) + sample.y);
                if let Some(sight) = &sight {
                    shade::push_sight(&mut rays, sight, self.input.visibility);
                }
                sights.push(sight);
            }
        }
        let mut hits = HitBatch::default();
        self.input
            .visibility
            .closest_hits(&rays, Coherence::Coherent, &mut hits);
        let mut scratch = Scratch::default();
        let mut ray = 0;
        let mut sights = sights.into_iter();
        positions(block)
            .map(|(x, y)| {
                let mut pixel = Pixel::default();
                for (k, sample) in (0_u64..).zip(&self.samples) {
                    // The iterator holds one entry per position and sample.
                    let Some(Some(sight)) = sights.next() else { continue };
                    let point = self.shader.locate(&sight, &hits, ray);
                    ray += 1;
                    if sample.central {
                        pixel.centre = point;
                    }
                    let Some(point) = point.filter(|point| !point.back && sample.share > 0.0) else {
                        continue;
                    };
                    let index = u64::from(y) * u64::from(self.width) + u64::from(x);
                    let stream = index * self.samples.len() as u64 + k;
                    self.add(&mut pixel, &point, sample.share, stream, &mut scratch);
                }
                pixel
            })
            .collect()
    }

    fn add(&self, pixel: &mut Pixel, point: &SurfacePoint, share: f64, stream: u64, scratch: &mut Scratch) {
        let direct = self.direct.as_ref().map_or_else(DirectEstimate::default, |pass| {
            let at = DirectPoint {
                face: point.face,
                point: point.point,
                normal: point.normal,
                stream,
            };
            pass.estimate(&at, scratch)
        });
        let shade = self.shader.shade(point, direct.mean);
        for c in 0..3 {
            pixel.shade.irradiance[c] += share * shade.irradiance[c];
            pixel.shade.radiosity[c] += share * shade.radiosity[c];
            pixel.shade.albedo[c] += share * shade.albedo[c];
            pixel.direct.mean[c] += share * direct.mean[c];
            pixel.direct.variance[c] += share * share * direct.variance[c];
        }
    }
}
