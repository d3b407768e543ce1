//! The exchange area of two polygons with occluders between them, to a given tolerance.
//!
//! A_P F_PQ = ∫_P F₀(x) dA − ∫_P F(x → hidden part of Q) dA. The first integral is the exchange area without occluders, which has a closed form. The inner factor of the second is exact:
//! Q is clipped against the shadow of every occluder as seen from x, and the remaining pieces are summed by Lambert's formula. As a function of x it is analytic but for the lines on which
//! the view changes its structure; P is cut along these first, and the cells are then integrated by an adaptive rule, worst cell first. Where more is hidden than visible, the visible part is integrated instead.
//! f64 throughout. Where rays in f64 take less time for the tolerance than clipping, they take its place.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

mod between;
mod bodies;
mod cells;
mod events;
mod few;
mod flat;
mod free_point;
mod gauss;
mod groups;
mod integration;
mod layers;
mod pieces;
mod plates;
mod point;
mod pyramids;
mod quad;
mod rays;
mod receiver;
mod rule;
mod screen;
mod shadow;
mod sight;
mod stops;
mod sunlit;
mod view_cells;

use std::cmp::Ordering;

use glam::{DVec2, DVec3};

use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{self, PreparedPolygon, Tolerance};
use crate::visibility::occluders::{Body, Occluder};
use bodies::Extent;
use cells::{Cells, Shape};
use events::Outline;
use flat::Flat;
pub(crate) use free_point::{Place, PointViews};
pub(super) use integration::{Integration, Limits};
use pieces::Pieces;
pub use point::VisibleFactor;
pub(super) use rays::{after_all_by_rays, by_rays, clipping_worth, expected_cost};
use receiver::Receiver;
use shadow::Shadows;
use sight::{Sight, Views};
pub(crate) use sunlit::{Lit, lit_part};
pub(crate) use view_cells::Scratch;

/// The share of the allowed error for the exchange area without occluders.
const SHARE_OF_WHOLE: f64 = 1e-3;

/// The tolerance and the budget of an integration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// The tolerance on A_P F_PQ / min(A_P, A_Q): on the absolute error of the larger of the two form factors.
    pub tolerance: f64,
    /// The number of evaluations of the inner factor after which no more begin; the first look at all cells is always finished.
    pub budget: usize,
}

/// An exchange area with its estimated error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Partial {
    /// A_P F_PQ = A_Q F_QP in m².
    pub exchange_area: f64,
    /// The estimate of its absolute error, in m².
    pub error: f64,
    /// The number of points from which the other polygon was viewed.
    pub n_evaluations: usize,
    /// The number of rays between the polygons, where rays took the place of clipping.
    pub n_rays: usize,
    /// True if the estimate is within the tolerance; false if the budget was spent before.
    pub reached: bool,
}

/// Returns the exchange area of two convex planar polygons that occluders may hide from each other in any part.
///
/// A_P F_PQ = ∫_P ∫_Q V cos θ_P cos θ_Q / (π r²) dA dA in m². Corners run counter-clockwise seen from the front; the part behind the other
/// polygon's plane does not count. `occluders` must hold all polygons that reach in between, such as
/// [`OccluderIndex`](crate::visibility::occluders::OccluderIndex) finds; more do no harm. They may touch, pierce and overlap each other and
/// both polygons; those in the plane of P or of Q hide nothing. Either order of P and Q gives the same bits.
///
/// Accuracy: the estimated error is the sum over all cells of an estimate from the decay of the integrand's polynomial degrees
/// and from its values on the cell's border, beyond the points of the rule. In a cell that is nearer to Q than some of its size the same points also integrate the form factor without
/// occluders, which has a peak there and whose integral is known: the integrand may miss its share of the part that the points miss. Where edges run close above P, as in a narrow gap,
/// strips beside them follow the layers in which the view changes, and points ever nearer to a cell's border show what is left; cells in a row miss the same, so that these errors are added.
/// An edge at a height h over P, of size D, adds what rounding of coordinates c may turn the planes through it, 4 ε c D / h times the perimeter of P, or all that a layer as wide as h holds.
/// The error is at most the visible or the hidden part, whichever is more.
/// Against runs with a far smaller tolerance it held in all of several hundred random cases with up to three intersecting boxes and plates, and in a thousand climbs towards scenes where it would fail;
/// the true error is mostly more than ten times smaller. Tolerances down to 1e-12 are reached. A remainder of Q within 1e-15 of
/// the distances involved may count as hidden, and the result is exactly 0 where nothing else is seen.
///
/// Cells:
/// - Between discontinuity lines, a view past one convex body is analytic. Where its edges and the target are three radii of a cell away or more,
///   all points of the cell are inside: 7 or 19 of a triangle, 9 or 25 of a quadrilateral.
/// - Where the tolerance is above all of the exchange area without occluders, each cell from which one body at most hides anything has 3 or 4 points inside,
///   and at least a fifth of the error allowed is stated, or 0.15 of the exchange area without occluders if that is less: the true error is far smaller.
/// - Where the tolerance is above a hundredth of the exchange area without occluders, cells first have 7 or 9 points on their border and in the middle, which is enough for most.
///   Three edges of different occluders may open a view between these points, which they miss: at least 0.15 of the tolerance or of that exchange area, whichever is less, by the area of the cells that something is hidden from, is then stated as error.
/// - Cells from which several bodies hide something have 13 or 25 points a triangle in any case.
/// - A closed convex solid hides from a point the region behind its silhouette, one convex polygon, however many sides there are. The discontinuity lines of a solid with seven sides or more are left out at first:
///   such a view is smooth but for small bends, and plain subdivision finds these. A plane between marks the cells that see nothing of the solid; others in which all points agree
///   state an error for the part between the points. Where 200 evaluations for each side do not reach the goal, the lines are computed after all.
/// - More than 4096 cells or a million pairs of vertices and edges are left to plain subdivision, which finds their lines with more evaluations.
///
/// A polygon without area, or with less than three corners, exchanges nothing; coordinates that are not finite give NaN.
/// Cost: for each cell 3 or 4, 7 or 9, or for each triangle of it 13 or 25 evaluations, each in proportion to the number of occluders; P has as many cells as discontinuity lines cut it into.
///
/// Source: Lambert's formula as in [`point_form_factor`](crate::geometry::point_form_factor::point_form_factor); the discontinuity lines are the
/// EV events of Gigus and Malik, "Computing the Aspect Graph for Line Drawings of Polyhedral Objects", IEEE PAMI 12(2), 1990, as discontinuity meshing of shadows
/// uses them (Lischinski, Tampieri and Greenberg 1992, Heckbert 1992).
/// Departures: their curved EEE events are left to adaptive subdivision; the tests hold errors to their estimates in random views through three crossing edges.
#[must_use]
#[doc(alias = "view factor")]
pub fn exchange_area(p: &[DVec3], q: &[DVec3], occluders: &[Occluder<'_>], accuracy: Accuracy) -> Partial {
    let areas = [p, q].map(|side| polygon::area_vector(side).length());
    let goal = accuracy.tolerance * areas[0].min(areas[1]);
    let whole = Whole::of(p, q, SHARE_OF_WHOLE * goal);
    let mut begun = Integration::begin([p, q], occluders, goal, Limits::of(accuracy.budget), whole);
    begun.refine(goal, accuracy.budget, &|| true);
    begun.result(goal)
}

/// The exchange area that two polygons would have without occluders, m².
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Whole {
    pub(super) area: f64,
    /// The estimate of its absolute error.
    pub(super) error: f64,
}

impl Whole {
    /// The relative error that is always enough.
    const REL: f64 = 1e-13;

    /// Computes it to an absolute error, m²; either order of the two gives the same bits.
    pub(super) fn of(p: &[DVec3], q: &[DVec3], error: f64) -> Self {
        let first = |side: &[DVec3]| side.first().map(DVec3::to_array);
        let in_order = if first(q) < first(p) { [q, p] } else { [p, q] };
        let [p, q] = in_order.map(PreparedPolygon::new);
        let tolerance = Tolerance {
            rel: Self::REL,
            abs: error,
        };
        Self::between(&p, &q, tolerance)
    }

    fn between(p: &PreparedPolygon, q: &PreparedPolygon, tolerance: Tolerance) -> Self {
        let exchange = polygon_form_factor::exchange_area(p, q, tolerance);
        Self {
            area: exchange.value,
            error: exchange.error,
        }
    }

    /// Returns an error that is at most the greatest possible error of a part of the whole.
    fn bounded(self, part: f64, error: f64) -> f64 {
        error.min(part.max(self.area - part) + self.error)
    }
}

/// Integrates a pair with many occluders without discontinuity lines, which would be more than the points; `None` if that does not reach the goal.
///
/// It is tried where the exchange area without occluders is up to [`SMALL_AMONG_MANY`] times the goal; the part that a shadow between all points may hide is stated as error. See [`Integration::begin`] for the arguments.
pub(super) fn uncut(sides: [&[DVec3]; 2], occluders: &[Occluder<'_>], goal: f64, whole: Whole) -> Option<Partial> {
    let mut view = View::new(sides, occluders, whole).ok()?;
    view.uncut(goal)
}

/// Chooses the polygon to integrate over: the one that is farther from all occluders in units of its own size, because shadows are softer there.
fn first_receives(sides: &[Vec<DVec3>; 2], occluders: &[Occluder<'_>]) -> bool {
    let share = |side: &[DVec3], gap: &dyn Fn(&[DVec3]) -> f64| {
        let (low, high) = bounds(side);
        let gaps = occluders.iter().map(|occluder| gap(&occluder.corners));
        gaps.fold(f64::INFINITY, f64::min) / (high - low).length_squared()
    };
    let beside = |side: &Vec<DVec3>| {
        let (low, high) = bounds(side);
        share(side, &|corners| {
            let (l, h) = bounds(corners);
            (l - high).max(low - h).max(DVec3::ZERO).length_squared()
        })
    };
    let above = |side: &Vec<DVec3>| {
        let plane = Flat::of(side);
        share(side, &|corners| {
            let heights = corners.iter().map(|&v| plane.height(v));
            let (lowest, highest) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            lowest.max(-highest).max(0.0).powi(2)
        })
    };
    let mut shares = sides.each_ref().map(beside);
    if shares.iter().all(|&share| share <= 0.0) {
        // Boxes around turned polygons meet although these are apart.
        shares = sides.each_ref().map(above);
    }
    let [p, q] = shares;
    let position = |k: usize| polygon::centroid(&sides[k]);
    let by_place = || position(0).to_array().partial_cmp(&position(1).to_array());
    p.total_cmp(&q)
        .reverse()
        .then_with(|| by_place().unwrap_or(Ordering::Equal))
        != Ordering::Greater
}

/// Returns whether any of some points lies in front of a polygon's plane.
fn is_before(points: &[DVec3], polygon: &[DVec3]) -> bool {
    let normal = polygon::area_vector(polygon).normalize_or_zero();
    let size = polygon
        .iter()
        .chain(points)
        .map(|&v| (v - polygon[0]).abs().element_sum())
        .fold(0.0, f64::max);
    points.iter().any(|&v| normal.dot(v - polygon[0]) > 1e-14 * size)
}

fn bounds(corners: &[DVec3]) -> (DVec3, DVec3) {
    let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    corners.iter().fold(all, |(low, high), &v| (low.min(v), high.max(v)))
}

/// The most cells that the receiver is cut into before integration; plain subdivision finds the other lines.
const MAX_CELLS: usize = 4096;

/// The most pairs of a vertex and an edge that are tested for discontinuity lines.
const MAX_EVENT_PAIRS: usize = 1 << 20;

/// The multiple of the error allowed up to which a pair with many occluders is integrated uncut (see [`uncut`]), by its exchange area without them.
///
/// A cut costs far more there than for few occluders, and many small shadows together make a smooth integrand.
/// Times: `docs/performance.md`.
const SMALL_AMONG_MANY: f64 = 40.0;

/// Evaluations past bodies, for each side of these, after which their discontinuity lines are computed.
///
/// More sides have more such lines, and more work between them.
const PAST_BODIES: usize = 200;

/// The least part of the error allowed that is stated there.
const PAST_BODIES_SHARE: f64 = 0.02;

/// The part of the error allowed that all cells together may state at the first look.
///
/// With it nine pairs in ten state less than 30 times their true errors, where these are a hundredth of the tolerance or more.
const FIRST_SHARE: f64 = 0.3;

/// The fraction of the unoccluded exchange area that a shadow between the sample points can hide: the most that is stated beyond an estimate.
const UNSEEN: f64 = 0.15;

/// The least part of the error allowed that is stated for three or four points in a cell.
const FEW_SHARE: f64 = 0.2;

/// The same for other points, where the occluders are no convex body.
const UNSEEN_SHARE: f64 = 0.5;

/// The same where they are one convex body: in one of a thousand climbs the estimate was half of the true error, which was a thousandth of the tolerance.
const MIN_SHARE: f64 = 0.005;

/// The part of the exchange area without occluders from which on a tolerance is loose: nine points on a cell are then mostly enough.
const LOOSE: f64 = 0.01;

/// A receiver, its target and their occluders.
struct View<'a> {
    sight: Sight,
    target: Vec<DVec3>,
    occluders: Vec<Occluder<'a>>,
    /// The solids that hide things by their silhouettes.
    bodies: Vec<Body<'a>>,
    whole: Whole,
}

impl<'a> View<'a> {
    /// Chooses the receiver. The exchange area is returned as an error where nothing is to be integrated: 0, or NaN.
    fn new([p, q]: [&[DVec3]; 2], occluders: &[Occluder<'a>], whole: Whole) -> Result<Self, f64> {
        let [area_p, area_q] = [p, q].map(polygon::area_vector);
        let mut sides = [
            clip_to_half_space(p, q.first().copied().unwrap_or_default(), area_q),
            clip_to_half_space(q, p.first().copied().unwrap_or_default(), area_p),
        ];
        let mut corners = p.iter().chain(q).chain(occluders.iter().flat_map(|b| b.corners.iter()));
        if !corners.all(|v| v.is_finite()) {
            return Err(f64::NAN);
        }
        let smaller_area = area_p.length().min(area_q.length());
        if smaller_area <= 0.0 || sides.iter().any(|side| side.len() < 3) {
            return Err(0.0);
        }
        let mut occluders: Vec<Occluder<'a>> = occluders.iter().filter(|b| b.corners.len() >= 3).cloned().collect();
        let mut normals = [area_p.normalize_or_zero(), area_q.normalize_or_zero()];
        if !first_receives(&sides, &occluders) {
            sides.reverse();
            normals.reverse();
        }
        let [corners, target] = sides;
        // A side of a solid that is only seen from the back hides nothing beyond its front sides.
        occluders.retain(|occluder| !occluder.one_sided || is_before(&corners, &occluder.corners));
        let receiver = Receiver::new(corners, normals[0]);
        let shadows = Shadows::new(&receiver, &target, &occluders);
        Ok(Self {
            sight: Sight::new(receiver, &target, &occluders, shadows),
            target,
            bodies: bodies::of(&occluders),
            occluders,
            whole,
        })
    }

    /// Returns whether all occluders are sides of one convex body, seen from outside: three of its edges never cross in a view.
    fn occluders_are_convex(&self) -> bool {
        let corners = || self.occluders.iter().flat_map(|occluder| occluder.corners.iter());
        let mut planes = self.occluders.iter().map(|occluder| Flat::of(&occluder.corners));
        self.occluders.len() == 1
            || self.occluders.iter().all(|occluder| occluder.one_sided)
                && planes.all(|plane| corners().all(|&v| plane.height(v) <= plane.tolerance(v, 1e-12)))
    }

    fn outer(&self) -> Vec<DVec2> {
        let receiver = &self.sight.receiver;
        receiver.corners.iter().map(|&v| receiver.to_plane(v)).collect()
    }

    /// Integrates over the receiver without discontinuity lines, if it exchanges less than [`SMALL_AMONG_MANY`] goals without occluders; `None` if that does not reach the goal.
    fn uncut(&mut self, goal: f64) -> Option<Partial> {
        let most = self.whole.area;
        if most.is_nan() || most >= SMALL_AMONG_MANY * goal {
            return None;
        }
        let outer = self.outer();
        let area = polygon_area(&outer);
        let mut triangles: Vec<[DVec2; 3]> = Cells::cut(outer, &[], 0.0, 1)
            .shapes()
            .flat_map(Shape::triangles)
            .collect();
        // One shadow between all points is within one triangle, or within a few.
        let mut unseen = UNSEEN * most;
        while unseen > 0.25 * goal {
            triangles = triangles
                .into_iter()
                .flat_map(|corners| Shape::Triangle(corners).halves())
                .collect();
            unseen *= 0.5;
        }
        unseen += self.sight.error_within(0.0);
        let enough = (goal - unseen).max(0.0) / area;
        let looks = triangles
            .into_iter()
            .map(|corners| self.sight.look_at_triangle(corners, enough));
        let found = pieces::sum_uncut(looks, self.whole, unseen);
        (found.error <= goal && area > 0.0).then_some(found)
    }

    /// Looks at all cells: past bodies without their discontinuity lines first, and with these if that takes too long; `again` makes the same view once more.
    ///
    /// `None` where that is not worth while.
    fn look(self, again: impl FnOnce() -> Result<Self, f64>, goal: f64, limits: Limits) -> Option<Pieces> {
        if self.bodies.is_empty() {
            return self.first_look(goal, limits, false);
        }
        let n_sides = self.occluders.len();
        let mut pieces = self.first_look(goal, limits, true)?;
        pieces.refine(goal, limits.budget.min(PAST_BODIES * n_sides), &|| true);
        let n_evaluations = pieces.n_evaluations();
        if pieces.error() <= goal || n_evaluations >= limits.budget || pieces.is_given_up() {
            return Some(pieces);
        }
        match again() {
            Ok(view) => Some(view.first_look(goal, limits, false)?.spent(n_evaluations)),
            Err(_) => Some(pieces),
        }
    }

    /// Cuts the receiver along the discontinuity lines, `past_bodies` only along those of other occluders, and looks at all cells.
    fn first_look(self, goal: f64, limits: Limits, past_bodies: bool) -> Option<Pieces> {
        let (low, high) = bounds(&self.sight.receiver.corners);
        let is_listed =
            |side: &&Occluder<'_>| !past_bodies || side.body.is_none_or(|body| !self.bodies.contains(&body));
        let occluders: Vec<&Occluder<'_>> = self.occluders.iter().filter(is_listed).collect();
        let corners_of_occluders = occluders.iter().map(|b| &*b.corners);
        let outline = Outline::new(&self.sight.receiver, &self.target, corners_of_occluders);
        // A line that is missed by this much changes an integral by its square only.
        let margin = 1e-9 * (high - low).length();
        let is_listed = outline.n_pairs() <= MAX_EVENT_PAIRS;
        let mut events = if is_listed { outline.events(margin) } else { Vec::new() };
        let receiver = &self.sight.receiver;
        for part in outline.parts() {
            let in_frame: Vec<DVec3> = part.iter().map(|&v| receiver.in_frame(v)).collect();
            events.extend(layers::cuts(&in_frame, low.distance(high)));
        }
        let outer = self.outer();
        let area = polygon_area(&outer);
        let enough = FIRST_SHARE * goal / area;
        let may_hide = UNSEEN * self.whole.area;
        let cells = Cells::cut(
            outer,
            &events,
            margin,
            MAX_CELLS.min(limits.budget / (2 * rule::MAX_EVALUATIONS)),
        );

        let whole = self.whole.area;
        let is_whole = cells.are_whole() && is_listed && !past_bodies;
        let is_loose = is_whole && goal >= LOOSE * whole;
        let is_one_body = self.occluders_are_convex();
        let is_looser = is_loose && goal >= whole;
        let mut unlisted = if occluders.is_empty() {
            0.0
        } else {
            self.sight.error_within(margin)
        };
        let mut sight = self.sight;
        if past_bodies {
            unlisted += (PAST_BODIES_SHARE * goal).min(may_hide);
            sight.find_bodies();
            sight.unlisted = self
                .bodies
                .iter()
                .map(|&body| Extent::of(body, &sight.receiver))
                .collect();
        }
        sight.is_whole = is_whole;
        sight.is_one_body = is_one_body;
        sight.is_loose = is_loose;
        sight.may_hide = may_hide / area;
        if is_whole && !is_one_body {
            sight.find_bodies();
        }
        let mut looks = Vec::new();
        for shape in cells.shapes() {
            if sight.n_cuts() > limits.worth {
                return None;
            }
            let allowed = enough * shape.area();
            let site = sight.site(shape);
            if is_looser && site.views != Views::Any {
                let look = sight.look(site, |f| few::integrate(shape, f));
                if look.estimate.least_error() <= allowed {
                    looks.push(look.with_least_error(FEW_SHARE * enough, sight.may_hide));
                    continue;
                }
            }
            if site.views == Views::Analytic {
                looks.push(sight.look_at_analytic(site, enough));
                continue;
            }
            if is_loose {
                let look = sight.look(site, |f| match shape {
                    Shape::Triangle(corners) => rule::integrate_loosely(corners, f),
                    Shape::Quad(corners) => quad::integrate(corners, f),
                });
                if look.estimate.least_error() <= allowed && !look.has_curves {
                    looks.push(look.with_least_share(enough, sight.may_hide));
                    continue;
                }
            }
            looks.extend(shape.triangles().map(|corners| sight.look_at_triangle(corners, enough)));
        }
        Some(Pieces::new(sight, self.whole, &looks, enough, unlisted).worth(limits.worth))
    }
}

/// Returns the area of a polygon in its plane.
fn polygon_area(corners: &[DVec2]) -> f64 {
    let from_first = |k: usize| corners[k] - corners[0];
    let doubled: f64 = (1..corners.len().saturating_sub(1))
        .map(|k| from_first(k).perp_dot(from_first(k + 1)))
        .sum();
    0.5 * doubled.abs()
}

/// Returns plates as occluders of two sides.
#[cfg(test)]
fn two_sided(plates: &[Vec<DVec3>]) -> Vec<Occluder<'_>> {
    let occluder = |corners| Occluder {
        corners: std::borrow::Cow::from(corners),
        one_sided: false,
        body: None,
    };
    plates.iter().map(occluder).collect()
}
