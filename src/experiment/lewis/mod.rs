//! Reproduces [`LEWIS_1992`](crate::references::LEWIS_1992): multigrid against Gauss-Seidel on a room with a hole in its ceiling.
//!
//! Tables 1 and 2, figures 1, 2, 5 and 6, and the proposal of section 7.
//!
//! Table 2 as he ran it: u = f at the start, max |r| < 2.5e-5 W·m⁻² at the end, which is 1e-4 of the hole's 0.25 W over the unit area of a wall, at every l: table 2 requires this, not a tolerance
//! scaled by the area of a patch. Gauss-Seidel uses the residuals that its sweep meets, multigrid the true ones after a cycle. Coarse form factors are by equation (5) on each level, with 20 sweeps on
//! the coarsest level. Multiplications count N² for a sweep, N² / 4 for a restricted residual, and exclude the stopping tests and all setup, as his times do. Times are ours: the median of alternating
//! runs to the same tolerance, each with one check of the true residual, on the machine that the report names; "with setup" adds the restricted matrices, which one thread or several make.
//!
//! The figures, as files that `radiosity reproduce lewis -o DIR` writes (figures 3 and 4 are sketches of restriction and prolongation):
//!
//! | figure | file | content |
//! |---|---|---|
//! | 1 | `figure-1.png` | the entries of I − diag(ρ) F at l = 2: blocks of zeros where patches share a wall |
//! | 2 | `report.md` | the algorithm, as printed and repaired: cycles of each variant |
//! | 5 | `figure-5.png` | the solution at l = 4 on the unfolded room |
//! | 6 | `figure-6-times.svg` | the time of Gauss-Seidel and of multigrid by N, his and ours |
//! | – | `convergence.svg` | the true residual of both after every sweep and cycle, l = 4 |
//!
//! Figure 2 is the algorithm; [`run_variant`] runs possible readings of it, at l = 1 to 4: repaired it takes 4, 4, 4, 4 cycles; with line 12 as printed (Jacobi) 7, 6, 6, 6; with
//! the sign of an ordinary defect 50, 7, 51, 7, which a test at even l alone would miss; with v = 0 before the second recursive call too 4, 5, 4, 4, so counts alone do
//! not distinguish it; with coarse rows that do not sum to 1 it diverges at l = 1 and 2, and grows to 1e47 at l = 4 before the sweeps take over.
//!
//! Section 7, K u by levels, is tried by [`product_by_levels`] at l = 4: for errors of at most 2e-3, 2e-4 and 8e-6 W·m⁻² (of radiosities of 0.02 to 1.1) it evaluates 0.25, 0.91 and 1.10 as many form
//! factors as there are pairs, and takes far longer than a product with the stored matrix (`radiosity reproduce lewis` has the times). His negative finding is confirmed: at the accuracy of the
//! solution (2.5e-5) the light of a room this small varies too much over patches for coarse ones to replace them, and the search costs as much as it saves.

mod by_levels;
mod figure_2;
mod images;
mod model;
mod printed;
mod report;
mod tables;

pub use by_levels::{ByLevels, EPSILONS, product_by_levels};
pub use figure_2::{VARIANTS, Variant, VariantRun, run_variant};
pub use images::{density_png, unfolded_png};
pub use model::Room;
pub use report::{LevelTimes, ROUNDS};
pub use tables::{Check, LewisResults, SizeLine, SolverLine, reproduce};

/// The tables that can be reproduced.
pub const TABLES: std::ops::RangeInclusive<u8> = 1..=2;

/// The greatest level of table 1.
pub const LEVEL_MAX: u32 = 6;

/// The default finest level of table 2, which takes seconds.
pub const LEVEL_DEFAULT: u32 = 5;

/// The value of max |r| at which both solvers stop, W·m⁻².
pub const TOLERANCE: f64 = 2.5e-5;
