//! Decides when further threads are worth waking: small work runs on the calling thread alone.

use rayon::prelude::*;

/// The number of multiplications for which another thread is worth waking.
///
/// They take some 10 to 40 µs; a sleeping thread takes about as long to begin, and may find its core busy.
pub(crate) const TERMS_PER_THREAD: usize = 1 << 17;

/// Returns whether `n_terms` multiplications are worth more than one thread, which depends on the problem alone, not on the machine.
pub(crate) fn pay(n_terms: usize) -> bool {
    n_terms >= 2 * TERMS_PER_THREAD
}

/// The bytes of a matrix from which another thread is worth waking for a pass.
///
/// Smaller matrices stay in the cache of one core, which reads them in a hundred microseconds or less.
///
/// Between passes of a solver the other threads sleep; waking them takes tens of microseconds. Times: `docs/performance.md`.
const CACHED_BYTE: usize = 2 << 20;

/// The number of multiplications for which another thread is worth waking, for any size of the matrix.
const PASS_TERMS: usize = 1 << 21;

/// Returns whether a pass over a matrix of `n_byte` bytes, with `n_terms` multiplications, is worth more than one thread.
///
/// It depends on the problem alone, not on the machine.
pub(crate) fn pay_for_pass(n_terms: usize, n_byte: usize) -> bool {
    n_byte >= CACHED_BYTE || n_terms >= PASS_TERMS
}

/// Calls `work` for every task; in order on this thread unless `pay` is true.
pub(crate) fn for_each<T: Send>(pay: bool, tasks: Vec<T>, work: impl Fn(T) + Sync + Send) {
    if pay {
        tasks.into_par_iter().for_each(work);
    } else {
        tasks.into_iter().for_each(work);
    }
}

/// Calls `work` for every chunk of items, with its number; in order on this thread unless `pay` is true.
pub(crate) fn for_each_chunk<T: Send>(
    pay: bool,
    items: &mut [T],
    n_together: usize,
    work: impl Fn(usize, &mut [T]) + Sync + Send,
) {
    if pay {
        let chunks = items.par_chunks_mut(n_together).enumerate();
        chunks.for_each(|(k, chunk)| work(k, chunk));
    } else {
        let chunks = items.chunks_mut(n_together).enumerate();
        chunks.for_each(|(k, chunk)| work(k, chunk));
    }
}

/// Returns the results of `work` for 0 to `n` − 1; computed on this thread unless `pay` is true.
pub(crate) fn map<R: Send>(pay: bool, n: usize, work: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    if pay {
        (0..n).into_par_iter().map(work).collect()
    } else {
        (0..n).map(work).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::sync::Mutex;
    use std::thread::ThreadId;

    /// Returns the threads on which tasks ran.
    fn runners(pay: bool) -> HashSet<ThreadId> {
        let seen = Mutex::new(HashSet::new());
        let note = || {
            seen.lock().expect("no panic").insert(std::thread::current().id());
        };
        for_each(pay, (0..64).collect(), |_: usize| note());
        for_each_chunk(pay, &mut [0; 64], 3, |_, _| note());
        assert_eq!(map(pay, 64, |k| k), (0..64).collect::<Vec<_>>());
        map(pay, 64, |_| note());
        seen.into_inner().expect("no panic")
    }

    #[test]
    fn few_terms_wake_nobody() {
        let own = HashSet::from([std::thread::current().id()]);
        assert_eq!(runners(pay(2 * TERMS_PER_THREAD - 1)), own);
        assert_eq!(runners(pay_for_pass(PASS_TERMS - 1, CACHED_BYTE - 1)), own);
        // Work that is passed to the pool runs there, since this thread is no part of it.
        assert!(runners(pay(2 * TERMS_PER_THREAD)).is_disjoint(&own));
        assert!(pay_for_pass(PASS_TERMS, 0) && pay_for_pass(0, CACHED_BYTE));
    }
}
