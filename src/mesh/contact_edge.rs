//! One contact edge of a face.

use glam::DVec3;

/// A segment along which a face meets the plane of another one, in front of which it stands or which it pierces.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactEdge {
    pub(super) from: DVec3,
    pub(super) to: DVec3,
    /// The distance, in m, up to which a point lies on it.
    pub(super) tolerance: f64,
    /// The greatest distance of its ends from the plane, in m.
    pub(super) misfit: f64,
}

impl ContactEdge {
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let along = self.to - self.from;
        let t = ((point - self.from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        point.distance(self.from + t * along)
    }

    /// Returns the range on a line, in m from its start, along which the contact edge runs, if all of it beside the line lies on the line.
    pub(super) fn part_along(&self, [start, end]: [DVec3; 2]) -> Option<[f64; 2]> {
        let length = start.distance(end);
        let unit = (end - start).try_normalize()?;
        let [a, b] = [self.from, self.to].map(|point| unit.dot(point - start));
        let part = [a.min(b).max(0.0), a.max(b).min(length)];
        let lies_on = |t: &f64| self.distance(start + t * unit) <= self.tolerance;
        (part[0] <= part[1] && part.iter().all(lies_on)).then_some(part)
    }
}
