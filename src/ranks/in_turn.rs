//! Chunks of work that ranks share, with their results in order on every rank.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Claim, Ranks};

/// The time after which a rank without work asks again.
const PATIENCE: Duration = Duration::from_millis(20);

/// The conversion of a chunk's result into bytes for other ranks, and back.
pub(crate) struct Code<E, D> {
    pub(crate) encode: E,
    /// Decodes the result of the chunk of a number.
    pub(crate) decode: D,
}

/// Yields the results of chunks 0, 1, ..., n − 1 on every rank, each computed by one of them, and whether that was this one.
///
/// A rank computes a chunk whenever the next result has not arrived. Chunks are given out up to `window` ahead of the rank that yielded the fewest, so that at most as many results wait on a rank.
pub(crate) struct InTurn<'a, T, W, E, D> {
    ranks: &'a dyn Ranks,
    number: u64,
    n: u64,
    next: u64,
    window: u64,
    ready: BTreeMap<u64, Ready<T>>,
    work: W,
    code: Code<E, D>,
    /// True once all chunks are given out.
    is_over: bool,
}

/// A result that waits for its turn.
enum Ready<T> {
    Own(T),
    Bytes(Vec<u8>),
}

impl<'a, T, W, E, D> InTurn<'a, T, W, E, D>
where
    W: FnMut(usize) -> T,
    E: Fn(&T) -> Vec<u8>,
    D: Fn(usize, &[u8]) -> T,
{
    /// Begins `n` chunks. Collective.
    pub(crate) fn new(ranks: &'a dyn Ranks, (n, window): (usize, usize), work: W, code: Code<E, D>) -> Self {
        Self {
            number: ranks.begin(),
            ranks,
            n: n as u64,
            next: 0,
            window: (window as u64).max(1),
            ready: BTreeMap::new(),
            work,
            code,
            is_over: false,
        }
    }

    /// Receives the results from other ranks.
    fn receive(&mut self, wait: Duration) {
        let came = self.ranks.posted(self.number, wait);
        self.ready
            .extend(came.into_iter().map(|(chunk, bytes)| (chunk, Ready::Bytes(bytes))));
    }
}

impl<T, W, E, D> Iterator for InTurn<'_, T, W, E, D>
where
    W: FnMut(usize) -> T,
    E: Fn(&T) -> Vec<u8>,
    D: Fn(usize, &[u8]) -> T,
{
    type Item = (T, bool);

    fn next(&mut self) -> Option<(T, bool)> {
        if self.next == self.n {
            return None;
        }
        // There are no more than a usize counts.
        let place = |chunk: u64| usize::try_from(chunk).unwrap_or(usize::MAX);
        loop {
            self.receive(Duration::ZERO);
            if let Some(result) = self.ready.remove(&self.next) {
                let chunk = place(self.next);
                self.next += 1;
                self.ranks.needs(self.number, self.next);
                return Some(match result {
                    Ready::Own(result) => (result, true),
                    Ready::Bytes(bytes) => ((self.code.decode)(chunk, &bytes), false),
                });
            }
            if !self.is_over {
                match self.ranks.claim(self.number, self.n, self.window) {
                    Claim::Given(chunk) => {
                        let result = (self.work)(place(chunk));
                        self.ranks.post(self.number, chunk, (self.code.encode)(&result));
                        self.ready.insert(chunk, Ready::Own(result));
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
        fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
            vec![own.to_vec()]
        }
        fn claim(&self, _work: u64, n: u64, window: u64) -> Claim {
            self.counter.lock().expect("no panic").claim(n, window)
        }
        fn needs(&self, _work: u64, chunk: u64) {
            self.counter.lock().expect("no panic").needs(self.rank, chunk);
        }
        fn post(&self, _work: u64, chunk: u64, result: Vec<u8>) {
            for other in &self.others {
                // A rank that has all results is gone.
                let _ = other.send((chunk, result.clone()));
            }
        }
        fn posted(&self, _work: u64, wait: Duration) -> Vec<(u64, Vec<u8>)> {
            let inbox = self.inbox.lock().expect("no panic");
            inbox.recv_timeout(wait).into_iter().chain(inbox.try_iter()).collect()
        }
    }

    /// All results in order on each rank, every chunk computed once, and none more than the window ahead.
    #[test]
    fn every_rank_gets_all_results_in_order_and_each_chunk_is_computed_once() {
        for (n_ranks, n, window) in [(1, 5, 1), (2, 100, 1), (3, 100, 4), (4, 37, 100), (3, 2, 8), (2, 0, 3)] {
            let counter = Mutex::new(Counter::new(n_ranks));
            let [n_computed, n_taken] = [0, 0].map(AtomicUsize::new);
            let (senders, receivers): (Vec<_>, Vec<_>) = (0..n_ranks).map(|_| channel()).unzip();
            std::thread::scope(|scope| {
                for (rank, inbox) in receivers.into_iter().enumerate() {
                    let others = senders.iter().enumerate().filter(|(other, _)| *other != rank);
                    let others = others.map(|(_, sender)| sender.clone()).collect();
                    let (counter, n_computed, n_taken) = (&counter, &n_computed, &n_taken);
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
                        let code = Code {
                            encode: Vec::clone,
                            decode: |k: usize, bytes: &[u8]| {
                                assert_eq!(bytes.len(), k);
                                bytes.to_vec()
                            },
                        };
                        let mut n_own = 0;
                        for (result, is_own) in InTurn::new(&ranks, (n, window), work, code) {
                            n_own += usize::from(is_own);
                            assert_eq!(result, vec![u8::try_from(n_yielded).expect("small"); n_yielded]);
                            n_yielded += 1;
                            let n_given = counter.lock().expect("no panic").n_given();
                            assert!(n_given <= n.min(n_yielded + window) as u64);
                        }
                        assert_eq!(n_yielded, n);
                        n_taken.fetch_add(n_own, Ordering::SeqCst);
                    });
                }
            });
            assert_eq!((n_computed.into_inner(), n_taken.into_inner()), (n, n));
        }
    }
}
