//! A run of one command: its flags, its context, and its report.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use super::args::{CommonArgs, MeshArgs, MethodArgs, StorageArgs};
use super::checks::{describe_checks, describe_work};
use super::exit_code::ExitCode;
use super::failure::{Failure, flag};
use super::interrupt::Interrupt;
use super::json::{JsonDocument, in_order};
use super::progress::Bars;
use super::{Outcome, ranks, warn};
use crate::document::{Document, OfScene};
use crate::mesh::{MeshOptions, Subdivision};
use crate::plan::byte_text;
use crate::printable::printable_message;
use crate::render::MAX_PICTURE_EXITANCE;
use crate::scene::{Lighting, Scene, SceneWarningKind, builtin};
use crate::workflow::{self, Afterwards, Context, Demand, FormFactorRequest, FormFactorStudy, Model, Use, Warning};

/// A run of one command.
pub(super) struct Run {
    pub(super) command: &'static str,
    pub(super) common: CommonArgs,
    pub(super) cx: Context,
    pub(super) bars: Arc<Bars>,
    interrupt: Interrupt,
    /// True if lightings follow after the scene is read, in which a scene without emitters may emit light.
    pub(super) has_lightings: bool,
    /// The warning about a scene without emitters.
    dark: Option<Warning>,
}

impl Run {
    pub(super) fn new(command: &'static str, common: &CommonArgs) -> Self {
        // These commands make many short runs, which do not check for interruptions.
        let interrupt = Interrupt::listen(!matches!(command, "compare" | "reproduce"));
        let quiet = common.quiet || !ranks::is_first();
        let bars = Arc::new(Bars::new(quiet, interrupt.clone()));
        let mut cx = Context::new(Arc::clone(&bars) as _);
        cx.ranks = ranks::of_run();
        cx.naming = flag;
        if !quiet {
            let bars = Arc::clone(&bars);
            cx = cx.on_warning(move |warning| bars.aside(|| warn(&warning.text(&flag))));
        }
        Self {
            command,
            common: common.clone(),
            cx,
            bars,
            interrupt,
            has_lightings: false,
            dark: None,
        }
    }

    /// Sets memory and checkpoint from flags, and the demands of the steps after the form factors.
    pub(super) fn expect(&mut self, storage: &StorageArgs, demand: Demand) {
        self.cx.memory = storage.memory.memory();
        self.cx.memory.n_others = ranks::n_others();
        self.cx.checkpoint_file.clone_from(&storage.checkpoint);
        self.cx.demand = demand;
    }

    /// Returns the request for form factors; `tolerance` is that of another flag.
    pub(super) fn request(&self, method: &MethodArgs, tolerance: Option<f64>, then: Afterwards) -> FormFactorRequest {
        FormFactorRequest {
            explain: self.common.explain,
            ..method.request(tolerance, then)
        }
    }

    /// Adds a warning of the program itself.
    pub(super) fn warn(&self, message: &str) {
        self.cx.warn(Warning::Other(message.to_owned()));
    }

    /// Reads a scene within the memory limit, cuts it into patches and builds the ray tracer's tree; without arguments for patches, these are not used.
    pub(super) fn prepare(
        &mut self,
        path: &Path,
        mesh_args: impl Into<Option<MeshArgs>>,
        default: impl FnOnce(&Scene) -> Subdivision,
    ) -> Result<Model, Failure> {
        let name = path.to_string_lossy();
        if !path.exists() && builtin::names().any(|known| known == name) {
            let message = format!(
                "{name}: no such file; `radiosity scene {name} -o {name}.obj` writes the built-in scene of that name"
            );
            return Err(Failure::new("unreadable", message).in_file(path));
        }
        let mut options = self.common.reading.options();
        if self.command == "render" {
            options = options.max_exitance(MAX_PICTURE_EXITANCE);
        }
        self.common.reading.describe(&mut self.cx);
        let wants_light = !matches!(self.command, "form-factors" | "field" | "compare" | "heat" | "points");
        let dark = RefCell::new(None);
        let scene = workflow::load(path, &options, &self.cx, |warning| {
            let is_later = self.has_lightings && warning.kind == SceneWarningKind::NoEmission;
            if is_later {
                *dark.borrow_mut() = Some(Warning::Scene(warning.clone()));
            }
            wants_light && !is_later
        })?;
        self.dark = dark.into_inner();
        self.prepare_scene(path, scene, mesh_args, default)
    }

    /// Cuts a scene into patches and builds the ray tracer's tree; messages call it `path`.
    pub(super) fn prepare_scene(
        &mut self,
        path: &Path,
        scene: Scene,
        mesh_args: impl Into<Option<MeshArgs>>,
        default: impl FnOnce(&Scene) -> Subdivision,
    ) -> Result<Model, Failure> {
        let mesh_args = mesh_args.into();
        let default = default(&scene);
        let options: MeshOptions = mesh_args.map_or_else(|| default.into(), |args| args.options(default));
        match mesh_args {
            Some(_) => self.cx.settings.note_mesh(options),
            None => self.cx.settings.note_subdivision(options.subdivision),
        }
        let patches_for = match mesh_args {
            None => Use::Nothing,
            Some(_) if self.command == "field" => Use::Points,
            Some(_) => Use::Light,
        };
        let model = Model::new(scene, path, options, patches_for, &mut self.cx)?;
        self.cx.expect_same("scene", model.scene.content_hash().as_bytes())?;
        Ok(model)
    }

    /// Warns of lightings in which no face emits light, each with its file; `None` stands for the scene's own.
    pub(super) fn warn_of_darkness(&mut self, model: &Model, lightings: &[(Option<&Path>, Option<&Lighting>)]) {
        for (file, lighting) in lightings {
            match (file, lighting) {
                (Some(file), Some(lighting)) => model.warn_of_darkness([(*file, *lighting)], &self.cx),
                (_, None) => {
                    if let Some(warning) = self.dark.take() {
                        self.cx.warn(warning);
                    }
                }
                _ => {}
            }
        }
    }

    /// Runs a command that checks for interruptions: removes the checkpoint of finished work, and completes a failure by a signal.
    ///
    /// Such a failure names the signal and the work that the same command finds when it is run again.
    pub(super) fn of(
        command: &'static str,
        common: &CommonArgs,
        work: impl FnOnce(&mut Self) -> Result<Outcome, Failure>,
    ) -> Result<Outcome, Failure> {
        let mut run = Self::new(command, common);
        let failure = match work(&mut run) {
            Ok(outcome) => {
                if outcome.code == ExitCode::Done {
                    run.cx.forget_checkpoint();
                }
                return Ok(outcome);
            }
            Err(failure) if failure.code != ExitCode::Interrupted => return Err(failure),
            Err(failure) => failure,
        };
        run.bars.finish();
        let kept = match run.cx.checkpoint() {
            Some(checkpoint) => format!(
                "{} finished parts are in {}; the same command continues from them",
                checkpoint.n_pieces(),
                checkpoint.path().display()
            ),
            None => failure.message,
        };
        Err(run.interrupt.failure(&kept))
    }

    /// Returns the exit code of a run with the code `code`, after failed checks in a strict run and light leaks.
    pub(super) fn judged(&self, code: ExitCode, strict: bool) -> ExitCode {
        match code {
            _ if strict && !self.cx.audit.passed() => ExitCode::CheckFailed,
            ExitCode::Done if self.cx.leaks.are_too_great => ExitCode::NotConverged,
            code => code,
        }
    }

    /// Returns the outcome of a run: adds lines about the audit, the times and the written files to the text, and judges the exit code.
    pub(super) fn outcome<'a>(
        &self,
        mut text: String,
        document: JsonDocument,
        written: impl IntoIterator<Item = &'a PathBuf>,
        (code, strict): (ExitCode, bool),
    ) -> Outcome {
        self.describe_audit(&mut text);
        self.describe_times(&mut text);
        for path in written {
            let _ = writeln!(text, "wrote {}", path.display());
        }
        Outcome {
            text,
            document,
            code: self.judged(code, strict),
        }
    }

    /// Adds the line about the audit.
    pub(super) fn describe_audit(&self, text: &mut String) {
        let n_broken = self.cx.audit.violations().count();
        let n = self.cx.audit.checks.len();
        let _ = match n_broken {
            _ if n == 0 => Ok(()),
            0 if n == 1 => writeln!(text, "conservation checks: 1 holds"),
            0 => writeln!(text, "conservation checks: {n} hold"),
            _ => writeln!(
                text,
                "conservation checks: {n_broken} of {n} FAIL; the warnings name them"
            ),
        };
    }

    /// Adds the line of the checks of form factors, and with `--explain` their cost and memory.
    pub(super) fn describe_form_factors(&self, text: &mut String, computed: &FormFactorStudy) {
        describe_checks(text, computed);
        if self.common.explain {
            describe_work(text, computed);
        }
    }

    /// Returns the text of `--explain`, or nothing.
    pub(super) fn explanation(&self, model: &Model) -> String {
        let mut text = String::new();
        if self.common.explain {
            for decision in &model.plan.decisions {
                let _ = writeln!(text, "{}: {} ({})", decision.subject, decision.choice, decision.reason);
            }
            if self.cx.ranks.size() > 1 {
                let sent = self.cx.ranks.traffic();
                let _ = writeln!(
                    text,
                    "rank 0 sent: {} messages of {} to single ranks, {} collective ones of {}",
                    sent.n_messages,
                    byte_text(sent.message_byte),
                    sent.n_collective,
                    byte_text(sent.collective_byte)
                );
            }
            for item in &model.plan.left_out {
                let _ = writeln!(text, "left out: {item}");
            }
            for check in &self.cx.audit.checks {
                let _ = writeln!(text, "conservation check: {check}");
            }
            for skipped in &self.cx.audit.not_checked {
                let _ = writeln!(
                    text,
                    "conservation check: {}: not done ({})",
                    skipped.law.statement(),
                    skipped.reason
                );
            }
            let _ = writeln!(text);
        }
        text
    }

    /// Adds the line about the times.
    pub(super) fn describe_times(&self, text: &mut String) {
        let times = self.cx.times();
        let total = times.total_s();
        let _ = write!(text, "{total:.2} s");
        for (k, (name, seconds)) in times
            .iter()
            .filter(|(_, s)| *s >= (0.005 * total).max(0.005))
            .enumerate()
        {
            let comma = if k == 0 { ":" } else { "," };
            let _ = write!(text, "{comma} {} {seconds:.2} s", name.replace('_', " "));
        }
        let _ = writeln!(text);
    }

    /// Returns the document of a command, with the peak of the memory so far.
    pub(super) fn typed_document<T>(&self, result: T) -> Document<'_, T> {
        let warnings = self.cx.warnings();
        let warnings = warnings.iter().map(|warning| printable_message(&warning.text(&flag)));
        Document::new(self.command, &self.cx, warnings.collect(), result)
    }

    /// Returns the document of a command; null without `--json`, as documents of many times take gigabytes.
    pub(super) fn document(&self, result: impl Serialize) -> JsonDocument {
        if self.common.json {
            in_order(&self.typed_document(result)).into()
        } else {
            JsonDocument::default()
        }
    }

    /// Returns the document of a command that prepared a scene, with the omitted steps and the choices.
    pub(super) fn document_of(&self, model: &Model, result: impl Serialize) -> JsonDocument {
        self.document(OfScene::new(model, &self.cx, self.common.explain, result))
    }
}
