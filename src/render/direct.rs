//! The irradiance straight from the emitters, integrated at every pixel.

use std::num::NonZeroU32;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::direct_exact::{ClearParts, SeenByPatch};
use super::direct_point::{DirectEstimate, DirectPoint, ShadowRays};
use super::outdoors::DistantSun;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon;
use crate::geometry::sampling::{Frame, PointStream, Sequence, UniformOnPolygon};
use crate::mesh::Mesh;
use crate::scene::{FaceId, Scene};
use crate::visibility::{Coherence, HitBatch, Visibility};

/// The method that finds the direct irradiance of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DirectMethod {
    /// No direct pass: all irradiance is interpolated from the patches.
    #[default]
    Off,
    /// Cosine-distributed rays: H = 1/n Σ E(front hit by ray k).
    ///
    /// Unbiased, and independent of the emitters' shapes. The error falls at least as n^(−1/2), best with n a power of two.
    CosineRays {
        /// Rays per sample of a pixel.
        n: NonZeroU32,
    },
    /// The exact form factor to every emitting face, times its visible fraction: H = Σ_j E_j F(x → j) V_j.
    ///
    /// V = Σ w_k v_k / Σ w_k over n points of the face, with v = 1 where a shadow ray arrives and w = cos θ cos θ′ / r². Exact where the
    /// face is fully visible or hidden; in a penumbra consistent, with a bias of order 1/n.
    /// The time grows with pixels × emitting faces × n.
    Polygons {
        /// Shadow rays per emitting face and sample of a pixel.
        n: NonZeroU32,
    },
    /// The exact form factor to the visible part of every emitting face: H = Σ_j E_j F(x → visible part of j), in f64 and without rays.
    ///
    /// Each face is clipped against the occluders between it and the point's patch (see [`VisibleFactor`](crate::form_factor::partial::VisibleFactor)).
    /// No noise; the error is that of rounding. The time grows with pixels × emitting faces × occluders in between.
    Exact,
}

impl DirectMethod {
    /// The default number of rays of [`CosineRays`](Self::CosineRays).
    pub const RAYS: NonZeroU32 = NonZeroU32::MIN.saturating_add(4095);

    /// The default number of shadow rays of [`Polygons`](Self::Polygons).
    pub const SHADOW_RAYS: NonZeroU32 = NonZeroU32::MIN.saturating_add(15);

    /// Returns the default method of an image.
    ///
    /// It is [`Off`](Self::Off) where patches are shown `flat`, [`CosineRays`](Self::CosineRays), whose noise is known, in an unfolded view, which is for checks, and else
    /// [`Polygons`](Self::Polygons).
    #[must_use]
    pub fn suited(is_unfolded: bool, flat: bool) -> Self {
        match (is_unfolded, flat) {
            (_, true) => Self::Off,
            (true, false) => Self::CosineRays { n: Self::RAYS },
            (false, false) => Self::Polygons { n: Self::SHADOW_RAYS },
        }
    }

    /// Returns the method with another number of rays; `None` if it traces none.
    #[must_use]
    pub fn with_rays(self, n: NonZeroU32) -> Option<Self> {
        match self {
            Self::CosineRays { .. } => Some(Self::CosineRays { n }),
            Self::Polygons { .. } => Some(Self::Polygons { n }),
            Self::Off | Self::Exact => None,
        }
    }
}

/// A map of a convex face into its interior, away from the edges.
///
/// A point within rounding of an edge may lie behind the neighbouring wall once it is in f32, and see nothing.
#[derive(Clone, Copy, Debug)]
struct Inset {
    centroid: DVec3,
    /// The scale of the map: points move to centroid + scale (point − centroid).
    scale: f64,
}

impl Inset {
    /// Returns the map that leaves no point nearer to an edge than `margin`, or half of the way from the centroid in a face that is too narrow for that.
    pub(super) fn new(corners: &[DVec3], margin: f64) -> Self {
        let centroid = polygon::centroid(corners);
        let scale = 1.0 - (margin / edge_distance(corners, centroid)).min(0.5);
        Self { centroid, scale }
    }

    pub(super) fn apply(self, point: DVec3) -> DVec3 {
        self.centroid + (point - self.centroid) * self.scale
    }
}

/// Returns the distance of a point in a polygon from the nearest edge's line.
fn edge_distance(corners: &[DVec3], point: DVec3) -> f64 {
    (0..corners.len())
        .map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            (b - a).cross(point - a).length() / (b - a).length()
        })
        .fold(f64::INFINITY, f64::min)
}

/// Returns a point of a face, moved away from an edge that is nearer than `offset`.
pub(super) fn away_from_edges(corners: &[DVec3], point: DVec3, offset: f64) -> DVec3 {
    if edge_distance(corners, point) < offset {
        Inset::new(corners, EDGE_OFFSETS * offset).apply(point)
    } else {
        point
    }
}

/// The face of an emitter as a target of shadow rays.
pub(super) struct Target {
    pub(super) corners: Vec<DVec3>,
    pub(super) normal: DVec3,
    points: UniformOnPolygon,
}

impl Target {
    /// Returns the target of rays that start and end at a height of `offset` above their faces.
    pub(super) fn new(corners: Vec<DVec3>, offset: f64) -> Self {
        let inset = Inset::new(&corners, EDGE_OFFSETS * offset);
        let inside: Vec<DVec3> = corners.iter().map(|&v| inset.apply(v)).collect();
        Self {
            normal: polygon::area_vector(&corners).normalize_or_zero(),
            points: UniformOnPolygon::new(&inside),
            corners,
        }
    }

    /// Returns the end of the next ray from a point of a face with this normal, and the ray's weight; 0 below the horizon.
    pub(super) fn next_end(&self, stream: &mut PointStream, point: DVec3, normal: DVec3) -> (DVec3, f64) {
        let [u, v, ..] = stream.next_point();
        let to = self.points.point(u, v);
        let r = to - point;
        let weight = normal.dot(r).max(0.0) * -self.normal.dot(r) / r.length_squared().powi(2);
        (to, weight)
    }

    /// Returns the middle of the part above the horizon, for a point to which all ends are below it.
    pub(super) fn middle_above(&self, point: DVec3, normal: DVec3) -> DVec3 {
        let above = clip_to_half_space(&self.corners, point, normal);
        above.iter().sum::<DVec3>() / above.len() as f64
    }
}

struct Emitter {
    face: Target,
    exitance: [f64; 3],
}

/// The emitters of a scene, prepared.
pub(super) struct DirectPass<'a> {
    scene: &'a Scene,
    visibility: &'a dyn Visibility,
    method: DirectMethod,
    sequence: Sequence,
    seed: u64,
    sun: Option<DistantSun>,
    emitters: Vec<Emitter>,
    /// E of every face.
    exitance: Vec<[f64; 3]>,
    /// The occluders, for the exact method.
    clear: Option<ClearParts<'a>>,
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    shadows: ShadowRays,
    hits: HitBatch,
    seen: SeenByPatch,
}

/// The distance that the ends of rays keep from the edges of their faces, in units of the visibility's offset.
const EDGE_OFFSETS: f64 = 2.0;

/// The most rays that are traced at once.
const BATCH: u32 = 1 << 14;

impl<'a> DirectPass<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        mesh: &'a Mesh,
        visibility: &'a dyn Visibility,
        method: DirectMethod,
        (sequence, seed): (Sequence, u64),
        sun: Option<DistantSun>,
    ) -> Self {
        let exitance: Vec<[f64; 3]> = scene
            .faces
            .iter()
            .map(|face| scene.materials[face.material.0 as usize].exitance)
            .collect();
        let emitters = scene
            .face_ids()
            .zip(&exitance)
            .filter(|(_, exitance)| exitance.iter().any(|&e| e > 0.0))
            .map(|(face, &exitance)| Emitter {
                face: Target::new(scene.polygon(face), visibility.offset()),
                exitance,
            })
            .collect();
        Self {
            scene,
            visibility,
            method,
            sequence,
            seed,
            sun,
            emitters,
            exitance,
            clear: (method == DirectMethod::Exact).then(|| ClearParts::new(scene, mesh)),
        }
    }

    /// Estimates the direct irradiance at one point, of the emitters and the sun.
    pub(super) fn estimate(&self, at: &DirectPoint, scratch: &mut Scratch) -> DirectEstimate {
        let mut estimate = match self.method {
            DirectMethod::Off => DirectEstimate::default(),
            DirectMethod::CosineRays { n } => self.by_rays(at, n.get(), scratch),
            DirectMethod::Polygons { n } => self.by_polygons(at, n.get(), scratch),
            DirectMethod::Exact => self.exactly(at, scratch),
        };
        if let Some(sun) = &self.sun {
            let origin = self.origin(at.face, at.point, at.normal);
            let numbers = (self.sequence, self.seed);
            let own = sun.estimate(self.visibility, origin, at, numbers, &mut scratch.shadows);
            for c in 0..3 {
                estimate.mean[c] += own.mean[c];
                estimate.variance[c] += own.variance[c];
            }
        }
        estimate
    }

    fn exactly(&self, at: &DirectPoint, scratch: &mut Scratch) -> DirectEstimate {
        let mut estimate = DirectEstimate::default();
        let Some(clear) = &self.clear else { return estimate };
        for (k, emitter) in (0..).zip(&self.emitters) {
            let form_factor = scratch.seen.form_factor(clear, at, (k, &emitter.face.corners));
            for (mean, exitance) in estimate.mean.iter_mut().zip(emitter.exitance) {
                *mean += exitance * form_factor;
            }
        }
        estimate
    }

    fn stream(&self, at: &DirectPoint) -> PointStream {
        PointStream::new(self.sequence, self.seed, at.stream)
    }

    /// Returns the origin of the rays of a point of a face, in the frame of the visibility.
    pub(super) fn origin(&self, face: FaceId, at: DVec3, normal: DVec3) -> DVec3 {
        let offset = self.visibility.offset();
        let corners = self.scene.polygon(face);
        away_from_edges(&corners, at, offset) - self.visibility.frame_origin() + normal * offset
    }

    fn by_rays(&self, at: &DirectPoint, n: u32, scratch: &mut Scratch) -> DirectEstimate {
        let Scratch { shadows, hits, .. } = scratch;
        let rays = &mut shadows.rays;
        let frame = Frame::from_normal(at.normal);
        let origin = self.origin(at.face, at.point, at.normal);
        let mut stream = self.stream(at);
        let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
        let mut left = n;
        while left > 0 {
            let n_batch = left.min(BATCH);
            left -= n_batch;
            rays.clear();
            rays.push_cosine_rays(origin, &frame, &mut stream, n_batch);
            self.visibility.closest_hits(rays, Coherence::Incoherent, hits);
            for k in 0..rays.len() {
                let Some(hit) = hits.face(k).filter(|hit| !hit.back) else {
                    continue;
                };
                let exitance = self.exitance[hit.face.0 as usize];
                for c in 0..3 {
                    sum[c] += exitance[c];
                    squares[c] += exitance[c] * exitance[c];
                }
            }
        }
        let n = f64::from(n);
        let mean = sum.map(|sum| sum / n);
        DirectEstimate {
            mean,
            // A single sample does not show its spread; its square is an upper bound.
            variance: std::array::from_fn(|c| {
                let spread = (squares[c] / n - mean[c] * mean[c]).max(0.0);
                if n > 1.0 { spread / (n - 1.0) } else { squares[c] }
            }),
        }
    }

    /// Estimates by points on the emitters, which verification draws again from the image's attributes.
    fn by_polygons(&self, at: &DirectPoint, n: u32, scratch: &mut Scratch) -> DirectEstimate {
        let mut stream = self.stream(at);
        let mut estimate = DirectEstimate::default();
        for emitter in &self.emitters {
            // Each emitter uses the same part of the stream, whether it is visible or not.
            let form_factor = point_form_factor(at.point, at.normal, &emitter.face.corners);
            if form_factor > 0.0 {
                let (fraction, variance) = self.visible_fraction(at, &emitter.face, n, &mut stream, scratch);
                for (c, exitance) in emitter.exitance.iter().enumerate() {
                    let whole = exitance * form_factor;
                    estimate.mean[c] += whole * fraction;
                    estimate.variance[c] += whole * whole * variance;
                }
            }
        }
        estimate
    }

    /// Returns V and its variance.
    fn visible_fraction(
        &self,
        at: &DirectPoint,
        emitter: &Target,
        n: u32,
        stream: &mut PointStream,
        scratch: &mut Scratch,
    ) -> (f64, f64) {
        let ShadowRays { rays, blocked, weights } = &mut scratch.shadows;
        let (mut total, mut seen, mut squares) = (0.0, 0.0, [0.0; 3]);
        let frame = self.visibility.frame_origin();
        let offset = self.visibility.offset();
        let origin = self.origin(at.face, at.point, at.normal);
        let mut left = n;
        while left > 0 {
            let n_batch = left.min(BATCH);
            left -= n_batch;
            rays.clear();
            weights.clear();
            for _ in 0..n_batch {
                let (to, weight) = emitter.next_end(stream, at.point, at.normal);
                if weight > 0.0 {
                    weights.push(weight);
                    rays.push_segment(origin, to - frame + emitter.normal * offset);
                }
            }
            if left == 0 && rays.is_empty() && total <= 0.0 {
                // All points are below the horizon, but a part of the face is above it.
                let to = emitter.middle_above(at.point, at.normal);
                weights.push(1.0);
                rays.push_segment(origin, to - frame + emitter.normal * offset);
            }
            self.visibility.occluded(rays, Coherence::Coherent, blocked);
            for (&w, &hidden) in weights.iter().zip(blocked.iter()) {
                let v = f64::from(!hidden);
                total += w;
                seen += w * v;
                squares[0] += w * w * v;
                squares[1] += w * w;
            }
        }
        let fraction = seen / total;
        // Σ w² (v − V)², with v² = v.
        squares[2] = squares[0] * (1.0 - 2.0 * fraction) + squares[1] * fraction * fraction;
        (fraction, squares[2].max(0.0) / (total * total))
    }
}
