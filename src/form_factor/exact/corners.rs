//! Pairs of patches on two grids of rectangles with parallel edges and any steps, where an absolute error is enough.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::ops::Range;

use super::lattice::Lattice;
use super::patches::Patches;
use crate::form_factor::pairs::Exchange;
use crate::geometry::rectangle::grids::{Grid, GridPair};

/// Some rows of patches of a face as a grid.
pub(super) struct PatchGrid {
    grid: Grid,
    /// The numbers of the patches.
    patches: Range<usize>,
    /// The contributions of a cell's positions along both axes: their sum, added to the first patch, is the cell's patch.
    places: [Vec<usize>; 2],
    /// The greatest distance of a patch's corner from the grid's, in m.
    off: f64,
    /// The largest perimeter of a patch, in m.
    perimeter: f64,
}

impl PatchGrid {
    /// Takes the rows of a lattice that hold `patches`; `None` if these are no rectangles without gaps between them.
    pub(super) fn new(patches: &Patches, lattice: &Lattice, range: Range<usize>) -> Option<Self> {
        let (first, counts) = lattice.rows_of(&range);
        let of_patch = |k: usize| <[_; 4]>::try_from(patches.corners[k].as_slice()).ok();
        let base: [_; 4] = of_patch(first)?;
        let x = (base[1] - base[0]).normalize_or_zero();
        let y = patches.prepared[first].normal().cross(x);
        let strides = [1, counts[0]];
        let step = |axis: usize| patches.corners[first + strides[axis]][0] - base[0];
        // Which axis of the lattice runs along x.
        let along_x = match counts {
            [1, 1] => 0,
            [1, _] => usize::from(step(1).dot(x).abs() > step(1).dot(y).abs()),
            _ => usize::from(step(0).dot(x).abs() < step(0).dot(y).abs()),
        };
        let mut lines = [Vec::new(), Vec::new()];
        let mut places = [Vec::new(), Vec::new()];
        for (k, own) in [x, y].into_iter().enumerate() {
            let axis = if k == 0 { along_x } else { 1 - along_x };
            let mut order: Vec<usize> = (0..counts[axis]).map(|i| i * strides[axis]).collect();
            if counts[axis] > 1 && step(axis).dot(own) < 0.0 {
                order.reverse();
            }
            for &place in &order {
                let extent = of_patch(first + place)?.map(|v| own.dot(v - base[0]));
                let [low, high] =
                    [f64::min, f64::max].map(|of: fn(f64, f64) -> f64| extent.into_iter().fold(extent[0], of));
                lines[k].push(low);
                if place == order[order.len() - 1] {
                    lines[k].push(high);
                }
            }
            places[k] = order;
        }
        let grid = Grid {
            origin: base[0],
            axes: [x, y],
            lines,
        };
        let mut off = 0.0_f64;
        for (i, add) in places[0].iter().enumerate() {
            for (j, other) in places[1].iter().enumerate() {
                let k = first + add + other;
                for corner in of_patch(k)? {
                    let nearest = |axis: usize| {
                        let (at, lines) = (grid.axes[axis].dot(corner - base[0]), &grid.lines[axis]);
                        let [low, high] = [0, 1].map(|end| lines[[i, j][axis] + end]);
                        if at - low < high - at { low } else { high }
                    };
                    off = off.max(corner.distance(grid.at(nearest(0), nearest(1))));
                }
            }
        }
        let longest = |lines: &[f64]| lines.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let perimeter = 2.0 * (longest(&grid.lines[0]) + longest(&grid.lines[1]));
        Some(Self {
            grid,
            patches: first..first + counts[0] * counts[1],
            places,
            off,
            perimeter,
        })
    }
}

/// The exchange areas without occluders of all patches of some rows with all of another face.
pub(super) struct CornerSums {
    rows: Range<usize>,
    columns: Range<usize>,
    /// In m², row by row.
    values: Vec<f64>,
    error: f64,
}

impl CornerSums {
    /// Computes the pairs of two grids; `None` if edges are not parallel, or the absolute error of some pair may be above `most`, in m².
    pub(super) fn new(from: &PatchGrid, to: &PatchGrid, most: f64) -> Option<Self> {
        let pair = GridPair::new(&from.grid, &to.grid)?;
        let error = pair.error(from.off + to.off, [from.perimeter, to.perimeter]);
        if error > most {
            return None;
        }
        let n_columns = to.patches.len();
        let mut values = vec![0.0; from.patches.len() * n_columns];
        pair.for_each(|[i, j], [k, l], value| {
            let row = from.places[0][i] + from.places[1][j];
            values[row * n_columns + to.places[0][k] + to.places[1][l]] = value;
        });
        Some(Self {
            rows: from.patches.clone(),
            columns: to.patches.clone(),
            values,
            error,
        })
    }

    /// Returns whether the rows of some patches are there.
    #[cfg(test)]
    pub(super) fn covers(&self, rows: &Range<usize>) -> bool {
        self.rows.start <= rows.start && rows.end <= self.rows.end
    }

    /// Returns the exchange area of a pair.
    pub(super) fn get(&self, i: usize, j: usize) -> Exchange {
        let k = (i - self.rows.start) * self.columns.len() + (j - self.columns.start);
        Exchange {
            area: self.values[k],
            error: self.error,
        }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::form_factor::facing::Facing;
    use crate::geometry::polygon_form_factor::{Tolerance, exchange_area};
    use crate::mesh::{Mesh, Subdivision};
    use crate::scene::builtin;

    fn patches(name: &str, n: u32) -> Patches {
        let scene = builtin::build(name, None).unwrap().scene;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(n)).unwrap();
        Patches::new(&mesh, &Facing::new(&mesh), true)
    }

    #[test]
    fn sums_over_corners_are_the_pairs_computed_one_by_one() {
        let patches = patches("room-box", 5);
        let lattices: Vec<Lattice> = patches
            .faces
            .iter()
            .map(|f| Lattice::find(&patches.corners, f.range()).unwrap())
            .collect();
        let grid = |f: usize, range: Range<usize>| PatchGrid::new(&patches, &lattices[f], range).unwrap();
        let (mut n_tables, mut n_seen) = (0, 0);
        for f in 0..lattices.len() {
            let (own, rows) = (patches.faces[f].range(), patches.faces[f].range().start);
            // Patches 6 to 11 lie in the second and the third row of five.
            for rows in [own, rows + 6..rows + 12] {
                for g in 0..lattices.len() {
                    let others = patches.faces[g].range();
                    let Some(sums) = CornerSums::new(&grid(f, rows.clone()), &grid(g, others.clone()), 1.0) else {
                        continue;
                    };
                    n_tables += 1;
                    assert!(sums.covers(&rows) && sums.error < 5e-13, "{:e}", sums.error);
                    for i in rows.clone() {
                        for j in others.clone() {
                            let exact = exchange_area(&patches.prepared[i], &patches.prepared[j], Tolerance::default());
                            let off = (sums.get(i, j).area - exact.value).abs();
                            assert!(off <= sums.error + exact.error, "{i} {j}: {off:e} of {:e}", exact.value);
                            n_seen += usize::from(exact.value > 0.0);
                        }
                    }
                }
            }
        }
        // All pairs of faces but those in one plane, back to back and with themselves; more than half of their patches see each other.
        assert!(n_tables >= 2 * 90 && n_seen > 30_000, "{n_tables} {n_seen}");
    }

    #[test]
    fn an_error_that_is_too_large_makes_no_table_and_triangles_make_no_grid() {
        let patches = patches("room-box", 3);
        let lattice = |f: usize| Lattice::find(&patches.corners, patches.faces[f].range()).unwrap();
        let grid = |f: usize| PatchGrid::new(&patches, &lattice(f), patches.faces[f].range()).unwrap();
        let [wall, side] = [0, 6].map(grid);
        assert!(CornerSums::new(&wall, &side, 1e-12).is_some());
        assert!(CornerSums::new(&wall, &side, 1e-14).is_none());
        let sphere = self::patches("sphere-room-r1", 1);
        let triangle = (0..sphere.len()).find(|&k| sphere.corners[k].len() == 3).unwrap();
        let alone = Lattice::find(&sphere.corners, triangle..triangle + 1).unwrap();
        assert!(PatchGrid::new(&sphere, &alone, triangle..triangle + 1).is_none());
    }
}
