//! Pixels, and their conversion to layers.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::direct_point::DirectEstimate;
use super::gather::Gathered;
use super::image::{Image, Samples, channel_names};
use super::shade::{Shade, SurfacePoint};

/// All values of one pixel.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Pixel {
    pub(super) shade: Shade,
    pub(super) direct: DirectEstimate,
    /// The variance of the irradiance, and the number of gathered rays.
    pub(super) variance: [f64; 3],
    pub(super) n_rays: u32,
    /// The number of its samples.
    pub(super) n_samples: u32,
    /// The estimated error of the solution.
    pub(super) error: [f64; 3],
    /// The hit at the pixel's centre.
    pub(super) centre: Option<SurfacePoint>,
}

impl Pixel {
    /// Returns L = B/π.
    pub(super) fn radiance(&self) -> [f32; 3] {
        self.shade.radiosity.map(|b| single(b / PI))
    }

    /// Adds the gathered light.
    pub(super) fn add_gathered(&mut self, gathered: &Gathered) {
        let [irradiance, reflected, variance] = gathered.estimate();
        for c in 0..3 {
            self.shade.irradiance[c] += irradiance[c];
            self.shade.radiosity[c] += reflected[c];
            self.variance[c] = variance[c] + self.direct.variance[c];
        }
        self.n_rays = gathered.n_rays();
    }
}

type Value = fn(&Pixel) -> [f64; 3];

const RGB: [char; 3] = ['R', 'G', 'B'];
const XYZ: [char; 3] = ['X', 'Y', 'Z'];

/// The layers of every image; the empty prefix is the image itself.
const TRIPLES: [(&str, [char; 3], Value); 6] = [
    ("", RGB, |pixel| pixel.shade.radiosity.map(|b| b / PI)),
    ("irradiance", RGB, |pixel| pixel.shade.irradiance),
    ("radiosity", RGB, |pixel| pixel.shade.radiosity),
    ("albedo", RGB, |pixel| pixel.shade.albedo),
    ("N", XYZ, |pixel| {
        pixel.centre.map_or([0.0; 3], |at| at.normal.to_array())
    }),
    ("P", XYZ, |pixel| {
        pixel.centre.map_or([0.0; 3], |at| at.point.to_array())
    }),
];

/// The layers of a direct pass.
const DIRECT_TRIPLES: [(&str, [char; 3], Value); 2] = [
    ("direct", RGB, |pixel| pixel.direct.mean),
    ("direct_error", RGB, |pixel| pixel.direct.variance.map(f64::sqrt)),
];

/// The layer of final gather.
const VARIANCE: (&str, [char; 3], Value) = ("variance", RGB, |pixel| pixel.variance);

/// The layer of the solution's error.
const ERROR: (&str, [char; 3], Value) = ("error", RGB, |pixel| pixel.error);

/// The optional layers of an image.
#[expect(
    clippy::struct_excessive_bools,
    reason = "any of these groups of layers goes with any other"
)]
#[derive(Clone, Copy, Debug)]
pub(super) struct Kinds {
    pub(super) direct: bool,
    pub(super) gathered: bool,
    pub(super) error: bool,
    /// True if pixels have different numbers of samples.
    pub(super) adaptive: bool,
}

/// Three layers under construction.
struct Triple {
    prefix: &'static str,
    suffixes: [char; 3],
    value: Value,
    channels: [Vec<f32>; 3],
}

/// An image under construction.
pub(super) struct Canvas {
    width: usize,
    height: usize,
    triples: Vec<Triple>,
    depth: Vec<f32>,
    patch: Vec<u32>,
    samples: Option<Vec<u32>>,
    pixel_samples: Option<Vec<u32>>,
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize, kinds: Kinds) -> Self {
        let n = width * height;
        let direct: &[_] = if kinds.direct { &DIRECT_TRIPLES } else { &[] };
        let variance = kinds.gathered.then_some(&VARIANCE);
        let error = kinds.error.then_some(&ERROR);
        let triples = TRIPLES
            .iter()
            .chain(direct)
            .chain(variance)
            .chain(error)
            .map(|&(prefix, suffixes, value)| Triple {
                prefix,
                suffixes,
                value,
                channels: std::array::from_fn(|_| vec![0.0; n]),
            })
            .collect();
        Self {
            width,
            height,
            triples,
            depth: vec![0.0; n],
            patch: vec![u32::MAX; n],
            samples: kinds.gathered.then(|| vec![0; n]),
            pixel_samples: kinds.adaptive.then(|| vec![0; n]),
        }
    }

    /// Sets pixels, given in the order of their positions.
    pub(super) fn set_all(&mut self, positions: impl Iterator<Item = (u32, u32)>, pixels: &[Pixel]) {
        for ((x, y), pixel) in positions.zip(pixels) {
            self.set(x, y, pixel);
        }
    }

    fn set(&mut self, x: u32, y: u32, pixel: &Pixel) {
        let k = y as usize * self.width + x as usize;
        for triple in &mut self.triples {
            for (channel, value) in triple.channels.iter_mut().zip((triple.value)(pixel)) {
                channel[k] = single(value);
            }
        }
        if let Some(samples) = &mut self.samples {
            samples[k] = pixel.n_rays;
        }
        if let Some(pixel_samples) = &mut self.pixel_samples {
            pixel_samples[k] = pixel.n_samples;
        }
        if let Some(at) = &pixel.centre {
            self.depth[k] = single(at.depth);
            self.patch[k] = at.patch.patch.0;
        }
    }

    pub(super) fn into_image(self) -> Image {
        let mut image = Image::new(self.width, self.height);
        for triple in self.triples {
            let names = channel_names(triple.prefix, triple.suffixes);
            for (name, samples) in names.iter().zip(triple.channels) {
                image.insert(name, Samples::F32(samples));
            }
        }
        image.insert("Z", Samples::F32(self.depth));
        if let Some(samples) = self.samples {
            image.insert("samples", Samples::U32(samples));
        }
        if let Some(pixel_samples) = self.pixel_samples {
            image.insert("pixel_samples", Samples::U32(pixel_samples));
        }
        image.insert("patch", Samples::U32(self.patch));
        image
    }
}

#[expect(clippy::cast_possible_truncation, reason = "image layers are f32 by design")]
fn single(x: f64) -> f32 {
    x as f32
}
