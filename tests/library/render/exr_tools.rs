//! Our files as OpenEXR's own tools see them. Skipped, with a message, where the tools are missing (Debian: package `openexr`).

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use radiosity::render::exr::{self, Parts, Pixels};
use radiosity::render::{Attributes, DirectMethod, Image, RenderSettings, Samples};
use radiosity::visibility::embree::EmbreeVisibility;

use super::scenes::{Solved, bright_cube};

/// Runs a tool and returns what it prints; `None` where it is not installed.
fn run(tool: &str, files: &[&Path]) -> Option<String> {
    match Command::new(tool).args(files).output() {
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{tool} fails: {complaint}");
            Some(text)
        }
        Err(error) => {
            eprintln!("skipped: {tool} cannot be run ({error}); install OpenEXR's tools to run this test");
            None
        }
    }
}

fn picture() -> (Image, Attributes) {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let settings = RenderSettings {
        direct: DirectMethod::Exact,
        ..RenderSettings::default()
    };
    solved.unfold(&visibility, 40, settings)
}

/// The type of every channel that `exrheader` lists, and the number of parts.
fn channels(listing: &str) -> (BTreeMap<String, String>, usize) {
    let lines = listing.lines().filter(|line| line.contains("sampling 1 1"));
    let channels = lines.map(|line| {
        let (name, rest) = line.trim().split_once(", ").unwrap();
        (name.to_owned(), rest.split(',').next().unwrap().to_owned())
    });
    let n_parts = listing.matches("channels (type chlist)").count();
    (channels.collect(), n_parts)
}

fn kind(image: &Image, name: &str, pixels: Pixels) -> &'static str {
    let group = name.rsplit_once('.').map_or(name, |(group, _)| group);
    let halved = ["R", "G", "B", "irradiance", "radiosity", "direct", "albedo", "N"];
    if image.u32(name).is_some() {
        "32-bit unsigned integer"
    } else if pixels == Pixels::F16 && halved.contains(&group) {
        "16-bit floating-point"
    } else {
        "32-bit floating-point"
    }
}

#[test]
fn openexr_lists_our_channels_with_their_types_and_attributes() {
    let (image, mut attributes) = picture();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for pixels in [Pixels::F32, Pixels::F16] {
        for (parts, n_expected) in [(Parts::Single, 1), (Parts::Multi, 10)] {
            attributes.pixels = pixels;
            exr::write_parts(&path, &image, &attributes, parts).unwrap();
            let Some(listing) = run("exrheader", &[&path]) else {
                return;
            };
            let (found, n_parts) = channels(&listing);
            assert_eq!(n_parts, n_expected, "{listing}");
            assert_eq!(found.len(), image.layers().len(), "{listing}");
            for layer in image.layers() {
                assert_eq!(found[&layer.name], kind(&image, &layer.name, pixels), "{}", layer.name);
            }
            for attribute in [
                "camera",
                "settings",
                "surfaces",
                "seed",
                "scene_sha256",
                "radiosity_version",
            ] {
                let stated = format!("{attribute} (type string)");
                assert_eq!(listing.matches(&stated).count(), 1, "{attribute}: {listing}");
            }
            assert!(listing.contains("zip, multi-scanline blocks"), "{listing}");
        }
    }
}

#[test]
fn openexr_decodes_the_pixels_that_we_wrote() {
    let (image, mut attributes) = picture();
    let folder = tempfile::tempdir().unwrap();
    let (ours, theirs) = (folder.path().join("ours.exr"), folder.path().join("theirs.exr"));
    for pixels in [Pixels::F32, Pixels::F16] {
        attributes.pixels = pixels;
        exr::write(&ours, &image, &attributes).unwrap();
        // OpenEXR decodes all channels and encodes them again, as tiles.
        if run("exrmaketiled", &[&ours, &theirs]).is_none() {
            return;
        }
        let (decoded, decoded_attributes) = exr::read(&theirs).unwrap();
        assert_eq!(decoded_attributes, attributes);
        let (as_stored, _) = exr::read(&ours).unwrap();
        assert_eq!(decoded, as_stored);
        if pixels == Pixels::F32 {
            assert_eq!(decoded, image);
        }
    }
}

#[test]
fn halves_keep_eleven_bits_and_large_values_keep_all() {
    let (mut image, mut attributes) = picture();
    attributes.pixels = Pixels::F16;
    let bright = image.f32("radiosity.R").unwrap().iter().map(|b| b * 1e6).collect();
    image.insert("radiosity.R", Samples::F32(bright));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for parts in [Parts::Single, Parts::Multi] {
        exr::write_parts(&path, &image, &attributes, parts).unwrap();
        let (read, read_attributes) = exr::read(&path).unwrap();
        assert_eq!(read_attributes, attributes);
        for name in ["P.X", "Z", "radiosity.R", "direct_error.G"] {
            assert_eq!(read.f32(name), image.f32(name), "{name}");
        }
        assert_eq!(read.u32("patch"), image.u32("patch"));
        let mut n_rounded = 0;
        for (a, b) in read
            .f32("irradiance.G")
            .unwrap()
            .iter()
            .zip(image.f32("irradiance.G").unwrap())
        {
            // Half an ulp of 11 bits.
            assert!((a - b).abs() <= b.abs() / 2048.0, "{a} {b}");
            n_rounded += usize::from(a.to_bits() != b.to_bits());
        }
        assert!(n_rounded > 1000, "{n_rounded}");
    }
}

#[test]
fn halves_and_parts_pass_verification() {
    let (image, mut attributes) = picture();
    attributes.pixels = Pixels::F16;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    exr::write_parts(&path, &image, &attributes, Parts::Multi).unwrap();
    let report = radiosity::render::verify::verify(&path).unwrap();
    assert!(report.passed && report.n_checked == 6 * 1600, "{report:#?}");
    // The room for rounding to 11 bits is no room for more.
    let (mut wrong, described) = exr::read(&path).unwrap();
    let darker = wrong.f32("direct.R").unwrap().iter().map(|h| h * 0.998).collect();
    wrong.insert("direct.R", Samples::F32(darker));
    assert!(
        !radiosity::render::verify::verify_image(&wrong, &described)
            .unwrap()
            .passed
    );
}
