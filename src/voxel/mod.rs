//! Discrete radiosity on voxels, with visibility in integer arithmetic.
//!
//! ```text
//! Scene ──▶ VoxelScene (octree, surfels) ──▶ Links I(x, v) ──▶ LinkOperator ──▶ propagation, or any Solver ──▶ patches of the scene ──▶ renderer
//!           discretize, octree              line, bundle, links  operator         radiosity                      display
//! ```
//!
//! Every surface voxel x gathers light along the directions v of a discrete sphere:
//! B(x) = E(x) + ρ(x) Σ_v B(I(x, v)) cos θ(x, v) A(v), where I(x, v) is the first surface voxel on the discrete line from x towards x + v.
//!
//! [`solve_adaptively`] joins voxels to cells where the light is even: [`Cells`] are the unknowns, and the voxels still decide visibility.
//!
//! Error: of first order in the voxel's side. [`Materials::emission`] gives emitters the power of their true areas. Cells save links and memory rather than time.
//! Scale, speed and errors: measured in `docs/performance.md`.
//!
//! Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002).

mod adaptive;
mod bundle;
mod cell_operator;
mod cells;
mod checks;
mod discretize;
mod display;
mod error;
mod grid;
mod line;
mod link_file;
mod links;
mod materials;
mod octree;
mod operator;
mod picture;
mod radiosity;
mod regions;
mod sight;
mod sights;
mod sphere;
mod surfaces;
mod thin;
mod weights;

pub use adaptive::{Adaptive, AdaptiveSettings, solve_adaptively};
pub use cells::{Cells, MAX_CELL_LEVEL};
pub use checks::ThinGap;
pub use discretize::{Normal, Surfel, VoxelScene};
pub use display::onto_patches;
pub use error::VoxelError;
pub use grid::{Grid, MAX_VOXELS, MIN_VOXELS, Voxel};
pub use line::Direction;
pub use links::Links;
pub use materials::Materials;
pub use octree::Octree;
pub use operator::{Gather, LeakPower, LinkOperator};
pub use picture::picture;
pub use radiosity::{Form, Propagation, propagate};
pub use sight::Sight;
pub use sphere::{DiscreteSphere, MAX_RADIUS, SolidAngle, SphereDirection};
pub use surfaces::SurfelMean;
pub use thin::{Leak, ThinWall};
pub use weights::RowWeights;
