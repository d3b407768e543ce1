//! Fuzzer mutations of scenes, cameras, lightings, boundary conditions, lists of frames and tables: no panic, and every refusal is one line that names the file.
//!
//! What `fuzz/` does without end and guided by coverage, this does briefly in every run of the tests; the mutations are the same in every run.

use std::path::{Path, PathBuf};

use glam::DVec3;
use radiosity::heat::Boundary;
use radiosity::report::{points, sun_path};
use radiosity::scene::{Camera, Lighting, builtin, frames, load};
use rand_pcg::Pcg64Dxsm;
use rand_pcg::rand_core::Rng as _;

/// What a number of a file is replaced by.
const HOSTILE: &[&str] = &[
    "0",
    "-0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "1e15",
    "9999999999",
    "18446744073709551616",
    "-9223372036854775809",
    "1,5",
    "1/2/3",
    "//",
    "",
    "\u{feff}",
    "\\",
    "\0",
    "'",
    "[",
    "=",
    "#",
];

/// Mutations of one file that are tried.
const N_MUTATIONS: u64 = 150;

struct Mutator(Pcg64Dxsm);

impl Mutator {
    fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.0.next_u64() % n.max(1) as u64).unwrap()
    }

    /// Changes a text in one to four ways: bytes, words, lines.
    fn mutate(&mut self, original: &[u8]) -> Vec<u8> {
        let mut bytes = original.to_vec();
        for _ in 0..=self.below(4) {
            let n = bytes.len();
            match self.below(6) {
                0 if n > 0 => {
                    let place = self.below(n);
                    bytes[place] ^= 1 << self.below(8);
                }
                1 => bytes.truncate(self.below(n + 1)),
                2 => {
                    let (from, length) = (self.below(n), self.below(40));
                    let piece: Vec<u8> = bytes.iter().skip(from).take(length).copied().collect();
                    let at = self.below(n + 1);
                    bytes.splice(at..at, piece);
                }
                3 => {
                    let from = self.below(n);
                    let to = n.min(from + self.below(20));
                    bytes.drain(from..to);
                }
                4 => {
                    let mut lines: Vec<Vec<u8>> = bytes.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
                    let (a, b) = (self.below(lines.len()), self.below(lines.len()));
                    lines.swap(a, b);
                    bytes = lines.join(&b'\n');
                }
                _ => {
                    let mut words: Vec<Vec<u8>> = bytes.split(|b| *b == b' ').map(<[u8]>::to_vec).collect();
                    let k = self.below(words.len());
                    words[k] = HOSTILE[self.below(HOSTILE.len())].as_bytes().to_vec();
                    bytes = words.join(&b' ');
                }
            }
        }
        bytes
    }
}

/// Tries mutations of `original` under the name `path`, next to what it refers to.
fn try_all(path: &Path, original: &[u8], seed: u64, attempt: impl Fn(&Path) -> Result<(), String>) -> (u32, u32) {
    let mut mutator = Mutator(Pcg64Dxsm::new(seed.into(), 1));
    let (mut n_read, mut n_refused) = (0, 0);
    for k in 0..N_MUTATIONS {
        let bytes = mutator.mutate(original);
        std::fs::write(path, &bytes).unwrap();
        match attempt(path) {
            Ok(()) => n_read += 1,
            Err(message) => {
                n_refused += 1;
                let shown = String::from_utf8_lossy(&bytes);
                assert_eq!(message.lines().count(), 1, "mutation {k}: {message}\n{shown}");
                assert!(
                    message.contains(path.parent().unwrap().to_str().unwrap()),
                    "mutation {k}: {message}\n{shown}"
                );
            }
        }
    }
    (n_read, n_refused)
}

fn files(directory: &str, ending: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).unwrap();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|found| found == ending));
    paths.sort();
    paths
}

fn name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

#[test]
fn scenes() {
    let (mut n_read, mut n_refused) = (0, 0);
    for folder in [
        "tests/data/obj/valid",
        "tests/data/obj/valid/exporters",
        "tests/data/obj/invalid",
    ] {
        let directory = tempfile::tempdir().unwrap();
        let libraries = files(folder, "mtl");
        for library in &libraries {
            std::fs::copy(library, directory.path().join(name(library))).unwrap();
        }
        for (seed, scene) in (1..).zip(files(folder, "obj")) {
            let path = directory.path().join(name(&scene));
            let attempt = |file: &Path| load(file).map(drop).map_err(|error| error.to_string());
            let (read, refused) = try_all(&path, &std::fs::read(&scene).unwrap(), seed, attempt);
            n_read += read;
            n_refused += refused;
        }
        // The libraries, under a scene that uses all their materials.
        for (seed, library) in (1000..).zip(&libraries) {
            let text = std::fs::read(library).unwrap();
            let scene = directory.path().join("user.obj");
            std::fs::write(
                &scene,
                format!(
                    "mtllib {}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n",
                    name(library)
                ),
            )
            .unwrap();
            let attempt = |_: &Path| load(&scene).map(drop).map_err(|error| error.to_string());
            let path = directory.path().join(name(library));
            try_all(&path, &text, seed, attempt);
            std::fs::write(&path, &text).unwrap();
        }
    }
    assert!(
        n_read > 500 && n_refused > 500,
        "{n_read} read, {n_refused} refused: both ways are tried"
    );
}

const CAMERA: &str = "eye = [0.278, 0.273, -0.8]\ndirection = [0.0, 0.0, 1.0]\nup = [0.0, 1.0, 0.0]\nvertical_fov_degree = 39.3\nwidth = 512\nheight = 512\n";
const LIGHTING: &str =
    "[surface.x0]\nexitance = [1.0, 0.5, 0.25]\nreflectance = [0.5, 0.5, 0.5]\n\n[surface.z1]\nexitance = 2.0\n";
const FRAMES: &str =
    "[[frame]]\nname = \"noon\"\nlighting = \"noon.toml\"\n\n[[frame]]\nname = \"night-2.b\"\ncamera = \"unfolded\"\n";

const BOUNDARY: &str = "[surroundings]\ntemperature_k = 3.0\n\n[sun]\ndirection = [0.0, -0.985, 0.174]\nirradiance_w_m2 = 1361.0\nangular_radius_deg = 0.25\n\n\
     [sky]\nirradiance_w_m2 = 100.0\nup = [0.0, 0.0, 1.0]\n\n[[surface]]\nname = \"*\"\nemissivity = 0.95\nabsorptance = 0.88\ntemperature_k = 300.0\n\n\
     [[surface]]\nname = \"z*\"\nsupplied_w_m2 = -5.0\n";

const SUN: &str = "time,x,y,z,irradiance\n0,0.5,-0.5,0.7,800\n1.5,0.1,-0.2,1,950.5\n2,-0.6,0.1,0.2,400\n";
const PLACES: &str = "# a day\nirradiance,time,latitude,longitude\n0,2026-06-21T03:00:00+02:00,47.4,8.5\n900,2026-06-21T12:00:00+02:00,47.4,8.5\n";
const POINTS: &str = "name,x,y,z,nx,ny,nz\na,0.5,0.5,0.5,0,0,1\nb,0.25,0.5,1e-3,1,2,-2\nc,0.5,0.75,0.1,0,-1,0\n";

/// Reads a file; an error is what the user would see.
type Load = fn(&Path) -> Result<(), String>;

/// Reads a camera, and checks that it is one: what a picture needs of it is finite, and its own text says the same.
fn load_camera(file: &Path) -> Result<(), String> {
    let camera = Camera::load(file).map_err(|error| error.to_string())?;
    let text = std::fs::read_to_string(file).unwrap();
    for (x, y) in [(0.0, 0.0), (2.0, 1.5), (4.0, 3.0)] {
        let (origin, direction) = camera.primary_ray(x, y, 4, 3);
        assert!(origin.is_finite(), "{text}");
        // A few roundings of a unit vector.
        assert!((direction.length() - 1.0).abs() < 1e-14, "{direction}: {text}");
    }
    assert!(
        camera.width().is_none_or(|w| w > 0) && camera.height().is_none_or(|h| h > 0),
        "{text}"
    );
    let again = file.with_file_name("again.toml");
    camera.save(&again).unwrap();
    let same = Camera::load(&again).unwrap_or_else(|error| panic!("{error}: {text}"));
    assert_eq!(
        (same.eye(), same.width(), same.height()),
        (camera.eye(), camera.width(), camera.height())
    );
    assert!(same.direction().distance(camera.direction()) < 1e-14, "{text}");
    assert!(same.up().distance(camera.up()) < 1e-14, "{text}");
    Ok(())
}

/// Reads a lighting of the cube, and checks that the cube in its light is a valid scene.
fn load_lighting(file: &Path) -> Result<(), String> {
    let scene = builtin::build("cube", None).unwrap().scene;
    let lighting = Lighting::load(file, &scene).map_err(|error| error.to_string())?;
    let lit = lighting.apply(&scene);
    assert_eq!(lit.faces.len(), scene.faces.len());
    for material in &lit.materials {
        assert!(
            material.reflectance.iter().all(|rho| (0.0..=1.0).contains(rho)),
            "{material:?}"
        );
        assert!(
            material.exitance.iter().all(|e| e.is_finite() && *e >= 0.0),
            "{material:?}"
        );
    }
    Ok(())
}

/// Reads boundary conditions of the cube, and checks that all values are in range.
fn load_boundary(file: &Path) -> Result<(), String> {
    let scene = builtin::build("cube", None).unwrap().scene;
    let boundary = Boundary::load(file, &scene).map_err(|error| error.to_string())?;
    assert!(boundary.surroundings_k >= 0.0 && boundary.surroundings_k.is_finite());
    assert!(boundary.sun.is_none_or(|sun| sun.direction().is_normalized()));
    for surface in boundary.surfaces.iter().flatten() {
        assert!(surface.emissivity > 0.0 && surface.emissivity <= 1.0, "{surface:?}");
        assert!((0.0..=1.0).contains(&surface.absorptance), "{surface:?}");
    }
    Ok(())
}

/// Reads a list of frames, and checks that their names can be parts of different files' names.
fn load_frames(file: &Path) -> Result<(), String> {
    let list = frames::load(file).map_err(|error| error.to_string())?;
    assert!(!list.is_empty());
    for (k, frame) in list.iter().enumerate() {
        assert!(
            !frame.name.is_empty() && !frame.name.contains(['/', '\\', '\n', '\0']),
            "{frame:?}"
        );
        assert!(list[..k].iter().all(|other| other.name != frame.name), "{frame:?}");
    }
    Ok(())
}

/// Reads a path of the sun, and checks that times increase and that the sun is one.
fn load_sun_path(file: &Path) -> Result<(), String> {
    let path = sun_path::read(file, 0.25, [DVec3::Y, DVec3::Z]).map_err(|error| error.to_string())?;
    assert!(!path.steps.is_empty());
    assert!(path.steps.is_sorted_by(|a, b| a.time < b.time), "{path:?}");
    for step in &path.steps {
        assert!(step.time.is_finite() && step.direction.is_normalized(), "{step:?}");
        let strength = step.sun.map_or(1.0, |sun| sun.irradiance());
        assert!(strength > 0.0 && strength.is_finite(), "{step:?}");
    }
    Ok(())
}

/// Reads free points, and checks that all are finite and that normals have a length.
fn load_points(file: &Path) -> Result<(), String> {
    for query in points::read(file).map_err(|error| error.to_string())? {
        assert!(query.position.is_finite(), "{query:?}");
        assert!(
            query.normal.is_none_or(|own| own.try_normalize().is_some()),
            "{query:?}"
        );
    }
    Ok(())
}

/// Tables of the sun and of points.
#[test]
fn tables() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.csv");
    let kinds: [(&str, Load); 3] = [(SUN, load_sun_path), (PLACES, load_sun_path), (POINTS, load_points)];
    for (seed, (text, load)) in (2000..).step_by(100).zip(kinds) {
        std::fs::write(&path, text).unwrap();
        assert_eq!(load(&path), Ok(()));
        let (mut n_read, mut n_refused) = (0, 0);
        for k in 0..8 {
            let (read, refused) = try_all(&path, text.as_bytes(), seed + k, load);
            n_read += read;
            n_refused += refused;
        }
        // Of 1200: mutations that only change digits, blanks or names of other columns leave a valid table; times must increase.
        assert!(
            n_read > 20 && n_refused > 300,
            "{n_read} read, {n_refused} refused: {text}"
        );
    }
}

/// Each number of a table replaced by one that it must not be: refused, with its line.
#[test]
fn cells_that_are_no_numbers_are_refused_with_their_line() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.csv");
    let kinds: [(&str, Load); 3] = [(SUN, load_sun_path), (PLACES, load_sun_path), (POINTS, load_points)];
    for (text, load) in kinds {
        let lines: Vec<&str> = text.lines().collect();
        let head = lines.iter().position(|line| !line.starts_with('#')).unwrap();
        for (number, line) in lines.iter().enumerate().skip(head + 1) {
            for k in 0..line.split(',').count() {
                if lines[head].split(',').nth(k) == Some("name") {
                    continue;
                }
                for hostile in [
                    "nan", "-nan", "inf", "-inf", "1e999", "-1e999", "", "true", "1 2", "0x1",
                ] {
                    let mut cells: Vec<&str> = line.split(',').collect();
                    cells[k] = hostile;
                    let changed = cells.join(",");
                    let mut mutated = lines.clone();
                    mutated[number] = &changed;
                    std::fs::write(&path, mutated.join("\n")).unwrap();
                    let message = load(&path).expect_err(&changed);
                    let place = format!("a.csv:{}: ", number + 1);
                    assert!(
                        message.contains(&place) && message.lines().count() == 1,
                        "{message}: {changed}"
                    );
                }
            }
        }
    }
}

#[test]
fn cameras_lightings_and_frames() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.toml");
    let kinds: [(&str, Load); 4] = [
        (CAMERA, load_camera),
        (LIGHTING, load_lighting),
        (FRAMES, load_frames),
        (BOUNDARY, load_boundary),
    ];
    for (seed, (text, load)) in (100..).step_by(100).zip(kinds) {
        std::fs::write(&path, text).unwrap();
        assert_eq!(load(&path), Ok(()));
        let (mut n_read, mut n_refused) = (0, 0);
        for k in 0..8 {
            let (read, refused) = try_all(&path, text.as_bytes(), seed + k, load);
            n_read += read;
            n_refused += refused;
        }
        // Of 1200: a mutation that only changes digits, blanks or the order of lines leaves a valid file.
        assert!(
            n_read > 20 && n_refused > 600,
            "{n_read} read, {n_refused} refused: {text}"
        );
    }
}

/// Each number of a camera, of a lighting and of boundary conditions, replaced by one that it must not be: refused, with its line.
#[test]
fn numbers_that_are_none_are_refused_with_their_line() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.toml");
    let kinds: [(&str, Load); 3] = [
        (CAMERA, load_camera),
        (LIGHTING, load_lighting),
        (BOUNDARY, load_boundary),
    ];
    for (text, load) in kinds {
        let mut n_numbers = 0;
        for (number, line) in (1..).zip(text.lines()) {
            let Some((key, value)) = line.split_once(" = ") else {
                continue;
            };
            for part in value.split([',', '[', ']', ' ']).filter(|part| !part.is_empty()) {
                let places = value.match_indices(part).map(|(at, _)| at).filter(|&at| {
                    let ends = |c: Option<char>| c.is_none_or(|c| ",[] ".contains(c));
                    ends(value[..at].chars().next_back()) && ends(value[at + part.len()..].chars().next())
                });
                for at in places {
                    n_numbers += 1;
                    for hostile in ["nan", "-nan", "inf", "-inf", "1e999", "-1e999", "\"1\"", "true", "[]"] {
                        let changed = format!("{}{hostile}{}", &value[..at], &value[at + part.len()..]);
                        let mutated = text.replacen(line, &format!("{key} = {changed}"), 1);
                        std::fs::write(&path, &mutated).unwrap();
                        let message = load(&path).expect_err(&mutated);
                        let place = format!("a.toml:{number}: ");
                        assert!(
                            message.contains(&place) && message.lines().count() == 1,
                            "{message}: {mutated}"
                        );
                    }
                }
            }
        }
        assert!(n_numbers > 6, "{n_numbers} numbers in {text}");
    }
}
