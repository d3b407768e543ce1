//! Progress on stderr: a bar on a terminal, and periodic lines elsewhere.

use std::io::IsTerminal;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

use super::failure::flag;
use super::interrupt::Interrupt;
use crate::progress::{Forecast, Progress};
use crate::workflow::Warning;

/// The interval of the display's updates on a terminal, whether work is done or not.
const TICK: Duration = Duration::from_millis(250);

/// The interval of lines elsewhere.
const LINE: Duration = Duration::from_secs(30);

/// The current stage on stderr, with the time left.
pub(super) struct Bars {
    stage: Arc<Mutex<Stage>>,
    is_terminal: bool,
    interrupt: Interrupt,
    quiet: bool,
    /// Ends the thread that writes lines when it is dropped.
    _lines: Option<Sender<()>>,
}

/// The current stage.
struct Stage {
    name: String,
    bar: ProgressBar,
    begun: Instant,
}

impl Bars {
    /// Shows bars if stderr is a terminal, and lines if it is not, unless `quiet` is set.
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
            quiet,
            _lines: lines,
        }
    }

    /// Writes to stderr while the bar is hidden.
    pub(super) fn aside(&self, write: impl FnOnce()) {
        locked(&self.stage).bar.suspend(write);
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

/// Returns the display of a stage of unknown length.
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

/// Writes a line about the current stage every [`LINE`], until the other end of the channel is dropped.
fn write_lines(stage: &Mutex<Stage>, ended: &Receiver<()>) {
    let mut last: Option<(Instant, Instant, f64)> = None;
    while ended.recv_timeout(LINE) == Err(RecvTimeoutError::Timeout) {
        let stage = locked(stage);
        let (done, total) = (stage.bar.position(), stage.bar.length().unwrap_or(0));
        let share = if total == 0 { 0.0 } else { done as f64 / total as f64 };
        let (at, before) = match last {
            Some((begun, at, before)) if begun == stage.begun => (at, before),
            _ => (stage.begun, 0.0),
        };
        let text = line(
            &stage.name,
            stage.begun.elapsed(),
            share,
            (at.elapsed(), share - before),
        );
        last = Some((stage.begun, Instant::now(), share));
        drop(stage);
        super::complain(&text);
    }
}

/// Returns a line about a stage; the time left follows from the share done in the last time, as early work may be easier than late.
fn line(name: &str, elapsed: Duration, share: f64, recent: (Duration, f64)) -> String {
    if share <= 0.0 {
        return format!("{name}: {} so far", HumanDuration(elapsed));
    }
    let left = Duration::try_from_secs_f64(recent.0.as_secs_f64() * (1.0 - share).max(0.0) / recent.1);
    let left = left.map_or_else(
        |_| String::new(),
        |left| format!(", about {} left", HumanDuration(left)),
    );
    format!("{name}: {:.1} % in {}{left}", 100.0 * share, HumanDuration(elapsed))
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
            // A hidden bar counts, but draws nothing.
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
        if forecast.asked.1 > Forecast::LONG && !self.quiet {
            let warning = Warning::LongWork(forecast.clone()).text(&flag);
            self.aside(|| super::warn(&warning));
        }
    }

    fn opened(&self, checkpoint: &Path) {
        self.interrupt.note_checkpoint(checkpoint);
    }

    fn is_cancelled(&self) -> bool {
        self.interrupt.came()
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.finish();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_from_the_last_line() {
        let seconds = Duration::from_secs;
        let text = |elapsed, share, recent| line("form factors", seconds(elapsed), share, recent);
        assert_eq!(text(30, 0.0, (seconds(30), 0.0)), "form factors: 30 seconds so far");
        assert_eq!(
            text(30, 0.2, (seconds(30), 0.2)),
            "form factors: 20.0 % in 30 seconds, about 2 minutes left"
        );
        // Slower than before, and stuck.
        assert_eq!(
            text(60, 0.21, (seconds(30), 0.01)),
            "form factors: 21.0 % in 60 seconds, about 40 minutes left"
        );
        assert_eq!(text(90, 0.21, (seconds(30), 0.0)), "form factors: 21.0 % in 2 minutes");
    }
}
