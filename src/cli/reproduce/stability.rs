//! `radiosity reproduce stability`.

use std::fmt::Write as _;

use serde_json::json;

use super::{Findings, Reproduction};
use crate::cli::args::ReproduceArgs;
use crate::cli::failure::Failure;
use crate::cli::{Outcome, SCHEMA_VERSION, output};
use crate::experiment::stability::{self, CaseSummary, Cell, Stability, Verdict};
use crate::report::Table;
use crate::report::plot::{ErrorTimePlot, PlotPoint, Ranged, Series};

pub(super) fn run(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    if args.tables.is_some() {
        return Err(Failure::usage("--tables has no use with `stability`; leave it out"));
    }
    if args.level.is_some() || args.seeds.is_some() {
        return Err(Failure::usage(
            "--level and --seeds have no use with `stability`, whose cases are what they are; leave them out",
        ));
    }
    let mut reproduction = Reproduction::new(args)?;
    let run = &mut reproduction.run;
    let seed = args.seed.unwrap_or(0);
    run.cx.set("seed", seed);
    let result = run.cx.time("stability", || stability::run(seed, &run.cx.progress()))?;
    let n_wrong = result.wrong().count();
    let results_document = json!({"schema_version": SCHEMA_VERSION, "settings": run.cx.settings, "result": result});
    let files = vec![
        output::text("report.md", report(&result, false)),
        output::text("results.csv", cells(&result).to_csv()),
        output::text("results.json", format!("{results_document:#}\n")),
        output::text("times.csv", times_table(&result).to_csv()),
        output::text("error_time.svg", plot(&result).to_svg()?),
    ];
    reproduction.finish(Findings {
        printed: report(&result, true),
        files,
        result: json!({
            "tolerance": stability::TOLERANCE,
            "max_passes": stability::MAX_PASSES,
            "n_wrong": n_wrong,
            "result": result,
            "times": times(&result),
        }),
        wrong: (n_wrong > 0).then(|| format!("{n_wrong} cells are wrong; see the table")),
    })
}

/// Returns the report; files leave out the times, so that equal work gives equal bytes.
fn report(result: &Stability, with_times: bool) -> String {
    let count = |verdict: Verdict| result.cells.iter().filter(|cell| cell.verdict == verdict).count();
    let mut text = String::from("# Solvers on stiff, extreme and impossible systems\n\n");
    let _ = writeln!(
        text,
        "Every solver with its defaults on every case, to a relative residual of {:e} within {} passes. **right**: converged, and residual, error bound, signs and power balance are \
         true, judged by a solution to all digits; then the passes and the relative error. **slow**: all passes used up, and said so. **refused**: a typed error, or stopped as \
         stagnated or diverged. **WRONG**: anything else.\n\n{} right, {} slow, {} refused, {} wrong.\n",
        stability::TOLERANCE,
        stability::MAX_PASSES,
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
fn times(result: &Stability) -> serde_json::Value {
    let by_case = result.cells.chunks(result.solvers.len());
    let case = |(case, cells): (&CaseSummary, &[Cell])| {
        json!({
            "case": case.name,
            "time_s": cells.iter().map(|cell| cell.time_s).collect::<Vec<_>>(),
            "auto_time_ratio": case.auto_time_ratio,
        })
    };
    result.cases.iter().zip(by_case).map(case).collect()
}

fn times_table(result: &Stability) -> Table {
    let mut table = Table::new(["case", "solver", "time_s"]);
    for cell in &result.cells {
        let time = cell.time_s.map_or(String::new(), |time| format!("{time:?}"));
        table.push([cell.case.clone(), cell.solver.to_owned(), time]);
    }
    table
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
    let mut table = Table::new([
        "case",
        "solver",
        "verdict",
        "detail",
        "choice",
        "n_passes",
        "work",
        "error",
        "error_bound",
        "residual_l2",
    ]);
    let number = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:?}"));
    for cell in &result.cells {
        table.push([
            cell.case.clone(),
            cell.solver.to_owned(),
            format!("{:?}", cell.verdict).to_lowercase(),
            cell.detail.clone(),
            cell.choice.unwrap_or_default().to_owned(),
            cell.n_passes.map_or(String::new(), |n| n.to_string()),
            number(cell.work),
            number(cell.error),
            number(cell.error_bound),
            number(cell.residual_l2),
        ]);
    }
    table
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
        subtitle: format!(
            "every case that a solver was right on, to a relative residual of {:e}",
            stability::TOLERANCE
        ),
        error_label: "relative error of the radiosity".to_owned(),
        series: series.collect(),
        reference_error: None,
    }
}
