//! Boundary conditions of the cube: what is read is in range, and whatever has a solution has temperatures.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::heat::{Boundary, Network};
use radiosity_fuzz::{CUBE, MESH, put, refused};

fuzz_target!(|data: &[u8]| {
    let path = put("b.toml", data);
    match Boundary::load(&path, &CUBE) {
        Ok(boundary) => {
            assert_eq!(boundary.surfaces.len(), CUBE.surfaces.len());
            assert!(boundary.surroundings_k >= 0.0 && boundary.surroundings_k.is_finite());
            for surface in boundary.surfaces.iter().flatten() {
                assert!(surface.emissivity > 0.0 && surface.emissivity <= 1.0);
                assert!((0.0..=1.0).contains(&surface.absorptance));
            }
            // Surfaces of the cube do not coincide: two sides of a sheet are refused.
            let _ = Network::new(&CUBE, &MESH, &boundary);
        }
        Err(error) => refused(&path, &error.to_string()),
    }
});
