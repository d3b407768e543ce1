//! The common part of methods between pairs: points on both patches, rays between them, and an exchange area from their sums.

use super::facing;
use super::pairs::{self, Exchange, PairWorker};
use super::segments::{Independence, PairSums, Segments, VisibleFraction, kernel};
use super::sight::Sights;
use super::{ComputeResult, Computed, FormFactorError, Input, PairCounts};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{self, PreparedPolygon, Tolerance, exchange_area};
use crate::geometry::quadrature::WeightedPoint;
use crate::geometry::sampling::{PointStream, Sequence, UniformOnPolygon};
use crate::matrix::StorageChoice;
use crate::mesh::{Mesh, Patch, PatchId};
use crate::progress::Progress;

/// A method between pairs: `sample` adds the segments of a pair (its number in the row, i, j), and `exchange` makes an exchange area
/// of their results.
pub(super) struct Sampled<S, X> {
    pub(super) independence: Independence,
    pub(super) sample: S,
    pub(super) exchange: X,
}

impl<S, X> Sampled<S, X>
where
    S: Fn(&mut Segments<'_>, usize, [usize; 2]) + Sync,
    X: Fn([usize; 2], PairSums, VisibleFraction) -> Result<Exchange, FormFactorError> + Sync,
{
    pub(super) fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let sights = Sights::new(input);
        pairs::by_pairs(input, storage, progress, || Worker {
            method: self,
            segments: Segments::new(input, &sights, self.independence),
        })
    }
}

struct Worker<'a, S, X> {
    method: &'a Sampled<S, X>,
    segments: Segments<'a>,
}

impl<S, X> PairWorker for Worker<'_, S, X>
where
    S: Fn(&mut Segments<'_>, usize, [usize; 2]),
    X: Fn([usize; 2], PairSums, VisibleFraction) -> Result<Exchange, FormFactorError>,
{
    fn row(&mut self, i: usize, others: &[usize], emit: &mut dyn FnMut(Exchange)) -> Result<(), FormFactorError> {
        self.segments.begin(i, others);
        for (k, &j) in others.iter().enumerate() {
            (self.method.sample)(&mut self.segments, k, [i, j]);
        }
        self.segments.finish();
        for (k, &j) in others.iter().enumerate() {
            let (sums, visible) = self.segments.result(k);
            emit((self.method.exchange)([i, j], sums, visible)?);
        }
        Ok(())
    }

    fn counts(&self) -> PairCounts {
        self.segments.counts()
    }
}

/// Returns q × q stratified points on every patch: one at random in each cell of equal area.
pub(super) fn stratified(mesh: &Mesh, q: usize, seed: u64) -> Vec<Vec<WeightedPoint>> {
    let cell = 1.0 / q as f64;
    (0..mesh.n_patches())
        .map(|i| {
            let map = UniformOnPolygon::new(&mesh.polygon(PatchId::from_index(i)));
            let mut stream = PointStream::new(Sequence::Random, seed, i as u64);
            (0..q * q)
                .map(|k| {
                    let [u, v, ..] = stream.next_point();
                    WeightedPoint {
                        position: map.point(((k % q) as f64 + u) * cell, ((k / q) as f64 + v) * cell),
                        weight: cell * cell,
                    }
                })
                .collect()
        })
        .collect()
}

/// Returns A_i A_j w_p w_s k_ps in m² for a point of patch i and all those of patch j, with k the [`kernel`].
pub(super) fn by_kernel<'a>(
    (from, x): (&'a Patch, &'a WeightedPoint),
    (to, points): (&'a Patch, &'a [WeightedPoint]),
) -> impl Iterator<Item = f64> {
    let area = from.area * to.area * x.weight;
    points
        .iter()
        .map(move |y| area * y.weight * kernel((x.position, from.normal), (y.position, to.normal)))
}

/// Adds the segments between all points of i and all points of j, weighted by the exchange area that each stands for.
pub(super) fn join_all(
    segments: &mut Segments<'_>,
    mesh: &Mesh,
    points: &[Vec<WeightedPoint>],
    owner: usize,
    [i, j]: [usize; 2],
) {
    let (from, to) = (&mesh.patches[i], &mesh.patches[j]);
    segments.join(owner, (i, &points[i]), (j, &points[j]), |x, weights| {
        weights.extend(by_kernel((from, x), (to, &points[j])));
        1.0
    });
}

/// Points along each side of a triangle of the part of a patch in front of another one's plane.
const POINTS_OF_PART: usize = 2;

/// Adds segments between the parts of two patches in front of each other's planes, to a pair without a segment.
///
/// The patches' own points may all miss a sliver above the horizon, and without a ray it would count as half visible.
pub(super) fn join_parts_in_front(segments: &mut Segments<'_>, mesh: &Mesh, owner: usize, [i, j]: [usize; 2]) {
    if segments.has_segment(owner) {
        return;
    }
    let (from, to) = (&mesh.patches[i], &mesh.patches[j]);
    let points = [(i, to), (j, from)].map(|(own, other)| {
        let corners = mesh.polygon(PatchId::from_index(own));
        let part = clip_to_half_space(&corners, other.centroid, other.normal);
        points_of_part(&part, mesh.patches[own].area)
    });
    segments.join(owner, (i, &points[0]), (j, &points[1]), |x, weights| {
        weights.extend(by_kernel((from, x), (to, &points[1])));
        1.0
    });
}

/// Returns points on a convex part of a patch, each with its part of the patch's area.
fn points_of_part(part: &[glam::DVec3], area: f64) -> Vec<WeightedPoint> {
    let cell = 1.0 / POINTS_OF_PART as f64;
    let triangles = (2..part.len()).map(|k| [part[0], part[k - 1], part[k]]);
    let on_triangle = |corners: [glam::DVec3; 3]| {
        let map = UniformOnPolygon::new(&corners);
        let weight = polygon::area_vector(&corners).length() / area * cell * cell;
        (0..POINTS_OF_PART * POINTS_OF_PART).map(move |k| WeightedPoint {
            position: map.point(
                ((k % POINTS_OF_PART) as f64 + 0.5) * cell,
                ((k / POINTS_OF_PART) as f64 + 0.5) * cell,
            ),
            weight,
        })
    };
    triangles.flat_map(on_triangle).collect()
}

/// Computes Σ w V over all segments between given points: a quadrature rule for the whole integral.
///
/// Error: the distance of the rule from the exact exchange area without occluders, as far as it is visible, plus the error of the visible fraction.
pub(super) fn quadrature(
    points: &[Vec<WeightedPoint>],
    input: Input<'_>,
    storage: StorageChoice,
    progress: &dyn Progress,
) -> Result<Computed, FormFactorError> {
    let polygons = facing::prepared(input.mesh);
    let method = Sampled {
        independence: Independence::SharedEnds,
        sample: |segments: &mut Segments<'_>, owner: usize, pair: [usize; 2]| {
            join_all(segments, input.mesh, points, owner, pair);
        },
        exchange: |[i, j]: [usize; 2], sums: PairSums, visible: VisibleFraction| {
            let exact = to_two_digits_of(sums.all, [&polygons[i], &polygons[j]]);
            // With a margin for the two digits, and for errors that are stored in f32.
            let bias = 1.01 * (sums.all - exact.value).abs() + exact.error;
            Ok(Exchange {
                area: sums.open,
                error: bias * visible.fraction + exact.value * visible.error,
            })
        },
    };
    method.compute(input, storage, progress)
}

/// Returns the exchange area of two patches without occluders, so exact that its distance from `rule` has two right digits, as far as f64 allows.
fn to_two_digits_of(rule: f64, [from, to]: [&PreparedPolygon; 2]) -> polygon_form_factor::Exchange {
    // That is cheap where the rule's own error is larger.
    let coarse = exchange_area(from, to, Tolerance { rel: 1e-2, abs: 0.0 });
    let off = (rule - coarse.value).abs();
    if coarse.error <= 0.1 * off {
        return coarse;
    }
    let rel = (0.01 * off / coarse.value.max(f64::MIN_POSITIVE)).clamp(1e-10, 1e-4);
    exchange_area(from, to, Tolerance { rel, abs: 0.0 })
}

impl Exchange {
    /// Returns an exchange area without occluders times the visible fraction, with both errors.
    pub(super) fn times(self, visible: VisibleFraction) -> Self {
        Self {
            area: self.area * visible.fraction,
            error: self.error * visible.fraction + self.area * visible.error,
        }
    }
}
