//! Tables of the sun and of free points, read as both: what is read is finite and in order.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::report::{points, sun_path};
use radiosity_fuzz::{put, refused};

fuzz_target!(|data: &[u8]| {
    let path = put("t.csv", data);
    let axes = [[0.0, 1.0, 0.0].into(), [0.0, 0.0, 1.0].into()];
    match sun_path::read(&path, 0.25, axes) {
        Ok(found) => {
            assert!(!found.steps.is_empty() && found.steps.is_sorted_by(|a, b| a.time < b.time));
            for step in &found.steps {
                assert!(step.time.is_finite() && step.direction.is_normalized());
                assert!(step.sun.is_none_or(|sun| sun.irradiance() > 0.0 && sun.irradiance().is_finite()));
            }
        }
        Err(error) => refused(&path, &error.to_string()),
    }
    match points::read(&path) {
        Ok(found) => {
            for query in found {
                assert!(query.position.is_finite());
                assert!(query.normal.is_none_or(|own| own.try_normalize().is_some()));
            }
        }
        Err(error) => refused(&path, &error.to_string()),
    }
});
