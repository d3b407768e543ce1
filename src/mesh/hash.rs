//! The fingerprint of the patches' geometry.

use sha2::{Digest, Sha256};

use super::patch::PatchId;
use super::patches::Mesh;
use crate::scene::hash::{count, hexadecimal, numbers};

impl Mesh {
    /// Returns the SHA-256 of the patches' corners, on which form factors depend, as 64 hexadecimal digits.
    ///
    /// Two meshes have the same hash if their patches have the same corners (to the last bit, 0 and −0 being the same), in the
    /// same order. The patches are also all occluders. Materials and names do not matter.
    #[must_use]
    pub fn geometry_hash(&self) -> String {
        let mut hasher = Sha256::new();
        // The first line distinguishes these bytes from a later layout.
        hasher.update(b"radiosity patches 1\n");
        count(&mut hasher, self.n_patches());
        for i in 0..self.n_patches() {
            let corners = self.polygon(PatchId::from_index(i));
            count(&mut hasher, corners.len());
            for corner in corners {
                numbers(&mut hasher, corner.to_array());
            }
        }
        hexadecimal(&hasher.finalize())
    }
}
