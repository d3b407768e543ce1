//! `radiosity reproduce`.

use std::fmt::Write as _;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use serde_json::json;

use super::args::{PaperName, ReproduceArgs};
use super::compare::failure;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::pipeline::Run;
use super::{Outcome, SCHEMA_VERSION, output, reproduce_solvers};
use crate::experiment::baranoski::{self, Figure, LEVEL, TABLE_OF_SOLVERS, TableResult, solvers};
use crate::report::{Table, memory_peak_byte};

/// Runs of every stochastic method.
const DEFAULT_SEEDS: u64 = 100;

pub(super) fn run(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    match args.paper {
        PaperName::Baranoski => run_baranoski(args),
        PaperName::Stability => super::stability::run(args),
        PaperName::Lewis => super::reproduce_lewis::run(args),
        PaperName::Malgouyres => super::reproduce_malgouyres::run(args),
    }
}

fn run_baranoski(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    if args.level.is_some() {
        return Err(Failure::usage("--level is for `lewis`; `baranoski` has no levels"));
    }
    let (seeds, seed) = (args.seeds.unwrap_or(DEFAULT_SEEDS), args.seed.unwrap_or(0));
    let tables = match &args.tables {
        None => std::iter::once(TABLE_OF_SOLVERS).chain(baranoski::TABLES).collect(),
        Some(list) => parse_tables(list, TABLE_OF_SOLVERS..=*baranoski::TABLES.end())?,
    };
    let directory = args
        .output
        .clone()
        .unwrap_or_else(|| PathBuf::from("reproduce-baranoski"));
    output::make_directory(&directory)?;
    let mut run = Run::new("reproduce", &args.common);
    run.set("paper", json!(args.paper));
    run.set("tables", json!(tables));
    run.set("seeds", seeds);
    run.set("seed", seed);
    let of_form_factors: Vec<u8> = tables.iter().copied().filter(|t| *t != TABLE_OF_SOLVERS).collect();
    let cases = if tables.contains(&TABLE_OF_SOLVERS) {
        run.times
            .time("solvers", || solvers::table_2(&run.progress))
            .map_err(failure)?
    } else {
        Vec::new()
    };
    let results = run
        .times
        .time("reproduce", || {
            baranoski::reproduce(&of_form_factors, seeds, seed, &run.progress)
        })
        .map_err(failure)?;
    run.progress.finish();
    let inside = results.iter().all(|table| table.inside) && cases.iter().all(solvers::CaseResult::inside);
    let mut files = ["report.md", "results.csv", "results.json"].map(str::to_owned).to_vec();
    if !cases.is_empty() {
        files.extend(reproduce_solvers::write(&directory, &cases)?);
    }
    let document = json!({
        "schema_version": SCHEMA_VERSION,
        "command": run.command,
        "version": env!("CARGO_PKG_VERSION"),
        "settings": run.settings,
        "stages": run.times.to_json(),
        "total_s": run.times.total_s(),
        "memory_peak_byte": memory_peak_byte(),
        "level": LEVEL,
        "inside": inside,
        "tables": results,
        "solvers": cases,
        "files": files,
    });
    let mut report = if of_form_factors.is_empty() {
        String::from("# Baranoski, Bramley and Shirley 1995: the paper's numbers beside ours\n")
    } else {
        report(&results)
    };
    let mut printed = report.clone();
    if !cases.is_empty() {
        report.push_str(&reproduce_solvers::report(&cases, false));
        printed.push_str(&reproduce_solvers::report(&cases, true));
    }
    // Times and memory do not belong into the results: equal work gives equal bytes.
    let results_document = json!({
        "schema_version": SCHEMA_VERSION,
        "version": env!("CARGO_PKG_VERSION"),
        "settings": run.settings,
        "level": LEVEL,
        "inside": inside,
        "tables": results,
        "solvers": cases,
    });
    let write = |file: &str, text: &str| output::write(&directory.join(file), |w| w.write_all(text.as_bytes()));
    write("report.md", &report)?;
    write("results.csv", &all_figures(&results).to_csv())?;
    write("results.json", &format!("{results_document:#}\n"))?;
    let _ = writeln!(
        printed,
        "\nwrote report.md, results.csv, results.json{} to {}",
        if cases.is_empty() {
            ""
        } else {
            ", and the tables and plots of table 2,"
        },
        directory.display()
    );
    if !inside {
        run.warn("our own figures are outside of what they must be; see the tables marked so");
    }
    Ok(Outcome {
        text: printed,
        document,
        code: if inside { ExitCode::Done } else { ExitCode::CheckFailed },
    })
}

/// Reads a list like `3,5-7` of tables that are built.
pub(super) fn parse_tables(list: &str, built: RangeInclusive<u8>) -> Result<Vec<u8>, Failure> {
    let (least, most) = (built.start(), built.end());
    let mut tables = Vec::new();
    for part in list.split(',') {
        let ends = part.split_once('-').unwrap_or((part, part));
        let number = |text: &str| text.trim().parse::<u8>().ok();
        let range = number(ends.0).zip(number(ends.1)).filter(|(a, b)| a <= b);
        let Some((first, last)) = range else {
            return Err(Failure::usage(format!(
                "`{part}` names no tables; write --tables {least}-{most} or --tables {least},{most}"
            )));
        };
        if !(built.contains(&first) && built.contains(&last)) {
            return Err(Failure::usage(format!(
                "`{part}`: of this paper tables {least} to {most} are built; write --tables {least}-{most}"
            )));
        }
        tables.extend(first..=last);
    }
    tables.sort_unstable();
    tables.dedup();
    Ok(tables)
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
    let relative = table.figures.iter().any(|f| f.relative_error.is_some());
    let mut columns = vec![
        "figure",
        "method",
        "paper",
        "ours: mean",
        "ours: sd",
        "exact mean",
        "exact sd",
        "99.9 % of runs",
        "paper's percentile",
    ];
    if relative {
        columns.extend(["paper: error (%)", "ours: error (%)"]);
    }
    let mut rows = Table::new(columns);
    for figure in &table.figures {
        let per_cent = figure.name.ends_with("(%)");
        let show = |v: f64| if per_cent { format!("{v:.3}") } else { format!("{v:.6}") };
        let maybe = |v: Option<f64>| v.map_or("–".to_owned(), show);
        let random = figure.reproduced;
        let paper = match figure.corrected {
            Some(corrected) => format!("{}† ({corrected})", figure.printed),
            None => figure.printed.to_string(),
        };
        let mut cells = vec![
            figure.name.clone(),
            figure.method.to_owned(),
            paper,
            show(figure.measured.mean),
            maybe(Some(figure.measured.sd).filter(|_| random)),
            maybe(figure.expected_mean),
            maybe(figure.expected_sd),
            figure.range.map_or("–".to_owned(), |[low, high]| {
                format!("{} to {}", show(low), show(high))
            }),
            match figure.printed_percentile {
                Some(p) => format!("{p:.1} %"),
                None if figure.reproduced => "the same".to_owned(),
                None => "not reproduced".to_owned(),
            },
        ];
        if relative {
            let error = |e: Option<f64>, digits: usize| e.map_or("–".to_owned(), |e| format!("{e:.digits$}"));
            cells.extend([error(figure.printed_relative_error, 3), error(figure.relative_error, 3)]);
        }
        rows.push(cells);
    }
    rows
}

fn all_figures(results: &[TableResult]) -> Table {
    let mut table = Table::new([
        "table",
        "n_patches",
        "rays",
        "method",
        "figure",
        "printed",
        "corrected",
        "misprint",
        "mean",
        "sd",
        "min",
        "max",
        "expected_mean",
        "expected_sd",
        "range_low",
        "range_high",
        "printed_percentile",
        "printed_relative_error",
        "relative_error",
        "reproduced",
        "p_mean",
        "p_sd",
    ]);
    let number = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:?}"));
    for result in results {
        for figure in &result.figures {
            table.push([
                result.number.to_string(),
                result.n_patches.to_string(),
                result.rays.to_string(),
                figure.method.to_owned(),
                figure.name.clone(),
                format!("{:?}", figure.printed),
                number(figure.corrected),
                figure.misprint.unwrap_or_default().to_owned(),
                format!("{:?}", figure.measured.mean),
                format!("{:?}", figure.measured.sd),
                format!("{:?}", figure.measured.min),
                format!("{:?}", figure.measured.max),
                number(figure.expected_mean),
                number(figure.expected_sd),
                number(figure.range.map(|r| r[0])),
                number(figure.range.map(|r| r[1])),
                number(figure.printed_percentile),
                number(figure.printed_relative_error),
                number(figure.relative_error),
                figure.reproduced.to_string(),
                number(figure.p_mean),
                number(figure.p_sd),
            ]);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_tables() {
        let read = |list: &str| parse_tables(list, 3..=8).map_err(|failure| failure.message);
        assert_eq!(read("3-8"), Ok(vec![3, 4, 5, 6, 7, 8]));
        assert_eq!(read("7, 3,5-7"), Ok(vec![3, 5, 6, 7]));
        for wrong in ["", "2", "3-9", "8-3", "x", "3-"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
