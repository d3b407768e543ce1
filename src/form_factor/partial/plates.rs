//! Convex planar polygons, and a tree of balls around them.

use glam::DVec3;

use crate::geometry::polygon;

/// Plates in a leaf of the tree, at most.
const LEAF: usize = 4;

/// A convex planar polygon.
pub(super) struct Plate {
    pub(super) corners: Vec<DVec3>,
    pub(super) normal: DVec3,
    pub(super) ball: Ball,
}

/// A ball around something.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) middle: DVec3,
    pub(super) radius: f64,
}

impl Plate {
    pub(super) fn new(corners: Vec<DVec3>) -> Self {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        Self {
            normal: polygon::area_vector(&corners).normalize_or_zero(),
            ball: Ball {
                radius: corners.iter().map(|v| v.distance(middle)).fold(0.0, f64::max),
                middle,
            },
            corners,
        }
    }

    /// From a point of the plane: far from the origin n · x has fewer digits than a difference of points.
    pub(super) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }
}

impl Ball {
    /// Returns whether two balls come nearer to each other than `gap`.
    pub(super) fn is_near(&self, other: &Self, gap: f64) -> bool {
        self.middle.distance(other.middle) <= self.radius + other.radius + gap
    }

    /// Returns whether a half-line comes nearer to the ball than `gap`; `direction` is a unit vector.
    pub(super) fn is_met(&self, start: DVec3, direction: DVec3, gap: f64) -> bool {
        let towards = self.middle - start;
        let along = towards.dot(direction).max(0.0);
        (towards - along * direction).length() <= self.radius + gap
    }
}

/// A node of a [`BallTree`].
struct Node {
    ball: Ball,
    /// The range of `order` below this node.
    first: usize,
    end: usize,
    /// The second child, or 0 for a leaf; the first child is the next node.
    second: usize,
}

/// Balls in a binary tree, cut at the median of the longest side.
#[derive(Default)]
pub(super) struct BallTree {
    nodes: Vec<Node>,
    order: Vec<usize>,
}

impl BallTree {
    pub(super) fn new(balls: &[Ball]) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..balls.len()).collect(),
        };
        if !balls.is_empty() {
            tree.grow(balls, 0, balls.len());
        }
        tree
    }

    fn grow(&mut self, balls: &[Ball], first: usize, end: usize) {
        let own = &mut self.order[first..end];
        let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let middles = own.iter().map(|&k| balls[k].middle);
        let (low, high) = middles.fold(all, |(low, high), v| (low.min(v), high.max(v)));
        let middle = 0.5 * (low + high);
        let reach = |&k: &usize| balls[k].middle.distance(middle) + balls[k].radius;
        let radius = own.iter().map(reach).fold(0.0, f64::max);
        let node = self.nodes.len();
        self.nodes.push(Node {
            ball: Ball { middle, radius },
            first,
            end,
            second: 0,
        });
        if own.len() <= LEAF {
            return;
        }
        let axis = (high - low).max_position();
        let half = own.len() / 2;
        own.select_nth_unstable_by(half, |&a, &b| balls[a].middle[axis].total_cmp(&balls[b].middle[axis]));
        self.grow(balls, first, first + half);
        self.nodes[node].second = self.nodes.len();
        self.grow(balls, first + half, end);
    }

    /// Calls `visit` for each ball in those nodes that are `wanted`, by their number and ball.
    pub(super) fn visit(&self, wanted: impl Fn(usize, &Ball) -> bool, mut visit: impl FnMut(usize)) {
        let mut stack = [0_usize; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index];
            if !wanted(index, &node.ball) {
                continue;
            }
            if node.second == 0 {
                self.order[node.first..node.end].iter().for_each(|&k| visit(k));
            } else {
                stack[depth] = node.second;
                stack[depth + 1] = index + 1;
                depth += 2;
            }
        }
    }
}
