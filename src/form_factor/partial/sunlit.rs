//! The part of a polygon that parallel light reaches past occluders, by exact clipping.

use glam::DVec3;

use super::Occluder;
use super::shadow::{Fragments, HalfSpace, subtract};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;

/// The cosine between an occluder's normal and the light below which the occluder is edge on, and shades nothing.
const EDGE_ON: f64 = 1e-14;

/// The part of a polygon that light reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lit {
    /// Its area, m².
    pub(crate) area: f64,
    /// An upper bound of the length of its border, m: that of all pieces that make it up.
    pub(crate) border: f64,
}

/// Returns the part of a convex `region` that light from the unit `direction` reaches past `occluders`.
///
/// The region faces the light, and `normal` is its unit normal.
///
/// The shadow of an occluder is the prism of its part in front of the region's plane along the light. It is cut from the region edge by edge ([`SUTHERLAND_HODGMAN_1974`](crate::references::SUTHERLAND_HODGMAN_1974)
/// with each plane), so that the remaining pieces are convex and disjoint. Accuracy: a few ulps of the coordinates at each cut. Departures: none.
pub(crate) fn lit_part(region: &[DVec3], normal: DVec3, direction: DVec3, occluders: &[Occluder<'_>]) -> Lit {
    let origin = region[0];
    let moved: Vec<DVec3> = region.iter().map(|&v| v - origin).collect();
    let (mut fragments, mut next) = (Fragments::default(), Fragments::default());
    let (mut rest, mut piece, mut half_spaces) = (Vec::new(), Vec::new(), Vec::new());
    fragments.push(&moved);
    for occluder in occluders {
        let above = clip_to_half_space(&occluder.corners, origin, normal);
        if !prism(&above, origin, direction, occluder.one_sided, &mut half_spaces) {
            continue;
        }
        next.clear();
        for fragment in fragments.iter() {
            subtract(fragment, &half_spaces, &mut next, &mut rest, &mut piece);
        }
        std::mem::swap(&mut fragments, &mut next);
    }
    let mut lit = Lit { area: 0.0, border: 0.0 };
    for fragment in fragments.iter() {
        lit.area += polygon::area_vector(fragment).dot(normal).abs();
        lit.border += polygon::perimeter(fragment);
    }
    lit
}

/// Sets the half-spaces whose intersection is the prism of a polygon along the light, seen from `origin`; false if it shades nothing.
fn prism(
    corners: &[DVec3],
    origin: DVec3,
    direction: DVec3,
    one_sided: bool,
    half_spaces: &mut Vec<HalfSpace>,
) -> bool {
    if corners.len() < 3 {
        return false;
    }
    let area = polygon::area_vector(corners);
    let facing = area.dot(direction);
    // Light that meets the back of a solid's side has met another side's front.
    if facing.abs() <= EDGE_ON * area.length() || (one_sided && facing < 0.0) {
        return false;
    }
    half_spaces.clear();
    let starts = std::iter::once(&corners[corners.len() - 1]).chain(corners);
    for (&from, &to) in starts.zip(corners) {
        let along = to - from;
        // Seen from the light a front runs counter-clockwise: its inner side is on the left.
        let inward = direction.cross(along) * facing.signum();
        let from = from - origin;
        let slack = 1e-15 * along.abs().element_sum();
        half_spaces.push(HalfSpace {
            normal: inward,
            offset: -inward.dot(from),
            slack: [slack * from.abs().element_sum(), slack],
        });
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::partial::two_sided;

    fn square(corner: DVec3, side: f64) -> Vec<DVec3> {
        vec![
            corner,
            corner + DVec3::X * side,
            corner + DVec3::new(side, side, 0.0),
            corner + DVec3::Y * side,
        ]
    }

    fn lit(plates: &[Vec<DVec3>], direction: DVec3) -> f64 {
        let occluders = two_sided(plates);
        lit_part(&square(DVec3::ZERO, 4.0), DVec3::Z, direction.normalize(), &occluders).area
    }

    /// Plates of 1 m at a height of 1 m: their shadows move by the slope of the light, and count once where they overlap.
    #[test]
    fn a_plate_shades_its_own_size_where_the_light_takes_it() {
        let plate = square(DVec3::new(1.0, 1.0, 1.0), 1.0);
        let turned: Vec<DVec3> = plate.iter().rev().copied().collect();
        let beside = square(DVec3::new(1.5, 1.0, 2.0), 1.0);
        let below = square(DVec3::new(1.0, 1.0, -1.0), 1.0);
        for (plates, direction, expected) in [
            (vec![plate.clone()], DVec3::Z, 15.0),
            (vec![turned.clone()], DVec3::Z, 15.0),
            (vec![below, turned], DVec3::Z, 15.0),
            (vec![plate.clone()], DVec3::new(0.5, 0.0, 1.0), 15.0),
            // Half of the shadow falls beside the square.
            (vec![plate.clone()], DVec3::new(1.5, 0.0, 1.0), 15.5),
            (vec![plate.clone(), beside.clone()], DVec3::Z, 14.5),
            (
                vec![plate.clone(), beside.clone(), plate.clone()],
                DVec3::new(0.5, 0.0, 1.0),
                15.0,
            ),
            (vec![], DVec3::new(0.1, 0.0, 1.0), 16.0),
            (vec![square(DVec3::new(-9.0, -9.0, 0.5), 20.0)], DVec3::Z, 0.0),
        ] {
            let found = lit(&plates, direction);
            assert!(
                (found - expected).abs() < 1e-13,
                "{plates:?} {direction}: {found} {expected}"
            );
        }
    }

    /// A wall that pierces the square shades by its upper part alone.
    #[test]
    fn what_is_below_the_plane_shades_nothing() {
        let wall = vec![
            DVec3::new(2.0, 1.0, -5.0),
            DVec3::new(2.0, 2.0, -5.0),
            DVec3::new(2.0, 2.0, 0.5),
            DVec3::new(2.0, 1.0, 0.5),
        ];
        assert!((lit(std::slice::from_ref(&wall), DVec3::new(1.0, 0.0, 1.0)) - 15.5).abs() < 1e-13);
        assert!((lit(&[wall], DVec3::Z) - 16.0).abs() < 1e-13);
    }
}
