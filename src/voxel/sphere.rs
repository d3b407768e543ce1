//! The discrete sphere: the directions of light and their solid angles.

use std::f64::consts::PI;

use super::VoxelError;

/// The greatest radius: components of directions then fit into 8 bits.
pub const MAX_RADIUS: u32 = 255;

/// The formula for the solid angle of a face of the sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SolidAngle {
    /// The element at the face's centre, cos / r²: Malgouyres 2002, section 3.2. Relative error about 1/(8 R²).
    #[default]
    Centre,
    /// The solid angle of the square in closed form, exact to rounding.
    Exact,
}

/// One direction: from a voxel towards the one that lies `vector` away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereDirection {
    /// v, in voxels.
    pub vector: [i32; 3],
    /// Σ over the outer faces f of v of A(f): solid angle over π.
    pub weight: f64,
}

/// The discrete sphere Σ_R: the voxels at distance ≤ R from the centre that have a 6-neighbour at distance > R.
///
/// Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), section 3.2, with
/// A(f) = (k + ½) / (π (i² + j² + (k + ½)²)^{3/2}) for the outer face f of v = (i, j, k) towards +k, and likewise for the others.
/// Σ A = 4 up to the quadrature's error (A is solid angle / π); Lemma 1: Σ cos θ A → 1 over any hemisphere as R → ∞.
/// Departures: R is an integer; exact solid angles as an option.
#[derive(Clone, Debug)]
pub struct DiscreteSphere {
    radius: u32,
    directions: Vec<SphereDirection>,
    n_faces: usize,
}

impl DiscreteSphere {
    /// Makes the sphere of a radius, with neighbouring directions near each other in order.
    ///
    /// The order is side by side of the cube around it, along a Hilbert curve on each.
    ///
    /// # Errors
    /// [`VoxelError::Radius`] for a radius of 0 or above [`MAX_RADIUS`].
    pub fn new(radius: u32, solid_angle: SolidAngle) -> Result<Self, VoxelError> {
        if radius == 0 || radius > MAX_RADIUS {
            return Err(VoxelError::Radius { radius });
        }
        let r = radius.cast_signed();
        let outside = |[i, j, k]: [i32; 3]| i * i + j * j + k * k > r * r;
        let mut directions = Vec::new();
        let mut n_faces = 0;
        for k in -r..=r {
            for j in -r..=r {
                for i in -r..=r {
                    let vector = [i, j, k];
                    if outside(vector) {
                        continue;
                    }
                    let mut weight = 0.0;
                    let mut is_outer = false;
                    for axis in 0..3 {
                        for sign in [-1, 1] {
                            let mut neighbour = vector;
                            neighbour[axis] += sign;
                            if outside(neighbour) {
                                is_outer = true;
                                n_faces += 1;
                                weight += face_weight(vector, axis, sign, solid_angle);
                            }
                        }
                    }
                    if is_outer {
                        directions.push(SphereDirection { vector, weight });
                    }
                }
            }
        }
        directions.sort_by_cached_key(|d| place_on_curve(d.vector));
        Ok(Self {
            radius,
            directions,
            n_faces,
        })
    }

    /// Returns R.
    #[must_use]
    pub fn radius(&self) -> u32 {
        self.radius
    }

    /// Returns the directions.
    #[must_use]
    pub fn directions(&self) -> &[SphereDirection] {
        &self.directions
    }

    /// Returns the number of outer faces.
    #[must_use]
    pub fn n_faces(&self) -> usize {
        self.n_faces
    }
}

/// Returns A(f) of the face of `vector` towards ±`axis`.
fn face_weight(vector: [i32; 3], axis: usize, sign: i32, solid_angle: SolidAngle) -> f64 {
    let height = f64::from(sign * vector[axis]) + 0.5;
    let (a, b) = (f64::from(vector[(axis + 1) % 3]), f64::from(vector[(axis + 2) % 3]));
    match solid_angle {
        SolidAngle::Centre => height / (PI * (a * a + b * b + height * height).powf(1.5)),
        SolidAngle::Exact => {
            // The solid angle of the rectangle from (0, 0) to (x, y) at distance z; signed, so that four corners make any rectangle.
            let corner = |x: f64, y: f64| (x * y).atan2(height * (x * x + y * y + height * height).sqrt());
            let along = |x: f64| corner(x, b + 0.5) - corner(x, b - 0.5);
            (along(a + 0.5) - along(a - 0.5)) / PI
        }
    }
}

/// Returns the side of the cube that a direction points at, and its position on a Hilbert curve there.
fn place_on_curve(vector: [i32; 3]) -> (usize, u32) {
    let axis = (0..3).rev().max_by_key(|&a| vector[a].abs()).unwrap_or(0);
    let side = 2 * axis + usize::from(vector[axis] < 0);
    // Centred on a power of two, so that the quarters of the curve are the quarters of the side.
    let coordinate = |a: usize| (vector[a] + 256).cast_unsigned();
    (side, hilbert(coordinate((axis + 1) % 3), coordinate((axis + 2) % 3)))
}

/// Returns the position of a cell on the Hilbert curve over 512 × 512 cells.
fn hilbert(mut x: u32, mut y: u32) -> u32 {
    let mut place = 0;
    let mut s = 256;
    while s > 0 {
        let (right, up) = (u32::from(x & s > 0), u32::from(y & s > 0));
        place += s * s * ((3 * right) ^ up);
        if up == 0 {
            if right == 1 {
                x = 511 - x;
                y = 511 - y;
            }
            std::mem::swap(&mut x, &mut y);
        }
        s /= 2;
    }
    place
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::DVec3;

    use super::*;

    fn hemisphere_sum(sphere: &DiscreteSphere, normal: DVec3) -> f64 {
        let n = normal.normalize();
        let cosine = |d: &SphereDirection| n.dot(DVec3::from_array(d.vector.map(f64::from)).normalize());
        sphere.directions().iter().map(|d| d.weight * cosine(d).max(0.0)).sum()
    }

    #[test]
    fn the_papers_spheres_have_the_papers_sizes() {
        for (radius, n_directions, n_faces) in [(30, 9194, 16926), (38, 14790, 27078)] {
            let sphere = DiscreteSphere::new(radius, SolidAngle::Centre).unwrap();
            assert_eq!(sphere.directions().len(), n_directions);
            assert_eq!(sphere.n_faces(), n_faces);
        }
    }

    #[test]
    fn solid_angles_fill_the_sphere() {
        for radius in [1, 2, 7, 30] {
            let total = |solid_angle| -> f64 {
                let sphere = DiscreteSphere::new(radius, solid_angle).unwrap();
                sphere.directions().iter().map(|d| d.weight).sum()
            };
            // The outer faces close the ball, so exact solid angles add up to 4 π / π; 1e-12 is the rounding of 17,000 terms.
            assert!((total(SolidAngle::Exact) - 4.0).abs() < 1e-12);
            // The element at a face's centre is off by at most 1/(8 (R/√3)²) of its value: the mean of the curvature over the square.
            let bound = 4.0 * 3.0 / (8.0 * f64::from(radius * radius));
            assert!((total(SolidAngle::Centre) - 4.0).abs() < bound, "{radius}");
        }
    }

    #[test]
    fn hemispheres_sum_to_one_in_the_limit() {
        let normals = [DVec3::Z, DVec3::ONE, DVec3::new(1.0, 2.0, 3.0)];
        let sphere = DiscreteSphere::new(30, SolidAngle::Centre).unwrap();
        // An independent computation, to its four printed decimals.
        for (normal, expected) in normals.into_iter().zip([1.0010, 0.9992, 0.9997]) {
            assert!((hemisphere_sum(&sphere, normal) - expected).abs() < 5.1e-5);
        }
        // Lemma 1: the worst of the normals falls with every doubling of R.
        let worst = |radius| {
            let larger = DiscreteSphere::new(radius, SolidAngle::Centre).unwrap();
            let errors = normals.map(|n| (hemisphere_sum(&larger, n) - 1.0).abs());
            errors.into_iter().fold(0.0, f64::max)
        };
        let errors = [4, 16, 64].map(worst);
        assert!(errors[1] < 0.5 * errors[0] && errors[2] < 0.5 * errors[1], "{errors:?}");
    }

    #[test]
    fn the_curve_visits_neighbours() {
        let mut cells: Vec<(u32, [u32; 2])> = (0..512)
            .flat_map(|y| (0..512).map(move |x| (hilbert(x, y), [x, y])))
            .collect();
        cells.sort_unstable();
        for (k, pair) in (0_u32..).zip(cells.windows(2)) {
            let ([ax, ay], [bx, by]) = (pair[0].1, pair[1].1);
            assert_eq!((pair[0].0, ax.abs_diff(bx) + ay.abs_diff(by)), (k, 1));
        }
    }

    #[test]
    fn radii_out_of_range_are_refused() {
        for radius in [0, MAX_RADIUS + 1] {
            let refused = DiscreteSphere::new(radius, SolidAngle::Centre);
            assert!(matches!(refused, Err(VoxelError::Radius { radius: r }) if r == radius));
        }
    }
}
