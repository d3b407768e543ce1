//! Pairs of patches that repeat: on two regular grids an exchange area depends on the step between the patches only.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use rayon::prelude::*;

use super::patches::Patches;
use crate::form_factor::pairs::Exchange;

/// The part of the largest coordinate below which lengths that differ count as equal: some ulps, by which rounding moves a corner anyway.
const EQUAL: f64 = 4.0 * f64::EPSILON;

/// The fewest pairs for each entry that make a table worth its memory.
const MIN_REPEATS: usize = 3;

/// The greatest change of an exchange area without cosines, by a corner that is off by a part of a patch's size.
///
/// There are eight corners, and each moves areas, distances and heights.
const LEVER: f64 = 8.0;

/// The most entries of one table: 16 MB.
const MAX_ENTRIES: usize = 1 << 20;

/// Patches as translations of one another, at i u + j v for whole i and j.
///
/// They are those of a face, of which patch i + j n lies at i u + j v, or some of one plane in any order.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    first: usize,
    /// The steps along both axes; that of an axis with one patch is zero.
    steps: [DVec3; 2],
    counts: [usize; 2],
    extent: f64,
    /// Where the patches are, if not in the order of their numbers.
    cells: Option<Arc<Cells>>,
}

/// The positions of patches that do not come in the order of their lattice.
#[derive(Debug)]
struct Cells {
    /// In ascending order of the patches.
    places: Vec<(u32, [u32; 2])>,
    /// By position, the first axis fastest; `None` where the lattice has a hole.
    patches: Vec<Option<u32>>,
    /// The greatest distance of a corner from its position in the lattice, along an axis, in m.
    off: f64,
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
            cells: None,
        })
    }

    /// Makes a lattice from the positions of patches, the least of which along each axis is 0; `off` is how far a corner is from its position, in m.
    pub(super) fn of_cells(mut places: Vec<(u32, [u32; 2])>, steps: [DVec3; 2], extent: f64, off: f64) -> Self {
        places.sort_unstable();
        let counts = [0, 1].map(|axis| places.iter().map(|place| place.1[axis] as usize + 1).max().unwrap_or(0));
        let mut patches = vec![None; counts[0] * counts[1]];
        for &(patch, [i, j]) in &places {
            patches[i as usize + j as usize * counts[0]] = Some(patch);
        }
        let step = |axis: usize| if counts[axis] > 1 { steps[axis] } else { DVec3::ZERO };
        Self {
            first: places.first().map_or(0, |place| place.0 as usize),
            steps: [step(0), step(1)],
            counts,
            extent,
            cells: Some(Arc::new(Cells { places, patches, off })),
        }
    }

    /// Returns the number of patches.
    fn n_patches(&self) -> usize {
        let all = self.counts[0] * self.counts[1];
        self.cells.as_ref().map_or(all, |cells| cells.places.len())
    }

    /// Returns the patch with the greatest number.
    pub(super) fn last(&self) -> usize {
        let last = self.first + (self.counts[0] * self.counts[1]).saturating_sub(1);
        let of_cells = |cells: &Arc<Cells>| cells.places.last().map_or(0, |place| place.0 as usize);
        self.cells.as_ref().map_or(last, of_cells)
    }

    /// Returns how far corners may be from their positions in the lattice, in m.
    fn off(&self) -> f64 {
        let rounding = EQUAL * self.extent;
        self.cells.as_ref().map_or(rounding, |cells| rounding.max(cells.off))
    }

    /// Returns the patch at a position; `None` where there is none.
    fn patch_at(&self, [i, j]: [usize; 2]) -> Option<usize> {
        if i >= self.counts[0] || j >= self.counts[1] {
            return None;
        }
        let k = i + j * self.counts[0];
        match &self.cells {
            Some(cells) => cells.patches[k].map(|patch| patch as usize),
            None => Some(self.first + k),
        }
    }

    /// Returns the first patch of the rows (along the first axis) that hold some patches, and the counts along both axes of these rows.
    pub(super) fn rows_of(&self, patches: &Range<usize>) -> (usize, [usize; 2]) {
        let n_u = self.counts[0];
        let row = |patch: usize| patch.saturating_sub(self.first) / n_u;
        let (begin, end) = (row(patches.start), row(patches.end - 1).min(self.counts[1] - 1) + 1);
        (self.first + n_u * begin, [n_u, end - begin])
    }

    fn place(&self, patch: usize) -> [usize; 2] {
        if let Some(cells) = &self.cells
            && let Ok(k) = cells.places.binary_search_by_key(&patch, |place| place.0 as usize)
        {
            return cells.places[k].1.map(|index| index as usize);
        }
        let k = patch - self.first;
        [k % self.counts[0], k / self.counts[0]]
    }
}

/// One coordinate of the step between two patches: a − b along a common axis, or a position on one of the grids alone.
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

/// The distinct exchange areas of two grids, each stored once.
pub(super) struct Repeats {
    from: Lattice,
    to: Lattice,
    coordinates: Vec<Coordinate>,
    /// Computed when first read.
    values: Vec<OnceLock<Exchange>>,
}

impl Repeats {
    /// Computes the distinct exchange areas of two grids; `None` if too few pairs repeat.
    pub(super) fn new(
        patches: &Patches,
        from: &Lattice,
        to: &Lattice,
        exchange: impl Fn(usize, usize) -> Exchange + Sync,
    ) -> Option<Self> {
        let repeats = Self::empty(from, to)?;
        repeats
            .values
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .for_each(|(k, value)| {
                value.get_or_init(|| repeats.value(patches, k, &exchange));
            });
        Some(repeats)
    }

    /// Returns the table of two grids with nothing computed; `None` if too few pairs repeat.
    pub(super) fn empty(from: &Lattice, to: &Lattice) -> Option<Self> {
        let coordinates = coordinates(from, to);
        let n_values: usize = coordinates.iter().map(|c| c.count).product();
        let n_pairs = from.n_patches() * to.n_patches();
        if n_values > MAX_ENTRIES || n_values * MIN_REPEATS > n_pairs {
            return None;
        }
        Some(Self {
            from: from.clone(),
            to: to.clone(),
            coordinates,
            values: (0..n_values).map(|_| OnceLock::new()).collect(),
        })
    }

    /// Returns the exchange area of a pair, if it is computed.
    pub(super) fn get(&self, i: usize, j: usize) -> Exchange {
        self.values[self.index(i, j)].get().copied().unwrap_or_default()
    }

    /// Returns the exchange area of a pair, and computes it by `exchange` if no pair with the same step was read before.
    pub(super) fn get_or(
        &self,
        patches: &Patches,
        (i, j): (usize, usize),
        exchange: impl Fn(usize, usize) -> Exchange,
    ) -> Exchange {
        let index = self.index(i, j);
        *self.values[index].get_or_init(|| self.value(patches, index, &exchange))
    }

    /// Computes entry `index`.
    ///
    /// The corners of all pairs that share it are equal but for a small distance, whose effect goes into the error.
    fn value(&self, patches: &Patches, index: usize, exchange: &impl Fn(usize, usize) -> Exchange) -> Exchange {
        let Some((i, j)) = self.representative(index) else {
            return Exchange::default();
        };
        let value = exchange(i, j);
        let [p, q] = [i, j].map(|k| &patches.prepared[k]);
        let size = p.radius().min(q.radius());
        let rounding = EQUAL * self.from.extent.max(self.to.extent);
        let off = self.from.off() + self.to.off();
        let mut error = value.error + 2.0 * value.area * rounding / size;
        if off > 2.0 * rounding {
            // Where cosines are small, a corner that moves changes them by more.
            let distance = (patches.corners[i][0] - patches.corners[j][0]).length_squared();
            let most = (p.area() * q.area() / distance).min(p.area()).min(q.area());
            error += LEVER * off / size * value.area.max(most);
        }
        Exchange { error, ..value }
    }

    fn index(&self, i: usize, j: usize) -> usize {
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
        index
    }

    /// Returns the first pair that has entry `index`; `None` where the grids have holes in all of them.
    fn representative(&self, mut index: usize) -> Option<(usize, usize)> {
        let (mut a, mut b) = ([0; 2], [0; 2]);
        // Along the common directions, both patches move together.
        let mut common: [Option<(usize, usize, bool, usize)>; 2] = [None; 2];
        for c in self.coordinates.iter().rev() {
            let value = index % c.count;
            index /= c.count;
            match (c.from, c.to) {
                (Some(axis), None) => a[axis] = value,
                (None, Some((axis, _))) => b[axis] = value,
                (Some(axis), Some((other, against))) => {
                    (a[axis], b[other]) = if against {
                        let first = value.min(self.from.counts[axis] - 1);
                        (first, value - first)
                    } else {
                        // The least a and b with a − b + shift = value.
                        (value.saturating_sub(c.shift), c.shift.saturating_sub(value))
                    };
                    common[usize::from(common[0].is_some())] = Some((axis, other, against, self.from.counts[axis]));
                }
                (None, None) => {}
            }
        }
        let moved = |(mut from, mut to): ([usize; 2], [usize; 2]), along: usize, by: usize| {
            if let Some((axis, other, against, _)) = common[along] {
                to[other] += by;
                from[axis] = if against {
                    from[axis].checked_sub(by)?
                } else {
                    from[axis] + by
                };
            }
            Some((from, to))
        };
        let steps = |along: usize| 0..common[along].map_or(1, |(.., count)| count);
        steps(0).find_map(|first| {
            steps(1).find_map(|second| {
                let (from, to) = moved(moved((a, b), 0, first)?, 1, second)?;
                Some((self.from.patch_at(from)?, self.to.patch_at(to)?))
            })
        })
    }
}

/// Finds the axes that two grids have in common.
fn coordinates(from: &Lattice, to: &Lattice) -> Vec<Coordinate> {
    let rounding = EQUAL * from.extent.max(to.extent);
    let off = from.off() + to.off();
    let slack = if off > 2.0 * rounding { off } else { rounding };
    let mut found = Vec::new();
    let mut free = [true; 2];
    for axis in 0..2 {
        let most = from.counts[axis].max(2) as f64;
        let common = (0..2).filter(|&k| free[k] && to.counts[k] > 1).find_map(|k| {
            // The difference must not show at the far end of the grids either.
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
