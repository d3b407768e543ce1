//! Table 2 of Baranoski, Bramley and Shirley as files: the solvers side by side.

use std::fmt::Write as _;

use super::{CaseResult, METHODS, SolverRun, Verdict, start_name};
use crate::experiment::ExperimentError;
use crate::experiment::findings::{Files, text_file};
use crate::report::curves::{Curve, CurvePlot};
use crate::report::{Table, table};
use crate::solver::HistoryEntry;

/// An error norm of the paper.
struct Norm {
    file: &'static str,
    label: &'static str,
    of: fn(&HistoryEntry) -> f64,
}

const NORMS: [Norm; 4] = [
    Norm {
        file: "max-power",
        label: "greatest power |r A| (W, equation 25)",
        of: |entry| entry.residual_max_power,
    },
    Norm {
        file: "residual",
        label: "residual norm sqrt(Σ r²) (W/m², equation 26)",
        of: |entry| entry.residual_euclidean,
    },
    Norm {
        file: "rms-error",
        label: "RMS error (W/m², equation 27)",
        of: |entry| entry.errors.map_or(f64::NAN, |e| e.error_rms),
    },
    Norm {
        file: "goertler-error",
        label: "wrong share of reflected light (equation 28)",
        of: |entry| entry.errors.map_or(f64::NAN, |e| e.error_goertler),
    },
];

/// Returns the report in Markdown, with our times, or without for files.
pub(in crate::experiment::baranoski) fn report(results: &[CaseResult], with_times: bool) -> String {
    let mut text = String::from(
        "\n## Table 2: solvers on the room with the sphere\n\n\
         All stop at max |r A| < 1e-3 W. n steps are a pass. \"Paper\" is its time in seconds on a machine of 1995, and the passes that follow from it. \"Expected\" is what an \
         independent implementation of the corrected algorithms counted; passes may differ by 1, steps of progressive refinement by 1 %, of overshooting by three quarters of a pass more, RMS errors by a factor of 2. The same residual is not the same accuracy: the last columns \
         tell the errors against a solution to 1e-12.\n",
    );
    for result in results {
        let case = &result.case;
        let _ = writeln!(
            text,
            "\n### Case {}: ρ_avg = {}, {:.1} % of F not 0 (paper: {} %), eigenvalues {:.4} to {:.4}\n",
            case.name,
            case.rho_avg,
            100.0 * result.density,
            case.paper_density_percent,
            result.eigenvalue_range[0],
            result.eigenvalue_range[1]
        );
        text.push_str(&case_table(result, with_times).to_markdown());
        let forms = table! { form in &result.printed_forms;
            "as printed": form.name,
            "what is wrong": form.slip,
            "steps": form.n_steps,
            "outcome": verdict(form.verdict),
            "expected": form.expected.map_or("–", verdict),
            "max |r A| (W)": format!("{:.1e}", form.residual_max_power),
            "RMS error": format!("{:.1e}", form.error_rms),
        };
        let _ = writeln!(text, "\n{}", forms.to_markdown());
        let verdict = if result.inside() { "inside" } else { "OUTSIDE" };
        let _ = writeln!(text, "Case {}: {verdict} the tolerances.", case.name);
    }
    text
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Converges => "converges",
        Verdict::WrongAnswer => "wrong answer",
        Verdict::Diverges => "diverges",
    }
}

fn case_table(result: &CaseResult, with_times: bool) -> Table {
    let dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    let all = table! { (run, method) in result.runs.iter().zip(&METHODS);
        "method": run.method,
        "start": start_name(method.start),
        "paper: s": dash(run.paper_time_s.map(|t| format!("{t:.2}"))),
        "paper: passes": dash(run.paper_passes.map(|p| p.to_string())),
        "expected": dash(run.expected_count.map(|c| c.to_string())),
        "passes": format!("{:.*}", if method.by_steps { 2 } else { 0 }, run.n_passes),
        "steps": run.n_steps,
        "selected alike": dash(run.selected_alike.map(|share| format!("{:.0} %", 100.0 * share))),
        "RMS error": format!("{:.1e}", run.error_rms),
        "Goertler": format!("{:.1e}", run.error_goertler),
        "tolerances": if run.inside { "inside" } else { "OUTSIDE" },
        "ms": format!("{:.2}", 1e3 * run.time_s),
    };
    all.without_last(usize::from(!with_times))
}

/// Returns tables and plots as files.
pub(in crate::experiment::baranoski) fn files(results: &[CaseResult]) -> Result<Files, ExperimentError> {
    let mut files = vec![
        text_file("table-2.csv", summary(results).to_csv()),
        text_file("table-2-histories.csv", histories(results).to_csv()),
        text_file("table-2-times.csv", times(results).to_csv()),
        text_file("table-2-eigenvalues.csv", eigenvalues(results).to_csv()),
    ];
    for result in results {
        for norm in &NORMS {
            for by_time in [false, true] {
                let plot = convergence(result, norm, by_time);
                let axis = if by_time { "time" } else { "steps" };
                let name = result.case.name.to_ascii_lowercase();
                let file = format!("case-{name}-{}-{axis}.svg", norm.file);
                files.push(text_file(file, plot.to_svg()?));
            }
        }
    }
    for (file, title, cases) in [
        (
            "figure-2.svg",
            "Eigenvalues as the reflectance grows (figure 2)",
            &['A', 'B', 'C', 'D'][..],
        ),
        (
            "figure-3.svg",
            "Eigenvalues as the density grows (figure 3)",
            &['C', 'E'][..],
        ),
    ] {
        files.push(text_file(file, spectra(results, title, cases).to_svg()?));
    }
    Ok(files)
}

fn convergence(result: &CaseResult, norm: &Norm, by_time: bool) -> CurvePlot {
    let n = result.eigenvalues.len() as f64;
    let curve = |(style, run): (usize, &SolverRun)| {
        let x = |entry: &HistoryEntry| if by_time { 1e3 * entry.time_s } else { n * entry.work };
        let points = run.history.iter().map(|entry| (x(entry), (norm.of)(entry)));
        Curve {
            name: run.method.to_owned(),
            style,
            points: points.collect(),
        }
    };
    CurvePlot {
        title: format!("Case {}: ρ_avg = {}", result.case.name, result.case.rho_avg),
        subtitle: format!(
            "992 patches, {:.1} % of F not 0; until max |r A| < 1e-3 W",
            100.0 * result.density
        ),
        x_label: if by_time { "run time (ms)" } else { "steps of iteration" }.to_owned(),
        y_label: norm.label.to_owned(),
        log_x: false,
        log_y: true,
        marked: false,
        curves: result.runs.iter().enumerate().map(curve).collect(),
    }
}

fn spectra(results: &[CaseResult], title: &str, cases: &[char]) -> CurvePlot {
    let shown = results.iter().enumerate().filter(|(_, r)| cases.contains(&r.case.name));
    CurvePlot {
        title: title.to_owned(),
        subtitle: "I − diag(ρ) F, all eigenvalues in ascending order".to_owned(),
        x_label: "number of the eigenvalue".to_owned(),
        y_label: "eigenvalue".to_owned(),
        log_x: false,
        log_y: false,
        marked: false,
        curves: shown
            .map(|(style, result)| Curve {
                name: format!(
                    "{}: ρ_avg = {}, {:.0} %",
                    result.case.name,
                    result.case.rho_avg,
                    100.0 * result.density
                ),
                // The first styles are those of the solvers.
                style: METHODS.len() + style,
                points: result
                    .eigenvalues
                    .iter()
                    .enumerate()
                    .map(|(k, v)| ((k + 1) as f64, *v))
                    .collect(),
            })
            .collect(),
    }
}

fn summary(results: &[CaseResult]) -> Table {
    let runs = results
        .iter()
        .flat_map(|of| of.runs.iter().zip(&METHODS).map(move |(run, method)| (of, run, method)));
    table! { (result, run, method) in runs;
        "case": result.case.name,
        "rho_avg": result.case.rho_avg,
        "density": result.density,
        "method": run.method,
        "start": start_name(method.start),
        "stop_reason": run.stop_reason.to_string(),
        "n_steps": run.n_steps,
        "n_passes": run.n_passes,
        "residual_max_power": run.residual_max_power,
        "error_rms": run.error_rms,
        "error_goertler": run.error_goertler,
        "expected_count": run.expected_count,
        "expected_rms": run.expected_rms,
        "paper_time_s": run.paper_time_s,
        "paper_passes": run.paper_passes,
        "selected_alike": run.selected_alike,
        "inside": run.inside,
    }
}

/// Iterates over the history of every run, pass by pass.
fn entries(results: &[CaseResult]) -> impl Iterator<Item = (&CaseResult, &SolverRun, &HistoryEntry)> {
    let runs = results.iter().flat_map(|of| of.runs.iter().map(move |run| (of, run)));
    runs.flat_map(|(of, run)| run.history.iter().map(move |entry| (of, run, entry)))
}

fn histories(results: &[CaseResult]) -> Table {
    table! { (result, run, entry) in entries(results);
        "case": result.case.name,
        "method": run.method,
        "pass": entry.pass,
        "work": entry.work,
        "residual_max_power": entry.residual_max_power,
        "residual_euclidean": entry.residual_euclidean,
        "residual_l2": entry.residual_l2,
        "error_rms": entry.errors.map_or(f64::NAN, |e| e.error_rms),
        "error_goertler": entry.errors.map_or(f64::NAN, |e| e.error_goertler),
    }
}

fn times(results: &[CaseResult]) -> Table {
    table! { (result, run, entry) in entries(results);
        "case": result.case.name,
        "method": run.method,
        "pass": entry.pass,
        "time_s": entry.time_s,
    }
}

fn eigenvalues(results: &[CaseResult]) -> Table {
    let all = results
        .iter()
        .flat_map(|of| (1_usize..).zip(&of.eigenvalues).map(move |(k, value)| (of, k, value)));
    table! { (result, k, value) in all;
        "case": result.case.name,
        "rho_avg": result.case.rho_avg,
        "density": result.density,
        "number": k,
        "eigenvalue": *value,
    }
}
