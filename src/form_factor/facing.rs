//! The patches as polygons, and which of them face each other.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use crate::geometry::polygon_form_factor::PreparedPolygon;
use crate::mesh::{Mesh, PatchId};
use crate::threads;

/// Returns the patches as polygons for [`exchange_area`](crate::geometry::polygon_form_factor::exchange_area).
pub(super) fn prepared(mesh: &Mesh) -> Vec<PreparedPolygon> {
    polygons(mesh, PreparedPolygon::new)
}

/// Maps the corners of each patch.
pub(super) fn polygons<T>(mesh: &Mesh, map: impl Fn(&[DVec3]) -> T) -> Vec<T> {
    (0..mesh.n_patches())
        .map(|i| map(&mesh.polygon(PatchId::from_index(i))))
        .collect()
}

/// The planes of all patches and their corners, for the first test of a pair.
#[derive(Debug)]
pub(super) struct Facing {
    corners: Arc<[Vec<DVec3>]>,
    normals: Vec<DVec3>,
    sizes: Vec<f64>,
}

impl Facing {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let corners: Vec<Vec<DVec3>> = threads::collect(mesh.n_patches(), |i| mesh.polygon(PatchId::from_index(i)));
        let sizes = threads::collect_from(&corners, |c| c.iter().map(|v| v.distance(c[0])).fold(0.0, f64::max));
        Self {
            corners: corners.into(),
            normals: mesh.patches.iter().map(|p| p.normal).collect(),
            sizes,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.corners.len()
    }

    /// Returns the corners of all patches, in m.
    pub(super) fn corners(&self) -> &Arc<[Vec<DVec3>]> {
        &self.corners
    }

    /// Returns the patches for the closed forms.
    pub(super) fn polygons(&self) -> Vec<PreparedPolygon> {
        self.corners
            .iter()
            .map(|corners| PreparedPolygon::new(corners))
            .collect()
    }

    /// Returns whether part of each patch lies in front of the other's plane.
    ///
    /// A corner counts as in front from 1e-14 of its distance and the patch's size on: below that, rounding decides the sign, and
    /// patches of one plane must differ from patches that meet at an edge. A billionth of the size of the patch whose corner it is suffices, however large the other is.
    pub(super) fn pair(&self, i: usize, j: usize) -> bool {
        self.sees(i, j) && self.sees(j, i)
    }

    /// Returns whether any patch of one flat range may see any of another, and the reverse.
    pub(super) fn any(&self, from: Range<usize>, to: Range<usize>) -> bool {
        let sees = |i: usize, mut others: Range<usize>| others.any(|j| self.sees(i, j));
        sees(from.start, to.clone()) && sees(to.start, from)
    }

    /// Returns the unit normal of a patch.
    pub(super) fn normal(&self, i: usize) -> DVec3 {
        self.normals[i]
    }

    /// Returns whether each of `others` is in front of a flat range of patches.
    ///
    /// True if part of it lies in front of every patch, false if all of it lies behind each; `None` where that is uncertain, and pairs are tested one by one.
    pub(super) fn in_front(&self, of: Range<usize>, others: Range<usize>) -> Vec<Option<bool>> {
        let (origin, normal) = (self.corners[of.start][0], self.normals[of.start]);
        // The distance of the patches' own planes from the first one's: shifted, and turned.
        let (mut shifted, mut turned, mut reach) = (0.0_f64, 0.0_f64, 0.0_f64);
        for i in of {
            let to = self.corners[i][0] - origin;
            shifted = shifted.max(normal.dot(to).abs());
            turned = turned.max(self.normals[i].distance(normal));
            reach = reach.max(to.length() + self.sizes[i]);
        }
        let sides = others.map(|j| {
            let (mut before, mut behind) = (false, true);
            for &v in &self.corners[j] {
                let to = v - origin;
                let slack = shifted + (turned + 1e-13) * (to.length() + reach);
                let height = normal.dot(to);
                before |= height > slack;
                behind &= height < -slack;
            }
            (before || behind).then_some(before)
        });
        sides.collect()
    }

    /// Returns whether all of patch j lies in front of the plane of patch i, or on it.
    pub(super) fn is_in_front(&self, i: usize, j: usize) -> bool {
        let (origin, normal) = (self.corners[i][0], self.normals[i]);
        let slack = 1e-9 * self.sizes[j];
        self.corners[j].iter().all(|&v| normal.dot(v - origin) >= -slack)
    }

    fn sees(&self, i: usize, j: usize) -> bool {
        let (origin, normal) = (self.corners[i][0], self.normals[i]);
        let enough = 1e-9 * self.sizes[j];
        self.corners[j].iter().any(|&v| {
            let to = v - origin;
            let height = normal.dot(to);
            height > 1e-14 * (to.length() + self.sizes[i]) || height > enough
        })
    }
}
