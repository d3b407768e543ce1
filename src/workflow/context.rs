//! The context of a study: observers of its progress, its limits, and its warnings.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::leaks::Leaks;
use super::settings::Settings;
use super::warning::Warning;
use super::{Memory, Parameter, WorkflowError};
use crate::audit::Audit;
use crate::checkpoint::Checkpoint;
use crate::parameter::plainly;
use crate::progress::{Forecast, Progress, Silent};
use crate::ranks::{Alone, Ranks};
use crate::report::StageTimes;

/// A function that receives each warning at once.
type Listener = Box<dyn Fn(&Warning)>;

/// Progress, limits, warnings, times and settings, shared by the steps of a study.
///
/// [`Context::default`] is silent, uses up to 80 % of the available memory and keeps no checkpoint.
pub struct Context {
    progress: Arc<dyn Progress + Send>,
    listener: Option<Listener>,
    warnings: RefCell<Vec<Warning>>,
    times: RefCell<StageTimes>,
    /// Formats parameters in texts; by default, by their names.
    pub naming: fn(Parameter, Option<&str>) -> String,
    /// The memory limit, and the storage of form factors.
    pub memory: Memory,
    /// The demands of later steps on the storage of form factors.
    pub demand: Demand,
    /// The settings of the results, for files of results.
    pub settings: Settings,
    /// The conservation checks of the results so far.
    pub audit: Audit,
    /// The file of the lighting of each channel; empty where the materials are the scene's own.
    pub lighting_files: Vec<Option<PathBuf>>,
    /// The light that leaks through patches which are not cut at contact edges.
    pub leaks: Leaks,
    /// The ranks that share the work; each has a context and takes the same steps.
    pub ranks: Arc<dyn Ranks>,
    /// A file for finished work, from which the same study continues after an interruption.
    pub checkpoint_file: Option<PathBuf>,
    pub(super) checkpoint: Option<Checkpoint>,
    pub(super) deadline: Option<Instant>,
    pub(super) has_looked_at_gaps: Cell<bool>,
    /// True if only the first warning of each kind is stored, so that repeated work warns once.
    pub(super) warns_once_of_a_kind: bool,
    begun: Instant,
}

/// The steps after form factors, as far as storage depends on them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Demand {
    /// The output, in whose directory a scratch file is placed.
    pub output: Option<PathBuf>,
    /// The part of the checkpoint for form factors: 0 except for later poses.
    pub part: u32,
    /// The tolerance of the solver, if there is one.
    pub tolerance: Option<f64>,
    /// The name of the solver, if there is one.
    pub solver: Option<String>,
    /// The greatest reflectance of all lightings besides the scene's own.
    pub reflectance_max: f64,
    /// Memory for an image, in bytes.
    pub image_byte: u64,
    /// True if the results of single surfaces at the times of a path of the sun are dropped block by block, as they are not used.
    pub drops_surfaces: bool,
}

impl Default for Context {
    fn default() -> Self {
        Self::new(Arc::new(Silent))
    }
}

impl Context {
    /// Returns a context whose steps report to `progress`.
    #[must_use]
    pub fn new(progress: Arc<dyn Progress + Send>) -> Self {
        Self {
            progress,
            listener: None,
            warnings: RefCell::default(),
            times: RefCell::default(),
            naming: plainly,
            memory: Memory::default(),
            demand: Demand::default(),
            settings: Settings::default(),
            audit: Audit::default(),
            lighting_files: Vec::new(),
            leaks: Leaks::default(),
            ranks: Arc::new(Alone),
            checkpoint_file: None,
            checkpoint: None,
            deadline: None,
            has_looked_at_gaps: Cell::new(false),
            warns_once_of_a_kind: false,
            begun: Instant::now(),
        }
    }

    /// Returns a context for auxiliary work: with the same progress and memory, and with warnings and times of its own.
    pub(super) fn aside(&self) -> Self {
        let mut own = Self::new(Arc::clone(&self.progress));
        own.memory = self.memory.clone();
        own
    }

    /// Sets a function that receives each warning at once; it is stored as well.
    #[must_use]
    pub fn on_warning(mut self, listener: impl Fn(&Warning) + 'static) -> Self {
        self.listener = Some(Box::new(listener));
        self
    }

    /// Returns all warnings so far.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        self.warnings.borrow().clone()
    }

    /// Stores a warning and reports it.
    pub fn warn(&self, warning: Warning) {
        let is_of_its_kind = |other: &Warning| std::mem::discriminant(other) == std::mem::discriminant(&warning);
        if self.warns_once_of_a_kind && self.warnings.borrow().iter().any(is_of_its_kind) {
            return;
        }
        if let Some(listener) = &self.listener {
            listener(&warning);
        }
        self.note(warning);
    }

    /// Stores a warning that has already been reported.
    pub(super) fn note(&self, warning: Warning) {
        self.warnings.borrow_mut().push(warning);
    }

    /// Warns of a checkpoint that could not be written completely.
    pub(super) fn warn_of_checkpoint(&self) {
        if let Some(checkpoint) = &self.checkpoint
            && let Some(reason) = checkpoint.failure()
        {
            self.warn(Warning::CheckpointIncomplete {
                file: checkpoint.path().to_owned(),
                reason,
            });
        }
    }

    /// Stores and reports a warning, unless an equal one is stored.
    pub fn warn_once(&self, warning: Warning) {
        let is_said = self.warnings.borrow().contains(&warning);
        if !is_said {
            self.warn(warning);
        }
    }

    /// Returns the wall times of the stages so far.
    #[must_use]
    pub fn times(&self) -> StageTimes {
        self.times.borrow().clone()
    }

    /// Runs a stage and adds its duration to the times.
    pub fn time<T>(&self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let result = work();
        self.times.borrow_mut().add(stage, begun.elapsed());
        result
    }

    /// Returns the time since the context was made.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.begun.elapsed()
    }

    /// Sets the deadline, counted from the creation of the context; none if it is beyond the range of the clock.
    pub(super) fn end_within(&mut self, limit: Duration) {
        self.deadline = self.begun.checked_add(limit);
    }

    /// Adds the results of an audit, with a warning for each check that fails.
    pub fn audited(&mut self, found: Audit) {
        for check in found.violations() {
            self.warn(Warning::BrokenLaw(check.clone()));
        }
        self.audit.extend(found);
    }

    /// Returns the progress with checkpoint and deadline.
    #[must_use]
    pub fn progress(&self) -> Watch<'_> {
        Watch {
            progress: &*self.progress,
            ranks: &*self.ranks,
            checkpoint: self.checkpoint.as_ref(),
            deadline: self.deadline,
            forecast: Mutex::default(),
        }
    }

    /// Returns an error if work is to end; to be called after each step that may be incomplete.
    ///
    /// # Errors
    /// [`WorkflowError::Interrupted`].
    pub fn go_on(&self) -> Result<(), WorkflowError> {
        if self.progress.is_cancelled() {
            Err(WorkflowError::Interrupted)
        } else {
            Ok(())
        }
    }

    /// Returns the checkpoint, once it is open.
    #[must_use]
    pub fn checkpoint(&self) -> Option<&Checkpoint> {
        self.checkpoint.as_ref()
    }

    /// Closes the checkpoint of finished work, and removes its file; warns if that fails.
    pub fn forget_checkpoint(&mut self) {
        let Some(checkpoint) = self.checkpoint.take() else {
            return;
        };
        let file = checkpoint.path().to_owned();
        if let Err(error) = checkpoint.remove(self.ranks.is_first()) {
            let reason = error.reason();
            self.warn(Warning::CheckpointLeft { file, reason });
        }
    }

    /// Opens the checkpoint with the key of the computation, unless it is open.
    pub(super) fn open_checkpoint(&mut self, path: &Path, key: &[u8; 32]) -> Result<(), WorkflowError> {
        self.checkpoint = Some(Checkpoint::open_of_rank(path, key, &*self.ranks)?);
        self.progress.opened(path);
        Ok(())
    }
}

/// The progress of a [`Context`], with its checkpoint and deadline.
pub struct Watch<'a> {
    progress: &'a dyn Progress,
    ranks: &'a dyn Ranks,
    checkpoint: Option<&'a Checkpoint>,
    deadline: Option<Instant>,
    forecast: Mutex<Option<Forecast>>,
}

impl Watch<'_> {
    /// Returns the expected run time of the last stage, if known.
    pub(super) fn heard(self) -> Option<Forecast> {
        self.forecast.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Watch<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.progress.begin(stage, total);
    }

    fn advance(&self, steps: u64) {
        self.progress.advance(steps);
    }

    fn forecast(&self, forecast: &Forecast) {
        self.progress.forecast(forecast);
        *self.forecast.lock().unwrap_or_else(PoisonError::into_inner) = Some(forecast.clone());
    }

    fn deadline(&self) -> Option<Instant> {
        self.deadline.or_else(|| self.progress.deadline())
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled()
    }

    fn checkpoint(&self) -> Option<&Checkpoint> {
        self.checkpoint
    }

    fn ranks(&self) -> &dyn Ranks {
        self.ranks
    }
}
