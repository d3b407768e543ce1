//! The fingerprint of a scene.

use std::collections::HashMap;

use sha2::{Digest, Sha256};

use super::{MaterialId, Scene};

impl Scene {
    /// Returns the SHA-256 of a scene's content, as 64 hexadecimal digits.
    ///
    /// Two scenes have the same hash if they have the same faces (corner positions to the last bit, with the same first corner), in the same order, with
    /// the same surfaces and materials, names included. The numbering and layout of vertices and materials in
    /// a file, comments, line numbers and unused elements do not matter; 0 and −0 are the same.
    #[must_use]
    pub fn content_hash(&self) -> String {
        let mut hasher = Sha256::new();
        // The first line distinguishes later layouts of these bytes.
        hasher.update(b"radiosity scene 1\n");
        count(&mut hasher, self.surfaces.len());
        for surface in &self.surfaces {
            text(&mut hasher, &surface.name);
        }
        let mut order: HashMap<MaterialId, usize> = HashMap::new();
        count(&mut hasher, self.faces.len());
        for face in &self.faces {
            let corners = face.corners.as_slice();
            count(&mut hasher, corners.len());
            for &v in corners {
                numbers(&mut hasher, self.vertices[v as usize].to_array());
            }
            hasher.update(face.surface.0.to_le_bytes());
            let n_known = order.len();
            let material = *order.entry(face.material).or_insert(n_known);
            count(&mut hasher, material);
            if material == n_known {
                let new = &self.materials[face.material.0 as usize];
                text(&mut hasher, &new.name);
                numbers(&mut hasher, new.reflectance);
                numbers(&mut hasher, new.exitance);
            }
        }
        hexadecimal(&hasher.finalize())
    }
}

/// Returns two hexadecimal digits a byte.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    let nibbles = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    nibbles
        .filter_map(|nibble| char::from_digit(nibble.into(), 16))
        .collect()
}

pub(crate) fn count(hasher: &mut Sha256, n: usize) {
    hasher.update((n as u64).to_le_bytes());
}

fn text(hasher: &mut Sha256, text: &str) {
    count(hasher, text.len());
    hasher.update(text);
}

pub(crate) fn numbers(hasher: &mut Sha256, numbers: [f64; 3]) {
    for x in numbers {
        // Adding zero turns -0.0 into 0.0.
        hasher.update((x + 0.0).to_le_bytes());
    }
}
