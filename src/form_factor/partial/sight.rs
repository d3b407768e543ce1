//! The views of a target from the cells of a receiver: the points of each cell, and the errors of its integrals.

use glam::{DVec2, DVec3};

use super::bodies::Extent;
use super::cells::Shape;
use super::flat::Flat;
use super::gauss;
use super::layers::LowEdges;
use super::receiver::Receiver;
use super::rule::{self, Estimate, Parts};
use super::shadow::Shadows;
use super::{MIN_SHARE, UNSEEN_SHARE, Whole};
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{PreparedPolygon, Tolerance};
use crate::visibility::occluders::Occluder;

/// The places of the parts in [`Parts`].
pub(super) const VISIBLE: usize = 0;
pub(super) const HIDDEN: usize = 1;

/// The distance from the target, in radii of a cell, up to which the cell is near: beyond, F₀ has no peak that the points of a rule could miss.
const NEAR: f64 = 3.0;

/// The least part of the largest polygon's size that the others have where discontinuity lines are accurate to some 1e-10 of a cell.
const ALIKE: f64 = 1e-6;

/// The greatest share that a part may have of F₀ between the points, as a multiple of its largest share on the points.
const MORE_THAN_SEEN: f64 = 4.0;

/// The share of a part's error below which that of the other must be for the other to be used.
///
/// The closed form that this needs costs as much as some evaluations.
const BETTER: f64 = 0.5;

/// The fraction of a cell that a shadow may cover without touching a point of a rule.
const BETWEEN_POINTS: f64 = 0.15;

/// The same where the shadow is wider than the distance of the points, and so only reaches in.
const AT_A_SIDE: f64 = 0.03;

/// The fraction of a cell beyond the points on its border.
const BEYOND_POINTS: f64 = 1e-3;

/// The greatest form factor from the edge of a polygon to another, as a multiple of its mean over the polygon.
const AT_AN_EDGE: f64 = 4.0;

/// The part of the receiver's size up to which edges above it count as in its plane.
const IN_PLANE: f64 = 1e-13;

/// The visible part of a target from the points of its receiver.
pub(super) struct Sight {
    pub(super) receiver: Receiver,
    /// The target, its plane, and the half-planes that it is made of: seen from the origin of the receiver's frame.
    target: Vec<DVec3>,
    /// The target seen from its own first corner: all its digits, however far off it is.
    target_alone: Vec<DVec3>,
    /// The largest coordinate of the target, seen from the origin of the receiver's frame.
    apart: f64,
    target_plane: (DVec3, f64),
    target_sides: Vec<(DVec3, f64)>,
    shadows: Shadows,
    low_edges: LowEdges,
    /// Boxes around the occluders, seen from the origin of the receiver's frame.
    ///
    /// `None` where rounding may displace discontinuity lines, as sizes differ too much.
    boxes: Option<Vec<(DVec3, DVec3)>>,
    /// The bodies whose discontinuity lines are not listed.
    pub(super) unlisted: Vec<Extent>,
    /// True if no discontinuity line crosses a cell: a body that hides nothing from one of its points hides nothing from all of it.
    pub(super) is_whole: bool,
    /// True if all occluders are sides of one convex body.
    pub(super) is_one_body: bool,
    /// True if hidden parts are evaluated in cells near the target alone: elsewhere F₀ has no peak, and where the tolerance is loose the visible part is enough.
    pub(super) is_loose: bool,
    /// The most exchange area that a shadow between the points of a cell may hide, by area.
    pub(super) may_hide: f64,
}

impl Sight {
    /// Returns the number of cuts of fragments so far.
    pub(super) fn n_cuts(&self) -> usize {
        self.shadows.n_cuts
    }

    /// Prepares the view of `shadows`.
    pub(super) fn new(receiver: Receiver, target: &[DVec3], occluders: &[Occluder<'_>], shadows: Shadows) -> Self {
        let outer: Vec<DVec2> = receiver.corners.iter().map(|&v| receiver.to_plane(v)).collect();
        let outlines = occluders.iter().map(|b| &*b.corners).chain(std::iter::once(target));
        let edges = outlines.flat_map(|corners| {
            let next = corners.iter().cycle().skip(1);
            corners
                .iter()
                .zip(next)
                .map(|(&a, &b)| [receiver.in_frame(a), receiver.in_frame(b)])
        });
        let plane = Flat::with_normal(&receiver.corners, receiver.normal);
        let low_edges = LowEdges::new(edges, &outer, plane.tolerance(receiver.corners[0], IN_PLANE));
        // Small numbers keep the digits that narrow cells need.
        let moved: Vec<DVec3> = target.iter().map(|&v| receiver.seen_from_origin(v)).collect();
        let normal = polygon::area_vector(&moved).normalize_or_zero();
        let next = moved.iter().cycle().skip(1);
        let sides = moved.iter().zip(next).map(|(&a, &b)| {
            let inward = normal.cross(b - a).normalize_or_zero();
            (inward, inward.dot(a))
        });
        let boxes: Vec<(DVec3, DVec3)> = occluders
            .iter()
            .map(|occluder| {
                let (low, high) = super::bounds(&occluder.corners);
                (receiver.seen_from_origin(low), receiver.seen_from_origin(high))
            })
            .collect();
        let all = boxes
            .iter()
            .copied()
            .chain([super::bounds(&moved), super::bounds(&receiver.corners)]);
        let (smallest, largest) = all.fold((f64::INFINITY, 0.0_f64), |(small, large), (low, high)| {
            let size = low.distance(high);
            (small.min(size), large.max(size))
        });
        let are_alike = smallest > ALIKE * largest;
        Self {
            target_plane: (normal, normal.dot(moved[0])),
            target_sides: sides.collect(),
            target_alone: target.iter().map(|&v| v - target[0]).collect(),
            apart: moved.iter().map(|v| v.abs().max_element()).fold(0.0, f64::max),
            target: moved,
            boxes: are_alike.then_some(boxes),
            receiver,
            shadows,
            low_edges,
            unlisted: Vec::new(),
            is_whole: false,
            is_one_body: false,
            is_loose: false,
            may_hide: f64::INFINITY,
        }
    }

    pub(super) fn find_bodies(&mut self) {
        self.shadows.find_bodies();
    }

    /// Returns a cell with the kind of views from it.
    ///
    /// Views change on discontinuity lines, and on curves where the edges of three convex bodies cross, the target among them: away from these lines, each body alone hides something from all points or from none.
    pub(super) fn site(&mut self, shape: Shape) -> Site {
        let (middle, radius) = circle(shape);
        let reach = NEAR * radius;
        let is_of_one_body =
            self.is_whole && (self.is_one_body || !self.shadows.several_may_hide(self.receiver.to_world(middle)));
        let is_near = self.distance(middle) < reach;
        let views = match is_of_one_body {
            true if !is_near && self.is_far_from_occluders(middle, reach) => Views::Analytic,
            true => Views::OfOneBody,
            false => Views::Any,
        };
        Site {
            shape,
            is_near,
            views,
            may_open: self.is_loose && !is_of_one_body,
        }
    }

    /// Returns the form factors to the visible and to the hidden part of the target, and keeps their largest shares of both in `shares`.
    fn at(&mut self, point: DVec2, shares: &mut Option<Parts>) -> Parts {
        let place = self.receiver.to_world(point);
        if self.is_loose && shares.is_none() {
            return self.shadows.visible(place);
        }
        let parts = self.shadows.visible_and_hidden(place);
        let whole = parts[VISIBLE] + parts[HIDDEN];
        if let Some(shares) = shares
            && whole > 0.0
        {
            *shares = [0, 1].map(|part| shares[part].max(parts[part] / whole));
        }
        parts
    }

    fn is_far_from_occluders(&self, point: DVec2, reach: f64) -> bool {
        let place = self.receiver.offset(point);
        let is_far = |&(low, high): &(DVec3, DVec3)| {
            (low - place).max(place - high).max(DVec3::ZERO).length_squared() > reach * reach
        };
        self.boxes.as_ref().is_some_and(|boxes| boxes.iter().all(is_far))
    }

    /// Returns the error of discontinuity lines that are missed by `margin`: its square, unless the view changes within as little.
    ///
    /// Beside an edge of height h rounding of a point by ε turns the plane through both by ε/h: as far as the receiver reaches, the view is off by that, or by all that a layer of width h holds.
    pub(super) fn error_within(&self, margin: f64) -> f64 {
        let lowest = self.low_edges.lowest();
        if lowest.is_infinite() {
            return 0.0;
        }
        let corners = &self.receiver.corners;
        let next = corners.iter().cycle().skip(1);
        let perimeter: f64 = corners.iter().zip(next).map(|(a, b)| a.distance(*b)).sum();
        let (low, high) = super::bounds(corners);
        let rounding = 4.0 * f64::EPSILON * low.abs().max(high.abs()).max_element();
        perimeter
            * (rounding * low.distance(high) / lowest)
                .min(lowest)
                .max(if lowest > margin { 0.0 } else { margin })
    }

    /// Evaluates a cell at the points of a rule.
    pub(super) fn look(&mut self, site: Site, rule: impl FnOnce(&mut dyn FnMut(DVec2) -> Parts) -> Estimate) -> Look {
        let shape = site.shape;
        let mut shares = site.is_near.then_some([0.0; 2]);
        self.shadows.forget();
        let mut is_any_visible = false;
        let mut largest = 0.0_f64;
        let mut estimate = rule(&mut |point| {
            let parts = self.at(point, &mut shares);
            is_any_visible |= parts[VISIBLE] > 0.0;
            largest = largest.max(parts[VISIBLE] + parts[HIDDEN]);
            parts
        });
        if !self.unlisted.is_empty() {
            for part in [VISIBLE, HIDDEN] {
                if estimate.integral[part] <= 0.0 {
                    let least = largest * shape.area() * self.unseen(part, shape);
                    estimate.error[part] = estimate.error[part].max(least);
                }
            }
        }
        let has_curves = site.may_open && is_any_visible && self.shadows.several_hide();
        let mut layers = [0.0; 2];
        if !self.low_edges.is_empty() {
            let low_edges = std::mem::take(&mut self.low_edges);
            for corners in shape.triangles() {
                let (error, n_evaluations) = low_edges.error(corners, |point| self.at(point, &mut shares));
                estimate.error = [0, 1].map(|part| estimate.error[part] + error[part]);
                layers = [0, 1].map(|part| layers[part] + error[part]);
                estimate.n_evaluations += n_evaluations;
            }
            self.low_edges = low_edges;
        }
        Look {
            site,
            estimate,
            layers,
            shares,
            has_curves,
        }
    }

    /// Returns the share of a cell that a part may cover although it is 0 at all points of a rule, where the shadows of bodies are not listed.
    fn unseen(&self, part: usize, shape: Shape) -> f64 {
        let corners = shape.corners();
        let next = corners.iter().cycle().skip(1);
        let size = corners
            .iter()
            .zip(next)
            .map(|(a, b)| a.distance(*b))
            .fold(0.0, f64::max);
        if part == VISIBLE {
            // A body hides all of the target from a convex part of the receiver, and so from the hull of the points.
            return if self.shadows.several_hide() {
                BETWEEN_POINTS
            } else {
                BEYOND_POINTS
            };
        }
        let cells = || shape.triangles().map(|cell| cell.map(|v| self.receiver.offset(v)));
        let reaches_in = |body: &&Extent| cells().any(|cell| !body.is_beside(&cell, &self.target));
        let widths = self.unlisted.iter().filter(reaches_in).map(|body| body.width);
        match widths.reduce(f64::min) {
            None => 0.0,
            // A shadow is convex, and no narrower than its caster: one that contains no point of the rule is in a corner or at a side.
            Some(width) if size <= 2.0 * width => AT_A_SIDE,
            Some(_) => BETWEEN_POINTS,
        }
    }

    pub(super) fn look_at_triangle(&mut self, corners: [DVec2; 3], enough: f64) -> Look {
        let site = self.site(Shape::Triangle(corners));
        if site.views == Views::Analytic {
            return self.look_at_analytic(site, enough);
        }
        let look = self.look(site, |f| rule::integrate(corners, enough, true, f));
        self.with_some_error(look, enough)
    }

    /// Evaluates a cell in which the view is analytic.
    pub(super) fn look_at_analytic(&mut self, site: Site, enough: f64) -> Look {
        let look = self.look(site, |f| match site.shape {
            Shape::Triangle(corners) => rule::integrate(corners, enough, false, f),
            Shape::Quad(corners) => gauss::integrate(corners, enough * site.shape.area(), f),
        });
        self.with_some_error(look, enough)
    }

    fn with_some_error(&self, look: Look, enough: f64) -> Look {
        if self.is_loose {
            look.with_least_share(enough, self.may_hide)
        } else {
            look
        }
    }

    /// Returns a lower bound of the distance of the target from a point of the receiver.
    fn distance(&self, point: DVec2) -> f64 {
        let point = self.receiver.offset(point);
        let (normal, level) = self.target_plane;
        let outside = self
            .target_sides
            .iter()
            .map(|(inward, level)| level - inward.dot(point));
        outside.fold(0.0, f64::max).hypot(normal.dot(point) - level)
    }

    /// Returns the exchange area of a cell without occluders, to within `error` or rounding.
    ///
    /// The larger one is moved into the frame of the smaller one, where rounding by δ displaces its edges: what that changes is stated.
    fn without_occluders(&self, shape: Shape, error: f64) -> Whole {
        let mut cell: Vec<DVec3> = shape.corners().iter().map(|&v| self.receiver.offset(v)).collect();
        let mut target = &self.target;
        if polygon::perimeter(target) < polygon::perimeter(&cell) {
            for v in &mut cell {
                *v -= self.target[0];
            }
            target = &self.target_alone;
        }
        let [cell, target] = [&cell, target].map(|side| PreparedPolygon::new(side));
        let tolerance = Tolerance {
            rel: Whole::REL,
            abs: error.max(8.0 * f64::EPSILON * cell.perimeter() * target.perimeter()),
        };
        let whole = Whole::between(&cell, &target, tolerance);
        let displaced = f64::EPSILON * self.apart * cell.perimeter().max(target.perimeter());
        Whole {
            error: whole.error + displaced.min(AT_AN_EDGE * displaced / cell.area().max(target.area()) * whole.area),
            ..whole
        }
    }

    /// Returns the integral of the part `base`, which is summed, over a cell, from whichever part is known better, its error, and how much of the error has the same sign in all cells;
    /// `enough` is the error allowed.
    ///
    /// In a near cell the same points integrate F₀ too, whose integral is known: this part may miss as much as the points miss of F₀, or may miss of the other part,
    /// in proportion to its share of F₀. Cells in a row along an edge miss the same, so that these errors do not cancel.
    pub(super) fn settle(&self, look: &Look, base: usize, enough: f64) -> [f64; 3] {
        let &Look {
            site: Site { shape, .. },
            ref estimate,
            layers,
            shares,
            ..
        } = look;
        let other = 1 - base;
        let is_other = estimate.error[base] > enough && estimate.error[other] < BETTER * estimate.error[base];
        let part = if is_other { other } else { base };
        let (mut integral, mut error, mut alike) = (estimate.integral[part], estimate.error[part], layers[part]);
        // Past bodies whose lines are not listed, a part has no error only if that is proved.
        let knows_shape = self.is_whole || !self.unlisted.is_empty();
        let is_certain = integral.max(error) <= 0.0 && knows_shape;
        let shares = shares.filter(|_| !is_certain);
        if is_other || shares.is_some() {
            let whole = self.without_occluders(shape, 0.01 * enough);
            if let Some(shares) = shares {
                let missed = estimate.integral[VISIBLE] + estimate.integral[HIDDEN] - whole.area;
                let share = if knows_shape {
                    (MORE_THAN_SEEN * shares[part]).min(1.0)
                } else {
                    1.0
                };
                let unseen = share * missed.abs().max(estimate.error[1 - part]);
                error += unseen;
                alike += unseen;
            }
            integral = integral.min(whole.area);
            error = whole.bounded(integral, error);
            if is_other {
                integral = whole.area - integral;
                error += whole.error;
            }
        }
        [integral, error, alike.min(error)]
    }
}

/// Returns the middle of a shape's corners, and the greatest distance of one from it.
fn circle(shape: Shape) -> (DVec2, f64) {
    let corners = shape.corners();
    let middle = corners.iter().sum::<DVec2>() / corners.len() as f64;
    let radius = corners.iter().map(|v| v.distance(middle)).fold(0.0, f64::max);
    (middle, radius)
}

/// The kind of function that the form factors from the points of a cell are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Views {
    /// At most one body hides anything, and the edges that the view is made of, where it is singular, are not near.
    Analytic,
    /// At most one body hides anything, so that no edges cross.
    OfOneBody,
    /// Several bodies may hide something, or a discontinuity line may cross the cell.
    Any,
}

/// A cell with the kind of views from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    pub(super) shape: Shape,
    /// True if the target is near, so that F₀ may have a peak between the points of a rule.
    is_near: bool,
    pub(super) views: Views,
    /// True if three edges of different polygons may open or close a view between the points, as the tolerance is loose and the points are few.
    may_open: bool,
}

/// The visibility of a cell at the points of a rule.
pub(super) struct Look {
    pub(super) site: Site,
    pub(super) estimate: Estimate,
    /// The share of its errors that stands for layers along the border of the cell.
    pub(super) layers: Parts,
    /// In a near cell, the largest shares of F₀ that the parts have on these points.
    shares: Option<Parts>,
    /// Whether the points see a part of the target, and several bodies before the rest of it, whose edges may cross in views.
    pub(super) has_curves: bool,
}

impl Look {
    /// States at least the share of `enough` that few points leave where the tolerance is loose; at most `may_hide`, both errors by area.
    pub(super) fn with_least_share(self, enough: f64, may_hide: f64) -> Self {
        let share = if self.site.may_open { UNSEEN_SHARE } else { MIN_SHARE };
        self.with_least_error(share * enough, may_hide)
    }

    /// States at least this error by area, and at most `may_hide`, of a part that is not 0, and of a visible part that edges may open between points.
    pub(super) fn with_least_error(mut self, least: f64, may_hide: f64) -> Self {
        let least = least.min(may_hide) * self.site.shape.area();
        let Estimate { integral, error, .. } = &mut self.estimate;
        for part in [VISIBLE, HIDDEN] {
            if integral[part] > 0.0 || (part == VISIBLE && self.site.may_open) {
                error[part] = error[part].max(least);
            }
        }
        self
    }
}
