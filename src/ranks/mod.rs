//! Several processes that do one piece of work together: the ranks of an MPI program.
//!
//! All ranks run the same command on the same input, each with its own threads. Work that is worth it is cut into chunks, which ranks claim as they finish others
//! ([`Ranks::claim`]), and every rank receives the results of all chunks in their order. Each rank thus has the same numbers at every step, those of a single rank;
//! of form factors in memory it stores [a part](crate::matrix::Among). Rank 0 alone prints and writes files.
//!
//! [`Alone`] is the single rank of an ordinary run. With the feature `mpi`, [`start`] returns the ranks that `mpirun` started.

#[cfg(any(test, feature = "mpi"))]
mod counter;
mod in_turn;
mod launch;
#[cfg(any(test, feature = "mpi"))]
mod parts;
#[cfg(test)]
pub(crate) mod threads;
#[cfg(feature = "mpi")]
mod world;

pub(crate) use in_turn::{Code, InTurn};
pub use launch::{RanksError, start};

use std::fmt::Debug;
use std::time::Duration;

/// The ranks that work together; one of them is this process.
///
/// Methods that are *collective* return on each rank once all ranks have called them, in the same order on each. The provided methods for sharing work are those of a single rank.
pub trait Ranks: Debug + Send + Sync {
    /// Returns K, the number of ranks.
    fn size(&self) -> usize;

    /// Returns the number of this rank, below K.
    fn rank(&self) -> usize;

    /// Returns the bytes of each rank, in the order of ranks. Collective.
    fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>>;

    /// Returns the name of the machine.
    #[expect(clippy::unnecessary_literal_bound, reason = "machines have names of their own")]
    fn host(&self) -> &str {
        "this machine"
    }

    /// Returns the numbers of each rank, one after the other in the order of ranks. Collective.
    fn all_gather_numbers(&self, own: &[f64]) -> Vec<f64> {
        let bytes: Vec<u8> = own.iter().flat_map(|x| x.to_le_bytes()).collect();
        let all = self.all_gather(&bytes).concat();
        all.as_chunks().0.iter().map(|x| f64::from_le_bytes(*x)).collect()
    }

    /// Returns the number of the next shared task, the same on each rank, as all ask in the same order.
    fn begin(&self) -> u64 {
        0
    }

    /// Claims the next of `n` chunks of a task, unless it is `window` chunks or more ahead of the rank that [needs](Self::needs) the earliest.
    fn claim(&self, _work: u64, _n: u64, _window: u64) -> Claim {
        Claim::Over
    }

    /// Reports that this rank has received all results of a task before those of `chunk`.
    fn needs(&self, _work: u64, _chunk: u64) {}

    /// Sends the result of a chunk to all other ranks.
    fn post(&self, _work: u64, _chunk: u64, _result: Vec<u8>) {}

    /// Returns the results of chunks that other ranks sent and that were not returned before; waits for one for at most `wait`.
    fn posted(&self, _work: u64, _wait: Duration) -> Vec<(u64, Vec<u8>)> {
        Vec::new()
    }

    /// Returns the messages that this rank has sent so far.
    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    /// Ends the work of this rank with an exit code, and returns the end of the program; collective, but for failures that other ranks do not share.
    fn end(&self, end: End) -> Verdict {
        Verdict {
            code: end.code,
            speaks: end.failed,
            aborts: false,
        }
    }

    /// Ends all ranks at once.
    fn abort(&self, code: u8) -> ! {
        std::process::exit(code.into())
    }

    /// Returns whether this rank prints and writes files.
    fn is_first(&self) -> bool {
        self.rank() == 0
    }

    /// Returns the number of ranks on the machine of each rank, \[K\]. Collective.
    fn on_each_host(&self) -> Vec<usize> {
        let hosts = self.all_gather(self.host().as_bytes());
        let same = |host: &Vec<u8>| hosts.iter().filter(|other| *other == host).count();
        hosts.iter().map(same).collect()
    }
}

/// The answer to [`Ranks::claim`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// This chunk is the rank's.
    Given(u64),
    /// The next one is too far ahead.
    Later,
    /// All are given out.
    Over,
}

/// The end of a rank's work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct End {
    /// The exit code.
    pub code: u8,
    /// True if there is an error to print.
    pub failed: bool,
}

/// The end of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// The exit code of all ranks.
    pub code: u8,
    /// True if this rank prints its error: one of those that have one.
    pub speaks: bool,
    /// True if other ranks are still at work, and this rank is to [`abort`](Ranks::abort) them.
    pub aborts: bool,
}

/// The messages that a rank sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Collective operations.
    pub n_collective: u64,
    /// Bytes given to collective operations.
    pub collective_byte: u64,
    /// Messages to single ranks.
    pub n_messages: u64,
    /// Bytes of these messages.
    pub message_byte: u64,
}

/// A single rank.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alone;

impl Ranks for Alone {
    fn size(&self) -> usize {
        1
    }

    fn rank(&self) -> usize {
        0
    }

    fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        vec![own.to_vec()]
    }

    fn all_gather_numbers(&self, own: &[f64]) -> Vec<f64> {
        own.to_vec()
    }
}
