//! Vertices at one place: equal or nearly equal ones.

use foldhash::{HashMap, HashMapExt as _};
use glam::DVec3;

/// The distance, as a part of the scene's size, within which vertices are nearly equal: some steps of f32.
pub(super) const NEAR: f64 = 1e-6;

/// The result of joining vertices.
pub(super) struct Welded {
    /// The first vertex at the place of each, \[n\].
    pub(super) first: Vec<u32>,
    /// The greatest distance of a vertex from the one that replaces it, in m.
    pub(super) moved: f64,
    /// The number of vertices that differ from the one that replaces them.
    pub(super) n_moved: usize,
}

/// Returns the first vertex at the place of each; equal bits are one place, and so are 0 and −0.
pub(super) fn equal(vertices: &[DVec3]) -> Vec<u32> {
    let mut first_at: HashMap<[u64; 3], u32> = HashMap::with_capacity(vertices.len().min(1 << 16));
    (0..)
        .zip(vertices)
        .map(|(id, &vertex)| *first_at.entry(bits(vertex)).or_insert(id))
        .collect()
}

fn bits(vertex: DVec3) -> [u64; 3] {
    // Adding zero turns -0.0 into 0.0.
    (vertex + 0.0).to_array().map(f64::to_bits)
}

/// Joins vertices that are no farther apart than `tolerance`, in m.
///
/// In their order, each is replaced by the nearest earlier vertex that was not replaced.
/// Work: O(n), unless many vertices that stay apart are in one cube of side 4 `tolerance`.
pub(super) fn within(vertices: &[DVec3], tolerance: f64) -> Welded {
    within_of(vertices, equal(vertices), tolerance)
}

/// Joins vertices as [`within`] does, given the first vertex at the place of each.
fn within_of(vertices: &[DVec3], mut first: Vec<u32>, tolerance: f64) -> Welded {
    let (mut moved, mut n_moved) = (0.0_f64, 0);
    // The last unreplaced vertex in each cell, and for each vertex the one before it in its cell.
    let mut last: HashMap<[i64; 3], u32> = HashMap::new();
    let mut before: Vec<u32> = vec![u32::MAX; first.len()];
    let side = 4.0 * tolerance;
    // The margin covers the rounding of a distance equal to the tolerance.
    let reach = tolerance * (1.0 + 8.0 * f64::EPSILON);
    for id in 0..first.len() {
        if (first[id] as usize) < id {
            // The vertex that it equals has been joined already.
            first[id] = first[first[id] as usize];
            n_moved += usize::from(vertices[first[id] as usize] != vertices[id]);
            continue;
        }
        let here = vertices[id];
        let near = cells_between(cell_of(here - reach, side), cell_of(here + reach, side))
            .filter_map(|cell| last.get(&cell).copied())
            .flat_map(|last| {
                std::iter::successors(Some(last), |&k| Some(before[k as usize]).filter(|&k| k != u32::MAX))
            });
        let nearest = near
            .map(|other| (vertices[other as usize].distance(here), other))
            .filter(|(distance, _)| *distance <= tolerance)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if let Some((distance, other)) = nearest {
            first[id] = other;
            moved = moved.max(distance);
            n_moved += 1;
        } else {
            let known = last.insert(cell_of(here, side), first[id]);
            before[id] = known.unwrap_or(u32::MAX);
        }
    }
    Welded { first, moved, n_moved }
}

/// Returns how many vertices are within `tolerance` of a different earlier one; `first` is the result of [`equal`].
pub(super) fn n_nearly_equal(vertices: &[DVec3], first: &[u32], tolerance: f64) -> usize {
    let welded = within_of(vertices, first.to_vec(), tolerance);
    // Each place counts once.
    let own = (0_u32..).zip(first).filter(|(id, first)| id == *first);
    own.filter(|(id, _)| welded.first[*id as usize] != *id).count()
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "coordinates beyond the range of i64 meet in its last cell"
)]
fn cell_of(vertex: DVec3, side: f64) -> [i64; 3] {
    (vertex / side).floor().to_array().map(|x| x as i64)
}

/// Iterates over the cells between two corners.
fn cells_between(from: [i64; 3], to: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    let [x, y, z] = std::array::from_fn(|axis| from[axis]..=to[axis]);
    x.flat_map(move |i| {
        let z = z.clone();
        y.clone().flat_map(move |j| z.clone().map(move |k| [i, j, k]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_join_the_nearest_before_them() {
        let at = |x: f64| DVec3::new(x, 0.0, -0.0);
        let vertices = [
            at(0.0),
            at(1.0),
            at(0.3),
            at(0.9),
            at(1.0),
            DVec3::new(0.0, 0.0, 0.0),
            at(2.0),
        ];
        assert_eq!(equal(&vertices), [0, 1, 2, 3, 1, 0, 6]);
        let welded = within(&vertices, 0.31);
        assert_eq!(welded.first, [0, 1, 0, 1, 1, 0, 6]);
        assert!((welded.moved - 0.3).abs() < 1e-15 && welded.n_moved == 2);
        let first = equal(&vertices);
        assert_eq!(n_nearly_equal(&vertices, &first, 0.31), 2);
        assert_eq!(n_nearly_equal(&vertices, &first, 0.05), 0);
    }

    #[test]
    fn no_pair_within_the_tolerance_stays_apart() {
        // A grid perturbed by less than the tolerance: all pairs within the tolerance are found, across cells too.
        let mut vertices = Vec::new();
        for k in 0..1000 {
            let base = DVec3::new(f64::from(k % 10), f64::from(k / 10 % 10), f64::from(k / 100)) - 5.0;
            let off = 1e-3 * f64::from(k % 7) / 7.0;
            vertices.extend([base, base + DVec3::new(off, -off, 0.5 * off)]);
        }
        let welded = within(&vertices, 2e-3);
        for (k, first) in welded.first.iter().enumerate() {
            assert_eq!(*first as usize, k / 2 * 2);
        }
        assert!(welded.moved > 1e-3 && welded.moved < 2e-3);
    }
}
