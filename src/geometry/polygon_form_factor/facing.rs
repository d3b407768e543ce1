//! The parts of two polygons that face each other.

use std::ops::Deref;

use glam::DVec3;

use super::prepared::PreparedPolygon;

/// The part of a polygon's radius above which a height is real, whatever the other polygon's coordinates.
const MIN_HEIGHT: f64 = 1e-9;

/// The parts of two polygons in front of each other's planes, both not empty.
pub(super) struct FacingPair<'a> {
    pub(super) first: Part<'a>,
    pub(super) second: Part<'a>,
    /// From the first part's first corner to the second's.
    pub(super) shift: DVec3,
}

/// The part of a polygon in front of a plane.
pub(super) struct Part<'a> {
    pub(super) polygon: WholeOrCut<'a>,
    /// The heights of the corners over the other's plane, in m; none is negative.
    pub(super) heights: Heights,
}

/// A polygon that was not cut, or the rest of one.
pub(super) enum WholeOrCut<'a> {
    Whole(&'a PreparedPolygon),
    Cut(Box<PreparedPolygon>),
}

impl Deref for WholeOrCut<'_> {
    type Target = PreparedPolygon;
    fn deref(&self) -> &PreparedPolygon {
        match self {
            Self::Whole(polygon) => polygon,
            Self::Cut(polygon) => polygon,
        }
    }
}

impl<'a> FacingPair<'a> {
    /// Returns the parts, or `None` if no point of either front sees one of the other.
    ///
    /// A corner within 8 ulps (of the largest coordinate) of the other's plane counts as in it, and is neither cut off nor seen. Where that is more than
    /// a billionth of the size of the corner's polygon, the billionth counts instead, so that a very large polygon sees one that stands on it.
    pub(super) fn new(first: &'a PreparedPolygon, second: &'a PreparedPolygon) -> Option<Self> {
        let has_area = |polygon: &PreparedPolygon| polygon.area() > 0.0 && polygon.area().is_finite();
        if !has_area(first) || !has_area(second) {
            return None;
        }
        let ulps = 8.0 * f64::EPSILON * (first.extent() + second.extent());
        let tolerance = |of: &PreparedPolygon| ulps.min(MIN_HEIGHT * of.radius());
        let first_heights = Heights::new(first, second, tolerance(first))?;
        let second_heights = Heights::new(second, first, tolerance(second))?;
        let first_part = Part::new(first, first_heights, second);
        let second_part = Part::new(second, second_heights, first);
        let shift = first_part.polygon.to_first_corner_of(&second_part.polygon);
        Some(Self {
            first: first_part,
            second: second_part,
            shift,
        })
    }
}

impl<'a> Part<'a> {
    fn new(polygon: &'a PreparedPolygon, heights: Heights, plane: &PreparedPolygon) -> Self {
        let n = polygon.n_corners();
        if (0..n).all(|k| heights.get(k) >= 0.0) {
            return Self {
                polygon: WholeOrCut::Whole(polygon),
                heights,
            };
        }
        // Cut each edge at most once (Sutherland and Hodgman 1974), with the digits that a thin remainder needs.
        let (mut corners, mut corner_heights) = (Vec::with_capacity(n + 1), Vec::with_capacity(n + 1));
        for k in 0..n {
            let next = (k + 1) % n;
            let (height, next_height) = (heights.get(k), heights.get(next));
            let (corner, next_corner) = (polygon.exact_corner(k), polygon.exact_corner(next));
            if height >= 0.0 {
                corners.push(corner);
                corner_heights.push(height);
            }
            if height * next_height < 0.0 {
                let (a, b) = (plane.exact_height(corner), plane.exact_height(next_corner));
                corners.push(corner.plus(a / (a - b), next_corner.minus(corner)));
                corner_heights.push(0.0);
            }
        }
        Self {
            polygon: WholeOrCut::Cut(Box::new(polygon.part(&corners))),
            heights: Heights::from_fn(corner_heights.len(), |k| corner_heights[k]),
        }
    }
}

/// A height for each corner; the first four need no memory of their own.
pub(super) struct Heights {
    first: [f64; 4],
    others: Vec<f64>,
    mean: f64,
    lowest: f64,
    highest: f64,
}

impl Heights {
    /// Returns the heights of a polygon's corners over a plane, or `None` if none is positive.
    fn new(polygon: &PreparedPolygon, plane: &PreparedPolygon, tolerance: f64) -> Option<Self> {
        let corners = polygon.corners();
        let heights = Self::from_fn(corners.len(), |k| plane.height(&corners[k], tolerance));
        (heights.highest > 0.0).then_some(heights)
    }

    fn from_fn(n: usize, height_of: impl Fn(usize) -> f64) -> Self {
        let mut heights = Self {
            first: [0.0; 4],
            others: Vec::new(),
            mean: 0.0,
            lowest: f64::INFINITY,
            highest: 0.0,
        };
        for (k, place) in heights.first.iter_mut().enumerate().take(n) {
            *place = height_of(k);
        }
        heights.others.extend((4..n).map(height_of));
        for &height in heights.first[..n.min(4)].iter().chain(&heights.others) {
            heights.mean += height;
            heights.lowest = heights.lowest.min(height);
            heights.highest = heights.highest.max(height);
        }
        heights.mean /= n as f64;
        heights
    }

    pub(super) fn get(&self, k: usize) -> f64 {
        if k < 4 { self.first[k] } else { self.others[k - 4] }
    }

    /// The corners' mean height.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The lowest corner's height.
    pub(super) fn lowest(&self) -> f64 {
        self.lowest
    }

    /// The variation of the heights, from 0 to 1: (highest − lowest)/highest.
    pub(super) fn variation(&self) -> f64 {
        1.0 - self.lowest / self.highest
    }

    /// The highest corner's height.
    pub(super) fn highest(&self) -> f64 {
        self.highest
    }
}
