//! The patch of a face at a given point.

use glam::{DVec2, DVec3};

use super::face_shape::FaceShape;
use super::patch::{PatchId, PatchPoint};
use super::pieces::{Corner, PieceTree, Pieces};

/// The regular subdivision of one face, or of its pieces.
#[derive(Clone, Debug)]
pub(super) struct FaceGrid {
    first_patch: u32,
    shape: Shape,
}

#[derive(Clone, Debug)]
enum Shape {
    /// n² triangles: row j holds 2(n − j) − 1, alternately upright and inverted.
    Triangle { n: u32 },
    /// n_u × n_v quads, u fastest.
    Parallelogram { n_u: u32, n_v: u32 },
    /// The same for a quad whose opposite edges differ: the grid is bilinear, the ray's coordinates are not.
    Bilinear { n_u: u32, n_v: u32, map: Box<BilinearMap> },
    /// A face in pieces, each with a grid of its own.
    Pieces(Box<PieceGrids>),
}

/// The grids of a face's pieces.
#[derive(Clone, Debug)]
struct PieceGrids {
    /// The face itself.
    outline: FlatOutline,
    tree: PieceTree,
    grids: Vec<PieceGrid>,
    /// The greatest distance from the plane of the contact edges that cut it, in m.
    misfit: f64,
}

#[derive(Clone, Debug)]
struct PieceGrid {
    outline: FlatOutline,
    /// Counted from the first patch of the face.
    first_patch: u32,
    shape: FaceShape,
}

impl FaceGrid {
    pub(super) fn triangle(first_patch: u32, n: u32) -> Self {
        Self {
            first_patch,
            shape: Shape::Triangle { n },
        }
    }

    pub(super) fn quad(first_patch: u32, n_u: u32, n_v: u32, corners: [DVec3; 4]) -> Self {
        let [a, b, c, d] = corners;
        let skew = (a - b + c - d).length();
        let size = (c - a).length().max((d - b).length());
        let shape = if skew <= 1e-12 * size {
            Shape::Parallelogram { n_u, n_v }
        } else {
            let map = Box::new(BilinearMap::new(corners));
            Shape::Bilinear { n_u, n_v, map }
        };
        Self { first_patch, shape }
    }

    /// Makes the grids of the pieces of a face, with their subdivisions in the same order.
    pub(super) fn pieces(first_patch: u32, pieces: &Pieces, shapes: &[FaceShape]) -> Self {
        let mut n_patches = 0;
        let grids = pieces.outlines.iter().zip(shapes).map(|(outline, &shape)| {
            let grid = PieceGrid {
                outline: FlatOutline::new(outline),
                first_patch: n_patches,
                shape,
            };
            n_patches += PatchId::from_index(shape.n_patches()).0;
            grid
        });
        let shape = Shape::Pieces(Box::new(PieceGrids {
            outline: FlatOutline::new(&pieces.face),
            grids: grids.collect(),
            tree: pieces.tree.clone(),
            misfit: pieces.misfit,
        }));
        Self { first_patch, shape }
    }

    /// Returns the greatest distance from the plane of the contact edges that cut the face, in m; `None` for a face that is not cut.
    pub(super) fn misfit(&self) -> Option<f64> {
        match &self.shape {
            Shape::Pieces(pieces) => Some(pieces.misfit),
            _ => None,
        }
    }

    /// Returns the subdivision of the face, or of each of its pieces, in the order of the patches.
    pub(super) fn shapes(&self) -> Vec<FaceShape> {
        match &self.shape {
            Shape::Triangle { n } => vec![FaceShape::Triangle { n: *n }],
            Shape::Parallelogram { n_u, n_v } | Shape::Bilinear { n_u, n_v, .. } => {
                vec![FaceShape::Quad { n_u: *n_u, n_v: *n_v }]
            }
            Shape::Pieces(pieces) => pieces.grids.iter().map(|grid| grid.shape).collect(),
        }
    }

    pub(super) fn patch_at(&self, u: f64, v: f64) -> PatchId {
        match &self.shape {
            Shape::Parallelogram { n_u, n_v } => {
                let (i, j) = (split(u, *n_u).0, split(v, *n_v).0);
                PatchId(self.first_patch + j * n_u + i)
            }
            _ => self.locate(u, v).patch,
        }
    }

    pub(super) fn locate(&self, u: f64, v: f64) -> PatchPoint {
        let (index, weights) = match &self.shape {
            Shape::Triangle { n } => locate_in_triangle(*n, u, v),
            Shape::Parallelogram { n_u, n_v } => locate_in_quad(*n_u, *n_v, u, v),
            Shape::Bilinear { n_u, n_v, map } => {
                let local = map.bilinear_from_ray(u, v);
                locate_in_quad(*n_u, *n_v, local.x, local.y)
            }
            Shape::Pieces(pieces) => pieces.locate(u, v),
        };
        PatchPoint {
            patch: PatchId(self.first_patch + index),
            weights,
        }
    }
}

/// Splits x in [0, 1] into the cell of n and the position in it; rounding just outside is moved to the border.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the value is clamped to 0..=n-1 first, and a NaN becomes 0"
)]
fn split(x: f64, n: u32) -> (u32, f64) {
    let scaled = x * f64::from(n);
    let cell = (scaled.max(0.0) as u32).min(n - 1);
    (cell, (scaled - f64::from(cell)).clamp(0.0, 1.0))
}

fn locate_in_quad(n_u: u32, n_v: u32, u: f64, v: f64) -> (u32, [f64; 4]) {
    let ((i, s), (j, t)) = (split(u, n_u), split(v, n_v));
    let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
    (j * n_u + i, weights)
}

fn locate_in_triangle(n: u32, u: f64, v: f64) -> (u32, [f64; 4]) {
    let (j, t) = split(v, n);
    let (mut i, mut s) = split(u, n);
    if i + j >= n {
        // Rounding put the point beyond the long edge: it belongs to the last upright triangle of the row.
        i = n - 1 - j;
        s = 1.0;
    }
    let row = 2 * n * j - j * j;
    if s + t <= 1.0 {
        return (row + 2 * i, [1.0 - s - t, s, t, 0.0]);
    }
    if i + j == n - 1 {
        let sum = s + t;
        return (row + 2 * i, [0.0, s / sum, t / sum, 0.0]);
    }
    (row + 2 * i + 1, [1.0 - t, s + t - 1.0, 1.0 - s, 0.0])
}

impl PieceGrids {
    fn locate(&self, u: f64, v: f64) -> (u32, [f64; 4]) {
        let point = self.outline.point(u, v);
        let grid = &self.grids[self.tree.piece_at(point)];
        let local = grid.outline.local(point);
        let (index, weights) = match grid.shape {
            FaceShape::Triangle { n } => locate_in_triangle(n, local.x, local.y),
            FaceShape::Quad { n_u, n_v } => locate_in_quad(n_u, n_v, local.x, local.y),
        };
        (grid.first_patch + index, weights)
    }
}

/// A triangle or a convex quad in the plane of a face.
#[derive(Clone, Debug)]
enum FlatOutline {
    Triangle([DVec2; 3]),
    Quad(BilinearMap),
}

impl FlatOutline {
    fn new(outline: &[Corner]) -> Self {
        let flat = |k: usize| outline[k].flat;
        if outline.len() == 3 {
            Self::Triangle(std::array::from_fn(flat))
        } else {
            Self::Quad(BilinearMap {
                corners: std::array::from_fn(flat),
            })
        }
    }

    /// Returns the point at the ray's coordinates.
    fn point(&self, u: f64, v: f64) -> DVec2 {
        match self {
            Self::Triangle([a, b, c]) => *a + u * (*b - *a) + v * (*c - *a),
            Self::Quad(map) => map.point_from_ray(u, v),
        }
    }

    /// Returns the coordinates of a point in the units of a grid.
    fn local(&self, point: DVec2) -> DVec2 {
        match self {
            Self::Triangle([a, b, c]) => {
                let (e, f, h) = (*b - *a, *c - *a, point - *a);
                DVec2::new(h.perp_dot(f), e.perp_dot(h)) / e.perp_dot(f)
            }
            Self::Quad(map) => map.bilinear(point),
        }
    }
}

/// P(s, t) = v0 + s e + t f + s t g in the plane of a convex quad.
#[derive(Clone, Debug)]
struct BilinearMap {
    corners: [DVec2; 4],
}

impl BilinearMap {
    fn new(corners: [DVec3; 4]) -> Self {
        let [a, b, _, d] = corners;
        let x = (b - a).normalize();
        let normal = (b - a).cross(d - a).normalize();
        let y = normal.cross(x);
        Self {
            corners: corners.map(|p| DVec2::new((p - a).dot(x), (p - a).dot(y))),
        }
    }

    /// Turns the ray's coordinates into bilinear ones.
    fn bilinear_from_ray(&self, u: f64, v: f64) -> DVec2 {
        self.bilinear(self.point_from_ray(u, v))
    }

    /// Returns the point at the ray's coordinates, which are affine in each of the two triangles.
    fn point_from_ray(&self, u: f64, v: f64) -> DVec2 {
        let [a, b, c, d] = self.corners;
        if u + v <= 1.0 {
            a + u * (b - a) + v * (d - a)
        } else {
            c + (1.0 - u) * (d - c) + (1.0 - v) * (b - c)
        }
    }

    /// Returns the bilinear coordinates of a point.
    fn bilinear(&self, point: DVec2) -> DVec2 {
        let [a, b, c, d] = self.corners;
        // Eliminating s from h = s e + t f + s t g leaves k2 t² + k1 t + k0 = 0, in a convex quad with one root in [0, 1].
        let (e, f, g, h) = (b - a, d - a, a - b + c - d, point - a);
        let (k2, k1, k0) = (g.perp_dot(f), e.perp_dot(f) + h.perp_dot(g), h.perp_dot(e));
        let q = -0.5 * (k1 + k1.signum() * (k1 * k1 - 4.0 * k2 * k0).max(0.0).sqrt());
        let outside = |t: f64| {
            if t.is_finite() {
                (t - t.clamp(0.0, 1.0)).abs()
            } else {
                f64::INFINITY
            }
        };
        let (t1, t2) = (k0 / q, q / k2);
        let t = if outside(t1) <= outside(t2) { t1 } else { t2 };
        let direction = e + t * g;
        let s = (h - t * f).dot(direction) / direction.length_squared();
        DVec2::new(s, t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangle_cells_are_numbered_row_by_row_and_cover_everything() {
        let n = 5;
        let grid = FaceGrid::triangle(100, n);
        let mut seen = vec![0; 25];
        let fine = 40;
        for j in 0..fine {
            for i in 0..fine - j {
                let (u, v) = (
                    (f64::from(i) + 0.3) / f64::from(fine),
                    (f64::from(j) + 0.3) / f64::from(fine),
                );
                let point = grid.locate(u, v);
                seen[point.patch.0 as usize - 100] += 1;
                let sum: f64 = point.weights.iter().sum();
                assert!((sum - 1.0).abs() < 1e-12 && point.weights.iter().all(|&w| (-1e-12..=1.0).contains(&w)));
            }
        }
        assert!(seen.iter().all(|&count| count > 0), "{seen:?}");
    }

    #[test]
    fn bilinear_coordinates_come_back() {
        let corners = [
            DVec3::new(0.0, 0.0, 1.0),
            DVec3::new(3.0, 0.2, 1.0),
            DVec3::new(2.0, 1.5, 1.0),
            DVec3::new(0.3, 1.0, 1.0),
        ];
        let map = BilinearMap::new(corners);
        let [a, b, c, d] = map.corners;
        for (s, t) in [
            (0.1, 0.2),
            (0.9, 0.05),
            (0.5, 0.5),
            (0.97, 0.99),
            (0.0, 1.0),
            (1.0, 1.0),
            (0.0, 0.0),
        ] {
            let p = (1.0 - s) * (1.0 - t) * a + s * (1.0 - t) * b + s * t * c + (1.0 - s) * t * d;
            // The ray's own coordinates of p, from the triangle that it lies in.
            let first = {
                let (e, f, h) = (b - a, d - a, p - a);
                let det = e.perp_dot(f);
                DVec2::new(h.perp_dot(f) / det, e.perp_dot(h) / det)
            };
            let uv = if first.x + first.y <= 1.0 {
                first
            } else {
                let (e, f, h) = (d - c, b - c, p - c);
                let det = e.perp_dot(f);
                DVec2::new(1.0 - h.perp_dot(f) / det, 1.0 - e.perp_dot(h) / det)
            };
            let back = map.bilinear_from_ray(uv.x, uv.y);
            assert!((back - DVec2::new(s, t)).length() < 1e-12, "{s} {t}: {back}");
        }
    }
}
