//! The faces, or groups of faces, that may be joined to a coarser patch.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use crate::mesh::face_shape::count;
use crate::mesh::patches::Mesh;

/// cos 60°: normals that differ by more point to different parts of an enclosure.
const COS_MAX_TURN: f64 = 0.5;

/// Groups of patches with their neighbours.
pub(super) struct Neighbours {
    /// A n of each group, m².
    area_vectors: Vec<DVec3>,
    /// The surface of each group.
    surfaces: Vec<u32>,
    /// For each group its neighbours of the same surface, and the length of the common border, m.
    borders: Vec<BTreeMap<u32, f64>>,
}

impl Neighbours {
    pub(super) fn of_mesh(mesh: &Mesh, group_of_patch: &[u32]) -> Self {
        let n = group_of_patch.iter().map(|&g| g as usize + 1).max().unwrap_or(0);
        let mut groups = Self {
            area_vectors: vec![DVec3::ZERO; n],
            surfaces: vec![0; n],
            borders: vec![BTreeMap::new(); n],
        };
        // Positions, not vertices: a position has several vertices where planes meet.
        let key = |v: u32| mesh.vertices[v as usize].to_array().map(|x| (x + 0.0).to_bits());
        let mut by_edge: HashMap<([u64; 3], [u64; 3]), Vec<u32>> = HashMap::new();
        for (patch, &group) in mesh.patches.iter().zip(group_of_patch) {
            groups.area_vectors[group as usize] += patch.area * patch.normal;
            groups.surfaces[group as usize] = patch.surface.0;
            let corners = patch.corners.as_slice();
            for (k, &a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                let (from, to) = (key(a), key(b));
                // A neighbour on the same side runs along the edge in the opposite sense.
                for &other in by_edge.get(&(to, from)).into_iter().flatten() {
                    if other != group {
                        let length = mesh.vertices[a as usize].distance(mesh.vertices[b as usize]);
                        groups.add_border(group, other, length);
                    }
                }
                by_edge.entry((from, to)).or_default().push(group);
            }
        }
        groups
    }

    fn add_border(&mut self, a: u32, b: u32, length: f64) {
        if self.surfaces[a as usize] == self.surfaces[b as usize] {
            *self.borders[a as usize].entry(b).or_default() += length;
            *self.borders[b as usize].entry(a).or_default() += length;
        }
    }

    /// Returns the parents of pairs of pairs, or `None` where no more can be joined.
    pub(super) fn join_four(&self) -> Option<Vec<u32>> {
        let first = self.join_pairs()?;
        let pairs = self.joined(&first);
        match pairs.join_pairs() {
            None => Some(first),
            Some(second) => Some(first.iter().map(|&pair| second[pair as usize]).collect()),
        }
    }

    /// Joins each group with its free neighbour of the longest common border, in the order of the groups.
    fn join_pairs(&self) -> Option<Vec<u32>> {
        let n = self.surfaces.len();
        let mut parents: Vec<Option<u32>> = vec![None; n];
        let mut n_parents = 0;
        for group in 0..n {
            if parents[group].is_some() {
                continue;
            }
            let free = self.borders[group]
                .iter()
                .filter(|&(&other, _)| parents[other as usize].is_none());
            let flat = free.filter(|&(&other, _)| self.may_join(group, other as usize));
            let partner = flat.fold(None, |best: Option<(u32, f64)>, (&other, &length)| match best {
                Some((_, longest)) if longest >= length => best,
                _ => Some((other, length)),
            });
            parents[group] = Some(n_parents);
            if let Some((partner, _)) = partner {
                parents[partner as usize] = Some(n_parents);
            }
            n_parents += 1;
        }
        ((n_parents as usize) < n).then(|| parents.into_iter().flatten().collect())
    }

    fn may_join(&self, a: usize, b: usize) -> bool {
        let (a, b) = (self.area_vectors[a], self.area_vectors[b]);
        a.dot(b) > COS_MAX_TURN * a.length() * b.length()
    }

    /// Returns the groups that result from `parents`.
    pub(super) fn joined(&self, parents: &[u32]) -> Self {
        let n = parents.iter().map(|&p| p as usize + 1).max().unwrap_or(0);
        let mut groups = Self {
            area_vectors: vec![DVec3::ZERO; n],
            surfaces: vec![0; n],
            borders: vec![BTreeMap::new(); n],
        };
        for (group, &parent) in parents.iter().enumerate() {
            groups.area_vectors[parent as usize] += self.area_vectors[group];
            groups.surfaces[parent as usize] = self.surfaces[group];
        }
        for (group, &parent) in parents.iter().enumerate() {
            for (&other, &length) in self.borders[group].range(count(group)..) {
                let other = parents[other as usize];
                if other != parent {
                    groups.add_border(parent, other, length);
                }
            }
        }
        groups
    }
}
