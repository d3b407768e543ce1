//! The weights of a voxel's directions, cos θ A.

use std::sync::OnceLock;

use glam::DVec3;

use super::discretize::{Normal, VoxelScene};
use super::links::is_in_front;
use super::sphere::{DiscreteSphere, SphereDirection};

/// Whether the weights cos θ A of a surfel's directions are made to sum to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowWeights {
    /// Divided by their sum over the hemisphere, links that escape included: a closed scene keeps its energy.
    #[default]
    Normalised,
    /// As the paper prints them: sums are off by about 1e-3 at R = 30 (Lemma 1).
    Plain,
}

/// The memory up to which weights are stored for every normal, in bytes; beyond it they are calculated again for each row.
const KEPT_WEIGHTS: usize = 1 << 29;

/// cos θ A of the directions in front of every surfel of a scene, calculated when first needed.
pub(super) struct Weights<'a> {
    scene: &'a VoxelScene,
    sphere: &'a DiscreteSphere,
    rule: RowWeights,
    /// By normal.
    kept: Vec<OnceLock<Vec<f64>>>,
    keeps: bool,
}

impl<'a> Weights<'a> {
    pub(super) fn new(scene: &'a VoxelScene, sphere: &'a DiscreteSphere, row_weights: RowWeights) -> Self {
        let n_bytes = scene.normals.len() * sphere.directions().len() * size_of::<f64>();
        Self {
            scene,
            sphere,
            rule: row_weights,
            kept: scene.normals.iter().map(|_| OnceLock::new()).collect(),
            keeps: n_bytes <= KEPT_WEIGHTS,
        }
    }

    /// Calls `work` with cos θ A of the directions in front of a surfel, in their order.
    pub(super) fn with<T>(&self, surfel: usize, work: impl FnOnce(&[f64]) -> T) -> T {
        let normal = self.scene.surfels[surfel].normal as usize;
        let calculate = || weights_of(&self.scene.normals[normal], self.sphere, self.rule);
        if self.keeps {
            work(self.kept[normal].get_or_init(calculate))
        } else {
            work(&calculate())
        }
    }
}

/// Returns cos θ A of the directions in front of a surface, in the sphere's order.
fn weights_of(normal: &Normal, sphere: &DiscreteSphere, row_weights: RowWeights) -> Vec<f64> {
    let in_front = sphere.directions().iter().filter(|d| is_in_front(normal, d.vector));
    let weight = |d: &SphereDirection| {
        let v = DVec3::from_array(d.vector.map(f64::from));
        // A direction that is in front by rounding alone has no weight.
        d.weight * (normal.unit.dot(v) / v.length()).max(0.0)
    };
    let mut weights: Vec<f64> = in_front.map(weight).collect();
    if row_weights == RowWeights::Normalised {
        let sum: f64 = weights.iter().sum();
        for w in &mut weights {
            *w /= sum;
        }
    }
    weights
}
