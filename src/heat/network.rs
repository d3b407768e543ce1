//! Boundary conditions on the patches of a mesh: given temperatures, and groups of patches that share an unknown one.

use super::boundary::{Boundary, Condition, PatchPlace};
use super::error::HeatError;
use super::sides::opposites;
use crate::disjoint_sets::DisjointSets;
use crate::matrix::operator::{Block, Components, LinearOperator, RowAccess};
use crate::matrix::{DiskError, FormFactors};
use crate::mesh::Mesh;
use crate::scene::Scene;

/// The greatest difference of the corners of coincident patches, in units of the size of the scene.
const COINCIDENT: f64 = 1e-9;

/// The relative sum below which supplied heats balance up to rounding.
const BALANCED_TO: f64 = 1e-12;

/// The boundary conditions of every patch.
///
/// A patch has a given emissive power M = σ T⁴, or is a member of a group of patches with one unknown M and a supplied heat. A group is one patch where a flux is supplied, the two sides of a sheet,
/// or all patches of a node. Its balance Σ A ε (M − H) = Q gives M = Q / S + Σ w H with S = Σ A ε and w = A ε / S. B = ε M + (1 − ε) H is then linear in H with weights that are not negative and sum
/// to 1: B = E + R H, for all patches together.
#[derive(Clone, Debug)]
pub struct Network {
    /// ε, \[n\].
    pub(super) emissivity: Vec<f64>,
    /// α, \[n\].
    pub(super) absorptance: Vec<f64>,
    areas: Vec<f64>,
    /// The quantity that determines the temperature of each patch, \[n\].
    pub(super) state: Vec<State>,
    pub(super) groups: Vec<Group>,
}

/// The quantity that determines the temperature of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum State {
    /// A given temperature, K.
    Given(f64),
    /// The temperature of the group of this number.
    Member(usize),
}

/// Patches of one unknown temperature.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// The patches, each with its weight A ε / S.
    pub(super) members: Vec<(usize, f64)>,
    /// S = Σ A ε, m².
    pub(super) absorbing: f64,
    /// The heat supplied to all together, without absorbed solar heat, W.
    pub(super) supplied: f64,
}

impl Group {
    /// Returns Σ w x.
    pub(super) fn mean(&self, x: &[f64]) -> f64 {
        self.members.iter().map(|&(i, weight)| weight * x[i]).sum()
    }
}

impl Network {
    /// Assigns boundary conditions to the patches of a mesh.
    ///
    /// # Errors
    /// [`HeatError::OtherScene`], [`HeatError::OutOfRange`], and [`HeatError::Apart`] for the two sides of a sheet that do not coincide.
    pub fn new(scene: &Scene, mesh: &Mesh, boundary: &Boundary) -> Result<Self, HeatError> {
        let (expected, found) = (scene.surfaces.len(), boundary.surfaces.len());
        if expected != found {
            return Err(HeatError::OtherScene { expected, found });
        }
        for (surface, own) in scene.surfaces.iter().zip(&boundary.surfaces) {
            if let Some(Err((key, wrong))) = own.map(super::SurfaceBoundary::checked) {
                let surface = surface.name.clone();
                return Err(HeatError::OutOfRange { surface, key, wrong });
            }
        }
        let mut of_surface = vec![Vec::new(); expected];
        for (i, patch) in mesh.patches.iter().enumerate() {
            of_surface[patch.surface.0 as usize].push(i);
        }
        let n = mesh.n_patches();
        let mut network = Self {
            emissivity: vec![1.0; n],
            absorptance: vec![1.0; n],
            areas: mesh.areas(),
            state: vec![State::Given(0.0); n],
            groups: Vec::new(),
        };
        let mut of_node = vec![Vec::new(); boundary.nodes.len()];
        for (k, patches) in of_surface.iter().enumerate() {
            for (place, &i) in patches.iter().enumerate() {
                let place = PatchPlace {
                    in_surface: (place, patches.len()),
                    in_scene: (i, n),
                };
                let own = boundary.of_patch(k, place).map_err(|(key, wrong)| {
                    let surface = scene.surfaces[k].name.clone();
                    HeatError::OutOfRange { surface, key, wrong }
                })?;
                let Some(own) = own else {
                    continue;
                };
                network.emissivity[i] = own.emissivity;
                network.absorptance[i] = own.absorptance;
                match own.condition {
                    Condition::Temperature(kelvin) => network.state[i] = State::Given(kelvin),
                    Condition::Supplied(flux) => network.group(&[i], flux * network.areas[i]),
                    Condition::Node(node) => of_node[node].push(i),
                    Condition::OtherSide(_) => {}
                }
            }
        }
        // Weights need the emissivities of both sides.
        for (k, patches) in of_surface.iter().enumerate() {
            let other = match boundary.surfaces[k].map(|own| own.condition) {
                Some(Condition::OtherSide(other)) if k < other => other,
                _ => continue,
            };
            let (low, high) = scene.box_where_faces_meet();
            let tolerance = scene.slack().max(COINCIDENT * low.distance(high));
            let partners = opposites(mesh, patches, &of_surface[other], tolerance);
            let n_alone = partners.iter().filter(|partner| partner.is_none()).count();
            let n_missing = of_surface[other].len().saturating_sub(patches.len());
            if n_alone + n_missing > 0 {
                let pair = if n_alone > 0 { [k, other] } else { [other, k] };
                return Err(HeatError::Apart {
                    surfaces: pair.map(|side| scene.surfaces[side].name.clone()),
                    n_alone: n_alone.max(n_missing),
                });
            }
            for (&i, partner) in patches.iter().zip(partners) {
                network.group(&[i, partner.unwrap_or(i)], 0.0);
            }
        }
        for (patches, node) in of_node.iter().zip(&boundary.nodes) {
            network.group(patches, node.supplied_w);
        }
        Ok(network)
    }

    /// Adds a group.
    fn group(&mut self, members: &[usize], supplied: f64) {
        if members.is_empty() {
            return;
        }
        let weight = |&i: &usize| self.areas[i] * self.emissivity[i];
        let absorbing: f64 = members.iter().map(weight).sum();
        let weighted = members.iter().map(|i| (*i, weight(i) / absorbing)).collect();
        for &i in members {
            self.state[i] = State::Member(self.groups.len());
        }
        self.groups.push(Group {
            members: weighted,
            absorbing,
            supplied,
        });
    }

    /// Returns n.
    #[must_use]
    pub fn n_patches(&self) -> usize {
        self.areas.len()
    }

    /// Returns A, m², \[n\].
    pub(super) fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Returns the reflectance for [`Coupled`] F, the same in all channels, \[n, c\]: 1 − ε for given temperatures, and 1 for members of groups.
    pub(crate) fn reflectance(&self, n_channels: usize) -> Block {
        let of_patch = |(state, emissivity): (&State, &f64)| match state {
            State::Given(_) => 1.0 - emissivity,
            State::Member(_) => 1.0,
        };
        let values: Vec<f64> = self.state.iter().zip(&self.emissivity).map(of_patch).collect();
        Block::from_channels(&vec![values; n_channels])
    }

    /// Applies R: x ← R x.
    pub(crate) fn reflect(&self, x: &mut Block) {
        let n_channels = x.n_channels();
        self.share(x.values_mut(), n_channels);
        for (i, state) in self.state.iter().enumerate() {
            if let State::Given(_) = state {
                x.row_mut(i).iter_mut().for_each(|own| *own *= 1.0 - self.emissivity[i]);
            }
        }
    }

    /// Mixes the irradiances of each group: x ← (1 − ε) x + ε Σ w x, in every channel.
    fn share(&self, x: &mut [f64], n_channels: usize) {
        for group in self.groups.iter().filter(|group| group.members.len() > 1) {
            for c in 0..n_channels {
                let at = |i: usize| i * n_channels + c;
                let mean: f64 = group.members.iter().map(|&(i, weight)| weight * x[at(i)]).sum();
                for &(i, _) in &group.members {
                    let own = &mut x[at(i)];
                    *own = (1.0 - self.emissivity[i]) * *own + self.emissivity[i] * mean;
                }
            }
        }
    }

    /// Returns R F where members of groups are mixed; `None` where F itself suffices.
    pub(crate) fn coupled<'a>(&'a self, factors: &'a FormFactors) -> Option<Coupled<'a>> {
        let is_mixed = self.groups.iter().any(|group| group.members.len() > 1);
        is_mixed.then_some(Coupled { network: self, factors })
    }

    /// Refuses enclosures in which nothing determines a temperature: connected patches, all members of groups, that let nothing out.
    ///
    /// `absorbed`: solar heat, W·m⁻², \[n\]; `lets_out`: of each row, \[n\].
    ///
    /// # Errors
    /// [`HeatError::NoTemperature`], with the imbalance.
    pub(crate) fn expect_determined(
        &self,
        scene: &Scene,
        mesh: &Mesh,
        components: &Components,
        absorbed: &[f64],
        lets_out: impl Fn(usize) -> bool,
    ) -> Result<(), HeatError> {
        let mut sums = vec![(0.0, 0.0); components.n_components];
        let mut is_open = vec![false; components.n_components];
        for (i, &label) in components.labels.iter().enumerate() {
            is_open[label as usize] |= lets_out(i) || matches!(self.state[i], State::Given(_));
            let power = self.areas[i] * absorbed[i];
            sums[label as usize].0 += power;
            sums[label as usize].1 += power;
        }
        for group in &self.groups {
            let label = components.labels[group.members[0].0] as usize;
            sums[label].0 += group.supplied;
            sums[label].1 += group.supplied.abs();
        }
        let Some(closed) = is_open.iter().position(|open| !open) else {
            return Ok(());
        };
        let members = || components.labels.iter().filter(|label| **label as usize == closed);
        let first = components.labels.iter().position(|label| *label as usize == closed);
        let surface = first.map_or(0, |i| mesh.patches[i].surface.0 as usize);
        let (net, gross) = sums[closed];
        Err(HeatError::NoTemperature {
            surface: scene.surfaces[surface].name.clone(),
            n_patches: members().count(),
            imbalance_w: net,
            has_solutions: net.abs() <= BALANCED_TO * gross,
        })
    }

    /// Returns the sets of patches that exchange heat, also through the temperatures of groups.
    pub(super) fn components(&self, of_factors: &Components) -> Components {
        let n = self.n_patches();
        let mut sets = DisjointSets::new(n);
        let mut first = vec![None; of_factors.n_components];
        for (i, &label) in of_factors.labels.iter().enumerate() {
            sets.join(*first[label as usize].get_or_insert(i), i);
        }
        for group in &self.groups {
            for &(i, _) in &group.members {
                sets.join(group.members[0].0, i);
            }
        }
        let mut labels = vec![0; n];
        let mut next = 0;
        for i in 0..n {
            let least = sets.find(i);
            labels[i] = if least == i { next } else { labels[least] };
            next += u32::from(least == i);
        }
        Components {
            labels,
            n_components: next as usize,
        }
    }
}

/// The operator R F without the factor 1 − ε of patches with a given temperature.
///
/// The irradiances of a group's members are mixed as their common temperature requires.
pub(crate) struct Coupled<'a> {
    network: &'a Network,
    factors: &'a FormFactors,
}

impl LinearOperator for Coupled<'_> {
    fn n_rows(&self) -> usize {
        self.factors.n_rows()
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        self.factors.apply(x, y);
        let n_channels = y.n_channels();
        self.network.share(y.values_mut(), n_channels);
    }

    fn rows(&self) -> Option<&dyn RowAccess> {
        None
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        None
    }

    fn components(&self) -> Option<Components> {
        let of_factors = LinearOperator::components(self.factors)?;
        Some(self.network.components(&of_factors))
    }

    fn failure(&self) -> Option<&DiskError> {
        self.factors.failure()
    }
}
