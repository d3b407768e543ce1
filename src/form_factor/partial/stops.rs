//! Whether any of some polygons stops a ray between two others.

use std::ops::{ControlFlow, Range};

use glam::DVec3;

use super::flat::Flat;
use super::shadow::EDGE_ON;
use crate::geometry::box_pairs::BoxTree;
use crate::visibility::occluders::Occluder;

/// The fewest polygons, and the fewest rays, for which a tree pays.
const MIN_SCREENS: usize = 24;
const MIN_RAYS: usize = 1024;

/// The margin of a box, as a part of its coordinates, for their rounding.
const MARGIN: f64 = 1e-12;

/// A convex occluder, as a ray meets it.
struct Screen {
    plane: Flat,
    /// The heights up to which the ends of rays on either polygon count as in the plane.
    tolerances: [f64; 2],
    one_sided: bool,
    /// Its edges among those of all.
    edges: Range<usize>,
}

/// The occluders between two polygons, as rays meet them.
pub(super) struct Stops {
    screens: Vec<Screen>,
    /// The corners of all screens, each with a vector that points inwards from the edge that begins there.
    edges: Vec<(DVec3, DVec3)>,
    /// The boxes of all screens, once there are many rays.
    tree: Option<BoxTree>,
}

impl Stops {
    /// Prepares occluders for rays from one polygon to another.
    pub(super) fn new(ends: [&[DVec3]; 2], occluders: &[Occluder<'_>]) -> Self {
        let mut edges = Vec::with_capacity(4 * occluders.len());
        let occluders = occluders.iter().filter(|occluder| occluder.corners.len() >= 3);
        let screens = occluders.map(|occluder| {
            let corners = &occluder.corners;
            let plane = Flat::of(corners);
            let next = corners.iter().cycle().skip(1);
            let first = edges.len();
            edges.extend(corners.iter().zip(next).map(|(&a, &b)| (a, plane.normal.cross(b - a))));
            let tolerance = |end: &[DVec3]| end.iter().map(|&v| plane.tolerance(v, EDGE_ON)).fold(0.0, f64::max);
            Screen {
                plane,
                tolerances: ends.map(tolerance),
                one_sided: occluder.one_sided,
                edges: first..edges.len(),
            }
        });
        Self {
            screens: screens.collect(),
            edges,
            tree: None,
        }
    }

    /// Prepares for a number of rays in all.
    pub(super) fn expect(&mut self, n_rays: usize) {
        if self.tree.is_some() || n_rays < MIN_RAYS || self.screens.len() < MIN_SCREENS {
            return;
        }
        let boxes = self.screens.iter().map(|screen| {
            let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let corners = self.edges[screen.edges.clone()].iter();
            let (low, high) = corners.fold(all, |(low, high), &(v, _)| (low.min(v), high.max(v)));
            let margin = DVec3::splat(MARGIN * low.abs().max(high.abs()).max_element());
            (low - margin, high + margin)
        });
        self.tree = Some(BoxTree::new(boxes.collect()));
    }

    /// Returns whether an occluder stops a ray; the one that stopped the `last` is tested first.
    pub(super) fn stop(&self, ends: [DVec3; 2], last: &mut usize) -> bool {
        if self
            .screens
            .get(*last)
            .is_some_and(|screen| self.is_stopped_by(screen, ends))
        {
            return true;
        }
        let found = match &self.tree {
            None => self.screens.iter().position(|screen| self.is_stopped_by(screen, ends)),
            Some(tree) => self.first_in(tree, ends),
        };
        *last = found.unwrap_or(*last);
        found.is_some()
    }

    fn is_stopped_by(&self, screen: &Screen, [x, y]: [DVec3; 2]) -> bool {
        let (h_x, h_y) = (screen.plane.height(x), screen.plane.height(y));
        let [t_x, t_y] = screen.tolerances;
        let from_front = h_x > t_x && h_y < -t_y;
        let from_back = h_x < -t_x && h_y > t_y;
        // A ray has no direction here: if it leaves a solid, it has entered it.
        if !(from_front || from_back && !screen.one_sided) {
            return false;
        }
        let met = x + (y - x) * (h_x / (h_x - h_y));
        let mut edges = self.edges[screen.edges.clone()].iter();
        edges.all(|&(corner, inward)| inward.dot(met - corner) >= 0.0)
    }

    fn first_in(&self, tree: &BoxTree, ends: [DVec3; 2]) -> Option<usize> {
        let [x, y] = ends;
        // Where a ray is parallel to a side of the boxes, a large number stands for infinity, which times 0 is none.
        let inverse = (y - x).map(|d| if d.abs() < 1e-200 { 1e200 } else { d.recip() });
        let meets = |(low, high): (DVec3, DVec3)| {
            let (to_low, to_high) = ((low - x) * inverse, (high - x) * inverse);
            let begin = to_low.min(to_high).max_element();
            let end = to_low.max(to_high).min_element();
            begin.max(0.0) <= end.min(1.0)
        };
        let found = tree.meeting(&meets, &mut |k| {
            if self.is_stopped_by(&self.screens[k as usize], ends) {
                ControlFlow::Break(k as usize)
            } else {
                ControlFlow::Continue(())
            }
        });
        found.break_value()
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::form_factor::partial::two_sided;
    use crate::geometry::sampling::{PointStream, Sequence};

    #[test]
    fn a_tree_finds_what_a_list_finds() {
        let mut numbers = PointStream::new(Sequence::Random, 1, 0);
        let mut point = || {
            let [x, y, z, _] = numbers.next_point();
            DVec3::new(x, y, z)
        };
        // Turned squares, and some along the axes.
        let squares: Vec<Vec<DVec3>> = (0..300)
            .map(|k| {
                let turn = if k % 3 == 0 {
                    DQuat::IDENTITY
                } else {
                    DQuat::from_scaled_axis(6.0 * point())
                };
                let (middle, a, b) = (0.1 + 0.8 * point(), turn * (0.03 * DVec3::X), turn * (0.03 * DVec3::Y));
                vec![middle - a - b, middle + a - b, middle + a + b, middle - a + b]
            })
            .collect();
        let occluders = two_sided(&squares);
        let level = |z: f64| [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z));
        let (below, above) = (level(0.0), level(1.0));
        let list = Stops::new([&below, &above], &occluders);
        let mut tree = Stops::new([&below, &above], &occluders);
        tree.expect(MIN_RAYS - 1);
        assert!(tree.tree.is_none());
        tree.expect(MIN_RAYS);
        assert!(tree.tree.is_some());
        let mut n_stopped = 0;
        for k in 0..4000 {
            let (mut x, mut y) = (point(), point());
            if k % 4 == 0 {
                // Parallel to an axis, through the middle of a square.
                x = 0.5 * (squares[k % 300][0] + squares[k % 300][2]);
                y = x;
            }
            (x.z, y.z) = (0.0, 1.0);
            let stopped = [&list, &tree].map(|stops| {
                let mut last = usize::MAX;
                stops.stop([x, y], &mut last)
            });
            assert_eq!(stopped[0], stopped[1], "{x} {y}");
            n_stopped += u32::from(stopped[0]);
        }
        assert!((1000..3500).contains(&n_stopped), "{n_stopped}");
    }
}
