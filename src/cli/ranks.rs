//! The ranks of this run.

use std::sync::{Arc, OnceLock};

use super::args::{Command, HeatArgs, SolveArgs};
use super::failure::Failure;
use crate::ranks::{self, Alone, Ranks};
use crate::whole_file;

/// The ranks, and the number of others on this machine.
static RANKS: OnceLock<(Arc<dyn Ranks>, usize)> = OnceLock::new();

/// Finds the ranks that a launcher started; after this, all but the first write no files.
///
/// The second value of an error is true on the first rank, which prints it.
pub(super) fn start() -> Result<(), (Failure, bool)> {
    let all = ranks::start().map_err(|error| (Failure::usage(error.to_string()), error.rank() == 0))?;
    if !all.is_first() {
        whole_file::leave_to_first_rank();
    }
    let on_each = all.on_each_host();
    let n_others = on_each[all.rank()] - 1;
    // The program starts only once.
    let _ = RANKS.set((all, n_others));
    Ok(())
}

/// Returns all ranks.
pub(super) fn of_run() -> Arc<dyn Ranks> {
    RANKS
        .get()
        .map_or_else(|| Arc::new(Alone) as _, |(all, _)| Arc::clone(all))
}

/// Returns whether this rank prints.
pub(super) fn is_first() -> bool {
    RANKS.get().is_none_or(|(all, _)| all.is_first())
}

/// Returns how many other ranks are on this machine.
pub(super) fn n_others() -> usize {
    RANKS.get().map_or(0, |(_, n_others)| *n_others)
}

/// Returns the default number of threads, 0 for that of the cores: ranks on one machine share its cores.
pub(super) fn default_threads() -> usize {
    let n_here = n_others() + 1;
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    if n_here == 1 { 0 } else { (cores / n_here).max(1) }
}

/// Refuses several ranks for work that they cannot share.
pub(super) fn expect_shared(command: &Command) -> Result<(), Failure> {
    let n = of_run().size();
    match alone(command) {
        Some(what) if n > 1 => Err(Failure::usage(format!(
            "{n} ranks are started, and {what} runs on one; start one rank"
        ))),
        _ => Ok(()),
    }
}

/// Returns the part of a command that runs on one rank only.
fn alone(command: &Command) -> Option<&'static str> {
    let on_path = "--sun-path with --checkpoint";
    let time_limit = "--time-limit";
    let first = |flags: &[(bool, &'static str)]| flags.iter().find(|(given, _)| *given).map(|(_, what)| *what);
    match command {
        Command::FormFactors(a) => first(&[(a.method.time_limit.is_some(), time_limit)]),
        Command::Solve(SolveArgs {
            method,
            sun_path,
            storage,
            ..
        })
        | Command::Heat(HeatArgs {
            method,
            sun_path,
            storage,
            ..
        }) => first(&[
            (method.time_limit.is_some(), time_limit),
            (sun_path.is_some() && storage.checkpoint.is_some(), on_path),
        ]),
        Command::Render(a) => first(&[(a.method.time_limit.is_some(), time_limit)]),
        Command::Scene(_) => Some("`scene`"),
        Command::Points(_) => Some("`points`"),
        Command::Field(_) => Some("`field`"),
        Command::Voxel(_) => Some("`voxel`"),
        Command::Verify(_) => Some("`verify`"),
        Command::Compare(_) => Some("`compare`"),
        Command::Reproduce(_) => Some("`reproduce`"),
        Command::Completions(_) => Some("`completions`"),
        Command::Man(_) => Some("`man`"),
    }
}
