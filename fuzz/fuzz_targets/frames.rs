//! Lists of frames: names that are parts of file names, each once; and the cube with its surfaces moved as they say.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::scene::frames;
use radiosity_fuzz::{CUBE, put, refused};

fuzz_target!(|data: &[u8]| {
    let path = put("f.toml", data);
    let frames = match frames::load(&path) {
        Ok(frames) => frames,
        Err(error) => return refused(&path, &error.to_string()),
    };
    assert!(!frames.is_empty());
    for (k, frame) in frames.iter().enumerate() {
        assert!(!frame.name.is_empty() && !frame.name.contains(['/', '\\', '\0', '\n']), "{:?}", frame.name);
        assert!(frames[..k].iter().all(|other| other.name != frame.name), "{:?}", frame.name);
        let pose = match frame.pose(&path, &CUBE) {
            Ok(pose) => pose,
            Err(error) => return refused(&path, &error.to_string()),
        };
        match CUBE.posed(&pose) {
            Ok(moved) => {
                assert_eq!(moved.faces.len(), CUBE.faces.len());
                for face in moved.face_ids() {
                    let area = moved.area_vector(face).length();
                    // Far away, corners are rounded to 1e15 times 2^-53.
                    assert!((area - 1.0).abs() < 0.5, "face {face:?} has {area} m²");
                }
            }
            Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
        }
    }
});
