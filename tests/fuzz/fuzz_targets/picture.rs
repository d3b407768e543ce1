//! Pictures that are to be verified.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::render::verify::verify;
use radiosity_fuzz::put;

fuzz_target!(|data: &[u8]| {
    let path = put("i.exr", data);
    match verify(&path) {
        Ok(report) => assert!(report.n_checked <= report.n_pixels),
        Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
    }
});
