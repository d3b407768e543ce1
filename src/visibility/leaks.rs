//! Light leaks through patches: light that arrives on one side of a contact edge and leaves on the other.

use std::collections::BTreeMap;

use glam::DVec3;

use super::{Coherence, HitBatch, RayBatch, Visibility};
use crate::geometry::polygon;
use crate::geometry::sampling::{Frame, PointStream, Sequence, UniformOnPolygon, cosine_direction};
use crate::matrix::operator::Block;
use crate::mesh::{CrossedPatch, Mesh, Patch, PatchId};
use crate::threads;

/// The part of the emitted power above which a leak is too great.
pub const MAX_RELATIVE_LEAK: f64 = 1e-3;

/// Rays for all crossed patches together, and the fewest and the most for each.
const RAYS: usize = 1 << 18;
const MIN_RAYS: usize = 128;
const MAX_RAYS: usize = 1 << 14;

/// The fewest rays of each piece; no ray of a piece leaks where there is no occluder.
const MIN_RAYS_OF_PIECE: usize = 16;

/// The light leaks of a mesh, estimated by rays.
///
/// A patch i is one unknown: of the light that arrives at its piece p, the share A_q / A_i leaves from another piece q. It leaks if the point of q does not see the origin of the light. With x and x' points of p and q,
/// y the point that a ray from x meets, and V the visibility, the exchange area that leaks between patches i and j is
/// L_ij = Σ_p A_p Σ_{q≠p} A_q / A_i ∫_j (1 − V(x', y)) dF(x, y), in m². It is 0 where contact edges hide nothing from either side, and at most A_i Σ_p w_p (1 − w_p) with w_p = A_p / A_i, where both sides share no view.
///
/// Accuracy: the standard error of each figure, from 128 to 16 384 rays for each crossed patch. Work: two ray queries for each ray.
#[derive(Clone, Debug, Default)]
pub struct LightLeaks {
    pieces: Vec<Leak>,
    n_patches: usize,
    /// A of all patches of the mesh, m².
    areas: Vec<f64>,
}

/// The hits of rays from one piece of a crossed patch.
#[derive(Clone, Debug)]
struct Leak {
    patch: PatchId,
    /// The exchange area that one ray stands for, m².
    weight: f64,
    n_rays: usize,
    /// The number of rays that leak, by the patch that they meet; `None` for the surroundings.
    leaking: BTreeMap<Option<PatchId>, u32>,
}

/// A power or an exchange area that leaks, with its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leakage {
    /// The power in W, or the exchange area in m².
    pub value: f64,
    /// Its standard error.
    pub error: f64,
    /// The value relative to all that is emitted.
    pub relative: f64,
}

impl Leakage {
    /// Returns whether the leak is above [`MAX_RELATIVE_LEAK`].
    #[must_use]
    pub fn is_too_great(&self) -> bool {
        self.relative > MAX_RELATIVE_LEAK
    }

    fn of(self, emitted: f64) -> Self {
        let relative = if self.value > 0.0 { self.value / emitted } else { 0.0 };
        Self { relative, ..self }
    }
}

impl LightLeaks {
    /// Finds the light leaks of the [crossed patches](crate::mesh::ContactEdges::crossed_patches) of a mesh.
    #[must_use]
    pub fn find(mesh: &Mesh, crossed: &[CrossedPatch], visibility: &dyn Visibility) -> Self {
        let n_rays = (RAYS / crossed.len().max(1)).clamp(MIN_RAYS, MAX_RAYS);
        Self {
            pieces: threads::collect_flat(crossed.len(), |k| of_patch(mesh, &crossed[k], visibility, n_rays)),
            n_patches: crossed.len(),
            areas: mesh.areas(),
        }
    }

    /// Returns the number of patches that contact edges cross.
    #[must_use]
    pub fn n_patches(&self) -> usize {
        self.n_patches
    }

    /// Returns the exchange area Σ L_ij that leaks, in m², including the surroundings.
    ///
    /// It is relative to Σ A_i, which is all that leaves the patches if each has a radiosity of 1.
    #[must_use]
    pub fn exchange_area(&self) -> Leakage {
        self.sum(|_| 1.0, |_| 1.0).of(self.areas.iter().sum())
    }

    /// Returns the power that leaks, Σ ρ_i L_ij B_j in W, in the channel where its part of the emitted power is greatest.
    ///
    /// It is reflected light that leaves a patch where it cannot have arrived.
    ///
    /// `reflectance`: ρ; `exitance`: E, `radiosity`: B, W·m⁻². Shapes: \[n, c\].
    ///
    /// # Panics
    /// If a block does not have one row per patch.
    #[must_use]
    #[track_caller]
    pub fn power(&self, reflectance: &Block, exitance: &Block, radiosity: &Block) -> Leakage {
        assert_eq!(exitance.n_rows(), self.areas.len(), "one row per patch");
        let in_channel = |c: usize| {
            let value = |block: &Block, patch: PatchId| block.row(patch.0 as usize)[c];
            let emitted = self.areas.iter().enumerate().map(|(i, area)| area * exitance.row(i)[c]);
            let light = |met: Option<PatchId>| met.map_or(0.0, |patch| value(radiosity, patch));
            self.sum(|patch| value(reflectance, patch), light).of(emitted.sum())
        };
        let all = (0..exitance.n_channels()).map(in_channel);
        all.max_by(|a, b| a.relative.total_cmp(&b.relative)).unwrap_or_default()
    }

    /// Returns Σ weight factor(i) light(j) over leaking rays; the variance of each piece is that of independent rays.
    fn sum(&self, factor: impl Fn(PatchId) -> f64, light: impl Fn(Option<PatchId>) -> f64) -> Leakage {
        let (mut value, mut variance) = (0.0, 0.0);
        for leak in &self.pieces {
            let rays = || leak.leaking.iter().map(|(&met, &n)| (f64::from(n), light(met)));
            let first: f64 = rays().map(|(n, b)| n * b).sum();
            let second: f64 = rays().map(|(n, b)| n * b * b).sum();
            let scale = leak.weight * factor(leak.patch);
            value += scale * first;
            variance += scale * scale * (second - first * first / leak.n_rays as f64).max(0.0);
        }
        Leakage {
            value,
            error: variance.sqrt(),
            relative: 0.0,
        }
    }
}

/// Returns the leaks of each piece of a patch.
fn of_patch(mesh: &Mesh, crossed: &CrossedPatch, visibility: &dyn Visibility, n_rays: usize) -> Vec<Leak> {
    let areas: Vec<f64> = crossed
        .pieces
        .iter()
        .map(|piece| polygon::area_vector(piece).length())
        .collect();
    let area: f64 = areas.iter().sum();
    let maps: Vec<UniformOnPolygon> = crossed
        .pieces
        .iter()
        .map(|piece| UniformOnPolygon::new(piece))
        .collect();
    let patch = &mesh.patches[crossed.patch.0 as usize];
    let of_piece = |p: usize| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a part of a number of rays"
        )]
        let share = (n_rays as f64 * areas[p] / area) as usize;
        let n = share.max(MIN_RAYS_OF_PIECE);
        let stream = u64::from(crossed.patch.0) << 32 | p as u64;
        let mut rays = PieceRays::new(n, patch, visibility);
        let mut points = PointStream::new(Sequence::Sobol, 0, stream);
        let mut elsewhere = PointStream::new(Sequence::Sobol, 1, stream);
        for _ in 0..n {
            let [u, v, s, t] = points.next_point();
            let [a, b, c, _] = elsewhere.next_point();
            let q = other_piece(&areas, p, c);
            rays.add(maps[p].point(u, v), maps[q].point(a, b), cosine_direction(s, t));
        }
        Leak {
            patch: crossed.patch,
            weight: areas[p] / n as f64 * (area - areas[p]) / area,
            n_rays: n,
            leaking: rays.leaking(mesh, visibility),
        }
    };
    (0..areas.len()).map(of_piece).collect()
}

/// Returns a piece other than p, chosen by a number in (0, 1) with a probability in proportion to its area.
fn other_piece(areas: &[f64], p: usize, number: f64) -> usize {
    let others = || areas.iter().enumerate().filter(|(q, _)| *q != p);
    let mut left = number * others().map(|(_, area)| area).sum::<f64>();
    let mut last = p;
    for (q, area) in others() {
        last = q;
        left -= area;
        if left <= 0.0 {
            break;
        }
    }
    last
}

/// Rays from one piece of a patch, with a point of another piece for each.
struct PieceRays {
    normal: DVec3,
    frame: Frame,
    offset: f64,
    /// The frame of the rays.
    origin: DVec3,
    rays: RayBatch,
    /// The starting points and directions, in the world.
    from: Vec<(DVec3, DVec3)>,
    /// The points of other pieces, off the face.
    others: Vec<DVec3>,
}

impl PieceRays {
    fn new(n: usize, patch: &Patch, visibility: &dyn Visibility) -> Self {
        Self {
            normal: patch.normal,
            frame: Frame::from_normal(patch.normal),
            offset: visibility.offset(),
            origin: visibility.frame_origin(),
            rays: RayBatch::default(),
            from: Vec::with_capacity(n),
            others: Vec::with_capacity(n),
        }
    }

    fn add(&mut self, x: DVec3, other: DVec3, direction: DVec3) {
        let lift = self.offset * self.normal;
        let direction = self.frame.to_world(direction);
        self.rays.push_ray(x + lift - self.origin, direction);
        self.from.push((x + lift, direction));
        self.others.push(other + lift);
    }

    /// Traces the rays, and tests whether the other points see the points that they meet.
    fn leaking(&self, mesh: &Mesh, visibility: &dyn Visibility) -> BTreeMap<Option<PatchId>, u32> {
        let mut hits = HitBatch::default();
        visibility.closest_hits(&self.rays, Coherence::Incoherent, &mut hits);
        let (mut segments, mut rays) = (RayBatch::default(), RayBatch::default());
        let (mut met, mut leaking) = (Vec::new(), BTreeMap::new());
        for (k, (&(from, direction), &other)) in self.from.iter().zip(&self.others).enumerate() {
            match hits.face(k) {
                None => rays.push_ray(other - self.origin, direction),
                Some(hit) if hit.back => {}
                Some(hit) => {
                    let patch = mesh.patch_at(hit.face, f64::from(hits.u[k]), f64::from(hits.v[k]));
                    let normal = mesh.patches[patch.0 as usize].normal;
                    let y = from + f64::from(hits.t[k]) * direction + self.offset * normal;
                    if normal.dot(other - y) <= 0.0 {
                        *leaking.entry(Some(patch)).or_insert(0) += 1;
                    } else {
                        segments.push_segment(y - self.origin, other - self.origin);
                        met.push(patch);
                    }
                }
            }
        }
        let mut blocked = Vec::new();
        visibility.occluded(&segments, Coherence::Incoherent, &mut blocked);
        for (&patch, _) in met.iter().zip(&blocked).filter(|(_, blocked)| **blocked) {
            *leaking.entry(Some(patch)).or_insert(0) += 1;
        }
        visibility.occluded(&rays, Coherence::Incoherent, &mut blocked);
        match blocked.iter().map(|&blocked| u32::from(blocked)).sum() {
            0 => {}
            n => *leaking.entry(None).or_insert(0) += n,
        }
        leaking
    }
}
