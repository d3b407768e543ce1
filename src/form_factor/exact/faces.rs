//! The pairs of faces that may see each other, found without visiting all pairs.

use std::ops::Range;

use glam::DVec3;

use super::patches::Patches;
use crate::form_factor::facing::Facing;

/// A leaf holds at most this many faces.
const LEAF: usize = 4;

/// Some faces: the box around their corners, and that around their normals.
struct Node {
    corners: (DVec3, DVec3),
    normals: (DVec3, DVec3),
    /// The range of `order` below this node.
    faces: Range<usize>,
    /// The greatest number of a face below this node.
    last: usize,
    /// The second child, or 0 for a leaf; the first child is the next node.
    second: usize,
}

/// Faces in a binary tree, cut at the median of the longest side of a box: of positions where the normals are much alike, else of normals.
pub(super) struct FaceTree {
    nodes: Vec<Node>,
    order: Vec<usize>,
    corners: Vec<(DVec3, DVec3)>,
    normals: Vec<DVec3>,
}

fn around(points: impl Iterator<Item = (DVec3, DVec3)>) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points.fold(none, |(low, high), (l, h)| (low.min(l), high.max(h)))
}

impl FaceTree {
    pub(super) fn new(patches: &Patches, facing: &Facing) -> Self {
        let faces = &patches.faces;
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..faces.len()).collect(),
            corners: faces
                .iter()
                .map(|face| around(patches.corners[face.range()].iter().flatten().map(|&v| (v, v))))
                .collect(),
            normals: faces.iter().map(|face| facing.normal(face.range().start)).collect(),
        };
        if !faces.is_empty() {
            tree.grow(0..faces.len());
        }
        tree
    }

    fn grow(&mut self, range: Range<usize>) {
        let own = &self.order[range.clone()];
        let corners = around(own.iter().map(|&f| self.corners[f]));
        let normals = around(own.iter().map(|&f| (self.normals[f], self.normals[f])));
        let index = self.nodes.len();
        self.nodes.push(Node {
            corners,
            normals,
            faces: range.clone(),
            last: own.iter().copied().max().unwrap_or(0),
            second: 0,
        });
        if range.len() <= LEAF {
            return;
        }
        let middle = range.len() / 2;
        let (size, spread) = (corners.1 - corners.0, normals.1 - normals.0);
        let whole = self.nodes[0].corners.1 - self.nodes[0].corners.0;
        // Both relative to their greatest value: the scene's size, and the diameter of the sphere of normals.
        let by_place = size.max_element() * 2.0 >= spread.max_element() * whole.max_element();
        let key = |f: usize| {
            if by_place {
                let (low, high) = self.corners[f];
                (low + high)[size.max_position()]
            } else {
                self.normals[f][spread.max_position()]
            }
        };
        self.order[range.clone()].select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        self.grow(range.start..range.start + middle);
        self.nodes[index].second = self.nodes.len();
        self.grow(range.start + middle..range.end);
    }

    /// Returns whether no face below a node comes after `f` and may face it.
    pub(super) fn is_behind(&self, f: usize, node: usize) -> bool {
        let Some(node) = self.nodes.get(node) else {
            return true;
        };
        let (own, normal) = (self.corners[f], self.normals[f]);
        // From the node's faces to this one, and back.
        let to = (own.0 - node.corners.1, own.1 - node.corners.0);
        let back = (-to.1, -to.0);
        node.last <= f || highest(node.normals, to) <= 0.0 || highest((normal, normal), back) <= 0.0
    }

    /// Returns both children of a node that is not a leaf.
    pub(super) fn halves(&self, node: usize) -> Option<[usize; 2]> {
        let second = self.nodes[node].second;
        (second > 0).then_some([node + 1, second])
    }

    /// Returns the box around the faces below a node.
    pub(super) fn bounds(&self, node: usize) -> (DVec3, DVec3) {
        self.nodes[node].corners
    }

    /// Returns the faces below a node.
    pub(super) fn faces(&self, node: usize) -> &[usize] {
        &self.order[self.nodes[node].faces.clone()]
    }
}

/// Returns a bound from above of n · d for n and d in two boxes.
fn highest(n: (DVec3, DVec3), d: (DVec3, DVec3)) -> f64 {
    (n.0 * d.0).max(n.0 * d.1).max(n.1 * d.0).max(n.1 * d.1).element_sum()
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, Subdivision};
    use crate::scene::builtin;

    #[test]
    fn no_faces_that_face_each_other_are_missed_and_few_others_found() {
        // Leaves of four faces are much of a scene of twelve.
        for (name, n, most) in [
            ("sphere-room-r1", 1, 1.2),
            ("cornell-box", 3, 1.6),
            ("room-box", 2, 1.6),
        ] {
            let scene = builtin::build(name, None).unwrap().scene;
            let mesh = Mesh::new(&scene, Subdivision::Uniform(n)).unwrap();
            let facing = Facing::new(&mesh);
            let patches = Patches::new(&mesh, &facing, true);
            let tree = FaceTree::new(&patches, &facing);
            let (mut n_found, mut n_facing) = (0, 0);
            for f in 0..patches.faces.len() {
                let mut found = Vec::new();
                let mut nodes = vec![0];
                while let Some(node) = nodes.pop() {
                    if tree.is_behind(f, node) {
                        continue;
                    }
                    match tree.halves(node) {
                        Some(halves) => nodes.extend(halves),
                        None => found.extend(tree.faces(node).iter().copied().filter(|&g| g > f)),
                    }
                }
                found.sort_unstable();
                let any = |g: usize| facing.any(patches.faces[f].range(), patches.faces[g].range());
                let exact: Vec<usize> = (f + 1..patches.faces.len()).filter(|&g| any(g)).collect();
                assert!(exact.iter().all(|g| found.binary_search(g).is_ok()), "{name} {f}");
                n_found += found.len();
                n_facing += exact.len();
            }
            assert!(
                n_found as f64 <= most * n_facing as f64,
                "{name}: {n_found} for {n_facing}"
            );
        }
    }
}
