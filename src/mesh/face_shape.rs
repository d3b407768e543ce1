//! The subdivision of a face.

/// The patches of one face, in their order, as a hierarchy needs them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceShape {
    /// n_u × n_v quads, u fastest.
    Quad {
        /// Patches along the direction that runs fastest.
        n_u: u32,
        /// Patches along the other direction.
        n_v: u32,
    },
    /// n² triangles: row j holds 2(n − j) − 1, alternately upright and inverted.
    Triangle {
        /// Parts of each edge.
        n: u32,
    },
}

impl FaceShape {
    /// Returns the number of patches.
    #[must_use]
    pub fn n_patches(self) -> usize {
        match self {
            Self::Quad { n_u, n_v } => n_u as usize * n_v as usize,
            Self::Triangle { n } => n as usize * n as usize,
        }
    }
}

/// Returns a number of patches as their ids count.
pub(super) fn count(n: usize) -> u32 {
    u32::try_from(n).expect("a mesh has fewer than 2^31 patches")
}
