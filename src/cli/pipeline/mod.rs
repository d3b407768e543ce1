//! The stages that several commands share, each one call into the library, timed and told to the progress bar.

mod factors;
mod prepared;
mod solution;

use std::fmt::Write as _;

use serde_json::{Value, json};

pub(super) use factors::{Computed, Fineness, repairs};
pub(super) use prepared::Prepared;

use super::args::CommonArgs;
use super::progress::Bars;
use super::storage::Storage;
use super::{SCHEMA_VERSION, merge, warn};
use crate::report::{StageTimes, memory_peak_byte};

/// A run of one command: settings, clock, progress.
pub(super) struct Run {
    pub(super) command: &'static str,
    pub(super) common: CommonArgs,
    pub(super) times: StageTimes,
    pub(super) progress: Bars,
    pub(super) settings: serde_json::Map<String, Value>,
    pub(super) storage: Storage,
    has_looked_at_gaps: bool,
}

impl Run {
    pub(super) fn new(command: &'static str, common: &CommonArgs) -> Self {
        Self {
            command,
            common: common.clone(),
            times: StageTimes::default(),
            progress: Bars::new(common.quiet),
            settings: serde_json::Map::new(),
            storage: Storage::default(),
            has_looked_at_gaps: false,
        }
    }

    pub(super) fn warn(&self, message: &str) {
        if !self.common.quiet {
            self.progress.finish();
            warn(message);
        }
    }

    pub(super) fn set(&mut self, name: &str, value: impl Into<Value>) {
        self.settings.insert(name.to_owned(), value.into());
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
        });
        merge(&mut document, result);
        document
    }

    /// Returns the document of a command that prepared a scene: with what was left out, and what was chosen.
    pub(super) fn document_of(&self, prepared: &Prepared, result: Value) -> Value {
        let mut document = self.document(result);
        document["left_out"] = json!(prepared.plan.left_out);
        if self.common.explain {
            document["decisions"] = json!(prepared.plan.decisions);
        }
        document
    }
}
