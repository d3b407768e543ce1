//! The parts of two polygons that face each other.

use std::borrow::Cow;

use glam::DVec3;

use super::prepared::PreparedPolygon;

/// The parts of two polygons in front of each other's planes, both not empty.
pub(super) struct FacingPair<'a> {
    pub(super) first: Part<'a>,
    pub(super) second: Part<'a>,
}

/// What is left of a polygon in front of a plane.
pub(super) struct Part<'a> {
    pub(super) polygon: Cow<'a, PreparedPolygon>,
    /// Of the corners over the other's plane, in m; none is negative.
    pub(super) heights: Heights,
}

impl<'a> FacingPair<'a> {
    /// Returns `None` if no point of either front sees one of the other.
    ///
    /// A corner within 8 ulps (of the largest coordinate) of the other's plane counts as in it, and is neither cut off nor seen.
    pub(super) fn new(first: &'a PreparedPolygon, second: &'a PreparedPolygon) -> Option<Self> {
        let tolerance = 8.0 * f64::EPSILON * (first.extent() + second.extent());
        let first_heights = Heights::new(first, second, tolerance)?;
        let second_heights = Heights::new(second, first, tolerance)?;
        Some(Self {
            first: Part::new(first, first_heights, second),
            second: Part::new(second, second_heights, first),
        })
    }

    /// Returns whether a horizon cut one of the polygons.
    pub(super) fn is_cut(&self) -> bool {
        [&self.first, &self.second]
            .iter()
            .any(|part| matches!(part.polygon, Cow::Owned(_)))
    }

    /// Returns the vector from the first polygon's first corner to the second's.
    pub(super) fn shift(&self) -> DVec3 {
        let [a, b] = [&self.first, &self.second].map(|part| part.polygon.exact_corner(0));
        b.minus(a).to_f64()
    }
}

impl<'a> Part<'a> {
    fn new(polygon: &'a PreparedPolygon, heights: Heights, plane: &PreparedPolygon) -> Self {
        let n = polygon.n_corners();
        if (0..n).all(|k| heights.get(k) >= 0.0) {
            return Self {
                polygon: Cow::Borrowed(polygon),
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
            polygon: Cow::Owned(polygon.part(&corners)),
            heights: Heights::from_fn(corner_heights.len(), |k| corner_heights[k]),
        }
    }
}

/// A height for each corner; the first four need no memory of their own.
pub(super) struct Heights {
    first: [f64; 4],
    others: Vec<f64>,
    mean: f64,
    highest: f64,
}

impl Heights {
    /// Returns the heights of a polygon's corners over a plane, or `None` if none is positive.
    fn new(polygon: &PreparedPolygon, plane: &PreparedPolygon, tolerance: f64) -> Option<Self> {
        let corners = polygon.corners();
        let heights = Self::from_fn(corners.len(), |k| plane.height(corners[k], tolerance));
        (heights.highest > 0.0).then_some(heights)
    }

    fn from_fn(n: usize, height: impl Fn(usize) -> f64) -> Self {
        let mut heights = Self {
            first: [0.0; 4],
            others: Vec::new(),
            mean: 0.0,
            highest: 0.0,
        };
        for (k, place) in heights.first.iter_mut().enumerate().take(n) {
            *place = height(k);
        }
        heights.others.extend((4..n).map(height));
        for &height in heights.first[..n.min(4)].iter().chain(&heights.others) {
            heights.mean += height / n as f64;
            heights.highest = heights.highest.max(height);
        }
        heights
    }

    pub(super) fn get(&self, k: usize) -> f64 {
        if k < 4 { self.first[k] } else { self.others[k - 4] }
    }

    /// The corners' mean height.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// The highest corner's height.
    pub(super) fn highest(&self) -> f64 {
        self.highest
    }
}
