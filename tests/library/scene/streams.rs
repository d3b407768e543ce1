//! Binary files that are longer than the part that is read at once.

use std::fmt::Write as _;
use std::path::Path;

use radiosity::scene::{Scene, load};

/// Vertices along a side of the mesh: its files have some megabytes.
const SIDE: u32 = 180;

/// A face with a list of its own that is longer than what is read at once.
const LONG: usize = 777;
const LONG_LIST: i32 = 3 << 20;

fn vertices() -> Vec<[f32; 3]> {
    let all = (0..SIDE * SIDE).map(|k| {
        let (x, y) = (k % SIDE, k / SIDE);
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let at = |n: u32| n as f32 * 0.125;
        [at(x), at(y), at((x * 7 + y * 5) % 11)]
    });
    all.collect()
}

/// Triangles, two of each square.
fn faces() -> Vec<[u32; 3]> {
    let squares = (0..SIDE * (SIDE - 1)).filter(|k| k % SIDE != SIDE - 1);
    squares
        .flat_map(|k| [[k, k + 1, k + SIDE + 1], [k, k + SIDE + 1, k + SIDE]])
        .collect()
}

fn in_ascii() -> Vec<u8> {
    let (vertices, faces) = (vertices(), faces());
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    );
    for [x, y, z] in vertices {
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    for [a, b, c] in faces {
        writeln!(text, "3 {a} {b} {c}").unwrap();
    }
    text.into_bytes()
}

/// The same in binary, with lists of several lengths between what counts.
fn in_binary(is_little: bool) -> Vec<u8> {
    let (vertices, faces) = (vertices(), faces());
    let order = if is_little { "little" } else { "big" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex {}\nproperty float x\nproperty list uchar short extra\n\
         property float y\nproperty float z\nelement face {}\nproperty list uchar int vertex_indices\n\
         property list int uchar note\nend_header\n",
        vertices.len(),
        faces.len()
    )
    .into_bytes();
    let float = |x: f32| if is_little { x.to_le_bytes() } else { x.to_be_bytes() };
    let whole = |x: i32| if is_little { x.to_le_bytes() } else { x.to_be_bytes() };
    for (k, [x, y, z]) in vertices.into_iter().enumerate() {
        bytes.extend(float(x));
        let n = u8::try_from(k % 5).unwrap();
        bytes.push(n);
        bytes.extend(std::iter::repeat_n(0xa5, 2 * usize::from(n)));
        bytes.extend([float(y), float(z)].concat());
    }
    for (k, face) in faces.into_iter().enumerate() {
        bytes.push(3);
        bytes.extend(face.into_iter().flat_map(|v| whole(v.cast_signed())));
        let n = if k == LONG {
            LONG_LIST
        } else {
            i32::try_from(k % 3).unwrap()
        };
        bytes.extend(whole(n));
        bytes.extend(std::iter::repeat_n(0x5a, usize::try_from(n).unwrap()));
    }
    bytes
}

fn in_stl() -> Vec<u8> {
    let (vertices, faces) = (vertices(), faces());
    let mut bytes = vec![b' '; 80];
    bytes.extend(u32::try_from(faces.len()).unwrap().to_le_bytes());
    for face in faces {
        bytes.extend([0; 12]);
        let corners = face.into_iter().flat_map(|v| vertices[v as usize]);
        bytes.extend(corners.flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

fn scene_of(directory: &Path, name: &str, bytes: &[u8]) -> Scene {
    let path = directory.join(name);
    std::fs::write(&path, bytes).unwrap();
    load(&path).unwrap_or_else(|error| panic!("{name}: {error}")).scene
}

#[test]
fn a_long_binary_file_has_what_its_text_has() {
    let directory = tempfile::tempdir().unwrap();
    let expected = scene_of(directory.path(), "text.ply", &in_ascii());
    assert_eq!(expected.faces.len(), faces().len());
    for (name, bytes) in [
        ("little.ply", in_binary(true)),
        ("big.ply", in_binary(false)),
        ("all.stl", in_stl()),
    ] {
        assert!(bytes.len() > 3 << 20, "longer than what is read at once");
        let scene = scene_of(directory.path(), name, &bytes);
        assert_eq!(scene.vertices, expected.vertices, "{name}");
        let corners = |of: &Scene| of.faces.iter().map(|face| face.corners).collect::<Vec<_>>();
        assert_eq!(corners(&scene), corners(&expected), "{name}");
    }
}

#[test]
fn a_long_binary_file_that_is_cut_or_lies_is_refused_in_one_line() {
    let directory = tempfile::tempdir().unwrap();
    for (name, bytes) in [("cut.ply", in_binary(true)), ("cut.stl", in_stl())] {
        let path = directory.path().join(name);
        for k in 1..12 {
            std::fs::write(&path, &bytes[..bytes.len() * k / 12]).unwrap();
            let message = load(&path).expect_err("it is cut short").to_string();
            assert!(
                message.contains("cut short") && message.lines().count() == 1,
                "{message}"
            );
        }
    }
    // The long list claims more than the file has behind it.
    let mut bytes = in_binary(true);
    let claimed = LONG_LIST.to_le_bytes();
    let at = bytes
        .windows(5)
        .position(|window| window[..4] == claimed && window[4] == 0x5a);
    bytes[at.unwrap()..][..4].copy_from_slice(&i32::MAX.to_le_bytes());
    let path = directory.path().join("lie.ply");
    std::fs::write(&path, &bytes).unwrap();
    let message = load(&path).expect_err("it lies").to_string();
    assert!(
        message.contains("the file states 2147483647 numbers in a list and has room for"),
        "{message}"
    );
}
