//! Why a scene could not be solved on voxels.

use thiserror::Error;

use super::grid::{MAX_VOXELS, MIN_VOXELS};
use super::sphere::MAX_RADIUS;

/// Why a scene could not be solved on voxels.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VoxelError {
    /// A resolution out of range.
    #[error("{n} voxels along the longest axis; give {MIN_VOXELS} to {MAX_VOXELS}")]
    Resolution {
        /// The requested value.
        n: u32,
    },
    /// A radius out of range.
    #[error("a discrete sphere of radius {radius}; give 1 to {MAX_RADIUS}")]
    Radius {
        /// The requested value.
        radius: u32,
    },
    /// Links cannot be written to or read from their file.
    #[error("{}: {source}", .path.display())]
    LinkFile {
        /// The file.
        path: std::path::PathBuf,
        /// The fault.
        source: std::io::Error,
    },
    /// The caller asked to stop; the links found so far are in the file with `.part` at the end of its name.
    #[error("the search for links was interrupted")]
    Interrupted,
    /// More unknowns than 32-bit ids can name.
    #[error("{n_surfels} surface voxels are more than 4294967295; give fewer voxels along the longest axis")]
    TooMany {
        /// The number of surfels.
        n_surfels: usize,
    },
}
