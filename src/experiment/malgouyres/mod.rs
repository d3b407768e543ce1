//! Extends the paper on discrete radiosity by its error against patches with exact form factors, and against run time.
//!
//! On four rooms the irradiance of the voxels is compared with that of patches, H, in the norm ‖H_voxels − H‖ / ‖H‖, ‖x‖² = Σ A x² over *measuring patches*. The reference is the
//! patch solution with [`exact`](crate::form_factor::ExactMethod) form factors on patches half as wide, averaged over the measuring ones; its own error is estimated by its change from
//! measuring patches to those. Voxel values are interpolated to 8 × 8 points of each measuring patch and averaged.
//!
//! Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002); the paper prints two pictures and no error.

mod measure;
mod report;
mod runs;

pub use measure::{Case, PatchReference};
pub use report::SceneTimes;
pub use runs::{MalgouyresResults, PatchRun, SceneResult, VoxelRun, reproduce};

/// The greatest level: the finest resolution is 10 · 2^level voxels along the longest axis.
pub const LEVEL_MAX: u32 = 4;

/// The default level: 40 voxels along the longest axis.
pub const LEVEL_DEFAULT: u32 = 2;
