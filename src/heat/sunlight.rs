//! The light of sun and sky on each patch.

use std::f64::consts::TAU;
use std::num::NonZeroUsize;

use glam::DVec3;

use super::boundary::{Sky, Sun};
use crate::form_factor::partial::{Lit, lit_part};
use crate::form_factor::{Fraction, Input};
use crate::geometry::gauss_legendre::rounded_rule;
use crate::geometry::polygon;
use crate::geometry::sampling::{Frame, PointStream, Sequence, UniformOnPolygon, cosine_direction};
use crate::matrix::operator::Block;
use crate::mesh::PatchId;
use crate::threads;
use crate::visibility::occluders::{OccluderIndex, PairVisibility};
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// The depth, in units of the patch's width, by which a neglected occluder may reach into the light of a patch; see [`OccluderIndex`].
const NEGLECTED: f64 = 1e-10;

/// The circles of directions in the disc of the sun, and in the coarser rule for the error estimate.
const CIRCLES: [NonZeroUsize; 2] = [
    NonZeroUsize::new(6).expect("positive"),
    NonZeroUsize::new(4).expect("positive"),
];

/// The number of directions on each circle, in units of the number of circles.
const PER_CIRCLE: usize = 4;

/// The rays from each patch that sees a part of the sky, the limits for all patches together and for one, and the seed.
const RAYS: usize = 1 << 14;
const MAX_RAYS: usize = 1 << 26;
const MIN_RAYS: usize = 256;
const SEED: u64 = 0x5ca1e;

/// The deviation from the vertical within which a normal counts as vertical.
const UPRIGHT: f64 = 1e-12;

/// The lit part of each patch, and the irradiance straight from the sun.
#[derive(Clone, Debug, PartialEq)]
pub struct Sunlight {
    /// The lit fraction of each patch's area, \[n\], for a disc its mean over the directions; 0 for patches that face away.
    pub fraction: Vec<f64>,
    /// Its error, \[n\].
    pub fraction_error: Vec<f64>,
    /// The mean irradiance straight from the sun, W·m⁻², \[n\].
    pub irradiance: Vec<f64>,
    /// Its error, W·m⁻², \[n\].
    pub irradiance_error: Vec<f64>,
}

impl Sunlight {
    /// Returns the light of a sun that does not shine on `n` patches.
    pub(crate) fn dark(n: usize) -> Self {
        Self {
            fraction: vec![0.0; n],
            fraction_error: vec![0.0; n],
            irradiance: vec![0.0; n],
            irradiance_error: vec![0.0; n],
        }
    }
}

/// The sunlight on each patch, in the channels of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Sunlit {
    /// Fractions, and irradiances by a sun of 1 W/m².
    pub light: Sunlight,
    /// The irradiance straight from the sun, W·m⁻², \[n, c\].
    pub irradiance: Block,
    /// Its error, W·m⁻², \[n, c\].
    pub error: Block,
}

impl Sunlit {
    /// Computes the light of a sun whose `irradiance` varies by channel; that of `sun` is ignored.
    #[must_use]
    pub fn new(input: Input<'_>, sun: &Sun, irradiance: &[f64]) -> Self {
        Self::of(&SunOccluders::new(input), input, sun, irradiance)
    }

    /// Returns the light of a sun that does not shine on `n` patches.
    pub(crate) fn dark(n: usize, n_channels: usize) -> Self {
        Self {
            light: Sunlight::dark(n),
            irradiance: Block::zeros(n, n_channels),
            error: Block::zeros(n, n_channels),
        }
    }

    /// Computes the light as [`new`](Self::new) does, with prepared occluders.
    pub(crate) fn of(occluders: &SunOccluders, input: Input<'_>, sun: &Sun, irradiance: &[f64]) -> Self {
        let one = Sun {
            irradiance: 1.0,
            ..*sun
        };
        let light = occluders.sunlight(input, &one);
        let block = |of_patches: &[f64]| {
            let rows = of_patches
                .iter()
                .flat_map(|own| irradiance.iter().map(move |strength| strength * own));
            Block::from_values(rows.collect(), irradiance.len())
        };
        Self {
            irradiance: block(&light.irradiance),
            error: block(&light.irradiance_error),
            light,
        }
    }
}

/// Computes the direct sunlight on each patch.
///
/// H = S f max(n · s, 0) with f the lit fraction of the patch, exact by clipping against the prism of every occluder along the light. Both sides of a face occlude. For a disc of angular radius r it
/// is the mean over directions s + u sin r, |u| ≤ 1, by 6 circles of 24 points (Gauss in |u|², the trapezium rule around).
///
/// Errors: the length of the shadow border times the error of an occluder's position (the rounding of coordinates, see [`OccluderIndex`], and 1e-10 of the patch), over the cosine. For a disc of N
/// directions also the difference to 4 circles of 16, and the standard deviation between directions over N^¾, the error of a border that crosses such a grid. Work: for each patch and direction a
/// traversal of a tree of the occluders, in parallel.
///
/// # Panics
/// If the mesh has no patch.
#[must_use]
pub fn sunlight(input: Input<'_>, sun: &Sun) -> Sunlight {
    SunOccluders::new(input).sunlight(input, sun)
}

/// The light from one direction on a patch.
#[derive(Clone, Copy, Debug, Default)]
struct Shone {
    /// The lit fraction.
    fraction: f64,
    fraction_error: f64,
    /// The lit fraction times the cosine.
    cosine: f64,
    cosine_error: f64,
}

impl Shone {
    fn add(&mut self, weight: f64, other: Self) {
        self.fraction += weight * other.fraction;
        self.fraction_error += weight * other.fraction_error;
        self.cosine += weight * other.cosine;
        self.cosine_error += weight * other.cosine_error;
    }
}

impl Sun {
    /// Returns the directions that represent the sun, each with its weight and its cosine to the middle.
    pub(super) fn directions(&self) -> Vec<(DVec3, f64, f64)> {
        if self.angular_radius_deg() > 0.0 {
            self.disc(CIRCLES[0])
        } else {
            vec![(self.direction(), 1.0, 1.0)]
        }
    }

    fn disc(&self, n_circles: NonZeroUsize) -> Vec<(DVec3, f64, f64)> {
        let frame = Frame::from_normal(self.direction());
        let edge = self.angular_radius_deg().to_radians().sin();
        let n_around = PER_CIRCLE * n_circles.get();
        let circle = |(k, (square, weight)): (usize, (f64, f64))| {
            let sine = edge * square.sqrt();
            let along = (1.0 - sine * sine).sqrt();
            let direction = move |j: usize| {
                // Successive circles are rotated, so that no two directions lie in one plane with the axis.
                let angle = TAU * (j as f64 + k as f64 / n_circles.get() as f64) / n_around as f64;
                let local = DVec3::new(sine * angle.cos(), sine * angle.sin(), along);
                (frame.to_world(local).normalize(), weight / n_around as f64, along)
            };
            (0..n_around).map(direction).collect::<Vec<_>>()
        };
        rounded_rule(n_circles)
            .into_iter()
            .enumerate()
            .flat_map(circle)
            .collect()
    }
}

/// The occluders of a scene, prepared for any number of suns.
pub(crate) struct SunOccluders {
    index: OccluderIndex,
    /// A length beyond the scene, m.
    reach: f64,
}

impl SunOccluders {
    /// Prepares the occluders.
    pub(crate) fn new(input: Input<'_>) -> Self {
        let (low, high) = input.scene.bounding_box();
        Self {
            index: OccluderIndex::new(input.scene),
            reach: 2.0 * low.distance(high),
        }
    }

    /// Computes the light as [`sunlight`] does, for the scene of these occluders.
    pub(crate) fn sunlight(&self, input: Input<'_>, sun: &Sun) -> Sunlight {
        let lamp = Lamp {
            input,
            index: &self.index,
            reach: self.reach,
        };
        lamp.sunlight(sun)
    }
}

/// The light of suns on the patches of a scene.
struct Lamp<'a> {
    input: Input<'a>,
    index: &'a OccluderIndex,
    /// A length beyond the scene, m.
    reach: f64,
}

impl Lamp<'_> {
    fn sunlight(&self, sun: &Sun) -> Sunlight {
        let of_patch = |i: usize| {
            let [fine, coarse] = if sun.angular_radius_deg() > 0.0 {
                CIRCLES.map(|n_circles| self.of_disc(i, sun, n_circles))
            } else {
                [self.shone_on(i, sun.direction()); 2]
            };
            let difference = |a: f64, b: f64| (a - b).abs();
            let [fraction_error, cosine_error] = [
                fine.fraction_error + difference(fine.fraction, coarse.fraction),
                fine.cosine_error + difference(fine.cosine, coarse.cosine),
            ];
            let strength = sun.irradiance();
            [
                fine.fraction.min(1.0),
                fraction_error.min(1.0),
                strength * fine.cosine,
                strength * cosine_error,
            ]
        };
        let n = self.input.mesh.n_patches();
        let found: Vec<[f64; 4]> = threads::collect(n, of_patch);
        let column = |k: usize| found.iter().map(|row| row[k]).collect();
        Sunlight {
            fraction: column(0),
            fraction_error: column(1),
            irradiance: column(2),
            irradiance_error: column(3),
        }
    }

    fn shone_on(&self, patch: usize, direction: DVec3) -> Shone {
        let own = &self.input.mesh.patches[patch];
        let cosine = own.normal.dot(direction);
        if cosine <= 0.0 {
            return Shone::default();
        }
        let corners = self.input.mesh.polygon(PatchId::from_index(patch));
        // The far end of the prism over the patch, with reversed winding.
        let far: Vec<DVec3> = corners.iter().rev().map(|&v| v + self.reach * direction).collect();
        let between = self.index.between(&corners, &far);
        let perimeter = polygon::perimeter(&corners);
        let whole = Lit {
            area: own.area,
            border: 0.0,
        };
        let lit = match &between.visibility {
            PairVisibility::Full => whole,
            PairVisibility::None => Lit { area: 0.0, ..whole },
            PairVisibility::Partial(among) => {
                let occluders = self.index.occluders(&corners, &far, among);
                lit_part(&corners, own.normal, direction, &occluders)
            }
        };
        let neglected = NEGLECTED * perimeter;
        let touched = if between.touched { perimeter } else { 0.0 };
        let off = (lit.border + touched) * self.index.slack() + perimeter * neglected;
        let fraction = (lit.area / own.area).clamp(0.0, 1.0);
        let fraction_error = match between.visibility {
            PairVisibility::Full if !between.touched => 0.0,
            _ => (off / cosine / own.area).min(1.0),
        };
        Shone {
            fraction,
            fraction_error,
            cosine: fraction * cosine,
            cosine_error: fraction_error * cosine,
        }
    }

    /// Returns the mean over the disc of the sun, in which each direction has the weight of its part of the disc.
    fn of_disc(&self, patch: usize, sun: &Sun, n_circles: NonZeroUsize) -> Shone {
        let mut mean = Shone::default();
        let mut squares = [0.0; 2];
        let directions = sun.disc(n_circles);
        for &(direction, share, along) in &directions {
            // The irradiance of a plane across the axis is the visible area of the disc: dω cos = du dv.
            let mut shone = self.shone_on(patch, direction);
            shone.cosine /= along;
            shone.cosine_error /= along;
            squares[0] += share * shone.fraction.powi(2);
            squares[1] += share * shone.cosine.powi(2);
            mean.add(share, shone);
        }
        // The border of an occluder is unresolved between the directions.
        let unseen = directions.len() as f64;
        let missed = |square: f64, own: f64| (square - own * own).max(0.0).sqrt() / unseen.powf(0.75);
        mean.fraction_error += missed(squares[0], mean.fraction);
        mean.cosine_error += missed(squares[1], mean.cosine);
        mean
    }
}

/// Returns the fraction of the light of each patch that escapes above the horizon of a sky, \[n\], from `escaped`, the fraction that escapes at all.
///
/// A patch that faces up sees no other part of the surroundings, one that faces down none of the sky, and one that sees no face has (1 + n · u) / 2. For all others, rays find the part of the escaping
/// light above the horizon: 2^14 for each patch, or fewer to limit them to 2^26 in all, but at least 256. Errors: that of `escaped`, and sqrt(p (1 − p) / N) of the N rays that escape, with p = (k + 1) / (N + 2) for k above.
#[must_use]
pub fn above_horizon(input: Input<'_>, sky: &Sky, escaped: &[Fraction], sees_nothing: &[bool]) -> Vec<Fraction> {
    let n = input.mesh.n_patches();
    let n_rays = (MAX_RAYS / n.max(1)).clamp(MIN_RAYS, RAYS);
    let of_patch = |buffers: &mut (RayBatch, HitBatch), i: usize| {
        let upwards = input.mesh.patches[i].normal.dot(sky.up());
        let all = escaped[i];
        if all.value + all.error() <= 0.0 || upwards >= 1.0 - UPRIGHT {
            return all;
        }
        if upwards <= UPRIGHT - 1.0 {
            return Fraction::default();
        }
        if sees_nothing[i] {
            return Fraction {
                value: 0.5 * (1.0 + upwards),
                ..Fraction::default()
            };
        }
        let [n_above, n_escaped] = counted(input, i, sky.up(), n_rays, buffers);
        let p = (n_above + 1.0) / (n_escaped + 2.0);
        let share = if n_escaped > 0.0 { n_above / n_escaped } else { 0.5 };
        let variance = if n_escaped > 0.0 {
            p * (1.0 - p) / n_escaped
        } else {
            0.25
        };
        Fraction {
            value: share * all.value,
            common: share * all.common,
            variance: share * share * all.variance + all.value * all.value * variance,
        }
    };
    threads::collect_with(n, || (RayBatch::default(), HitBatch::default()), of_patch)
}

/// Returns the number of rays from a patch that escape above the horizon, and of all that escape.
fn counted(input: Input<'_>, i: usize, up: DVec3, n_rays: usize, buffers: &mut (RayBatch, HitBatch)) -> [f64; 2] {
    let (rays, hits) = buffers;
    let visibility = input.visibility;
    let normal = input.mesh.patches[i].normal;
    let place = UniformOnPolygon::new(&input.mesh.polygon(PatchId::from_index(i)));
    let frame = Frame::from_normal(normal);
    let start = normal * visibility.offset() - visibility.frame_origin();
    let mut points = PointStream::new(Sequence::Sobol, SEED, i as u64);
    rays.clear();
    let mut heights = Vec::with_capacity(n_rays);
    for _ in 0..n_rays {
        let [u, v, s, t] = points.next_point();
        let direction = frame.to_world(cosine_direction(s, t));
        heights.push(direction.dot(up));
        rays.push_ray(place.point(u, v) + start, direction);
    }
    visibility.closest_hits(rays, Coherence::Incoherent, hits);
    let mut counts = [0.0; 2];
    for (k, height) in heights.into_iter().enumerate() {
        if hits.face(k).is_none() {
            counts[0] += f64::from(u8::from(height > 0.0));
            counts[1] += 1.0;
        }
    }
    counts
}
