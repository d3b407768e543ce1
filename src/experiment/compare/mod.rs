//! Compares all methods on one scene: the true error against the run time.

mod part;
mod report;
mod tables;

pub use part::{Part, default_subdivision, matrix_demand};
pub use report::{CompareDocument, ComparisonRecord, ReferenceRecord, Subject};

use std::time::Instant;

use serde::Serialize;

use super::statistics::Spread;
use super::{ExperimentError, RayUse, Reference, Sweep, pareto};
use crate::form_factor::{FormFactorError, Input};
use crate::matrix::{MatrixError, StorageChoice};
use crate::progress::{Progress, Silent};

/// The settings of a comparison.
#[derive(Clone, Debug)]
pub struct CompareSettings<'a> {
    /// The methods.
    pub sweeps: Vec<&'static Sweep>,
    /// The number of runs of every setting, each with a seed of its own.
    pub n_seeds: u64,
    /// The first seed; the others follow it.
    pub first_seed: u64,
    /// The greatest time of a single run, s.
    ///
    /// Settings that took longer are not repeated, and those that are expected to take longer are not run at all.
    pub time_limit_s: f64,
    /// The storage of the form factors of every run.
    pub storage: StorageChoice<'a>,
}

impl CompareSettings<'_> {
    /// The default [`n_seeds`](Self::n_seeds).
    pub const SEEDS: u64 = 5;

    /// The default [`time_limit_s`](Self::time_limit_s).
    pub const TIME_LIMIT_S: f64 = 2.0;
}

/// One run of one setting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "CompareRun"))]
pub struct Run {
    /// The method's name in the sweep.
    pub method: &'static str,
    /// The parameter that varies.
    pub parameter: &'static str,
    /// Its value.
    pub value: u64,
    /// The seed.
    pub seed: u64,
    /// Wall time of the method, s: from the patches to the stored form factors.
    pub time_s: f64,
    /// max |F − F*|.
    pub error_max: f64,
    /// Root-mean-square error; see [`Reference::errors`].
    pub error_rms: f64,
    /// The share of entries that are not zero.
    pub density: f64,
    /// The bytes of the form factors, with their standard errors, in memory or on a disk.
    pub stored_bytes: u64,
}

/// The summary of the runs of one setting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "CompareCase"))]
pub struct CaseSummary {
    /// The method's name in the sweep.
    pub method: &'static str,
    /// The parameter that varies.
    pub parameter: &'static str,
    /// Its value.
    pub value: u64,
    /// The number of runs.
    pub n_runs: usize,
    /// Wall time, s.
    pub time_s: Spread,
    /// max |F − F*|.
    pub error_max: Spread,
    /// Root-mean-square error.
    pub error_rms: Spread,
    /// True if the medians of time and greatest error are on the Pareto front of all settings; errors below the reference's own count as that.
    pub on_front_max: bool,
    /// True if the medians of time and root-mean-square error are.
    pub on_front_rms: bool,
}

/// A setting that was not measured, or not as often as asked.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LeftOut {
    /// The method's name in the sweep.
    pub method: &'static str,
    /// The values concerned.
    pub values: Vec<u64>,
    /// Why.
    pub reason: String,
}

/// The measurements of a comparison.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// One entry for each setting, by method and value.
    pub cases: Vec<CaseSummary>,
    /// Every run, in the order of execution.
    pub runs: Vec<Run>,
    /// The measurements that were left out.
    pub left_out: Vec<LeftOut>,
}

/// A setting during the runs over the seeds.
struct Case {
    sweep: &'static Sweep,
    value: u64,
    runs: Vec<Run>,
    /// True if it is not run any more.
    stopped: bool,
    /// True if the method cannot treat the scene.
    unusable: bool,
}

/// Runs every setting of every method over the seeds and measures the errors against `reference`.
///
/// Everything runs in the caller's thread pool, one run at a time. The settings are interleaved: each seed runs all of them before the next seed
/// begins, in an order rotated by one place for every seed, so that changes of the machine's speed affect them alike.
/// Before the measurements, the cheapest setting runs once to wake the threads. Methods that always trace rays are left out if
/// `input.unoccluded` excludes visibility.
///
/// # Errors
/// [`ExperimentError::Method`] if a method fails, with its setting.
///
/// # Panics
/// If the reference is that of another scene.
pub fn compare(
    input: Input<'_>,
    reference: &Reference,
    settings: &CompareSettings<'_>,
    progress: &dyn Progress,
) -> Result<Comparison, ExperimentError> {
    let mut left_out = Vec::new();
    let mut cases = Vec::new();
    for &sweep in &settings.sweeps {
        if input.unoccluded && sweep.rays == RayUse::Everything {
            left_out.push(LeftOut {
                method: sweep.name,
                values: sweep.values.to_vec(),
                reason: "as its rays always meet what they hit first".to_owned(),
            });
            continue;
        }
        let values = sweep.values(input.unoccluded);
        let case = |&value| Case {
            sweep,
            value,
            runs: Vec::new(),
            stopped: false,
            unusable: false,
        };
        cases.extend(values.iter().map(case));
    }
    if let Some(first) = cases.first() {
        // Its errors, if any, occur again below.
        let _ = measure(input, reference, first, settings.first_seed, settings.storage);
    }
    progress.begin("compare", settings.n_seeds * cases.len() as u64);
    let mut runs = Vec::new();
    for turn in 0..settings.n_seeds {
        let n = cases.len();
        for k in 0..n {
            // The first turn goes upwards through each sweep, as forecasts require.
            #[expect(
                clippy::cast_possible_truncation,
                reason = "the remainder is below the number of settings"
            )]
            let k = (k + (turn % n as u64) as usize) % n;
            progress.advance(1);
            if cases[k].stopped {
                continue;
            }
            let seed = settings.first_seed.wrapping_add(turn);
            let run = match measure(input, reference, &cases[k], seed, settings.storage) {
                Ok(run) => run,
                Err(ExperimentError::Method {
                    source: source @ FormFactorError::NotApplicable { .. },
                    ..
                }) => {
                    left_out.push(cannot_be_used(&mut cases, k, &source));
                    continue;
                }
                Err(error) => return Err(error),
            };
            runs.push(run);
            cases[k].runs.push(run);
            if turn == 0 {
                stop_what_takes_too_long(&mut cases, k, run.time_s, settings.time_limit_s);
            }
        }
    }
    left_out.extend(
        settings
            .sweeps
            .iter()
            .filter_map(|sweep| shortened(sweep, &cases, settings)),
    );
    Ok(Comparison {
        cases: summaries(&cases, reference),
        runs,
        left_out,
    })
}

fn measure(
    input: Input<'_>,
    reference: &Reference,
    case: &Case,
    seed: u64,
    storage: StorageChoice<'_>,
) -> Result<Run, ExperimentError> {
    let Case { sweep, value, .. } = *case;
    let failed = |source| ExperimentError::Method {
        method: sweep.name,
        parameter: sweep.parameter.name(),
        value,
        source,
    };
    let method = sweep.build(value, seed).map_err(failed)?;
    let start = Instant::now();
    let computed = method.compute(input, storage, &Silent);
    let time_s = start.elapsed().as_secs_f64();
    let computed = computed.map_err(failed)?;
    let (error_max, error_rms) = reference
        .errors(&computed.factors, input.mesh)
        .map_err(MatrixError::from)?;
    Ok(Run {
        method: sweep.name,
        parameter: sweep.parameter.name(),
        value,
        seed,
        time_s,
        error_max,
        error_rms,
        density: computed.factors.density(),
        stored_bytes: computed.factors.stored_byte() as u64,
    })
}

/// Stops all settings of the method of setting `k`, which cannot treat the scene.
fn cannot_be_used(cases: &mut [Case], k: usize, reason: &FormFactorError) -> LeftOut {
    let name = cases[k].sweep.name;
    let mut values = Vec::new();
    for case in cases.iter_mut().filter(|case| case.sweep.name == name) {
        case.stopped = true;
        case.unusable = true;
        values.push(case.value);
    }
    LeftOut {
        method: name,
        values,
        reason: reason.to_string(),
    }
}

/// Stops setting `k` if it took longer than the limit, and all more expensive ones of its method if the next of them is expected to.
fn stop_what_takes_too_long(cases: &mut [Case], k: usize, time_s: f64, limit_s: f64) {
    cases[k].stopped = time_s > limit_s;
    let (sweep, value) = (cases[k].sweep, cases[k].value);
    let dearer = |case: &Case| case.sweep.name == sweep.name && case.value > value;
    let Some(next) = cases.iter().filter(|case| dearer(case)).map(|case| case.value).min() else {
        return;
    };
    let growth = (next as f64 / value as f64).powi(sweep.parameter.cost_power());
    if time_s * growth > limit_s {
        cases
            .iter_mut()
            .filter(|case| dearer(case))
            .for_each(|case| case.stopped = true);
    }
}

fn shortened(sweep: &Sweep, cases: &[Case], settings: &CompareSettings<'_>) -> Option<LeftOut> {
    let stopped = cases
        .iter()
        .filter(|case| case.sweep.name == sweep.name && case.stopped && !case.unusable);
    let values: Vec<u64> = stopped.map(|case| case.value).collect();
    (!values.is_empty()).then(|| LeftOut {
        method: sweep.name,
        values,
        reason: format!(
            "as a run takes more than {} s, or is expected to (at most one was made); a longer time limit measures them",
            settings.time_limit_s
        ),
    })
}

fn summaries(cases: &[Case], reference: &Reference) -> Vec<CaseSummary> {
    let measured: Vec<&Case> = cases.iter().filter(|case| !case.runs.is_empty()).collect();
    let spread = |case: &Case, of: fn(&Run) -> f64| Spread::of(&case.runs.iter().map(of).collect::<Vec<_>>());
    let mut summaries: Vec<CaseSummary> = measured
        .iter()
        .map(|case| CaseSummary {
            method: case.sweep.name,
            parameter: case.sweep.parameter.name(),
            value: case.value,
            n_runs: case.runs.len(),
            time_s: spread(case, |run| run.time_s),
            error_max: spread(case, |run| run.error_max),
            error_rms: spread(case, |run| run.error_rms),
            on_front_max: false,
            on_front_rms: false,
        })
        .collect();
    // The reference does not resolve differences below its own error.
    let front = |error: fn(&CaseSummary) -> Spread, resolved: f64| {
        let point = |s: &CaseSummary| (s.time_s.median, error(s).median.max(resolved));
        pareto::front(&summaries.iter().map(point).collect::<Vec<_>>())
    };
    let max = front(|s| s.error_max, reference.error_max);
    let rms = front(|s| s.error_rms, reference.error_rms);
    for (k, summary) in summaries.iter_mut().enumerate() {
        summary.on_front_max = max[k];
        summary.on_front_rms = rms[k];
    }
    summaries
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::experiment::sweep_by_name;

    #[test]
    fn forecasts_look_one_step_ahead() {
        let sweep = sweep_by_name("sr").unwrap();
        let mut cases: Vec<Case> = [64, 256, 1024, 4096]
            .map(|value| Case {
                sweep,
                value,
                runs: Vec::new(),
                stopped: false,
                unusable: false,
            })
            .into();
        let stopped = |all: &[Case]| -> Vec<bool> { all.iter().map(|c| c.stopped).collect() };
        // Four times as many rays would take 0.8 s; further settings are not predicted from here.
        stop_what_takes_too_long(&mut cases, 0, 0.2, 1.0);
        assert_eq!(stopped(&cases), [false; 4]);
        stop_what_takes_too_long(&mut cases, 1, 0.3, 1.0);
        assert_eq!(stopped(&cases), [false, false, true, true]);
        stop_what_takes_too_long(&mut cases, 1, 1.1, 1.0);
        assert_eq!(stopped(&cases), [false, true, true, true]);
    }
}
