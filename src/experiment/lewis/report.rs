//! The report, tables, plots and JSON of the reproduction.

use std::fmt::Write as _;

use serde::Serialize;

use super::{Check, LewisResults, SolverLine, VariantRun, density_png, unfolded_png};
use crate::experiment::ExperimentError;
use crate::experiment::findings::{Files, Findings, PaperFindings, text_file};
use crate::report::curves::{Curve, CurvePlot};
use crate::report::{Machine, Table, table};

/// The number of alternating runs for a median.
pub const ROUNDS: usize = 7;

/// Our times of one level.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "LewisTimes"))]
pub struct LevelTimes {
    /// l.
    pub level: u32,
    /// The median time of Gauss-Seidel, s.
    pub gauss_seidel_s: f64,
    /// The median time of multigrid without setup, s.
    pub multigrid_s: f64,
    /// The median time of multigrid's setup, s.
    pub setup_s: f64,
    /// `multigrid_s` over `gauss_seidel_s`.
    pub ratio: f64,
    /// The same with the setup.
    pub ratio_with_setup: f64,
}

impl From<&SolverLine> for LevelTimes {
    fn from(line: &SolverLine) -> Self {
        Self {
            level: line.level,
            gauss_seidel_s: line.times_s[0],
            multigrid_s: line.times_s[1],
            setup_s: line.setup_s,
            ratio: line.time_ratio(),
            ratio_with_setup: line.time_ratio_with_setup(),
        }
    }
}

impl LewisResults {
    /// Returns the report, files and document of these tables.
    ///
    /// # Errors
    /// [`ExperimentError`] if a picture or a plot cannot be encoded.
    pub fn findings(&self, tables: &[u8]) -> Result<PaperFindings<'_, Self, Vec<LevelTimes>>, ExperimentError> {
        let inside = self.checks.iter().all(Check::is_met);
        let times = self.solvers.iter().map(LevelTimes::from).collect();
        let printed = report(tables, self, true);
        Ok(Findings {
            captions: captions(),
            ..PaperFindings::new(self, times, inside, printed, files(tables, self)?)
        })
    }
}

fn files(tables: &[u8], results: &LewisResults) -> Result<Files, ExperimentError> {
    let mut files = vec![text_file("report.md", report(tables, results, false))];
    if tables.contains(&1) {
        files.push(text_file("table-1.csv", table_1(results).to_csv()));
        files.push(("figure-1.png".to_owned(), density_png(2, 4)?));
    }
    if tables.contains(&2) {
        files.push(text_file("table-2.csv", table_2_csv(results).to_csv()));
        files.push(text_file("table-2-times.csv", times_csv(results).to_csv()));
        files.push(text_file(
            "history.csv",
            history(results, ["gauss_seidel", "multigrid"]).to_csv(),
        ));
        files.push(text_file("checks.csv", checks(results).to_csv()));
        let figure_5 = unfolded_png(4, &results.solution, 16)?;
        files.push(("figure-5.png".to_owned(), figure_5));
        files.push(text_file("figure-6-times.svg", figure_6(results).to_svg()?));
        files.push(text_file("convergence.svg", convergence(results).to_svg()?));
    }
    Ok(files)
}

fn captions() -> Vec<(String, String)> {
    let captions = [
        (
            "figure-1.png",
            "Figure 1 of the paper: each entry of I − diag(ρ) F at l = 2, black where its magnitude is 1 and white where it is 0.",
        ),
        (
            "figure-5.png",
            "Figure 5 of the paper: the radiosities at l = 4 on the unfolded room, the walls in a row between ceiling and floor.",
        ),
    ];
    captions.map(|(name, text)| (name.to_owned(), text.to_owned())).into()
}

fn report(tables: &[u8], results: &LewisResults, with_times: bool) -> String {
    let mut text = String::from("# Lewis 1992: the paper's numbers beside ours\n");
    if tables.contains(&1) {
        text.push_str("\n## Table 1: matrix sizes, and what storing them takes in f64\n\n");
        text.push_str(&table_1(results).to_markdown());
    }
    if tables.contains(&2) {
        text.push_str("\n## Table 2: Gauss-Seidel (GS) and multigrid (MG)\n\n");
        text.push_str(&table_2(results, with_times).to_markdown());
        text.push_str(
            "\nIterations and multiplications as the paper counts them: from u = f to max |r| < 2.5e-5, stopping tests and setup left out. Ratio: time of MG by time of GS.\n",
        );
        if with_times {
            let machine = Machine::here();
            let _ = writeln!(
                text,
                "Times: medians of {ROUNDS} alternating runs with {} threads on {}, each with one check of the true residual; \"with setup\" adds the restricted matrices. The paper's times are a SPARCstation 2's.",
                machine.n_threads,
                machine.processor()
            );
        }
        text.push_str("\n## Residuals at l = 4: max |r| after each pass\n\n");
        text.push_str(&history(results, ["Gauss-Seidel", "multigrid"]).to_markdown());
        text.push_str("\n## Figure 2, as it may be read: cycles until max |r| < 2.5e-5\n\n");
        text.push_str(&variants(results).to_markdown());
        text.push_str("\n## Section 7: K u by levels, form factors evaluated as they are needed, l = 4\n\n");
        text.push_str(&by_levels(results, with_times).to_markdown());
        text.push_str("\nTerms and evaluations by N².\n");
        if with_times {
            text.push_str("Times in one thread: by that of evaluating all pairs, and by that of a product with the stored matrix.\n");
        }
    }
    let failed: Vec<&Check> = results.checks.iter().filter(|check| !check.is_met()).collect();
    let n_checks = results.checks.len();
    let _ = writeln!(text, "\n{} of {n_checks} checks are met.", n_checks - failed.len());
    for check in failed {
        let _ = writeln!(
            text,
            "- FAILED: {}: {} where {} ± {:.1e} must be",
            check.name, check.measured, check.expected, check.tolerance
        );
    }
    text
}

fn table_1(results: &LewisResults) -> Table {
    table! { line in &results.sizes;
        "l": line.level,
        "N": line.n_patches,
        "N²": line.n_entries,
        "dense byte": line.dense_bytes,
        "symmetric byte": line.symmetric_bytes,
        "sparse byte": line.sparse_bytes,
    }
}

fn table_2(results: &LewisResults, with_times: bool) -> Table {
    let printed = |line: &SolverLine, k: usize| line.printed_iterations.map_or("–".to_owned(), |n| n[k].to_string());
    let all = table! { line in &results.solvers;
        "l": line.level,
        "N": line.n_patches,
        "GS paper": printed(line, 0),
        "GS ours": line.iterations[0],
        "MG paper": printed(line, 1),
        "MG ours": line.iterations[1],
        "GS mult.": format!("{:.2e}", line.multiply_adds[0]),
        "MG mult.": format!("{:.2e}", line.multiply_adds[1]),
        "mult. ratio": format!("{:.3}", line.multiply_adds[1] / line.multiply_adds[0]),
        "ratio paper": line.printed_ratio.map_or("–".to_owned(), |r| format!("{r:.3}")),
        "ratio ours": format!("{:.3}", line.time_ratio()),
        "with setup": format!("{:.3}", line.time_ratio_with_setup()),
        "GS time (s)": format!("{:.3e}", line.times_s[0]),
        "MG time (s)": format!("{:.3e}", line.times_s[1]),
    };
    all.without_last(if with_times { 0 } else { 4 })
}

fn table_2_csv(results: &LewisResults) -> Table {
    table! { line in &results.solvers;
        "level": line.level,
        "n_patches": line.n_patches,
        "gs_printed": line.printed_iterations.map(|n| n[0]),
        "gs_passes": line.iterations[0],
        "mg_printed": line.printed_iterations.map(|n| n[1]),
        "mg_cycles": line.iterations[1],
        "gs_multiply_adds": line.multiply_adds[0],
        "mg_multiply_adds": line.multiply_adds[1],
        "gs_printed_s": line.printed_times_s.map(|t| t[0]),
        "mg_printed_s": line.printed_times_s.map(|t| t[1]),
        "mg_setup_work": line.setup_work,
    }
}

fn times_csv(results: &LewisResults) -> Table {
    table! { line in &results.solvers;
        "level": line.level,
        "n_patches": line.n_patches,
        "gs_s": line.times_s[0],
        "mg_s": line.times_s[1],
        "mg_setup_s": line.setup_s,
    }
}

fn history(results: &LewisResults, [gauss_seidel, multigrid]: [&str; 2]) -> Table {
    let mut table = Table::new(["pass", gauss_seidel, multigrid]);
    for (k, residual) in results.gauss_seidel_residuals.iter().enumerate() {
        let of_multigrid = results.multigrid_residuals.get(k).map(|r| format!("{r:.3e}"));
        table.push([
            (k + 1).to_string(),
            format!("{residual:.3e}"),
            of_multigrid.unwrap_or_default(),
        ]);
    }
    table
}

fn checks(results: &LewisResults) -> Table {
    table! { check in &results.checks;
        "check": check.name,
        "expected": check.expected,
        "measured": check.measured,
        "tolerance": check.tolerance,
        "met": check.is_met(),
    }
}

fn variants(results: &LewisResults) -> Table {
    let cycles = |runs: &[VariantRun], k: usize| runs[k].n_cycles.map_or("diverges".to_owned(), |n| n.to_string());
    let residuals = |run: &VariantRun| {
        let shown: Vec<String> = run.residuals.iter().take(4).map(|r| format!("{r:.2e}")).collect();
        shown.join(", ")
    };
    table! { (variant, runs) in &results.variants;
        "form": variant.description(),
        "l = 1": cycles(runs, 0),
        "l = 2": cycles(runs, 1),
        "l = 3": cycles(runs, 2),
        "l = 4": cycles(runs, 3),
        "max |r| at l = 4, cycles 1 to 4": residuals(&runs[3]),
    }
}

fn by_levels(results: &LewisResults, with_times: bool) -> Table {
    let all = table! { run in &results.by_levels;
        "ε": format!("{:.0e}", run.epsilon),
        "terms": format!("{:.3}", run.terms),
        "evaluations": format!("{:.3}", run.evaluations),
        "max error": format!("{:.1e}", run.error_max),
        "time by all pairs": format!("{:.2}", run.time_by_direct),
        "time by stored": format!("{:.1}", run.time_by_stored),
    };
    all.without_last(if with_times { 0 } else { 2 })
}

fn figure_6(results: &LewisResults) -> CurvePlot {
    let ours = |name: &str, style: usize, k: usize| {
        let point = |line: &SolverLine| (line.n_patches as f64, line.times_s[k]);
        Curve {
            name: name.to_owned(),
            style,
            points: results.solvers.iter().map(point).collect(),
        }
    };
    let printed = |name: &str, style: usize, k: usize| {
        let point = |line: &SolverLine| Some((line.n_patches as f64, line.printed_times_s?[k]));
        Curve {
            name: name.to_owned(),
            style,
            points: results.solvers.iter().filter_map(point).collect(),
        }
    };
    CurvePlot {
        title: "Time of Gauss-Seidel and multigrid".to_owned(),
        subtitle: "Lewis 1992, figure 6: from u = f to max |r| < 2.5e-5; the paper's on a SPARCstation 2".to_owned(),
        x_label: "number of patches N".to_owned(),
        y_label: "run time (s)".to_owned(),
        log_x: true,
        log_y: true,
        marked: true,
        curves: vec![
            ours("Gauss-Seidel", 0, 0),
            ours("multigrid", 1, 1),
            printed("Gauss-Seidel, paper", 2, 0),
            printed("multigrid, paper", 3, 1),
        ],
    }
}

fn convergence(results: &LewisResults) -> CurvePlot {
    let passes = |name: &str, style: usize, residuals: &[f64]| Curve {
        name: name.to_owned(),
        style,
        points: (1_u32..).map(f64::from).zip(residuals.iter().copied()).collect(),
    };
    CurvePlot {
        title: "Convergence in the room of Lewis 1992, l = 4".to_owned(),
        subtitle: "true residuals; a cycle of multigrid costs 1.37 sweeps".to_owned(),
        x_label: "number of passes".to_owned(),
        y_label: "greatest residual |r| (W/m²)".to_owned(),
        log_x: true,
        log_y: true,
        marked: true,
        curves: vec![
            passes("Gauss-Seidel", 0, &results.gauss_seidel_residuals),
            passes("multigrid", 1, &results.multigrid_residuals),
        ],
    }
}
