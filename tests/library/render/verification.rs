//! Right images pass, wrong ones do not.

use std::num::NonZeroU32;

use radiosity::geometry::DVec3;
use radiosity::geometry::sampling::Sequence;
use radiosity::render::verify::{VerifyError, VerifyReport, verify, verify_image};
use radiosity::render::{Attributes, DirectMethod, Image, RenderSettings, Samples, Tile, ViewDescription, exr};
use radiosity::visibility::Visibility;
use radiosity::visibility::brute_force::BruteForce;
use radiosity::visibility::embree::EmbreeVisibility;

use super::scenes::{Builder, Solved, black_cube, box_scene, bright_cube, rectangle};

const PARALLEL: f64 = 0.199_824_895_698_387_4;
const PERPENDICULAR: f64 = 0.200_043_776_075_403_15;

fn n(n: u32) -> NonZeroU32 {
    NonZeroU32::new(n).unwrap()
}

fn with(direct: DirectMethod) -> RenderSettings {
    RenderSettings {
        direct,
        ..RenderSettings::default()
    }
}

fn polygons() -> RenderSettings {
    with(DirectMethod::Polygons { n: n(4) })
}

fn cosine_rays(rays: u32) -> RenderSettings {
    with(DirectMethod::CosineRays { n: n(rays) })
}

fn tile<'a>(attributes: &'a Attributes, name: &str) -> &'a Tile {
    let ViewDescription::Unfolded(layout) = &attributes.view else {
        panic!("an unfolded view");
    };
    layout.tiles.iter().find(|tile| tile.name == name).unwrap()
}

/// Changes the values of a layer inside a tile: value and (column, row) in, value out.
fn change(image: &mut Image, tile: &Tile, layer: &str, new: impl Fn(&dyn Fn(u32, u32) -> f32, u32, u32) -> f32) {
    let (width, old) = (image.width(), image.f32(layer).unwrap().to_vec());
    let index = |i: u32, j: u32| (tile.top + j) as usize * width + (tile.left + i) as usize;
    let mut samples = old.clone();
    for j in 0..tile.height {
        for i in 0..tile.width {
            samples[index(i, j)] = new(&|column, row| old[index(column, row)], i, j);
        }
    }
    image.insert(layer, Samples::F32(samples));
}

fn colours(prefix: &str) -> [String; 3] {
    ["R", "G", "B"].map(|c| {
        if prefix.is_empty() {
            c.to_owned()
        } else {
            format!("{prefix}.{c}")
        }
    })
}

const COLOUR_LAYERS: [&str; 4] = ["", "irradiance", "radiosity", "direct"];

fn check(image: &Image, attributes: &Attributes) -> VerifyReport {
    verify_image(image, attributes).unwrap()
}

#[test]
fn the_black_cube_passes_through_a_file_and_its_walls_have_the_known_means() {
    let solved = Solved::new(black_cube(), 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.exr");
    for settings in [polygons(), cosine_rays(256)] {
        let (image, attributes) = solved.unfold(&visibility, 32, settings);
        exr::write(&path, &image, &attributes).unwrap();
        let report = verify(&path).unwrap();
        assert!(report.passed, "{report:#?}");
        assert_eq!(
            (report.n_pixels, report.n_checked, report.n_not_checkable),
            (6144, 6144, 0)
        );
        assert_eq!(report.walls.len(), 6);
        let by_rays = settings.direct != DirectMethod::Polygons { n: n(4) };
        for wall in &report.walls {
            let exact = match wall.name.as_str() {
                "x0" => 0.0,
                "x1" => PARALLEL,
                _ => PERPENDICULAR,
            };
            let colours = [exact, 2.0 * exact, 0.5 * exact];
            let found = wall.exact.unwrap();
            for c in 0..3 {
                assert!((found[c] - colours[c]).abs() < 1e-14, "{}: {found:?}", wall.name);
                assert!(wall.error[c].abs() <= wall.tolerance[c]);
                // 32 pixels a side see the mean to better than one in a thousand.
                assert!(wall.quadrature.unwrap()[c].abs() < 1e-3 * colours[c].max(1e-9));
                assert!(wall.tolerance[c] <= if by_rays { 0.02 } else { 1e-3 } * colours[c] + 1e-13);
            }
        }
        if by_rays {
            assert!(report.tolerance.n_rays == 256 && report.tolerance.max_statistical > 0.0);
        } else {
            assert!(report.max_error < 1e-7 && report.tolerance.max_statistical <= 0.0);
        }
    }
}

#[test]
fn interreflection_supersampling_and_other_numbers_pass() {
    let solved = Solved::new(bright_cube(), 3);
    let embree = EmbreeVisibility::new(&solved.scene).unwrap();
    let brute = BruteForce::new(&solved.scene);
    let variants = [
        RenderSettings {
            samples: n(2),
            ..polygons()
        },
        RenderSettings {
            flat: true,
            samples: n(3),
            ..cosine_rays(24)
        },
        RenderSettings {
            sequence: Sequence::Random,
            seed: 11,
            ..cosine_rays(100)
        },
        cosine_rays(1),
    ];
    for settings in variants {
        for visibility in [&embree as &dyn Visibility, &brute] {
            let (image, attributes) = solved.unfold(visibility, 24, settings);
            let report = check(&image, &attributes);
            assert!(report.passed, "{settings:?}: {report:#?}");
            assert_eq!(report.n_checked, 6 * 24 * 24);
        }
    }
}

/// Both direct methods, each with the alarms that its noise allows.
#[test]
fn a_wall_that_is_one_percent_off_fails() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    for settings in [polygons(), cosine_rays(1024)] {
        let (image, attributes) = solved.unfold(&visibility, 32, settings);
        assert!(check(&image, &attributes).passed);
        let mut tampered = image.clone();
        for name in COLOUR_LAYERS.iter().flat_map(|prefix| colours(prefix)) {
            change(&mut tampered, tile(&attributes, "y1"), &name, |old, i, j| {
                1.01 * old(i, j)
            });
        }
        let report = check(&tampered, &attributes);
        assert!(!report.passed);
        for wall in &report.walls {
            assert_eq!(wall.passed, wall.name != "y1", "{wall:#?}");
        }
    }
}

#[test]
fn one_wrong_pixel_among_noise_fails() {
    let solved = Solved::new(black_cube(), 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    for sequence in [Sequence::Sobol, Sequence::Random] {
        let settings = RenderSettings {
            sequence,
            samples: n(2),
            ..cosine_rays(if sequence == Sequence::Sobol { 1024 } else { 8192 })
        };
        let (image, attributes) = solved.unfold(&visibility, 12, settings);
        let right = check(&image, &attributes);
        assert!(right.passed, "{right:#?}");
        // In the middle of a wall, and in its corner.
        for (place, factor) in [((5, 6), 1.1), ((0, 11), 1.25)] {
            let mut wrong = image.clone();
            let tile = tile(&attributes, "y0").clone();
            for layer in COLOUR_LAYERS.into_iter().flat_map(colours) {
                change(&mut wrong, &tile, &layer, |at, i, j| {
                    at(i, j) * if (i, j) == place { factor } else { 1.0 }
                });
            }
            let report = check(&wrong, &attributes);
            assert!(!report.passed && report.n_outside == 1, "{report:#?}");
        }
    }
}

/// The basis of the factor in `verify/neighbours.rs`; a minute.
#[test]
#[ignore = "a minute: many right images, none of which may fail"]
fn right_images_of_many_seeds_pass() {
    let solved = Solved::new(black_cube(), 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    for seed in 100..104 {
        for sequence in [Sequence::Sobol, Sequence::Random] {
            let settings = RenderSettings {
                sequence,
                seed,
                samples: n(2),
                ..cosine_rays(1024)
            };
            let (image, attributes) = solved.unfold(&visibility, 32, settings);
            let report = check(&image, &attributes);
            assert!(report.passed, "{sequence:?} {seed}: {report:#?}");
        }
    }
}

#[test]
fn wrong_exitance_and_wrong_geometry_fail() {
    let solved = Solved::new(black_cube(), 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let (image, attributes) = solved.unfold(&visibility, 16, polygons());
    let mut brighter = attributes.clone();
    brighter.surfaces[0].polygons[0].exitance[1] *= 1.001;
    let report = check(&image, &brighter);
    assert!(!report.passed && report.n_outside == 5 * 256);
    let mut moved = attributes.clone();
    for corner in &mut moved.surfaces[0].polygons[0].corners {
        corner.x -= 0.01;
    }
    assert!(!check(&image, &moved).passed);
}

/// A flip that the light's symmetry hides is still found by the positions; one of the light alone by the light.
#[test]
fn flipped_tiles_fail() {
    let solved = Solved::new(black_cube(), 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    for settings in [polygons(), cosine_rays(64)] {
        let (image, attributes) = solved.unfold(&visibility, 16, settings);
        let floor = tile(&attributes, "z0");
        let colour_names: Vec<String> = COLOUR_LAYERS.iter().flat_map(|prefix| colours(prefix)).collect();
        // The light comes from x = 0: one of the floor's axes is a symmetry, the other is not.
        let along_row = floor.right.x.abs() > 0.5;
        let mut flipped = image.clone();
        for name in &colour_names {
            change(&mut flipped, floor, name, |old, i, j| {
                if along_row { old(15 - i, j) } else { old(i, 15 - j) }
            });
        }
        let report = check(&flipped, &attributes);
        assert!(!report.passed && report.n_strips_outside > 0 && report.n_misplaced == 0);

        let mut mirrored = image.clone();
        let all = colour_names.iter().map(String::as_str).chain(["P.X", "P.Y", "P.Z"]);
        for name in all {
            change(&mut mirrored, floor, name, |old, i, j| {
                if along_row { old(i, 15 - j) } else { old(15 - i, j) }
            });
        }
        let second = check(&mirrored, &attributes);
        assert!(!second.passed && second.n_misplaced == 256, "{second:#?}");
    }
}

#[test]
fn pictures_that_do_not_follow_from_the_light_fail() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let (image, attributes) = solved.unfold(&visibility, 8, polygons());
    for layer in ["G", "radiosity.B", "irradiance.R"] {
        let mut tampered = image.clone();
        change(&mut tampered, tile(&attributes, "z0"), layer, |old, i, j| {
            1.00001 * old(i, j)
        });
        let report = check(&tampered, &attributes);
        assert!(!report.passed && report.n_inconsistent == 64, "{layer}: {report:#?}");
    }
    let black = Solved::new(black_cube(), 1);
    let (mut dark, dark_attributes) = black.unfold(&visibility, 8, polygons());
    change(&mut dark, tile(&dark_attributes, "z0"), "irradiance.R", |old, i, j| {
        1.1 * old(i, j)
    });
    assert_eq!(
        check(&dark, &dark_attributes).n_inconsistent,
        64,
        "nothing reflects: all irradiance is direct"
    );
    change(&mut dark, tile(&dark_attributes, "z0"), "direct.R", |_, _, _| f32::NAN);
    assert!(!check(&dark, &dark_attributes).passed);
}

/// Pixels in a shadow are compared as well: rays are unbiased there, or drawn again.
#[test]
fn shadows_are_compared() {
    let mut exitance = [[0.0; 3]; 6];
    exitance[5] = [1.0; 3];
    let mut builder = Builder {
        scene: box_scene(DVec3::ONE, exitance, [[0.0; 3]; 6]),
    };
    let black = builder.material([0.0; 3], [0.0; 3]);
    let block = builder.surface("block");
    let low = DVec3::new(0.4, 0.4, 0.0);
    let (x, y, z) = (DVec3::X * 0.2, DVec3::Y * 0.2, DVec3::Z * 0.3);
    builder.face(block, black, &rectangle(low + z, x, y));
    builder.face(block, black, &rectangle(low, z, y));
    builder.face(block, black, &rectangle(low + x, y, z));
    builder.face(block, black, &rectangle(low, x, z));
    builder.face(block, black, &rectangle(low + y, z, x));
    let scene = builder.scene;
    let mesh = radiosity::mesh::Mesh::new(&scene, radiosity::mesh::Subdivision::Uniform(1)).unwrap();
    let zero = radiosity::matrix::operator::Block::zeros(mesh.n_patches(), 3);
    let solved = Solved {
        scene,
        mesh,
        radiosity: zero.clone(),
        irradiance: zero.clone(),
        indirect: zero,
    };
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    for (settings, noisy) in [
        (with(DirectMethod::Polygons { n: n(64) }), false),
        (cosine_rays(64), true),
    ] {
        let (mut image, attributes) = solved.unfold(&visibility, 40, settings);
        let report = check(&image, &attributes);
        assert!(report.passed, "{report:#?}");
        assert_eq!(report.n_pixels, 6 * 1600);
        let row = |name: &str| report.walls.iter().find(|wall| wall.name == name).unwrap();
        // The lamp itself sees nothing bright, the walls see it whole, the floor around the block does not.
        assert!(report.complete && (report.n_drawn > 200) != noisy, "{report:#?}");
        assert_eq!(row("z1").n_checked, 1600);
        assert_eq!(row("x0").n_checked, 1600);
        assert!((row("x0").exact.unwrap()[0] - PERPENDICULAR).abs() < 1e-14);
        let floor = row("z0");
        assert_eq!(floor.n_checked, 1600);
        assert!(floor.exact.unwrap()[0] < PARALLEL - 0.005);
        assert_eq!(report.n_not_checkable, report.n_pixels - report.n_checked);
        // A wrong pixel in the open is found: without noise a slightly wrong one, with it one that no noise can make.
        let wall = tile(&attributes, "x0").clone();
        let top = (0..1600u32)
            .map(|k| (k % 40, k / 40))
            .find(|&(i, j)| {
                wall.point(f64::from(wall.left + i) + 0.5, f64::from(wall.top + j) + 0.5)
                    .z
                    > 0.9
            })
            .unwrap();
        let wrong = |value: f32| if noisy { 1.5 } else { 1.0001 * value };
        change(&mut image, &wall, "direct.G", |old, i, j| {
            let value = old(i, j);
            if (i, j) == top { wrong(value) } else { value }
        });
        assert_eq!(check(&image, &attributes).n_outside, 1);
    }
}

#[test]
fn images_that_cannot_be_verified_say_why() {
    let solved = Solved::new(black_cube(), 1);
    let visibility = BruteForce::new(&solved.scene);
    let (interpolated, described) = solved.unfold(&visibility, 8, RenderSettings::default());
    let error = verify_image(&interpolated, &described).unwrap_err();
    assert!(matches!(error, VerifyError::NoDirectPass) && error.to_string().contains("direct pass"));

    let (image, attributes) = solved.unfold(&visibility, 8, polygons());
    let mut perspective = attributes.clone();
    perspective.view = ViewDescription::Perspective(serde_json::json!({}));
    assert!(matches!(
        verify_image(&image, &perspective),
        Err(VerifyError::BadCamera(reason)) if reason.contains("eye")
    ));
    let mut dark = attributes.clone();
    dark.surfaces[0].polygons[0].exitance = [0.0; 3];
    assert!(matches!(verify_image(&image, &dark), Err(VerifyError::NoEmitter)));
    let mut partial = Image::new(image.width(), image.height());
    for layer in image.layers().iter().filter(|layer| layer.name != "direct.G") {
        partial.insert(&layer.name, layer.samples.clone());
    }
    assert!(matches!(verify_image(&partial, &attributes), Err(VerifyError::MissingLayer(name)) if name == "direct.G"));
    let mut shifted = attributes.clone();
    if let ViewDescription::Unfolded(layout) = &mut shifted.view {
        layout.tiles[0].left += 1000;
    }
    assert!(matches!(verify_image(&image, &shifted), Err(VerifyError::BadLayout(_))));
}

/// Sets one value of a layer.
fn set(image: &mut Image, layer: &str, index: usize, value: f32) {
    if let Some(old) = image.f32(layer) {
        let mut samples = old.to_vec();
        samples[index] = value;
        image.insert(layer, Samples::F32(samples));
    } else {
        let mut samples = image.u32(layer).unwrap().to_vec();
        samples[index] = value.to_bits();
        image.insert(layer, Samples::U32(samples));
    }
}

/// Every layer of every pixel is held against the scene, the view or the other layers, at least by a bound.
#[test]
fn a_wrong_number_in_any_layer_fails() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    for settings in [polygons(), cosine_rays(256), with(DirectMethod::Exact)] {
        let (image, attributes) = solved.unfold(&visibility, 8, settings);
        let right = check(&image, &attributes);
        assert!(right.passed, "{right:#?}");
        let floor = tile(&attributes, "z0");
        let pixel = (floor.top + 3) as usize * image.width() + floor.left as usize + 3;
        // The cross leaves the corners of the picture free.
        let gap = 0;
        assert_eq!(image.u32("patch").unwrap()[gap], u32::MAX);
        for layer in image.layers() {
            for value in [f32::NAN, 1e9, -1.0] {
                // Of patches it is not known how many there are, but none is on two faces.
                let is_open = layer.name == "patch" && !value.is_nan();
                for index in [pixel, gap] {
                    let mut wrong = image.clone();
                    set(&mut wrong, &layer.name, index, value);
                    let report = check(&wrong, &attributes);
                    assert!(!report.passed || (is_open && index == pixel), "{} {value}", layer.name);
                }
            }
        }
        // Another face's patch.
        let elsewhere = tile(&attributes, "z1");
        let other = (elsewhere.top + 3) as usize * image.width() + elsewhere.left as usize + 3;
        let patches = image.u32("patch").unwrap();
        let mut swapped = image.clone();
        set(&mut swapped, "patch", pixel, f32::from_bits(patches[other]));
        assert!(check(&swapped, &attributes).n_inconsistent > 0);
        let mut none = image.clone();
        set(&mut none, "patch", pixel, f32::from_bits(u32::MAX));
        assert_eq!(check(&none, &attributes).n_misplaced, 1);
    }
}

/// Layers that agree with each other can still not come from the scene.
#[test]
fn light_that_the_scene_cannot_make_fails() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let (image, attributes) = solved.unfold(&visibility, 8, with(DirectMethod::Exact));
    let scene = &solved.scene;
    for (added, expected) in [(0.0_f32, true), (100.0, false), (-0.5, false)] {
        let mut lit = image.clone();
        for tile in match &attributes.view {
            ViewDescription::Unfolded(layout) => &layout.tiles,
            ViewDescription::Perspective(_) => panic!("an unfolded view"),
        } {
            let material = scene
                .faces
                .iter()
                .find(|face| face.surface == tile.surface)
                .map(|face| &scene.materials[face.material.0 as usize])
                .unwrap();
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                #[expect(clippy::cast_possible_truncation, reason = "layers are f32")]
                let more = [
                    1.0,
                    material.reflectance[c],
                    material.reflectance[c] / std::f64::consts::PI,
                ]
                .map(|share| share as f32 * added);
                for (prefix, shift) in ["irradiance.", "radiosity.", ""].into_iter().zip(more) {
                    change(&mut lit, tile, &format!("{prefix}{name}"), |old, i, j| {
                        old(i, j) + shift
                    });
                }
            }
        }
        let report = check(&lit, &attributes);
        assert_eq!(report.passed, expected, "{added}: {report:#?}");
    }
}
