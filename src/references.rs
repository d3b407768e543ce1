//! The sources that formulas cite, one documented constant each: a citation is a link, and a broken one fails the docs build.

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

/// I. E. Sutherland, G. W. Hodgman, "Reentrant polygon clipping", Communications of the ACM 17(1), 1974: cutting a polygon along one plane after another.
pub const SUTHERLAND_HODGMAN_1974: &str = "Sutherland and Hodgman 1974";

/// E. M. Sparrow, "A New and Simpler Formulation for Radiative Angle Factors", Journal of Heat Transfer 85(2), 1963: form factors as contour integrals.
pub const SPARROW_1963: &str = "Sparrow 1963";

/// H. Freeman, R. Shapira, "Determining the minimum-area encasing rectangle for an arbitrary closed curve", Communications of the ACM 18(7), 1975.
pub const FREEMAN_SHAPIRA_1975: &str = "Freeman and Shapira 1975";

/// E. Reinhard, M. Stark, P. Shirley, J. Ferwerda, "Photographic Tone Reproduction for Digital Images", SIGGRAPH 2002.
pub const REINHARD_2002: &str = "Reinhard et al. 2002";

/// W. Hoeffding, "Probability Inequalities for Sums of Bounded Random Variables", Journal of the American Statistical Association 58(301), 1963.
pub const HOEFFDING_1963: &str = "Hoeffding 1963";

/// A. B. Owen, "Monte Carlo Variance of Scrambled Net Quadrature", SIAM Journal on Numerical Analysis 34(5), 1997.
pub const OWEN_1997: &str = "Owen 1997";

/// B. Laurent, P. Massart, "Adaptive estimation of a quadratic functional by model selection", The Annals of Statistics 28(5), 2000.
pub const LAURENT_2000: &str = "Laurent and Massart 2000";

/// B. Efron, "Student's t-Test Under Symmetry Conditions", Journal of the American Statistical Association 64(328), 1969.
pub const EFRON_1969: &str = "Efron 1969";

/// Q.-M. Shao, "Self-normalized Large Deviations", The Annals of Probability 25(1), 1997.
pub const SHAO_1997: &str = "Shao 1997";

/// M. F. Cohen, D. P. Greenberg, "The Hemi-Cube: A Radiosity Solution for Complex Environments", SIGGRAPH 1985.
pub const COHEN_GREENBERG_1985: &str = "Cohen and Greenberg 1985";

/// D. Lischinski, F. Tampieri, D. P. Greenberg, "Combining Hierarchical Radiosity and Discontinuity Meshing", SIGGRAPH 1993: a local pass that gathers at every pixel.
pub const LISCHINSKI_1993: &str = "Lischinski, Tampieri and Greenberg 1993";

/// J. Arvo, "The Irradiance Jacobian for Partially Occluded Polyhedral Sources", SIGGRAPH 1994: how irradiance changes as vertices of sources and occluders move.
pub const ARVO_1994: &str = "Arvo 1994";

/// M. S. Floater, "Mean value coordinates", Computer Aided Geometric Design 20(1), 2003.
pub const FLOATER_2003: &str = "Floater 2003";

/// A. P. Ingersoll, T. Svitek, B. C. Murray, "Stability of polar frosts in spherical bowl-shaped craters on the Moon, Mercury, and Mars", Icarus 100(1), 1992.
///
/// The temperature of the shadow in a crater; `docs/heat.md` derives it.
pub const INGERSOLL_1992: &str = "Ingersoll, Svitek and Murray 1992";

/// D. R. Baum, S. Mann, K. P. Smith, J. M. Winget, "Making Radiosity Usable: Automatic Preprocessing and Meshing Techniques for the Generation of Accurate Radiosity Solutions", SIGGRAPH 1991.
///
/// Where polygons meet, both are cut, so that no patch reaches from one side to the other.
pub const BAUM_1991: &str = "Baum et al. 1991";
