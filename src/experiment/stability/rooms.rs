//! Form factors in closed form, made without a scene.

use glam::DVec3;

use crate::experiment::ExperimentError;
use crate::geometry::rectangle::rectangle_exchange_area;
use crate::geometry::sampling::{PointStream, Sequence};
use crate::matrix::{Entry, FormFactors, RowTally, RowTile, StorageChoice};

/// Cuts a parallelogram into n × n patches, counter-clockwise where `u` × `v` points to the front.
fn grid(origin: DVec3, u: DVec3, v: DVec3, n: u32) -> impl Iterator<Item = [DVec3; 4]> {
    let at = move |a: u32, b: u32| origin + u * (f64::from(a) / f64::from(n)) + v * (f64::from(b) / f64::from(n));
    (0..n * n).map(move |k| {
        let (a, b) = (k / n, k % n);
        [at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)]
    })
}

/// Returns the patches of a cube of the given edge, n × n on each side, all facing inwards; the last n² are the ceiling.
pub(super) fn cube(edge: f64, n: u32) -> Vec<[DVec3; 4]> {
    cuboid(DVec3::splat(edge), n)
}

/// Returns the patches of a cuboid with the given edges, n × n on each side, like [`cube`].
pub(super) fn cuboid(edges: DVec3, n: u32) -> Vec<[DVec3; 4]> {
    let [x, y, z] = [DVec3::X * edges.x, DVec3::Y * edges.y, DVec3::Z * edges.z];
    let o = DVec3::ZERO;
    let sides = [(o, y, z), (x, z, y), (o, z, x), (y, x, z), (o, x, y), (z, y, x)];
    sides
        .into_iter()
        .flat_map(|(origin, u, v)| grid(origin, u, v, n))
        .collect()
}

/// Returns two unit squares of n × n patches that face each other across a gap.
pub(super) fn plates(gap: f64, n: u32) -> Vec<[DVec3; 4]> {
    let low = grid(DVec3::ZERO, DVec3::X, DVec3::Y, n);
    low.chain(grid(DVec3::Z * gap, DVec3::Y, DVec3::X, n)).collect()
}

/// Returns the form factors of rectangles without occluders; each factor is multiplied by `factor`.
pub(super) fn form_factors(
    patches: &[[DVec3; 4]],
    factor: f64,
    storage: StorageChoice,
) -> Result<FormFactors, ExperimentError> {
    let area = |p: &[DVec3; 4]| (p[1] - p[0]).cross(p[3] - p[0]).length();
    let mut upper = RowTile::new(0);
    for (i, from) in patches.iter().enumerate() {
        let others = (0_u32..).zip(patches).skip(i + 1);
        let entries: Vec<Entry> = others
            .map(|(j, to)| {
                (
                    j,
                    factor * rectangle_exchange_area(from, to).unwrap_or(0.0).max(0.0),
                    0.0,
                )
            })
            .collect();
        upper.push_row(&entries, RowTally::default());
    }
    let areas = patches.iter().map(area).collect();
    Ok(FormFactors::from_exchange_tiles(areas, [upper], storage)?)
}

/// Returns the form factors of the parts of a sphere's inside: F_ij = A_j / Σ A, for any shape.
pub(super) fn sphere(areas: Vec<f64>) -> Result<FormFactors, ExperimentError> {
    let total: f64 = areas.iter().sum();
    let mut upper = RowTile::new(0);
    for (i, a) in areas.iter().enumerate() {
        let others = (0_u32..).zip(&areas).skip(i);
        let entries: Vec<Entry> = others.map(|(j, b)| (j, a * b / total, 0.0)).collect();
        upper.push_row(&entries, RowTally::default());
    }
    Ok(FormFactors::from_exchange_tiles(
        areas,
        [upper],
        StorageChoice::default(),
    )?)
}

/// Returns separate rooms, mutually hidden.
pub(super) fn side_by_side(rooms: &[&FormFactors]) -> Result<FormFactors, ExperimentError> {
    let areas: Vec<f64> = rooms.iter().flat_map(|room| room.areas().iter().copied()).collect();
    let mut upper = RowTile::new(0);
    let mut columns = 0_u32..;
    for room in rooms {
        let own: Vec<u32> = columns.by_ref().take(room.n_rows()).collect();
        for (i, a) in room.areas().iter().enumerate() {
            let entries: Vec<Entry> = own[i..]
                .iter()
                .zip(i..)
                .map(|(&column, j)| (column, a * room.get(i, j), 0.0))
                .collect();
            upper.push_row(&entries, RowTally::default());
        }
    }
    Ok(FormFactors::from_exchange_tiles(
        areas,
        [upper],
        StorageChoice::default(),
    )?)
}

/// Returns the result of shooting `n_rays` rays from every patch of a closed room: row i is a sample of n_rays draws with the probabilities F_ij.
pub(super) fn shot(room: &FormFactors, n_rays: u32, seed: u64) -> Result<FormFactors, ExperimentError> {
    let n = room.n_rows();
    let mut tile = RowTile::new(0);
    for i in 0..n {
        let mut reached = Vec::with_capacity(n);
        let mut sum = 0.0;
        room.for_each_in_row(i, |j, f, _| {
            sum += f;
            reached.push((j, sum));
        });
        let mut stream = PointStream::new(Sequence::Random, seed, i as u64);
        let mut counts = vec![0_u32; n];
        for _ in 0..n_rays {
            let [u, ..] = stream.next_point();
            let hit = reached
                .partition_point(|&(_, below)| below <= u * sum)
                .min(reached.len() - 1);
            counts[reached[hit].0] += 1;
        }
        let share = |(j, &count): (u32, &u32)| {
            let f = f64::from(count) / f64::from(n_rays);
            (j, f, (f * (1.0 - f) / f64::from(n_rays)).sqrt())
        };
        let entries: Vec<Entry> = (0..).zip(&counts).map(share).collect();
        let tally = RowTally {
            n_rays: u64::from(n_rays),
            ..RowTally::default()
        };
        tile.push_row(&entries, tally);
    }
    Ok(FormFactors::from_tiles(
        room.areas().to_vec(),
        [tile],
        StorageChoice::default(),
    )?)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn closed_rooms_are_closed_and_facing_plates_see_each_other() {
        let room = form_factors(&cube(2.0, 3), 1.0, StorageChoice::default()).unwrap();
        assert!((0..54).all(|i| (room.row_sum(i) - 1.0).abs() < 1e-13));
        let sphere = sphere(vec![1e-8, 0.5, 3.0]).unwrap();
        assert!((0..3).all(|i| (sphere.row_sum(i) - 1.0).abs() < 1e-15));
        let gap = form_factors(&plates(0.01, 4), 1.0, StorageChoice::default()).unwrap();
        assert!(gap.get(5, 16 + 5) + gap.get(5, 16 + 6) > 0.9 || gap.row_sum(5) > 0.97);
        let two = side_by_side(&[&room, &sphere]).unwrap();
        assert!((two.row_sum(55) - 1.0).abs() < 1e-14 && two.get(0, 56).abs() <= 0.0);
        let shot = shot(&room, 1000, 1).unwrap();
        assert!((0..54).all(|i| (shot.row_sum(i) - 1.0).abs() < 1e-13));
        assert!((shot.get(0, 30) - room.get(0, 30)).abs() < 5.0 * (room.get(0, 30) / 1000.0).sqrt() + 1e-3);
    }
}
