//! All pairs of boxes that overlap, and all boxes that overlap another one, without looking at all of them.

use std::ops::ControlFlow;

use glam::DVec3;

/// A group of at most this many boxes is not split.
const LEAF: usize = 8;

/// A tree of groups of boxes.
#[derive(Clone, Debug)]
struct Group {
    low: DVec3,
    high: DVec3,
    content: Content,
}

#[derive(Clone, Debug)]
enum Content {
    Faces(Vec<u32>),
    Halves(Box<[Group; 2]>),
}

/// Calls `visit` once for each pair of boxes that overlap or touch, by their places in the list; each is its least and its greatest corner.
///
/// Work: O(n log n) and the number of pairs, for boxes that are small beside the space that they fill.
pub(crate) fn overlapping_pairs(boxes: Vec<(DVec3, DVec3)>, mut visit: impl FnMut(u32, u32)) {
    let boxes = Boxes(boxes);
    if let Ok(n) = u32::try_from(boxes.0.len()) {
        boxes.within(&boxes.group((0..n).collect()), &mut visit);
    }
}

/// Boxes that are asked for one at a time which of them overlap another one.
#[derive(Clone, Debug)]
pub(crate) struct BoxTree {
    boxes: Boxes,
    root: Group,
}

impl BoxTree {
    /// Takes the boxes by their least and greatest corners. Work: O(n log n).
    pub(crate) fn new(boxes: Vec<(DVec3, DVec3)>) -> Self {
        let boxes = Boxes(boxes);
        let root = boxes.group((0..).take(boxes.0.len()).collect());
        Self { boxes, root }
    }

    /// Calls `visit` once for each of the boxes that overlaps or touches `other`, by its place in the list.
    ///
    /// Work: O(log n) and the number of boxes found, for boxes that are small beside the space that they fill.
    pub(crate) fn overlapping(&self, other: (DVec3, DVec3), visit: &mut impl FnMut(u32)) {
        // Nothing breaks off.
        let _ = self.meeting(&|own| overlap(own, other), &mut |k| {
            visit(k);
            ControlFlow::Continue(())
        });
    }

    /// Calls `visit` once for each of the boxes that meets something, by its place in the list, until it breaks: `meets` tells it of a box, and of each box around several.
    pub(crate) fn meeting(
        &self,
        meets: &impl Fn((DVec3, DVec3)) -> bool,
        visit: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.boxes.meeting(&self.root, meets, visit)
    }
}

#[derive(Clone, Debug)]
struct Boxes(Vec<(DVec3, DVec3)>);

impl Boxes {
    fn group(&self, mut faces: Vec<u32>) -> Group {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = faces.iter().fold(empty, |(low, high), &face| {
            let (l, h) = self.0[face as usize];
            (low.min(l), high.max(h))
        });
        let content = if faces.len() <= LEAF {
            Content::Faces(faces)
        } else {
            let axis = (high - low).max_position();
            let middle = faces.len() / 2;
            let twice_centre = |&face: &u32| self.0[face as usize].0[axis] + self.0[face as usize].1[axis];
            faces.select_nth_unstable_by(middle, |a, b| twice_centre(a).total_cmp(&twice_centre(b)));
            let upper = faces.split_off(middle);
            Content::Halves(Box::new([self.group(faces), self.group(upper)]))
        };
        Group { low, high, content }
    }

    /// Visits the pairs within one group.
    fn within(&self, group: &Group, visit: &mut impl FnMut(u32, u32)) {
        match &group.content {
            Content::Faces(faces) => {
                for (i, &a) in faces.iter().enumerate() {
                    faces[i + 1..].iter().for_each(|&b| self.pair(a, b, visit));
                }
            }
            Content::Halves(halves) => {
                self.within(&halves[0], visit);
                self.within(&halves[1], visit);
                self.between(&halves[0], &halves[1], visit);
            }
        }
    }

    /// Visits the pairs with one face in each of two groups.
    fn between(&self, a: &Group, b: &Group, visit: &mut impl FnMut(u32, u32)) {
        if !overlap((a.low, a.high), (b.low, b.high)) {
            return;
        }
        match (&a.content, &b.content) {
            (Content::Faces(of_a), Content::Faces(of_b)) => {
                for &face in of_a {
                    for &other in of_b {
                        self.pair(face, other, visit);
                    }
                }
            }
            (Content::Halves(halves), Content::Faces(_)) => halves.iter().for_each(|half| self.between(half, b, visit)),
            (Content::Faces(_), Content::Halves(halves)) => halves.iter().for_each(|half| self.between(a, half, visit)),
            (Content::Halves(of_a), Content::Halves(of_b)) => {
                for half in of_a.iter() {
                    of_b.iter().for_each(|other| self.between(half, other, visit));
                }
            }
        }
    }

    /// Visits the faces of a group whose boxes meet something.
    fn meeting(
        &self,
        group: &Group,
        meets: &impl Fn((DVec3, DVec3)) -> bool,
        visit: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if !meets((group.low, group.high)) {
            return ControlFlow::Continue(());
        }
        match &group.content {
            Content::Faces(faces) => {
                let mut found = faces.iter().filter(|&&face| meets(self.0[face as usize]));
                found.try_for_each(|&face| visit(face))
            }
            Content::Halves(halves) => halves.iter().try_for_each(|half| self.meeting(half, meets, visit)),
        }
    }

    fn pair(&self, a: u32, b: u32, visit: &mut impl FnMut(u32, u32)) {
        if overlap(self.0[a as usize], self.0[b as usize]) {
            visit(a, b);
        }
    }
}

fn overlap(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> bool {
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
