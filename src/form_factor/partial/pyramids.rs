//! Pyramids of directions around a point, and the ranges of directions in which it sees polygons.

use glam::{DVec2, DVec3};

/// The widths of the six pyramids, and the position of a cut in a cell.
///
/// These numbers occur in no scene, so that no edge lies in the side of a cell.
const WIDTHS: DVec3 = DVec3::new(1.0, 1.043_728_173, 0.971_346_289);
const CUT: f64 = 0.487_153_926;

/// The part of a polygon's size within which its edges count as made by a side of a cell.
pub(super) const ON_SIDE: f64 = 1e-14;

/// The extent of a polygon in a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Extent {
    /// The range of directions.
    pub(super) low: DVec2,
    pub(super) high: DVec2,
    /// The range along the axis.
    pub(super) near: f64,
    pub(super) far: f64,
}

/// A pyramid of directions: those whose coordinates u and v, over that along the axis, are in a range.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    /// A unit vector along an axis.
    pub(super) axis: DVec3,
    pub(super) across: [DVec3; 2],
    pub(super) low: DVec2,
    pub(super) high: DVec2,
}

impl Cell {
    /// Returns the six that fill all directions.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        (0..6).map(move |k| {
            let [w, u, v] = [k % 3, (k + 1) % 3, (k + 2) % 3];
            let widths = WIDTHS.to_array();
            let high = DVec2::new(widths[u], widths[v]) / widths[w];
            Self {
                axis: if k < 3 { axes[w] } else { -axes[w] },
                across: [axes[u], axes[v]],
                low: -high,
                high,
            }
        })
    }

    /// Returns the inward normals of its sides.
    pub(super) fn sides(&self) -> [DVec3; 4] {
        let [u, v] = self.across;
        [
            u - self.low.x * self.axis,
            self.high.x * self.axis - u,
            v - self.low.y * self.axis,
            self.high.y * self.axis - v,
        ]
    }

    pub(super) fn corners(&self) -> [DVec3; 4] {
        let at = |u: f64, v: f64| self.axis + u * self.across[0] + v * self.across[1];
        let Self { low, high, .. } = *self;
        [
            at(low.x, low.y),
            at(high.x, low.y),
            at(high.x, high.y),
            at(low.x, high.y),
        ]
    }

    /// Returns both parts of the cell, cut across its longer side, which is `k`, each with the inward normal of the cut.
    pub(super) fn halves(&self) -> (usize, [(Self, DVec3); 2]) {
        let size = self.high - self.low;
        let k = usize::from(size.y > size.x);
        let cut = self.low[k] + CUT * size[k];
        let (mut first, mut second) = (*self, *self);
        first.high[k] = cut;
        second.low[k] = cut;
        let normal = self.across[k] - cut * self.axis;
        (k, [(first, -normal), (second, normal)])
    }

    /// Returns the range of some corners.
    pub(super) fn range(&self, corners: &[DVec3]) -> Extent {
        let mut found = Extent {
            low: DVec2::INFINITY,
            high: DVec2::NEG_INFINITY,
            near: f64::INFINITY,
            far: f64::NEG_INFINITY,
        };
        // Without f64::min and f64::max, which spend time on NaN.
        let (less, more) = (|a, b| if b < a { b } else { a }, |a, b| if b > a { b } else { a });
        for &v in corners {
            let z = self.axis.dot(v);
            let (x, y) = (self.across[0].dot(v) / z, self.across[1].dot(v) / z);
            found.low = DVec2::new(less(found.low.x, x), less(found.low.y, y));
            found.high = DVec2::new(more(found.high.x, x), more(found.high.y, y));
            found.near = less(found.near, z);
            found.far = more(found.far, z);
        }
        found
    }
}

impl Extent {
    /// Returns whether something of this extent may fill a cell.
    pub(super) fn spans(&self, cell: &Cell) -> bool {
        let rounding = ON_SIDE * (cell.high.abs() + cell.low.abs());
        self.low.cmple(cell.low + rounding).all() && self.high.cmpge(cell.high - rounding).all()
    }

    /// Returns whether a polygon of this extent may hide a part of a polygon of another.
    pub(super) fn may_hide(&self, other: &Self) -> bool {
        self.near < other.far && self.low.cmplt(other.high).all() && other.low.cmplt(self.high).all()
    }
}
