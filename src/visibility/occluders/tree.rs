//! A tree of boxes around polygons, in f64.

use glam::DVec3;

use super::super::shaft::Shaft;

/// A leaf holds at most this many polygons.
const LEAF: usize = 4;

#[derive(Clone, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The range of `order` below this node.
    first: u32,
    end: u32,
    /// The second child, or 0 for a leaf; the first child is the next node.
    second: u32,
}

/// Boxes in a binary tree, cut at the median of the longest side.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

impl Tree {
    pub(super) fn new(boxes: &[(DVec3, DVec3)]) -> Self {
        let n = u32::try_from(boxes.len()).unwrap_or(u32::MAX);
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..n).collect(),
        };
        if n > 0 {
            tree.grow(boxes, 0, n);
        }
        tree
    }

    fn grow(&mut self, boxes: &[(DVec3, DVec3)], first: u32, end: u32) {
        let range = first as usize..end as usize;
        let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = self.order[range.clone()].iter().fold(all, |(low, high), &k| {
            let (l, h) = boxes[k as usize];
            (low.min(l), high.max(h))
        });
        let node = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            first,
            end,
            second: 0,
        });
        if range.len() <= LEAF {
            return;
        }
        let axis = (high - low).max_position();
        let twice_centre = |&k: &u32| boxes[k as usize].0[axis] + boxes[k as usize].1[axis];
        let half = range.len() / 2;
        self.order[range].select_nth_unstable_by(half, |a, b| twice_centre(a).total_cmp(&twice_centre(b)));
        let middle = u32::midpoint(first, end);
        self.grow(boxes, first, middle);
        self.nodes[node].second = u32::try_from(self.nodes.len()).unwrap_or(0);
        self.grow(boxes, middle, end);
    }

    /// Returns the root; `None` without polygons.
    pub(super) fn root(&self) -> Option<u32> {
        (!self.nodes.is_empty()).then_some(0)
    }

    /// Returns the box around a node.
    pub(super) fn bounds(&self, node: u32) -> (DVec3, DVec3) {
        let node = &self.nodes[node as usize];
        (node.low, node.high)
    }

    /// Returns both children of a node that is not a leaf.
    pub(super) fn halves(&self, node: u32) -> Option<[u32; 2]> {
        let second = self.nodes[node as usize].second;
        (second > 0).then_some([node + 1, second])
    }

    /// Returns the polygons below a node.
    pub(super) fn polygons(&self, node: u32) -> &[u32] {
        let node = &self.nodes[node as usize];
        &self.order[node.first as usize..node.end as usize]
    }

    /// Calls `visit` for each polygon in the boxes that may meet a shaft; stops where it returns false.
    pub(super) fn visit(&self, shaft: &Shaft<'_>, mut visit: impl FnMut(u32) -> bool) {
        let mut stack = [0_u32; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index as usize];
            if !shaft.may_meet_box(node.low, node.high) {
                continue;
            }
            if node.second == 0 {
                let polygons = &self.order[node.first as usize..node.end as usize];
                if !polygons.iter().all(|&k| visit(k)) {
                    return;
                }
            } else {
                stack[depth] = node.second;
                stack[depth + 1] = index + 1;
                depth += 2;
            }
        }
    }
}
