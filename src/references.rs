//! The sources that formulas cite: one documented constant each, so that a citation is a link and a broken one fails the docs build.

/// R. R. Lewis, "Solving the Classic Radiosity Equation Using Multigrid Techniques", University of British Columbia, 4 February 1992.
///
/// Multigrid against Gauss-Seidel on a cube-shaped room with a hole in its ceiling. The coarse form factor (5) and the
/// model problem of section 4 come from here.
pub const LEWIS_1992: &str = "Lewis 1992";

/// G. V. G. Baranoski, R. Bramley, P. Shirley, "Iterative Methods For Fast Radiosity Solutions", Indiana University, April 1995.
///
/// Iterative solvers from Gauss-Seidel to Chebyshev on a room with a sphere; appendix A compares shooting and quadrature for form factors.
/// Known misprints that touch this crate: the Gauss-Seidel and SOR lines add ρ Σ F B to E (printed with a minus); V = A/ρ in
/// the conjugate-gradient method (section 3.2 prints the inverse); SD5, SD10 and SG5, SG10 are the same methods.
pub const BARANOSKI_1995: &str = "Baranoski, Bramley and Shirley 1995";

/// R. Malgouyres, "A Discrete Radiosity Method", Discrete Geometry for Computer Imagery, LNCS 2301, 2002.
///
/// Radiosity on voxels: visibility by integer lines in an octree.
pub const MALGOUYRES_2002: &str = "Malgouyres 2002";

/// J. H. Lambert, "Photometria", 1760: the irradiance of a point from a uniformly bright polygon, a sum over its edges.
pub const LAMBERT_1760: &str = "Lambert 1760";

/// The Cornell box: measured geometry of the Program of Computer Graphics, Cornell University.
///
/// <https://www.graphics.cornell.edu/online/box/data.html>
pub const CORNELL_BOX: &str = "Cornell box data";
