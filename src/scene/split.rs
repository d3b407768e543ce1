//! Splits the outline of a face in a file into flat faces: flat convex quads stay, all others become triangles.

use glam::{DVec2, DVec3};

use super::Corners;
use crate::geometry::polygon;

/// The greatest distance of a corner of a flat quad from its plane, in units of the diagonal of the quad's bounding box.
///
/// Exporters commonly write six decimals, so a rotated quad of a metre is flat to about 1e-6 of its size. The
/// remaining bend changes the area by its square.
pub(crate) const PLANARITY: f64 = 1e-6;

/// The kind of an outline.
#[derive(Debug, PartialEq)]
pub(super) enum Outline {
    /// Flat faces, as indices into the outline, each in its winding.
    Faces(Vec<Corners>),
    /// All corners lie on one line.
    ZeroArea,
    /// The outline crosses itself.
    SelfIntersecting,
}

/// Splits an outline of at least three different corners.
///
/// - Triangles, and quads that are flat ([`PLANARITY`]) and strictly convex, stay.
/// - Other quads are cut along a diagonal that leaves both triangles in front: the shorter one, if both do.
/// - Larger outlines, flat or not, are projected along the greatest component of their area vector (an affine image of
///   the projection along the normal) and cut into triangles by ear clipping (`earcut`). Corners on a straight edge are kept, so that neighbours
///   that share them leave no crack.
///
/// The area is zero if no triangle of the fan about the first corner exceeds 8 ε (m + d) d, the rounding error of
/// decimal coordinates, with m the greatest |coordinate|, d the diagonal of the bounding box and ε = 2.2e-16.
pub(super) fn split(corners: &[DVec3]) -> Outline {
    let Some(&first) = corners.first() else {
        return Outline::ZeroArea;
    };
    let low = corners.iter().fold(first, |low, &v| low.min(v));
    let high = corners.iter().fold(first, |high, &v| high.max(v));
    let size = low.distance(high);
    let noise = 8.0 * f64::EPSILON * (low.abs().max(high.abs()).max_element() + size) * size;
    let area_vector = polygon::area_vector(corners);
    if corners[1..]
        .windows(2)
        .all(|w| 0.5 * (w[0] - first).cross(w[1] - first).length() <= noise)
    {
        return Outline::ZeroArea;
    }
    if area_vector.length() <= noise {
        return Outline::SelfIntersecting;
    }
    match corners {
        [_, _, _] => Outline::Faces(vec![Corners::Triangle([0, 1, 2])]),
        &[a, b, c, d] => split_quad([a, b, c, d], area_vector.normalize(), size, noise),
        _ => split_polygon(corners, area_vector, noise),
    }
}

fn split_quad(v: [DVec3; 4], normal: DVec3, size: f64, noise: f64) -> Outline {
    let area = |[i, j, k]: [usize; 3]| 0.5 * (v[j] - v[i]).cross(v[k] - v[i]).dot(normal);
    let in_front = |triangle| area(triangle) > noise;
    let cut_02 = in_front([0, 1, 2]) && in_front([0, 2, 3]);
    let cut_13 = in_front([1, 2, 3]) && in_front([1, 3, 0]);
    if cut_02 && cut_13 && polygon::planarity_error(&v) <= PLANARITY * size {
        return Outline::Faces(vec![Corners::Quad([0, 1, 2, 3])]);
    }
    let shorter_02 = v[0].distance_squared(v[2]) <= v[1].distance_squared(v[3]);
    let triangles = match (cut_02, cut_13) {
        (false, false) => return Outline::SelfIntersecting,
        (true, true) if shorter_02 => [[0, 1, 2], [0, 2, 3]],
        (true, false) => [[0, 1, 2], [0, 2, 3]],
        (_, true) => [[1, 2, 3], [1, 3, 0]],
    };
    Outline::Faces(triangles.map(Corners::Triangle).to_vec())
}

fn split_polygon(corners: &[DVec3], area_vector: DVec3, noise: f64) -> Outline {
    let flat = project(corners, area_vector);
    // Ear clipping would make slivers of corners that are straight up to rounding: they are restored afterwards.
    let n = flat.len();
    let straight = |i: usize| {
        let (before, after) = (flat[i] - flat[(i + n - 1) % n], flat[(i + 1) % n] - flat[i]);
        0.5 * before.perp_dot(after).abs() <= noise
    };
    let bends: Vec<u32> = (0..).zip(0..n).filter(|&(_, i)| !straight(i)).map(|(k, _)| k).collect();
    let mut ears: Vec<usize> = Vec::new();
    let points = bends.iter().map(|&i| flat[i as usize].to_array());
    earcut::Earcut::new().earcut(points, &[], &mut ears);
    let mut triangles = Vec::new();
    for &ear in ears.as_chunks::<3>().0 {
        let [a, b, c] = ear.map(|k| bends[k]);
        let in_front = area_2d(&flat, [a, b, c]) > 0.0;
        triangles.push(if in_front { [a, b, c] } else { [a, c, b] });
    }
    let triangles = without_slivers(restore_straight_corners(triangles, corners.len()), &flat, noise);
    let has_area = |t: [u32; 3]| {
        let [a, b, c] = t.map(|i| corners[i as usize]);
        area_2d(&flat, t) > 0.0 && polygon::area_vector(&[a, b, c]).length() > 0.0
    };
    if !triangles.iter().all(|&t| has_area(t)) {
        return Outline::SelfIntersecting;
    }
    // The projected outline has this area; overlapping or missing ears change the sum.
    let total: f64 = triangles.iter().map(|&t| area_2d(&flat, t)).sum();
    let expected = area_vector.abs().max_element();
    if (total - expected).abs() > noise.max(1e-9 * expected) {
        return Outline::SelfIntersecting;
    }
    Outline::Faces(triangles.into_iter().map(Corners::Triangle).collect())
}

/// Drops the greatest component of the area vector, so that the projected outline is counter-clockwise.
fn project(corners: &[DVec3], area_vector: DVec3) -> Vec<DVec2> {
    let axis = area_vector.abs().max_position();
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let (a, b) = if area_vector[axis] > 0.0 { (a, b) } else { (b, a) };
    // Differences keep the digits of a small face far from the origin.
    corners
        .iter()
        .map(|&v| v - corners[0])
        .map(|v| DVec2::new(v[a], v[b]))
        .collect()
}

fn area_2d(flat: &[DVec2], t: [u32; 3]) -> f64 {
    let [a, b, c] = t.map(|i| flat[i as usize]);
    0.5 * (b - a).perp_dot(c - a)
}

/// Replaces triangles whose corners lie on a line up to rounding: ear clipping cuts one where a corner lies on the line between two others.
///
/// The triangle beyond the longest edge of a sliver is cut in two at the sliver's third corner. Slivers without such a neighbour stay.
fn without_slivers(mut triangles: Vec<[u32; 3]>, flat: &[DVec2], noise: f64) -> Vec<[u32; 3]> {
    let length = |a: u32, b: u32| flat[a as usize].distance_squared(flat[b as usize]);
    let turned = |t: [u32; 3], k: usize| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
    // Every exchange gives a sliver a greater angle, or removes it; the limit ends cycles that rounding causes.
    for _ in 0..2 * triangles.len() {
        let exchange = (0..triangles.len()).find_map(|k| {
            if area_2d(flat, triangles[k]) > noise {
                return None;
            }
            let [from, to, middle] = (0..3)
                .map(|turn| turned(triangles[k], turn))
                .max_by(|s, t| length(s[0], s[1]).total_cmp(&length(t[0], t[1])))?;
            let beyond = |t: &[u32; 3]| (0..3).map(|turn| turned(*t, turn)).find(|t| (t[0], t[1]) == (to, from));
            let (other, [.., apex]) = (0..).zip(&triangles).find_map(|(other, t)| Some((other, beyond(t)?)))?;
            Some((k, other, [[to, middle, apex], [middle, from, apex]]))
        });
        let Some((k, other, [first, second])) = exchange else {
            break;
        };
        triangles[k] = first;
        triangles[other] = second;
    }
    triangles
}

/// Restores the corners on straight edges that ear clipping omits: the triangle at such an edge becomes a fan.
fn restore_straight_corners(triangles: Vec<[u32; 3]>, n_corners: usize) -> Vec<[u32; 3]> {
    let mut used = vec![false; n_corners];
    for i in triangles.iter().flatten() {
        used[*i as usize] = true;
    }
    if used.iter().all(|&u| u) {
        return triangles;
    }
    let after = |i: u32| if i as usize + 1 == n_corners { 0 } else { i + 1 };
    // The corners omitted between a and b, or none if a used one lies between them.
    let left_out = |a: u32, b: u32| {
        let mut between = Vec::new();
        let mut i = after(a);
        while i != b && !used[i as usize] {
            between.push(i);
            i = after(i);
        }
        if i == b { between } else { Vec::new() }
    };
    let mut work = triangles;
    let mut whole = Vec::new();
    while let Some(triangle) = work.pop() {
        let turns = [0, 1, 2].map(|k| {
            let mut turned = triangle;
            turned.rotate_left(k);
            turned
        });
        let Some([from, to, apex]) = turns.into_iter().find(|&[a, b, _]| !left_out(a, b).is_empty()) else {
            whole.push(triangle);
            continue;
        };
        let mut last = from;
        for next in left_out(from, to).into_iter().chain([to]) {
            work.push([last, next, apex]);
            last = next;
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(points: &[[f64; 2]]) -> Vec<DVec3> {
        // The plane is along no axis, so that nothing is exact by chance.
        let (u, v) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.48, 0.8, -0.36));
        points
            .iter()
            .map(|p| DVec3::new(1.0, 2.0, 3.0) + p[0] * u + p[1] * v)
            .collect()
    }

    fn faces(corners: &[DVec3]) -> Vec<Corners> {
        match split(corners) {
            Outline::Faces(faces) => faces,
            other => panic!("expected faces, got {other:?}"),
        }
    }

    fn area_vectors(corners: &[DVec3]) -> Vec<DVec3> {
        let vector = |face: &Corners| {
            let own: Vec<DVec3> = face.as_slice().iter().map(|&i| corners[i as usize]).collect();
            polygon::area_vector(&own)
        };
        faces(corners).iter().map(vector).collect()
    }

    /// Asserts that every face is in front, the areas add up, and each edge of the outline belongs to exactly one face.
    fn assert_tiles(corners: &[DVec3]) {
        let whole = polygon::area_vector(corners);
        let parts = area_vectors(corners);
        assert!(parts.iter().all(|a| a.dot(whole) > 0.0), "{parts:?}");
        let sum: DVec3 = parts.iter().sum();
        assert!(sum.distance(whole) < 1e-14 * whole.length(), "{sum} is not {whole}");
        for i in 0..corners.len() {
            let edge = (i, (i + 1) % corners.len());
            let count = faces(corners)
                .iter()
                .flat_map(|f| {
                    let v = f.as_slice().to_vec();
                    (0..v.len())
                        .map(|k| (v[k] as usize, v[(k + 1) % v.len()] as usize))
                        .collect::<Vec<_>>()
                })
                .filter(|e| *e == edge)
                .count();
            assert_eq!(count, 1, "edge {edge:?}");
        }
    }

    /// A case that the fuzzer found: a corner moved onto the line between its second neighbours.
    #[test]
    fn a_corner_on_the_line_between_others_makes_no_triangle_without_area() {
        let hexagon = |depth: f64| {
            let (x, z) = (0.259_808, 0.15);
            [[0.0, 0.3], [-x, z], [-x, -z], [0.0, depth], [x, -z], [x, z]].map(|[x, z]| DVec3::new(x, 1.95, z))
        };
        // On two lines at once at 0, on none near it.
        for depth in [0.0, 1e-17, -1e-17, 1e-9, -1e-9, 0.1] {
            let corners = hexagon(depth);
            let expected = polygon::area_vector(&corners).length();
            for turn in 0..6 {
                let mut outline = corners;
                outline.rotate_left(turn);
                let areas: Vec<f64> = faces(&outline)
                    .iter()
                    .map(|face| {
                        let Corners::Triangle(t) = face else {
                            panic!("{face:?}: larger outlines become triangles")
                        };
                        polygon::area_vector(&t.map(|i| outline[i as usize])).length()
                    })
                    .collect();
                // 1e-9 m of a slit of 0.3 m, halved.
                assert!(
                    areas.len() == 4 && areas.iter().all(|&area| area > 1e-10),
                    "{depth} {turn}: {areas:?}"
                );
                let total: f64 = areas.iter().sum();
                assert!(
                    (total - expected).abs() < 1e-15,
                    "{depth} {turn}: {total} of {expected}"
                );
            }
        }
    }

    #[test]
    fn a_flat_convex_quad_stays_a_quad() {
        let quad = at(&[[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 2.0]]);
        assert_eq!(faces(&quad), vec![Corners::Quad([0, 1, 2, 3])]);
    }

    #[test]
    fn a_concave_quad_is_cut_at_its_notch_wherever_it_starts() {
        let points = [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]];
        for start in 0..4 {
            let mut turned = points;
            turned.rotate_left(start);
            assert_tiles(&at(&turned));
            assert_eq!(faces(&at(&turned)).len(), 2);
        }
    }

    #[test]
    fn a_quad_with_a_straight_corner_becomes_two_triangles() {
        let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 2.0]];
        for start in 0..4 {
            let mut turned = points;
            turned.rotate_left(start);
            assert_tiles(&at(&turned));
        }
    }

    #[test]
    fn a_bent_quad_is_cut_along_its_shorter_diagonal() {
        let mut quad = at(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [-0.5, 1.0]]);
        // Lifting one corner by h moves each corner about h / 4 away from the mean plane.
        let (flat, normal) = (quad[3], polygon::area_vector(&quad).normalize());
        let low = quad.iter().fold(flat, |low, &v| low.min(v));
        let high = quad.iter().fold(flat, |high, &v| high.max(v));
        let size = low.distance(high);
        quad[3] = flat + 4.8 * PLANARITY * size * normal;
        assert_eq!(
            faces(&quad),
            vec![Corners::Triangle([0, 1, 2]), Corners::Triangle([0, 2, 3])]
        );
        quad.rotate_left(1);
        assert_eq!(
            faces(&quad),
            vec![Corners::Triangle([1, 2, 3]), Corners::Triangle([1, 3, 0])]
        );
        quad[2] = flat + 3.2 * PLANARITY * size * normal;
        assert_eq!(faces(&quad), vec![Corners::Quad([0, 1, 2, 3])]);
    }

    #[test]
    fn a_concave_polygon_is_tiled_from_either_side() {
        let mut star: Vec<[f64; 2]> = (0..10)
            .map(|k| {
                let (s, c) = (std::f64::consts::PI * f64::from(k) / 5.0).sin_cos();
                let r = if k % 2 == 0 { 2.0 } else { 0.6 };
                [r * c, r * s]
            })
            .collect();
        assert_tiles(&at(&star));
        assert_eq!(faces(&at(&star)).len(), 8);
        star.reverse();
        assert_tiles(&at(&star));
    }

    #[test]
    fn corners_on_straight_edges_are_kept() {
        let square = [
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [2.0, 2.0],
            [1.0, 2.0],
            [0.0, 2.0],
            [0.0, 1.0],
        ];
        for axes in [true, false] {
            let corners = if axes {
                square.map(|p| DVec3::new(p[0], p[1], 5.0)).to_vec()
            } else {
                at(&square)
            };
            for start in 0..square.len() {
                let mut turned = corners.clone();
                turned.rotate_left(start);
                assert_tiles(&turned);
            }
        }
    }

    #[test]
    fn a_corner_that_was_left_out_is_put_back() {
        // A triangle 0 2 4 with one corner left out on one edge and two on another.
        let restored = restore_straight_corners(vec![[0, 2, 4]], 7);
        let mut sorted: Vec<[u32; 3]> = restored
            .into_iter()
            .map(|mut t| {
                let least = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
                t.rotate_left(least);
                t
            })
            .collect();
        sorted.sort_unstable();
        // Fans: 1 on edge 0-2, 3 on edge 2-4, 5 and 6 on edge 4-0: five triangles, each edge of the outline once.
        assert_eq!(sorted.len(), 5);
        for edge in (0..7).map(|i| (i, (i + 1) % 7)) {
            let count = sorted
                .iter()
                .flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])))
                .filter(|e| *e == edge)
                .count();
            assert_eq!(count, 1, "edge {edge:?}");
        }
    }

    #[test]
    fn crossing_and_collapsed_outlines_are_told_apart() {
        let bow_tie = at(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(split(&bow_tie), Outline::SelfIntersecting);
        let uneven = at(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]]);
        assert_eq!(split(&uneven), Outline::SelfIntersecting);
        let pentagram: Vec<[f64; 2]> = (0..5)
            .map(|k| (std::f64::consts::PI * 0.8 * f64::from(k)).sin_cos())
            .map(|(s, c)| [c, s])
            .collect();
        assert_eq!(split(&at(&pentagram)), Outline::SelfIntersecting);
        let line = at(&[[0.0, 0.0], [0.1, 0.1], [0.3, 0.3]]);
        assert_eq!(split(&line), Outline::ZeroArea);
    }

    #[test]
    fn a_gap_of_a_millionth_is_no_rounding_error() {
        let sliver = [
            DVec3::ZERO,
            DVec3::X,
            DVec3::new(1.0, 1e-6, 0.0),
            DVec3::new(0.0, 1e-6, 0.0),
        ]
        .map(|v| v + 10.0);
        assert_eq!(faces(&sliver), vec![Corners::Quad([0, 1, 2, 3])]);
    }
}
