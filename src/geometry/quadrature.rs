//! Gauss points and weights on triangles and planar quads.

use std::num::NonZeroUsize;

use glam::DVec3;

use super::gauss_legendre;

/// A point of a quadrature rule with its weight as a share of the patch: the weights sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedPoint {
    /// The point, in m.
    pub position: DVec3,
    /// The weight; 1 in sum over a patch.
    pub weight: f64,
}

/// A q × q Gauss-Legendre product rule.
///
/// On a quad the rule acts on the bilinear map of the unit square, on a triangle on the collapsed square; the weights carry
/// the map's area element. Polynomials up to degree 2q − 1 in the square (2q − 2 on a triangle) times that element are integrated exactly.
/// Nodes and weights are those of 31 digits, rounded.
#[derive(Clone, Debug)]
pub struct GaussProduct {
    /// Nodes and weights on [0, 1].
    line: Vec<(f64, f64)>,
}

impl GaussProduct {
    /// Returns the rule with q × q points.
    #[must_use]
    pub fn new(q: NonZeroUsize) -> Self {
        Self {
            line: gauss_legendre::rounded_rule(q),
        }
    }

    /// Returns the number of points of the rule, q².
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.line.len() * self.line.len()
    }

    /// Returns the relative change of each node's weight along a side in the rule through every other node from both ends.
    ///
    /// That rule is exact for as many degrees as it has nodes; `None` with fewer than three nodes, where nothing remains to compare.
    /// w'_k = ∫ ℓ_k over the nodes that stay, by the rule itself, which is exact for it; −1 for the others.
    #[must_use]
    pub(crate) fn coarser(&self) -> Option<Vec<f64>> {
        let q = self.line.len();
        if q < 3 {
            return None;
        }
        let stays = |k: usize| k.min(q - 1 - k).is_multiple_of(2);
        let integral = |k: usize| -> f64 {
            let others = || (0..q).filter(move |&m| m != k && stays(m));
            let basis = |x: f64| -> f64 {
                let factor = |m: usize| (x - self.line[m].0) / (self.line[k].0 - self.line[m].0);
                others().map(factor).product()
            };
            self.line.iter().map(|&(x, weight)| weight * basis(x)).sum()
        };
        let change = |k: usize| if stays(k) { integral(k) / self.line[k].1 } else { 0.0 } - 1.0;
        Some((0..q).map(change).collect())
    }

    /// Returns the rule's points and weights on a patch of three or four corners.
    ///
    /// # Panics
    /// If there are neither three nor four corners.
    #[must_use]
    #[track_caller]
    pub fn on_polygon(&self, corners: &[DVec3]) -> Vec<WeightedPoint> {
        let mut points = Vec::with_capacity(self.n_points());
        for &(t, weight_t) in &self.line {
            for &(s, weight_s) in &self.line {
                let (position, element) = match *corners {
                    [a, b, c] => (a + s * ((1.0 - t) * (b - a) + t * (c - a)), s),
                    [a, b, c, d] => {
                        let along_s = (1.0 - t) * (b - a) + t * (c - d);
                        let along_t = (1.0 - s) * (d - a) + s * (c - b);
                        (
                            a + s * (b - a) + t * (d - a) + s * t * (a - b + c - d),
                            along_s.cross(along_t).length(),
                        )
                    }
                    _ => panic!("a patch has three or four corners, not {}", corners.len()),
                };
                points.push(WeightedPoint {
                    position,
                    weight: weight_s * weight_t * element,
                });
            }
        }
        let total: f64 = points.iter().map(|p| p.weight).sum();
        for point in &mut points {
            point.weight /= total;
        }
        points
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::geometry::polygon;

    #[test]
    fn the_coarser_rule_is_exact_for_as_many_degrees_as_it_has_nodes_and_no_more() {
        for q in 1..12 {
            let rule = GaussProduct::new(NonZeroUsize::new(q).unwrap());
            let Some(changes) = rule.coarser() else {
                assert!(q < 3);
                continue;
            };
            let n_nodes = changes.iter().filter(|c| **c > -1.0).count();
            assert!(n_nodes < q && 2 * n_nodes >= q, "{q}: {n_nodes}");
            let change = |degree: usize| -> f64 {
                let power = |x: f64| (2.0 * x - 1.0).powi(i32::try_from(degree).unwrap());
                let nodes = rule.line.iter().zip(&changes);
                nodes.map(|((x, weight), change)| weight * change * power(*x)).sum()
            };
            for degree in 0..n_nodes {
                assert!(change(degree).abs() < 1e-13, "{q} {degree}: {}", change(degree));
            }
            // By symmetry odd degrees are exact as well.
            let next = n_nodes + n_nodes % 2;
            assert!(change(next).abs() > 1e-4, "{q} {next}: {}", change(next));
        }
    }

    #[test]
    fn low_degrees_are_exact() {
        let shapes: [&[DVec3]; 3] = [
            &[DVec3::ZERO, DVec3::X, DVec3::Y],
            &[DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y],
            &[
                DVec3::ZERO,
                DVec3::new(3.0, 0.0, 0.0),
                DVec3::new(1.5, 1.0, 0.0),
                DVec3::Y,
            ],
        ];
        for corners in shapes {
            for q in 2..7 {
                let rule = GaussProduct::new(NonZeroUsize::new(q).unwrap());
                let points = rule.on_polygon(corners);
                assert_eq!(points.len(), q * q);
                let mean: DVec3 = points.iter().map(|p| p.weight * p.position).sum();
                assert!(mean.distance(polygon::centroid(corners)) < 1e-14);
            }
        }
        // Mean of x² y over the triangle (0,0) (1,0) (0,1): 2 · 2!·1!/5! = 1/30.
        let rule = GaussProduct::new(NonZeroUsize::new(3).unwrap());
        let mean: f64 = rule
            .on_polygon(shapes[0])
            .iter()
            .map(|p| p.weight * p.position.x.powi(2) * p.position.y)
            .sum();
        assert!((mean - 1.0 / 30.0).abs() < 1e-16);
    }
}
