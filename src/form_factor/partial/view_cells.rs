//! The directions around a point, divided into cells until few faces remain in each.
//!
//! Six pyramids about the axes fill all directions. A cell is halved as long as that is expected to save work, counted in tests of a patch against a face that may hide it. Where one face fills a cell, everything beyond
//! it there is hidden and left out, so that the work depends on the visible faces. In the remaining cells, every patch is cut by each face that may hide a part of it.
//! Source: J. E. Warnock, "A Hidden Surface Algorithm for Computer Generated Halftone Pictures", University of Utah, 1969. Departures: pyramids of directions instead of windows of a screen, and exact cuts
//! instead of pixels at the end.

use std::f64::consts::PI;
use std::ops::Range;

use glam::DVec3;

use super::free_point::{PointViews, SeenPart};
use super::plates::{Ball, Plate};
use super::pyramids::{Cell, Extent, ON_SIDE};
use super::shadow::{Fragments, HalfSpace, subtract};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;

/// The greatest number of faces that may hide something in a cell that is not divided.
const FEW: usize = 4;

/// The work of a polygon in a cell, in tests of a pair.
const LOOKS: usize = 4;

/// The most halvings of one of the six pyramids: about a corner of many faces they would not end.
const MAX_HALVINGS: u32 = 20;

/// Buffers of the views from points.
#[derive(Default)]
pub(crate) struct Scratch {
    half_spaces: Vec<HalfSpace>,
    /// The half-spaces of each occluder's pyramid, its plane last.
    ///
    /// Empty for occluders that hide nothing beyond others: the far sides of solids, and faces seen edge-on.
    pyramids: Vec<Range<usize>>,
    /// The distance of each occluder that hides a part of something, m.
    distances: Vec<Option<f64>>,
    items: Vec<Item>,
    /// Balls around the items of no cell, as seen from the point.
    balls: Vec<Ball>,
    corners: Vec<DVec3>,
    whole: Vec<DVec3>,
    cutting: Cutting,
}

/// Buffers of the cutting of one polygon.
#[derive(Default)]
struct Cutting {
    fragments: Fragments,
    next: Fragments,
    rest: Vec<DVec3>,
    piece: Vec<DVec3>,
    cover: Vec<HalfSpace>,
}

/// A polygon in a cell: an occluder, a patch, or an occluder that is one patch.
#[derive(Clone, Debug)]
struct Item {
    /// The occluder, or the one that the patch is a part of.
    own: usize,
    hides: bool,
    /// Whether it fills the cell.
    fills: bool,
    /// The patch, and whether it is seen from behind.
    patch: Option<(usize, bool)>,
    /// Corners as seen from the point, counter-clockwise there.
    corners: Range<usize>,
    extent: Extent,
}

/// The polygons of a cell.
#[derive(Clone, Copy)]
struct Work {
    n_targets: usize,
    n_hiders: usize,
}

impl Work {
    /// Returns the expected work, in tests of a pair.
    fn cost(self) -> usize {
        if self.n_targets == 0 {
            return 0;
        }
        self.n_targets * self.n_hiders + LOOKS * (self.n_targets + self.n_hiders)
    }
}

/// A view from a point.
pub(super) struct View<'a, V> {
    views: &'a PointViews,
    point: DVec3,
    scratch: &'a mut Scratch,
    visit: V,
    /// The distance of the nearest face that hides a part of something, m.
    nearest: f64,
}

impl<'a, V: FnMut(&SeenPart<'_>)> View<'a, V> {
    /// Calls `visit` with every visible part; see [`PointViews::visit`].
    pub(super) fn look(
        views: &'a PointViews,
        (point, normal): (DVec3, Option<DVec3>),
        scratch: &'a mut Scratch,
        visit: V,
    ) -> f64 {
        let mut view = View {
            views,
            point,
            scratch,
            visit,
            nearest: f64::INFINITY,
        };
        view.gather(normal);
        let n_all = view.scratch.items.len();
        for cell in Cell::all() {
            let n_corners = view.scratch.corners.len();
            let sides = cell.sides();
            let lengths = sides.map(DVec3::length);
            for k in 0..n_all {
                let ball = &view.scratch.balls[k];
                let mut planes = sides.iter().zip(lengths);
                if planes.all(|(side, length)| side.dot(ball.middle) > -1.001 * length * ball.radius) {
                    view.put_in(k, &sides, &cell);
                }
            }
            view.leave_out_hidden(&cell, n_all);
            view.divide(&cell, n_all, MAX_HALVINGS);
            view.scratch.items.truncate(n_all);
            view.scratch.corners.truncate(n_corners);
        }
        view.nearest
    }

    /// Gathers the polygons that the point may see, with a `normal` those in front of it, and the pyramids of the occluders.
    fn gather(&mut self, normal: Option<DVec3>) {
        let (views, point) = (self.views, self.point);
        let Scratch {
            half_spaces,
            pyramids,
            distances,
            balls,
            items,
            corners,
            ..
        } = &mut *self.scratch;
        half_spaces.clear();
        pyramids.clear();
        balls.clear();
        distances.clear();
        distances.resize(views.occluders.len(), None);
        items.clear();
        corners.clear();
        let mut push = |plate: &Plate, own: usize, hides: bool, patch: Option<usize>| {
            let height = plate.height(point);
            if is_edge_on(plate, point) {
                return;
            }
            let is_back = height < 0.0;
            let start = corners.len();
            corners.extend(plate.corners.iter().map(|&v| v - point));
            if is_back {
                corners[start..].reverse();
            }
            if let Some(normal) = normal {
                let above = clip_to_half_space(&corners[start..], DVec3::ZERO, normal);
                corners.truncate(start);
                corners.extend(above);
            }
            if corners.len() < start + 3 {
                corners.truncate(start);
                return;
            }
            items.push(Item {
                own,
                hides,
                fills: false,
                patch: patch.map(|patch| (patch, is_back)),
                corners: start..corners.len(),
                extent: Extent::default(),
            });
            balls.push(Ball {
                middle: plate.ball.middle - point,
                ..plate.ball
            });
        };
        let is_outside = views.index.solids_without(point);
        for (own, (plate, patches)) in views.occluders.iter().zip(&views.patches_of).enumerate() {
            let start = half_spaces.len();
            let solid = views.solid_of[own];
            // Seen from outside, the far sides of a closed convex solid are behind its near ones.
            let is_far_side = solid.is_some_and(|solid| is_outside[solid]) && plate.height(point) < 0.0;
            if !is_far_side {
                pyramid_over(plate, point, true, half_spaces);
            }
            pyramids.push(start..half_spaces.len());
            if is_far_side {
                continue;
            }
            let hides = start < half_spaces.len();
            if let [patch] = patches[..] {
                push(&views.patches[patch], own, hides, Some(patch));
                continue;
            }
            push(plate, own, hides, None);
            for &patch in patches {
                push(&views.patches[patch], own, false, Some(patch));
            }
        }
    }

    /// Appends the part of an item that is inside of some sides of a cell to the items, if there is any.
    fn put_in(&mut self, k: usize, sides: &[DVec3], cell: &Cell) {
        let Scratch {
            items,
            corners,
            whole,
            cutting: Cutting { rest, .. },
            ..
        } = &mut *self.scratch;
        whole.clear();
        whole.extend_from_slice(&corners[items[k].corners.clone()]);
        for &side in sides {
            match keep_inside(whole, side, rest) {
                Kept::Nothing => return,
                Kept::Part => std::mem::swap(whole, rest),
                Kept::All => {}
            }
        }
        let start = corners.len();
        corners.extend_from_slice(whole);
        items.push(Item {
            corners: start..corners.len(),
            extent: cell.range(whole),
            ..items[k].clone()
        });
    }

    /// Divides a cell, whose items are those from `first` on, without the items hidden there.
    fn divide(&mut self, cell: &Cell, first: usize, halvings: u32) {
        let whole = self.work_of(first);
        if whole.n_targets == 0 {
            return;
        }
        if halvings == 0 || whole.n_hiders <= FEW {
            self.cut(cell, first);
            return;
        }
        let (end, n_corners) = (self.scratch.items.len(), self.scratch.corners.len());
        let (axis, halves) = cell.halves();
        let [(one, _), (other, _)] = halves;
        self.put_in_half(first..end, axis, &halves[0]);
        self.leave_out_hidden(&one, end);
        let (middle, first_work) = (self.scratch.items.len(), self.work_of(end));
        self.put_in_half(first..end, axis, &halves[1]);
        self.leave_out_hidden(&other, middle);
        if first_work.cost() + self.work_of(middle).cost() < whole.cost() {
            self.divide(&other, middle, halvings - 1);
            self.scratch.items.truncate(middle);
            self.divide(&one, end, halvings - 1);
            self.scratch.items.truncate(end);
        } else {
            self.scratch.items.truncate(end);
            self.cut(cell, first);
        }
        self.scratch.corners.truncate(n_corners);
    }

    fn work_of(&self, first: usize) -> Work {
        let items = &self.scratch.items[first..];
        Work {
            n_targets: items.iter().filter(|item| item.patch.is_some()).count(),
            n_hiders: items.iter().filter(|item| item.hides).count(),
        }
    }

    /// Appends the parts of some items in one half of a cell that is cut across `axis`.
    fn put_in_half(&mut self, items: Range<usize>, axis: usize, (half, side): &(Cell, DVec3)) {
        for k in items {
            let extent = &self.scratch.items[k].extent;
            if extent.high[axis] <= half.low[axis] || extent.low[axis] >= half.high[axis] {
                continue;
            }
            if extent.low[axis] >= half.low[axis] && extent.high[axis] <= half.high[axis] {
                self.scratch.items.push(self.scratch.items[k].clone());
            } else {
                self.put_in(k, &[*side], half);
            }
        }
    }

    /// Leaves out the items beyond a face that fills the cell.
    fn leave_out_hidden(&mut self, cell: &Cell, first: usize) {
        let Scratch {
            half_spaces,
            pyramids,
            items,
            corners,
            ..
        } = &mut *self.scratch;
        let of_cell = cell.corners();
        let mut nearest: Option<(usize, f64)> = None;
        for item in items[first..].iter_mut().filter(|item| item.hides) {
            if !item.fills && item.extent.spans(cell) {
                let pyramid = &half_spaces[pyramids[item.own].clone()];
                let edges = &pyramid[..pyramid.len() - 1];
                item.fills = edges.iter().all(|edge| of_cell.iter().all(|&v| edge.value(v) >= 0.0));
            }
            if item.fills && nearest.is_none_or(|(_, far)| item.extent.far < far) {
                nearest = Some((item.own, item.extent.far));
            }
        }
        let Some((own, _)) = nearest else {
            return;
        };
        let beyond = half_spaces[pyramids[own].end - 1];
        let is_hidden = |item: &Item| {
            let mut deepest = 0.0;
            let mut is_beyond = |&v: &DVec3| {
                let depth = beyond.value(v);
                deepest = if depth > deepest { depth } else { deepest };
                depth >= 0.0
            };
            // Items in the plane of the face are not hidden by it.
            corners[item.corners.clone()].iter().all(&mut is_beyond) && deepest > self.views.tolerance()
        };
        let mut n_left = first;
        for k in first..items.len() {
            if items[k].own == own || !is_hidden(&items[k]) {
                items.swap(n_left, k);
                n_left += 1;
            }
        }
        items.truncate(n_left);
    }

    /// Cuts every patch of a cell by all faces that may hide a part of it there, and visits the remaining parts.
    fn cut(&mut self, cell: &Cell, first: usize) {
        let (views, point) = (self.views, self.point);
        let Scratch {
            half_spaces,
            pyramids,
            distances,
            items,
            corners,
            cutting,
            ..
        } = &mut *self.scratch;
        let items = &items[first..];
        let sides = cell.sides();
        for target in items {
            let Some((patch, is_back)) = target.patch else {
                continue;
            };
            let plate = &views.patches[patch];
            cutting.fragments.clear();
            cutting.fragments.push(&corners[target.corners.clone()]);
            if is_back {
                for &k in &views.covers[patch] {
                    let cover = &views.faces[k];
                    if cutting.cut_cover(cover, point) {
                        self.nearest = self.nearest.min(polygon::distance(point, &cover.corners));
                    }
                }
            }
            let others = items.iter().filter(|item| item.hides && item.own != target.own);
            for item in others.filter(|item| item.extent.may_hide(&target.extent)) {
                let occluder = &views.occluders[item.own];
                if !views.is_before(plate, occluder, point)
                    && cutting.cut_away(&half_spaces[pyramids[item.own].clone()])
                {
                    let distance = || polygon::distance(point, &occluder.corners);
                    self.nearest = self.nearest.min(*distances[item.own].get_or_insert_with(distance));
                }
                if cutting.fragments.is_empty() {
                    break;
                }
            }
            let reach = ON_SIDE * (plate.ball.middle.distance(point) + plate.ball.radius);
            for part in cutting.fragments.iter() {
                let (border, distance) = border_of(part, &sides, reach);
                (self.visit)(&SeenPart {
                    patch,
                    is_back,
                    corners: part,
                    border,
                    distance,
                });
            }
        }
    }
}

/// Returns an upper bound of the length of the border of a part as the origin sees it, in radians, and the distance of its nearest edge, m.
///
/// Edges that lie in a side of the cell do not count.
fn border_of(corners: &[DVec3], sides: &[DVec3], reach: f64) -> (f64, f64) {
    let (mut border, mut nearest) = (0.0, f64::INFINITY);
    let mut a = corners[corners.len() - 1];
    for &b in corners {
        let edge = b - a;
        let is_in = |side: &DVec3| side.dot(a).abs() <= reach && side.dot(b).abs() <= reach;
        if edge != DVec3::ZERO && !sides.iter().any(is_in) {
            let t = (-a.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            let distance = (a + t * edge).length();
            nearest = nearest.min(distance);
            border += (edge.length() / distance.max(f64::MIN_POSITIVE)).min(PI);
        }
        a = b;
    }
    (border, nearest)
}

/// How much of a polygon is inside.
enum Kept {
    Nothing,
    Part,
    All,
}

/// Sets `inside` to the part of a convex polygon on the inner side of a plane through the origin, if the plane cuts it.
fn keep_inside(corners: &[DVec3], normal: DVec3, inside: &mut Vec<DVec3>) -> Kept {
    let (mut is_any_in, mut is_any_out) = (false, false);
    for &v in corners {
        let value = normal.dot(v);
        is_any_in |= value > 0.0;
        is_any_out |= value < 0.0;
    }
    if !is_any_in {
        return Kept::Nothing;
    }
    if !is_any_out {
        return Kept::All;
    }
    inside.clear();
    let mut a = corners[corners.len() - 1];
    let mut value_a = normal.dot(a);
    for &b in corners {
        let value_b = normal.dot(b);
        if value_a * value_b < 0.0 {
            inside.push(a + (b - a) * (value_a / (value_a - value_b)));
        }
        if value_b >= 0.0 {
            inside.push(b);
        }
        (a, value_a) = (b, value_b);
    }
    if inside.len() >= 3 { Kept::Part } else { Kept::Nothing }
}

/// Returns whether a point is in the plane of a plate.
fn is_edge_on(plate: &Plate, point: DVec3) -> bool {
    plate.height(point).abs() <= f64::EPSILON * plate.ball.middle.distance(point)
}

/// Appends the half-spaces of the pyramid over a plate, with or without the one `beyond` its plane; none if it is seen edge-on.
fn pyramid_over(plate: &Plate, point: DVec3, beyond: bool, half_spaces: &mut Vec<HalfSpace>) {
    if is_edge_on(plate, point) {
        return;
    }
    let sign = plate.height(point).signum();
    let next = plate.corners.iter().cycle().skip(1);
    for (&a, &b) in plate.corners.iter().zip(next) {
        let (a, b) = (a - point, b - point);
        // Seen from the front the corners run counter-clockwise, and a × b points outwards.
        let slack = 1e-15 * a.abs().element_sum() * (b - a).abs().element_sum();
        half_spaces.push(HalfSpace {
            normal: a.cross(b) * -sign,
            offset: 0.0,
            slack: [0.0, slack],
        });
    }
    if beyond {
        let normal = plate.normal * -sign;
        half_spaces.push(HalfSpace {
            normal,
            offset: -normal.dot(plate.corners[0] - point),
            slack: [0.0; 2],
        });
    }
}

impl Cutting {
    /// Cuts from the fragments of a back the part that a front in its plane covers; returns whether there is any.
    fn cut_cover(&mut self, cover: &Plate, point: DVec3) -> bool {
        let mut half_spaces = std::mem::take(&mut self.cover);
        half_spaces.clear();
        pyramid_over(cover, point, false, &mut half_spaces);
        let is_cut = !half_spaces.is_empty() && self.cut_away(&half_spaces);
        self.cover = half_spaces;
        is_cut
    }

    /// Cuts the part in all half-spaces from the fragments; returns whether there is any.
    fn cut_away(&mut self, half_spaces: &[HalfSpace]) -> bool {
        let Self {
            fragments,
            next,
            rest,
            piece,
            ..
        } = self;
        next.clear();
        let mut is_cut = false;
        for fragment in fragments.iter() {
            let before = next.len();
            if subtract(fragment, half_spaces, next, rest, piece) {
                is_cut = true;
            } else {
                // Nothing is hidden: one whole fragment instead of the pieces.
                next.truncate(before);
                next.push(fragment);
            }
        }
        std::mem::swap(fragments, next);
        is_cut
    }
}
