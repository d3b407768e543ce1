//! `hemicube`: rays through the cells of a half cube over points of each patch.

use std::num::NonZeroUsize;
use std::ops::Range;

use glam::DVec3;

use super::entry::{MethodEntry, Work};
use super::on_the_fly::Rows;
use super::point_errors::{Found, PointErrors};
use super::settings::POINTS;
use super::{ComputeResult, FormFactorMethod, Input, Reciprocity, rows};
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::geometry::sampling::Frame;
use crate::matrix::{Entry, RayWeights, RowTally, RowTile, StorageChoice};
use crate::mesh::PatchId;
use crate::progress::Progress;
use crate::scene::FaceId;
use crate::setting::{Kind, Setting, Value};
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// A hemicube over the centre of each patch, or over its Gauss points.
///
/// F_ij ≈ Σ_p w_p Σ ΔF_c over the cells c of the hemicube at point p whose ray, through the cell's middle, first hits the front of j. The top has R × R
/// cells and each side R × R/2. ΔF_c is the exact form factor of the cell as a polygon ([`point_form_factor`]). The ΔF of all cells sum to 1, and rows to 1
/// less the fraction that escaped or met a back face.
///
/// Rays are traced in every scene, as they find the patches. Bias: patch i sees what its points see, wrong by some
/// per cent to tens of per cent where patches touch and q = 1; aliasing at the cells, of the order 1/√m of an entry made of m cells.
/// Not symmetric; A_i F_ij may exceed the smaller area.
/// Error of an entry: its distance from the exact form factor without occluders (two digits of it) where nothing occludes. Where something may, plus
/// sqrt(2/((q² + 2)(q² + 3))) of that, for parts of i between the points whose view is hidden, which more cells do not show. Where a fraction v < 1 − 1/√m is visible from the
/// points, by m rays: the points' distance from the exact form factor, plus sqrt(v(1 − v)/q² + 2/((q² + 2)(q² + 3))) of it, plus 1/√m of the entry. Patches that are certain
/// not to see each other have their value as error, mostly 0. It covers the rule on i, the cells and the shadows; summed over patches that err to both sides it is much more than their error.
///
/// Source: [`COHEN_GREENBERG_1985`](crate::references::COHEN_GREENBERG_1985). Departures: rays through the cells' middles instead of scan conversion, which finds
/// the same patch in each cell; exact ΔF instead of the integrand at the middle times the cell's area; more than one point by choice.
#[derive(Clone, Copy, Debug)]
pub struct Hemicube {
    /// R, the number of cells along each edge of the top; an odd number counts as the next even one.
    pub resolution: NonZeroUsize,
    /// q, the number of Gauss points along each side of a patch; the centroid where it is 1.
    pub points: NonZeroUsize,
}

/// Cells along each edge of the hemicube's top.
pub static RESOLUTION: Setting = Setting {
    name: "resolution",
    help: "Cells along each edge of the top",
    letter: "N",
    kind: Kind::Count(4096),
};

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "hemicube",
    summary: "Rays through the cells of a half cube (Cohen and Greenberg)",
    settings: &[RESOLUTION.or(Value::Count(256)), POINTS.or(Value::Count(1))],
    work: Work::Rows,
    make: |s| {
        Some(Box::new(Hemicube {
            resolution: s.values.get(&RESOLUTION)?.size()?,
            points: s.points()?,
        }))
    },
};

/// A ray of the hemicube: its direction in the patch's frame, and the form factor of its cell.
struct Cell {
    direction: DVec3,
    factor: f64,
}

/// Returns the cells of the top, then of the four sides, row by row.
fn cells(resolution: usize) -> Vec<Cell> {
    let half = resolution.div_ceil(2);
    let step = 1.0 / half as f64;
    let mut cells = Vec::with_capacity(12 * half * half);
    let mut add = |corner: DVec3, u: DVec3, v: DVec3| {
        // Counter-clockwise seen from the point in the middle.
        let quad = [corner, corner + v, corner + u + v, corner + u];
        cells.push(Cell {
            direction: corner + 0.5 * (u + v),
            factor: point_form_factor(DVec3::ZERO, DVec3::Z, &quad),
        });
    };
    let (x, y, z) = (step * DVec3::X, step * DVec3::Y, step * DVec3::Z);
    let place = |k: usize| (k as f64 - half as f64) * step;
    for b in 0..2 * half {
        for a in 0..2 * half {
            add(DVec3::new(place(a), place(b), 1.0), x, y);
        }
    }
    for (out, along) in [(DVec3::X, y), (DVec3::Y, -x), (-DVec3::X, -y), (-DVec3::Y, x)] {
        for c in 0..half {
            for a in 0..2 * half {
                let corner = out + along * (a as f64 - half as f64) + z * c as f64;
                add(corner, along, z);
            }
        }
    }
    cells
}

/// Rays that are traced at once.
const BATCH: usize = 512;

impl FormFactorMethod for Hemicube {
    fn name(&self) -> &'static str {
        "hemicube"
    }

    fn reciprocity(&self) -> Reciprocity {
        Reciprocity::NotPromised
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let cells = cells(self.resolution.get());
        let errors = PointErrors::new(input);
        rows::by_rows(input, storage, progress, None, |rows| {
            self.tile(input, rows, &cells, &errors)
        })
    }

    fn rows<'a>(&'a self, input: Input<'a>) -> Option<Rows<'a>> {
        let cells = cells(self.resolution.get());
        let errors = PointErrors::new(input);
        Some(Box::new(move |rows| self.tile(input, rows, &cells, &errors)))
    }
}

impl Hemicube {
    fn tile(&self, input: Input<'_>, rows: Range<usize>, cells: &[Cell], errors: &PointErrors<'_>) -> RowTile {
        let mut tile = RowTile::new(rows.start);
        let mut row = Row::new(input);
        for i in rows {
            let patch = &input.mesh.patches[i];
            let points = if self.points.get() == 1 {
                vec![WeightedPoint {
                    position: patch.centroid,
                    weight: 1.0,
                }]
            } else {
                GaussProduct::new(self.points).on_polygon(&input.mesh.polygon(PatchId::from_index(i)))
            };
            for point in &points {
                row.shoot(i, point, cells);
            }
            let (entries, tally) = row.take(i, &points, errors);
            tile.push_row(&entries, tally);
        }
        tile
    }
}

/// The buffers of one thread, and the sums of one row at a time.
struct Row<'a> {
    input: Input<'a>,
    rays: RayBatch,
    factors: Vec<f64>,
    hits: HitBatch,
    /// Σ w ΔF and the number of cells that see each patch.
    sums: Vec<Found>,
    tally: RowTally,
    weights: RayWeights,
}

impl<'a> Row<'a> {
    fn new(input: Input<'a>) -> Self {
        Self {
            input,
            rays: RayBatch::default(),
            factors: Vec::new(),
            hits: HitBatch::default(),
            sums: vec![Found::default(); input.mesh.n_patches()],
            tally: RowTally::default(),
            weights: NO_RAYS,
        }
    }

    fn shoot(&mut self, i: usize, point: &WeightedPoint, cells: &[Cell]) {
        let visibility = self.input.visibility;
        let normal = self.input.mesh.patches[i].normal;
        let frame = Frame::from_normal(normal);
        let origin = point.position + normal * visibility.offset() - visibility.frame_origin();
        for batch in cells.chunks(BATCH) {
            for cell in batch {
                self.rays.push_ray(origin, frame.to_world(cell.direction));
                self.factors.push(point.weight * cell.factor);
            }
            self.trace(self.input.mesh.patches[i].face);
        }
    }

    fn trace(&mut self, own: FaceId) {
        let visibility = self.input.visibility;
        visibility.closest_hits_from(own, &self.rays, Coherence::Coherent, &mut self.hits);
        for (k, &factor) in self.factors.iter().enumerate() {
            self.tally.n_rays += 1;
            match self.hits.face(k) {
                None => {
                    self.tally.n_escaped += 1;
                    self.weights.escaped += factor;
                }
                Some(hit) if hit.back => {
                    self.tally.n_absorbed += 1;
                    self.weights.absorbed += factor;
                }
                Some(hit) => {
                    let (u, v) = (f64::from(self.hits.u[k]), f64::from(self.hits.v[k]));
                    let PatchId(j) = self.input.mesh.patch_at(hit.face, u, v);
                    let found = &mut self.sums[j as usize];
                    found.factor += factor;
                    found.n_rays += 1;
                }
            }
        }
        self.rays.clear();
        self.factors.clear();
    }

    /// Returns the finished row and makes room for the next.
    fn take(&mut self, i: usize, points: &[WeightedPoint], errors: &PointErrors<'_>) -> (Vec<Entry>, RowTally) {
        let errors = errors.of_row(i, points, &self.sums);
        let found = self.sums.iter_mut().zip(errors).enumerate();
        let entries = found.map(|(j, (sum, error))| (PatchId::from_index(j).0, std::mem::take(sum).factor, error));
        let entries = entries.collect();
        let tally = RowTally {
            weights: Some(std::mem::replace(&mut self.weights, NO_RAYS)),
            ..std::mem::take(&mut self.tally)
        };
        (entries, tally)
    }
}

/// The cells are not independent samples, so Σ w² is 0: see [`RayWeights::squared`].
const NO_RAYS: RayWeights = RayWeights {
    escaped: 0.0,
    absorbed: 0.0,
    squared: 0.0,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cells_cover_the_hemisphere_once() {
        for resolution in [1, 2, 7, 16, 64] {
            let cells = cells(resolution);
            let even = resolution + resolution % 2;
            assert_eq!(cells.len(), 3 * even * even);
            let sum: f64 = cells.iter().map(|c| c.factor).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{resolution}: {sum}");
            assert!(cells.iter().all(|c| c.factor > 0.0 && c.direction.z > 0.0));
            // By symmetry, and because a form factor is a mean of directions: Σ ΔF ω = (0, 0, 2/3).
            let mean: DVec3 = cells.iter().map(|c| c.factor * c.direction.normalize()).sum();
            assert!(mean.x.abs() < 1e-12 && mean.y.abs() < 1e-12);
            let tolerance = 0.5 / (even * even) as f64;
            assert!((mean.z - 2.0 / 3.0).abs() < tolerance, "{resolution}: {mean}");
        }
    }

    #[test]
    fn the_top_has_its_closed_form() {
        // From the point below the middle of a square of side 2 at height 1: 4 (2/(2π)) (1/√2) atan(1/√2).
        let exact = 4.0 / std::f64::consts::PI * 0.5_f64.sqrt() * 0.5_f64.sqrt().atan();
        let cells = cells(64);
        let top: f64 = cells[..64 * 64].iter().map(|c| c.factor).sum();
        assert!((top - exact).abs() < 1e-13, "{top} {exact}");
    }
}
