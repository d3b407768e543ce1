//! Faces that are cut at contact edges, and light that leaks where they are not.

use std::fmt::Write as _;

use glam::{DMat3, DVec3};
use serde_json::Value;
use tempfile::TempDir;

use crate::program::{document, radiosity, stderr, with_scene};

/// A turned room of 4 m × 4 m × 3 m with a wall across it, whose ends are so far from the bright side.
fn divided_room(feet: [f64; 2]) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let materials = "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\nKe 1\n";
    std::fs::write(directory.path().join("scene.mtl"), materials).unwrap();
    let turned = |x: f64, y: f64, z: u32| format!("v {} {} {z}\n", 0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
    let plan = [
        (0.0, 0.0),
        (4.0, 0.0),
        (4.0, 4.0),
        (0.0, 4.0),
        (feet[0], 0.0),
        (feet[1], 4.0),
    ];
    let levels = [0, 3].into_iter();
    let vertices: String = levels.flat_map(|z| plan.map(|(x, y)| turned(x, y, z))).collect();
    let faces = [
        ("floor", "1 2 3 4"),
        ("ceiling", "10 9 8 7"),
        ("front", "7 11 5 1"),
        ("front_dark", "11 8 2 5"),
        ("dark", "8 9 3 2"),
        ("back_dark", "9 12 6 3"),
        ("back", "12 10 4 6"),
        ("wall", "5 6 12 11"),
        ("wall_dark", "11 12 6 5"),
    ];
    let faces = faces.map(|(name, corners)| format!("o {name}\nf {corners}\n")).concat();
    let lamp = "usemtl lamp\no lamp\nf 10 7 1 4\n";
    let text = format!("mtllib scene.mtl\n{vertices}usemtl grey\n{faces}{lamp}");
    std::fs::write(directory.path().join("scene.obj"), text).unwrap();
    directory
}

/// Returns the mean radiosity of a surface, or the greatest of those whose names begin so, up to a `_` at the end.
#[track_caller]
fn brightest(result: &Value, beginning: &str) -> f64 {
    let surfaces = result["surfaces"].as_array().unwrap().iter();
    let own: Vec<f64> = surfaces
        .filter(|surface| {
            let name = surface["name"].as_str().unwrap();
            name == beginning || (beginning.ends_with('_') && name.starts_with(beginning))
        })
        .map(|surface| surface["radiosity"][0].as_f64().unwrap())
        .collect();
    assert!(!own.is_empty(), "{beginning}");
    own.into_iter().fold(0.0, f64::max)
}

/// How a sealed room is drawn.
struct Drawn {
    turn: DMat3,
    away: DVec3,
    in_triangles: bool,
    /// Where its walls end over the ground.
    above: f64,
    /// By how much the ground rises with x; the walls go through it then.
    slope: f64,
    /// Whether the outer walls are the other sides of the inner ones.
    is_sheet: bool,
    /// Whether its walls are of several faces that meet in T-junctions, inner and outer ones in different places.
    in_panels: bool,
}

const PLAIN: Drawn = Drawn {
    turn: DMat3::IDENTITY,
    away: DVec3::ZERO,
    in_triangles: false,
    above: 0.0,
    slope: 0.0,
    is_sheet: false,
    in_panels: false,
};

/// A closed room, askew on a ground below a bright sky.
fn sealed_room(drawn: &Drawn) -> TempDir {
    let base = |x: f64| if drawn.slope > 0.0 { -0.3 } else { drawn.above + 0.0 * x };
    let askew = DMat3::from_rotation_z(0.3);
    let mut faces: Vec<(String, [DVec3; 4])> = Vec::new();
    let ground = |x: f64, y: f64| DVec3::new(x, y, drawn.slope * x);
    faces.push((
        "ground".into(),
        [
            ground(-10.0, -8.0),
            ground(11.0, -8.0),
            ground(11.0, 7.0),
            ground(-10.0, 7.0),
        ],
    ));
    let thickness = if drawn.is_sheet { 0.0 } else { 0.33 };
    for (name, t, cuts) in [
        ("in", 0.0, [0.0, 0.3, 0.7, 1.0]),
        ("out", thickness, [0.0, 0.4, 0.6, 1.0]),
    ] {
        let plan = [
            (-2.0 - t, -1.5 - t),
            (2.0 + t, -1.5 - t),
            (2.0 + t, 1.7 + t),
            (-2.0 - t, 1.7 + t),
        ];
        let at = |k: usize, z: f64| askew * DVec3::new(plan[k % 4].0, plan[k % 4].1, z);
        let top = 2.7 + t;
        let mut add = |name: String, mut corners: [DVec3; 4]| {
            if name.starts_with("in") {
                corners.reverse();
            }
            faces.push((name, corners));
        };
        for k in 0..4 {
            let (low, high) = ([at(k, base(0.0)), at(k + 1, base(0.0))], [at(k, top), at(k + 1, top)]);
            let spans = if drawn.in_panels { 3 } else { 1 };
            for span in 0..spans {
                let ends = if drawn.in_panels {
                    [cuts[span], cuts[span + 1]]
                } else {
                    [0.0, 1.0]
                };
                let [a, b] = ends.map(|s| low[0].lerp(low[1], s));
                let [d, c] = ends.map(|s| high[0].lerp(high[1], s));
                add(format!("{name}_{k}"), [a, b, c, d]);
            }
        }
        add(format!("{name}_top"), [0, 1, 2, 3].map(|k| at(k, top)));
    }
    faces.push((
        "sky".into(),
        [(-10.0, -8.0), (-10.0, 7.0), (11.0, 7.0), (11.0, -8.0)].map(|(x, y)| DVec3::new(x, y, 8.0)),
    ));
    let mut known: Vec<DVec3> = Vec::new();
    let (mut vertices, mut text) = (String::new(), String::new());
    for (name, corners) in &faces {
        let ids = corners.map(|corner| {
            let place = drawn.turn * corner + drawn.away;
            known.iter().position(|other| *other == place).unwrap_or_else(|| {
                known.push(place);
                let _ = writeln!(vertices, "v {:?} {:?} {:?}", place.x, place.y, place.z);
                known.len() - 1
            }) + 1
        });
        let [a, b, c, d] = ids;
        let material = if name == "sky" { "sky" } else { "grey" };
        let _ = write!(text, "o {name}\nusemtl {material}\nf {a} {b} {c}");
        let _ = if drawn.in_triangles {
            writeln!(text, "\nf {a} {c} {d}")
        } else {
            writeln!(text, " {d}")
        };
    }
    let directory = tempfile::tempdir().unwrap();
    let materials = "newmtl grey\nKd 0.7\nnewmtl sky\nKd 0\nKe 100\n";
    std::fs::write(directory.path().join("scene.mtl"), materials).unwrap();
    let text = format!("mtllib scene.mtl\n{vertices}{text}");
    std::fs::write(directory.path().join("scene.obj"), text).unwrap();
    directory
}

fn turned(seed: f64) -> Drawn {
    Drawn {
        turn: DMat3::from_euler(glam::EulerRot::XYZ, 0.7 * seed, 1.1, -2.0 * seed),
        away: DVec3::new(100.0 * seed, 3.0, -40.0),
        ..PLAIN
    }
}

/// However a closed room is drawn and cut, it is dark: up to a part in 1e8 of the sky's light, which the tolerances of form factors and solver leave.
#[test]
fn no_light_reaches_a_sealed_room() {
    let rooms = [
        PLAIN,
        turned(1.0),
        Drawn {
            in_triangles: true,
            ..turned(2.0)
        },
        Drawn {
            above: 1e-9,
            ..turned(3.0)
        },
        Drawn {
            above: 3e-15,
            in_triangles: true,
            ..PLAIN
        },
        Drawn { above: 1e-7, ..PLAIN },
        Drawn {
            above: 5e-6,
            ..turned(0.3)
        },
        Drawn {
            above: 1e-5,
            in_triangles: true,
            ..turned(0.6)
        },
        Drawn {
            above: 1e-4,
            in_panels: true,
            ..turned(0.2)
        },
        Drawn {
            above: 1e-3,
            is_sheet: true,
            ..PLAIN
        },
        Drawn {
            above: 1e-3,
            ..turned(0.4)
        },
        Drawn {
            above: -1e-9,
            ..turned(4.0)
        },
        Drawn { above: -0.2, ..PLAIN },
        Drawn {
            slope: 0.05,
            ..turned(5.0)
        },
        Drawn {
            is_sheet: true,
            ..turned(6.0)
        },
        Drawn {
            in_panels: true,
            ..turned(7.0)
        },
    ];
    for (k, room) in rooms.iter().enumerate() {
        let directory = sealed_room(room);
        let finer = [
            ["--subdivide", "2"],
            ["--subdivide", "3"],
            ["--max-edge", "4"],
            ["--max-edge", "2.7"],
        ];
        for cut in [&[][..], &finer[k % 4]] {
            // Slits take long to be known well.
            let has_slit = room.above > 1e-8;
            if has_slit && k % 2 > 0 && !cut.is_empty() {
                continue;
            }
            let tolerance = if has_slit { "1e-5" } else { "1e-6" };
            let solve = ["solve", "scene.obj", "--quiet", "--form-factor-tolerance", tolerance];
            let (code, solved) = document(directory.path(), &[&solve, cut].concat());
            assert_eq!(code, 0, "{k} {cut:?}: {}", solved["warnings"]);
            assert!(solved["n_cut_faces"].as_u64().unwrap() > 0, "{k} {cut:?}");
            assert_eq!(solved["light_leak"], Value::Null);
            let inside = brightest(&solved, "in_");
            // Light does pass below walls that end in the air: through a slit that is as long as deep, less than its share of the lower walls, squared.
            let slit = if room.is_sheet {
                30.0 * room.above
            } else {
                100.0 * room.above.powi(2)
            };
            let unknown = if has_slit { 1e-4 } else { 1e-6 };
            assert!(inside < unknown + slit.max(0.0), "{k} {cut:?}: {inside}");
            assert!(brightest(&solved, "out_") > 1.0, "{k} {cut:?}");
        }
    }
}

/// A room of 8 m × 4 m × 3 m, parted by a wall of two sides that ends so far from floor, ceiling and walls, which are of two faces each or of one.
fn parted_room(gap: f64, turn: DMat3, by_hand: bool) -> TempDir {
    let at = |x: f64, y: f64, z: f64| turn * DVec3::new(x, y, z) + DVec3::new(1.0, 2.0, 3.0);
    let across = |x: f64, gap: f64| {
        [
            at(x, gap, gap),
            at(x, 4.0 - gap, gap),
            at(x, 4.0 - gap, 3.0 - gap),
            at(x, gap, 3.0 - gap),
        ]
    };
    let back = |mut corners: [DVec3; 4]| {
        corners.reverse();
        corners
    };
    let mut faces = vec![
        ("lamp", across(0.0, 0.0)),
        ("end", back(across(8.0, 0.0))),
        ("dark", across(5.0, gap)),
        ("bright", back(across(5.0, gap))),
    ];
    let spans = if by_hand { &[0.0, 5.0, 8.0][..] } else { &[0.0, 8.0] };
    for span in spans.windows(2) {
        let (a, b) = (span[0], span[1]);
        let level = |z: f64| [at(a, 0.0, z), at(b, 0.0, z), at(b, 4.0, z), at(a, 4.0, z)];
        let side = |y: f64| [at(a, y, 0.0), at(a, y, 3.0), at(b, y, 3.0), at(b, y, 0.0)];
        let own = [
            ("floor", level(0.0)),
            ("ceiling", back(level(3.0))),
            ("front", side(0.0)),
            ("back", back(side(4.0))),
        ];
        faces.extend(own);
    }
    let mut text = "mtllib scene.mtl\n".to_owned();
    for (k, (name, corners)) in faces.iter().enumerate() {
        for place in corners {
            let _ = writeln!(text, "v {:?} {:?} {:?}", place.x, place.y, place.z);
        }
        let material = if *name == "lamp" { "lamp" } else { "grey" };
        let first = 4 * k + 1;
        let _ = writeln!(
            text,
            "g {name}\nusemtl {material}\nf {first} {} {} {}",
            first + 1,
            first + 2,
            first + 3
        );
    }
    let directory = tempfile::tempdir().unwrap();
    let materials = "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0\nKe 100\n";
    std::fs::write(directory.path().join("scene.mtl"), materials).unwrap();
    std::fs::write(directory.path().join("scene.obj"), text).unwrap();
    directory
}

/// Beyond a wall that ends short of all others arrives what passes through the slits, and no more: as much as where floor and walls are drawn in two faces each.
#[test]
fn walls_that_end_short_of_walls_let_through_what_their_slits_do() {
    let turns = [DMat3::from_euler(glam::EulerRot::XYZ, 0.7, 1.1, -2.0), DMat3::IDENTITY];
    for (k, gap) in [0.0, 1e-9, 5e-6, 1e-4, 1e-3].into_iter().enumerate() {
        let edge = if k < 3 { "5" } else { "2.5" };
        let tolerance = ["--form-factor-tolerance", "1e-5"];
        let flags = [&["solve", "scene.obj", "--quiet", "--max-edge", edge][..], &tolerance].concat();
        let solved = [false, true].map(|by_hand| {
            let directory = parted_room(gap, turns[k % 2], by_hand);
            document(directory.path(), &flags)
        });
        let codes = solved.each_ref().map(|run| run.0);
        assert_eq!(codes, [0, 0], "{gap:e}: {}", solved[0].1["warnings"]);
        assert_eq!(solved[0].1["n_cut_faces"], 4, "{gap:e}");
        for name in ["end", "dark"] {
            let [found, expected] = [0, 1].map(|which: usize| brightest(&solved[which].1, name));
            assert!(
                (found - expected).abs() < 1e-5 + 0.01 * expected && expected < 1e-5 + 20.0 * gap,
                "{gap:e} {name}: {found:e} {expected:e}"
            );
        }
        assert!(brightest(&solved[0].1, "bright") > 5.0);
    }
}

/// Rays find no way in either, nor do the points of rules.
#[test]
fn no_method_sees_into_a_sealed_room() {
    let room = Drawn {
        in_panels: true,
        ..turned(1.0)
    };
    for room in [PLAIN, room] {
        let directory = sealed_room(&room);
        for method in ["centre", "pdm", "sr", "sg5", "gauss-lambert", "contour", "qmc"] {
            for cut in ["1", "2"] {
                let flags = [
                    "solve",
                    "scene.obj",
                    "--quiet",
                    "--method",
                    method,
                    "--points",
                    "3",
                    "--subdivide",
                    cut,
                ];
                let flags: Vec<&str> = if matches!(method, "pdm" | "gauss-lambert" | "contour") {
                    flags.to_vec()
                } else {
                    flags
                        .into_iter()
                        .filter(|flag| !["--points", "3"].contains(flag))
                        .collect()
                };
                let (_, solved) = document(directory.path(), &flags);
                let inside = brightest(&solved, "in_");
                assert!(inside < 1e-6, "{method} {cut}: {inside}");
            }
        }
    }
}

/// Whole faces leak: the run says how much, and does not end as if all were well.
#[test]
fn light_that_leaks_through_whole_faces_is_told() {
    let directory = divided_room([2.9, 3.1]);
    for flags in [&["--subdivide", "1"][..], &["--subdivide", "4"], &["--max-edge", "0.4"]] {
        let solve = |more: &[&str]| {
            let arguments = [&["solve", "scene.obj"], flags, more].concat();
            let output = radiosity(directory.path(), &[&arguments[..], &["--json"]].concat());
            let result: Value = serde_json::from_slice(&output.stdout).unwrap();
            (output.status.code().unwrap(), result, stderr(&output))
        };
        let (code, cut, said) = solve(&[]);
        assert_eq!((code, said.as_str()), (0, ""), "{flags:?}");
        // Floor and ceiling, which the wall crosses; elsewhere it stands along borders.
        assert_eq!(
            (&cut["n_cut_faces"], &cut["settings"]["cut_at_walls"]),
            (&2.into(), &true.into())
        );
        let dark = ["dark", "wall", "back_dark", "front_dark"];
        assert!(
            dark.iter().all(|name| brightest(&cut, name).to_bits() == 0),
            "{flags:?}"
        );
        assert!(brightest(&cut, "floor") > 0.1);
        // The flag of former times changes nothing.
        assert_eq!(solve(&["--cut-at-walls"]).1["surfaces"], cut["surfaces"]);

        let (code, whole, said) = solve(&["--no-cut"]);
        assert_eq!((code, &whole["n_cut_faces"]), (3, &0.into()), "{flags:?}");
        assert!(
            said.contains("that straddle contact edges") && said.contains("--no-cut"),
            "{said}"
        );
        assert!(whole["left_out"].to_string().contains("--no-cut"));
        let leak = |name: &str| whole["light_leak"][name].as_f64().unwrap();
        // What the dark half absorbs has leaked, and light that comes back from it or that only its own walls exchange counts too.
        let absorbed: f64 = whole["surfaces"]
            .as_array()
            .unwrap()
            .iter()
            .map(|surface| {
                let is_dark = dark.contains(&surface["name"].as_str().unwrap());
                let radiosity = surface["radiosity"][0].as_f64().unwrap();
                if is_dark {
                    surface["area_m2"].as_f64().unwrap() * radiosity
                } else {
                    0.0
                }
            })
            .sum();
        assert!(
            leak("power_w") > 0.5 * absorbed && leak("power_w") < 12.0,
            "{flags:?}: {absorbed} {}",
            leak("power_w")
        );
        assert!(leak("power_error_w") < 0.05 * leak("power_w"));
        // The lamp is 12 m² large and emits 1 W/m².
        assert!((leak("relative") - leak("power_w") / 12.0).abs() < 1e-12);
    }
}

/// Of a floor and a ceiling of 2 m × 1 m below and above a wall that parts them in halves, half of what arrives on each side leaves on the other: A Σ w (1 − w) = 1 m² each.
#[test]
fn the_exchange_area_that_leaks_is_told() {
    let directory = tempfile::tempdir().unwrap();
    let text = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 1\nv 2 0 1\nv 2 1 1\nv 0 1 1\nv 1 0 0\nv 1 1 0\nv 1 1 1\nv 1 0 1\n\
        o floor\nf 1 2 3 4\no ceiling\nf 8 7 6 5\no x0\nf 1 4 8 5\no x1\nf 2 6 7 3\no wall\nf 9 10 11 12\no other\nf 12 11 10 9\n\
        o y0\nf 1 5 12 9\nf 9 12 6 2\no y1\nf 4 10 11 8\nf 10 3 7 11\n";
    std::fs::write(directory.path().join("scene.obj"), text).unwrap();
    let run = |more: &[&str]| {
        document(
            directory.path(),
            &[&["form-factors", "scene.obj", "--quiet"], more].concat(),
        )
    };
    let (code, whole) = run(&["--no-cut"]);
    assert_eq!((code, &whole["light_leak"]["n_patches"]), (3, &2.into()));
    let leak = |name: &str| whole["light_leak"][name].as_f64().unwrap();
    assert!((leak("exchange_area_m2") - 2.0).abs() < 1e-9, "{}", whole["light_leak"]);
    assert!((leak("relative") - 2.0 / 12.0).abs() < 1e-9);
    // Between surfaces, factors do not depend on how these are cut.
    let (code, cut) = run(&[]);
    assert_eq!((code, &cut["n_cut_faces"]), (0, &2.into()));
    let numbers = |result: &Value| -> Vec<f64> {
        let text = result["surface_form_factor"].to_string();
        text.split(['[', ']', ',']).filter_map(|x| x.parse().ok()).collect()
    };
    let (one, other) = (numbers(&whole), numbers(&cut));
    assert_eq!(one.len(), 64);
    assert!(
        one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-6),
        "{one:?} {other:?}"
    );
}

#[test]
fn a_scene_without_contact_edges_says_so() {
    let directory = with_scene("cube");
    for flags in [&[][..], &["--no-cut"]] {
        let (code, result) = document(directory.path(), &[&["form-factors", "scene.obj"], flags].concat());
        assert_eq!(
            (code, &result["n_cut_faces"], &result["n_patches"]),
            (0, &0.into(), &6.into())
        );
        assert_eq!(result["light_leak"], Value::Null);
        assert_eq!(
            result["left_out"].to_string().contains("none crosses a face"),
            flags.is_empty()
        );
    }
}

#[test]
fn form_factors_are_used_again_on_the_patches_that_they_are_for() {
    let directory = divided_room([2.9, 3.1]);
    let run = |arguments: &[&str]| document(directory.path(), arguments);
    let made = run(&["form-factors", "scene.obj", "-o", "cut.npz", "--subdivide", "2"]).1;
    let whole = run(&[
        "form-factors",
        "scene.obj",
        "-o",
        "whole.npz",
        "--subdivide",
        "2",
        "--no-cut",
    ])
    .1;
    for flags in [&[][..], &["--subdivide", "2"], &["--cut-at-walls"]] {
        let (code, solved) = run(&[&["solve", "scene.obj", "--form-factors", "cut.npz"], flags].concat());
        assert_eq!((code, &solved["n_patches"]), (0, &made["n_patches"]), "{flags:?}");
        // Those of whole faces leak, whatever is asked for.
        let (code, solved) = run(&[&["solve", "scene.obj", "--form-factors", "whole.npz"], flags].concat());
        assert_eq!((code, &solved["n_patches"]), (3, &whole["n_patches"]), "{flags:?}");
        assert!(
            solved["warnings"]
                .to_string()
                .contains("compute the form factors again")
        );
    }
    let arguments = ["solve", "scene.obj", "--form-factors", "cut.npz", "--no-cut"];
    let refused = radiosity(directory.path(), &arguments);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("cut.npz is for --subdivide 2 without --no-cut"));
}

#[test]
fn images_and_sequences_have_patches_that_end_at_walls_wherever_these_come_to_stand() {
    let directory = divided_room([2.9, 3.1]);
    let render = |more: &[&str]| {
        let cheap = ["render", "scene.obj", "-o", "out.exr", "--width", "8", "--quiet"];
        document(directory.path(), &[&cheap, more].concat())
    };
    for flags in [&[][..], &["--max-edge", "1.5"]] {
        let (code, result) = render(flags);
        assert_eq!((code, &result["n_cut_faces"]), (0, &2.into()), "{flags:?}");
    }
    assert_eq!(render(&["--max-edge", "1.5", "--no-cut"]).0, 3);
    // Half a metre towards the light.
    let frames = "[[frame]]\nname = \"a\"\n[[frame]]\nname = \"b\"\n[[frame.move]]\nsurface = [\"wall\", \"wall_dark\"]\ntranslate = [-0.4, -0.3, 0]\n";
    std::fs::write(directory.path().join("frames.toml"), frames).unwrap();
    let (code, result) = render(&["--frames", "frames.toml", "--max-edge", "1.5"]);
    assert_eq!(code, 0, "{}", result["warnings"]);
    for frame in result["frames"].as_array().unwrap() {
        for name in ["dark", "wall", "back_dark", "front_dark"] {
            assert!(brightest(frame, name) < 1e-9, "{name}: {frame}");
        }
        assert!(brightest(frame, "floor") > 0.05);
    }
}
