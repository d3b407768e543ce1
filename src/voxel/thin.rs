//! Walls thinner than two voxels: detection, and separation of their sides.
//!
//! For voxels that hold both sides of a wall, or lie beside voxels that hold the other side, normals are not enough: at the edge of a sheet, the outside of one wall faces lines
//! that come from inside, along the other. There the lattice's own topology decides. The centres of the voxels are *nodes*, each at a definite point in the air (or inside a
//! solid), and two neighbouring nodes are joined unless a face crosses the segment between them. A surfel *looks to* the nodes that its front reaches:
//! the end of the segment that its face crosses, if no other face crosses between, and all nodes that are joined to that one within the 27 around the voxel.
//! Lines leave only by these nodes, continue only between joined nodes, and see a surfel only from a node that it looks to. So light passes no closed surface, however thin.
//!
//! Source: the segments are those of S. Laine, "A Topological Approach to Voxelization", 2013. Departures from Malgouyres 2002: he keeps one normal a voxel.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;
use rayon::prelude::*;

use super::discretize::{Piece, Pieces, Surfel, VoxelScene, each_crossing};
use super::grid::{MAX_VOXELS, Voxel, to_u32};
use super::operator::LeakPower;
use crate::geometry::polygon;
use crate::matrix::operator::Block;
use crate::scene::{FaceId, Scene, SurfaceId};
use crate::threads;

/// Pairs of surfaces with the least thickness between their surfels, in voxels, and the number of these surfels.
type Pairs = BTreeMap<[SurfaceId; 2], (f64, usize)>;

/// A wall thinner than two voxels: two surfaces, back to back in one voxel or in neighbouring ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinWall {
    /// The surfaces of the two sides, the lower id first; equal where one surface is both.
    pub surfaces: [SurfaceId; 2],
    /// The least distance between the planes of its sides, m.
    pub thickness: f64,
    /// The number of surfels that have the other side beside or behind them.
    pub n_surfels: usize,
}

/// Light that passes between regions of air that surfaces close off from each other, and light that is lost in a closed scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leak {
    /// The power that passes, W, in the channel where its share is greatest.
    pub power: f64,
    /// That power as a share of the emitted power in the channel.
    pub share: f64,
    /// The power that is lost, W, in the channel where its share is greatest.
    pub lost_power: f64,
    /// That power as a share of the emitted power in the channel.
    pub lost_share: f64,
}

/// The share of the emitted power above which light through walls makes a result wrong.
const MAX_PASSED: f64 = 1e-3;

/// The same of light that is lost in a closed scene: the coarse voxels of a furnished room lose a few hundredths.
const MAX_LOST: f64 = 0.1;

impl Leak {
    /// Compares the power that leaks with the emitted power of the surfels, both by channel.
    ///
    /// `exitance`: E, W·m⁻², \[n, c\].
    #[must_use]
    pub fn new(power: &LeakPower, voxels: &VoxelScene, exitance: &Block) -> Self {
        let greatest = |of_kind: &[f64]| {
            let of_channel = |(c, &leaking): (usize, &f64)| {
                let emitted = |(k, s): (usize, &Surfel)| s.area * exitance.row(k)[c];
                let emitted: f64 = voxels.surfels.iter().enumerate().map(emitted).sum();
                [leaking, if leaking > 0.0 { leaking / emitted } else { leaking }]
            };
            let all = of_kind.iter().enumerate().map(of_channel);
            all.max_by(|a, b| a[1].total_cmp(&b[1])).unwrap_or_default()
        };
        let ([power, share], [lost_power, lost_share]) = (greatest(&power.passed), greatest(&power.lost));
        Self {
            power,
            share,
            lost_power,
            lost_share,
        }
    }

    /// Returns whether more than a thousandth of the emitted power passes walls, or more than a tenth is lost.
    #[must_use]
    pub fn is_too_much(&self) -> bool {
        self.share.is_nan() || self.share > MAX_PASSED || self.lost_share > MAX_LOST
    }
}

impl VoxelScene {
    /// Returns the number of voxels along the longest axis that makes a wall two voxels thick, if it is possible.
    #[must_use]
    pub fn n_voxels_for(&self, wall: &ThinWall) -> Option<u32> {
        let extent = self.grid.voxel_size * f64::from(self.grid.n_voxels.into_iter().max()? - 1);
        let n = (2.0 * extent / wall.thickness).ceil() + 1.0;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most MAX_VOXELS, and positive"
        )]
        (n <= f64::from(MAX_VOXELS)).then_some(n as u32)
    }
}

/// The cosine beyond which two faces are sides of one wall.
const OPPOSED: f64 = -0.5;

/// The height by which a face may rise above another's plane and still be behind it, in voxels.
const RISE: f64 = 1e-6;

/// The distance, in voxels, below which crossings of one segment are those of a sheet: each side looks away from the other.
const COINCIDENT: f64 = 1e-6;

/// The side of a voxel from which a line enters: 2 a from the lower neighbour along axis a, 2 a + 1 from the upper one.
pub(super) type Side = u32;

/// Stands for a side where the line begins in the voxel's centre.
pub(super) const AT_CENTRE: Side = 6;

/// The bits of all nodes: the six neighbours, by [`Side`], and the centre.
pub(super) const ALL_NODES: u8 = 0x7f;

/// Marks in [`VoxelScene::normal_of`](super::discretize::VoxelScene) the surfels of voxels whose sides are known.
pub(super) const THIN: u32 = 1 << 31;

/// A part of a face in a voxel that looks to certain nodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) face: FaceId,
    /// m².
    pub(super) area: f64,
    /// The nodes that it looks to.
    pub(super) nodes: u8,
}

/// The thin walls of a scene.
pub(super) struct Found {
    pub(super) walls: Vec<ThinWall>,
    /// By rank: the voxels of thin walls, and those around them.
    pub(super) near: Vec<bool>,
}

/// Finds all pairs of surfels that look away from each other, each behind the other, in one voxel or in two that touch.
pub(super) fn find(scene: &Scene, voxels: &VoxelScene) -> Found {
    let planes: Vec<(DVec3, f64)> = scene.face_ids().map(|face| plane(voxels, scene, face)).collect();
    let plane_of = |s: usize| planes[voxels.surfels[s].face.0 as usize];
    let surface = |s: usize| scene.faces[voxels.surfels[s].face.0 as usize].surface;
    let n_ranks = voxels.octree.n_voxels();
    // The thickness of the wall between two surfels, in voxels.
    let thickness = |s: usize, t: usize| {
        if voxels.normal(s).unit.dot(voxels.normal(t).unit) > OPPOSED {
            return None;
        }
        let ((n_s, level_s), (n_t, level_t)) = (plane_of(s), plane_of(t));
        let foot = |v: usize, n: DVec3, level: f64| {
            let centre = DVec3::from_array(voxels.surfels[v].voxel().map(f64::from));
            centre - (n.dot(centre) - level) * n
        };
        let heights = [
            n_s.dot(foot(t, n_t, level_t)) - level_s,
            n_t.dot(foot(s, n_s, level_s)) - level_t,
        ];
        heights
            .iter()
            .all(|&h| h <= RISE)
            .then(|| (-0.5 * (heights[0] + heights[1])).max(0.0))
    };
    let add = |pairs: &mut Pairs, key: [SurfaceId; 2], (least, n): (f64, usize)| {
        let known = pairs.entry(key).or_insert((f64::INFINITY, 0));
        *known = (known.0.min(least), known.1 + n);
    };
    let of_rank = |rank: usize| {
        let mut pairs = Pairs::new();
        for s in voxels.surfels_of(to_u32(rank)) {
            let mut of_surfel = Pairs::new();
            voxels.each_rank_around(voxels.surfels[s].voxel(), |other| {
                for t in voxels.surfels_of(other).filter(|&t| t != s) {
                    if let Some(thickness) = thickness(s, t) {
                        let mut key = [surface(s), surface(t)];
                        key.sort_unstable();
                        let known = of_surfel.entry(key).or_insert((thickness, 1));
                        known.0 = known.0.min(thickness);
                    }
                }
            });
            for (key, one) in of_surfel {
                add(&mut pairs, key, one);
            }
        }
        pairs
    };
    let found: Vec<(usize, Pairs)> = threads::collect_flat(n_ranks, |rank| {
        let pairs = of_rank(rank);
        (!pairs.is_empty()).then_some((rank, pairs))
    });
    let mut pairs = Pairs::new();
    let mut core = vec![false; if found.is_empty() { 0 } else { n_ranks }];
    for (rank, here) in found {
        core[rank] = true;
        for (key, one) in here {
            add(&mut pairs, key, one);
        }
    }
    let wall = |(surfaces, (least, n_surfels))| ThinWall {
        surfaces,
        thickness: least * voxels.grid.voxel_size,
        n_surfels,
    };
    let mut walls: Vec<ThinWall> = pairs.into_iter().map(wall).collect();
    walls.sort_by(|a, b| a.thickness.total_cmp(&b.thickness));
    Found {
        walls,
        near: dilated(voxels, &core),
    }
}

/// Returns the ranks whose voxel is marked or touches one that is.
fn dilated(voxels: &VoxelScene, marked: &[bool]) -> Vec<bool> {
    let touches = |rank: usize| {
        let mut found = false;
        let first = voxels.surfels_of(to_u32(rank)).start;
        voxels.each_rank_around(voxels.surfels[first].voxel(), |other| found |= marked[other as usize]);
        found
    };
    threads::collect(marked.len(), touches)
}

fn plane(voxels: &VoxelScene, scene: &Scene, face: FaceId) -> (DVec3, f64) {
    let normal = scene.area_vector(face).normalize_or_zero();
    (normal, normal.dot(voxels.grid.to_lattice(scene.polygon(face)[0])))
}

/// The nodes that faces look to, in a scene with thin walls.
pub(super) struct Sides {
    /// The crossings that make voxels surface, by rank and face.
    samples: Vec<Sample>,
    /// By rank: the segments to the six neighbours whose half in the voxel a face crosses.
    crossed: Vec<u8>,
    /// The parts of the faces in the voxels of thin walls and in those around them, by rank.
    parts: Vec<(u32, Part)>,
}

/// A crossing of a face with the segment from a node to the next one along an axis.
struct OnSegment {
    axis: usize,
    lower: Voxel,
    at: f64,
    looks_up: bool,
    rank: u32,
    face: FaceId,
}

/// A crossing of a face that makes a voxel surface, and the node that its front reaches.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Sample {
    rank: u32,
    face: FaceId,
    node: Option<Side>,
}

impl Sides {
    /// Finds the sides in the voxels `near` thin walls.
    pub(super) fn new(scene: &Scene, voxels: &VoxelScene, near: &[bool], pieces: &Pieces) -> Self {
        let (crossed, samples) = samples(scene, voxels);
        let of_voxels: Vec<(u32, &[(u32, usize)])> =
            pieces.by_voxel().filter(|(rank, _)| near[*rank as usize]).collect();
        let samples_of = |rank, face| samples_of(&samples, rank, face);
        let without_crossing: Vec<(Voxel, FaceId)> = of_voxels
            .iter()
            .flat_map(|(rank, list)| list.iter().map(|&(_, k)| (*rank, pieces.all[k])))
            .filter(|(rank, piece)| samples_of(*rank, piece.face).is_empty())
            .map(|(_, piece)| (piece.voxel, piece.face))
            .collect();
        let nearby = Nearby::new(scene, voxels, &without_crossing);
        let parts_of = |&(rank, list): &(u32, &[(u32, usize)])| -> Vec<(u32, Part)> {
            let nodes = Nodes::new(voxels, &crossed, pieces.all[list[0].1].voxel);
            let mut parts = Vec::new();
            for &(_, k) in list {
                let Piece { voxel, face, area } = pieces.all[k];
                let found = samples_of(rank, face);
                if found.is_empty() {
                    let nodes = nodes.joined(nearby.reached(scene, voxels, voxel, face));
                    parts.push((rank, Part { face, area, nodes }));
                    continue;
                }
                // A view that other faces hide at one crossing may be open at another: a face is hidden only if it is at all of them.
                let seen: Vec<Side> = found.iter().filter_map(|sample| sample.node).collect();
                if seen.is_empty() {
                    parts.push((rank, Part { face, area, nodes: 0 }));
                }
                let share = area / seen.len() as f64;
                let first = parts.len();
                for side in seen {
                    let nodes = nodes.joined(1 << place_of_side(side));
                    match parts[first..].iter_mut().find(|(_, part)| part.nodes == nodes) {
                        Some((_, part)) => part.area += share,
                        None => parts.push((
                            rank,
                            Part {
                                face,
                                area: share,
                                nodes,
                            },
                        )),
                    }
                }
            }
            parts
        };
        let parts = threads::collect_flat(of_voxels.len(), |k| parts_of(&of_voxels[k]));
        Self {
            samples,
            crossed,
            parts,
        }
    }

    /// Returns a node that a face looks to from the voxel of a rank, if it crosses a segment there.
    pub(super) fn node_of(&self, rank: u32, face: FaceId) -> Option<Side> {
        samples_of(&self.samples, rank, face)
            .iter()
            .find_map(|sample| sample.node)
    }

    /// Returns the parts in the voxel of a rank, if its sides are known; `from` is their earliest possible index.
    pub(super) fn parts_of(&self, rank: u32, from: &mut usize) -> &[(u32, Part)] {
        let n = self.parts[*from..].iter().take_while(|(of, _)| *of == rank).count();
        let found = &self.parts[*from..*from + n];
        *from += n;
        found
    }

    /// Returns the segments from the voxel of a rank to its neighbours whose half in the voxel a face crosses.
    pub(super) fn crossed(&self, rank: u32) -> u8 {
        self.crossed[rank as usize]
    }
}

/// Returns the crossings of a face that make the voxel of a rank surface.
fn samples_of(samples: &[Sample], rank: u32, face: FaceId) -> &[Sample] {
    let start = samples.partition_point(|s| (s.rank, s.face) < (rank, face));
    let n = samples[start..].partition_point(|s| (s.rank, s.face) == (rank, face));
    &samples[start..start + n]
}

/// Returns by rank the halves of segments that are crossed, and all crossings that make voxels surface, sorted.
fn samples(scene: &Scene, voxels: &VoxelScene) -> (Vec<u8>, Vec<Sample>) {
    let faces: Vec<FaceId> = scene.face_ids().collect();
    let of_face = |&face: &FaceId| {
        let mut found = Vec::new();
        each_crossing(&voxels.grid, &scene.polygon(face), |c| {
            let Some(rank) = voxels.octree.rank(c.voxel) else {
                return;
            };
            let mut lower = c.voxel;
            // A crossing below the centre is on the segment from the lower neighbour.
            lower[c.axis] -= i32::from(c.at < f64::from(c.voxel[c.axis]));
            found.push(OnSegment {
                axis: c.axis,
                lower,
                at: c.at,
                looks_up: c.looks_up,
                rank,
                face,
            });
        });
        found
    };
    let mut crossings: Vec<OnSegment> = threads::collect_flat(faces.len(), |k| of_face(&faces[k]));
    let segment = |c: &OnSegment| (c.axis, c.lower);
    crossings.par_sort_by(|a, b| {
        segment(a)
            .cmp(&segment(b))
            .then(a.at.total_cmp(&b.at))
            .then(a.face.cmp(&b.face))
    });
    let mut crossed = vec![0; voxels.octree.n_voxels()];
    let mut samples = Vec::with_capacity(crossings.len());
    for on_segment in crossings.chunk_by_mut(|a, b| segment(a) == segment(b)) {
        for sheet in on_segment.chunk_by_mut(|a, b| b.at - a.at < COINCIDENT) {
            sheet.sort_by_key(|c| c.looks_up);
        }
        let (axis, lower) = segment(&on_segment[0]);
        let side = 2 * to_side(axis);
        let last = on_segment.len() - 1;
        for (k, c) in on_segment.iter().enumerate() {
            let is_of_lower = voxels.octree.rank(lower) == Some(c.rank);
            crossed[c.rank as usize] |= 1 << if is_of_lower { side + 1 } else { side };
            let node = match (c.looks_up, k) {
                (false, 0) => Some(if is_of_lower { AT_CENTRE } else { side }),
                (true, k) if k == last => Some(if is_of_lower { side + 1 } else { AT_CENTRE }),
                _ => None,
            };
            samples.push(Sample {
                rank: c.rank,
                face: c.face,
                node,
            });
        }
    }
    samples.par_sort_unstable();
    (crossed, samples)
}

/// The number of the node in the centre of 27.
const CENTRE: usize = 13;

/// Returns the offset of the k-th of 27 nodes from the one in their centre.
fn step(k: usize) -> Voxel {
    [k % 3, k / 3 % 3, k / 9].map(|c| i32::try_from(c).expect("0 to 2") - 1)
}

/// Returns the number, among the 27 nodes, of the node on a side.
fn place_of_side(side: Side) -> usize {
    match side {
        0..6 => {
            let stride = [1, 3, 9][(side / 2) as usize];
            if side % 2 == 1 {
                CENTRE + stride
            } else {
                CENTRE - stride
            }
        }
        _ => CENTRE,
    }
}

/// The 27 nodes around a voxel, and which of them are joined.
struct Nodes {
    label: [usize; 27],
}

impl Nodes {
    fn new(voxels: &VoxelScene, crossed: &[u8], voxel: Voxel) -> Self {
        let crossed_at: [u8; 27] = std::array::from_fn(|k| {
            let at = std::array::from_fn(|a| voxel[a] + step(k)[a]);
            voxels.octree.rank(at).map_or(0, |rank| crossed[rank as usize])
        });
        let mut label: [usize; 27] = std::array::from_fn(|k| k);
        for k in 0..27 {
            for (axis, stride) in [1, 3, 9].into_iter().enumerate() {
                let is_crossed =
                    |next: usize| crossed_at[k] >> (2 * axis + 1) & 1 == 1 || crossed_at[next] >> (2 * axis) & 1 == 1;
                if step(k)[axis] < 1 && !is_crossed(k + stride) {
                    let (a, b) = (label[k], label[k + stride]);
                    label.iter_mut().filter(|l| **l == b).for_each(|l| *l = a);
                }
            }
        }
        Self { label }
    }

    /// Returns those of the six neighbours and the centre that are joined to any of some of the 27 nodes.
    fn joined(&self, to: u32) -> u8 {
        let is_joined = |side: Side| {
            let label = self.label[place_of_side(side)];
            (0..27).any(|k| to >> k & 1 == 1 && self.label[k] == label)
        };
        (0..=AT_CENTRE)
            .filter(|&side| is_joined(side))
            .fold(0, |bits, side| bits | 1 << side)
    }
}

/// The faces around voxels with faces that are too small to cross any segment, by bricks of 4 × 4 × 4.
struct Nearby {
    faces: HashMap<Voxel, Vec<FaceId>>,
}

impl Nearby {
    fn new(scene: &Scene, voxels: &VoxelScene, small: &[(Voxel, FaceId)]) -> Self {
        let mut faces: HashMap<Voxel, Vec<FaceId>> =
            small.iter().map(|(voxel, _)| (brick(*voxel), Vec::new())).collect();
        if faces.is_empty() {
            return Self { faces };
        }
        // Segments begin in a voxel of the brick and end in the centre of one that touches it.
        let reach = DVec3::splat(1.5);
        for face in scene.face_ids() {
            let corners: Vec<DVec3> = scene.polygon(face).iter().map(|&v| voxels.grid.to_lattice(v)).collect();
            let low = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min) - reach;
            let high = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + reach;
            let normal = polygon::area_vector(&corners).normalize_or_zero();
            let meets = |at: &Voxel| {
                let first = DVec3::from_array(at.map(|c| f64::from(4 * c)));
                let (middle, half) = (first + 1.5, DVec3::splat(1.5) + reach);
                let is_beside = (first + 3.0).cmplt(low).any() || first.cmpgt(high).any();
                !is_beside && normal.dot(middle - corners[0]).abs() <= normal.abs().dot(half)
            };
            let [from, to] = [low, high].map(|v| brick(v.to_array().map(super::grid::nearest)));
            let n_in_box: i64 = (0..3).map(|a| i64::from(to[a] - from[a]) + 1).product();
            if n_in_box > i64::try_from(faces.len()).unwrap_or(i64::MAX) {
                faces
                    .iter_mut()
                    .filter(|(at, _)| meets(at))
                    .for_each(|(_, list)| list.push(face));
                continue;
            }
            for z in from[2]..=to[2] {
                for y in from[1]..=to[1] {
                    for x in from[0]..=to[0] {
                        if let Some(list) = faces.get_mut(&[x, y, z]).filter(|_| meets(&[x, y, z])) {
                            list.push(face);
                        }
                    }
                }
            }
        }
        Self { faces }
    }

    /// Returns those of the 27 nodes around a voxel that the middle of a face in it looks to without another face between.
    fn reached(&self, scene: &Scene, voxels: &VoxelScene, voxel: Voxel, face: FaceId) -> u32 {
        let to_lattice =
            |of: FaceId| -> Vec<DVec3> { scene.polygon(of).iter().map(|&v| voxels.grid.to_lattice(v)).collect() };
        let corners = to_lattice(face);
        let from = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let normal = scene.area_vector(face).normalize_or_zero();
        let around: Vec<Vec<DVec3>> = self
            .faces
            .get(&brick(voxel))
            .into_iter()
            .flatten()
            .map(|&f| to_lattice(f))
            .collect();
        let is_reached = |k: &usize| {
            let to = DVec3::from_array(std::array::from_fn(|a| f64::from(voxel[a] + step(*k)[a])));
            normal.dot(to - from) > RISE && !around.iter().any(|other| crosses(other, from, to))
        };
        (0..27).filter(is_reached).fold(0, |bits, k| bits | 1 << k)
    }
}

fn brick(voxel: Voxel) -> Voxel {
    voxel.map(|c| c.div_euclid(4))
}

/// Returns whether a convex face crosses a segment, its beginning left out.
fn crosses(corners: &[DVec3], from: DVec3, to: DVec3) -> bool {
    let normal = polygon::area_vector(corners).normalize_or_zero();
    let [before, after] = [from, to].map(|p| normal.dot(p - corners[0]));
    if before.abs() < COINCIDENT || before * after > 0.0 {
        return false;
    }
    let at = from.lerp(to, before / (before - after));
    let edges = (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]));
    // A hair beyond its border too: two faces that share an edge leave no gap.
    edges
        .into_iter()
        .all(|(a, b)| (b - a).cross(at - a).dot(normal) >= -RISE * (b - a).length())
}

fn to_side(axis: usize) -> Side {
    u32::try_from(axis).expect("an axis")
}
