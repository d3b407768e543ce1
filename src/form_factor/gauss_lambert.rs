//! `gauss-lambert`: Gauss points on one patch, the exact form factor from each of them to the other.

use std::num::NonZeroUsize;

use super::pairs::Exchange;
use super::sampled::{self, Sampled};
use super::segments::{Independence, PairSums, Segments, VisibleFraction, kernel};
use super::{Computed, FormFactorError, FormFactorMethod, Input};
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon_form_factor::{Tolerance, exchange_area};
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::matrix::StorageChoice;
use crate::progress::Progress;

/// Gauss points on the smaller patch of each pair (by the radius around its corners), exact point-to-polygon form factors to the larger one.
///
/// A_i F_ij = A_i Σ_p w_p F(x_p → j) v_p, with F by [`point_form_factor`] and v_p = Σ_s k_ps V_ps / Σ_s k_ps the visible fraction by rays from x_p to q × q
/// Gauss points of the other patch, k the integrand times the Gauss weight.
///
/// Order: 2q between patches apart from each other; where they touch still high, as the exact inner integral leaves no singularity but a weak one
/// of higher derivatives (3e-8 in a cube of 216 patches with q = 5); second where one patch crosses the other's plane. Bias: that of the rule, and about q^(−3/2) of the entry at the
/// border of a shadow. 0 ≤ A_i F_ij ≤ the smaller patch's area.
/// Error of an entry: how far the rule is from the exact exchange area without blockers, as far as the pair is visible, plus the error of the visible
/// fraction and 1e-14 of the smaller area for rounding.
///
/// Source: [`LAMBERT_1760`](crate::references::LAMBERT_1760); the combination is folklore. Departures: none.
#[derive(Clone, Copy, Debug)]
pub struct GaussLambert {
    /// q, the number of Gauss points along each side.
    pub points: NonZeroUsize,
}

impl FormFactorMethod for GaussLambert {
    fn name(&self) -> &'static str {
        "gauss-lambert"
    }

    fn compute(
        &self,
        input: Input<'_>,
        storage: StorageChoice,
        progress: &dyn Progress,
    ) -> Result<Computed, FormFactorError> {
        let patches = &input.mesh.patches;
        let polygons = sampled::prepared(input.mesh);
        let rule = GaussProduct::new(self.points);
        let points = sampled::polygons(input.mesh, |corners| rule.on_polygon(corners));
        let outer_first = |[i, j]: [usize; 2]| {
            // Between equal patches rounding must not decide: a moved scene would give another rule.
            let is_smaller = polygons[j].radius() < (1.0 - 1e-9) * polygons[i].radius();
            if is_smaller { [j, i] } else { [i, j] }
        };
        let seen_from = |outer: usize, inner: usize, x: &WeightedPoint| {
            let corners = polygons[inner].corners();
            patches[outer].area * x.weight * point_form_factor(x.position, patches[outer].normal, corners)
        };
        let method = Sampled {
            independence: Independence::SharedEnds,
            sample: |segments: &mut Segments<'_>, owner: usize, pair: [usize; 2]| {
                let [outer, inner] = outer_first(pair);
                let mut densities = Vec::with_capacity(points[inner].len());
                for x in &points[outer] {
                    let share = seen_from(outer, inner, x);
                    densities.clear();
                    densities.extend(points[inner].iter().map(|y| {
                        y.weight * kernel((x.position, patches[outer].normal), (y.position, patches[inner].normal))
                    }));
                    let total: f64 = densities.iter().sum();
                    if segments.is_known(owner) || total <= 0.0 {
                        // No ray is needed, or no point of the other patch is above the horizon although a sliver of it is.
                        segments.add_untraced(owner, share);
                        continue;
                    }
                    for (y, density) in points[inner].iter().zip(&densities) {
                        if *density > 0.0 {
                            let weight = share * density / total;
                            segments.add(owner, (outer, x.position), (inner, y.position), weight);
                        }
                    }
                }
            },
            exchange: |pair: [usize; 2], sums: PairSums, visible: VisibleFraction| {
                let [outer, inner] = outer_first(pair);
                let exact = exchange_area(&polygons[outer], &polygons[inner], Tolerance::default());
                let bias = (sums.all + sums.untraced - exact.value).abs() + exact.error;
                let rounding = 1e-14 * patches[outer].area;
                Ok(Exchange {
                    area: sums.open + sums.untraced * visible.fraction,
                    error: bias * visible.fraction + exact.value * visible.error + rounding,
                })
            },
        };
        method.compute(input, storage, progress)
    }
}
