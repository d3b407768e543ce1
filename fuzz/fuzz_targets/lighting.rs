//! Lightings of the cube: what is read makes a valid scene.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::scene::Lighting;
use radiosity_fuzz::{CUBE, put, refused};

fuzz_target!(|data: &[u8]| {
    let path = put("l.toml", data);
    match Lighting::load(&path, &CUBE) {
        Ok(lighting) => {
            let lit = lighting.apply(&CUBE);
            assert_eq!(lit.faces.len(), CUBE.faces.len());
            for material in &lit.materials {
                assert!(material.reflectance.iter().all(|rho| (0.0..=1.0).contains(rho)));
                assert!(material.exitance.iter().all(|e| e.is_finite() && *e >= 0.0));
            }
        }
        Err(error) => refused(&path, &error.to_string()),
    }
});
