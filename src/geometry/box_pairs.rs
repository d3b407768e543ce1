//! All pairs of boxes that overlap, and all boxes that overlap another one, found without visiting all.

use std::ops::ControlFlow;

use glam::DVec3;

/// A group of at most this many boxes is not split.
const LEAF: usize = 4;

/// The number of boxes below a node from which on threads share the work.
const PARALLEL: usize = 1 << 12;

/// Some boxes: a range of the tree's order.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    first: u32,
    end: u32,
    /// The second half, or 0 for boxes that are not split; the first half is the next node.
    second: u32,
}

impl Node {
    const NONE: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        first: 0,
        end: 0,
        second: 0,
    };

    fn len(&self) -> usize {
        (self.end - self.first) as usize
    }
}

/// Calls `visit` once for each pair of boxes that overlap or touch, by their places in the list; each is its least and its greatest corner.
///
/// Work: O(n log n) and the number of pairs, for boxes that are small beside the space that they fill.
pub(crate) fn overlapping_pairs(boxes: Vec<(DVec3, DVec3)>, mut visit: impl FnMut(u32, u32)) {
    BoxTree::new(boxes).within(0, &mut visit);
}

/// Returns the results of `visit` for the pairs of [`overlapping_pairs`], in their order whatever the number of threads.
pub(crate) fn collected_pairs<T: Send>(
    boxes: Vec<(DVec3, DVec3)>,
    visit: impl Fn(u32, u32, &mut Vec<T>) + Sync,
) -> Vec<T> {
    BoxTree::new(boxes).collected_within(0, &visit)
}

/// Boxes in a binary tree, cut at the median of the longest side.
#[derive(Clone, Debug)]
pub(crate) struct BoxTree {
    boxes: Vec<(DVec3, DVec3)>,
    /// The places of all boxes, so that those of a node are neighbours.
    order: Vec<u32>,
    /// The root is the first; none without boxes.
    nodes: Vec<Node>,
}

/// Returns the number of nodes of the tree of `n` boxes.
fn n_nodes(n: usize) -> usize {
    if n <= LEAF {
        1
    } else {
        1 + n_nodes(n / 2) + n_nodes(n - n / 2)
    }
}

impl BoxTree {
    /// Builds the tree of boxes given by their least and greatest corners. Work: O(n log n).
    pub(crate) fn new(boxes: Vec<(DVec3, DVec3)>) -> Self {
        let n = u32::try_from(boxes.len()).unwrap_or(0);
        let mut order: Vec<u32> = (0..n).collect();
        let mut nodes = Vec::new();
        if n > 0 {
            nodes.resize(n_nodes(n as usize), Node::NONE);
            grow(&boxes, &mut order, 0, &mut nodes, 0);
        }
        Self { boxes, order, nodes }
    }

    /// Calls `visit` once for each of the boxes that overlaps or touches `other`, by its place in the list.
    ///
    /// Work: O(log n) and the number of boxes found, for boxes that are small beside the space that they fill.
    pub(crate) fn overlapping(&self, other: (DVec3, DVec3), visit: &mut impl FnMut(u32)) {
        // The search visits all.
        let _: ControlFlow<()> = self.meeting(&|own| overlap(own, other), &mut |k| {
            visit(k);
            ControlFlow::Continue(())
        });
    }

    /// Calls `visit` once for each box for which `meets` is true, by its place in the list, until it breaks.
    ///
    /// `meets` is called with single boxes, and with boxes around several.
    pub(crate) fn meeting<T>(
        &self,
        meets: &impl Fn((DVec3, DVec3)) -> bool,
        visit: &mut impl FnMut(u32) -> ControlFlow<T>,
    ) -> ControlFlow<T> {
        let root = self.root();
        root.map_or(ControlFlow::Continue(()), |root| self.meeting_below(root, meets, visit))
    }

    fn meeting_below<T>(
        &self,
        index: usize,
        meets: &impl Fn((DVec3, DVec3)) -> bool,
        visit: &mut impl FnMut(u32) -> ControlFlow<T>,
    ) -> ControlFlow<T> {
        let node = &self.nodes[index];
        if !meets((node.low, node.high)) {
            return ControlFlow::Continue(());
        }
        if let Some(halves) = self.halves(index) {
            let mut halves = halves.into_iter();
            return halves.try_for_each(|half| self.meeting_below(half, meets, visit));
        }
        let mut found = self.below(node).iter().filter(|&&k| meets(self.boxes[k as usize]));
        found.try_for_each(|&k| visit(k))
    }

    /// Returns the root; `None` without boxes.
    pub(crate) fn root(&self) -> Option<usize> {
        (!self.nodes.is_empty()).then_some(0)
    }

    /// Returns the box around a node.
    pub(crate) fn around(&self, index: usize) -> (DVec3, DVec3) {
        let node = &self.nodes[index];
        (node.low, node.high)
    }

    /// Returns both children of a node that is split.
    pub(crate) fn halves(&self, index: usize) -> Option<[usize; 2]> {
        let second = self.nodes.get(index)?.second as usize;
        (second > 0).then_some([index + 1, second])
    }

    /// Returns the boxes below a node, by their places in the list.
    pub(crate) fn boxes_below(&self, index: usize) -> &[u32] {
        self.below(&self.nodes[index])
    }

    fn below(&self, node: &Node) -> &[u32] {
        &self.order[node.first as usize..node.end as usize]
    }

    /// Visits the pairs below one node.
    fn within(&self, index: usize, visit: &mut impl FnMut(u32, u32)) {
        let Some(node) = self.nodes.get(index) else {
            return;
        };
        if let Some([first, second]) = self.halves(index) {
            self.within(first, visit);
            self.within(second, visit);
            self.between(first, second, visit);
        } else {
            let own = self.below(node);
            for (i, &a) in own.iter().enumerate() {
                own[i + 1..].iter().for_each(|&b| self.pair(a, b, visit));
            }
        }
    }

    /// Visits the pairs with one box below each of two nodes.
    fn between(&self, a: usize, b: usize, visit: &mut impl FnMut(u32, u32)) {
        let [of_a, of_b] = [a, b].map(|k| &self.nodes[k]);
        if !overlap((of_a.low, of_a.high), (of_b.low, of_b.high)) {
            return;
        }
        match (self.halves(a), self.halves(b)) {
            (None, None) => {
                for &one in self.below(of_a) {
                    for &other in self.below(of_b) {
                        self.pair(one, other, visit);
                    }
                }
            }
            (Some(halves), None) => halves.iter().for_each(|&half| self.between(half, b, visit)),
            (None, Some(halves)) => halves.iter().for_each(|&half| self.between(a, half, visit)),
            (Some(halves_a), Some(halves_b)) => {
                for half in halves_a {
                    for other in halves_b {
                        self.between(half, other, visit);
                    }
                }
            }
        }
    }

    fn collected_within<T: Send>(&self, index: usize, visit: &(impl Fn(u32, u32, &mut Vec<T>) + Sync)) -> Vec<T> {
        let halves = self.halves(index).filter(|_| self.nodes[index].len() >= PARALLEL);
        let Some([first, second]) = halves else {
            let mut found = Vec::new();
            self.within(index, &mut |a, b| visit(a, b, &mut found));
            return found;
        };
        let (mut found, (mut of_second, mut of_both)) = rayon::join(
            || self.collected_within(first, visit),
            || {
                rayon::join(
                    || self.collected_within(second, visit),
                    || {
                        let mut of_both = Vec::new();
                        self.between(first, second, &mut |a, b| visit(a, b, &mut of_both));
                        of_both
                    },
                )
            },
        );
        found.append(&mut of_second);
        found.append(&mut of_both);
        found
    }

    fn pair(&self, a: u32, b: u32, visit: &mut impl FnMut(u32, u32)) {
        if overlap(self.boxes[a as usize], self.boxes[b as usize]) {
            visit(a, b);
        }
    }
}

/// Fills the nodes of a subtree whose boxes are in `order`; `first` is the place of its first box and `at` the number of its root.
fn grow(boxes: &[(DVec3, DVec3)], order: &mut [u32], first: u32, nodes: &mut [Node], at: usize) {
    let (low, high) = order.iter().fold((Node::NONE.low, Node::NONE.high), |(low, high), &k| {
        let (l, h) = boxes[k as usize];
        (low.min(l), high.max(h))
    });
    let n = order.len();
    let as_u32 = |k: usize| u32::try_from(k).expect("boxes are counted in 32 bits");
    let (root, below) = nodes.split_first_mut().expect("as many nodes as the tree has");
    *root = Node {
        low,
        high,
        first,
        end: first + as_u32(n),
        second: 0,
    };
    if n <= LEAF {
        return;
    }
    let (axis, middle) = ((high - low).max_position(), n / 2);
    let twice_centre = |&k: &u32| boxes[k as usize].0[axis] + boxes[k as usize].1[axis];
    order.select_nth_unstable_by(middle, |a, b| twice_centre(a).total_cmp(&twice_centre(b)));
    let (lower, upper) = order.split_at_mut(middle);
    let n_lower = n_nodes(middle);
    let second = at + 1 + n_lower;
    root.second = as_u32(second);
    let (of_lower, of_upper) = below.split_at_mut(n_lower);
    let first_of_upper = first + as_u32(middle);
    let mut halves = (
        || grow(boxes, lower, first, of_lower, at + 1),
        || grow(boxes, upper, first_of_upper, of_upper, second),
    );
    if n >= PARALLEL {
        rayon::join(halves.0, halves.1);
    } else {
        halves.0();
        halves.1();
    }
}

/// Returns whether two boxes overlap or touch.
pub(crate) fn overlap(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> bool {
    a.0.cmple(b.1).all() && b.0.cmple(a.1).all()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Boxes of very different sizes.
    fn boxes() -> Vec<(DVec3, DVec3)> {
        (0..300)
            .map(|i| {
                let x = f64::from(i * 37 % 41);
                let y = f64::from(i * 59 % 43);
                let size = f64::from(1 + i * 17 % 23) * if i % 50 == 0 { 3.0 } else { 0.4 };
                let corner = DVec3::new(x, y, 0.1 * x);
                (corner, corner + size)
            })
            .collect()
    }

    #[test]
    fn the_pairs_are_those_of_a_double_loop_each_once() {
        let boxes = boxes();
        let mut found = Vec::new();
        overlapping_pairs(boxes.clone(), |a, b| found.push((a.min(b), a.max(b))));
        let mut expected = BTreeSet::new();
        for a in 0..300_u32 {
            for b in a + 1..300 {
                if overlap(boxes[a as usize], boxes[b as usize]) {
                    expected.insert((a, b));
                }
            }
        }
        assert!(
            expected.len() > 1000 && expected.len() < 300 * 299 / 4,
            "the test tells pairs apart"
        );
        assert_eq!(found.len(), expected.len());
        assert_eq!(found.into_iter().collect::<BTreeSet<_>>(), expected);
    }

    #[test]
    fn pairs_that_are_collected_come_in_the_order_of_those_that_are_visited() {
        let mut many = Vec::new();
        for k in 0..40_u32 {
            let by = DVec3::splat(1.7 * f64::from(k));
            many.extend(boxes().into_iter().map(|(low, high)| (low + by, high + by)));
        }
        assert!(many.len() > 2 * PARALLEL);
        for n in [0, 1, 9, many.len()] {
            let mut visited = Vec::new();
            overlapping_pairs(many[..n].to_vec(), |a, b| visited.push((a, b)));
            let collected = collected_pairs(many[..n].to_vec(), |a, b, found| found.push((a, b)));
            assert_eq!(collected, visited, "{n}");
        }
    }

    #[test]
    fn a_search_that_breaks_visits_no_more() {
        let tree = BoxTree::new(boxes());
        for n in [1, 2, 150] {
            let mut visited = 0;
            let ended = tree.meeting(&|_| true, &mut |_| {
                visited += 1;
                if visited < n {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                }
            });
            assert_eq!((visited, ended), (n, ControlFlow::Break(())));
        }
    }

    #[test]
    fn a_tree_finds_what_a_loop_finds_each_once() {
        let boxes = boxes();
        for n in [0, 1, 7, 300] {
            let tree = BoxTree::new(boxes[..n].to_vec());
            for &other in &boxes {
                let mut found = Vec::new();
                tree.overlapping(other, &mut |k| found.push(k as usize));
                found.sort_unstable();
                let expected: Vec<usize> = (0..n).filter(|&k| overlap(boxes[k], other)).collect();
                assert_eq!(found, expected);
            }
        }
    }
}
