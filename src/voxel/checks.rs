//! Checks whether a discretised scene still resolves the original.

use std::collections::BTreeMap;

use glam::DVec3;

use super::discretize::VoxelScene;
use super::grid::Voxel;
use crate::geometry::polygon;
use crate::scene::{Scene, SurfaceId};
use crate::threads;

/// Two surfaces that face each other with less than two voxels between them, where the light is not resolved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThinGap {
    /// The two surfaces, the lower id first; equal where a surface faces itself.
    pub surfaces: [SurfaceId; 2],
    /// The number of surfels that look into the gap.
    pub n_surfels: usize,
}

/// The cosine beyond which two surfaces face each other across a gap.
const OPPOSED: f64 = -0.7;

impl VoxelScene {
    /// Returns the surfels whose front can be reached from outside of the lattice along a 6-path of free voxels.
    ///
    /// In a scene that is closed, seen from its fronts, there are none unless a surface leaks.
    ///
    /// # Panics
    /// Never: a lattice has at most 4096 voxels a side and surfels are counted in 32 bits.
    #[must_use]
    pub fn reached_from_outside(&self) -> Vec<u32> {
        let [nx, ny, nz] = self.grid.n_voxels.map(|n| n.unsigned_abs() as usize + 2);
        let place = |[x, y, z]: [usize; 3]| (z * ny + y) * nx + x;
        let mut reached = vec![false; nx * ny * nz];
        let is_free = |p: [usize; 3]| {
            let voxel: Voxel = p.map(|c| i32::try_from(c).expect("a lattice is small") - 1);
            self.octree.rank(voxel).is_none()
        };
        let mut stack = vec![[0_usize; 3]];
        reached[0] = true;
        while let Some(p) = stack.pop() {
            for a in 0..3 {
                for q in [p[a].checked_sub(1), Some(p[a] + 1).filter(|&c| c < [nx, ny, nz][a])]
                    .into_iter()
                    .flatten()
                {
                    let mut next = p;
                    next[a] = q;
                    if !reached[place(next)] && is_free(next) {
                        reached[place(next)] = true;
                        stack.push(next);
                    }
                }
            }
        }
        let is_reached = |&surfel: &u32| {
            let front = self.in_front(surfel as usize, 1);
            // A lattice with a rim of one voxel: no front is further out.
            let p = front.map(|c| (c + 1).unsigned_abs() as usize);
            self.octree.rank(front).is_none() && reached[place(p)]
        };
        let n = u32::try_from(self.n_surfels()).expect("surfels are counted in 32 bits");
        (0..n).filter(is_reached).collect()
    }

    /// Returns the pairs of surfaces that face each other with less than two free voxels between them, most surfels first.
    #[must_use]
    pub fn thin_gaps(&self, scene: &Scene) -> Vec<ThinGap> {
        let surface = |surfel: usize| scene.faces[self.surfels[surfel].face.0 as usize].surface;
        let mut counts: BTreeMap<[SurfaceId; 2], usize> = BTreeMap::new();
        for s in 0..self.n_surfels() {
            for distance in 0..=2 {
                let Some(rank) = self.octree.rank(self.in_front(s, distance)) else {
                    continue;
                };
                let range = self.surfels_of(rank);
                let first = range.start;
                let is_across = |&t: &usize| {
                    let opposed = self.normal(t).unit.dot(self.normal(s).unit) < OPPOSED;
                    opposed && (distance > 0 || self.surfels[s].faces(t - first))
                };
                if let Some(t) = range.clone().find(is_across) {
                    let mut pair = [surface(s), surface(t)];
                    pair.sort_unstable();
                    *counts.entry(pair).or_default() += 1;
                    break;
                }
                if distance > 0 {
                    break;
                }
            }
        }
        let gap = |(surfaces, n_surfels)| ThinGap { surfaces, n_surfels };
        let mut gaps: Vec<ThinGap> = counts.into_iter().map(gap).collect();
        gaps.sort_by_key(|found| std::cmp::Reverse(found.n_surfels));
        gaps
    }

    /// Returns the surfaces that are smaller than two voxels, each with the longest side of its box, m, the smallest first.
    ///
    /// Neither their shadows nor their exchange of light are resolved.
    #[must_use]
    pub fn small_surfaces(&self, scene: &Scene) -> Vec<(SurfaceId, f64)> {
        let mut boxes: BTreeMap<SurfaceId, (DVec3, DVec3)> = BTreeMap::new();
        for face in &scene.faces {
            let (low, high) = scene.positions(face).bounding_box();
            let bounds = boxes.entry(face.surface).or_insert((low, high));
            *bounds = (bounds.0.min(low), bounds.1.max(high));
        }
        let sides = boxes
            .into_iter()
            .map(|(surface, (low, high))| (surface, (high - low).max_element()));
        let mut small: Vec<_> = sides.filter(|&(_, side)| side < 2.0 * self.grid.voxel_size).collect();
        small.sort_by(|a, b| a.1.total_cmp(&b.1));
        small
    }

    /// Returns the Hausdorff distance between the scene and the centres of the surface voxels, in voxels.
    ///
    /// From voxels to the scene it is exact, to the face of each surfel (an upper bound). From the scene to voxels it is computed at points of its faces half a voxel apart, and so up to half a voxel's
    /// diagonal in the plane, 0.36, too small at worst. `None` if some point of the scene has no surface voxel within two voxels.
    #[must_use]
    pub fn hausdorff_distance(&self, scene: &Scene) -> Option<f64> {
        let to_lattice =
            |polygon: Vec<DVec3>| -> Vec<DVec3> { polygon.iter().map(|&v| self.grid.to_lattice(v)).collect() };
        let from_surfels = threads::collect_from(&self.surfels, |s| {
            polygon::distance(
                DVec3::from_array(s.voxel().map(f64::from)),
                &to_lattice(scene.polygon(s.face)),
            )
        });
        let from_voxels = from_surfels.into_iter().fold(0.0, f64::max);
        let faces: Vec<_> = scene.face_ids().collect();
        let of_face = |face: &crate::scene::FaceId| -> Option<f64> {
            let p = to_lattice(scene.polygon(*face));
            // A quad as it is, a triangle as a quad with a double corner.
            let d = p.get(3).copied().unwrap_or(p[2]);
            let span = [
                p[0].distance(p[1]),
                p[2].distance(d),
                p[0].distance(d),
                p[1].distance(p[2]),
            ];
            let mut n = 1.0_f64;
            for length in span {
                n = n.max((2.0 * length).ceil());
            }
            #[expect(clippy::cast_possible_truncation, reason = "twice the voxels along an edge")]
            let n = n as i32;
            let mut worst = from_voxels;
            for j in 0..=n {
                for i in 0..=n {
                    let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                    let point = p[0].lerp(p[1], u).lerp(d.lerp(p[2], u), v);
                    // The voxel of the point bounds the distance: most points need no search.
                    let home = point.to_array().map(super::grid::nearest);
                    let within = |voxel: Voxel| point.distance(DVec3::from_array(voxel.map(f64::from)));
                    if within(home) > worst || self.octree.rank(home).is_none() {
                        worst = worst.max(self.distance_to_voxels(point)?);
                    }
                }
            }
            Some(worst)
        };
        let distances: Option<Vec<f64>> = threads::collect_from(&faces, of_face).into_iter().collect();
        distances.map(|all| all.into_iter().fold(from_voxels, f64::max))
    }

    fn distance_to_voxels(&self, point: DVec3) -> Option<f64> {
        let home = point.to_array().map(super::grid::nearest);
        let nearest_within = |reach: i32| {
            let mut least = f64::INFINITY;
            for k in -reach..=reach {
                for j in -reach..=reach {
                    for i in -reach..=reach {
                        let voxel = [home[0] + i, home[1] + j, home[2] + k];
                        if self.octree.rank(voxel).is_some() {
                            least = least.min(point.distance(DVec3::from_array(voxel.map(f64::from))));
                        }
                    }
                }
            }
            least
        };
        // A voxel farther than one voxel away along an axis is at least one voxel from the point.
        let near = nearest_within(1);
        let least = if near <= 1.0 { near } else { nearest_within(2) };
        least.is_finite().then_some(least)
    }

    /// Returns the voxel `distance` voxels in front of a surfel, along the axis of its normal's largest component.
    fn in_front(&self, surfel: usize, distance: i32) -> Voxel {
        let normal = self.normal(surfel);
        let mut voxel = self.surfels[surfel].voxel();
        voxel[normal.axis] += distance * normal.integer[normal.axis].signum();
        voxel
    }
}
