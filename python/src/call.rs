//! Runs work off the calling thread, with the interpreter's lock released, while that thread handles signals and reports progress.

use std::ffi::CString;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use radiosity::progress::Progress;
use radiosity::workflow::{Context, Demand, Memory, Settings, Warning, WorkflowError};

use crate::error::{bad_argument, class, raised};

/// The interval at which signals are checked and progress is reported.
const BEAT: Duration = Duration::from_millis(50);

/// The bytes of the stack of a worker: that of a program's main thread on Linux.
const STACK: usize = 8 << 20;

/// The thread pool of calls; `None` for all cores.
static POOL: Mutex<Option<Arc<rayon::ThreadPool>>> = Mutex::new(None);

/// Sets the number of threads of all later calls, or with `None` all cores.
#[pyfunction]
#[pyo3(signature = (n))]
pub(crate) fn set_threads(py: Python<'_>, n: Option<usize>) -> PyResult<()> {
    let pool = n
        .map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build())
        .transpose();
    let pool = pool.map_err(|error| bad_argument(py, &format!("n: cannot start that many threads: {error}")))?;
    *POOL.lock().unwrap_or_else(PoisonError::into_inner) = pool.map(Arc::new);
    Ok(())
}

/// The progress of a call, written by its worker and read by the calling thread.
#[derive(Debug, Default)]
struct Shared {
    stage: Mutex<String>,
    total: AtomicU64,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl Progress for Shared {
    fn begin(&self, stage: &str, total: u64) {
        let mut known = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        stage.clone_into(&mut known);
        self.total.store(total, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}

impl Shared {
    fn state(&self) -> (String, u64, u64) {
        let stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner).clone();
        (
            stage,
            self.done.load(Ordering::Relaxed),
            self.total.load(Ordering::Relaxed),
        )
    }
}

/// The context of a call.
#[derive(Debug, Default)]
pub(crate) struct Call {
    /// The callback `progress(stage, done, total)`.
    pub(crate) progress: Option<Py<PyAny>>,
    /// The memory limit, and the storage of form factors.
    pub(crate) memory: Memory,
    /// A file for finished work.
    pub(crate) checkpoint: Option<std::path::PathBuf>,
    /// The demands of the steps after form factors.
    pub(crate) demand: Demand,
    /// The settings of the objects on which the work is based.
    pub(crate) settings: Settings,
}

/// A result, with its warnings and settings.
#[derive(Debug)]
pub(crate) struct Done<T> {
    pub(crate) value: T,
    pub(crate) warnings: Vec<String>,
    pub(crate) settings: Settings,
}

/// The result of a worker.
struct Ended<T> {
    result: Result<T, WorkflowError>,
    warnings: Vec<Warning>,
    settings: Settings,
}

impl Call {
    /// Runs work, and passes its warnings to Python's `warnings`.
    ///
    /// # Errors
    /// The exceptions of the package, KeyboardInterrupt, exceptions of the progress callback, and warnings that are configured as errors.
    pub(crate) fn run<T: Send>(
        self,
        py: Python<'_>,
        work: impl FnOnce(&mut Context) -> Result<T, WorkflowError> + Send,
    ) -> PyResult<Done<T>> {
        let (shared, progress, body) = self.prepared(work);
        let (ended, interrupted) = py.detach(|| watched(body, &shared, progress.as_ref()))?;
        let Some(error) = interrupted else {
            return ended.done(py);
        };
        // A single error is raised.
        let _ = ended.warn(py);
        Err(error)
    }

    /// Runs work as [`run`](Self::run) does, without waiting for interrupted work: it ends by itself at its next check, and its result is dropped.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub(crate) fn run_apart<T: Send + 'static>(
        self,
        py: Python<'_>,
        work: impl FnOnce(&mut Context) -> Result<T, WorkflowError> + Send + 'static,
    ) -> PyResult<Done<T>> {
        let (shared, progress, body) = self.prepared(work);
        let ended = py.detach(|| watched_apart(body, &shared, progress.as_ref()))?;
        ended.done(py)
    }

    /// Returns the body of a worker, and its state shared with the calling thread.
    fn prepared<T: Send, W: FnOnce(&mut Context) -> Result<T, WorkflowError> + Send>(
        self,
        work: W,
    ) -> (
        Arc<Shared>,
        Option<Py<PyAny>>,
        impl FnOnce() -> Ended<T> + Send + use<T, W>,
    ) {
        let Self {
            progress,
            memory,
            checkpoint,
            demand,
            settings,
        } = self;
        let shared = Arc::new(Shared::default());
        let of_worker = Arc::clone(&shared);
        let pool = POOL.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let study = move || {
            let mut cx = Context::new(of_worker);
            cx.memory = memory;
            cx.checkpoint_file = checkpoint;
            cx.demand = demand;
            cx.settings = settings;
            let result = work(&mut cx);
            if result.is_ok() {
                cx.forget_checkpoint();
            }
            Ended {
                result,
                warnings: cx.warnings(),
                settings: cx.settings,
            }
        };
        let body = move || match pool {
            Some(pool) => pool.install(study),
            None => study(),
        };
        (shared, progress, body)
    }
}

impl<T> Ended<T> {
    /// Passes the warnings to Python's `warnings`.
    fn warn(&self, py: Python<'_>) -> PyResult<()> {
        self.warnings.iter().try_for_each(|text| warn(py, &text.to_string()))
    }

    /// Returns the result, or raises its error.
    fn done(self, py: Python<'_>) -> PyResult<Done<T>> {
        let told = self.warn(py);
        let value = self.result.map_err(|error| raised(py, &error))?;
        told?;
        Ok(Done {
            value,
            warnings: self.warnings.iter().map(ToString::to_string).collect(),
            settings: self.settings,
        })
    }
}

fn named() -> std::thread::Builder {
    std::thread::Builder::new().name("radiosity".into()).stack_size(STACK)
}

/// Runs a body on a thread of its own, while this one checks for signals; returns its result, and the error of the checks if there was one.
fn watched<T: Send>(
    body: impl FnOnce() -> T + Send,
    shared: &Shared,
    progress: Option<&Py<PyAny>>,
) -> PyResult<(T, Option<PyErr>)> {
    std::thread::scope(|scope| {
        let (ends, is_ended) = channel::<()>();
        let worker = named().spawn_scoped(scope, move || {
            // This is dropped when the body ends, even by a panic.
            let _ends = ends;
            body()
        })?;
        let mut interrupted = None;
        let mut told = None;
        while is_ended.recv_timeout(BEAT) == Err(RecvTimeoutError::Timeout) {
            if interrupted.is_none() {
                interrupted = listened(shared, progress, &mut told).err();
            }
        }
        match worker.join() {
            Ok(ended) => Ok((ended, interrupted)),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// Runs a body as [`watched`] does, but abandons its thread after an interruption.
fn watched_apart<T: Send + 'static>(
    body: impl FnOnce() -> T + Send + 'static,
    shared: &Shared,
    progress: Option<&Py<PyAny>>,
) -> PyResult<T> {
    let (sends, receives) = channel();
    let worker = named().spawn(move || {
        // After an interruption there is no receiver.
        let _ = sends.send(body());
    })?;
    let mut told = None;
    loop {
        match receives.recv_timeout(BEAT) {
            Ok(ended) => return Ok(ended),
            Err(RecvTimeoutError::Timeout) => listened(shared, progress, &mut told)?,
            Err(RecvTimeoutError::Disconnected) => match worker.join() {
                Err(panic) => std::panic::resume_unwind(panic),
                Ok(()) => unreachable!("a thread that ends has sent its result"),
            },
        }
    }
}

/// Checks for signals and reports the progress; cancels the work if either raises an error.
fn listened(shared: &Shared, progress: Option<&Py<PyAny>>, told: &mut Option<(String, u64, u64)>) -> PyResult<()> {
    let heard = Python::attach(|py| heard(py, shared, progress, told));
    if heard.is_err() {
        shared.is_cancelled.store(true, Ordering::Relaxed);
    }
    heard
}

/// Checks for signals, and reports the progress if it has changed.
fn heard(
    py: Python<'_>,
    shared: &Shared,
    progress: Option<&Py<PyAny>>,
    told: &mut Option<(String, u64, u64)>,
) -> PyResult<()> {
    py.check_signals()?;
    let state = shared.state();
    if let Some(callback) = progress
        && told.as_ref() != Some(&state)
    {
        callback.call1(py, (&*state.0, state.1, state.2))?;
        *told = Some(state);
    }
    Ok(())
}

/// Warns at the line of the user's code that called the package.
fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    PyErr::warn(py, &class(py, "RadiosityWarning")?, &text, 2)
}
