//! A polygon with the quantities that all of its pairs need.

use glam::DVec3;

use super::real::Vector;
use crate::geometry::double_double::DoubleDouble;

/// A planar polygon with its plane, area, bounding sphere and pieces for quadrature.
#[derive(Clone, Debug)]
pub struct PreparedPolygon {
    corners: Vec<DVec3>,
    /// The displacements of the exact corners from `corners`; empty where these are exact.
    remainders: Vec<DVec3>,
    /// Area times normal, with every digit of the corners.
    area_vector: Vector<DoubleDouble>,
    normal: DVec3,
    area: f64,
    /// The pieces' area, with folds counted twice; the area itself for convex polygons.
    unsigned_area: f64,
    centre: DVec3,
    radius: f64,
    /// Half of the longest edge of the pieces.
    half_edge: f64,
    /// The greatest distance of the middle of a piece's edge from the centre.
    reach: f64,
    is_parallelogram: bool,
    perimeter: f64,
    /// The largest coordinate: corners are accurate to an ulp of it.
    extent: f64,
    pieces: Vec<Piece>,
}

/// A bilinear patch x(s, t) over the unit square; a triangle is one whose first and last corners coincide.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Numbers of the corners at (0, 0), (1, 0), (1, 1), (0, 1).
    pub(super) corners: [usize; 4],
    /// The corners, from the polygon's first one.
    pub(super) offsets: [DVec3; 4],
    /// The area element at (0, 0), (1, 0), (0, 1); it is linear in s and t, negative where the patch is folded.
    pub(super) elements: [f64; 3],
}

impl Piece {
    /// Returns whether the area element is constant, to rounding.
    fn is_parallelogram(&self) -> bool {
        let [a, b, c] = self.elements;
        (b - a).abs().max((c - a).abs()) <= 1e-12 * a.abs()
    }
}

impl PreparedPolygon {
    /// Prepares a simple planar polygon, convex or not, whose corners run counter-clockwise seen from its front, in m.
    ///
    /// Fewer than three corners, or corners on a line, make a polygon of no area, which exchanges nothing.
    /// Corners off the common plane are kept as they are: the plane is that of the first corner and the area vector.
    #[must_use]
    pub fn new(corners: &[DVec3]) -> Self {
        let area_vector = corners
            .windows(2)
            .skip(1)
            .map(|w| difference(w[0], corners[0]).cross(difference(w[1], corners[0])))
            .fold(Vector::sum(DVec3::ZERO, DVec3::ZERO), |sum, v| {
                sum.plus(DoubleDouble::new(0.5), v)
            });
        let normal = area_vector.to_f64().normalize_or_zero();
        Self::build(corners.to_vec(), Vec::new(), area_vector, normal)
    }

    /// Prepares a part of this polygon, which keeps its plane.
    pub(super) fn part(&self, corners: &[Vector<DoubleDouble>]) -> Self {
        let (corners, remainders) = corners.iter().copied().map(Vector::split).unzip();
        let mut part = Self::build(corners, remainders, self.area_vector, self.normal);
        part.area = 0.0;
        for piece in &part.pieces {
            // The mean of a linear element is its value in the middle.
            part.area += 0.5 * (piece.elements[1] + piece.elements[2]);
        }
        part
    }

    fn build(corners: Vec<DVec3>, remainders: Vec<DVec3>, area_vector: Vector<DoubleDouble>, normal: DVec3) -> Self {
        let mut polygon = Self {
            area: area_vector.to_f64().length(),
            extent: corners.iter().map(|v| v.abs().max_element()).fold(0.0, f64::max),
            corners,
            remainders,
            area_vector,
            normal,
            unsigned_area: 0.0,
            centre: DVec3::ZERO,
            radius: 0.0,
            half_edge: 0.0,
            reach: 0.0,
            is_parallelogram: false,
            perimeter: 0.0,
            pieces: Vec::new(),
        };
        let n = polygon.n_corners();
        let offset = |k| polygon.offset(k).to_f64();
        let offsets: Vec<DVec3> = (0..n).map(offset).collect();
        let (low, high) = offsets
            .iter()
            .fold((DVec3::ZERO, DVec3::ZERO), |(low, high), &v| (low.min(v), high.max(v)));
        polygon.centre = 0.5 * (low + high);
        polygon.radius = offsets.iter().map(|v| v.distance(polygon.centre)).fold(0.0, f64::max);
        polygon.perimeter = (0..n).map(|k| offsets[k].distance(offsets[(k + 1) % n])).sum();
        polygon.pieces = (1..n.saturating_sub(1))
            .step_by(2)
            .map(|k| polygon.piece([0, k, k + 1, if k + 2 < n { k + 2 } else { 0 }]))
            .collect();
        polygon.is_parallelogram = polygon.pieces.iter().all(Piece::is_parallelogram);
        for piece in &polygon.pieces {
            for k in 0..4 {
                let (a, b) = (piece.offsets[k], piece.offsets[(k + 1) % 4]);
                polygon.half_edge = polygon.half_edge.max(0.5 * a.distance(b));
                if a != b {
                    polygon.reach = polygon.reach.max((0.5 * (a + b)).distance(polygon.centre));
                }
            }
            let [a, b, c] = piece.elements;
            polygon.unsigned_area += 0.25 * [a, b, c, b + c - a].map(f64::abs).iter().sum::<f64>();
        }
        polygon
    }

    fn piece(&self, corners: [usize; 4]) -> Piece {
        let [a, b, c, d] = corners.map(|k| self.offset(k));
        let element = |u: Vector<DoubleDouble>, v: Vector<DoubleDouble>| u.cross(v).to_f64().dot(self.normal);
        Piece {
            corners,
            offsets: [a, b, c, d].map(Vector::to_f64),
            elements: [
                element(b.minus(a), d.minus(a)),
                element(b.minus(a), c.minus(b)),
                element(c.minus(d), d.minus(a)),
            ],
        }
    }

    /// The corners, in m.
    #[must_use]
    pub fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// The unit normal by the right-hand rule; zero for a polygon of no area.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The area, in m².
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// The radius of a sphere around all corners, in m; its centre is the middle of the corners' box.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    pub(super) fn half_edge(&self) -> f64 {
        self.half_edge
    }

    pub(super) fn is_parallelogram(&self) -> bool {
        self.is_parallelogram
    }

    pub(super) fn reach(&self) -> f64 {
        self.reach
    }

    pub(super) fn unsigned_area(&self) -> f64 {
        self.unsigned_area
    }

    pub(super) fn n_corners(&self) -> usize {
        self.corners.len()
    }

    pub(crate) fn perimeter(&self) -> f64 {
        self.perimeter
    }

    pub(super) fn extent(&self) -> f64 {
        self.extent
    }

    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// The sphere's centre, from the first corner.
    pub(crate) fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Returns a corner with all its digits.
    pub(super) fn exact_corner(&self, k: usize) -> Vector<DoubleDouble> {
        let remainder = self.remainders.get(k).copied().unwrap_or(DVec3::ZERO);
        Vector::sum(self.corners[k], remainder)
    }

    /// Returns the vector from this polygon's first corner to another's.
    pub(super) fn to_first_corner_of(&self, other: &Self) -> DVec3 {
        if self.remainders.is_empty() && other.remainders.is_empty() {
            other.corners[0] - self.corners[0]
        } else {
            other.exact_corner(0).minus(self.exact_corner(0)).to_f64()
        }
    }

    fn offset(&self, k: usize) -> Vector<DoubleDouble> {
        self.exact_corner(k).minus(self.exact_corner(0))
    }

    /// Returns the height of a point over the polygon's plane times the area, with all digits.
    pub(super) fn exact_height(&self, point: Vector<DoubleDouble>) -> DoubleDouble {
        self.area_vector.dot(point.minus(self.exact_corner(0)))
    }

    /// Returns the height of a point over the polygon's plane, in m; 0 within `tolerance` of it, otherwise to about 200 ulps of itself.
    #[inline]
    pub(super) fn height(&self, point: &DVec3, tolerance: f64) -> f64 {
        // By components, which stay in registers.
        let (corner, normal) = (&self.corners[0], &self.normal);
        let (x, y, z) = (point.x - corner.x, point.y - corner.y, point.z - corner.z);
        let height = normal.x * x + normal.y * y + normal.z * z;
        if height.abs() > 0.01 * (x.abs() + y.abs() + z.abs()) {
            height
        } else if height.abs() <= tolerance {
            0.0
        } else {
            self.low_height(*point)
        }
    }

    /// Returns the height of a point near the plane, where the plain product loses digits.
    #[cold]
    fn low_height(&self, point: DVec3) -> f64 {
        let norm = self.area_vector.to_f64().length();
        self.exact_height(Vector::sum(point, DVec3::ZERO)).to_f64() / norm
    }
}

/// Returns a − b, exactly.
fn difference(a: DVec3, b: DVec3) -> Vector<DoubleDouble> {
    Vector::sum(a, -b)
}
