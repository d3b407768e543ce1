//! Pairs of patches that repeat: on two regular grids an exchange area depends on the step between the patches only.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::patches::Patches;
use crate::form_factor::pairs::Exchange;

/// Lengths that differ by less than this part of the largest coordinate are equal: some ulps, which rounding moves a corner by anyway.
const EQUAL: f64 = 4.0 * f64::EPSILON;

/// A table is worth its memory only if each entry stands for at least so many pairs.
const MIN_REPEATS: usize = 3;

/// The most entries of one table: 16 MB.
const MAX_ENTRIES: usize = 1 << 20;

/// The patches of a face as translations of the first: patch i + j n lies at i u + j v.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    first: usize,
    /// The steps along both axes; that of an axis with one patch is zero.
    steps: [DVec3; 2],
    counts: [usize; 2],
    extent: f64,
}

impl Lattice {
    /// Finds the grid that the patches `range` make; `None` if they are not all translations of one another, to rounding.
    pub(super) fn find(corners: &[Vec<DVec3>], range: Range<usize>) -> Option<Self> {
        let first = range.start;
        let base = &corners[first];
        let extent = range
            .clone()
            .flat_map(|k| &corners[k])
            .fold(0.0_f64, |m, v| m.max(v.abs().max_element()));
        let slack = EQUAL * extent;
        let offset = |k: usize| corners[k][0] - base[0];
        let is_shift = |k: usize, by: DVec3| {
            corners[k].len() == base.len()
                && corners[k]
                    .iter()
                    .zip(base)
                    .all(|(v, b)| (*v - *b - by).abs().max_element() <= slack)
        };
        let n = range.len();
        // The first axis ends where the next patch does not continue it.
        let step = if n > 1 { offset(first + 1) } else { DVec3::ZERO };
        let n_u = (2..n)
            .find(|&k| (offset(first + k) - step * k as f64).length() > 0.5 * step.length())
            .unwrap_or(n);
        if n == 0 || !n.is_multiple_of(n_u) {
            return None;
        }
        let n_v = n / n_u;
        let mean_step = |last: usize, count: usize| {
            if count > 1 {
                offset(last) / (count - 1) as f64
            } else {
                DVec3::ZERO
            }
        };
        let steps = [mean_step(first + n_u - 1, n_u), mean_step(first + n_u * (n_v - 1), n_v)];
        let at = |k: usize| steps[0] * (k % n_u) as f64 + steps[1] * (k / n_u) as f64;
        (0..n).all(|k| is_shift(first + k, at(k))).then_some(Self {
            first,
            steps,
            counts: [n_u, n_v],
            extent,
        })
    }

    /// Returns the first patch of the rows (along the first axis) that hold some patches, and the counts along both axes of these rows.
    pub(super) fn rows_of(&self, patches: &Range<usize>) -> (usize, [usize; 2]) {
        let n_u = self.counts[0];
        let row = |patch: usize| patch.saturating_sub(self.first) / n_u;
        let (begin, end) = (row(patches.start), row(patches.end - 1).min(self.counts[1] - 1) + 1);
        (self.first + n_u * begin, [n_u, end - begin])
    }

    fn place(&self, patch: usize) -> [usize; 2] {
        let k = patch - self.first;
        [k % self.counts[0], k / self.counts[0]]
    }
}

/// One coordinate of the step between two patches: a − b along a common axis, or a place on one of the grids alone.
#[derive(Clone, Copy, Debug)]
struct Coordinate {
    /// The axis of the first grid, with its sign.
    from: Option<usize>,
    /// The axis of the second grid, and true if it counts against the common direction.
    to: Option<(usize, bool)>,
    /// Added so that the least value is 0.
    shift: usize,
    count: usize,
}

/// The exchange areas of two grids, each different one once.
pub(super) struct Repeats {
    from: Lattice,
    to: Lattice,
    coordinates: Vec<Coordinate>,
    values: Vec<Exchange>,
}

impl Repeats {
    /// Computes what is different between two grids; `None` if too little repeats.
    pub(super) fn new(
        patches: &Patches,
        from: &Lattice,
        to: &Lattice,
        exchange: impl Fn(usize, usize) -> Exchange + Sync,
    ) -> Option<Self> {
        let coordinates = coordinates(from, to);
        let n_values: usize = coordinates.iter().map(|c| c.count).product();
        let n_pairs = from.counts.iter().chain(&to.counts).product::<usize>();
        if n_values > MAX_ENTRIES || n_values * MIN_REPEATS > n_pairs {
            return None;
        }
        let mut repeats = Self {
            from: *from,
            to: *to,
            coordinates,
            values: Vec::new(),
        };
        // Corners of the places in the table are equal to rounding; what that changes goes into the error.
        let rounding = EQUAL * from.extent.max(to.extent);
        repeats.values = (0..n_values)
            .into_par_iter()
            .with_min_len(64)
            .map(|k| {
                let (i, j) = repeats.representative(k);
                let value = exchange(i, j);
                let size = patches.prepared[i].radius().min(patches.prepared[j].radius());
                Exchange {
                    error: value.error + 2.0 * value.area * rounding / size,
                    ..value
                }
            })
            .collect();
        Some(repeats)
    }

    /// Returns the exchange area of a pair.
    pub(super) fn get(&self, i: usize, j: usize) -> Exchange {
        let (a, b) = (self.from.place(i), self.to.place(j));
        let mut index = 0;
        for c in &self.coordinates {
            let mut value = c.shift;
            if let Some(axis) = c.from {
                value += a[axis];
            }
            match c.to {
                // Along a common direction the step is a − b; a grid that runs the other way adds.
                Some((axis, false)) if c.from.is_some() => value -= b[axis],
                Some((axis, _)) => value += b[axis],
                None => {}
            }
            index = index * c.count + value;
        }
        self.values[index]
    }

    /// Returns a pair that has entry `index`.
    fn representative(&self, mut index: usize) -> (usize, usize) {
        let (mut a, mut b) = ([0; 2], [0; 2]);
        for c in self.coordinates.iter().rev() {
            let value = index % c.count;
            index /= c.count;
            match (c.from, c.to) {
                (Some(axis), None) => a[axis] = value,
                (None, Some((axis, _))) => b[axis] = value,
                (Some(axis), Some((other, false))) => {
                    // a − b + shift = value, both as small as can be.
                    a[axis] = value.saturating_sub(c.shift);
                    b[other] = c.shift.saturating_sub(value);
                }
                (Some(axis), Some((other, true))) => {
                    a[axis] = value.min(self.from.counts[axis] - 1);
                    b[other] = value - a[axis];
                }
                (None, None) => {}
            }
        }
        let number = |grid: &Lattice, [i, j]: [usize; 2]| grid.first + i + j * grid.counts[0];
        (number(&self.from, a), number(&self.to, b))
    }
}

/// Finds the axes that two grids have in common.
fn coordinates(from: &Lattice, to: &Lattice) -> Vec<Coordinate> {
    let slack = EQUAL * from.extent.max(to.extent);
    let mut found = Vec::new();
    let mut free = [true; 2];
    for axis in 0..2 {
        let most = from.counts[axis].max(2) as f64;
        let common = (0..2).filter(|&k| free[k] && to.counts[k] > 1).find_map(|k| {
            // At the far end of the grids too, the difference must not show.
            let reach = most.max(to.counts[k] as f64);
            let differs = |step: DVec3| (step - from.steps[axis]).abs().max_element() * reach > slack;
            if from.counts[axis] < 2 {
                None
            } else if !differs(to.steps[k]) {
                Some((k, false))
            } else {
                (!differs(-to.steps[k])).then_some((k, true))
            }
        });
        if let Some((k, _)) = common {
            free[k] = false;
        }
        found.push(Coordinate {
            from: Some(axis),
            to: common,
            shift: common.map_or(0, |(k, against)| if against { 0 } else { to.counts[k] - 1 }),
            count: from.counts[axis] + common.map_or(0, |(k, _)| to.counts[k] - 1),
        });
    }
    for k in (0..2).filter(|&k| free[k]) {
        found.push(Coordinate {
            from: None,
            to: Some((k, false)),
            shift: 0,
            count: to.counts[k],
        });
    }
    found
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
    fn repeated_pairs_are_those_computed_one_by_one() {
        let patches = patches("room-box", 6);
        let lattices: Vec<Lattice> = patches
            .faces
            .iter()
            .map(|f| Lattice::find(&patches.corners, f.range()).unwrap())
            .collect();
        let exchange = |i: usize, j: usize| {
            let exact = exchange_area(&patches.prepared[i], &patches.prepared[j], Tolerance::default());
            Exchange {
                area: exact.value,
                error: exact.error,
            }
        };
        let mut n_tables = 0;
        for (f, from) in lattices.iter().enumerate() {
            for (g, to) in lattices.iter().enumerate().skip(f + 1) {
                let Some(table) = Repeats::new(&patches, from, to, exchange) else {
                    continue;
                };
                n_tables += 1;
                for i in patches.faces[f].range() {
                    for j in patches.faces[g].range() {
                        let (repeated, own) = (table.get(i, j), exchange(i, j));
                        let off = (repeated.area - own.area).abs();
                        assert!(
                            off <= repeated.error + own.error && off <= 1e-12 * own.area,
                            "{i} {j}: {repeated:?} {own:?}"
                        );
                    }
                }
            }
        }
        // Opposite walls and sides, and neighbours, whose edges are cut alike.
        assert!(n_tables >= 15, "{n_tables}");
    }

    #[test]
    fn what_is_no_grid_of_translations_is_not_taken_for_one() {
        let sphere = patches("sphere-room-r1", 2);
        let n_lattices = sphere
            .faces
            .iter()
            .filter(|f| Lattice::find(&sphere.corners, f.range()).is_some())
            .count();
        // The six walls are grids; the sphere's trapezoids and triangles are not.
        assert!(n_lattices >= 6 && n_lattices < sphere.faces.len(), "{n_lattices}");
        let cube = patches("cube", 3);
        let mut corners = cube.corners.to_vec();
        assert!(Lattice::find(&corners, 0..9).is_some());
        corners[4][2] += DVec3::X * 1e-14;
        assert!(Lattice::find(&corners, 0..9).is_none());
    }
}
