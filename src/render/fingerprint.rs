//! The fingerprint of the input of an image.

use sha2::{Digest, Sha256};

use super::input::RenderInput;
use super::outdoors::Outdoors;
use super::settings::RenderSettings;
use super::view::View;
use crate::matrix::operator::Block;

impl RenderInput<'_> {
    /// Returns the SHA-256 of the input of an image: scene, patches, solution, view, settings, the rays' offset, and the version of the program.
    #[must_use]
    pub fn fingerprint(&self, view: &dyn View, settings: &RenderSettings) -> [u8; 32] {
        let mut hasher = Sha256::new();
        hasher.update(concat!("radiosity picture 4 ", env!("CARGO_PKG_VERSION"), "\n"));
        hasher.update(self.scene.content_hash());
        hasher.update(self.mesh.geometry_hash());
        let (width, height) = view.size();
        // The debug format shows every digit of a float.
        hasher.update(format!("{width} {height} {:?} {settings:?}\n", view.description()));
        if self.outdoors != Outdoors::default() {
            hasher.update(format!("{:?}\n", self.outdoors));
        }
        let origin = self.visibility.frame_origin().to_array();
        for number in origin.into_iter().chain([self.visibility.offset()]) {
            hasher.update(number.to_bits().to_le_bytes());
        }
        let given = [
            Some(self.radiosity),
            Some(self.irradiance),
            self.indirect_irradiance,
            self.error,
        ];
        for block in given {
            let shape = |b: &Block| (b.n_rows(), b.n_channels());
            hasher.update(format!("{:?}\n", block.map(shape)));
            for number in block.iter().flat_map(|block| block.values()) {
                hasher.update(number.to_bits().to_le_bytes());
            }
        }
        hasher.finalize().into()
    }
}
