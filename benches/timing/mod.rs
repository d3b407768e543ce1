//! Times of repeated runs.
#![expect(clippy::print_stdout, reason = "a benchmark prints its figures")]

use std::hint::black_box;
use std::time::{Duration, Instant};

/// The number of samples, of which the median counts.
const N_SAMPLES: usize = 11;

/// The least time of a sample: shorter runs are repeated in it.
const SAMPLE: Duration = Duration::from_millis(20);

/// Returns whether a benchmark is asked for: its name contains the first argument that is not a flag, if there is one.
pub(crate) fn is_wanted(name: &str) -> bool {
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
    wanted.is_none_or(|wanted| name.contains(&wanted))
}

/// Measures runs of `run`, each of which treats `n_items`, and prints the median, least and greatest time of one item.
pub(crate) fn measure<R>(name: &str, n_items: u64, mut run: impl FnMut() -> R) {
    if !is_wanted(name) {
        return;
    }
    let begin = Instant::now();
    black_box(run());
    let once = begin.elapsed().max(Duration::from_nanos(1));
    let n_runs = SAMPLE.as_nanos().div_ceil(once.as_nanos());
    let mut sample = || {
        let start = Instant::now();
        for _ in 0..n_runs {
            black_box(run());
        }
        start.elapsed().as_secs_f64() / (n_runs as f64 * n_items as f64)
    };
    let mut times: Vec<f64> = (0..N_SAMPLES).map(|_| sample()).collect();
    times.sort_by(f64::total_cmp);
    let [median, least, greatest] = [N_SAMPLES / 2, 0, N_SAMPLES - 1].map(|k| in_unit(times[k]));
    println!("{name:50} {median} ({least} to {greatest})");
}

/// Returns a time in a unit in which it has digits before the point.
fn in_unit(time_s: f64) -> String {
    let units = [(1.0, "s"), (1e-3, "ms"), (1e-6, "us")];
    let (size, unit) = units
        .into_iter()
        .find(|(size, _)| time_s >= *size)
        .unwrap_or((1e-9, "ns"));
    format!("{:.3} {unit}", time_s / size)
}
