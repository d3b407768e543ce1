//! Ranks that are threads of one process, for tests.

use std::sync::{Arc, Barrier, Mutex, PoisonError};

use super::Ranks;

/// The shared state of the ranks of a test.
#[derive(Debug)]
struct Meeting {
    barrier: Barrier,
    given: Mutex<Vec<Vec<u8>>>,
}

/// A rank for collective work, which does not share chunks out.
#[derive(Debug)]
struct ThreadRank {
    rank: usize,
    size: usize,
    meeting: Arc<Meeting>,
}

/// Returns the results of `work` on each of so many ranks.
pub(crate) fn on_ranks<R: Send>(size: usize, work: impl Fn(Arc<dyn Ranks>) -> R + Sync) -> Vec<R> {
    let meeting = Arc::new(Meeting {
        barrier: Barrier::new(size),
        given: Mutex::new(vec![Vec::new(); size]),
    });
    std::thread::scope(|scope| {
        let begin = |rank| {
            let meeting = Arc::clone(&meeting);
            let work = &work;
            scope.spawn(move || work(Arc::new(ThreadRank { rank, size, meeting })))
        };
        let all: Vec<_> = (0..size).map(begin).collect();
        all.into_iter().map(|rank| rank.join().expect("no panic")).collect()
    })
}

impl Ranks for ThreadRank {
    fn size(&self) -> usize {
        self.size
    }
    fn rank(&self) -> usize {
        self.rank
    }
    fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let given = || self.meeting.given.lock().unwrap_or_else(PoisonError::into_inner);
        given()[self.rank] = own.to_vec();
        self.meeting.barrier.wait();
        let all = given().clone();
        self.meeting.barrier.wait();
        all
    }
}
