//! What ranks agree on before they share work: each of them has to take the same steps.

use super::{Context, WorkflowError};

/// What all ranks have room for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// The least of the limits of memory, in bytes.
    pub(super) limit_byte: u64,
    /// The most that is used already, in bytes.
    pub(super) used_byte: u64,
    /// The most threads.
    pub(super) n_threads: usize,
}

impl Context {
    /// Refuses ranks for which `key`, a hash of what results depend on, is another than on rank 0. Collective.
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

    /// Returns the room of the rank that has the least, so that all of them store form factors alike. Collective.
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
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let of_rank = |bytes: &Vec<u8>| {
            let numbers: Vec<u64> = bytes.as_chunks().0.iter().map(|own| u64::from_le_bytes(*own)).collect();
            (numbers[0], numbers[1], numbers[2])
        };
        let all = self.ranks.all_gather(&bytes);
        all.iter().map(of_rank).fold(own, |room, (limit, used, threads)| Room {
            limit_byte: room.limit_byte.min(limit),
            used_byte: room.used_byte.max(used),
            n_threads: room.n_threads.max(usize::try_from(threads).unwrap_or(usize::MAX)),
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
