//! Scene files of all formats, cut short, mutated, or with false sizes: no panic, one line that names the file, and no memory for false sizes.

use std::path::{Path, PathBuf};

use radiosity::scene::{Format, LoadOptions, load_with};
use rand_pcg::Pcg64Dxsm;
use rand_pcg::rand_core::Rng as _;

use crate::program::limited;

const DATA: &str = "tests/data/formats";

/// One file of each encoding, with the name of its format.
const FILES: [&str; 26] = [
    "triangles-trimesh-binary.stl",
    "triangles-meshio-ascii.stl",
    "quads-meshio-ascii.ply",
    "quads-meshio-binary.ply",
    "quads-vtk-big-endian.ply",
    "quads-gmsh-22-ascii.msh",
    "quads-gmsh-22-binary.msh",
    "quads-gmsh-41-ascii.msh",
    "quads-gmsh-41-binary.msh",
    "quads-meshio-41-binary.msh",
    "quads-meshio-ascii.vtk",
    "quads-pyvista-binary.vtk",
    "quads-pyvista-grid.vtk",
    "triangles-gmsh.vtk",
    "quads-meshio-base64.vtu",
    "quads-meshio-zlib.vtu",
    "quads-pyvista-binary.vtu",
    "quads-pyvista-binary.vtp",
    "triangles-vtk-appended-raw.vtu",
    "triangles-vtk-appended-base64-zlib.vtu",
    "quads-vtk-appended-raw-zlib.vtp",
    "quads-vtk-appended-base64.vtp",
    "triangles-trimesh.glb",
    "triangles-trimesh.gltf",
    "view3d/l-room-by-origins.vs3",
    "view3d/window-mask-null.vs3",
];

/// A folder in memory, where the system has one.
fn folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() {
        tempfile::tempdir_in(memory).unwrap()
    } else {
        tempfile::tempdir().unwrap()
    }
}

/// Reads what a format is forced on; a refusal is one line that names the file. Returns whether it was read.
fn attempt(path: &Path, format: Format, bytes: &[u8]) -> bool {
    std::fs::write(path, bytes).unwrap();
    let options = LoadOptions::default().format(Some(format));
    match load_with(path, &options) {
        Ok(loaded) => {
            for warning in &loaded.warnings {
                assert_eq!(warning.to_string().lines().count(), 1, "{warning}");
            }
            for face in loaded.scene.face_ids() {
                assert!(loaded.scene.area_vector(face).length() > 0.0);
            }
            true
        }
        Err(error) => {
            let message = error.to_string();
            assert_eq!(message.lines().count(), 1, "{message}");
            assert!(message.contains("scene"), "no file named: {message}");
            assert!(!message.chars().any(char::is_control), "{message}");
            false
        }
    }
}

fn original(name: &str) -> (Vec<u8>, Format) {
    let path = Path::new(DATA).join(name);
    let format = Format::of(&path).unwrap();
    (std::fs::read(path).unwrap(), format)
}

#[test]
fn files_that_are_cut_anywhere_are_refused_in_one_line() {
    let directory = folder();
    let path = directory.path().join("scene");
    for name in FILES {
        let (bytes, format) = original(name);
        assert!(attempt(&path, format, &bytes), "{name}");
        let read: Vec<usize> = (0..bytes.len())
            .filter(|n| attempt(&path, format, &bytes[..*n]))
            .collect();
        // What ends behind the last face may be whole; a text without a mark of its end may be cut in its last number.
        let first = read.first().copied().unwrap_or(bytes.len());
        let is_text = ["ascii.stl", "vs3", ".vtk", "msh", "gltf", "ply"]
            .iter()
            .any(|part| name.contains(part));
        // View3D's input is whole after every surface.
        let least = if name.ends_with("vs3") {
            continue;
        } else if is_text {
            bytes.len() / 3
        } else {
            bytes.len() * 9 / 10
        };
        assert!(first >= least, "{name}: {first} of {} bytes are read", bytes.len());
    }
}

#[test]
fn mutated_files_are_read_or_refused_in_one_line() {
    let directory = folder();
    let path = directory.path().join("scene");
    let mut random = Pcg64Dxsm::new(41, 1);
    let mut below = |n: usize| usize::try_from(random.next_u64() % n.max(1) as u64).unwrap();
    let mut n_read = 0;
    for name in FILES {
        let (bytes, format) = original(name);
        for _ in 0..150 {
            let mut mutated = bytes.clone();
            for _ in 0..=below(4) {
                let at = below(mutated.len());
                match below(5) {
                    0 => mutated[at] ^= 1 << below(8),
                    1 => mutated[at] = b"0-9e.$<{\n \xff"[below(11)],
                    2 => {
                        let end = (at + below(20)).min(mutated.len());
                        mutated.drain(at..end);
                    }
                    3 => {
                        let piece: Vec<u8> = mutated
                            .iter()
                            .skip(below(bytes.len()))
                            .take(below(40))
                            .copied()
                            .collect();
                        mutated.splice(at..at, piece);
                    }
                    _ => {
                        let end = (at + 4).min(mutated.len());
                        mutated[at..end].fill(0xff);
                    }
                }
                if mutated.is_empty() {
                    break;
                }
            }
            n_read += usize::from(attempt(&path, format, &mutated));
        }
    }
    assert!(n_read > 50, "{n_read}");
}

/// Replaces the first place of some bytes.
fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from).unwrap();
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

/// Within 1 GB of address space, headers that claim billions are refused in one line.
#[test]
fn headers_that_lie_take_no_memory() {
    let directory = folder();
    let read = |name: &str| original(name).0;
    let mut stl = read("triangles-trimesh-binary.stl");
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let half_a_gb = 500_000_000_u32.to_le_bytes();
    let mut glb = read("triangles-trimesh.glb");
    let chunk = glb.windows(4).position(|kind| kind == b"BIN\0").unwrap();
    glb[chunk - 4..chunk].copy_from_slice(&half_a_gb);
    let mut appended = read("triangles-vtk-appended-raw.vtu");
    let first = appended.windows(5).position(|end| end == b"\n   _").unwrap() + 5;
    appended[first..first + 4].copy_from_slice(&half_a_gb);
    let huge =
        |name: &str, from: &str, to: &str| (name.to_owned(), replaced(&read(name), from.as_bytes(), to.as_bytes()));
    let binary = |name: &str, from: &[u8], to: &[u8]| (name.to_owned(), replaced(&read(name), from, to));
    let sixteen = 16_u64.to_le_bytes();
    let many = (1_u64 << 40).to_le_bytes();
    let cases = [
        ("triangles-trimesh-binary.stl".to_owned(), stl),
        huge(
            "quads-meshio-ascii.ply",
            "element vertex 16",
            "element vertex 4000000000",
        ),
        huge(
            "quads-meshio-binary.ply",
            "element vertex 16",
            "element vertex 40000000000",
        ),
        huge("quads-meshio-binary.ply", "element face 12", "element face 40000000000"),
        huge("quads-gmsh-22-ascii.msh", "$Nodes\n16", "$Nodes\n16000000000"),
        huge("quads-gmsh-22-binary.msh", "$Elements\n12", "$Elements\n12000000000"),
        binary(
            "quads-gmsh-41-binary.msh",
            &[b"$Nodes\n", &7_u64.to_le_bytes()[..], &sixteen].concat(),
            &[b"$Nodes\n", &7_u64.to_le_bytes()[..], &many].concat(),
        ),
        huge(
            "quads-gmsh-41-ascii.msh",
            "$Entities\n0 0 7 0",
            "$Entities\n0 0 7000000000 0",
        ),
        huge("quads-meshio-ascii.vtk", "POINTS 16", "POINTS 16000000000"),
        huge("quads-pyvista-binary.vtk", "POINTS 16", "POINTS 9223372036854775807"),
        huge("quads-pyvista-grid.vtk", "CELLS 13 48", "CELLS 13000000000 48000000000"),
        huge("quads-pyvista-grid.vtk", "CELL_TYPES 12", "CELL_TYPES 12000000000"),
        huge(
            "quads-meshio-base64.vtu",
            "NumberOfPoints=\"16\"",
            "NumberOfPoints=\"16000000000\"",
        ),
        huge(
            "quads-meshio-zlib.vtu",
            "NumberOfCells=\"12\"",
            "NumberOfCells=\"18446744073709551615\"",
        ),
        huge("quads-meshio-binary.vtk", "POINTS 16", "POINTS 22000000"),
        huge("quads-meshio-22-binary.msh", "$Nodes\n16", "$Nodes\n18000000"),
        huge(
            "quads-pyvista-binary.vtu",
            "NumberOfPoints=\"16\"",
            "NumberOfPoints=\"42000000\"",
        ),
        ("triangles-trimesh.glb".to_owned(), glb),
        ("appended.vtu".to_owned(), appended),
        huge("triangles-trimesh.gltf", "\"count\":36", "\"count\":3600000000000"),
        huge("triangles-trimesh.gltf", "\"byteLength\":", "\"byteLength\":9999999999"),
    ];
    for (name, bytes) in cases {
        let path: PathBuf = directory.path().join(Path::new(&name).file_name().unwrap());
        std::fs::write(&path, &bytes).unwrap();
        let shell = "ulimit -v 1000000; exec timeout -k 1 20";
        let file = path.to_str().unwrap();
        let output = limited(directory.path(), shell, &["form-factors", file, "--threads", "1"])
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{name}: {message}");
        assert_eq!(message.lines().count(), 1, "{name}: {message}");
        assert!(
            message.contains(Path::new(&name).file_name().unwrap().to_str().unwrap()),
            "{message}"
        );
    }
}

/// A pipe can be read once, and nothing in it twice or out of order.
#[cfg(unix)]
#[test]
fn a_pipe_gives_the_scene_of_the_file() {
    let directory = folder();
    for name in FILES {
        let (bytes, format) = original(name);
        let options = LoadOptions::default().format(Some(format));
        let pipe = directory.path().join(Path::new(name).file_name().unwrap());
        let is_made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(is_made.unwrap().success());
        let scene = std::thread::scope(|scope| {
            scope.spawn(|| std::fs::write(&pipe, bytes).unwrap());
            load_with(&pipe, &options).unwrap().scene
        });
        let expected = load_with(Path::new(DATA).join(name), &options).unwrap().scene;
        assert_eq!(format!("{scene:?}"), format!("{expected:?}"), "{name}");
    }
}
