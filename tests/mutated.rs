//! Scenes, cameras and lightings that a fuzzer's mutations made of the corpus: never a panic, and every refusal is one line that names the file.
//!
//! What `fuzz/` does without end and guided by coverage, this does briefly in every run of the tests; the mutations are the same in every run.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};

use radiosity::scene::{Camera, Lighting, load};
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

#[test]
fn cameras_and_lightings() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.toml");
    let camera = b"eye = [0.278, 0.273, -0.8]\ndirection = [0.0, 0.0, 1.0]\nup = [0.0, 1.0, 0.0]\nvertical_fov_degree = 39.3\nwidth = 512\nheight = 512\n";
    let load_camera = |file: &Path| Camera::load(file).map(drop).map_err(|error| error.to_string());
    std::fs::write(&path, camera).unwrap();
    load_camera(&path).unwrap();
    let (n_read, n_refused) = try_all(&path, camera, 7, load_camera);
    assert!(n_read > 0 && n_refused > 50, "{n_read} {n_refused}");
    let scene = load("scenes/cube/scene.obj").unwrap().scene;
    let lighting = b"[surface.x0]\nexitance = [1.0, 0.5, 0.0]\nreflectance = [0.5, 0.5, 0.5]\n\n[surface.z1]\nexitance = [2.0, 2.0, 2.0]\n";
    let load_lighting = |file: &Path| {
        Lighting::load(file, &scene)
            .map(drop)
            .map_err(|error| error.to_string())
    };
    std::fs::write(&path, lighting).unwrap();
    let first = load_lighting(&path);
    assert_eq!(first, Ok(()));
    let of_lightings = try_all(&path, lighting, 8, load_lighting);
    assert!(of_lightings.0 > 0 && of_lightings.1 > 50, "{of_lightings:?}");
}
