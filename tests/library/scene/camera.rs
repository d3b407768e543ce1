//! Cameras: frames, rays, files, and the view of a scene that has none.

use glam::DVec3;
use radiosity::scene::{Camera, Scene, builtin};

fn scene(name: &str) -> Scene {
    builtin::build(name, None).unwrap().scene
}

fn assert_near(a: DVec3, b: DVec3) {
    assert!(a.distance(b) < 1e-15, "{a} is not {b}");
}

#[test]
fn the_frame_is_right_up_back() {
    let eye = DVec3::new(1.0, 2.0, 3.0);
    let camera = Camera::new(eye, DVec3::new(2.0, 0.0, 0.0), DVec3::new(1.0, 0.0, 5.0), 90.0).unwrap();
    let world_from_camera = camera.world_from_camera();
    assert_near(world_from_camera.transform_vector3(DVec3::NEG_Z), DVec3::X);
    assert_near(world_from_camera.transform_vector3(DVec3::Y), DVec3::Z);
    assert_near(world_from_camera.transform_vector3(DVec3::X), DVec3::NEG_Y);
    assert_near(world_from_camera.transform_point3(DVec3::ZERO), eye);
    assert_near(camera.direction(), DVec3::X);
    assert_near(camera.up(), DVec3::Z);
}

#[test]
fn rays_go_through_the_pixels() {
    let camera = Camera::new(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 90.0).unwrap();
    let ray = |x, y| camera.primary_ray(x, y, 400, 200);
    assert_near(ray(200.0, 100.0).1, DVec3::NEG_Z);
    // Half of 90 degrees to the middle of the upper edge; twice as wide as high.
    assert_near(ray(200.0, 0.0).1, DVec3::new(0.0, 1.0, -1.0).normalize());
    assert_near(ray(400.0, 200.0).1, DVec3::new(2.0, -1.0, -1.0).normalize());
    assert_near(ray(0.0, 100.0).1, DVec3::new(-2.0, 0.0, -1.0).normalize());
    assert_eq!(ray(1.5, 2.5).0, DVec3::ZERO);
}

#[test]
fn a_camera_that_sees_nothing_is_refused() {
    let message = |direction, up, fov| Camera::new(DVec3::ZERO, direction, up, fov).unwrap_err().to_string();
    assert_eq!(
        message(DVec3::ZERO, DVec3::Y, 60.0),
        "camera: direction: zero or not finite; look elsewhere"
    );
    assert_eq!(
        message(DVec3::Y, DVec3::NEG_Y, 60.0),
        "camera: up: parallel to the direction; choose another one"
    );
    assert_eq!(
        message(DVec3::X, DVec3::Y, 180.0),
        "camera: vertical_fov_degree: 180 is not between 0 and 180 degrees; correct it"
    );
    let error = Camera::new(DVec3::NAN, DVec3::X, DVec3::Y, 60.0).unwrap_err();
    assert_eq!((error.kind(), error.file(), error.line()), ("bad_camera", None, None));
}

#[test]
fn a_camera_file_is_read_and_written() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("camera.toml");
    let scene_file = directory.path().join("scene.obj");
    assert_eq!(Camera::load_beside(&scene_file).unwrap(), None);
    std::fs::write(
        &file,
        "eye = [1, 2, 3]\nlook_at = [1, 2.0, 0]\nup = [0, 1, 0]\nvertical_fov_degree = 40\nheight = 100\n",
    )
    .unwrap();
    let camera = Camera::load_beside(&scene_file).unwrap().unwrap();
    let expected = Camera::new(DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_Z, DVec3::Y, 40.0).unwrap();
    assert_eq!(camera, expected.with_image_size(None, Some(100)));
    assert_eq!((camera.width(), camera.height()), (None, Some(100)));

    let saved = directory.path().join("saved.toml");
    camera.save(&saved).unwrap();
    assert_eq!(Camera::load(&saved).unwrap(), camera);
    assert_eq!(
        camera.to_toml(),
        "eye = [1.0, 2.0, 3.0]\ndirection = [0.0, 0.0, -1.0]\nup = [0.0, 1.0, 0.0]\nvertical_fov_degree = 40.0\nheight = 100\n"
    );
}

/// A camera that looks down is saved and turned with the up that it was given, not with what is left of it across its view.
#[test]
fn the_given_up_is_kept() {
    let camera = Camera::new(DVec3::ZERO, DVec3::new(0.0, 2.3, -2.8), DVec3::Z, 60.0).unwrap();
    assert!(camera.up().z < 0.7);
    assert_eq!(camera.given_up(), DVec3::Z);
    assert!(
        camera.to_toml().contains("up = [0.0, 0.0, 1.0]"),
        "{}",
        camera.to_toml()
    );
    let turned = Camera::new(camera.eye(), DVec3::X, camera.given_up(), 60.0).unwrap();
    assert_near(turned.up(), DVec3::Z);
}

#[test]
fn a_bad_camera_file_names_its_line() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("camera.toml");
    let good = "eye = [0, 0, 0]\nlook_at = [1, 0, 0]\nup = [0, 0, 1]\nvertical_fov_degree = 40\n";
    let cases = [
        (
            good.replace("40", "400"),
            ":4: vertical_fov_degree: 400 is not between 0 and 180 degrees; correct it",
        ),
        (
            good.replace("[1, 0, 0]", "[0, 0, 0]"),
            ":2: look_at: zero or not finite; look elsewhere",
        ),
        (
            good.replace("[0, 0, 1]", "[1, 0, 0]"),
            ":3: up: parallel to the direction; choose another one",
        ),
        (
            good.replace("[0, 0, 0]", "[0, nan, 0]"),
            ":1: eye: not finite; correct it",
        ),
        (
            good.replace("look_at = [1, 0, 0]\n", ""),
            ": neither `look_at` nor `direction`; add one",
        ),
        (
            format!("{good}direction = [1, 0, 0]\n"),
            ":5: both `look_at` and `direction`; keep one",
        ),
        (
            format!("{good}width = 0\n"),
            ":5: the width of an image is 1 to 16384 pixels; correct it",
        ),
        (
            format!("{good}height = 16385\n"),
            ":5: the height of an image is 1 to 16384 pixels; correct it",
        ),
    ];
    for (text, message) in cases {
        std::fs::write(&file, text).unwrap();
        let error = Camera::load(&file).unwrap_err();
        assert_eq!(error.to_string(), format!("{}{message}", file.display()));
        assert_eq!((error.kind(), error.file()), ("bad_camera", Some(file.as_path())));
    }
    // The reader of TOML words these.
    for (text, line, word) in [
        (format!("{good}zoom = 3\n"), Some(5), "zoom"),
        (good.replace("[0, 0, 1]", "[0, 0]"), Some(3), "three numbers"),
        (good.replace("[0, 0, 1]", "[0, 0, 1, 5]"), Some(3), "three numbers"),
        (good.replace("[0, 0, 1]", "[0, 0, 1"), Some(4), "array"),
        (good.replace("up = [0, 0, 1]\n", ""), Some(1), "up"),
    ] {
        std::fs::write(&file, &text).unwrap();
        let error = Camera::load(&file).unwrap_err();
        let shown = error.to_string();
        assert_eq!(error.line(), line, "{shown}");
        assert!(
            shown.contains(word) && !shown.contains('\n') && shown.ends_with("; correct the camera"),
            "{shown}"
        );
    }
    let missing = Camera::load(directory.path().join("none.toml")).unwrap_err();
    assert_eq!(missing.kind(), "unreadable");
}

#[test]
fn the_default_view_is_inside_a_room_and_upright() {
    for (name, up) in [
        ("cube", DVec3::Z),
        ("lewis-room", DVec3::Z),
        ("sphere-room-r1", DVec3::Z),
        ("sphere-room-r2", DVec3::Z),
        ("room-box", DVec3::Z),
        ("cornell-box", DVec3::Y),
    ] {
        let scene = scene(name);
        let camera = Camera::default_view(&scene);
        assert_eq!(camera.up(), up, "{name}");
        let (low, high) = scene.bounding_box();
        let eye = camera.eye();
        assert!(eye.cmpgt(low).all() && eye.cmplt(high).all(), "{name}: {eye}");
        // The view runs through the middle of the box.
        let centre = 0.5 * (low + high);
        assert!((centre - eye).cross(camera.direction()).length() < 1e-14, "{name}");
        assert!((centre - eye).dot(camera.direction()) > 0.0, "{name}");
        assert_eq!(camera, Camera::default_view(&scene), "{name}");
    }
    let eye = Camera::default_view(&scene("sphere-room-r2")).eye();
    assert!(eye.length() > 2.0, "not inside the sphere");
}

#[test]
fn a_solid_is_seen_from_outside() {
    let mut solid = scene("cube");
    for face in &mut solid.faces {
        if let radiosity::scene::Corners::Quad(v) = &mut face.corners {
            v.reverse();
        }
    }
    let camera = Camera::default_view(&solid);
    let eye = camera.eye();
    assert!(eye.min_element() < 0.0 || eye.max_element() > 1.0, "{eye}");
}
