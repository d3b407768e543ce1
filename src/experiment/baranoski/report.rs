//! The reproduction as report, tables and JSON.

use std::fmt::Write as _;

use serde::Serialize;

use super::solvers::{self, CaseResult};
use super::{Figure, LEVEL, TableResult};
use crate::experiment::ExperimentError;
use crate::experiment::findings::{Findings, ResultsFile, text_file};
use crate::report::{SCHEMA_VERSION, Table, pretty, table};
use crate::workflow::Settings;

/// The default number of runs of every stochastic method.
pub const DEFAULT_SEEDS: u64 = 100;

/// The part of the JSON document about the tables.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct BaranoskiDocument<'a> {
    /// The probability with which a table of a correct program is found outside of its range.
    pub level: f64,
    /// True if all tables are inside of their ranges.
    pub inside: bool,
    /// Tables 3 to 8, those that were asked for.
    pub tables: &'a [TableResult],
    /// Table 2, case by case.
    pub solvers: &'a [CaseResult],
}

/// Returns the report, files and document of tables 3 to 8 and of table 2, as far as computed; `settings` are those of the run.
///
/// # Errors
/// [`ExperimentError::Plot`].
pub fn findings<'a>(
    tables: &'a [TableResult],
    cases: &'a [CaseResult],
    settings: &Settings,
) -> Result<Findings<BaranoskiDocument<'a>>, ExperimentError> {
    let inside = tables.iter().all(|table| table.inside) && cases.iter().all(CaseResult::inside);
    let mut without_times = if tables.is_empty() {
        String::from("# Baranoski, Bramley and Shirley 1995: the paper's numbers beside ours\n")
    } else {
        report(tables)
    };
    let mut printed = without_times.clone();
    if !cases.is_empty() {
        without_times.push_str(&solvers::report::report(cases, false));
        printed.push_str(&solvers::report::report(cases, true));
    }
    let document = BaranoskiDocument {
        level: LEVEL,
        inside,
        tables,
        solvers: cases,
    };
    let results = ResultsFile {
        schema_version: SCHEMA_VERSION,
        version: Some(env!("CARGO_PKG_VERSION")),
        settings,
        results: document,
    };
    let mut files = vec![
        text_file("report.md", without_times),
        text_file("results.csv", all_figures(tables).to_csv()),
        text_file("results.json", format!("{}\n", pretty(&results))),
    ];
    if !cases.is_empty() {
        files.extend(solvers::report::files(cases)?);
    }
    let wrong = "our own figures are outside of what they must be; see the tables marked so";
    Ok(Findings {
        printed,
        files,
        captions: Vec::new(),
        document,
        wrong: (!inside).then(|| wrong.to_owned()),
    })
}

fn report(results: &[TableResult]) -> String {
    let mut text =
        String::from("# Baranoski, Bramley and Shirley 1995, appendix A: the paper's numbers beside ours\n\n");
    let _ = writeln!(
        text,
        "The paper prints one run of each method. \"Ours\" is an ensemble of {} runs, which differ in their seeds, with every pair of faces shot once, from the lower \
         number, as the paper's own numbers show. \"Exact\" is what such runs must have as mean and standard deviation. \"99.9 % of runs\" is where \
         a single run lies. The last column tells which share of our runs lies below the paper's number.\n\n\
         † marks a misprint; the number that it must have been stands in brackets, and is the one that the percentile is of. \
         PDM's digits are **not reproduced**: they follow from no known form of the method. Ours are those of plain 5 × 5 × 5 × 5 Gauss, and exact is what an independent computation of it gave.",
        results.first().map_or(0, |t| t.n_seeds)
    );
    for table in results {
        let _ = writeln!(text, "\n## Table {}: {}\n", table.number, table.title);
        text.push_str(&figures_table(table).to_markdown());
        let verdict = if table.inside { "inside" } else { "OUTSIDE" };
        let _ = writeln!(
            text,
            "\nOurs against exact: {verdict} the 99.9 % range of all figures together ({} tests of means and standard deviations, the least probability {:.2e}, the \
             bound {:.2e}).",
            table.n_tests,
            table.p_least,
            LEVEL / table.n_tests.max(1) as f64
        );
        let mut reasons: Vec<&str> = table.figures.iter().filter_map(|f| f.misprint).collect();
        reasons.dedup();
        for reason in reasons {
            let marked = |f: &&Figure| f.misprint == Some(reason);
            let names: Vec<String> = table
                .figures
                .iter()
                .filter(marked)
                .map(|f| format!("{} {}", f.method, f.name))
                .collect();
            let _ = writeln!(text, "\n† {}: {reason}.", names.join(", "));
        }
        if table.number == 6 {
            let _ = writeln!(
                text,
                "\n† The paper's head of the column SR says 1000 points a patch: with 625 rays of one point each it was 625."
            );
        }
    }
    text
}

fn figures_table(table: &TableResult) -> Table {
    let has_relative = table.figures.iter().any(|f| f.relative_error.is_some());
    let show = |figure: &Figure, v: f64| {
        let digits = if figure.name.ends_with("(%)") { 3 } else { 6 };
        format!("{v:.digits$}")
    };
    let maybe = |figure: &Figure, v: Option<f64>| v.map_or("–".to_owned(), |v| show(figure, v));
    let error = |e: Option<f64>| e.map_or("–".to_owned(), |e| format!("{e:.3}"));
    let all = table! { figure in &table.figures;
        "figure": figure.name,
        "method": figure.method,
        "paper": match figure.corrected {
            Some(corrected) => format!("{}† ({corrected})", figure.printed),
            None => figure.printed.to_string(),
        },
        "ours: mean": show(figure, figure.measured.mean),
        "ours: sd": maybe(figure, figure.reproduced.then_some(figure.measured.sd)),
        "exact mean": maybe(figure, figure.expected_mean),
        "exact sd": maybe(figure, figure.expected_sd),
        "99.9 % of runs": figure.range.map_or("–".to_owned(), |[low, high]| {
            format!("{} to {}", show(figure, low), show(figure, high))
        }),
        "paper's percentile": match figure.printed_percentile {
            Some(p) => format!("{p:.1} %"),
            None if figure.reproduced => "the same".to_owned(),
            None => "not reproduced".to_owned(),
        },
        "paper: error (%)": error(figure.printed_relative_error),
        "ours: error (%)": error(figure.relative_error),
    };
    all.without_last(if has_relative { 0 } else { 2 })
}

fn all_figures(results: &[TableResult]) -> Table {
    let all = results
        .iter()
        .flat_map(|of| of.figures.iter().map(move |figure| (of, figure)));
    table! { (result, figure) in all;
        "table": result.number,
        "n_patches": result.n_patches,
        "rays": result.rays,
        "method": figure.method,
        "figure": figure.name,
        "printed": figure.printed,
        "corrected": figure.corrected,
        "misprint": figure.misprint,
        "mean": figure.measured.mean,
        "sd": figure.measured.sd,
        "min": figure.measured.min,
        "max": figure.measured.max,
        "expected_mean": figure.expected_mean,
        "expected_sd": figure.expected_sd,
        "range_low": figure.range.map(|r| r[0]),
        "range_high": figure.range.map(|r| r[1]),
        "printed_percentile": figure.printed_percentile,
        "printed_relative_error": figure.printed_relative_error,
        "relative_error": figure.relative_error,
        "reproduced": figure.reproduced,
        "p_mean": figure.p_mean,
        "p_sd": figure.p_sd,
    }
}
