//! Files of form factors: written files are read back, and other files are refused.

#![expect(clippy::shadow_unrelated, reason = "every step of a test names its own results")]

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use radiosity::form_factor::registry::{METHODS, method};
use radiosity::form_factor::{Input, MethodSettings, RAYS, RESOLUTION};
use radiosity::matrix::{FormFactors, Layout, MatrixError, Precision, RayWeights, RowTally, RowTile, StorageChoice};
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::report::ReportError;
use radiosity::report::form_factors::{FormFactorFile, FormFactorReport};
use radiosity::scene::{Scene, builtin};
use radiosity::visibility::embree::EmbreeVisibility;
use serde_json::json;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;

use crate::support::{Uniform, bits, dense, storage};

fn cube(parts: u32) -> (Scene, Mesh) {
    let scene = builtin::build("cube", None).unwrap().scene;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(parts)).unwrap();
    (scene, mesh)
}

/// Random form factors with errors, and tallies of every kind.
fn random(mesh: &Mesh, density: f64, precision: Precision) -> FormFactors {
    let n = mesh.n_patches();
    let mut uniform = Uniform(11);
    let mut tile = RowTile::new(0);
    for i in 0..n {
        let mut entries = Vec::new();
        for j in 0..u32::try_from(n).unwrap() {
            if uniform.next() < density {
                entries.push((j, uniform.next() / n as f64, 1e-3 * uniform.next()));
            }
        }
        let weights = (i % 3 == 0).then(|| RayWeights {
            escaped: uniform.next() / 2.0,
            absorbed: uniform.next() / 2.0,
            squared: 0.01,
        });
        tile.push_row(
            &entries,
            RowTally {
                n_rays: 1000 + i as u64,
                n_escaped: i as u64,
                n_absorbed: 7,
                weights,
            },
        );
    }
    FormFactors::from_tiles(mesh.areas(), [tile], storage(Layout::Auto, precision)).unwrap()
}

fn write(path: &Path, of: (&Scene, &Mesh), factors: &FormFactors) -> Result<(), ReportError> {
    write_as(path, of, factors, false)
}

/// Writes form factors, `.npz` in full where they are to be dense.
fn write_as(
    path: &Path,
    (scene, mesh): (&Scene, &Mesh),
    factors: &FormFactors,
    dense: bool,
) -> Result<(), ReportError> {
    // The last as files of other versions may have it.
    let settings = json!({"subdivide": 2, "method": "sr", "stored_byte": 7});
    let report = FormFactorReport {
        scene,
        mesh,
        factors,
        tolerance_met: false,
        pairs: None,
        sky: None,
        settings: settings.as_object().unwrap(),
        surface: None,
        is_closed: true,
        dense,
    };
    report.write(path)
}

fn errors(f: &FormFactors) -> Vec<f64> {
    let n = f.n_rows();
    (0..n * n).map(|k| f.std_error(k / n, k % n)).collect()
}

fn read(path: &Path, mesh: &Mesh) -> Result<FormFactors, ReportError> {
    FormFactorFile::open(path)?.read(mesh)
}

#[test]
fn what_is_written_is_read_back_to_the_last_bit() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.npz");
    let (scene, mesh) = cube(5);
    for density in [0.0, 0.1, 0.9] {
        for (precision, dense_file) in [Precision::F64, Precision::F32]
            .map(|p| [(p, false), (p, true)])
            .concat()
        {
            let factors = random(&mesh, density, precision);
            write_as(&path, (&scene, &mesh), &factors, dense_file).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let file = FormFactorFile::open(&path).unwrap();
            let description = file.description();
            assert_eq!(description.mesh_options(), Some(Subdivision::Uniform(2).into()));
            assert_eq!(description.settings["method"], "sr");
            assert_eq!(description.settings["stored_byte"], 7, "kept as it is");
            assert_eq!(
                (description.n_patches, description.tolerance_met, description.symmetric),
                (150, false, false)
            );
            let again = file.read(&mesh).unwrap();
            assert_eq!(bits(&dense(&again).concat()), bits(&dense(&factors).concat()));
            assert_eq!(bits(&errors(&again)), bits(&errors(&factors)));
            assert_eq!(again.tallies(), factors.tallies());
            assert_eq!(again.storage().precision, precision);
            write_as(&path, (&scene, &mesh), &again, dense_file).unwrap();
            assert!(
                std::fs::read(&path).unwrap() == bytes,
                "equal content gives equal bytes"
            );
        }
    }
}

/// What any method computes can be read back from every format that can be read.
#[test]
fn every_method_goes_through_every_file() {
    let directory = tempfile::tempdir().unwrap();
    let scene = builtin::build("corridor", None).unwrap().scene;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(2)).unwrap();
    let visibility = EmbreeVisibility::new(&scene).unwrap();
    for entry in METHODS {
        let mut settings = entry.resolve(&MethodSettings::default()).unwrap();
        for (setting, value) in [(&RAYS, 100_u64), (&RESOLUTION, 16)] {
            if entry.uses(setting) {
                settings.values.set(setting, value);
            }
        }
        let input = Input {
            scene: &scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded: false,
        };
        let computed = entry.build(&settings).compute(input, StorageChoice::default(), &Silent);
        let factors = computed.unwrap().factors;
        for format in ["npz", "npy", "mtx"] {
            let path = directory.path().join(format!("{}.{format}", entry.name));
            write(&path, (&scene, &mesh), &factors).unwrap();
            let again = read(&path, &mesh).unwrap_or_else(|error| panic!("{} {format}: {error}", entry.name));
            for (a, b) in dense(&again).concat().iter().zip(dense(&factors).concat()) {
                // Exchange areas of symmetric ones come back to 3 units in the last place.
                assert!((a - b).abs() <= 1e-15 * b.abs(), "{} {format}: {a} {b}", entry.name);
            }
            let has_tallies = format == "npz";
            assert_eq!(FormFactorFile::open(&path).unwrap().has_errors(), has_tallies);
            if has_tallies {
                assert_eq!(again.tallies(), factors.tallies(), "{}", entry.name);
                assert_eq!(bits(&errors(&again)), bits(&errors(&factors)), "{}", entry.name);
            }
        }
    }
}

/// Compressed sparse rows, however the form factors are stored and however many are not zero; in full only where that is asked for.
#[test]
fn an_archive_has_one_layout() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.npz");
    let (scene, mesh) = cube(2);
    let layouts = [Layout::Auto, Layout::Sparse, Layout::Dense];
    let cases = layouts.into_iter().flat_map(|layout| {
        let densities = [0.0, 0.1, 0.9].into_iter();
        densities.flat_map(move |density| [(layout, density, false), (layout, density, true)])
    });
    for (layout, density, dense_file) in cases {
        let as_it_suits = random(&mesh, density, Precision::F64);
        let mut tile = RowTile::new(0);
        for i in 0..as_it_suits.n_rows() {
            let mut entries = Vec::new();
            as_it_suits.for_each_in_row(i, |j, value, error| {
                entries.push((u32::try_from(j).unwrap(), value, error));
            });
            tile.push_row(&entries, RowTally::default());
        }
        let factors = FormFactors::from_tiles(mesh.areas(), [tile], storage(layout, Precision::F64)).unwrap();
        write_as(&path, (&scene, &mesh), &factors, dense_file).unwrap();
        let file = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
        let names: Vec<String> = file.file_names().map(|name| name.unwrap().into_owned()).collect();
        let rows: &[&str] = if dense_file {
            &["F.npy"]
        } else {
            &["format.npy", "shape.npy", "indptr.npy", "indices.npy", "data.npy"]
        };
        let expected = [&["meta.npy"], rows, &["error.npy", "area_m2.npy"]].concat();
        assert_eq!(names, expected, "{layout:?} {density}");
        let again = read(&path, &mesh).unwrap();
        assert_eq!(bits(&dense(&again).concat()), bits(&dense(&factors).concat()));
        assert_eq!(bits(&errors(&again)), bits(&errors(&factors)));
    }
}

/// The description stands in the archive as a text that NumPy shows.
#[test]
fn the_description_of_an_archive_is_a_text() {
    let sound = Sound::new(0.5, false);
    let (_, meta) = sound.members.iter().find(|(name, _)| name == "meta.npy").unwrap();
    let (head, text) = meta.split_at(meta.len() - 4 * text_of(meta).chars().count());
    let head = String::from_utf8_lossy(head);
    let expected = format!("'descr': '<U{}', 'fortran_order': False, 'shape': ()", text.len() / 4);
    assert!(head.contains(&expected), "{head}");
    let description: serde_json::Value = serde_json::from_str(&text_of(meta)).unwrap();
    assert_eq!(description["geometry_sha256"], sound.mesh.geometry_hash());
}

/// Files that older programs wrote: dense ones, the description a member that is no array, areas without a unit in their name.
#[test]
fn files_of_older_programs_are_read() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/form_factors");
    for (name, parts, first) in [
        ("layout_1_dense.npz", 1, "F.npy"),
        ("layout_1_sparse.npz", 2, "data.npy"),
    ] {
        let path = directory.join(name);
        let (scene, mesh) = cube(parts);
        let file = FormFactorFile::open(&path).unwrap();
        assert!(file.has_errors(), "{name}");
        assert_eq!(file.description().settings["method"], "sr");
        let factors = file.read(&mesh).unwrap();
        // The values as they stand in the file; all that are not listed are 0.
        let mut zip = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
        let mut bytes = Vec::new();
        zip.by_name(first).unwrap().read_to_end(&mut bytes).unwrap();
        let values: Vec<f64> = bytes[128..]
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from_le_bytes(*b))
            .collect();
        let not_zero = |values: Vec<f64>| values.into_iter().filter(|value| *value > 0.0).collect::<Vec<_>>();
        assert_eq!(not_zero(dense(&factors).concat()), not_zero(values), "{name}");
        assert!(factors.row_sums().iter().all(|sum| (sum - 1.0).abs() < 1e-12), "{name}");
        assert!(factors.tallies().iter().all(|tally| tally.n_rays > 0), "{name}");
        // What is written now says the same.
        let now = tempfile::tempdir().unwrap();
        let again = now.path().join(name);
        write(&again, (&scene, &mesh), &factors).unwrap();
        let back = read(&again, &mesh).unwrap();
        assert_eq!(bits(&dense(&back).concat()), bits(&dense(&factors).concat()), "{name}");
        assert_eq!(bits(&errors(&back)), bits(&errors(&factors)), "{name}");
    }
}

#[test]
fn symmetric_form_factors_come_back_symmetric() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.npz");
    let (scene, mesh) = cube(5);
    for density in [0.02, 0.9] {
        for (precision, unit) in [(Precision::F64, f64::EPSILON), (Precision::F32, f32::EPSILON.into())] {
            let factors = random(&mesh, density, precision).symmetrised().unwrap();
            write(&path, (&scene, &mesh), &factors).unwrap();
            let again = read(&path, &mesh).unwrap();
            assert!(again.is_symmetric());
            for (a, b) in dense(&again).concat().iter().zip(dense(&factors).concat()) {
                assert!((a - b).abs() <= 2.0 * unit * b);
            }
            for (a, b) in errors(&again).iter().zip(errors(&factors)) {
                assert!((a - b).abs() <= 2.0 * f64::from(f32::EPSILON) * b);
            }
            assert_eq!(again.tallies(), factors.tallies());
        }
    }
}

#[test]
fn another_geometry_is_refused_and_other_materials_are_not() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.npz");
    let (mut scene, mesh) = cube(2);
    write(&path, (&scene, &mesh), &random(&mesh, 0.5, Precision::F64)).unwrap();
    let refused = |mesh: &Mesh| assert!(matches!(read(&path, mesh), Err(ReportError::OtherGeometry { .. })));
    refused(&cube(3).1);
    scene.materials[0].reflectance = [0.25; 3];
    assert!(read(&path, &Mesh::new(&scene, Subdivision::Uniform(2)).unwrap()).is_ok());
    scene.vertices[3].x += 1e-15;
    refused(&Mesh::new(&scene, Subdivision::Uniform(2)).unwrap());
}

/// A file on disk that belongs to a cube of 24 patches, as its members.
struct Sound {
    _directory: TempDir,
    path: PathBuf,
    mesh: Mesh,
    members: Vec<(String, Vec<u8>)>,
}

impl Sound {
    fn new(density: f64, symmetric: bool) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("F.npz");
        let (scene, mesh) = cube(2);
        let mut factors = random(&mesh, density, Precision::F64);
        if symmetric {
            factors = factors.symmetrised().unwrap();
        }
        // Full matrices in full, so that both layouts are tried.
        write_as(&path, (&scene, &mesh), &factors, density > 0.5).unwrap();
        let mut zip = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
        let members = (0..zip.len()).map(|k| {
            let mut member = zip.by_index(k).unwrap();
            let mut bytes = Vec::new();
            member.read_to_end(&mut bytes).unwrap();
            (member.name().unwrap().to_string(), bytes)
        });
        let members = members.collect();
        Self {
            _directory: directory,
            path,
            mesh,
            members,
        }
    }

    /// Writes the members again, with one changed or, if it becomes empty, left out, and returns why they are refused.
    #[track_caller]
    fn refused(&self, name: &str, change: impl Fn(&mut Vec<u8>)) -> ReportError {
        let mut zip = zip::ZipWriter::new(std::fs::File::create(&self.path).unwrap());
        for (known, bytes) in &self.members {
            let mut bytes = bytes.clone();
            if known == name {
                change(&mut bytes);
            }
            if !bytes.is_empty() {
                let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
                zip.start_file(known.as_str(), options).unwrap();
                zip.write_all(&bytes).unwrap();
            }
        }
        zip.finish().unwrap();
        let error = read(&self.path, &self.mesh).map(drop).expect_err("refused");
        assert_eq!(error.path(), self.path);
        assert!(error.to_string().starts_with(self.path.to_str().unwrap()), "{error}");
        error
    }
}

/// Replaces text in a header or description.
fn replace(bytes: &mut Vec<u8>, from: &str, to: &str) {
    let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
    bytes.splice(at..at + from.len(), to.bytes());
}

/// Returns the text of an array of one text.
fn text_of(array: &[u8]) -> String {
    let head = 10 + usize::from(u16::from_le_bytes([array[8], array[9]]));
    let characters = array[head..]
        .as_chunks()
        .0
        .iter()
        .map(|b| char::from_u32(u32::from_le_bytes(*b)).unwrap());
    characters.collect()
}

/// Replaces a part of the text of an array by one that is not longer.
fn replace_text(array: &mut Vec<u8>, from: &str, to: &str) {
    let text = text_of(array);
    assert!(text.contains(from) && to.len() <= from.len());
    let length = text.chars().count();
    let characters = text.replacen(from, to, 1);
    let characters = characters.chars().chain(std::iter::repeat('\0')).take(length);
    array.truncate(array.len() - 4 * length);
    array.extend(characters.flat_map(|c| u32::from(c).to_le_bytes()));
}

/// Puts a number in the place of the one at `index` of an array.
fn put(bytes: &mut [u8], index: usize, number: f64) {
    let at = bytes.len() - (24 * 24 - index) * 8;
    bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
}

#[test]
fn what_contradicts_itself_is_refused() {
    let full = Sound::new(0.9, false);
    let damaged = |error: ReportError, reason: &str| {
        assert!(matches!(error, ReportError::Damaged { .. }), "{error}");
        assert!(error.to_string().contains(reason), "{error}");
    };
    damaged(full.refused("F.npy", |b| replace(b, "(24, 24)", "(99, 99)")), "shape");
    damaged(
        full.refused("F.npy", |b| replace(b, "(24, 24)", "(4294967296, 4294967296)")),
        "shape",
    );
    damaged(
        full.refused("F.npy", |b| replace(b, "(24, 24)", "(12, 48)")),
        "[12, 48] instead of [24, 24]",
    );
    damaged(full.refused("F.npy", |b| b.truncate(1000)), "shape");
    damaged(full.refused("F.npy", |b| replace(b, "<f8", "<i8")), "cannot be used");
    damaged(
        full.refused("F.npy", |b| replace(b, "NUMPY", "NUMPI")),
        "not a NumPy array",
    );
    damaged(full.refused("error.npy", Vec::clear), "missing");
    damaged(full.refused("area_m2.npy", |b| *b.last_mut().unwrap() ^= 1), "m²");
    damaged(full.refused("n_escaped.npy", |b| *b.last_mut().unwrap() ^= 1), "tally");
    damaged(
        full.refused("ray_weights.npy", |b| {
            // The first weight becomes a number beyond 1e150.
            let at = b.len() - 24 * 3 * 8 + 7;
            b[at] ^= 64;
        }),
        "tally",
    );
    damaged(full.refused("meta.npy", |b| replace_text(b, "24", "{")), "no JSON");
    damaged(
        full.refused("meta.npy", |b| replace_text(b, "\"symmetric\": false,", "")),
        "checksum",
    );
    damaged(
        full.refused("meta.npy", |b| {
            replace_text(b, "\"symmetric\": false,", "\"symmetric\": true,");
        }),
        "checksum",
    );
    let error = full.refused("F.npy", |b| put(b, 24 * 3 + 5, -0.25));
    let source = MatrixError::Negative {
        row: 3,
        column: 5,
        value: -0.25,
    };
    assert!(
        matches!(&error, ReportError::Matrix { source: found, .. } if *found == source),
        "{error}"
    );
    let error = full.refused("F.npy", |b| put(b, 24 * 3 + 5, f64::NAN));
    let source = MatrixError::Value { row: 3, column: 5 };
    assert!(
        matches!(&error, ReportError::Matrix { source: found, .. } if *found == source),
        "{error}"
    );
    let error = full.refused("meta.npy", |b| replace_text(b, "form factors 2", "form factors 1"));
    assert!(matches!(error, ReportError::Version { .. }), "{error}");
    damaged(
        full.refused("meta.npy", |b| {
            let last = b.len() - 1;
            b[last] = 255;
        }),
        "cannot be used",
    );
    damaged(full.refused("meta.npy", |b| replace(b, "()", "(1,)")), "shape");
    let error = full.refused("meta.npy", Vec::clear);
    assert!(matches!(error, ReportError::NoDescription { .. }), "{error}");

    let sparse = Sound::new(0.1, false);
    let last = |b: &mut Vec<u8>, value: u8| {
        let at = b.len() - 4;
        b[at] = value;
    };
    damaged(sparse.refused("indices.npy", |b| last(b, 24)), "below 24");
    damaged(sparse.refused("indices.npy", |b| last(b, 0)), "ascending");
    damaged(sparse.refused("indptr.npy", |b| last(b, 255)), "rows");
    damaged(sparse.refused("data.npy", |b| b.truncate(b.len() - 8)), "shape");
    damaged(sparse.refused("format.npy", |b| *b.last_mut().unwrap() = b'c'), "csr");
    damaged(sparse.refused("shape.npy", |b| *b.last_mut().unwrap() = 1), "shape");

    let symmetric = Sound::new(0.9, true);
    damaged(symmetric.refused("F.npy", |b| put(b, 24 * 5 + 3, 0.01)), "symmetric");
    damaged(symmetric.refused("F.npy", |b| put(b, 24 * 3 + 5, 0.01)), "symmetric");
}

/// Writes a file that was not there: to cut an old one off can mean a wait for the disk.
fn write_anew(path: &Path, bytes: &[u8]) {
    std::fs::remove_file(path).unwrap();
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn cut_and_changed_files_are_refused_or_say_the_same() {
    for (density, symmetric) in [(0.1, false), (0.9, false), (0.9, true)] {
        let sound = Sound::new(density, symmetric);
        let whole = std::fs::read(&sound.path).unwrap();
        let expected = read(&sound.path, &sound.mesh).unwrap();
        for length in (0..whole.len()).step_by(37) {
            write_anew(&sound.path, &whole[..length]);
            assert!(read(&sound.path, &sound.mesh).is_err(), "cut off at {length}");
        }
        let mut zip = zip::ZipArchive::new(std::io::Cursor::new(&whole)).unwrap();
        let contents = (0..zip.len()).map(|k| {
            let member = zip.by_index(k).unwrap();
            let start = usize::try_from(member.data_start().unwrap()).unwrap();
            start..start + usize::try_from(member.size()).unwrap()
        });
        let contents: Vec<_> = contents.collect();
        for at in (0..whole.len()).step_by(7) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x55;
            write_anew(&sound.path, &bytes);
            match read(&sound.path, &sound.mesh) {
                Err(error) => assert_eq!(error.path(), sound.path),
                // Times and permissions of the members mean nothing here.
                Ok(found) => {
                    assert!(!contents.iter().any(|content| content.contains(&at)), "{at}");
                    assert_eq!(bits(&dense(&found).concat()), bits(&dense(&expected).concat()), "{at}");
                }
            }
        }
    }
}

#[test]
fn names_and_files_that_are_not_form_factors_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let (scene, mesh) = cube(1);
    let factors = random(&mesh, 0.5, Precision::F64);
    let in_directory = |name: &str| directory.path().join(name);
    let error = write(&in_directory("F.txt"), (&scene, &mesh), &factors).unwrap_err();
    assert!(matches!(error, ReportError::UnknownFormat { .. }));
    let error = write(&in_directory("no/F.npz"), (&scene, &mesh), &factors).unwrap_err();
    assert!(matches!(error, ReportError::Unwritable { .. }));
    let opened = |name: &str| FormFactorFile::open(&in_directory(name)).unwrap_err();
    assert!(matches!(opened("F.npz"), ReportError::Unreadable { .. }));
    assert!(matches!(opened("F.csv"), ReportError::UnknownFormat { .. }));
    std::fs::write(in_directory("F.npz"), "PK\x03\x04 and no more").unwrap();
    assert!(matches!(opened("F.npz"), ReportError::Damaged { .. }));
    std::fs::write(in_directory("F.npz"), "").unwrap();
    assert!(matches!(opened("F.npz"), ReportError::Damaged { .. }));
}

#[test]
fn storage_is_chosen_again_when_read() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.npz");
    let (scene, mesh) = cube(3);
    let factors = random(&mesh, 0.9, Precision::F64);
    write(&path, (&scene, &mesh), &factors).unwrap();
    assert_eq!(read(&path, &mesh).unwrap().storage(), StorageChoice::default());
}

/// What no ray hit is stated in the file, and comes back with it; and the sum over a row counts it once.
#[test]
fn entries_that_no_ray_hit_are_written_with_their_errors() {
    let (scene, mesh) = cube(4);
    let visibility = EmbreeVisibility::new(&scene).unwrap();
    let input = Input {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        unoccluded: true,
    };
    let directory = tempfile::tempdir().unwrap();
    for (name, layout) in [("sr", Layout::Sparse), ("sg5", Layout::Sparse), ("sr", Layout::Dense)] {
        let rays = Some(100);
        let mut settings = MethodSettings::default();
        if let Some(rays) = rays {
            settings.values.set(&RAYS, rays);
        }
        let method = method(name, &settings).unwrap();
        let storage = StorageChoice {
            layout,
            ..StorageChoice::default()
        };
        let factors = method.compute(input, storage, &Silent).unwrap().factors;
        let mut settings = serde_json::Map::new();
        settings.insert("method".into(), name.into());
        let report = FormFactorReport {
            scene: &scene,
            mesh: &mesh,
            factors: &factors,
            tolerance_met: true,
            pairs: None,
            sky: None,
            settings: &settings,
            surface: None,
            is_closed: true,
            dense: layout == Layout::Dense,
        };
        let path = directory.path().join("F.npz");
        report.write(&path).unwrap();
        let back = FormFactorFile::open(&path).unwrap().read(&mesh).unwrap();
        let n = mesh.n_patches();
        let mut n_unhit = 0;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let face = |k: usize| mesh.patches[k].face;
            let (value, error) = (factors.get(i, j), factors.std_error(i, j));
            assert_eq!(error > 0.0, face(i) != face(j), "{name} {i} {j}");
            assert!((back.std_error(i, j) - error).abs() <= 1e-7 * error, "{name} {i} {j}");
            n_unhit += usize::from(value <= 0.0 && error > 0.0);
            let mut visited = 0.0;
            factors.for_each_error_in_row(i, |k, _, e| {
                if k == j {
                    visited = e;
                }
            });
            assert!((visited - error).abs() <= 0.0);
        }
        assert!(n_unhit > n, "{name}");
        assert_eq!(
            back.density().to_bits(),
            factors.density().to_bits(),
            "only hits are kept"
        );
        assert!((factors.open_error(0) * factors.tallies()[0].effective_rays().unwrap() - 1.5).abs() < 1e-9);
    }
}
