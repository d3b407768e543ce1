//! The report, tables, plot and JSON of the table.

use std::fmt::Write as _;

use serde::Serialize;
use serde_json::json;

use super::{Cell, MAX_PASSES, Stability, TOLERANCE, Verdict};
use crate::experiment::ExperimentError;
use crate::experiment::findings::{Files, Findings, ResultsFile, text_file};
use crate::report::plot::{ErrorTimePlot, PlotPoint, Ranged, Series};
use crate::report::{SCHEMA_VERSION, Table, pretty, table};
use crate::workflow::Settings;

/// The part of the JSON document about the table.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StabilityDocument<'a> {
    /// The tolerance on sqrt(Σ A r² / Σ A E²).
    pub tolerance: f64,
    /// The passes that a solver may spend.
    pub max_passes: usize,
    /// Cells whose verdict is wrong.
    pub n_wrong: usize,
    /// The table.
    pub result: &'a Stability,
    /// Our times, case by case.
    pub times: Vec<CaseTimes<'a>>,
}

/// Our times of one case.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "StabilityTimes"))]
pub struct CaseTimes<'a> {
    /// The case.
    pub case: &'a str,
    /// The wall time of each solver, s, the least of three to a hundred runs; null where it came to no end.
    pub time_s: Vec<Option<f64>>,
    /// The time of `auto` by the least time of another solver that was right.
    pub auto_time_ratio: Option<f64>,
}

impl Stability {
    /// Returns the report, files and document; `settings` are those of the run.
    ///
    /// # Errors
    /// [`ExperimentError::Plot`].
    pub fn findings(&self, settings: &Settings) -> Result<Findings<StabilityDocument<'_>>, ExperimentError> {
        let n_wrong = self.wrong().count();
        Ok(Findings {
            printed: report(self, true),
            files: files(self, settings)?,
            captions: Vec::new(),
            document: StabilityDocument {
                tolerance: TOLERANCE,
                max_passes: MAX_PASSES,
                n_wrong,
                result: self,
                times: times(self),
            },
            wrong: (n_wrong > 0).then(|| format!("{n_wrong} cells are wrong; see the table")),
        })
    }
}

fn files(result: &Stability, settings: &Settings) -> Result<Files, ExperimentError> {
    let results = ResultsFile {
        schema_version: SCHEMA_VERSION,
        version: None,
        settings,
        results: json!({ "result": result }),
    };
    Ok(vec![
        text_file("report.md", report(result, false)),
        text_file("results.csv", cells(result).to_csv()),
        text_file("results.json", format!("{}\n", pretty(&results))),
        text_file("times.csv", times_table(result).to_csv()),
        text_file("error_time.svg", plot(result).to_svg()?),
    ])
}

/// Returns the report; files omit the times, so that equal work gives equal bytes.
fn report(result: &Stability, with_times: bool) -> String {
    let count = |verdict: Verdict| result.cells.iter().filter(|cell| cell.verdict == verdict).count();
    let mut text = String::from("# Solvers on stiff, extreme and impossible systems\n\n");
    let _ = writeln!(
        text,
        "Every solver with its defaults on every case, to a relative residual of {:e} within {} passes. **right**: converged, and residual, error bound, signs and power balance are \
         true, judged by a solution to all digits; then the passes and the relative error. **slow**: all passes used up, and said so. **refused**: a typed error, or stopped as \
         stagnated or diverged. **WRONG**: anything else.\n\n{} right, {} slow, {} refused, {} wrong.\n",
        TOLERANCE,
        MAX_PASSES,
        count(Verdict::Right),
        count(Verdict::Slow),
        count(Verdict::Refused),
        count(Verdict::Wrong)
    );
    let head = ["case", "n"].into_iter().chain(result.solvers.iter().copied());
    let time_head = with_times.then_some("auto: time / least");
    let mut table = Table::new(head.chain(["auto: work / least"]).chain(time_head));
    for (case, cells) in result.cases.iter().zip(result.cells.chunks(result.solvers.len())) {
        let ratio = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.2}"));
        let mut row = vec![case.name.clone(), case.n_patches.to_string()];
        row.extend(cells.iter().map(show));
        row.push(ratio(case.auto_work_ratio));
        row.extend(with_times.then(|| ratio(case.auto_time_ratio)));
        table.push(row);
    }
    text.push_str(&table.to_markdown());
    text.push_str("\nWork is in passes over the form factors, checks and factorisations included.\n");
    if with_times {
        text.push_str("Times are wall times of this run, the least of three to a hundred.\n");
    }
    text
}

/// Returns the times case by case, in the order of the cells.
fn times(result: &Stability) -> Vec<CaseTimes<'_>> {
    let by_case = result.cells.chunks(result.solvers.len());
    let of_cases = result.cases.iter().zip(by_case);
    of_cases
        .map(|(case, cells)| CaseTimes {
            case: &case.name,
            time_s: cells.iter().map(|cell| cell.time_s).collect(),
            auto_time_ratio: case.auto_time_ratio,
        })
        .collect()
}

fn times_table(result: &Stability) -> Table {
    table! { cell in &result.cells;
        "case": cell.case,
        "solver": cell.solver,
        "time_s": cell.time_s,
    }
}

fn show(cell: &Cell) -> String {
    match cell.verdict {
        Verdict::Right => format!(
            "right {} ({:.0e})",
            cell.n_passes.unwrap_or(0),
            cell.error.unwrap_or(0.0)
        ),
        Verdict::Slow => "slow".to_owned(),
        Verdict::Refused if cell.n_passes.is_some() => format!("refused: {}", cell.detail),
        Verdict::Refused => "refused".to_owned(),
        Verdict::Wrong => format!("WRONG: {}", cell.detail),
    }
}

fn cells(result: &Stability) -> Table {
    table! { cell in &result.cells;
        "case": cell.case,
        "solver": cell.solver,
        "verdict": format!("{:?}", cell.verdict).to_lowercase(),
        "detail": cell.detail,
        "choice": cell.choice,
        "n_passes": cell.n_passes,
        "work": cell.work,
        "error": cell.error,
        "error_bound": cell.error_bound,
        "residual_l2": cell.residual_l2,
    }
}

/// Draws the error of every right cell against its time.
fn plot(result: &Stability) -> ErrorTimePlot {
    let series = result.solvers.iter().enumerate().map(|(style, solver)| {
        let right = |cell: &&Cell| cell.solver == *solver && cell.verdict == Verdict::Right;
        let mut points: Vec<PlotPoint> = result
            .cells
            .iter()
            .filter(right)
            .filter_map(|cell| {
                Some(PlotPoint {
                    setting: cell.case.clone(),
                    time_s: Ranged::exactly(cell.time_s?),
                    error: Ranged::exactly(cell.error?),
                    on_front: false,
                })
            })
            .collect();
        points.sort_by(|a, b| a.time_s.middle.total_cmp(&b.time_s.middle));
        Series {
            name: (*solver).to_owned(),
            style,
            points,
        }
    });
    ErrorTimePlot {
        title: "Solvers on stiff and extreme systems: error against run time".to_owned(),
        subtitle: format!("every case that a solver was right on, to a relative residual of {TOLERANCE:e}"),
        error_label: "relative error of the radiosity".to_owned(),
        series: series.collect(),
        joined: false,
        reference_error: None,
    }
}
