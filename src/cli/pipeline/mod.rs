//! The stages that several commands share, each one call into the library, timed and told to the progress bar.

mod factors;
mod prepared;
mod repair;
mod solution;

use std::cell::RefCell;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use serde_json::{Value, json};

pub(super) use factors::{Computed, Fineness, Promised, spent_budget};
pub(super) use prepared::{Prepared, expect_room, posed};
pub(super) use repair::{BALANCE_TOLERANCE, repair};
pub(super) use solution::{Known, go_on};

use super::args::CommonArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::interrupt::Interrupt;
use super::progress::Bars;
use super::storage::Storage;
use super::{Outcome, SCHEMA_VERSION, merge, warn};
use crate::audit::Audit;
use crate::printable::printable_message;
use crate::report::{StageTimes, memory_peak_byte};
use crate::visibility::leaks::LightLeaks;

/// A run of one command: settings, clock, progress.
pub(super) struct Run {
    pub(super) command: &'static str,
    pub(super) common: CommonArgs,
    pub(super) times: StageTimes,
    pub(super) progress: Bars,
    pub(super) settings: serde_json::Map<String, Value>,
    pub(super) storage: Storage,
    /// What the laws of light say to the results so far.
    pub(super) audit: Audit,
    /// All warnings so far, for the document; with `--quiet` that is where they are.
    warnings: RefCell<Vec<String>>,
    /// The scene's file and its surfaces, for what is refused when the scene itself is out of reach.
    scene_file: PathBuf,
    surface_names: Vec<String>,
    /// The file of the lighting that each channel belongs to; none where the materials are the scene's own.
    pub(super) lighting_files: Vec<Option<PathBuf>>,
    /// The light leaks of the patches at hand, where contact edges cross some.
    pub(super) leaks: Option<LightLeaks>,
    /// What the document says of them: null where no patch is crossed.
    pub(super) light_leak: Value,
    /// Whether more leaks than results may have.
    pub(super) leaks_too_much: bool,
    /// True if lightings follow once the scene is read, in which it may emit light although it does not by itself.
    pub(super) has_lightings: bool,
    /// What is to be said if it does not.
    dark: Option<String>,
    pub(super) interrupt: Interrupt,
    has_looked_at_gaps: bool,
    begun: Instant,
}

impl Run {
    pub(super) fn new(command: &'static str, common: &CommonArgs) -> Self {
        // What these do is many short runs, and none of them asks whether to go on.
        let interrupt = Interrupt::listen(!matches!(command, "compare" | "reproduce"));
        Self {
            command,
            common: common.clone(),
            times: StageTimes::default(),
            progress: Bars::new(common.quiet, interrupt.clone()),
            interrupt,
            settings: serde_json::Map::new(),
            storage: Storage::default(),
            audit: Audit::default(),
            warnings: RefCell::default(),
            scene_file: PathBuf::new(),
            surface_names: Vec::new(),
            lighting_files: Vec::new(),
            leaks: None,
            light_leak: Value::Null,
            leaks_too_much: false,
            has_lightings: false,
            dark: None,
            has_looked_at_gaps: false,
            begun: Instant::now(),
        }
    }

    pub(super) fn warn(&self, message: &str) {
        self.warnings.borrow_mut().push(printable_message(message));
        if !self.common.quiet {
            self.progress.finish();
            warn(message);
        }
    }

    /// Takes in warnings that have been written already.
    fn note_warnings(&self, warnings: Vec<String>) {
        self.warnings.borrow_mut().extend(warnings);
    }

    /// Warns unless the same has been said.
    pub(super) fn warn_once(&self, message: &str) {
        let is_said = self.warnings.borrow().contains(&printable_message(message));
        if !is_said {
            self.warn(message);
        }
    }

    /// Goes on, unless a signal came: to be asked wherever work may have been left incomplete.
    pub(super) fn go_on(&self) -> Result<(), Failure> {
        if self.interrupt.came() {
            Err(Failure::interrupted())
        } else {
            Ok(())
        }
    }

    /// Ends the run: work that is done needs its checkpoint no more, and a failure by a signal says which signal it was and what the same
    /// command finds when it is given again.
    pub(super) fn ended(&mut self, result: Result<Outcome, Failure>) -> Result<Outcome, Failure> {
        let failure = match result {
            Ok(outcome) => {
                if outcome.code == ExitCode::Done {
                    self.forget_checkpoint();
                }
                return Ok(outcome);
            }
            Err(failure) if failure.code != ExitCode::Interrupted => return Err(failure),
            Err(failure) => failure,
        };
        self.progress.finish();
        let kept = match &self.progress.checkpoint {
            Some(checkpoint) => format!(
                "{} pieces of the work are in {}, and the same command goes on from there",
                checkpoint.n_pieces(),
                checkpoint.path().display()
            ),
            None => failure.message,
        };
        Err(self.interrupt.failure(&kept))
    }

    fn forget_checkpoint(&mut self) {
        if let Some(checkpoint) = self.progress.checkpoint.take()
            && let Err(error) = checkpoint.remove()
        {
            self.warn(&error.to_string());
        }
    }

    pub(super) fn set(&mut self, name: &str, value: impl Into<Value>) {
        self.settings.insert(name.to_owned(), value.into());
    }

    /// Takes in what an audit found, with a warning for each law that is broken.
    pub(super) fn audited(&mut self, found: Audit) {
        for check in found.violations() {
            self.warn(&format!("audit: {check}"));
        }
        self.audit.extend(found);
    }

    /// Returns the exit code of a run that is to end with `code`: a broken law counts if the run is strict, and light that leaks.
    pub(super) fn judged(&self, code: ExitCode, strict: bool) -> ExitCode {
        match code {
            _ if strict && !self.audit.passed() => ExitCode::CheckFailed,
            ExitCode::Done if self.leaks_too_much => ExitCode::NotConverged,
            code => code,
        }
    }

    /// Adds the line that says how the audit went.
    pub(super) fn describe_audit(&self, text: &mut String) {
        let n_broken = self.audit.violations().count();
        let n = self.audit.checks.len();
        let _ = match n_broken {
            _ if n == 0 => Ok(()),
            0 if n == 1 => writeln!(text, "audit: 1 law of light holds"),
            0 => writeln!(text, "audit: {n} laws of light hold"),
            _ => writeln!(
                text,
                "audit: {n_broken} of {n} laws of light are BROKEN; the warnings say which"
            ),
        };
    }

    /// Returns the text of `--explain`, or nothing.
    pub(super) fn explanation(&self, prepared: &Prepared) -> String {
        let mut text = String::new();
        if self.common.explain {
            for decision in &prepared.plan.decisions {
                let _ = writeln!(text, "{}: {} ({})", decision.subject, decision.choice, decision.reason);
            }
            for item in &prepared.plan.left_out {
                let _ = writeln!(text, "left out: {item}");
            }
            for check in &self.audit.checks {
                let _ = writeln!(text, "audit: {check}");
            }
            for skipped in &self.audit.not_checked {
                let _ = writeln!(
                    text,
                    "audit: {}: not checked ({})",
                    skipped.law.statement(),
                    skipped.reason
                );
            }
            let _ = writeln!(text);
        }
        text
    }

    /// Adds the line that says where the time went.
    pub(super) fn describe_times(&self, text: &mut String) {
        let total = self.times.total_s();
        let _ = write!(text, "{total:.2} s:");
        for (k, (name, seconds)) in self.times.iter().filter(|(_, s)| *s >= 0.005 * total).enumerate() {
            let comma = if k == 0 { "" } else { "," };
            let _ = write!(text, "{comma} {} {seconds:.2} s", name.replace('_', " "));
        }
        let _ = writeln!(text);
    }

    /// Returns the parts that the document of every command has, with `result` merged in.
    pub(super) fn document(&self, result: Value) -> Value {
        let mut document = json!({
            "schema_version": SCHEMA_VERSION,
            "command": self.command,
            "version": env!("CARGO_PKG_VERSION"),
            "settings": self.settings,
            "stages": self.times.to_json(),
            "total_s": self.times.total_s(),
            "memory_peak_byte": memory_peak_byte(),
            "warnings": *self.warnings.borrow(),
        });
        merge(&mut document, result);
        document
    }

    /// Returns the document of a command that prepared a scene: with what was left out, and what was chosen.
    pub(super) fn document_of(&self, prepared: &Prepared, result: Value) -> Value {
        let mut document = self.document(result);
        document["left_out"] = json!(prepared.plan.left_out);
        document["n_cut_faces"] = json!(prepared.mesh.n_cut_faces());
        document["light_leak"] = self.light_leak.clone();
        document["audit"] = json!({
            "passed": self.audit.passed(),
            "checks": self.audit.checks,
            "not_checked": self.audit.not_checked,
        });
        if self.common.explain {
            document["decisions"] = json!(prepared.plan.decisions);
        }
        document
    }
}
