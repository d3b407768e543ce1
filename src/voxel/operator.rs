//! The form factors of the links, as an operator for all solvers.

use super::discretize::VoxelScene;
use super::links::{Links, ROWS_PER_CHUNK, for_each_end, for_each_seen};
use super::sphere::DiscreteSphere;
use super::weights::{RowWeights, Weights};
use crate::matrix::operator::{Block, LinearOperator, RowAccess};
use crate::threads;

/// The number of rows of a chunk that a thread takes at a time.
const ROWS_AT_ONCE: usize = 8;

/// An operator whose rows can be computed range by range, for propagation in place.
pub trait Gather: LinearOperator {
    /// Computes Σ_v B(I(x, v)) cos θ A for the unknowns from `first` on, one row of `sums` each, on all threads.
    ///
    /// Where links cannot be read the sums are NaN, so that no solver uses them as light; see [`Links::failure`].
    fn gather(&self, first: usize, x: &Block, sums: &mut [f64]);

    /// Returns the areas of the unknowns, m².
    fn areas(&self) -> Vec<f64>;

    /// Returns the number of rows that are best computed together; ranges should begin at its multiples.
    fn rows_at_once(&self) -> usize;
}

/// F of the discrete equation: (F B)(x) = Σ_v B(I(x, v)) cos θ(x, v) A(v) over the directions in front of x.
///
/// Rows are gathered, not reciprocal: A_i F_ij differs from A_j F_ji by the sampling of directions.
///
/// Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), equation (2). Departures: rows divided by their own sum, unless told otherwise.
pub struct LinkOperator<'a> {
    scene: &'a VoxelScene,
    links: &'a Links,
    weights: Weights<'a>,
}

impl<'a> LinkOperator<'a> {
    /// Makes the operator of links and weights, which must come from the same scene and sphere.
    #[must_use]
    pub fn new(scene: &'a VoxelScene, sphere: &'a DiscreteSphere, links: &'a Links, row_weights: RowWeights) -> Self {
        Self {
            scene,
            links,
            weights: Weights::new(scene, sphere, row_weights),
        }
    }

    /// Returns the power that links carry between regions of air that surfaces close off from each other, and out of a closed scene, W.
    ///
    /// Σ_x A_x Σ_v B(I(x, v)) cos θ(x, v) A(v) over the links whose ends look into different regions, exactly: 0 unless lines leak. The regions are found without lines.
    /// Where the scene is [known to be closed](VoxelScene::expect_closed), with B(x) over the links that leave it or end at backs: what x sends there is lost.
    /// Links that end in a sub-voxel gap, which has no region, are not counted. NaN where links cannot be read; see [`Links::failure`].
    ///
    /// `radiosity`: B, W·m⁻², \[n, c\].
    #[must_use]
    pub fn leak_power(&self, radiosity: &Block) -> LeakPower {
        let n_channels = radiosity.n_channels();
        let n = self.scene.n_surfels();
        let n_chunks = if self.scene.may_leak() {
            n.div_ceil(ROWS_PER_CHUNK)
        } else {
            0
        };
        let of_chunk = |k: usize| {
            let mut power = LeakPower::new(n_channels, 0.0);
            let rows = k * ROWS_PER_CHUNK..((k + 1) * ROWS_PER_CHUNK).min(n);
            let done = self.links.with_chunk(self.scene, k, |chunk| {
                for surfel in rows {
                    let (area, row) = (self.scene.surfels[surfel].area, chunk.row(surfel % ROWS_PER_CHUNK));
                    add_leak(
                        self.scene,
                        &self.weights,
                        surfel,
                        row,
                        area,
                        |seen| radiosity.row(seen),
                        &mut power,
                    );
                }
            });
            if done.is_none() {
                power = LeakPower::new(n_channels, f64::NAN);
            }
            power
        };
        LeakPower::sum(&threads::collect(n_chunks, of_chunk), n_channels)
    }

    /// Returns the scene.
    #[must_use]
    pub fn scene(&self) -> &'a VoxelScene {
        self.scene
    }
}

/// The power of light that goes where none does, W, \[c\].
#[derive(Clone, Debug, PartialEq)]
pub struct LeakPower {
    /// Between regions of air that surfaces close off from each other.
    pub passed: Vec<f64>,
    /// Out of, or to backs in, a scene that is [known to be closed](VoxelScene::expect_closed).
    pub lost: Vec<f64>,
}

impl LeakPower {
    pub(super) fn new(n_channels: usize, power: f64) -> Self {
        Self {
            passed: vec![power; n_channels],
            lost: vec![power; n_channels],
        }
    }

    /// Adds up powers in their order, so that the sum does not depend on the threads.
    pub(super) fn sum(parts: &[Self], n_channels: usize) -> Self {
        let mut all = Self::new(n_channels, 0.0);
        for part in parts {
            add(&mut all.passed, &part.passed, 1.0);
            add(&mut all.lost, &part.lost, 1.0);
        }
        all
    }
}

fn add(sums: &mut [f64], terms: &[f64], factor: f64) {
    for (sum, term) in sums.iter_mut().zip(terms) {
        *sum += factor * term;
    }
}

impl VoxelScene {
    /// Returns whether links may carry light where none goes.
    pub(super) fn may_leak(&self) -> bool {
        self.regions.is_some() || self.is_closed
    }
}

/// Adds the power that the links of a surfel of an area bring from other regions of air, and lose in a closed scene.
pub(super) fn add_leak<'b>(
    scene: &VoxelScene,
    weights: &Weights<'_>,
    surfel: usize,
    row: &[u8],
    area: f64,
    radiosity: impl Fn(usize) -> &'b [f64],
    power: &mut LeakPower,
) {
    weights.with(surfel, |of_link| {
        let mut lost = 0.0;
        let parted = |k: usize, seen: usize| {
            if scene.are_parted(surfel, seen) {
                add(&mut power.passed, radiosity(seen), area * of_link[k]);
            }
        };
        for_each_end(row, surfel, parted, |k| lost += area * of_link[k]);
        if scene.is_closed {
            add(&mut power.lost, radiosity(surfel), lost);
        }
    });
}

/// Adds Σ_v B(I(x, v)) cos θ A of a surfel's links to `sums`, one per channel; `unknown` returns the row of `x` that is a surfel's radiosity.
pub(super) fn gather_row(
    weights: &Weights<'_>,
    surfel: usize,
    row: &[u8],
    unknown: impl Fn(usize) -> usize,
    x: &Block,
    sums: &mut [f64],
) {
    weights.with(surfel, |of_link| match x.n_channels() {
        1 => gather_channels::<1>(row, surfel, of_link, unknown, x, sums),
        3 => gather_channels::<3>(row, surfel, of_link, unknown, x, sums),
        _ => for_each_seen(row, surfel, |k, seen| {
            for (sum, value) in sums.iter_mut().zip(x.row(unknown(seen))) {
                *sum += of_link[k] * value;
            }
        }),
    });
}

fn gather_channels<const C: usize>(
    row: &[u8],
    surfel: usize,
    weights: &[f64],
    unknown: impl Fn(usize) -> usize,
    x: &Block,
    sums: &mut [f64],
) {
    let values = x.values().as_chunks::<C>().0;
    let mut totals = [0.0; C];
    for_each_seen(row, surfel, |k, seen| {
        let weight = weights[k];
        for (total, value) in totals.iter_mut().zip(&values[unknown(seen)]) {
            *total += weight * value;
        }
    });
    for (sum, total) in sums.iter_mut().zip(totals) {
        *sum += total;
    }
}

impl LinearOperator for LinkOperator<'_> {
    fn n_rows(&self) -> usize {
        self.scene.n_surfels()
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        self.gather(0, x, y.values_mut());
    }

    fn rows(&self) -> Option<&dyn RowAccess> {
        self.links.has_cheap_rows().then_some(self as &dyn RowAccess)
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        None
    }
}

impl Gather for LinkOperator<'_> {
    fn gather(&self, first: usize, x: &Block, sums: &mut [f64]) {
        let n_channels = x.n_channels();
        let end = first + sums.len() / n_channels;
        let mut rest = sums;
        let mut start = first;
        let mut pieces = Vec::new();
        while start < end {
            let stop = ((start / ROWS_PER_CHUNK + 1) * ROWS_PER_CHUNK).min(end);
            let (piece, more) = rest.split_at_mut((stop - start) * n_channels);
            pieces.push((start, piece));
            rest = more;
            start = stop;
        }
        threads::for_each(true, pieces, |(row_0, rows): (usize, &mut [f64])| {
            let chunk = row_0 / ROWS_PER_CHUNK;
            let done = self.links.with_chunk(self.scene, chunk, |chunk| {
                // A part of a chunk is still work for several threads.
                threads::for_each_chunk(true, rows, ROWS_AT_ONCE * n_channels, |k, some| {
                    for (surfel, row) in (row_0 + k * ROWS_AT_ONCE..).zip(some.chunks_mut(n_channels)) {
                        row.fill(0.0);
                        let links = chunk.row(surfel % ROWS_PER_CHUNK);
                        gather_row(&self.weights, surfel, links, |seen| seen, x, row);
                    }
                });
            });
            if done.is_none() {
                rows.fill(f64::NAN);
            }
        });
    }

    fn areas(&self) -> Vec<f64> {
        self.scene.areas()
    }

    fn rows_at_once(&self) -> usize {
        // Whole chunks: each is read, or found again, once a pass.
        ROWS_PER_CHUNK
    }
}

impl RowAccess for LinkOperator<'_> {
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let mut own = 0.0;
        self.links.with_chunk(self.scene, i / ROWS_PER_CHUNK, |chunk| {
            let row = chunk.row(i % ROWS_PER_CHUNK);
            gather_row(&self.weights, i, row, |seen| seen, x, sum);
            // Lines begin in front of a surfel, but a curved surface may still see itself.
            self.weights.with(i, |weights| {
                for_each_seen(row, i, |k, seen| {
                    if seen == i {
                        own += weights[k];
                    }
                });
            });
        });
        for (s, value) in sum.iter_mut().zip(x.row(i)) {
            *s -= own * value;
        }
        own
    }

    fn visit_row(&self, i: usize, visit: &mut dyn FnMut(usize, f64)) {
        let mut entries: Vec<(usize, f64)> = Vec::new();
        self.links.with_chunk(self.scene, i / ROWS_PER_CHUNK, |chunk| {
            let row = chunk.row(i % ROWS_PER_CHUNK);
            self.weights.with(i, |weights| {
                for_each_seen(row, i, |k, seen| entries.push((seen, weights[k])));
            });
        });
        // Several directions may see one surfel.
        entries.sort_by_key(|entry| entry.0);
        for same in entries.chunk_by(|a, b| a.0 == b.0) {
            visit(same[0].0, same.iter().map(|entry| entry.1).sum());
        }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::sphere::SolidAngle;
    use super::super::thin::{Leak, THIN};
    use super::super::{Form, propagate};
    use super::*;
    use crate::progress::Silent;
    use crate::scene::{Corners, Face, Scene, builtin};

    /// A lit cube around a dark one, both sides of whose walls are drawn.
    fn cube_in_cube() -> Scene {
        let mut scene = builtin::build("cube", None).unwrap().scene;
        let n = u32::try_from(scene.vertices.len()).unwrap();
        let (low, high) = scene.bounding_box();
        let smaller: Vec<_> = scene
            .vertices
            .iter()
            .map(|&v| low + (high - low) * 0.37 + (v - low) * 0.31)
            .collect();
        scene.vertices.extend(smaller);
        let inner: Vec<_> = scene.faces.clone();
        for face in inner {
            for is_outside in [true, false] {
                let Corners::Quad(mut corners) = face.corners else {
                    continue;
                };
                if is_outside {
                    corners.reverse();
                }
                let corners = Corners::Quad(corners.map(|v| v + n));
                scene.faces.push(Face { corners, ..face });
            }
        }
        scene
    }

    /// The same light, once with the sides of walls apart and once by normals alone: the leak is counted.
    #[test]
    fn a_leak_is_seen() {
        let scene = cube_in_cube();
        let mut voxels = VoxelScene::new(&scene, 24).unwrap();
        assert!(!voxels.thin_walls.is_empty() && voxels.regions.is_some());
        let sphere = DiscreteSphere::new(6, SolidAngle::Centre).unwrap();
        let leak_of = |kept: &VoxelScene| {
            let links = Links::in_memory(kept, &sphere, &Silent);
            let operator = LinkOperator::new(kept, &sphere, &links, RowWeights::Normalised);
            let n = kept.n_surfels();
            // Only surfaces outside the inner cube emit, 1 W/m².
            let emits = |s: usize| kept.surfels[s].face.0 < 6;
            let e = Block::from_values((0..n).map(|s| f64::from(u8::from(emits(s)))).collect(), 1);
            let rho = Block::from_values(vec![0.5; n], 1);
            let radiosity = propagate(&operator, &rho, &e, Form::InPlace, 12, &Silent).radiosity;
            let power = operator.leak_power(&radiosity);
            // By hand: row by row, with the operator's own weights.
            let mut by_hand = 0.0;
            for s in 0..n {
                let mut sum = 0.0;
                operator.visit_row(s, &mut |t, f| {
                    sum += if kept.are_parted(s, t) {
                        f * radiosity.row(t)[0]
                    } else {
                        0.0
                    };
                });
                by_hand += kept.surfels[s].area * sum;
            }
            assert!((power.passed[0] - by_hand).abs() <= 1e-12 * by_hand);
            Leak::new(&power, kept, &e)
        };
        let tight = leak_of(&voxels);
        assert!(tight.power.to_bits() == 0 && !tight.is_too_much(), "{tight:?}");
        voxels.normal_of.iter_mut().for_each(|normal| *normal &= !THIN);
        let leaky = leak_of(&voxels);
        assert!(leaky.share > 0.01 && leaky.is_too_much(), "{leaky:?}");
    }

    /// A turned cube of few voxels, at whose edges lines escape or meet backs: what is lost explains what a furnace lacks.
    #[test]
    fn light_that_is_lost_in_a_closed_scene_is_counted() {
        let turn = glam::DQuat::from_axis_angle(glam::DVec3::new(2.0, 1.0, 2.0) / 3.0, 0.9);
        let mut scene = crate::scene::builtin::build("cube", None).unwrap().scene;
        scene.vertices.iter_mut().for_each(|v| *v = turn * *v);
        let mut voxels = VoxelScene::new(&scene, 20).unwrap();
        let sphere = DiscreteSphere::new(8, SolidAngle::Exact).unwrap();
        let links = Links::in_memory(&voxels, &sphere, &Silent);
        assert!(links.n_escaped().unwrap() > 0);
        let n = voxels.n_surfels();
        let (rho, e) = (Block::from_values(vec![0.9; n], 1), Block::from_values(vec![0.1; n], 1));
        let leak = |kept: &VoxelScene| {
            let operator = LinkOperator::new(kept, &sphere, &links, RowWeights::Normalised);
            let solved = propagate(&operator, &rho, &e, Form::InPlace, 200, &Silent);
            let absorbed = |s: usize| kept.surfels[s].area * 0.1 * (1.0 - solved.irradiance.row(s)[0]);
            let missing: f64 = (0..n).map(absorbed).sum();
            (Leak::new(&operator.leak_power(&solved.radiosity), kept, &e), missing)
        };
        assert_eq!(leak(&voxels).0, Leak::default());
        voxels.expect_closed();
        let (lost, missing) = leak(&voxels);
        assert!(lost.is_too_much() && lost.power.to_bits() == 0, "{lost:?}");
        // Surfels that lose light are seen less, too, so that others lack less than they lose.
        assert!(
            lost.lost_power > missing && lost.lost_power < 3.0 * missing,
            "{lost:?} {missing}"
        );
    }
}
