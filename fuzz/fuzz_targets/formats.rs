//! Scene files of all formats: the first byte says which, all others are the file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::scene::{Format, LoadOptions, load_with};
use radiosity_fuzz::{put, refused};

fuzz_target!(|data: &[u8]| {
    let Some((&first, content)) = data.split_first() else {
        return;
    };
    let formats: Vec<Format> = Format::all().collect();
    let path = put("scene", content);
    let options = LoadOptions::default().format(Some(formats[usize::from(first) % formats.len()]));
    match load_with(&path, &options) {
        Ok(loaded) => {
            for warning in &loaded.warnings {
                assert_eq!(warning.to_string().lines().count(), 1, "{warning}");
            }
            for face in loaded.scene.face_ids() {
                let area = loaded.scene.area_vector(face).length();
                assert!(area.is_finite() && area > 0.0, "face {face:?} has {area} m²");
            }
        }
        Err(error) => refused(&path, &error.to_string()),
    }
});
