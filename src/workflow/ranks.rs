//! Agreement of ranks before they share work: all have to take the same steps.

use sha2::{Digest as _, Sha256};

use super::{Context, WorkflowError};
use crate::matrix::operator::Block;

/// The memory limit common to all ranks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// The least of the limits of memory, in bytes.
    pub(super) limit_byte: u64,
    /// The greatest memory in use, in bytes.
    pub(super) used_byte: u64,
    /// The greatest number of threads.
    pub(super) n_threads: usize,
}

impl Context {
    /// Refuses ranks whose `key`, a hash of the input of the results, differs from that of rank 0; a collective call.
    ///
    /// # Errors
    /// [`WorkflowError::RanksDiffer`].
    pub fn expect_same(&self, what: &'static str, key: &[u8]) -> Result<(), WorkflowError> {
        if self.ranks.size() == 1 {
            return Ok(());
        }
        let keys = self.ranks.all_gather(key);
        let hosts = self.ranks.all_gather(self.ranks.host().as_bytes());
        let host = |rank: usize| String::from_utf8_lossy(&hosts[rank]).into_owned();
        match keys.iter().position(|other| *other != keys[0]) {
            None => Ok(()),
            Some(rank) => Err(WorkflowError::RanksDiffer {
                what,
                rank,
                hosts: [host(rank), host(0)],
            }),
        }
    }

    /// Refuses ranks whose numbers differ from those of rank 0; a collective call.
    ///
    /// # Errors
    /// As [`expect_same`](Self::expect_same).
    pub(super) fn expect_same_numbers(&self, what: &'static str, blocks: &[&Block]) -> Result<(), WorkflowError> {
        if self.ranks.size() == 1 {
            return Ok(());
        }
        let mut hasher = Sha256::new();
        for block in blocks {
            hasher.update(format!("{} {}\n", block.n_rows(), block.n_channels()));
            for number in block.values() {
                hasher.update(number.to_bits().to_le_bytes());
            }
        }
        self.expect_same(what, &hasher.finalize())
    }

    /// Returns the room of the rank that has the least, so that all ranks store form factors alike; a collective call.
    pub(super) fn room(&self, used_byte: u64) -> Room {
        let own = Room {
            limit_byte: self.memory.limit(),
            used_byte,
            n_threads: rayon::current_num_threads(),
        };
        if self.ranks.size() == 1 {
            return own;
        }
        let numbers = [own.limit_byte, own.used_byte, own.n_threads as u64];
        let all = self.ranks.all_gather(numbers.map(u64::to_le_bytes).as_flattened());
        let of_ranks = all.iter().map(|bytes| bytes.as_chunks().0);
        of_ranks.fold(own, |room, of_rank| match *of_rank {
            [limit, used, threads] => Room {
                limit_byte: room.limit_byte.min(u64::from_le_bytes(limit)),
                used_byte: room.used_byte.max(u64::from_le_bytes(used)),
                n_threads: room
                    .n_threads
                    .max(usize::try_from(u64::from_le_bytes(threads)).unwrap_or(usize::MAX)),
            },
            _ => unreachable!("each rank gives three numbers"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_rank_agrees_with_itself() {
        let mut cx = Context::default();
        cx.memory.limit_byte = Some(12345);
        assert!(cx.expect_same("scene", b"key").is_ok());
        let room = cx.room(678);
        assert_eq!((room.limit_byte, room.used_byte), (12345, 678));
    }
}
