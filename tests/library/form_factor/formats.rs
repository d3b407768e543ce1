//! Form factors and solutions in the formats of other programs.

#![expect(clippy::shadow_unrelated, reason = "every step of a test names its own results")]

use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

use radiosity::matrix::operator::{Block, LinearOperator};
use radiosity::matrix::{FormFactors, StorageChoice};
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::report::ReportError;
use radiosity::report::form_factors::{FormFactorFile, FormFactorReport};
use radiosity::report::solution::SolutionReport;
use radiosity::scene::{Scene, SurfaceId, builtin};
use radiosity::solver::Solution;
use serde_json::{Value, json};

use crate::support::{bits, dense, random_rows, tiles};

struct Case {
    scene: Scene,
    mesh: Mesh,
    factors: FormFactors,
}

impl Case {
    /// The cube with 24 patches and form factors that are not symmetric, a share `density` of them not zero.
    fn new(density: f64) -> Self {
        let scene = builtin::build("cube", None).unwrap().scene;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(2)).unwrap();
        let rows = tiles(&random_rows(24, density, 21), 24);
        let factors = FormFactors::from_tiles(mesh.areas(), rows, StorageChoice::default()).unwrap();
        Self { scene, mesh, factors }
    }

    fn write(&self, path: &Path) {
        let settings = json!({"method": "sr", "subdivide": 2});
        let report = FormFactorReport {
            scene: &self.scene,
            mesh: &self.mesh,
            factors: &self.factors,
            tolerance_met: true,
            pairs: None,
            sky: None,
            settings: settings.as_object().unwrap(),
            surface: Some(SurfaceId(5)),
            is_closed: true,
            dense: false,
        };
        report.write(path).unwrap();
        let first = std::fs::read(path).unwrap();
        report.write(path).unwrap();
        assert!(std::fs::read(path).unwrap() == first, "equal content gives equal bytes");
    }

    fn expect_description(&self, text: &str) {
        let description: Value = serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(description["geometry_sha256"], self.mesh.geometry_hash());
        assert!(
            description["orientation"]
                .as_str()
                .unwrap()
                .contains("leaving patch i that reaches patch j")
        );
        assert_eq!(description["settings"]["method"], "sr");
    }
}

fn comments(text: &str, mark: &str) -> String {
    let lines = text.lines().filter_map(|line| line.strip_prefix(mark));
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn matrix_market_holds_every_entry() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.mtx");
    let case = Case::new(0.3);
    case.write(&path);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("%%MatrixMarket matrix coordinate real general\n% {\n"));
    case.expect_description(&comments(&text, "% "));
    let mut lines = text.lines().filter(|line| !line.starts_with('%'));
    let mut found = vec![0.0; 24 * 24];
    let size: Vec<usize> = lines.next().unwrap().split(' ').map(|n| n.parse().unwrap()).collect();
    assert_eq!(size[..2], [24, 24]);
    let mut n_entries = 0;
    for line in lines {
        let [i, j, value] = line.split(' ').collect::<Vec<_>>().try_into().unwrap();
        let place = |text: &str| text.parse::<usize>().unwrap() - 1;
        found[24 * place(i) + place(j)] = value.parse().unwrap();
        n_entries += 1;
    }
    assert_eq!(n_entries, size[2]);
    assert_eq!(bits(&found), bits(&dense(&case.factors).concat()));
}

#[test]
fn a_table_holds_the_surfaces() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.csv");
    let case = Case::new(0.9);
    case.write(&path);
    let text = std::fs::read_to_string(&path).unwrap();
    case.expect_description(&comments(&text, "# "));
    let patch_surface: Vec<u32> = case.mesh.patches.iter().map(|p| p.surface.0).collect();
    let expected = case.factors.surface_form_factors(&patch_surface, 6);
    let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(rows[0], "from,to,from_area_m2,form_factor,error");
    assert_eq!(rows.len(), 37);
    let row = rows[1 + 6 * 2 + 5];
    let value = expected.form_factor[6 * 2 + 5];
    assert_eq!(row, format!("y0,z1,1.0,{value:?},{:?}", expected.error[6 * 2 + 5]));
}

#[test]
fn an_image_has_row_i_downwards_and_column_j_to_the_right() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.exr");
    let case = Case::new(0.9);
    case.write(&path);
    let image = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
    let layer = image.layer_data;
    let Some(exr::meta::attribute::AttributeValue::Text(text)) = layer.attributes.other.get("radiosity".as_bytes())
    else {
        panic!("no description");
    };
    case.expect_description(&text.to_string());
    let channels: HashMap<String, Vec<f32>> = layer
        .channel_data
        .list
        .iter()
        .map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()))
        .collect();
    assert_eq!(channels.len(), 2);
    for (found, expected) in channels["Y"].iter().zip(dense(&case.factors).concat()) {
        assert!((f64::from(*found) - expected).abs() <= 6e-8 * expected);
    }
    assert!(channels["error"].iter().all(|e| e.to_bits() == 0));
}

/// Returns the text of an array in a `.vtu` file.
fn vtu_array<'a>(text: &'a str, name: &str) -> Vec<&'a str> {
    let (_, after) = text
        .split_once(&format!("Name=\"{name}\""))
        .unwrap_or_else(|| panic!("{name}"));
    let (_, after) = after.split_once('>').unwrap();
    after.split_once("</DataArray>").unwrap().0.split_whitespace().collect()
}

fn vtu_numbers(text: &str, name: &str) -> Vec<f64> {
    vtu_array(text, name).iter().map(|x| x.parse().unwrap()).collect()
}

#[test]
fn a_grid_holds_patches_with_sums() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.vtu");
    let case = Case::new(0.9);
    case.write(&path);
    let text = std::fs::read_to_string(&path).unwrap();
    let description: Vec<u8> = vtu_array(&text, "description")
        .iter()
        .map(|c| c.parse().unwrap())
        .collect();
    case.expect_description(std::str::from_utf8(&description[..description.len() - 1]).unwrap());
    let n = case.mesh.n_patches();
    assert!(text.contains("NumberOfCells=\"24\""));
    assert_eq!(vtu_array(&text, "types"), ["9"; 24]);
    assert_eq!(vtu_array(&text, "offsets").last(), Some(&"96"));
    let positions = vtu_numbers(&text, "position");
    let corners: Vec<usize> = vtu_array(&text, "connectivity")
        .iter()
        .map(|k| k.parse().unwrap())
        .collect();
    for (i, patch) in case.mesh.patches.iter().enumerate() {
        let mut centre = [0.0; 3];
        for k in 0..12 {
            centre[k % 3] += positions[3 * corners[4 * i + k / 3] + k % 3] / 4.0;
        }
        assert!((patch.centroid - glam::DVec3::from_array(centre)).length() < 1e-15);
    }
    let sums: Vec<f64> = (0..n).map(|i| case.factors.row_sum(i)).collect();
    assert_eq!(bits(&vtu_numbers(&text, "row_sum")), bits(&sums));
    let to_ceiling = vtu_numbers(&text, "form_factor_to_z1");
    for (i, found) in to_ceiling.iter().enumerate() {
        let expected: f64 = (20..24).map(|j| case.factors.get(i, j)).sum();
        assert!((found - expected).abs() < 1e-15);
    }
    assert_eq!(vtu_numbers(&text, "area_m2"), [0.25; 24]);
    assert_eq!(vtu_numbers(&text, "surface")[8..12], [2.0; 4]);
}

#[test]
fn an_array_is_read_back_with_its_description() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("F.npy");
    let mut case = Case::new(0.9);
    for _ in 0..2 {
        case.write(&path);
        let file = FormFactorFile::open(&path).unwrap();
        let again = file.read(&case.mesh).unwrap();
        assert_eq!(again.is_symmetric(), case.factors.is_symmetric());
        for (a, b) in dense(&again).concat().iter().zip(dense(&case.factors).concat()) {
            assert!((a - b).abs() <= 4e-16 * b);
        }
        case.factors = case.factors.symmetrised().unwrap();
    }
    let whole = std::fs::read(&path).unwrap();
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let result = FormFactorFile::open(&path).unwrap().read(&case.mesh);
        assert!(matches!(result, Err(ReportError::Damaged { .. })));
    };
    refused(&whole[..whole.len() - 8]);
    for at in [0, 8, 30, 200, whole.len() - 1] {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        refused(&bytes);
    }
    std::fs::remove_file(directory.path().join("F.npy.json")).unwrap();
    let error = FormFactorFile::open(&path).unwrap_err();
    assert!(matches!(error, ReportError::NoDescription { .. }), "{error}");
    assert!(error.to_string().contains("F.npy.json"));
}

#[test]
fn solutions_hold_the_residual() {
    let directory = tempfile::tempdir().unwrap();
    let case = Case::new(0.9);
    let n = case.mesh.n_patches();
    let block = |value: f64| Block::from_values((0..3 * n).map(|k| value + k as f64 / 100.0).collect(), 3);
    let (reflectance, exitance) = (block(0.1), block(1.0));
    let mut solution = Solution::without_reflection(block(2.0));
    case.factors.apply(&solution.radiosity, &mut solution.irradiance);
    let settings = json!({"solver": "pcg"});
    let report = SolutionReport {
        sky: None,
        sun: None,
        skylight: None,
        error: None,
        row_sums: None,
        scene: &case.scene,
        mesh: &case.mesh,
        reflectance: &reflectance,
        exitance: &exitance,
        solution: &solution,
        settings: settings.as_object().unwrap(),
    };
    let path = directory.path().join("B.vtu");
    report.write(&path).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(
        bits(&vtu_numbers(&text, "radiosity")),
        bits(solution.radiosity.values())
    );
    assert_eq!(bits(&vtu_numbers(&text, "exitance")), bits(exitance.values()));
    let residual = vtu_numbers(&text, "residual");
    for k in [0, 7, 71] {
        let value = |block: &Block| block.values()[k];
        let expected =
            value(&exitance) - value(&solution.radiosity) + value(&reflectance) * value(&solution.irradiance);
        assert!((residual[k] - expected).abs() < 1e-15);
    }
    let error = report.write(&directory.path().join("B.txt")).unwrap_err();
    assert!(matches!(error, ReportError::UnknownFormat { .. }));
}

/// NumPy and SciPy read the same numbers in the same places.
#[test]
fn python_loads_every_format() {
    let python = |arguments: &[&str]| Command::new("python3").args(arguments).output();
    if !python(&["-c", "import numpy, scipy"]).is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: python3 with numpy and scipy is not installed");
        return;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/load_form_factors.py");
    for (density, symmetric) in [(0.9, false), (0.2, false), (0.9, true), (0.1, true)] {
        let directory = tempfile::tempdir().unwrap();
        let mut case = Case::new(density);
        if symmetric {
            case.factors = case.factors.symmetrised().unwrap();
        }
        let nonzero = (0..24 * 24)
            .find(|k| k / 24 > 3 && case.factors.get(k / 24, k % 24) > 0.0)
            .unwrap();
        let (i, j) = (nonzero / 24, nonzero % 24);
        let name = |ending: &str| {
            directory
                .path()
                .join(format!("F.{ending}"))
                .to_str()
                .unwrap()
                .to_owned()
        };
        let files = ["npz", "npy", "mtx", "exr", "csv", "vtu"].map(name);
        for file in &files {
            case.write(Path::new(file));
        }
        let entry = ["--entry".to_owned(), i.to_string(), j.to_string()];
        let arguments: Vec<&str> = [script]
            .into_iter()
            .chain(files.iter().chain(&entry).map(String::as_str))
            .collect();
        let output = python(&arguments).unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(
            output.status.success(),
            "{text}{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let value = case.factors.get(i, j);
        let found = |file: &String| {
            let (_, after) = text
                .split_once(&format!("{file}: F[{i}, {j}] = "))
                .unwrap_or_else(|| panic!("{text}"));
            after.lines().next().unwrap().parse::<f64>().unwrap()
        };
        for file in &files[..3] {
            assert_eq!(found(file).to_bits(), value.to_bits());
        }
        assert!((found(&files[3]) - value).abs() <= 6e-8 * value);
        let sums = (0..24).map(|i| case.factors.row_sum(i)).fold(0.0, f64::max);
        for file in [&files[0], &files[5]] {
            let (_, after) = text.split_once(&format!("{file}: 24 patches, row sums ")).unwrap();
            let max: f64 = after
                .lines()
                .next()
                .unwrap()
                .split_once("to ")
                .unwrap()
                .1
                .parse()
                .unwrap();
            assert!((max - sums).abs() < 1e-14, "{max} {sums}");
        }
    }
}
