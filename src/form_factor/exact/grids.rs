//! Regular grids of patches in meshes that come already cut: faces of one plane that are translations of one another.

use std::collections::HashMap;

use glam::{DMat2, DVec2, DVec3};

use super::lattice::Lattice;
use super::patches::{FacePatches, Patches};

/// The fewest patches of a grid.
const MIN_PATCHES: usize = 4;

/// The part of the smallest patch's size below which edges that differ count as equal.
const ALIKE: f64 = 1e-6;

/// The greatest distance of a corner from its position in a grid, as a part of the smallest patch's size.
const OFF: f64 = 1e-6;

/// The most positions of a grid for each of its patches.
const MAX_PLACES: usize = 8;

/// The most grids of patches of one shape in one plane.
const MAX_GRIDS: usize = 256;

/// The grids that faces of one patch each make.
pub(super) struct Grids {
    pub(super) grids: Vec<Lattice>,
    /// The grid of each patch.
    of_patch: Vec<Option<u32>>,
}

/// The properties that patches of one grid have in common: the number of corners, two edges, and the distance of the plane from the origin, in units of a length.
type Shape = (usize, [i64; 7]);

impl Grids {
    /// Finds the grids whose corners are off their positions by no more than `most`, m. Work: O(n log n).
    ///
    /// The patches of a grid may come in any order and begin at any corner, and a grid may have holes. The steps of a grid are two edges of its patches: of parallelograms, or of triangles of which two make one.
    pub(super) fn find(patches: &Patches, most: f64) -> Self {
        let unit = ALIKE * patches.least_reach();
        let most = most.min(OFF * patches.least_reach());
        let mut grids = Self {
            grids: Vec::new(),
            of_patch: vec![None; patches.len()],
        };
        if !(unit > 0.0 && unit.is_finite()) {
            return grids;
        }
        let mut alike: HashMap<Shape, Vec<(u32, usize)>> = HashMap::new();
        for face in patches
            .faces
            .iter()
            .map(FacePatches::range)
            .filter(|range| range.len() == 1)
        {
            let (shape, first) = shape(&patches.corners[face.start], unit);
            if let Ok(patch) = u32::try_from(face.start) {
                alike.entry(shape).or_default().push((patch, first));
            }
        }
        let mut alike: Vec<Vec<(u32, usize)>> = alike.into_values().filter(|own| own.len() >= MIN_PATCHES).collect();
        alike.sort_unstable();
        for mut own in alike {
            for _ in 0..MAX_GRIDS {
                if own.len() < MIN_PATCHES {
                    break;
                }
                own = grids.take_grid(patches, own, most);
            }
        }
        grids
    }

    /// Returns the grid of a patch.
    pub(super) fn of(&self, patch: usize) -> Option<u32> {
        self.of_patch[patch]
    }

    /// Takes the grid of the first of some patches, each with its first corner; returns the others.
    fn take_grid(&mut self, patches: &Patches, own: Vec<(u32, usize)>, most: f64) -> Vec<(u32, usize)> {
        let corner = |(patch, first): (u32, usize), k: usize| {
            let corners = &patches.corners[patch as usize];
            corners[(first + k) % corners.len()]
        };
        let base = own[0];
        let origin = corner(base, 0);
        let mut edges = [0, 1, 2].map(|k| corner(base, k + 1) - corner(base, k));
        if patches.corners[base.0 as usize].len() == 3 {
            // The sides of the parallelogram that two triangles make, rather than its diagonal.
            edges.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        }
        let edges = [edges[0], edges[1]];
        let gram = DMat2::from_cols(
            DVec2::new(edges[0].dot(edges[0]), edges[0].dot(edges[1])),
            DVec2::new(edges[0].dot(edges[1]), edges[1].dot(edges[1])),
        );
        let solve = gram.inverse();
        let place = |patch: (u32, usize)| {
            let r = corner(patch, 0) - origin;
            let at = solve * DVec2::new(edges[0].dot(r), edges[1].dot(r));
            let whole = at.round();
            let is_at =
                (r - edges[0] * whole.x - edges[1] * whole.y).length() <= most * (1.0 + whole.abs().max_element());
            is_at.then_some(whole)
        };
        let (mut members, mut others) = (Vec::new(), Vec::new());
        for patch in own {
            match place(patch) {
                Some(at) => members.push((patch, at)),
                None => others.push(patch),
            }
        }
        if let Some(grid) = lattice(&members, edges, &corner, patches, most) {
            let number = u32::try_from(self.grids.len()).ok();
            for (patch, _) in &members {
                self.of_patch[patch.0 as usize] = number;
            }
            self.grids.push(grid);
        }
        others
    }
}

/// Returns the shape of a patch and the corner at which it begins: that of the greatest edge, so that the first corner in the file does not matter.
fn shape(corners: &[DVec3], unit: f64) -> (Shape, usize) {
    let n = corners.len();
    let rounded = |x: f64| {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a whole number; what is beyond its range is alike with nothing"
        )]
        let whole = (x / unit).round() as i64;
        whole
    };
    let edge = |k: usize| (corners[(k + 1) % n] - corners[k % n]).to_array().map(rounded);
    let first = (0..n).max_by_key(|&k| edge(k)).unwrap_or(0);
    let (along, next) = (edge(first), edge(first + 1));
    let normal = crate::geometry::polygon::area_vector(corners).normalize_or_zero();
    let height = rounded(normal.dot(corners[first]));
    let shape = [along[0], along[1], along[2], next[0], next[1], next[2], height];
    ((n, shape), first)
}

/// Returns the lattice of some patches at whole steps; `None` for too few patches, or corners off by more than `most`, m.
fn lattice(
    members: &[((u32, usize), DVec2)],
    edges: [DVec3; 2],
    corner: &impl Fn((u32, usize), usize) -> DVec3,
    patches: &Patches,
    most: f64,
) -> Option<Lattice> {
    if members.len() < MIN_PATCHES {
        return None;
    }
    let count = members.len() as f64;
    let least = members
        .iter()
        .fold(DVec2::INFINITY, |least, member| least.min(member.1));
    let greatest = members
        .iter()
        .fold(DVec2::NEG_INFINITY, |greatest, member| greatest.max(member.1));
    let size = greatest - least + 1.0;
    if size.x * size.y > (MAX_PLACES * members.len()) as f64 {
        return None;
    }
    // The steps of the best fit: from the mean, by least squares.
    let middle = members.iter().map(|member| member.1).sum::<DVec2>() / count;
    let centre = members.iter().map(|member| corner(member.0, 0)).sum::<DVec3>() / count;
    let (mut squares, mut moments) = ([0.0; 3], [DVec3::ZERO; 2]);
    for &(patch, at) in members {
        let (d, r) = (at - middle, corner(patch, 0) - centre);
        squares = [squares[0] + d.x * d.x, squares[1] + d.x * d.y, squares[2] + d.y * d.y];
        moments = [moments[0] + d.x * r, moments[1] + d.y * r];
    }
    let [xx, xy, yy] = squares;
    let steps = match (xx > 0.0, yy > 0.0) {
        (true, true) if xx * yy - xy * xy > 1e-9 * xx * yy => {
            let scale = 1.0 / (xx * yy - xy * xy);
            [
                (moments[0] * yy - moments[1] * xy) * scale,
                (moments[1] * xx - moments[0] * xy) * scale,
            ]
        }
        (true, false) => [moments[0] / xx, edges[1]],
        (false, true) => [edges[0], moments[1] / yy],
        _ => edges,
    };
    let n = patches.corners[members[0].0.0 as usize].len();
    // The mean patch, at the mean position.
    let mean: Vec<DVec3> = (0..n)
        .map(|k| members.iter().map(|member| corner(member.0, k)).sum::<DVec3>() / count)
        .collect();
    let (mut off, mut extent) = (0.0_f64, 0.0_f64);
    for &(patch, at) in members {
        let d = at - middle;
        for (k, own) in mean.iter().enumerate() {
            let v = corner(patch, k);
            extent = extent.max(v.abs().max_element());
            off = off.max((v - *own - d.x * steps[0] - d.y * steps[1]).abs().max_element());
        }
    }
    if off > most {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole numbers from 0 on, fewer than patches"
    )]
    let places = members.iter().map(|&((patch, _), at)| {
        let at = at - least;
        (patch, [at.x as u32, at.y as u32])
    });
    let places: Vec<(u32, [u32; 2])> = places.collect();
    // Two patches at one position make no grid.
    let mut taken: Vec<[u32; 2]> = places.iter().map(|place| place.1).collect();
    taken.sort_unstable();
    taken.dedup();
    (taken.len() == places.len()).then(|| Lattice::of_cells(places, steps, extent, off))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::DQuat;

    use super::super::lattice::Repeats;
    use super::*;
    use crate::form_factor::facing::Facing;
    use crate::form_factor::pairs::Exchange;
    use crate::geometry::polygon_form_factor::{Tolerance, exchange_area};
    use crate::mesh::{Mesh, Subdivision};
    use crate::scene::{Material, SceneBuilder};

    /// The walls of a box cut into quads or pairs of triangles, turned, in a random order, with some left out, each beginning at any corner.
    fn box_of(n: u32, triangles: bool, off: f64) -> Patches {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 0.7);
        let mut faces: Vec<Vec<DVec3>> = Vec::new();
        let [x, y, z] = [DVec3::X * 4.0, DVec3::Y * 3.0, DVec3::Z * 2.5];
        let walls = [
            (DVec3::ZERO, x, y),
            (z, y, x),
            (DVec3::ZERO, y, z),
            (x, z, y),
            (DVec3::ZERO, z, x),
            (y, x, z),
        ];
        let mut state = 12345_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        for (origin, u, v) in walls {
            for i in 0..n {
                for j in 0..n {
                    let mut at = |a: u32, b: u32| {
                        let place = origin + u * (f64::from(a) / f64::from(n)) + v * (f64::from(b) / f64::from(n));
                        turn * place + off * DVec3::new(random() - 0.5, random() - 0.5, random() - 0.5)
                    };
                    let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    if triangles {
                        faces.extend([vec![quad[0], quad[1], quad[2]], vec![quad[0], quad[2], quad[3]]]);
                    } else if (i, j) != (1, 2) {
                        faces.push(quad.to_vec());
                    }
                }
            }
        }
        for k in (1..faces.len()).rev() {
            let other = (random() * k as f64).floor();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a place in a list"
            )]
            faces.swap(k, other as usize);
            let n_corners = faces[k].len();
            faces[k].rotate_left(k % n_corners);
        }
        let mut builder = SceneBuilder::new();
        let surface = builder.surface("walls").unwrap();
        let grey = builder
            .material(Material {
                name: "grey".into(),
                reflectance: [0.5; 3],
                exitance: [0.0; 3],
            })
            .unwrap();
        for (line, face) in (0..).zip(&faces) {
            builder.face(face, surface, grey, line).unwrap();
        }
        let scene = builder.build().unwrap().scene;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(1)).unwrap();
        Patches::new(&mesh, &Facing::new(&mesh), true)
    }

    fn exchange(patches: &Patches, i: usize, j: usize) -> Exchange {
        let exact = exchange_area(&patches.prepared[i], &patches.prepared[j], Tolerance::default());
        Exchange {
            area: exact.value,
            error: exact.error,
        }
    }

    #[test]
    fn grids_are_found_in_any_order_and_their_tables_hold_what_they_state() {
        for (n, triangles, off) in [(8, false, 0.0), (8, true, 0.0), (8, false, 1e-12), (8, true, 1e-12)] {
            let patches = box_of(n, triangles, off);
            let grids = Grids::find(&patches, 1e-8);
            assert_eq!(
                grids.grids.len(),
                if triangles { 12 } else { 6 },
                "{n} {triangles} {off}"
            );
            assert!((0..patches.len()).all(|patch| grids.of(patch).is_some()));
            let mut n_tables = 0;
            for (a, from) in (0..).zip(&grids.grids) {
                for (b, to) in (0..).zip(&grids.grids).skip(a as usize + 1) {
                    let Some(table) = Repeats::empty(from, to) else {
                        continue;
                    };
                    n_tables += 1;
                    let of = |grid: u32| -> Vec<usize> {
                        (0..patches.len()).filter(|&k| grids.of(k) == Some(grid)).collect()
                    };
                    for i in of(a) {
                        for j in of(b) {
                            let repeated = table.get_or(&patches, (i, j), |i, j| exchange(&patches, i, j));
                            let own = exchange(&patches, i, j);
                            let differs_by = (repeated.area - own.area).abs();
                            assert!(
                                differs_by <= repeated.error + own.error,
                                "{i} {j}: {repeated:?} {own:?}"
                            );
                        }
                    }
                }
            }
            assert!(n_tables >= 15, "{n_tables}");
        }
    }

    #[test]
    fn corners_that_are_off_by_more_are_no_grid() {
        let patches = box_of(4, false, 1e-7);
        assert!(Grids::find(&patches, 1e-8).grids.is_empty());
    }
}
