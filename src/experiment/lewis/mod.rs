//! [`LEWIS_1992`](crate::references::LEWIS_1992): multigrid against Gauss-Seidel on a room with a hole in its ceiling.
//!
//! Tables 1 and 2, figures 1, 2, 5 and 6, and what section 7 hoped for.
//!
//! Table 2 as he ran it: u = f at the start, max |r| < 2.5e-5 W·m⁻² at the end, which is 1e-4 of the hole's 0.25 W over the unit area of a wall, at every l: what table 2 needs, and not a tolerance scaled by the
//! area of a patch. Gauss-Seidel looks at the residuals that its sweep meets, multigrid at the true ones after a cycle. Coarse form factors
//! by equation (5) on each level, 20 sweeps on the coarsest level. Multiplications count N² for a sweep, N² / 4 for a restricted residual, and leave the
//! stopping tests and all setup out, as his times do. Times are ours: the median of alternating runs to the same tolerance, each with one check of the true residual, on
//! the machine that the report names; "with setup" adds the restricted matrices, which one thread or several make.
//!
//! Figure 2 is the algorithm; [`run_variant`] runs what a reader may make of it. Section 7 is tried by [`product_by_levels`].

mod by_levels;
mod figure_2;
mod images;
mod model;
mod printed;
mod tables;

pub use by_levels::{ByLevels, EPSILONS, product_by_levels};
pub use figure_2::{VARIANTS, Variant, VariantRun, run_variant};
pub use images::{density_png, unfolded_png};
pub use model::Room;
pub use tables::{Check, LewisResults, SizeLine, SolverLine, reproduce};

/// The tables that can be repeated.
pub const TABLES: std::ops::RangeInclusive<u8> = 1..=2;

/// The greatest level of table 1.
pub const LEVEL_MAX: u32 = 6;

/// max |r| at which both solvers stop, W·m⁻².
pub const TOLERANCE: f64 = 2.5e-5;
