//! The cells of one face on one level, and the coarse cell of each.

use crate::mesh::face_shape::{FaceShape, count};

/// The borders between the parts of an edge, in parts of the finest level: 0, ..., n.
#[derive(Clone, Debug)]
pub(super) struct Cuts(Vec<u32>);

impl Cuts {
    fn new(n: u32) -> Self {
        Self((0..=n).collect())
    }

    fn n(&self) -> usize {
        self.0.len() - 1
    }

    /// Merges two by two, and where n is odd three in one place.
    fn coarsened(&self) -> Self {
        let n = self.n();
        let m = (n / 2).max(1);
        Self((0..=m).map(|k| self.0[k * n / m]).collect())
    }

    fn middle(&self, k: usize) -> f64 {
        0.5 * (f64::from(self.0[k]) + f64::from(self.0[k + 1]))
    }

    /// Returns, for every part, its coarse part, and the neighbour of that on its side with the weight of linear interpolation.
    fn parents(&self, coarse: &Self) -> Vec<Parent> {
        let parent = |k: usize| {
            let own = coarse.0.partition_point(|&cut| cut <= self.0[k]) - 1;
            let from_middle = self.middle(k) - coarse.middle(own);
            let side = if from_middle > 0.0 {
                own.checked_add(1)
            } else {
                own.checked_sub(1)
            };
            let neighbour = side.filter(|&j| j < coarse.n() && from_middle.abs() > 0.0).map(|j| {
                let weight = from_middle / (coarse.middle(j) - coarse.middle(own));
                (j, weight)
            });
            Parent { own, neighbour }
        };
        (0..self.n()).map(parent).collect()
    }
}

struct Parent {
    own: usize,
    neighbour: Option<(usize, f64)>,
}

impl Parent {
    fn weights(&self) -> impl Iterator<Item = (usize, f64)> + Clone {
        let taken = self.neighbour.map_or(0.0, |(_, weight)| weight);
        std::iter::once((self.own, 1.0 - taken)).chain(self.neighbour)
    }
}

/// The cells of one face on one level.
#[derive(Clone, Debug)]
pub(super) enum FaceCells {
    Quad { u: Cuts, v: Cuts },
    Triangle { n: usize },
}

impl FaceCells {
    pub(super) fn new(shape: FaceShape) -> Self {
        match shape {
            FaceShape::Quad { n_u, n_v } => Self::Quad {
                u: Cuts::new(n_u),
                v: Cuts::new(n_v),
            },
            FaceShape::Triangle { n } => Self::Triangle { n: n as usize },
        }
    }

    pub(super) fn n_cells(&self) -> usize {
        match self {
            Self::Quad { u, v } => u.n() * v.n(),
            Self::Triangle { n } => n * n,
        }
    }

    pub(super) fn coarsened(&self) -> Self {
        match self {
            Self::Quad { u, v } => Self::Quad {
                u: u.coarsened(),
                v: v.coarsened(),
            },
            Self::Triangle { n } => Self::Triangle { n: (n / 2).max(1) },
        }
    }

    /// Calls `visit` with the parent of every cell in turn, and the coarse cells and weights of its bilinear value.
    pub(super) fn for_each_parent(&self, coarse: &Self, mut visit: impl FnMut(u32, &[(u32, f64)])) {
        match (self, coarse) {
            (
                Self::Quad { u, v },
                Self::Quad {
                    u: coarse_u,
                    v: coarse_v,
                },
            ) => {
                let (in_u, in_v) = (u.parents(coarse_u), v.parents(coarse_v));
                let index = |i: usize, j: usize| count(j * coarse_u.n() + i);
                for above in &in_v {
                    for beside in &in_u {
                        let pairs = above
                            .weights()
                            .flat_map(|(j, w_v)| beside.weights().map(move |(i, w_u)| (i, j, w_u * w_v)));
                        let stencil: Vec<_> = pairs.map(|(i, j, weight)| (index(i, j), weight)).collect();
                        visit(index(beside.own, above.own), &stencil);
                    }
                }
            }
            (Self::Triangle { n }, Self::Triangle { n: m }) => {
                for (i, j, upright) in triangles(*n) {
                    let parent = parent_triangle(*n, *m, i, j, upright);
                    visit(parent, &[(parent, 1.0)]);
                }
            }
            _ => unreachable!("a face keeps its shape"),
        }
    }
}

/// Iterates over the cells of a triangle in their order.
fn triangles(n: usize) -> impl Iterator<Item = (usize, usize, bool)> {
    let row = move |j: usize| (0..2 * (n - j) - 1).map(move |k| (k / 2, j, k % 2 == 0));
    (0..n).flat_map(row)
}

/// Returns the cell of m² in which the centroid of a cell of n² lies; a centroid on a border belongs to the upright cell.
fn parent_triangle(n: usize, m: usize, i: usize, j: usize, upright: bool) -> u32 {
    // Centroids in 1 / 3n, times m: whole numbers of 1 / 3n of a coarse part.
    let third = if upright { 1 } else { 2 };
    let split = |k: usize| {
        let x = (3 * k + third) * m;
        (x / (3 * n), x % (3 * n))
    };
    let ((a, s), (b, t)) = (split(i), split(j));
    let row = 2 * m * b - b * b;
    count(row + 2 * a + usize::from(s + t > 3 * n))
}
