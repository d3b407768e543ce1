//! Camera files: what is read is a camera, and reads back from its own text.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::scene::Camera;
use radiosity_fuzz::{put, refused};

fuzz_target!(|data: &[u8]| {
    let path = put("c.toml", data);
    match Camera::load(&path) {
        Ok(camera) => {
            let (origin, direction) = camera.primary_ray(0.5, 0.25, 4, 3);
            assert!(origin.is_finite() && direction.is_finite(), "{origin} {direction}");
            assert!((direction.length() - 1.0).abs() < 1e-9, "{direction}: rays are of unit length to rounding");
            let again = put("again.toml", camera.to_toml().as_bytes());
            let same = Camera::load(&again).unwrap_or_else(|error| panic!("{error}\n{}", camera.to_toml()));
            assert_eq!(same.eye(), camera.eye());
            assert_eq!((same.width(), same.height()), (camera.width(), camera.height()));
            // The direction is made a unit vector again.
            assert!(same.direction().distance(camera.direction()) < 1e-12);
        }
        Err(error) => refused(&path, &error.to_string()),
    }
});
