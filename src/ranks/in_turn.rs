//! Chunks of work that ranks share, their results in order on every rank.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Claim, Ranks};

/// How long a rank without work waits before it asks again.
const PATIENCE: Duration = Duration::from_millis(20);

/// The result of a chunk.
pub(crate) struct Result {
    pub(crate) content: Vec<u8>,
    /// True if this rank computed it.
    pub(crate) is_own: bool,
}

/// Yields the results of chunks 0, 1, ..., n − 1 on every rank, each computed by one of them.
///
/// A rank computes a chunk whenever the next result is not there yet. Chunks are given out up to `window` ahead of the rank that yielded the fewest: so many results wait on a rank at most.
pub(crate) struct InTurn<'a, W> {
    ranks: &'a dyn Ranks,
    number: u64,
    n: u64,
    next: u64,
    window: u64,
    ready: BTreeMap<u64, Result>,
    work: W,
    /// True once all chunks are given out.
    is_over: bool,
}

impl<'a, W: FnMut(usize) -> Vec<u8>> InTurn<'a, W> {
    /// Begins `n` chunks. Collective.
    pub(crate) fn new(ranks: &'a dyn Ranks, n: usize, window: usize, work: W) -> Self {
        Self {
            number: ranks.begin(),
            ranks,
            n: n as u64,
            next: 0,
            window: (window as u64).max(1),
            ready: BTreeMap::new(),
            work,
            is_over: false,
        }
    }

    /// Takes in what other ranks sent.
    fn receive(&mut self, wait: Duration) {
        let came = self.ranks.posted(self.number, wait);
        let results = came.into_iter().map(|(chunk, content)| {
            let is_own = false;
            (chunk, Result { content, is_own })
        });
        self.ready.extend(results);
    }
}

impl<W: FnMut(usize) -> Vec<u8>> Iterator for InTurn<'_, W> {
    type Item = Result;

    fn next(&mut self) -> Option<Result> {
        if self.next == self.n {
            return None;
        }
        loop {
            self.receive(Duration::ZERO);
            if let Some(result) = self.ready.remove(&self.next) {
                self.next += 1;
                self.ranks.needs(self.number, self.next);
                return Some(result);
            }
            if !self.is_over {
                match self.ranks.claim(self.number, self.n, self.window) {
                    Claim::Given(chunk) => {
                        let content = (self.work)(usize::try_from(chunk).unwrap_or(usize::MAX));
                        self.ranks.post(self.number, chunk, content.clone());
                        self.ready.insert(chunk, Result { content, is_own: true });
                        continue;
                    }
                    Claim::Over => self.is_over = true,
                    Claim::Later => {}
                }
            }
            self.receive(PATIENCE);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc::{Receiver, Sender, channel};

    use super::*;
    use crate::ranks::counter::Counter;
    use crate::ranks::{Alone, End, Traffic, Verdict};

    /// A rank among threads of one process.
    #[derive(Debug)]
    struct Thread<'a> {
        rank: usize,
        counter: &'a Mutex<Counter>,
        others: Vec<Sender<(u64, Vec<u8>)>>,
        inbox: Mutex<Receiver<(u64, Vec<u8>)>>,
    }

    impl Ranks for Thread<'_> {
        fn size(&self) -> usize {
            self.others.len() + 1
        }
        fn rank(&self) -> usize {
            self.rank
        }
        fn host(&self) -> &str {
            "here"
        }
        fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
            vec![own.to_vec()]
        }
        fn all_gather_numbers(&self, own: &[f64]) -> Vec<f64> {
            own.to_vec()
        }
        fn begin(&self) -> u64 {
            0
        }
        fn claim(&self, _work: u64, n: u64, window: u64) -> Claim {
            self.counter.lock().expect("no panic").claim(n, window)
        }
        fn needs(&self, _work: u64, chunk: u64) {
            self.counter.lock().expect("no panic").needs(self.rank, chunk);
        }
        fn post(&self, _work: u64, chunk: u64, result: Vec<u8>) {
            for other in &self.others {
                // One that has all results is gone.
                let _ = other.send((chunk, result.clone()));
            }
        }
        fn posted(&self, _work: u64, wait: Duration) -> Vec<(u64, Vec<u8>)> {
            let inbox = self.inbox.lock().expect("no panic");
            inbox.recv_timeout(wait).into_iter().chain(inbox.try_iter()).collect()
        }
        fn traffic(&self) -> Traffic {
            Traffic::default()
        }
        fn end(&self, end: End) -> Verdict {
            Alone.end(end)
        }
        fn abort(&self, code: u8) -> ! {
            Alone.abort(code)
        }
    }

    /// All results in order on each rank, every chunk computed once, and none more than the window ahead.
    #[test]
    fn every_rank_gets_all_results_in_order_and_each_chunk_is_computed_once() {
        for (n_ranks, n, window) in [(1, 5, 1), (2, 100, 1), (3, 100, 4), (4, 37, 100), (3, 2, 8), (2, 0, 3)] {
            let (counter, n_computed) = (Mutex::new(Counter::new(n_ranks)), AtomicUsize::new(0));
            let (senders, receivers): (Vec<_>, Vec<_>) = (0..n_ranks).map(|_| channel()).unzip();
            std::thread::scope(|scope| {
                for (rank, inbox) in receivers.into_iter().enumerate() {
                    let others = senders.iter().enumerate().filter(|(other, _)| *other != rank);
                    let others = others.map(|(_, sender)| sender.clone()).collect();
                    let (counter, n_computed) = (&counter, &n_computed);
                    scope.spawn(move || {
                        let ranks = Thread {
                            rank,
                            counter,
                            others,
                            inbox: Mutex::new(inbox),
                        };
                        let mut n_yielded = 0;
                        let work = |k: usize| {
                            n_computed.fetch_add(1, Ordering::SeqCst);
                            vec![u8::try_from(k).expect("small"); k]
                        };
                        for result in InTurn::new(&ranks, n, window, work) {
                            assert_eq!(result.content, vec![u8::try_from(n_yielded).expect("small"); n_yielded]);
                            n_yielded += 1;
                            let n_given = counter.lock().expect("no panic").n_given();
                            assert!(n_given <= n.min(n_yielded + window) as u64);
                        }
                        assert_eq!(n_yielded, n);
                    });
                }
            });
            assert_eq!(n_computed.into_inner(), n);
        }
    }
}
