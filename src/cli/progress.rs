//! Progress on stderr: a bar on a terminal, a line now and then elsewhere.

use std::fmt::Write as _;
use std::io::IsTerminal;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

use super::interrupt::Interrupt;
use crate::checkpoint::Checkpoint;
use crate::progress::{Forecast, Progress};

/// The display moves this often on a terminal, whether work is done or not.
const TICK: Duration = Duration::from_millis(250);

/// Elsewhere there is a line this often.
const LINE: Duration = Duration::from_secs(30);

/// The current stage on stderr, with the time left.
pub(super) struct Bars {
    stage: Arc<Mutex<Stage>>,
    is_terminal: bool,
    interrupt: Interrupt,
    pub(super) checkpoint: Option<Checkpoint>,
    /// When work is to be over.
    pub(super) deadline: Option<Instant>,
    /// What there was to warn of meanwhile.
    warnings: Mutex<Vec<String>>,
    quiet: bool,
    /// Dropped, it ends the thread that writes lines.
    _lines: Option<Sender<()>>,
}

/// What is being done.
struct Stage {
    name: String,
    bar: ProgressBar,
    begun: Instant,
}

impl Bars {
    /// Shows bars if stderr is a terminal, and lines if it is not, unless `quiet` is asked for.
    #[must_use]
    pub(super) fn new(quiet: bool, interrupt: Interrupt) -> Self {
        let is_terminal = !quiet && std::io::stderr().is_terminal();
        let bar = if is_terminal {
            spinner("preparing")
        } else {
            ProgressBar::hidden()
        };
        let stage = Arc::new(Mutex::new(Stage {
            name: "preparing".to_owned(),
            bar,
            begun: Instant::now(),
        }));
        let lines = (!quiet && !is_terminal).then(|| {
            let (keep_on, ended) = channel();
            let stage = Arc::clone(&stage);
            std::thread::spawn(move || write_lines(&stage, &ended));
            keep_on
        });
        Self {
            stage,
            is_terminal,
            interrupt,
            checkpoint: None,
            deadline: None,
            warnings: Mutex::default(),
            quiet,
            _lines: lines,
        }
    }

    /// Returns the warnings that were written since the last time.
    pub(super) fn warnings(&self) -> Vec<String> {
        std::mem::take(&mut *self.warnings.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Removes the bar.
    pub(super) fn finish(&self) {
        locked(&self.stage).bar.finish_and_clear();
    }
}

// A poisoned lock only means that another thread panicked while drawing.
fn locked(stage: &Mutex<Stage>) -> std::sync::MutexGuard<'_, Stage> {
    stage.lock().unwrap_or_else(PoisonError::into_inner)
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .progress_chars("=> ")
}

/// Returns the display of a stage of which it is not known how much there is to do.
fn spinner(name: &str) -> ProgressBar {
    let style = style("{msg:<16} {spinner} {elapsed:>5}");
    ticking(
        ProgressBar::new_spinner()
            .with_style(style)
            .with_message(name.to_owned()),
    )
}

fn ticking(bar: ProgressBar) -> ProgressBar {
    bar.enable_steady_tick(TICK);
    bar
}

/// Returns what other settings would take than those of long work.
fn long_work(forecast: &Forecast) -> String {
    let time = |seconds: f64| {
        let seconds = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        HumanDuration(seconds).to_string()
    };
    let mut text = format!("form factors will take about {}", time(forecast.asked.1));
    for &(tolerance, seconds) in &forecast.looser {
        let _ = write!(text, ", to a tolerance of {tolerance:.0e} {}", time(seconds));
    }
    if let Some((rays, seconds)) = forecast.shooting {
        let error = Forecast::error_of_rays(rays);
        let _ = write!(text, ", by `--method sr` {} with errors of {error:.0e}", time(seconds));
    }
    text
}

/// Writes a line about the current stage every [`LINE`], until the other end of the channel is dropped.
fn write_lines(stage: &Mutex<Stage>, ended: &Receiver<()>) {
    while ended.recv_timeout(LINE) == Err(RecvTimeoutError::Timeout) {
        let stage = locked(stage);
        let elapsed = stage.begun.elapsed();
        let (done, total) = (stage.bar.position(), stage.bar.length().unwrap_or(0));
        let text = if total == 0 || done == 0 {
            format!("{}: {} so far", stage.name, HumanDuration(elapsed))
        } else {
            let share = done as f64 / total as f64;
            let left = Duration::try_from_secs_f64(elapsed.as_secs_f64() * (1.0 - share).max(0.0) / share);
            let left = left.map_or_else(
                |_| String::new(),
                |left| format!(", about {} left", HumanDuration(left)),
            );
            format!(
                "{}: {:.1} % in {}{left}",
                stage.name,
                100.0 * share,
                HumanDuration(elapsed)
            )
        };
        drop(stage);
        super::complain(&text);
    }
}

impl Progress for Bars {
    fn begin(&self, name: &str, total: u64) {
        let mut stage = locked(&self.stage);
        stage.bar.finish_and_clear();
        stage.bar = if self.is_terminal && total == 0 {
            spinner(name)
        } else if self.is_terminal {
            let style = style("{msg:<16} [{bar:32}] {percent_precise:>7} % in {elapsed:>5}, {eta:>6} left");
            ticking(ProgressBar::new(total).with_style(style).with_message(name.to_owned()))
        } else {
            // It counts, and draws nothing.
            ProgressBar::hidden()
        };
        if total > 0 {
            stage.bar.set_length(total);
        }
        name.clone_into(&mut stage.name);
        stage.begun = Instant::now();
    }

    fn advance(&self, steps: u64) {
        locked(&self.stage).bar.inc(steps);
    }

    fn forecast(&self, forecast: &Forecast) {
        if forecast.asked.1 <= Forecast::LONG {
            return;
        }
        let warning = long_work(forecast);
        if !self.quiet {
            let stage = locked(&self.stage);
            stage.bar.suspend(|| super::warn(&warning));
        }
        self.warnings
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(warning);
    }

    fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    fn is_cancelled(&self) -> bool {
        self.interrupt.came()
    }

    fn checkpoint(&self) -> Option<&Checkpoint> {
        self.checkpoint.as_ref()
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.finish();
    }
}
