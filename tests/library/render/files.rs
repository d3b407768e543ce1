//! EXR and PNG files.

use std::num::NonZeroU32;

use radiosity::render::{DirectMethod, Image, RenderError, RenderSettings, Samples, exr, png};
use radiosity::visibility::embree::EmbreeVisibility;

use super::scenes::{Solved, bright_cube};

fn settings() -> RenderSettings {
    RenderSettings {
        direct: DirectMethod::CosineRays {
            n: NonZeroU32::new(16).unwrap(),
        },
        seed: 0xfedc_ba98_7654_3210,
        ..RenderSettings::default()
    }
}

#[test]
fn an_exr_file_gives_back_names_types_pixels_and_attributes() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let (image, attributes) = solved.unfold(&visibility, 20, settings());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.exr");
    exr::write(&path, &image, &attributes).unwrap();
    let (read, read_attributes) = exr::read(&path).unwrap();
    assert_eq!(read, image);
    assert_eq!(read_attributes, attributes);

    let mut expected = vec!["B", "G", "N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "R", "Z"];
    let prefixes = ["albedo", "direct", "direct_error", "irradiance", "radiosity"];
    let names: Vec<String> = prefixes
        .iter()
        .flat_map(|prefix| ["B", "G", "R"].map(|c| format!("{prefix}.{c}")))
        .collect();
    expected.extend(names.iter().map(String::as_str));
    expected.push("patch");
    expected.sort_unstable();
    let found: Vec<&str> = read.layers().iter().map(|layer| layer.name.as_str()).collect();
    assert_eq!(found, expected);
    for layer in read.layers() {
        assert_eq!(
            matches!(layer.samples, Samples::U32(_)),
            layer.name == "patch",
            "{}",
            layer.name
        );
    }
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        1,
        "no temporary file is left"
    );
}

#[test]
fn equal_work_gives_equal_bytes_at_any_number_of_threads() {
    let solved = Solved::new(bright_cube(), 2);
    let folder = tempfile::tempdir().unwrap();
    let bytes = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
        let settings = RenderSettings { seed, ..settings() };
        let (exr_path, png_path) = (folder.path().join("a.exr"), folder.path().join("a.png"));
        pool.install(|| {
            let (image, attributes) = solved.unfold(&visibility, 40, settings);
            exr::write(&exr_path, &image, &attributes).unwrap();
            png::write(&png_path, &image).unwrap();
        });
        (std::fs::read(exr_path).unwrap(), std::fs::read(png_path).unwrap())
    };
    let one = bytes(1, 5);
    for _ in 0..4 {
        assert!(bytes(2, 5) == one);
    }
    assert!(bytes(1, 6).0 != one.0, "another seed gives another image");
}

#[test]
fn the_preview_decodes_and_shows_light_and_dark() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let (image, _) = solved.unfold(&visibility, 20, RenderSettings::default());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cube.png");
    png::write(&path, &image).unwrap();
    let decoder = ::png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (80, 60));
    assert_eq!(
        (info.color_type, info.bit_depth),
        (::png::ColorType::Rgb, ::png::BitDepth::Eight)
    );
    assert!(reader.info().srgb.is_some());
    // Background is black; the median of what is lit lies in the middle of the scale.
    assert_eq!(pixels[..3], [0, 0, 0]);
    let mut lit: Vec<u8> = pixels
        .chunks(3)
        .filter(|pixel| pixel.iter().any(|&code| code > 0))
        .map(|pixel| pixel[1])
        .collect();
    assert_eq!(lit.len(), 6 * 400);
    lit.sort_unstable();
    assert!((90..160).contains(&lit[lit.len() / 2]), "{}", lit[lit.len() / 2]);
}

#[test]
fn bad_files_are_told_apart() {
    let solved = Solved::new(bright_cube(), 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let (image, attributes) = solved.unfold(&visibility, 8, RenderSettings::default());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let read_bytes = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        exr::read(&path).unwrap_err()
    };
    assert!(matches!(
        exr::read(&folder.path().join("none")).unwrap_err(),
        RenderError::Io { .. }
    ));
    assert!(matches!(read_bytes(b"P6 1 1 255 abc"), RenderError::NotExr { .. }));
    exr::write(&path, &image, &attributes).unwrap();
    let good = std::fs::read(&path).unwrap();
    assert!(
        matches!(read_bytes(&good[..good.len() - 40]), RenderError::NotExr { .. }),
        "cut short"
    );

    let replaced = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = good
            .windows(from.len())
            .position(|window| window == from.as_bytes())
            .unwrap();
        let mut bytes = good.clone();
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        bytes
    };
    let renamed = read_bytes(&replaced("surfaces\0string", "surfaxes\0string"));
    assert!(
        matches!(renamed, RenderError::MissingAttribute { name: "surfaces", .. }),
        "{renamed}"
    );
    // A changed scene is read, and known to be changed: verification tells.
    std::fs::write(&path, replaced("\"exitance\":[1.0,", "\"exitance\":[1.1,")).unwrap();
    let (_, edited) = exr::read(&path).unwrap();
    assert!(!edited.scene_intact && attributes.scene_intact);
    let format = "radiosity_format\0string\0\u{1}\0\0\0";
    let newer = read_bytes(&replaced(&format!("{format}1"), &format!("{format}7")));
    assert!(
        matches!(&newer, RenderError::WrongFormat { found, .. } if found == "7"),
        "{newer}"
    );
    // A flipped bit among the pixels does not go unnoticed.
    let mut damaged = good.clone();
    let at = good.len() - 100;
    damaged[at] ^= 0x10;
    assert!(matches!(read_bytes(&damaged), RenderError::NotExr { .. }));
}

#[test]
fn nothing_is_written_where_writing_fails() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("no such folder").join("a.png");
    let error = png::write(&path, &Image::new(1, 1)).unwrap_err();
    assert!(matches!(error, RenderError::Io { .. }), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
