//! Lists of frames: names that are parts of file names, each once.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::scene::frames;
use radiosity_fuzz::{put, refused};

fuzz_target!(|data: &[u8]| {
    let path = put("f.toml", data);
    match frames::load(&path) {
        Ok(frames) => {
            assert!(!frames.is_empty());
            for (k, frame) in frames.iter().enumerate() {
                assert!(!frame.name.is_empty() && !frame.name.contains(['/', '\\', '\0', '\n']), "{:?}", frame.name);
                assert!(frames[..k].iter().all(|other| other.name != frame.name), "{:?}", frame.name);
            }
        }
        Err(error) => refused(&path, &error.to_string()),
    }
});
