//! Renders views to pixels, block by block.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use super::direct::{DirectPass, Scratch};
use super::direct_point::{DirectEstimate, DirectPoint};
use super::display::Watcher;
use super::error::RenderError;
use super::gather::{GatherScratch, Gathered, Gatherer, PixelPart, first_rays};
use super::image::Image;
use super::input::RenderInput;
use super::kept::{BlockState, KeptRounds, Round};
use super::pixel::{Canvas, Kinds, Pixel};
use super::rare::LightPool;
use super::samples::{FirstLook, PixelSamples};
use super::settings::RenderSettings;
use super::shade::{self, Shader, SurfacePoint};
use super::shared;
use super::view::View;
use crate::progress::Progress;
use crate::scene::SurfaceId;
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// The side of the square blocks of pixels that are the unit of parallel work.
const BLOCK_SIDE: u32 = 32;

/// The number of blocks that are rendered before their pixels are stored.
const BLOCKS_AT_A_TIME: usize = 256;

/// The edges of a block: left, top, right, bottom.
type Block = [u32; 4];

/// Iterates over the pixels of a block, row by row.
fn positions([x0, y0, x1, y1]: Block) -> impl Iterator<Item = (u32, u32)> {
    (y0..y1).flat_map(move |y| (x0..x1).map(move |x| (x, y)))
}

/// Returns an error if the caller asked to stop.
fn go_on(progress: &dyn Progress) -> Result<(), RenderError> {
    if progress.is_cancelled() {
        Err(RenderError::Interrupted)
    } else {
        Ok(())
    }
}

fn locked(state: &Mutex<BlockState>) -> MutexGuard<'_, BlockState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The view of a block.
struct Seen {
    /// The hits at the pixels' centres.
    centres: Vec<Option<SurfacePoint>>,
    /// The number of samples of each pixel.
    n_samples: Vec<u32>,
    /// The front-facing parts of all pixels, pixel by pixel.
    parts: Vec<PixelPart>,
    /// The visible sky of each pixel: π times its radiance, by its share of the pixel.
    sky: Vec<[f64; 3]>,
}

/// The sums over all samples that show the front of one surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct SurfaceSum {
    pub(super) n_samples: u64,
    /// The sum of the samples' shares of their pixels.
    pub(super) share: f64,
    /// The sum of the first channel of the irradiance times the share.
    pub(super) irradiance: f64,
}

/// The sums of the visible surfaces.
pub(super) type SurfaceSums = BTreeMap<SurfaceId, SurfaceSum>;

/// The input of rendering.
pub(super) struct Renderer<'a> {
    pub(super) input: &'a RenderInput<'a>,
    pub(super) view: &'a dyn View,
    pub(super) settings: &'a RenderSettings,
    pub(super) shader: Shader<'a>,
    pub(super) direct: Option<DirectPass<'a>>,
    pub(super) gatherer: Option<Gatherer<'a>>,
    pub(super) samples: PixelSamples,
    pub(super) size: (u32, u32),
    pub(super) watcher: &'a dyn Watcher,
}

impl Renderer<'_> {
    /// Renders the whole image; without final gather also sums over the visible part of each surface.
    ///
    /// # Errors
    /// [`RenderError::Interrupted`] if `progress` is cancelled.
    pub(super) fn image(&self, progress: &dyn Progress) -> Result<(Image, SurfaceSums), RenderError> {
        let (width, height) = self.size;
        let blocks: Vec<Block> = (0..height.div_ceil(BLOCK_SIDE))
            .flat_map(|j| (0..width.div_ceil(BLOCK_SIDE)).map(move |i| [i * BLOCK_SIDE, j * BLOCK_SIDE]))
            .map(|[x, y]| [x, y, (x + BLOCK_SIDE).min(width), (y + BLOCK_SIDE).min(height)])
            .collect();
        let kinds = Kinds {
            direct: self.direct.is_some(),
            gathered: self.gatherer.is_some(),
            error: self.input.error.is_some(),
            adaptive: self.samples.is_adaptive(),
        };
        let mut canvas = Canvas::new(width as usize, height as usize, kinds);
        if let Some(gatherer) = &self.gatherer {
            self.gather_all(gatherer, &blocks, &mut canvas, progress)?;
            return Ok((canvas.into_image(), SurfaceSums::new()));
        }
        let mut sums = SurfaceSums::new();
        progress.begin("render", blocks.len() as u64);
        // A limited number of blocks at a time keeps pixels in f64 from filling the memory.
        let render = |k: usize| {
            let rendered = (!progress.is_cancelled()).then(|| self.block(blocks[k]))?;
            self.show(blocks[k], rendered.0.iter().map(Pixel::radiance));
            progress.advance(1);
            Some(rendered)
        };
        let sizes = (blocks.len(), BLOCKS_AT_A_TIME);
        shared::for_each(progress, sizes, render, |k, (pixels, own)| {
            canvas.set_all(positions(blocks[k]), &pixels);
            for (surface, of_block) in own {
                let sum = sums.entry(surface).or_default();
                sum.n_samples += of_block.n_samples;
                sum.share += of_block.share;
                sum.irradiance += of_block.irradiance;
            }
        })?;
        Ok((canvas.into_image(), sums))
    }

    /// Renders with final gather: rounds of pilot rays over the whole image, and one round of the rays of the mean for each pixel.
    ///
    /// Each round of pilot rays is as long as all before it together.
    fn gather_all(
        &self,
        gatherer: &Gatherer<'_>,
        blocks: &[Block],
        canvas: &mut Canvas,
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        let kept = progress.checkpoint().map(|checkpoint| {
            KeptRounds::open(
                checkpoint,
                &self.input.fingerprint(self.view, self.settings),
                blocks.len(),
            )
        });
        progress.begin("render", blocks.len() as u64);
        let begun = |k: usize| {
            let (pixels, _) = (!progress.is_cancelled()).then(|| self.block(blocks[k]))?;
            let gathered = vec![Gathered::default(); pixels.len()];
            let mut state = BlockState {
                pixels,
                gathered,
                rare: None,
                n_rounds: 0,
            };
            if let Some(kept) = &kept {
                kept.restore(k, &mut state);
            }
            self.show(blocks[k], state.radiance());
            progress.advance(1);
            Some(state)
        };
        let mut states = Vec::with_capacity(blocks.len());
        let sizes = (blocks.len(), blocks.len().max(1));
        shared::for_each(progress, sizes, begun, |_, state| states.push(Mutex::new(state)))?;
        let is_shared = progress.ranks().size() > 1;
        let mut n_rounds = 0;
        loop {
            go_on(progress)?;
            let open: Vec<(usize, u32)> = states
                .iter()
                .map(locked)
                .enumerate()
                .filter_map(|(k, state)| state.is_open().then_some((k, state.n_rounds)))
                .collect();
            let n_open = open.len();
            // After the deadline pixels keep the stated noise of their rounds.
            if n_open == 0 || n_rounds > 0 && progress.is_late() {
                break;
            }
            n_rounds += 1;
            progress.begin("gather", n_open as u64);
            let round = |number: usize| {
                let (k, _) = open[number];
                let mut state = locked(&states[k]);
                // An interrupted round is discarded.
                let round = self.gather_round(gatherer, blocks[k], &state, progress)?;
                if let Some(kept) = &kept {
                    kept.keep(k, &state, &round);
                }
                state.end_round(&round);
                self.show(blocks[k], state.radiance());
                progress.advance(1);
                Some(is_shared.then_some(round))
            };
            let all = (n_open, n_open);
            shared::for_each(progress, all, round, |number, round| {
                let (k, n_before) = open[number];
                let mut state = locked(&states[k]);
                if state.n_rounds == n_before {
                    let fits = round.is_some_and(|round| state.end_round(&round));
                    assert!(fits, "ranks have equal states");
                    self.show(blocks[k], state.radiance());
                }
            })?;
        }
        let states = states
            .into_iter()
            .map(|state| state.into_inner().unwrap_or_else(PoisonError::into_inner));
        for (mut state, &block) in states.zip(blocks) {
            for (pixel, gathered) in state.pixels.iter_mut().zip(&state.gathered) {
                pixel.add_gathered(gathered);
            }
            canvas.set_all(positions(block), &state.pixels);
        }
        Ok(())
    }

    fn show(&self, [x0, y0, x1, y1]: Block, radiance: impl Iterator<Item = [f32; 3]>) {
        let radiance: Vec<[f32; 3]> = radiance.collect();
        self.watcher.pixels(x0, y0, x1 - x0, y1 - y0, &radiance);
    }

    /// Traces one more round; returns `None` if the caller asked to stop.
    fn gather_round(
        &self,
        gatherer: &Gatherer<'_>,
        block: Block,
        state: &BlockState,
        progress: &dyn Progress,
    ) -> Option<Round> {
        let parts = self.look(block).parts;
        // Later rounds have only the pixels that need them, whose rays do not represent the others.
        let mut scratch = GatherScratch {
            pool: state.rare.is_none().then(LightPool::default),
            ..GatherScratch::default()
        };
        let n_first = first_rays(parts.chunk_by(|a, b| a.pixel == b.pixel).count());
        let mut rest = parts.as_slice();
        let mut next = state.gathered.clone();
        for (k, gathered) in next.iter_mut().enumerate() {
            if progress.is_cancelled() {
                return None;
            }
            let n_own = rest.iter().take_while(|part| part.pixel == k).count();
            let (own, others) = rest.split_at(n_own);
            rest = others;
            if !gathered.is_finished() {
                gatherer.continue_with(own, n_first, gathered, &mut scratch);
            }
        }
        let rare = state
            .rare
            .unwrap_or_else(|| scratch.pool.unwrap_or_default().rare_light());
        let mut open = Vec::new();
        for ((pixel, before), mut gathered) in state.pixels.iter().zip(&state.gathered).zip(next) {
            if before.is_finished() {
                continue;
            }
            if gathered.n_rays() > 0 {
                gatherer.judge(pixel.shade.irradiance, &rare, &mut gathered);
            }
            open.push(gathered);
        }
        Some(Round { open, rare })
    }

    /// Finds the surface points in a block's samples.
    fn look(&self, block: Block) -> Seen {
        let (first, n_samples) = self.first_look(block);
        let n_first = self.samples.n_first();
        let wanted = || positions(block).zip(&n_samples);
        let more = wanted().flat_map(|(pixel, &n)| self.places(pixel, n_first, n));
        let mut more = self.trace(more).into_iter();
        let centres = match self.samples.centre() {
            Some(centre) => {
                let of_pixels = first.chunks_exact(n_first as usize);
                of_pixels.map(|of_pixel| of_pixel[centre]).collect()
            }
            None => self.trace(positions(block).map(|(x, y)| (f64::from(x) + 0.5, f64::from(y) + 0.5))),
        };
        let mut parts = Vec::new();
        let mut sky = vec![[0.0; 3]; n_samples.len()];
        for (pixel, ((position, &n), of_pixel)) in wanted().zip(first.chunks_exact(n_first as usize)).enumerate() {
            let found = of_pixel
                .iter()
                .copied()
                .chain(more.by_ref().take((n - n_first) as usize));
            let first_stream = self.number(position) * self.samples.n_streams();
            for (sample, point) in (0..).zip(found) {
                let stream = first_stream + u64::from(sample);
                if point.is_none() {
                    let own = self.sky_behind(position, sample);
                    (0..3).for_each(|c| sky[pixel][c] += own[c] / f64::from(n));
                }
                if let Some(point) = point.filter(|point| !point.back) {
                    parts.push(PixelPart {
                        pixel,
                        point,
                        share: 1.0 / f64::from(n),
                        stream,
                    });
                }
            }
        }
        Seen {
            centres,
            n_samples,
            parts,
            sky,
        }
    }

    /// Returns π times the radiance of the sky behind a sample that shows no surface.
    fn sky_behind(&self, pixel: (u32, u32), sample: u32) -> [f64; 3] {
        let Some(sky) = &self.input.outdoors.sky else {
            return [0.0; 3];
        };
        let place = self.places(pixel, sample, sample + 1).next();
        let sight = place.and_then(|(x, y)| self.view.sight(x, y));
        sight.map_or([0.0; 3], |sight| sky.behind(&sight))
    }

    /// Returns the surface points in the first samples of a block's pixels, and the number of samples that each pixel needs.
    fn first_look(&self, block: Block) -> (Vec<Option<SurfacePoint>>, Vec<u32>) {
        let n_first = self.samples.n_first();
        let places = |at: Block| positions(at).flat_map(|pixel| self.places(pixel, 0, n_first));
        let [x0, y0, x1, y1] = block;
        if !self.samples.is_adaptive() {
            return (self.trace(places(block)), vec![n_first; positions(block).count()]);
        }
        let corner = (x0.saturating_sub(1), y0.saturating_sub(1));
        let around = [corner.0, corner.1, (x1 + 1).min(self.size.0), (y1 + 1).min(self.size.1)];
        let places: Vec<(f64, f64)> = places(around).collect();
        let found = self.trace(places.iter().copied());
        let (n_first, width) = (n_first as usize, (around[2] - corner.0) as usize);
        let first_look = FirstLook {
            scene: self.input.scene,
            places: &places,
            found: &found,
            width,
            n_first,
            corner,
        };
        let numbers = self.samples.numbers();
        let n_samples = positions(block).map(|pixel| numbers[first_look.edge_level(pixel)]);
        let of_pixel = |(x, y): (u32, u32)| {
            let pixel = (y - corner.1) as usize * width + (x - corner.0) as usize;
            &found[pixel * n_first..][..n_first]
        };
        (
            positions(block).flat_map(of_pixel).copied().collect(),
            n_samples.collect(),
        )
    }

    /// Returns the number of a pixel, along the rows of the image.
    fn number(&self, (x, y): (u32, u32)) -> u64 {
        u64::from(y) * u64::from(self.size.0) + u64::from(x)
    }

    /// Returns the image coordinates of samples of a pixel.
    fn places(&self, pixel: (u32, u32), from: u32, to: u32) -> impl Iterator<Item = (f64, f64)> {
        let (x, y) = (f64::from(pixel.0), f64::from(pixel.1));
        let inside = self.samples.places(self.number(pixel), from, to);
        inside.map(move |(dx, dy)| (x + dx, y + dy))
    }

    /// Finds the surface points at image coordinates.
    fn trace(&self, places: impl Iterator<Item = (f64, f64)>) -> Vec<Option<SurfacePoint>> {
        let mut rays = RayBatch::default();
        let mut sights = Vec::new();
        for (x, y) in places {
            let sight = self.view.sight(x, y);
            if let Some(sight) = &sight {
                shade::push_sight(&mut rays, sight, self.input.visibility);
            }
            sights.push(sight);
        }
        let mut hits = HitBatch::default();
        self.input
            .visibility
            .closest_hits(&rays, Coherence::Coherent, &mut hits);
        let mut ray = 0;
        let found = sights.iter().map(|sight| {
            let sight = sight.as_ref()?;
            ray += 1;
            self.shader.locate(sight, &hits, ray - 1)
        });
        found.collect()
    }

    fn block(&self, block: Block) -> (Vec<Pixel>, SurfaceSums) {
        let seen = self.look(block);
        let mut pixels: Vec<Pixel> = seen
            .centres
            .into_iter()
            .zip(seen.n_samples)
            .zip(seen.sky)
            .map(|((centre, n_samples), sky)| {
                let mut pixel = Pixel {
                    n_samples,
                    centre,
                    ..Pixel::default()
                };
                pixel.shade.radiosity = sky;
                pixel
            })
            .collect();
        let mut scratch = Scratch::default();
        let mut sums = SurfaceSums::new();
        for part in &seen.parts {
            let [irradiance, ..] = self.add(&mut pixels[part.pixel], part, &mut scratch);
            let surface = self.input.mesh.patches[part.point.patch.patch.0 as usize].surface;
            let sum = sums.entry(surface).or_default();
            sum.n_samples += 1;
            sum.share += part.share;
            sum.irradiance += part.share * irradiance;
        }
        (pixels, sums)
    }

    /// Adds a part to its pixel, and returns its irradiance.
    fn add(&self, pixel: &mut Pixel, part: &PixelPart, scratch: &mut Scratch) -> [f64; 3] {
        let PixelPart { point, share, .. } = part;
        let direct = self.direct.as_ref().map_or_else(DirectEstimate::default, |pass| {
            let at = DirectPoint {
                face: point.face,
                patch: point.patch.patch,
                point: point.point,
                normal: point.normal,
                stream: part.stream,
            };
            pass.estimate(&at, scratch)
        });
        let shade = self.shader.shade(point, direct.mean);
        let error = self.input.error.map_or([0.0; 3], |block| {
            shade::channels(block.row(point.patch.patch.0 as usize))
        });
        for c in 0..3 {
            pixel.shade.irradiance[c] += share * shade.irradiance[c];
            pixel.shade.radiosity[c] += share * shade.radiosity[c];
            pixel.shade.albedo[c] += share * shade.albedo[c];
            pixel.direct.mean[c] += share * direct.mean[c];
            pixel.direct.variance[c] += share * share * direct.variance[c];
        }
        for (sum, of_patch) in pixel.error.iter_mut().zip(error) {
            *sum += share * of_patch;
        }
        shade.irradiance
    }
}
