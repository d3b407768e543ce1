//! Compares the pixels of an image with their expected content.

use super::answer::{Centre, PixelAnswer};
use super::error::VerifyError;
use super::light::Drawn;
use super::limits::Limits;
use super::points::Reference;
use super::report::{LayerCheck, LayerReport};
use super::rounding::Rounding;
use super::sheet::Sheet;
use crate::render::image::{Image, channel_names};

/// Three channels of one layer.
type Triple<'a> = [&'a [f32]; 3];

const RGB: [char; 3] = ['R', 'G', 'B'];
const XYZ: [char; 3] = ['X', 'Y', 'Z'];

/// The layers that verification uses.
pub(super) struct Layers<'a> {
    width: usize,
    n_pixels: usize,
    limits: Limits,
    direct: Triple<'a>,
    /// Irradiance, radiosity and radiance, if the image has them.
    light: Option<[Triple<'a>; 3]>,
    position: Triple<'a>,
    albedo: Option<Triple<'a>>,
    normal: Option<Triple<'a>>,
    depth: Option<&'a [f32]>,
    pub(super) patch: Option<&'a [u32]>,
    /// The standard error of the direct light.
    noise: Option<Triple<'a>>,
    /// The error of the solution and the variance of final gather.
    errors: Vec<Triple<'a>>,
    /// The number of gathered rays.
    samples: Option<&'a [u32]>,
    has_pixel_samples: bool,
    pub(super) reports: Vec<LayerReport>,
}

/// The result of one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Judged {
    pub(super) outside: bool,
    pub(super) misplaced: bool,
    pub(super) inconsistent: bool,
    /// The value in the image minus the exact one.
    pub(super) error: [f64; 3],
    /// The statistical, offset and rounding parts of the tolerance.
    pub(super) parts: [[f64; 3]; 3],
}

impl Judged {
    /// Returns whether a channel's error is within its tolerance; NaN is not.
    pub(super) fn is_within(&self, channel: usize) -> bool {
        let tolerance: f64 = self.parts.iter().map(|part| part[channel]).sum();
        self.error[channel].abs() <= tolerance
    }
}

impl<'a> Layers<'a> {
    pub(super) fn new(image: &'a Image, reference: &Reference<'_>) -> Result<Self, VerifyError> {
        let is_field = reference.attributes.field.is_some();
        let rgb = |prefix| triple(image, channel_names(prefix, RGB));
        // The form factors of a field are one channel, used for all three.
        let (direct, light, noise) = if is_field {
            let noise = image.f32("error").map(|error| [error; 3]);
            (triple(image, ["Y"; 3].map(str::to_owned))?, None, noise)
        } else {
            let light = [rgb("irradiance")?, rgb("radiosity")?, rgb("")?];
            let noise = if_given(image, "direct_error", RGB)?;
            (rgb("direct")?, Some(light), noise)
        };
        let colours = |prefix| {
            if is_field {
                Ok(None)
            } else {
                if_given(image, prefix, RGB)
            }
        };
        let (error, variance) = (colours("error")?, colours("variance")?);
        let mut layers = Self {
            width: image.width(),
            n_pixels: image.width() * image.height(),
            limits: Limits::new(reference, error),
            direct,
            light,
            position: triple(image, channel_names("P", XYZ))?,
            albedo: colours("albedo")?,
            normal: if_given(image, "N", XYZ)?,
            depth: image.f32("Z"),
            patch: image.u32("patch"),
            noise,
            errors: error.into_iter().chain(variance).collect(),
            samples: image.u32("samples"),
            has_pixel_samples: image.u32("pixel_samples").is_some(),
            reports: Vec::new(),
        };
        layers.reports = layers.how_checked(reference, (error.is_some(), variance.is_some()));
        Ok(layers)
    }

    /// Returns the check of each layer, in the order of the strength of the checks.
    fn how_checked(&self, reference: &Reference<'_>, (error, variance): (bool, bool)) -> Vec<LayerReport> {
        let is_field = self.light.is_none();
        let noise = if is_field { "error" } else { "direct_error" };
        let irradiance = if reference.nothing_reflects {
            LayerCheck::OtherLayers
        } else {
            LayerCheck::Bounds
        };
        let given = |is_given: bool, check| if is_given { check } else { LayerCheck::Missing };
        let mut rows = vec![(if is_field { "Y" } else { "direct" }, LayerCheck::ClosedForm)];
        if !is_field {
            rows.push(("albedo", given(self.albedo.is_some(), LayerCheck::Scene)));
        }
        rows.extend([
            ("N", given(self.normal.is_some(), LayerCheck::Scene)),
            ("P", LayerCheck::Scene),
            ("Z", given(self.depth.is_some(), LayerCheck::Scene)),
        ]);
        if !is_field {
            rows.extend([
                ("R,G,B", LayerCheck::OtherLayers),
                ("radiosity", LayerCheck::OtherLayers),
                ("irradiance", irradiance),
            ]);
        }
        rows.push((noise, given(self.noise.is_some(), LayerCheck::Bounds)));
        let more = [
            ("error", error),
            ("variance", variance),
            ("samples", self.samples.is_some()),
            ("pixel_samples", self.has_pixel_samples),
        ];
        let more = more.into_iter().filter(|(_, is_given)| *is_given);
        rows.extend(more.map(|(name, _)| (name, LayerCheck::Bounds)));
        rows.push(("patch", given(self.patch.is_some(), LayerCheck::Bounds)));
        rows.into_iter()
            .map(|(name, check)| LayerReport {
                name: name.to_owned(),
                check,
            })
            .collect()
    }

    /// Checks pixel k of a sheet.
    pub(super) fn judge(
        &self,
        sheet: &Sheet,
        k: usize,
        answer: &PixelAnswer,
        reference: &Reference<'_>,
        log_odds: f64,
    ) -> Judged {
        let index = sheet.index(k, self.width);
        let value = |layers: &Triple<'_>, c: usize| f64::from(layers[c][index]);
        let mut judged = Judged {
            misplaced: !self.is_placed(sheet, k, index, reference),
            inconsistent: !self.is_possible(index, reference),
            ..Judged::default()
        };
        let shown = match answer {
            PixelAnswer::Border => return judged,
            PixelAnswer::Background => {
                judged.outside = (0..3).any(|c| value(&self.direct, c).abs().to_bits() != 0);
                judged.inconsistent |= !self.is_black(index);
                return judged;
            }
            PixelAnswer::Surface(shown) => shown,
        };
        judged.inconsistent |= !shown.front && !self.is_black(index);
        let close = |found: f64, follows: f64| reference.layer_rounding().allows(found, follows, 0.0);
        for c in 0..3 {
            if let (Some(albedo), Some(own)) = (&self.albedo, shown.albedo) {
                judged.inconsistent |= !close(value(albedo, c), own[c]);
            }
            let Some([irradiance, radiosity, _]) = &self.light else {
                continue;
            };
            let (h, b) = (value(irradiance, c), value(radiosity, c));
            if let Some((exitance, reflectance)) = shown.material {
                judged.inconsistent |= !close(b, exitance[c] + reflectance[c] * h);
            }
            judged.inconsistent |= reference.nothing_reflects && !close(h, value(&self.direct, c));
        }
        if let Some((exact, offset)) = shown.irradiance {
            for c in 0..3 {
                judged.error[c] = value(&self.direct, c) - exact[c];
                judged.parts[0][c] = reference.statistical(c, exact[c].max(reference.leak(c, answer)), 1.0, log_odds);
                judged.parts[1][c] = offset[c].abs();
                judged.parts[2][c] = reference.rounding(c, exact[c]) + shown.rounding[c];
                judged.outside |= !judged.is_within(c);
            }
        }
        if let Some(drawn) = &shown.drawn {
            self.judge_drawn(&mut judged, index, drawn, reference);
            judged.outside |= drawn.odds > log_odds;
        }
        judged
    }

    /// Checks a pixel whose shadow rays were drawn again, so that their result has no noise.
    fn judge_drawn(&self, judged: &mut Judged, index: usize, drawn: &Drawn, reference: &Reference<'_>) {
        judged.outside = false;
        for c in 0..3 {
            let value = f64::from(self.direct[c][index]);
            let exact = value - judged.error[c];
            let [low, high] = [0, 1].map(|side| drawn.range[side][c]);
            judged.parts[0][c] = (exact - low).max(high - exact).max(0.0);
            let room = reference.rounding(c, high) + judged.parts[2][c];
            let is_between = low - room <= value && value <= high + room;
            judged.outside |= !is_between;
            if let (Some(noise), Some(stated)) = (&self.noise, drawn.error) {
                judged.inconsistent |= !Rounding::F32.allows(f64::from(noise[c][index]), stated[c], room);
            }
        }
    }

    /// Counts the pixels outside of all sheets that are not background.
    pub(super) fn count_wrong_gaps(&self, sheets: &[Sheet]) -> usize {
        let mut is_covered = vec![false; self.n_pixels];
        for sheet in sheets {
            for k in 0..sheet.answers.len() {
                is_covered[sheet.index(k, self.width)] = true;
            }
        }
        let gaps = (0..self.n_pixels).filter(|&index| !is_covered[index]);
        gaps.filter(|&index| !(self.is_black(index) && self.shows_nothing(index)))
            .count()
    }

    /// Returns whether position, normal, depth and patch are those of the pixel's centre.
    fn is_placed(&self, sheet: &Sheet, k: usize, index: usize, reference: &Reference<'_>) -> bool {
        let (face, point, slack) = match sheet.centres[k] {
            // The position is uncertain, but must be a number.
            Centre::Unsure => {
                let triples = [Some(self.position), self.normal, self.depth.map(|depth| [depth; 3])];
                return triples
                    .iter()
                    .flatten()
                    .flatten()
                    .all(|channel| channel[index].is_finite());
            }
            Centre::Nothing => return self.shows_nothing(index),
            Centre::Face { face, point, slack, .. } => (face, point, slack),
        };
        let plate = &reference.plates[face as usize];
        let depth = sheet.view.map_or(0.0, |(eye, axis)| axis.dot(point - eye));
        let is_at = |c: usize| Rounding::F32.allows(f64::from(self.position[c][index]), point[c], slack);
        // Normals may be stored as f16 even in a field, whose form factors are not.
        let halved = Rounding::of(reference.attributes.pixels);
        let looks = |normal: &Triple<'_>, c: usize| halved.allows(f64::from(normal[c][index]), plate.normal[c], 1e-9);
        (0..3).all(is_at)
            && self.normal.is_none_or(|normal| (0..3).all(|c| looks(&normal, c)))
            && self
                .depth
                .is_none_or(|layer| Rounding::F32.allows(f64::from(layer[index]), depth, slack))
            && self.patch.is_none_or(|patch| patch[index] != u32::MAX)
    }

    /// Returns whether position, normal, depth and patch are those of background.
    fn shows_nothing(&self, index: usize) -> bool {
        let triples = [Some(self.position), self.normal, self.depth.map(|depth| [depth; 3])];
        triples.iter().flatten().all(|channels| is_zero(channels, index))
            && self.patch.is_none_or(|patch| patch[index] == u32::MAX)
    }

    /// Returns whether all colours and their errors are 0.
    fn is_black(&self, index: usize) -> bool {
        let light = self.light.iter().flatten();
        let others = [Some(self.direct), self.albedo, self.noise];
        let mut all = light.chain(others.iter().flatten()).chain(&self.errors);
        all.all(|channels| is_zero(channels, index)) && self.samples.is_none_or(|samples| samples[index] == 0)
    }

    /// Returns whether a pixel's light is within the bounds of all pixels of the scene, and its radiance is radiosity/π.
    fn is_possible(&self, index: usize, reference: &Reference<'_>) -> bool {
        let limits = &self.limits;
        let rounding = reference.layer_rounding();
        let value = |layers: &Triple<'_>, c: usize| f64::from(layers[c][index]);
        let lies = |found: f64, least: f64, most: f64| {
            (found >= least || rounding.allows(found, least, 0.0))
                && (found <= most || rounding.allows(found, most, 0.0))
                && found.is_finite()
        };
        (0..3).all(|c| {
            let (direct, slack) = (value(&self.direct, c), limits.slack[c]);
            let light = self.light.iter().all(|[irradiance, radiosity, radiance]| {
                let (h, b) = (value(irradiance, c), value(radiosity, c));
                let [darkest, brightest] = limits.reflectance[c];
                lies(h, direct - slack, limits.irradiance[c])
                    && lies(b, darkest * h - slack, limits.exitance[c] + brightest * h + slack)
                    && rounding.allows(value(radiance, c), b / std::f64::consts::PI, 0.0)
            });
            let is_error = |layer: &Triple<'_>| (0.0..f64::INFINITY).contains(&value(layer, c));
            let brightest = limits.reflectance[c][1];
            lies(direct, 0.0, limits.direct[c])
                && light
                && self.albedo.iter().all(|albedo| lies(value(albedo, c), 0.0, brightest))
                && self
                    .noise
                    .iter()
                    .all(|noise| lies(value(noise, c), 0.0, limits.noise[c]))
                && self.errors.iter().all(is_error)
        })
    }
}

fn is_zero(channels: &Triple<'_>, index: usize) -> bool {
    channels.iter().all(|channel| channel[index].abs().to_bits() == 0)
}

fn triple(image: &Image, names: [String; 3]) -> Result<Triple<'_>, VerifyError> {
    let mut found: Triple<'_> = [&[]; 3];
    for (layer, name) in found.iter_mut().zip(names) {
        *layer = image.f32(&name).ok_or(VerifyError::MissingLayer(name))?;
    }
    Ok(found)
}

/// Returns three channels, or `None` if the image has none of them; it must have all or none.
fn if_given<'a>(image: &'a Image, prefix: &str, suffixes: [char; 3]) -> Result<Option<Triple<'a>>, VerifyError> {
    let names = channel_names(prefix, suffixes);
    let is_given = names.iter().any(|name| image.f32(name).is_some());
    is_given.then(|| triple(image, names)).transpose()
}
