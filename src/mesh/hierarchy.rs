//! Coarse and fine levels of a mesh: the patches of each level are unions of those of the next finer one.

mod adjacency;
mod cells;

use std::ops::Range;

use super::face_shape::count;
use super::patches::Mesh;

pub use super::face_shape::FaceShape;
use adjacency::Neighbours;
use cells::FaceCells;

/// The interpolation of values from a coarse level to the next finer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prolongation {
    /// Every patch takes the value of its parent: order 0, exact for constants.
    #[default]
    Injection,
    /// Bilinear between the parent and its neighbours in the grid of the same face, at the patch's centre.
    ///
    /// It is linear along the edges of a face and the parent's value at its corners, because light jumps from face to face. Between grids of equal cells the weights are 9, 3, 3, 1 sixteenths inside.
    /// Triangles and groups of faces have no such grid: there it is injection.
    ///
    /// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), section 5.5, the first of its two rules. Departures: none on grids of 2 × 2 unions.
    Bilinear,
}

/// The levels of a mesh, from its patches to ever larger unions of them.
///
/// Faces that are cut into grids are coarsened by themselves, all at once: n parts of an edge become ⌊n / 2⌋, which merges two by two, and where n is odd
/// three in one place: 12 → 6 → 3 → 1. Triangles join the patches whose centroids lie in the same coarse triangle, which are four where n is even.
/// When every face is one patch, faces are joined in pairs of pairs: neighbours across a common edge, of the same surface, whose normals differ by less than 60°,
/// first those with the longest common border. That makes a flat wall of many faces (and a sphere, by its regions) as coarse as it can be.
/// A scene whose faces have no such neighbours ends with one patch a face.
///
/// Memory: about 30 bytes a patch. Work: a few operations a patch.
/// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), section 5.1. Departures: any numbers of parts, triangles, and faces that are patches themselves.
#[derive(Clone, Debug, PartialEq)]
pub struct Hierarchy {
    n_patches: usize,
    levels: Vec<Coarsening>,
}

/// One step of a hierarchy: from a level of n patches to the next coarser one of m.
#[derive(Clone, Debug, PartialEq)]
pub struct Coarsening {
    /// \[n\].
    parents: Vec<u32>,
    /// The part of its parent's area that a patch has, \[n\].
    shares: Vec<f64>,
    /// The children of J are `children[ends[J − 1]..ends[J]]`, ascending.
    ends: Vec<u32>,
    children: Vec<u32>,
    /// The bilinear weights of patch i are `stencil[stencil_ends[i − 1]..stencil_ends[i]]`: coarse patches and weights.
    stencil_ends: Vec<u32>,
    stencil: Vec<(u32, f64)>,
}

impl Hierarchy {
    /// Returns the hierarchy of a mesh.
    #[must_use]
    pub fn of_mesh(mesh: &Mesh) -> Self {
        let shapes: Vec<FaceShape> = mesh.grids.iter().flat_map(super::grid::FaceGrid::shapes).collect();
        let mut hierarchy = Self::of_faces(&shapes, &mesh.areas());
        let mut group_of_patch: Vec<u32> = (0..count(mesh.n_patches())).collect();
        for level in &hierarchy.levels {
            for group in &mut group_of_patch {
                *group = level.parents[*group as usize];
            }
        }
        let mut neighbours = Neighbours::of_mesh(mesh, &group_of_patch);
        while let Some(parents) = neighbours.join_four() {
            neighbours = neighbours.joined(&parents);
            hierarchy = hierarchy.then(parents, &mesh.areas());
        }
        hierarchy
    }

    /// Returns the hierarchy of patches that come face by face, down to one patch a face.
    ///
    /// `areas`: A, m², \[n\].
    ///
    /// # Panics
    /// If there are not as many areas as patches.
    #[must_use]
    #[track_caller]
    pub fn of_faces(shapes: &[FaceShape], areas: &[f64]) -> Self {
        let n_patches: usize = shapes.iter().map(|shape| shape.n_patches()).sum();
        assert_eq!(n_patches, areas.len(), "one area per patch");
        let mut faces: Vec<FaceCells> = shapes.iter().map(|&shape| FaceCells::new(shape)).collect();
        let mut levels = Vec::new();
        let mut areas = areas.to_vec();
        while faces.iter().any(|face| face.n_cells() > 1) {
            let coarse: Vec<FaceCells> = faces.iter().map(FaceCells::coarsened).collect();
            let (mut parents, mut stencils) = (Vec::new(), Vec::new());
            let mut first = 0;
            for (fine, merged) in faces.iter().zip(&coarse) {
                fine.for_each_parent(merged, |parent, stencil| {
                    parents.push(first + parent);
                    stencils.push(stencil.iter().map(|&(k, w)| (first + k, w)).collect::<Vec<_>>());
                });
                first += count(merged.n_cells());
            }
            let level = Coarsening::new(parents, Some(&stencils), &areas);
            areas = level.restricted_sums(&areas);
            levels.push(level);
            faces = coarse;
        }
        Self { n_patches, levels }
    }

    /// Returns a hierarchy of two levels: the patches, and the sets that `labels` \[n\] puts them into.
    ///
    /// # Panics
    /// If there are not as many labels as areas, or a number below the greatest label names no patch.
    #[must_use]
    #[track_caller]
    pub fn of_groups(labels: &[u32], areas: &[f64]) -> Self {
        let patches = Self {
            n_patches: areas.len(),
            levels: Vec::new(),
        };
        patches.then(labels.to_vec(), areas)
    }

    /// Adds a coarsest level in which patch I of the present coarsest one joins `parents[I]`; `areas` are those of the finest level.
    ///
    /// # Panics
    /// If there is not one parent for each patch of the coarsest level, or a number below the greatest parent has no patch.
    #[must_use]
    #[track_caller]
    pub fn then(mut self, parents: Vec<u32>, areas: &[f64]) -> Self {
        let mut coarse_areas = areas.to_vec();
        for level in &self.levels {
            coarse_areas = level.restricted_sums(&coarse_areas);
        }
        self.levels.push(Coarsening::new(parents, None, &coarse_areas));
        self
    }

    /// Returns the number of patches of the finest level.
    #[must_use]
    pub fn n_patches(&self) -> usize {
        self.n_patches
    }

    /// Returns the steps from each level to the next coarser one, the finest first.
    #[must_use]
    pub fn levels(&self) -> &[Coarsening] {
        &self.levels
    }

    /// Returns the number of patches of every level, the finest first: 6 · 4^l, ..., 24, 6 in the room of Lewis.
    #[must_use]
    pub fn sizes(&self) -> Vec<usize> {
        let coarser = self.levels.iter().map(Coarsening::n_coarse);
        std::iter::once(self.n_patches).chain(coarser).collect()
    }
}

impl Coarsening {
    #[track_caller]
    fn new(parents: Vec<u32>, stencils: Option<&[Vec<(u32, f64)>]>, areas: &[f64]) -> Self {
        assert_eq!(parents.len(), areas.len(), "one parent per patch");
        let n_coarse = parents.iter().map(|&p| p as usize + 1).max().unwrap_or(0);
        let mut ends = vec![0_u32; n_coarse];
        let mut coarse_areas = vec![0.0; n_coarse];
        for (&parent, area) in parents.iter().zip(areas) {
            ends[parent as usize] += 1;
            coarse_areas[parent as usize] += area;
        }
        assert!(ends.iter().all(|&n| n > 0), "every coarse patch has children");
        let mut end = 0;
        let mut next = Vec::with_capacity(n_coarse);
        for n in &mut ends {
            next.push(end);
            end += *n;
            *n = end;
        }
        let mut children = vec![0; parents.len()];
        for (i, &parent) in (0..).zip(&parents) {
            children[next[parent as usize] as usize] = i;
            next[parent as usize] += 1;
        }
        let shares = parents.iter().zip(areas).map(|(&p, a)| a / coarse_areas[p as usize]);
        let shares = shares.collect();
        let (mut stencil_ends, mut stencil) = (Vec::new(), Vec::new());
        for (i, &parent) in parents.iter().enumerate() {
            match stencils {
                Some(stencils) => stencil.extend_from_slice(&stencils[i]),
                None => stencil.push((parent, 1.0)),
            }
            stencil_ends.push(count(stencil.len()));
        }
        Self {
            parents,
            shares,
            ends,
            children,
            stencil_ends,
            stencil,
        }
    }

    /// Returns n, the number of patches of the finer level.
    #[must_use]
    pub fn n_fine(&self) -> usize {
        self.parents.len()
    }

    /// Returns m, the number of patches of the coarser level.
    #[must_use]
    pub fn n_coarse(&self) -> usize {
        self.ends.len()
    }

    /// Returns the parent of each patch, \[n\].
    #[must_use]
    pub fn parents(&self) -> &[u32] {
        &self.parents
    }

    /// Returns the part of its parent's area that each patch has, \[n\].
    #[must_use]
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// Returns the patches of coarse patch `parent`, ascending.
    #[must_use]
    pub fn children(&self, parent: usize) -> &[u32] {
        &self.children[span(&self.ends, parent)]
    }

    /// Returns the coarse patches and weights of the bilinear value of a patch; the weights are positive and sum to 1.
    #[must_use]
    pub fn bilinear(&self, patch: usize) -> &[(u32, f64)] {
        &self.stencil[span(&self.stencil_ends, patch)]
    }

    /// Returns the area-weighted means over the coarse patches: x_I = Σ_{i ∈ I} A_i x_i / A_I.
    ///
    /// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), section 5.4. Departures: weighted by area, where patches of one parent differ.
    ///
    /// # Panics
    /// If there is not one value per patch.
    #[must_use]
    #[track_caller]
    pub fn restricted(&self, fine: &[f64]) -> Vec<f64> {
        assert_eq!(fine.len(), self.n_fine(), "one value per patch");
        let mut coarse = vec![0.0; self.n_coarse()];
        for ((&parent, share), x) in self.parents.iter().zip(&self.shares).zip(fine) {
            coarse[parent as usize] += share * x;
        }
        coarse
    }

    /// Returns the sums over the coarse patches, such as their areas.
    fn restricted_sums(&self, fine: &[f64]) -> Vec<f64> {
        let mut coarse = vec![0.0; self.n_coarse()];
        for (&parent, x) in self.parents.iter().zip(fine) {
            coarse[parent as usize] += x;
        }
        coarse
    }

    /// Returns the values on the finer level, \[n\], of coarse values \[m\].
    #[must_use]
    pub fn prolonged(&self, prolongation: Prolongation, coarse: &[f64]) -> Vec<f64> {
        match prolongation {
            Prolongation::Injection => self.parents.iter().map(|&parent| coarse[parent as usize]).collect(),
            Prolongation::Bilinear => {
                let value = |i| self.bilinear(i).iter().map(|&(k, w)| w * coarse[k as usize]).sum();
                (0..self.n_fine()).map(value).collect()
            }
        }
    }
}

/// Returns the range between two entries of a list of ends.
fn span(ends: &[u32], k: usize) -> Range<usize> {
    let begin = if k == 0 { 0 } else { ends[k - 1] };
    begin as usize..ends[k] as usize
}

#[cfg(test)]
mod tests;
