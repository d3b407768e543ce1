//! Loops on several threads, and the decision when further threads are worth waking: small work runs on the calling thread alone.
//!
//! The code of a parallel loop is long, and a compiler makes it anew for each closure: here it is compiled once.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

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

/// The number of pieces per thread into which a loop is cut, as some take longer than others.
const PIECES_PER_THREAD: usize = 64;

/// Calls `work` for 0 to `n` − 1, in parallel.
fn run(n: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..n).into_par_iter().with_max_len(1).for_each(work);
}

/// Returns the results of `work` for 0 to `n` − 1, in order, computed in parallel.
pub(crate) fn collect<R: Send>(n: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    in_pieces(n, &|piece| piece.map(&work).collect())
}

/// Returns the results of `work` for every item, in order, computed in parallel.
pub(crate) fn collect_from<'a, T: Sync, R: Send>(items: &'a [T], work: impl Fn(&'a T) -> R + Sync) -> Vec<R> {
    collect(items.len(), |k| work(&items[k]))
}

/// Returns what [`collect_from`] does, of items that `work` takes.
pub(crate) fn collect_owned<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    collect_from(&items, |item| {
        let item = item.lock().unwrap_or_else(PoisonError::into_inner).take();
        work(item.expect("each item is taken once"))
    })
}

/// Returns what [`collect`] does; `init` makes what some calls of `work` use one after the other, such as buffers.
pub(crate) fn collect_with<S, R: Send>(
    n: usize,
    init: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize) -> R + Sync,
) -> Vec<R> {
    in_pieces(n, &|piece| {
        let mut state = init();
        piece.map(|k| work(&mut state, k)).collect()
    })
}

/// Returns all that the results of `work` for 0 to `n` − 1 yield, in order, computed in parallel.
pub(crate) fn collect_flat<R: Send, I: IntoIterator<Item = R>>(n: usize, work: impl Fn(usize) -> I + Sync) -> Vec<R> {
    in_pieces(n, &|piece| piece.flat_map(&work).collect())
}

/// Returns the results of `work` for consecutive ranges of 0 to `n` − 1, one after the other.
fn in_pieces<R: Send>(n: usize, work: &(dyn Fn(Range<usize>) -> Vec<R> + Sync)) -> Vec<R> {
    let n_pieces = n.min(PIECES_PER_THREAD * rayon::current_num_threads());
    let done: Vec<Mutex<Vec<R>>> = (0..n_pieces).map(|_| Mutex::new(Vec::new())).collect();
    run(n_pieces, &|piece| {
        let results = work(piece * n / n_pieces..(piece + 1) * n / n_pieces);
        *done[piece].lock().unwrap_or_else(PoisonError::into_inner) = results;
    });
    let of_pieces: Vec<Vec<R>> = done
        .into_iter()
        .map(|results| results.into_inner().unwrap_or_else(PoisonError::into_inner))
        .collect();
    let mut all = Vec::with_capacity(of_pieces.iter().map(Vec::len).sum());
    for mut results in of_pieces {
        all.append(&mut results);
    }
    all
}

/// Calls `work` for every task; in order on this thread unless `pay` is true.
pub(crate) fn for_each<T: Send>(pay: bool, tasks: Vec<T>, work: impl Fn(T) + Sync) {
    if pay {
        collect_owned(tasks, work);
    } else {
        tasks.into_iter().for_each(work);
    }
}

/// Calls `work` for every chunk of items, with its number; in order on this thread unless `pay` is true.
pub(crate) fn for_each_chunk<T: Send>(
    pay: bool,
    items: &mut [T],
    n_together: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let chunks = items.chunks_mut(n_together).enumerate();
    if pay {
        for_each(true, chunks.collect(), |(k, chunk)| work(k, chunk));
    } else {
        chunks.for_each(|(k, chunk)| work(k, chunk));
    }
}

/// Returns the results of `work` for 0 to `n` − 1; computed on this thread unless `pay` is true.
pub(crate) fn map<R: Send>(pay: bool, n: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    if pay {
        collect(n, work)
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
