//! The tables, figure by figure: the paper's number beside ours, and the tests of ours.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use serde::Serialize;

use super::ensemble::{Cube, Ensemble};
use super::expected::Start;
use super::printed::{FACTORS, FactorTable, Printed, SUMS, SumTable};
use super::{PairFactors, TABLES, error_percent, face_sums};
use crate::experiment::ExperimentError;
use crate::experiment::statistics::{Spread, Z_999, normal_two_sided, percentile, variance_two_sided};
use crate::progress::Progress;

/// The probability that a table of a correct program is outside of its range, all of its figures together.
pub const LEVEL: f64 = 1e-3;

/// One figure of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Figure {
    /// The method's name in the paper.
    pub method: &'static str,
    /// Its name: "Σ of face 3", "error (%)", "F 1-6".
    pub name: String,
    /// The paper's number as printed.
    pub printed: f64,
    /// The number that the paper must mean, where it is a misprint.
    pub corrected: Option<f64>,
    /// Why it is a misprint.
    pub misprint: Option<&'static str>,
    /// Printed relative error of a form factor in per cent (tables 7 and 8).
    pub printed_relative_error: Option<f64>,
    /// The mean of the same, by ours, against the paper's rounded reference.
    pub relative_error: Option<f64>,
    /// Ours over all seeds; the number itself for PDM.
    pub measured: Spread,
    /// The exact mean, where it is known.
    pub expected_mean: Option<f64>,
    /// The exact standard deviation of a run, where it is known.
    pub expected_sd: Option<f64>,
    /// The range that holds 99.9 % of single runs.
    pub range: Option<[f64; 2]>,
    /// The share of our runs below the paper's number (misprints mended), in per cent; `None` for a figure that no seed changes.
    pub printed_percentile: Option<f64>,
    /// False where our number is not meant to be the paper's: PDM.
    pub reproduced: bool,
    /// The probability of a mean at least as far from the exact one, or 0 or 1 for a figure that does not vary.
    pub p_mean: Option<f64>,
    /// The probability of a standard deviation at least as far out.
    pub p_sd: Option<f64>,
}

/// A table of the paper, repeated.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct TableResult {
    /// Its number.
    pub number: u8,
    /// Its subject.
    pub title: String,
    /// The number of patches of the cube.
    pub n_patches: u32,
    /// Rays of each patch.
    pub rays: u64,
    /// Runs of every shooting method.
    pub n_seeds: u64,
    /// The figures by method.
    pub figures: Vec<Figure>,
    /// The number of probabilities that were looked at.
    pub n_tests: usize,
    /// The least of them.
    pub p_least: f64,
    /// True if the least is not below [`LEVEL`] / `n_tests`: with probability 1 − [`LEVEL`] at least for a correct program.
    pub inside: bool,
}

/// Repeats tables of the paper (3 to 8) with `n_seeds` runs of every shooting method.
///
/// Every mean and standard deviation of ours is tested against its exact value: means of normal figures by their standard errors, standard
/// deviations by χ², the mean of the error figure against 100 000 draws from the exact distribution of the sums, the sum of face 1 against 1
/// and PDM's figures against independently computed ones. A table passes if no probability is below [`LEVEL`] divided by their number (Bonferroni), so
/// that all figures of a table count together. The paper's single runs are not tested; their percentiles are listed.
///
/// # Errors
/// [`ExperimentError::TooFewSeeds`] below [`MIN_SEEDS`](super::MIN_SEEDS); the errors of the methods.
///
/// # Panics
/// If a table is not one of [`TABLES`].
pub fn reproduce(
    tables: &[u8],
    n_seeds: u64,
    first_seed: u64,
    progress: &dyn Progress,
) -> Result<Vec<TableResult>, ExperimentError> {
    assert!(tables.iter().all(|t| TABLES.contains(t)), "tables that can be repeated");
    let sum_tables: Vec<&SumTable> = SUMS.iter().filter(|t| tables.contains(&source_of(t, tables))).collect();
    let n_ensembles: usize = sum_tables.iter().map(|t| t.columns.len() - 1).sum();
    progress.begin("shoot", n_seeds * n_ensembles as u64);
    let mut results = BTreeMap::new();
    for table in sum_tables {
        let cube = Cube::new(table.divisions)?;
        let mut columns = Columns {
            gauss: cube.gauss()?,
            ensembles: Vec::new(),
        };
        for column in table.columns {
            if let Some(start) = start_of(column.method) {
                let ensemble = cube.shoot(start, table.rays, first_seed, n_seeds, progress)?;
                columns.ensembles.push((column.method, ensemble));
            }
        }
        if tables.contains(&table.number) {
            results.insert(table.number, sum_table(table, &columns, n_seeds));
        }
        if table.number == RUNS_OF_FACTORS {
            for factors in FACTORS.iter().filter(|t| tables.contains(&t.number)) {
                results.insert(factors.number, factor_table(factors, table, &columns, n_seeds));
            }
        }
    }
    Ok(results.into_values().collect())
}

/// The table whose runs tables 7 and 8 share.
const RUNS_OF_FACTORS: u8 = 6;

/// The table of the parallel faces; the other one is that of the perpendicular ones.
const PARALLEL: u8 = 7;

/// Returns a table in `tables` that shares the runs of `table`, if there is one, else its own number.
fn source_of(table: &SumTable, tables: &[u8]) -> u8 {
    let made_of_it = |t: &&FactorTable| table.number == RUNS_OF_FACTORS && tables.contains(&t.number);
    FACTORS.iter().find(made_of_it).map_or(table.number, |t| t.number)
}

fn start_of(method: &str) -> Option<Start> {
    let gauss = |q: usize| NonZeroUsize::new(q).map(Start::Gauss);
    match method {
        "SR" => Some(Start::Random),
        "SG5" => gauss(5),
        "SG10" => gauss(10),
        _ => None,
    }
}

/// The input of a table's columns.
struct Columns {
    gauss: PairFactors,
    ensembles: Vec<(&'static str, Ensemble)>,
}

impl Columns {
    fn ensemble(&self, method: &str) -> Option<&Ensemble> {
        self.ensembles.iter().find(|(name, _)| *name == method).map(|(_, e)| e)
    }
}

fn sum_table(table: &SumTable, columns: &Columns, n_seeds: u64) -> TableResult {
    let mut figures = Vec::new();
    for column in table.columns {
        let sum_name = |face: usize| format!("Σ of face {}", face + 1);
        let Some(ensemble) = columns.ensemble(column.method) else {
            let sums = face_sums(&columns.gauss);
            let known = known_sum(table.divisions);
            for (face, printed) in column.sums.iter().enumerate() {
                figures.push(fixed(column.method, sum_name(face), *printed, sums[face], known));
            }
            let known = known.map(|sum| error_percent(&[sum; 6]));
            // The tolerance is 100 times the rounding of six sums of six digits.
            figures.push(Figure {
                p_mean: known.map(|known| certain((error_percent(&sums) - known).abs() <= 100.0 * 6.0 * DIGITS)),
                ..fixed(
                    column.method,
                    "error (%)".to_owned(),
                    column.error,
                    error_percent(&sums),
                    known,
                )
            });
            continue;
        };
        let sums: Vec<[f64; 6]> = ensemble.runs.iter().map(face_sums).collect();
        for (face, printed) in column.sums.iter().enumerate() {
            let values: Vec<f64> = sums.iter().map(|s| s[face]).collect();
            let (mean, sd) = (ensemble.expected.sum_mean(face), ensemble.expected.sum_sd(face));
            figures.push(varying(column.method, sum_name(face), *printed, &values, mean, sd));
        }
        let values: Vec<f64> = sums.iter().map(error_percent).collect();
        figures.push(error_figure(column.method, column.error, &values, ensemble));
    }
    finish(
        table.number,
        format!("sums of the form factors of each face, {} patches", patches(table)),
        table,
        n_seeds,
        figures,
    )
}

fn factor_table(table: &FactorTable, source: &SumTable, columns: &Columns, n_seeds: u64) -> TableResult {
    let mut figures = Vec::new();
    for column in table.columns {
        for (&(i, j), &(printed, printed_error)) in table.pairs.iter().zip(column.factors) {
            let name = format!("F {i}-{j}");
            let (i, j) = (i - 1, j - 1);
            let relative = |f: f64| 100.0 * (f / table.reference - 1.0).abs();
            let (figure, error) = if let Some(ensemble) = columns.ensemble(column.method) {
                let values: Vec<f64> = ensemble.runs.iter().map(|run| run[i][j]).collect();
                let (mean, sd) = (ensemble.expected.mean[i][j], ensemble.expected.factor_sd(i, j));
                let error = values.iter().map(|f| relative(*f)).sum::<f64>() / values.len() as f64;
                (varying(column.method, name, printed, &values, mean, sd), error)
            } else {
                let value = columns.gauss[i][j];
                let known = KNOWN_FACTORS[usize::from(table.number != PARALLEL)];
                (fixed(column.method, name, printed, value, Some(known)), relative(value))
            };
            figures.push(Figure {
                printed_relative_error: Some(printed_error),
                relative_error: Some(error),
                ..figure
            });
        }
    }
    let kind = if table.number == PARALLEL {
        "parallel"
    } else {
        "perpendicular"
    };
    let title = format!(
        "form factors between {kind} faces, {} patches (the runs of table {RUNS_OF_FACTORS})",
        patches(source)
    );
    finish(table.number, title, source, n_seeds, figures)
}

fn patches(table: &SumTable) -> u32 {
    6 * table.divisions * table.divisions
}

fn finish(number: u8, title: String, source: &SumTable, n_seeds: u64, figures: Vec<Figure>) -> TableResult {
    let probabilities: Vec<f64> = figures
        .iter()
        .flat_map(|f| f.p_mean.into_iter().chain(f.p_sd))
        .collect();
    let p_least = probabilities.iter().copied().fold(1.0, f64::min);
    let n_tests = probabilities.len();
    TableResult {
        number,
        title,
        n_patches: patches(source),
        rays: source.rays,
        n_seeds,
        figures,
        n_tests,
        p_least,
        inside: p_least >= LEVEL / n_tests.max(1) as f64,
    }
}

/// Half a unit of the sixth decimal, with a margin for the rounding of numbers at its edge.
const DIGITS: f64 = 5.01e-7;

/// Returns the sum of a face by plain 5 × 5 × 5 × 5 Gauss, computed independently of this crate, to [`DIGITS`].
fn known_sum(divisions: u32) -> Option<f64> {
    match divisions {
        6 => Some(1.051_365),
        9 => Some(1.034_243),
        13 => Some(1.023_707),
        _ => None,
    }
}

/// The form factors between parallel and perpendicular faces of table [`RUNS_OF_FACTORS`], found in the same way.
const KNOWN_FACTORS: [f64; 2] = [0.199_825, 0.205_970];

/// Returns a test with two outcomes as a probability.
fn certain(passed: bool) -> f64 {
    if passed { 1.0 } else { 0.0 }
}

/// Returns a figure of PDM, which does not depend on a seed.
fn fixed(method: &'static str, name: String, printed: Printed, value: f64, known: Option<f64>) -> Figure {
    Figure {
        reproduced: false,
        p_mean: known.map(|known| certain((value - known).abs() <= DIGITS)),
        expected_mean: known,
        ..plain(method, name, printed, Spread::of(&[value]))
    }
}

/// Returns a figure that is a normal number of known mean and standard deviation, or a constant.
fn varying(method: &'static str, name: String, printed: Printed, values: &[f64], mean: f64, sd: f64) -> Figure {
    let measured = Spread::of(values);
    let n = values.len() as f64;
    let (p_mean, p_sd) = if sd > 0.0 {
        let degrees = u32::try_from(values.len() - 1).unwrap_or(u32::MAX);
        let z = (measured.mean - mean) / (sd / n.sqrt());
        (
            normal_two_sided(z),
            Some(variance_two_sided((measured.sd / sd).powi(2), degrees)),
        )
    } else {
        // All runs are equal, up to the rounding of a sum of patches.
        (certain(values.iter().all(|v| (v - mean).abs() < 1e-12)), None)
    };
    Figure {
        expected_mean: Some(mean),
        expected_sd: Some(sd),
        range: Some([mean - Z_999 * sd, mean + Z_999 * sd]),
        printed_percentile: (sd > 0.0).then(|| percentile(printed.corrected(), values)),
        p_mean: Some(p_mean),
        p_sd,
        ..plain(method, name, printed, measured)
    }
}

/// Returns the error figure, which is not normal, with its expectation from draws.
fn error_figure(method: &'static str, printed: Printed, values: &[f64], ensemble: &Ensemble) -> Figure {
    let draws = ensemble.expected.error_draws(DRAWS);
    let expected = Spread::of(&draws);
    let measured = Spread::of(values);
    let z = (measured.mean - expected.mean) / (expected.sd / (values.len() as f64).sqrt());
    Figure {
        expected_mean: Some(expected.mean),
        expected_sd: Some(expected.sd),
        range: Some([draws[DRAWS / 2000], draws[DRAWS - 1 - DRAWS / 2000]]),
        printed_percentile: Some(percentile(printed.corrected(), values)),
        p_mean: Some(normal_two_sided(z)),
        ..plain(method, "error (%)".to_owned(), printed, measured)
    }
}

/// The number of draws for the distribution of the error figure.
const DRAWS: usize = 100_000;

fn plain(method: &'static str, name: String, printed: Printed, measured: Spread) -> Figure {
    Figure {
        method,
        name,
        printed: printed.value,
        corrected: printed.misprint.map(|(value, _)| value),
        misprint: printed.misprint.map(|(_, reason)| reason),
        printed_relative_error: None,
        relative_error: None,
        measured,
        expected_mean: None,
        expected_sd: None,
        range: None,
        printed_percentile: None,
        reproduced: true,
        p_mean: None,
        p_sd: None,
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::experiment::baranoski::MIN_SEEDS;
    use crate::progress::Silent;

    /// Returns values that are distributed like normal ones about `mean`.
    fn sample(mean: f64, sd: f64) -> Vec<f64> {
        let z = [
            -1.83, -1.28, -0.97, -0.73, -0.52, -0.34, -0.17, 0.0, 0.17, 0.34, 0.52, 0.73, 0.97, 1.28, 1.83,
        ];
        z.iter().chain(&z).map(|z| mean + sd * z).collect()
    }

    fn verdict(values: &[f64], mean: f64, sd: f64) -> bool {
        let printed = SUMS[0].columns[1].sums[1];
        let figure = varying("SR", "some sum".to_owned(), printed, values, mean, sd);
        finish(3, String::new(), &SUMS[0], 30, vec![figure]).inside
    }

    #[test]
    fn a_wrong_mean_or_spread_is_outside() {
        assert!(verdict(&sample(1.0, 0.003), 1.0, 0.003));
        // The standard error of the mean of 30 is 0.183 standard deviations.
        assert!(verdict(&sample(1.0, 0.003), 1.0015, 0.003));
        assert!(!verdict(&sample(1.0, 0.003), 1.0025, 0.003));
        assert!(!verdict(&sample(1.0, 0.006), 1.0, 0.003));
        assert!(!verdict(&sample(1.0, 0.001), 1.0, 0.003));
        assert!(verdict(&[1.0; 30], 1.0, 0.0));
        assert!(!verdict(&[1.0 + 1e-9; 30], 1.0, 0.0));
    }

    #[test]
    fn table_3_is_what_it_must_be() {
        let tables = reproduce(&[3], MIN_SEEDS, 0, &Silent).unwrap();
        let [table] = &tables[..] else { panic!("one table") };
        assert!(table.inside, "{:e}", table.p_least);
        assert_eq!((table.number, table.n_patches, table.figures.len()), (3, 216, 4 * 7));
        // One test for each of PDM's figures; for each method face 1, two for each of five sums, and the error.
        assert_eq!(table.n_tests, 7 + 3 * 12);
        // An independent simulation gave standard deviations of the faces' sums of 0.0031 to 0.0046 for SR.
        let figure = |method: &str, name: &str| {
            table
                .figures
                .iter()
                .find(|f| f.method == method && f.name.ends_with(name))
                .unwrap()
        };
        for (name, sd) in [("face 2", 0.0029), ("face 6", 0.0046)] {
            assert!((figure("SR", name).expected_sd.unwrap() - sd).abs() < 6e-5, "{name}");
        }
        for method in ["SR", "SG5", "SG10"] {
            for face in 1..=6 {
                // The loss by Gauss points is below a hundredth of the noise.
                assert!((figure(method, &format!("face {face}")).expected_mean.unwrap() - 1.0).abs() < 3e-5);
            }
            let [low, high] = figure(method, "(%)").range.unwrap();
            let mean = figure(method, "(%)").expected_mean.unwrap();
            assert!(0.0 < low && low < 0.3 * mean && 2.0 * mean < high && high < 3.0 * mean);
        }
        assert!(!figure("PDM", "face 1").reproduced);
        assert_eq!(figure("SR", "face 3").corrected, Some(1.0114));
    }

    #[test]
    fn too_few_seeds_are_refused() {
        let error = reproduce(&[3], MIN_SEEDS - 1, 0, &Silent).err().unwrap();
        assert!(matches!(error, ExperimentError::TooFewSeeds { n_seeds: 29, least: 30 }));
    }
}
