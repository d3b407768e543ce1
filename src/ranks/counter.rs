//! The chunks of a task that are given out.

use super::Claim;

/// The next chunk of a task, and the progress of each rank.
#[derive(Clone, Debug)]
pub(super) struct Counter {
    next: u64,
    /// The first chunk whose result each rank has not received, \[K\].
    needed: Vec<u64>,
}

impl Counter {
    /// Returns a counter with no chunk given out.
    pub(super) fn new(n_ranks: usize) -> Self {
        Self {
            next: 0,
            needed: vec![0; n_ranks],
        }
    }

    /// Gives out the next of `n` chunks, unless it is `window` chunks or more ahead of the first that a rank needs.
    pub(super) fn claim(&mut self, n: u64, window: u64) -> Claim {
        let first = self.needed.iter().copied().min().unwrap_or(0);
        if self.next >= n {
            Claim::Over
        } else if self.next >= first + window {
            Claim::Later
        } else {
            self.next += 1;
            Claim::Given(self.next - 1)
        }
    }

    /// Records the first chunk whose result a rank needs.
    pub(super) fn needs(&mut self, rank: usize, chunk: u64) {
        self.needed[rank] = self.needed[rank].max(chunk);
    }

    /// Returns the number of chunks given out.
    #[cfg(test)]
    pub(super) fn n_given(&self) -> u64 {
        self.next
    }
}
