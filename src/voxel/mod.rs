//! Discrete radiosity: light on voxels, with integer arithmetic for who sees whom.
//!
//! ```text
//! Scene ──▶ VoxelScene (octree, surfels) ──▶ Links I(x, v) ──▶ LinkOperator ──▶ propagation, or any Solver ──▶ patches of the scene ──▶ renderer
//!           discretize, octree              line, bundle, links  operator         radiosity                      display
//! ```
//!
//! Every surface voxel x gathers light along the directions v of a discrete sphere:
//! B(x) = E(x) + ρ(x) Σ_v B(I(x, v)) cos θ(x, v) A(v), where I(x, v) is the first surface voxel on the discrete line from x towards x + v.
//!
//! [`solve_adaptively`] joins voxels to cells where the light is even: [`Cells`] are the unknowns, the voxels still decide who sees whom.
//!
//! Scale and speed: measured in `docs/performance.md`.
//!
//! In place or not: at 100 voxels and R = 10 in the living room, the mean radiosities of the surfaces are off from those after 40 propagations by 1.3 % after 5 propagations in place, 1.7 % after 5 of
//! equation (3), 0.10 % after 10 in place and 0.14 % after 10 of equation (3): root mean square weighted by area, relative (`--form in-place|jacobi --passes 5|10`).
//!
//! Error: of first order in the voxel's side, 1.9 % of the irradiance in the cube, 2.3 % in the room of Lewis, 2.3 % around a sphere, 6.2 % in the Cornell box at 40 voxels and R = 30, against patches with
//! exact form factors (`radiosity reproduce malgouyres`). Without [`Materials::emission`], which gives emitters the power of their true areas, it was 6.0 % in the room of Lewis, 2.9 % around the sphere and
//! 11 % in the Cornell box. Patches with exact form factors are nearer in less time on all four. Cells with a
//! tolerance of 0.2 come to 0.97 to 1.09 of these errors with 0.16 to 0.63 of the links; at equal run time to 1.03 (cube), 0.87 (room of Lewis), 1.00 (Cornell box) and 0.99 (sphere) of the error of
//! uniform voxels, which is to say that they save memory and not time: a line of a cell costs more than one of the many that leave a whole brick together
//! (one run of `radiosity reproduce malgouyres --level 2` on two otherwise idle cores).
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
pub use operator::{Gather, LinkOperator};
pub use picture::picture;
pub use radiosity::{Form, Propagation, propagate};
pub use sight::Sight;
pub use sphere::{DiscreteSphere, MAX_RADIUS, SolidAngle, SphereDirection};
pub use surfaces::SurfelMean;
pub use thin::{Leak, ThinWall};
pub use weights::RowWeights;
