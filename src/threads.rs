//! When a further thread pays: below a size nothing but the calling thread runs.

use rayon::prelude::*;

/// Multiplications for which another thread is worth waking.
///
/// They take some 10 to 40 µs; a thread that sleeps takes about as long to begin, and may find its core busy.
pub(crate) const TERMS_PER_THREAD: usize = 1 << 17;

/// Tells whether so many multiplications are worth more than one thread. It depends on the problem alone, never on the machine.
pub(crate) fn pay(n_terms: usize) -> bool {
    n_terms >= 2 * TERMS_PER_THREAD
}

/// Calls `work` for every task: in order on this thread where `n_terms`, the multiplications of all of them, are few.
pub(crate) fn for_each<T: Send>(n_terms: usize, tasks: Vec<T>, work: impl Fn(T) + Sync + Send) {
    if pay(n_terms) {
        tasks.into_par_iter().for_each(work);
    } else {
        tasks.into_iter().for_each(work);
    }
}

/// Calls `work` for every chunk of so many items, with its number: in order on this thread where `n_terms`, the multiplications of all of them, are few.
pub(crate) fn for_each_chunk<T: Send>(
    n_terms: usize,
    items: &mut [T],
    n_together: usize,
    work: impl Fn(usize, &mut [T]) + Sync + Send,
) {
    if pay(n_terms) {
        let chunks = items.par_chunks_mut(n_together).enumerate();
        chunks.for_each(|(k, chunk)| work(k, chunk));
    } else {
        let chunks = items.chunks_mut(n_together).enumerate();
        chunks.for_each(|(k, chunk)| work(k, chunk));
    }
}

/// Returns what `work` makes of 0 to `n` − 1: on this thread where `n_terms`, the multiplications of all of them, are few.
pub(crate) fn map<R: Send>(n_terms: usize, n: usize, work: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    if pay(n_terms) {
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

    /// Returns the threads that tasks of so many terms ran on.
    fn runners(n_terms: usize) -> HashSet<ThreadId> {
        let seen = Mutex::new(HashSet::new());
        let note = || {
            seen.lock().expect("no panic").insert(std::thread::current().id());
        };
        for_each(n_terms, (0..64).collect(), |_: usize| note());
        for_each_chunk(n_terms, &mut [0; 64], 3, |_, _| note());
        assert_eq!(map(n_terms, 64, |k| k), (0..64).collect::<Vec<_>>());
        map(n_terms, 64, |_| note());
        seen.into_inner().expect("no panic")
    }

    #[test]
    fn few_terms_wake_nobody() {
        let own = HashSet::from([std::thread::current().id()]);
        assert_eq!(runners(2 * TERMS_PER_THREAD - 1), own);
        // What is handed to the pool runs there, since this thread is no part of it.
        assert!(runners(2 * TERMS_PER_THREAD).is_disjoint(&own));
    }
}
