//! A union-find structure.

/// Disjoint sets of the numbers below n, joined in pairs; the least member represents its set.
///
/// Union by least member with path halving: O(log n) amortised a call (Tarjan and van Leeuwen 1984).
#[derive(Clone, Debug)]
pub(crate) struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// Returns n sets of one member each.
    ///
    /// # Panics
    ///
    /// Panics if n is above 2³².
    pub(crate) fn new(n: usize) -> Self {
        let parent: Vec<u32> = (0..=u32::MAX).take(n).collect();
        assert_eq!(parent.len(), n, "members are counted in 32 bits");
        Self { parent }
    }

    /// Returns the least member of the set of `x`.
    pub(crate) fn find(&mut self, mut x: usize) -> usize {
        while self.parent[x] as usize != x {
            self.parent[x] = self.parent[self.parent[x] as usize];
            x = self.parent[x] as usize;
        }
        x
    }

    /// Joins the sets of two members; returns false if they were the same set.
    pub(crate) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b)] = self.parent[a.min(b)];
        a != b
    }
}
