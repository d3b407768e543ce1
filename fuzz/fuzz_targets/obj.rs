//! OBJ files with their libraries: what follows a NUL is `a.mtl`, what follows the next one `b.mtl`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity_fuzz::{at, put, refused};

fuzz_target!(|data: &[u8]| {
    let mut parts = data.splitn(3, |byte| *byte == 0);
    let path = put("s.obj", parts.next().unwrap_or_default());
    for library in ["a.mtl", "b.mtl"] {
        let _ = match parts.next() {
            Some(part) => std::fs::write(at(library), part),
            None => std::fs::remove_file(at(library)),
        };
    }
    match radiosity::scene::load(&path) {
        Ok(loaded) => {
            let scene = loaded.scene;
            for warning in &loaded.warnings {
                assert_eq!(warning.to_string().lines().count(), 1, "{warning}");
            }
            for material in &scene.materials {
                assert!(material.reflectance.iter().all(|rho| (0.0..=1.0).contains(rho)));
                assert!(material.exitance.iter().all(|e| e.is_finite() && *e >= 0.0));
            }
            for face in scene.face_ids() {
                let area = scene.area_vector(face).length();
                assert!(area.is_finite() && area > 0.0, "face {face:?} has {area} m²");
            }
            match Mesh::new(&scene, Subdivision::Uniform(2)) {
                Ok(mesh) => assert!(mesh.areas().iter().all(|area| area.is_finite() && *area >= 0.0)),
                Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
            }
        }
        Err(error) => refused(&path, &error.to_string()),
    }
});
