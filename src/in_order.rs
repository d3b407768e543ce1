//! Runs work in parallel and yields its results in order, with bounded memory.

use crate::threads;

/// Yields `work(0)`, `work(1)`, ..., `work(n − 1)`.
///
/// If no result is left, the next `window` of them are computed in parallel. The results do not depend on `window` or the number
/// of threads.
pub(crate) struct InOrder<T, F> {
    next: usize,
    n: usize,
    window: usize,
    work: F,
    ready: std::vec::IntoIter<T>,
}

impl<T: Send, F: Fn(usize) -> T + Sync> InOrder<T, F> {
    /// Stores at most `memory_byte` of results, each of up to `item_byte`, but at least one per thread.
    pub(crate) fn new(n: usize, item_byte: u64, memory_byte: u64, work: F) -> Self {
        let fitting = usize::try_from(memory_byte / item_byte.max(1)).unwrap_or(usize::MAX);
        Self {
            next: 0,
            n,
            window: fitting.max(rayon::current_num_threads()),
            work,
            ready: Vec::new().into_iter(),
        }
    }
}

impl<T: Send, F: Fn(usize) -> T + Sync> Iterator for InOrder<T, F> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        if self.ready.len() == 0 {
            let end = self.n.min(self.next.saturating_add(self.window));
            let results = threads::collect(end - self.next, |k| (self.work)(self.next + k));
            self.next = end;
            self.ready = results.into_iter();
        }
        self.ready.next()
    }
}

/// Yields `work` of each item in order, with as many in parallel as there are threads.
pub(crate) fn by_turns<A: Send, B: Send>(
    mut items: impl Iterator<Item = A>,
    work: impl Fn(A) -> B + Sync,
) -> impl Iterator<Item = B> {
    let mut ready = Vec::new().into_iter();
    std::iter::from_fn(move || {
        if ready.len() == 0 {
            let turn: Vec<A> = items.by_ref().take(rayon::current_num_threads()).collect();
            ready = threads::collect_owned(turn, &work).into_iter();
        }
        ready.next()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_results_come_in_order_whatever_fits() {
        for memory in [0, 1, 70, u64::MAX] {
            let squares: Vec<usize> = InOrder::new(100, 10, memory, |k| k * k).collect();
            assert!(squares.iter().enumerate().all(|(k, &square)| square == k * k));
            assert_eq!(squares.len(), 100);
        }
        assert_eq!(InOrder::new(0, 0, 0, |k| k).count(), 0);
    }

    #[test]
    fn turns_keep_the_order() {
        let squares: Vec<usize> = by_turns(0..101, |k| k * k).collect();
        assert_eq!(squares, (0..101).map(|k| k * k).collect::<Vec<_>>());
        assert_eq!(by_turns(0..0, |k: usize| k).count(), 0);
    }

    #[test]
    fn no_more_is_computed_than_fits() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let n_done = AtomicUsize::new(0);
        let work = |_| n_done.fetch_add(1, Ordering::Relaxed);
        let window = rayon::current_num_threads() + 3;
        let mut results = InOrder::new(1000, 8, 8 * window as u64, work);
        for n_taken in 1..=1000 {
            assert!(results.next().is_some());
            assert!(n_done.load(Ordering::Relaxed) < n_taken + window);
        }
    }
}
