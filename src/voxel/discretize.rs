//! The conversion of faces to surface voxels.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::VoxelError;
use super::grid::{Grid, Voxel, nearest, to_u32};
use super::octree::{Built, Octree};
use super::regions::Regions;
use super::thin::{self, ALL_NODES, Part, Sides, THIN, ThinWall};
use crate::geometry::polygon;
use crate::scene::{FaceId, MaterialId, Scene, SurfaceId};
use crate::threads;

/// The scale of normals as integers, 2³⁰: heights over a lattice of 4096 voxels are then off by less than 6e-6 voxels.
const NORMAL_SCALE: f64 = 1_073_741_824.0;

/// The tolerance within which a coordinate counts as a half, which goes to the voxel on the face's front along any axis.
///
/// All voxels of a plane then have heights in (−1, 1) over one another. It is more than the lattice is shifted by, so that a lamp and the ceiling just above it share a voxel.
const HALF_SLACK: f64 = 4e-3;

/// The cosine of 30°: faces of one surface and material with a smaller angle between normals are one smooth surface where they meet in a voxel.
pub(super) const SMOOTH: f64 = 0.866_025_403_784_438_6;

/// The height by which two faces must rise above each other's planes to face each other, in voxels.
const RISE: f64 = 1e-6;

/// The most surfels of a voxel for which it is stored which face each other.
const MAX_FACING: usize = 8;

/// A normal, shared by all surfels that have it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    /// The unit normal, on the side that sees.
    pub unit: DVec3,
    /// The normal in units of 2⁻³⁰, rounded: for integer arithmetic.
    pub integer: [i32; 3],
    /// The axis of the largest component.
    pub axis: usize,
}

impl Normal {
    fn new(unit: DVec3) -> Self {
        let integer = (unit * NORMAL_SCALE).to_array().map(nearest);
        let axis = (0..3).rev().max_by_key(|&a| integer[a].abs()).unwrap_or(0);
        Self { unit, integer, axis }
    }

    /// Returns n · v, in units of 2⁻³⁰.
    #[must_use]
    pub fn dot(&self, v: [i32; 3]) -> i64 {
        (0..3).map(|a| i64::from(self.integer[a]) * i64::from(v[a])).sum()
    }

    /// Returns whether the normal lies along an axis.
    #[must_use]
    pub fn is_axis_aligned(&self) -> bool {
        (0..3).all(|a| a == self.axis || self.integer[a] == 0)
    }
}

/// The part of one surface in one voxel: an unknown of the discrete radiosity system.
///
/// A voxel where surfaces meet, or one with a wall thinner than a voxel, has several. Near [thin walls](VoxelScene::thin_walls) a surface on which a wall stands has one for each side of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfel {
    /// The voxel's coordinates.
    pub voxel: [u16; 3],
    /// The surfels of the same voxel that this one faces, as bits in their order.
    facing: u8,
    /// Index into [`VoxelScene::normals`].
    pub normal: u32,
    /// The face of the scene, the first one where several are merged.
    pub face: FaceId,
    /// Its share of the faces' areas, m².
    pub area: f64,
}

impl Surfel {
    /// Returns the voxel.
    #[must_use]
    pub fn voxel(&self) -> Voxel {
        self.voxel.map(i32::from)
    }

    /// Returns the surfels of its voxel that this one faces, as bits.
    pub(super) fn facing_bits(&self) -> u8 {
        self.facing
    }

    /// Returns whether this surfel faces any other of its voxel.
    pub(super) fn faces_any(&self) -> bool {
        self.facing != 0
    }

    /// Returns whether this surfel faces the one that is `other` places after the first of their voxel.
    pub(super) fn faces(&self, other: usize) -> bool {
        other < MAX_FACING && self.facing >> other & 1 == 1
    }
}

/// A scene as voxels.
#[derive(Clone, Debug)]
pub struct VoxelScene {
    /// The lattice.
    pub grid: Grid,
    /// The surface voxels.
    pub octree: Octree,
    /// All surfels, by the rank of their voxel.
    pub surfels: Vec<Surfel>,
    /// The distinct normals.
    pub normals: Vec<Normal>,
    /// The walls thinner than two voxels, the thinnest first.
    pub thin_walls: Vec<ThinWall>,
    /// The first surfel of each rank, and the number of surfels at the end.
    pub(super) first_surfel: Vec<u32>,
    /// [`Surfel::normal`] once more, in an array of its own: every line reads one somewhere else, and eight times as many stay in the cache.
    ///
    /// The highest bit is set near thin walls.
    pub(super) normal_of: Vec<u32>,
    /// The sides of each surfel; empty if no wall is thin.
    sides: Vec<Facts>,
    /// The closed-off regions of air, if there are thin walls and surfaces face several regions.
    pub(super) regions: Option<Regions>,
    /// True if the scene is known to be closed, so that no link may leave it.
    pub(super) is_closed: bool,
}

impl VoxelScene {
    /// Discretises a scene with `n` voxels along its longest axis.
    ///
    /// A voxel is surface where a face meets the cross of the three segments that join the middles of its opposite sides. Every 6-path through a face then contains
    /// such a voxel, so that surfaces are 6-separating: a walk from voxel to voxel follows these segments. Away from a face's border this is the height of the face,
    /// rounded, over the pixels of the axis that suits its normal; at the border the two other axes add the voxels that separation needs.
    /// A face that is too small to meet any cross gets the voxel of its centroid.
    /// A face's area is shared out evenly over its voxels: areas of surfaces are exact in sum.
    /// In the voxels of walls thinner than two voxels, and those around them, surfels of different sides are kept apart: see [`ThinWall`].
    ///
    /// Hausdorff distance to the scene: below 1 inside faces, since every surface voxel contains a point of the scene in its cube; up to 1.5 where three faces meet in the
    /// corner of a room, because none of them covers the pixels on its low border.
    ///
    /// # Errors
    /// [`VoxelError::Resolution`]; [`VoxelError::TooMany`] for 2³² surfels or more.
    ///
    /// Source: Malgouyres 2002, section 2.2; the cross is the target of S. Laine, "A Topological Approach to Voxelization", 2013.
    /// Departures: three axes where the paper has one.
    pub fn new(scene: &Scene, n: u32) -> Result<Self, VoxelError> {
        let grid = Grid::new(scene, n)?;
        let faces: Vec<FaceId> = scene.face_ids().collect();
        let all: Vec<Piece> = threads::collect_flat(faces.len(), |k| {
            let face = faces[k];
            let voxels = voxels_of_face(&grid, &scene.polygon(face));
            let area = scene.area_vector(face).length() / voxels.len() as f64;
            voxels.into_iter().map(move |voxel| Piece { voxel, face, area })
        });
        if u32::try_from(all.len()).is_err() {
            return Err(VoxelError::TooMany { n_surfels: all.len() });
        }
        let voxels: Vec<Voxel> = all.iter().map(|piece| piece.voxel).collect();
        let Built { octree, ranks } = Octree::build(grid.n_voxels, &voxels);
        drop(voxels);
        let mut order: Vec<(u32, usize)> = ranks.into_iter().zip(0..).collect();
        order.par_sort_unstable();
        let pieces = Pieces { all, order };
        let mut made = Self {
            grid,
            octree,
            surfels: Vec::new(),
            normals: Vec::new(),
            thin_walls: Vec::new(),
            first_surfel: Vec::new(),
            normal_of: Vec::new(),
            sides: Vec::new(),
            regions: None,
            is_closed: false,
        };
        made.put_surfels(scene, &pieces, None);
        let found = thin::find(scene, &made);
        if !found.walls.is_empty() {
            let sides = Sides::new(scene, &made, &found.near, &pieces);
            made.put_surfels(scene, &pieces, Some(&sides));
            made.thin_walls = found.walls;
            drop(pieces);
            made.regions = Regions::new(&made, &sides);
        }
        Ok(made)
    }

    /// Says that the scene is closed: links that leave it then carry light that is [lost](super::LinkOperator::leak_power).
    pub fn expect_closed(&mut self) {
        self.is_closed = true;
    }

    /// Makes the surfels of all pieces, one for each side where `sides` are known.
    fn put_surfels(&mut self, scene: &Scene, pieces: &Pieces, sides: Option<&Sides>) {
        let units: Vec<DVec3> = scene
            .face_ids()
            .map(|face| scene.area_vector(face).normalize_or_zero())
            .collect();
        let mut maker = Maker {
            scene,
            grid: &self.grid,
            units: &units,
            normals: Vec::new(),
            normal_of: HashMap::new(),
            surfels: Vec::with_capacity(pieces.order.len()),
            sides: Vec::new(),
        };
        let mut first_surfel = Vec::with_capacity(self.octree.n_voxels() + 1);
        let mut thin = Vec::new();
        let (mut next, mut parts) = (0, Vec::new());
        for (rank, of_voxel) in pieces.by_voxel() {
            let first = maker.surfels.len();
            first_surfel.push(to_u32(first));
            parts.clear();
            let known = sides.map(|sides| (sides.parts_of(rank, &mut next), sides.crossed(rank)));
            if let Some((known, crossed)) = known.filter(|(known, _)| !known.is_empty()) {
                parts.extend(known.iter().map(|(_, part)| *part));
                maker.push_voxel(pieces.voxel(of_voxel), &parts, crossed);
                thin.push(first..maker.surfels.len());
            } else {
                let part = |&(_, k): &(u32, usize)| pieces.all[k].everywhere();
                parts.extend(of_voxel.iter().map(part));
                maker.push_voxel(pieces.voxel(of_voxel), &parts, 0);
            }
        }
        first_surfel.push(to_u32(maker.surfels.len()));
        maker.surfels.shrink_to_fit();
        self.normal_of = maker.surfels.iter().map(|s| s.normal).collect();
        thin.into_iter().flatten().for_each(|s| self.normal_of[s] |= THIN);
        self.sides = if sides.is_some() { maker.sides } else { Vec::new() };
        (self.surfels, self.normals, self.first_surfel) = (maker.surfels, maker.normals, first_surfel);
    }

    /// Returns the number of surfels: the unknowns.
    #[must_use]
    pub fn n_surfels(&self) -> usize {
        self.surfels.len()
    }

    /// Returns the normal of a surfel.
    #[must_use]
    pub fn normal(&self, surfel: usize) -> &Normal {
        &self.normals[self.surfels[surfel].normal as usize]
    }

    /// Returns the surfels of the surface voxel of a rank.
    #[must_use]
    pub fn surfels_of(&self, rank: u32) -> std::ops::Range<usize> {
        let at = rank as usize;
        self.first_surfel[at] as usize..self.first_surfel[at + 1] as usize
    }

    /// Returns the areas of all surfels, m².
    #[must_use]
    pub fn areas(&self) -> Vec<f64> {
        self.surfels.iter().map(|s| s.area).collect()
    }

    /// Returns the memory of octree, surfels and normals.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.octree.n_bytes()
            + self.surfels.len() * size_of::<Surfel>()
            + self.normals.len() * size_of::<Normal>()
            + 4 * (self.first_surfel.len() + self.normal_of.len())
            + size_of::<Facts>() * self.sides.len()
            + self.regions.as_ref().map_or(0, Regions::n_bytes)
    }

    /// Calls `work` with the ranks of the surface voxels among a voxel and the 26 around it.
    pub(super) fn each_rank_around(&self, [x, y, z]: Voxel, mut work: impl FnMut(u32)) {
        for k in -1..=1 {
            for j in -1..=1 {
                for i in -1..=1 {
                    if let Some(rank) = self.octree.rank([x + i, y + j, z + k]) {
                        work(rank);
                    }
                }
            }
        }
    }

    /// Returns whether the sides of a surfel's voxel are known, as those of thin walls and around them are.
    pub(super) fn is_thin(&self, surfel: usize) -> bool {
        self.normal_of[surfel] & THIN != 0
    }

    /// Returns the nodes that a surfel looks to; all where these are unknown.
    pub(super) fn nodes(&self, surfel: usize) -> u8 {
        if self.is_thin(surfel) {
            self.sides[surfel].nodes
        } else {
            ALL_NODES
        }
    }

    /// Returns the sides towards which faces lie between the centre of a surfel's voxel and the voxel's border; none where that is unknown.
    pub(super) fn crossed(&self, surfel: usize) -> u8 {
        if self.is_thin(surfel) {
            self.sides[surfel].crossed
        } else {
            0
        }
    }
}

/// The part of a face in a voxel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) voxel: Voxel,
    pub(super) face: FaceId,
    /// Its share of the face's area, m².
    pub(super) area: f64,
}

impl Piece {
    fn everywhere(self) -> Part {
        let Self { face, area, .. } = self;
        Part {
            face,
            area,
            nodes: ALL_NODES,
        }
    }
}

/// The parts of all faces in all voxels.
pub(super) struct Pieces {
    pub(super) all: Vec<Piece>,
    /// The rank of each piece's voxel and the piece's index in `all`, sorted.
    order: Vec<(u32, usize)>,
}

impl Pieces {
    /// Returns the pieces of each surface voxel, as ranks and indices in `all`, by rank.
    pub(super) fn by_voxel(&self) -> impl Iterator<Item = (u32, &[(u32, usize)])> {
        self.order.chunk_by(|a, b| a.0 == b.0).map(|list| (list[0].0, list))
    }

    fn voxel(&self, of_voxel: &[(u32, usize)]) -> Voxel {
        self.all[of_voxel[0].1].voxel
    }
}

/// A surfel near a thin wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facts {
    /// The nodes that it looks to.
    nodes: u8,
    /// The sides towards which any face lies between the centre of its voxel and the voxel's border.
    crossed: u8,
}

/// Makes surfels voxel by voxel.
struct Maker<'a> {
    scene: &'a Scene,
    grid: &'a Grid,
    units: &'a [DVec3],
    normals: Vec<Normal>,
    normal_of: HashMap<[u64; 3], u32>,
    surfels: Vec<Surfel>,
    sides: Vec<Facts>,
}

/// A surfel in the making.
struct Draft {
    key: (SurfaceId, MaterialId),
    nodes: u8,
    faces: Vec<FaceId>,
    /// Σ area × normal.
    sum: DVec3,
    area: f64,
}

impl Maker<'_> {
    fn push_voxel(&mut self, voxel: Voxel, parts: &[Part], crossed: u8) {
        let mut drafts: Vec<Draft> = Vec::new();
        for &Part { face, area, nodes } in parts {
            let f = &self.scene.faces[face.0 as usize];
            let key = (f.surface, f.material);
            let unit = self.units[face.0 as usize];
            let same = |d: &&mut Draft| {
                let is_on_one_side = d.nodes & nodes != 0 || d.nodes == nodes;
                d.key == key && is_on_one_side && d.sum.normalize_or_zero().dot(unit) > SMOOTH
            };
            if let Some(draft) = drafts.iter_mut().find(same) {
                draft.faces.push(face);
                draft.nodes |= nodes;
                draft.sum += area * unit;
                draft.area += area;
            } else {
                drafts.push(Draft {
                    key,
                    nodes,
                    faces: vec![face],
                    sum: area * unit,
                    area,
                });
            }
        }
        let voxel = voxel.map(|c| u16::try_from(c).expect("a lattice has at most 4096 voxels a side"));
        let faced = self.facing(&drafts);
        for (draft, facing) in drafts.into_iter().zip(faced) {
            let of_face = |f: &FaceId| self.units[f.0 as usize];
            let first = of_face(&draft.faces[0]);
            // A surfel of one plane keeps the normal of that plane to the last bit.
            let flat = draft.faces.iter().all(|f| of_face(f) == first);
            let unit = if flat { first } else { draft.sum.normalize_or_zero() };
            let normal = self.normal(unit);
            self.surfels.push(Surfel {
                voxel,
                facing,
                normal,
                face: draft.faces[0],
                area: draft.area,
            });
            self.sides.push(Facts {
                nodes: draft.nodes,
                crossed,
            });
        }
    }

    fn normal(&mut self, unit: DVec3) -> u32 {
        let key = unit.to_array().map(|x| (x + 0.0).to_bits());
        *self.normal_of.entry(key).or_insert_with(|| {
            self.normals.push(Normal::new(unit));
            to_u32(self.normals.len() - 1)
        })
    }

    /// Returns for each surfel of a voxel which of the others it faces: each must rise above the other's plane.
    fn facing(&self, drafts: &[Draft]) -> Vec<u8> {
        if drafts.len() == 1 {
            return vec![0];
        }
        let rises = |over: &Draft, other: &Draft| {
            let face = over.faces[0];
            let n = self.units[face.0 as usize];
            let base = self.scene.polygon(face)[0];
            let corners = other.faces.iter().flat_map(|&f| self.scene.polygon(f));
            corners.map(|v| n.dot(v - base)).fold(f64::NEG_INFINITY, f64::max) > RISE * self.grid.voxel_size
        };
        let bits = |k: usize| {
            let is_on_one_side = |j: usize| drafts[k].nodes & drafts[j].nodes != 0;
            let faced = (0..drafts.len().min(MAX_FACING)).filter(|&j| {
                j != k && is_on_one_side(j) && rises(&drafts[k], &drafts[j]) && rises(&drafts[j], &drafts[k])
            });
            faced.fold(0_u8, |bits, j| bits | 1 << j)
        };
        (0..drafts.len()).map(bits).collect()
    }
}

/// A crossing of a face with a line through the centres of voxels along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// The voxel that the crossing makes surface.
    pub(super) voxel: Voxel,
    /// The axis of the line.
    pub(super) axis: usize,
    /// The position along the axis, in lattice coordinates.
    pub(super) at: f64,
    /// Whether the face's front looks along the axis instead of against it.
    pub(super) looks_up: bool,
}

/// Calls `work` with all crossings of a convex face with the lines through the centres of voxels.
pub(super) fn each_crossing(grid: &Grid, polygon: &[DVec3], mut work: impl FnMut(Crossing)) {
    let corners: Vec<DVec3> = polygon.iter().map(|&v| grid.to_lattice(v)).collect();
    let normal = polygon::area_vector(&corners).normalize_or_zero();
    for axis in 0..3 {
        // Along an axis in its own plane, a face has no visible area.
        if normal[axis].abs() > 1e-9 {
            fill(&corners, normal, axis, |crossing| {
                if (0..3).all(|a| (0..grid.n_voxels[a]).contains(&crossing.voxel[a])) {
                    work(crossing);
                }
            });
        }
    }
}

/// Returns the voxels of a convex face, each once; at least one.
fn voxels_of_face(grid: &Grid, polygon: &[DVec3]) -> Vec<Voxel> {
    let mut voxels = Vec::new();
    each_crossing(grid, polygon, |crossing| voxels.push(crossing.voxel));
    voxels.sort_unstable();
    voxels.dedup();
    if voxels.is_empty() {
        let centroid = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
        let voxel = grid.voxel_at(centroid);
        voxels.push(std::array::from_fn(|a| voxel[a].clamp(0, grid.n_voxels[a] - 1)));
    }
    voxels
}

/// Calls `work` with the crossings over the pixels that a convex polygon covers when seen along `axis`.
///
/// A pixel belongs to the polygon that contains its centre. On an edge both neighbours must decide alike: an edge is always evaluated from its
/// lower end, and a span excludes its low end and includes its high one.
fn fill(corners: &[DVec3], normal: DVec3, axis: usize, mut work: impl FnMut(Crossing)) {
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    let low = corners.iter().map(|v| v[c]).fold(f64::INFINITY, f64::min);
    let high = corners.iter().map(|v| v[c]).fold(f64::NEG_INFINITY, f64::max);
    let anchor = corners[0];
    for row in above(low)..above(high) {
        let y = f64::from(row);
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (k, &from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % corners.len()];
            let (p, q) = if (from[c], from[b]) <= (to[c], to[b]) {
                (from, to)
            } else {
                (to, from)
            };
            if above(p[c]) <= row && row < above(q[c]) {
                let x = p[b] + (y - p[c]) / (q[c] - p[c]) * (q[b] - p[b]);
                left = left.min(x);
                right = right.max(x);
            }
        }
        if left > right {
            continue;
        }
        for column in above(left)..above(right) {
            let x = f64::from(column);
            let offset = normal[b] * (x - anchor[b]) + normal[c] * (y - anchor[c]);
            let at = anchor[axis] - offset / normal[axis];
            let mut voxel = [0; 3];
            voxel[axis] = nearest(at + HALF_SLACK.copysign(normal[axis]));
            voxel[b] = column;
            voxel[c] = row;
            work(Crossing {
                voxel,
                axis,
                at,
                looks_up: normal[axis] > 0.0,
            });
        }
    }
}

/// Returns the least integer above x.
#[expect(
    clippy::cast_possible_truncation,
    reason = "lattice coordinates are at most MAX_VOXELS"
)]
fn above(x: f64) -> i32 {
    x.floor() as i32 + 1
}
