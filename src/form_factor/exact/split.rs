//! Pairs with occluders, divided where there are fewer occluders between the parts.
//!
//! The cost of an integral with m occluders grows faster than m², as discontinuity lines are those of pairs of edges. Halves of a patch mostly have fewer occluders before them, and some are fully visible or hidden.
//!
//! Parts begin in parallel, each with its share of the tolerance and of half of the budget; the other half goes to the greatest errors.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use glam::DVec3;

use crate::form_factor::partial::{self, Integration, Limits, Partial, Whole};
use crate::form_factor::sight::whole_where_grazing;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::progress::Progress;
use crate::threads;
use crate::visibility::occluders::{OccluderId, OccluderIndex, PairVisibility};
use crate::visibility::plane::Plane;

/// The fewest occluders of a pair that is divided; of a convex solid at most three sides count, as the view of one changes little.
const MIN_OCCLUDERS: usize = 5;

/// Times that a pair is halved, at most.
const MAX_HALVINGS: u32 = 12;

/// The greatest part of the whole's squared number of occluders to which those of two useful halves add up.
///
/// The halves of an integral with as many occluders take about as long as the whole.
const WORTH: f64 = 1.9;

/// The divisor of the budget that gives the evaluations for the relative error of a pair.
const EXTRA: usize = 100;

/// The least ratio of areas that marks a patch and a sun: there are few such pairs, and each stands for much light.
const UNLIKE: f64 = 1e4;

/// The further cost of a half, in squared counts of occluders.
const HALF: usize = 8;

/// The greatest height of one polygon over the other's plane in a narrow gap, as a part of the smaller one's size.
const NARROW: f64 = 0.1;

/// The greatest part of a polygon beyond a plane that counts as rounding, as a part of the smaller one's size.
const NARROWEST: f64 = 1e-9;

/// Integrates pairs, in parts or as a whole.
pub(in crate::form_factor) struct Split<'a> {
    pub(in crate::form_factor) index: &'a OccluderIndex,
    /// Evaluations of the inner factor after which no more begin.
    pub(in crate::form_factor) budget: usize,
    /// The part of an exchange area without occluders that its error is to stay below, as far as a share of the budget goes.
    pub(in crate::form_factor) relative: f64,
    /// The least ratio of areas of pairs with few occluders that are computed to a relative error.
    pub(in crate::form_factor) unlike_of_few: f64,
    pub(in crate::form_factor) progress: &'a dyn Progress,
}

/// A part of a pair that is integrated by itself.
struct Leaf {
    polygons: [Vec<DVec3>; 2],
    among: Vec<OccluderId>,
    /// Its exchange area without occluders.
    whole: Whole,
    /// Its cost, in squared counts of occluders.
    cost: usize,
}

/// The parts of a pair.
struct Parts {
    leaves: Vec<Leaf>,
    /// The exchange area, m², of fully visible parts, and its error.
    full: [f64; 2],
}

/// A half of a pair: a part of one polygon, and the whole of the other.
struct Half {
    polygons: [Vec<DVec3>; 2],
    view: PairVisibility,
    /// Its cost, in squared counts of occluders.
    cost: usize,
}

impl Split<'_> {
    /// Returns the exchange area of two polygons to within `goal`, m².
    ///
    /// `among` are their possible occluders, and `without` is the exchange area without them. Pairs of a patch and a polygon far larger or smaller are also computed to a part of `without`,
    /// as far as the budget over [`EXTRA`] goes.
    pub(in crate::form_factor) fn exchange_area(
        &self,
        p: &[DVec3],
        q: &[DVec3],
        among: &[OccluderId],
        goal: f64,
        without: Whole,
    ) -> Partial {
        if self.index.count(among) < MIN_OCCLUDERS
            && let Some(wall) = self.wall_in_a_gap(p, q, among)
        {
            return self.on_both_sides([p, q], wall, among, goal);
        }
        self.at_once(p, q, among, goal, without)
    }

    /// Returns the test whether to continue.
    fn go_on(&self) -> impl Fn() -> bool {
        || !self.progress.is_cancelled()
    }

    /// Does the work of [`exchange_area`](Self::exchange_area) without a search for narrow gaps.
    fn at_once(&self, p: &[DVec3], q: &[DVec3], among: &[OccluderId], goal: f64, without: Whole) -> Partial {
        let occluders = self.index.occluders(p, q, among);
        let count = self.index.count(among);
        let has_few = count < MIN_OCCLUDERS;
        let closer = if are_unlike(p, q, if has_few { self.unlike_of_few } else { UNLIKE }) {
            goal.min(self.relative * without.area)
        } else {
            goal
        };
        let extra = self.budget / EXTRA;
        if let Some(found) = partial::by_rays([p, q], &occluders, count, closer, self.budget, without, &self.go_on()) {
            return found;
        }
        if has_few {
            let mut whole = Integration::begin([p, q], &occluders, closer, Limits::of(self.budget), without);
            whole.refine(goal, self.budget, &self.go_on());
            whole.refine(closer, extra, &self.go_on());
            return whole.result(goal);
        }
        let uncut = |goal: f64| partial::uncut([p, q], &occluders, goal, without);
        if let Some(found) = uncut(closer) {
            return found;
        }
        if let Some(worth) = partial::clipping_worth(&occluders, count, closer, without) {
            let limits = Limits {
                budget: self.budget,
                worth,
            };
            let found = self.among_many([p, q], among, closer, without, limits);
            if found.error <= closer {
                return found;
            }
            let found = partial::after_all_by_rays([p, q], &occluders, closer, self.budget, without, &self.go_on());
            if let Some(found) = found.filter(|found| found.error <= closer) {
                return found;
            }
        }
        if closer < goal {
            let found = self.among_many([p, q], among, closer, without, Limits::of(extra));
            if found.error <= goal {
                return Partial { reached: true, ..found };
            }
            if let Some(found) = uncut(goal) {
                return found;
            }
        }
        self.among_many([p, q], among, goal, without, Limits::of(self.budget))
    }

    /// Integrates a pair with many occluders.
    ///
    /// Parts first get shares of the goal and of the budget by their estimated work; the rest of both then goes to the greatest errors.
    fn among_many(
        &self,
        [p, q]: [&[DVec3]; 2],
        among: &[OccluderId],
        goal: f64,
        without: Whole,
        limits: Limits,
    ) -> Partial {
        let Parts { leaves, full } = self.parts(p, q, among, goal, without);
        let cost: usize = leaves.iter().map(|leaf| leaf.cost).sum();
        let rest = goal - full[1];
        let begun: Vec<Integration> = threads::collect_from(&leaves, |leaf| {
            let share = leaf.cost as f64 / cost as f64;
            self.begin(leaf, share * rest, limits.share(leaf.cost, cost))
        });
        let found = self.finish(begun, rest, limits.budget);
        Partial {
            exchange_area: full[0] + found.exchange_area,
            error: full[1] + found.error,
            ..found
        }
    }

    /// Returns an occluder whose plane cuts both polygons, if the gap between them is narrow.
    ///
    /// Such a wall hides strips as wide as the gap, which take very many evaluations; between parts on one side of it, it hides nothing.
    fn wall_in_a_gap(&self, p: &[DVec3], q: &[DVec3], among: &[OccluderId]) -> Option<OccluderId> {
        let area_vectors = [p, q].map(polygon::area_vector);
        let size = area_vectors[0].length().min(area_vectors[1].length()).sqrt();
        let height = |of: &[DVec3], over: &[DVec3], area_vector: DVec3| {
            let normal = area_vector.normalize_or_zero();
            of.iter().map(|&v| normal.dot(v - over[0])).fold(0.0, f64::max)
        };
        if height(q, p, area_vectors[0]).min(height(p, q, area_vectors[1])) > NARROW * size {
            return None;
        }
        among.iter().copied().find(|&id| {
            let wall = Plane::of(self.index.corners(id));
            let is_cut = |side: &[DVec3]| {
                let [low, high] = wall.heights(side);
                low < -NARROWEST * size && high > NARROWEST * size
            };
            is_cut(p) && is_cut(q)
        })
    }

    /// Returns the exchange area of two polygons as that of their parts on both sides of a wall, which hides nothing between two parts on one side.
    fn on_both_sides(&self, sides: [&[DVec3]; 2], wall: OccluderId, among: &[OccluderId], goal: f64) -> Partial {
        let Plane { normal, point } = Plane::of(self.index.corners(wall));
        // Rounding may leave a border of a sliver on the other side: the same wall must not cut it again.
        let others: Vec<OccluderId> = among.iter().copied().filter(|&id| id != wall).collect();
        let parts = Split {
            budget: self.budget / 4,
            ..*self
        };
        let goal_of_part = 0.25 * goal;
        let mut sum = Partial {
            exchange_area: 0.0,
            error: 0.0,
            n_evaluations: 0,
            n_rays: 0,
            reached: true,
        };
        let [of_p, of_q] = sides.map(|side| [normal, -normal].map(|up| clip_to_half_space(side, point, up)));
        for (p, is_before) in of_p.iter().zip([true, false]) {
            for (q, is_before_too) in of_q.iter().zip([true, false]) {
                let is_one_side = is_before == is_before_too;
                let whole = Whole::of(p, q, 1e-3 * goal_of_part);
                let found = self.index.classify_cut(p, q, if is_one_side { &others } else { among });
                match whole_where_grazing(self.index, found, p, q) {
                    PairVisibility::None => {}
                    PairVisibility::Full => {
                        sum.exchange_area += whole.area;
                        sum.error += whole.error;
                    }
                    PairVisibility::Partial(among) => {
                        let part = if is_one_side {
                            parts.exchange_area(p, q, &among, goal_of_part, whole)
                        } else {
                            parts.at_once(p, q, &among, goal_of_part, whole)
                        };
                        sum.exchange_area += part.exchange_area;
                        sum.error += part.error;
                        sum.n_evaluations += part.n_evaluations;
                        sum.n_rays += part.n_rays;
                    }
                }
            }
        }
        sum.reached = sum.error <= goal;
        sum
    }

    /// Divides a pair.
    fn parts(&self, p: &[DVec3], q: &[DVec3], among: &[OccluderId], goal: f64, without: Whole) -> Parts {
        let mut parts = Parts {
            leaves: Vec::new(),
            full: [0.0; 2],
        };
        let whole = Leaf {
            polygons: [p.to_vec(), q.to_vec()],
            among: among.to_vec(),
            whole: without,
            cost: 1,
        };
        self.take_apart(whole, goal, MAX_HALVINGS, &mut parts);
        parts
    }

    /// Halves a pair as long as that is worth while.
    fn take_apart(&self, pair: Leaf, goal: f64, n_halvings: u32, parts: &mut Parts) {
        if self.progress.is_cancelled() {
            return;
        }
        let [p, q] = pair.polygons.each_ref().map(Vec::as_slice);
        let is_many = self.index.count(&pair.among) >= MIN_OCCLUDERS && n_halvings > 0;
        let Some(halves) = is_many.then(|| self.halves(p, q, &pair.among)).flatten() else {
            parts.leaves.push(pair);
            return;
        };
        for Half { polygons, view, cost } in halves {
            if view == PairVisibility::None {
                continue;
            }
            let whole = Whole::of(&polygons[0], &polygons[1], 1e-3 * goal);
            if let PairVisibility::Partial(among) = view {
                let half = Leaf {
                    polygons,
                    among,
                    whole,
                    cost,
                };
                self.take_apart(half, 0.5 * goal, n_halvings - 1, parts);
            } else {
                parts.full[0] += whole.area;
                parts.full[1] += whole.error;
            }
        }
    }

    /// Integrates a part to its own goal, as far as half of its share of the budget goes; first looks take at most that.
    fn begin(&self, leaf: &Leaf, goal: f64, limits: Limits) -> Integration {
        let [p, q] = leaf.polygons.each_ref().map(Vec::as_slice);
        let occluders = self.index.occluders(p, q, &leaf.among);
        let mut integration = Integration::begin([p, q], &occluders, goal, limits, leaf.whole);
        integration.refine(goal, limits.budget / 2, &self.go_on());
        integration
    }

    /// Spends the rest of `most` evaluations on the parts with the greatest errors, until all of them together are within the goal.
    fn finish(&self, mut parts: Vec<Integration>, goal: f64, most: usize) -> Partial {
        loop {
            let error: f64 = parts.iter().map(Integration::error).sum();
            let n_evaluations: usize = parts.iter().map(Integration::n_evaluations).sum();
            let open = parts.iter_mut().filter(|part| part.is_open());
            let more = match open.max_by(|a, b| a.error().total_cmp(&b.error())) {
                Some(worst) if error > goal && !self.progress.is_cancelled() => {
                    let budget = worst.n_evaluations() + most.saturating_sub(n_evaluations);
                    let enough = worst.error() - (error - goal);
                    worst.refine(enough.max(0.5 * worst.error()), budget, &self.go_on())
                }
                _ => false,
            };
            if !more {
                let results = parts.into_iter().map(|part| part.result(goal));
                let exchange_area = results.map(|part| part.exchange_area).sum();
                return Partial {
                    exchange_area,
                    error,
                    n_evaluations,
                    n_rays: 0,
                    reached: error <= goal,
                };
            }
        }
    }

    /// Returns the halves of the polygon whose division leaves fewer occluders, if that is worth while.
    fn halves(&self, p: &[DVec3], q: &[DVec3], among: &[OccluderId]) -> Option<[Half; 2]> {
        let of_both = [0, 1].map(|k| {
            let cut = if k == 0 { p } else { q };
            halved(cut).map(|half| {
                let polygons = if k == 0 { [half, q.to_vec()] } else { [p.to_vec(), half] };
                let [p, q] = polygons.each_ref().map(Vec::as_slice);
                let found = self.index.classify_cut(p, q, among);
                let view = whole_where_grazing(self.index, found, p, q);
                let cost = match &view {
                    PairVisibility::None => 0,
                    PairVisibility::Full => HALF,
                    PairVisibility::Partial(among) => self.index.count(among).pow(2) + HALF,
                };
                Half { polygons, view, cost }
            })
        });
        let cost = |halves: &[Half; 2]| halves.iter().map(|half| half.cost).sum::<usize>();
        let [of_p, of_q] = of_both;
        let best = if cost(&of_q) < cost(&of_p) { of_q } else { of_p };
        (cost(&best) as f64 <= WORTH * (self.index.count(among) as f64).powi(2)).then_some(best)
    }
}

/// Returns whether one polygon is `times` as large as the other, or more.
fn are_unlike(p: &[DVec3], q: &[DVec3], times: f64) -> bool {
    let [a, b] = [p, q].map(|side| polygon::area_vector(side).length());
    a.max(b) >= times * a.min(b)
}

/// Cuts a polygon across its longest edge, through the middle of it.
fn halved(corners: &[DVec3]) -> [Vec<DVec3>; 2] {
    let edges = (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]));
    let longest = edges.max_by(|a, b| a.0.distance_squared(a.1).total_cmp(&b.0.distance_squared(b.1)));
    let Some((a, b)) = longest else {
        return [Vec::new(), Vec::new()];
    };
    [a - b, b - a].map(|side| clip_to_half_space(corners, a.midpoint(b), side))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
pub(super) mod tests {
    use std::f64::consts::{PI, TAU};

    use glam::DQuat;

    use super::*;
    use crate::form_factor::partial::{self, Accuracy};
    use crate::progress::Silent;
    use crate::scene::{FaceId, Scene};

    fn split_within(index: &OccluderIndex, budget: usize) -> Split<'_> {
        Split {
            index,
            budget,
            relative: f64::INFINITY,
            unlike_of_few: 1.0,
            progress: &Silent,
        }
    }

    /// Leaves between a floor and a ceiling of 4 m × 4 m, 3 m apart, which are faces 0 and 1.
    pub(in crate::form_factor::exact) fn leaves(n: u32) -> Scene {
        let level = |z: f64| [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)].map(|(x, y)| DVec3::new(x, y, z));
        let [a, b, c, d] = level(3.0);
        let mut outlines = vec![level(0.0), [d, c, b, a]];
        outlines.extend((1..=n).map(|k| {
            // Irrational steps fill all positions and directions evenly.
            let part = |step: f64| (f64::from(k) * step.sqrt()).fract();
            let middle = DVec3::new(0.4 + 3.2 * part(2.0), 0.4 + 3.2 * part(3.0), 0.6 + 1.8 * part(5.0));
            let axis = DVec3::new(part(7.0), part(11.0), part(13.0)) - 0.5;
            let turn = DQuat::from_axis_angle(axis.normalize(), 3.0 * part(17.0));
            let half = 0.15 + 0.2 * part(19.0);
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| middle + turn * (half * DVec3::new(x, y, 0.0)))
        }));
        Scene::of_quads(&outlines)
    }

    #[test]
    fn what_is_not_cut_is_within_what_it_states() {
        let scene = leaves(12);
        let index = OccluderIndex::new(&scene);
        let [floor, ceiling] = [0, 1].map(|k| scene.polygon(FaceId(k)));
        let split = split_within(&index, 10_000_000);
        // A sixteenth of the ceiling, and the whole floor: each sees the other past most of the leaves.
        for (x, y) in [(0.0, 0.0), (0.25, 0.5), (0.75, 0.25)] {
            let corner = |u: f64, v: f64| {
                ceiling[0]
                    .lerp(ceiling[1], x + u)
                    .lerp(ceiling[3].lerp(ceiling[2], x + u), y + v)
            };
            let part = [
                corner(0.0, 0.0),
                corner(0.25, 0.0),
                corner(0.25, 0.25),
                corner(0.0, 0.25),
            ];
            let PairVisibility::Partial(among) = index.classify(&part, &floor) else {
                panic!("leaves occlude");
            };
            let most = Whole::of(&part, &floor, 0.0);
            let found = |goal: f64| split.exchange_area(&part, &floor, &among, goal, most);
            let reference = found(1e-5);
            assert!(reference.reached, "{reference:?}");
            let occluders = index.occluders(&part, &floor, &among);
            for share in [2.0, 0.3, 0.1, 0.03] {
                let goal = share * most.area;
                let uncut = partial::uncut([&part, &floor], &occluders, goal, most).unwrap();
                assert!(10 * uncut.n_evaluations < reference.n_evaluations, "{share} {uncut:?}");
                for loose in [uncut, found(goal)] {
                    let off = (loose.exchange_area - reference.exchange_area).abs();
                    assert!(
                        loose.reached && off <= loose.error + reference.error,
                        "{share} {off:e} {loose:?}"
                    );
                }
            }
            assert_eq!(partial::uncut([&part, &floor], &occluders, 1e-5, most), None);
        }
    }

    /// A floor and a ceiling as in [`leaves`], with a ball of quads between them whose corners stand out and in by a thousandth of its radius.
    fn bumpy_ball(n_rings: u32, n_sectors: u32) -> Scene {
        let walls = leaves(0);
        let mut outlines: Vec<[DVec3; 4]> = [0, 1].map(|k| walls.polygon(FaceId(k)).try_into().unwrap()).to_vec();
        let corner = |ring: u32, sector: u32| {
            let polar = (f64::from(ring) + 0.5) / f64::from(n_rings + 1) * PI;
            let around = f64::from(sector % n_sectors) / f64::from(n_sectors) * TAU;
            let step = f64::from(ring * n_sectors + sector % n_sectors);
            let radius = 0.8 + 8e-4 * (2.0 * (step * 2.0_f64.sqrt()).fract() - 1.0);
            let (sine, cosine) = polar.sin_cos();
            DVec3::new(2.0, 2.0, 1.5) + radius * DVec3::new(sine * around.cos(), sine * around.sin(), cosine)
        };
        for ring in 0..n_rings {
            outlines.extend(
                (0..n_sectors).map(|k| {
                    [(1, k), (1, k + 1), (0, k + 1), (0, k)].map(|(below, sector)| corner(ring + below, sector))
                }),
            );
        }
        Scene::of_quads(&outlines)
    }

    #[test]
    fn a_bumpy_ball_is_left_to_rays_where_its_facets_cut_a_wall_into_too_many_pieces() {
        let scene = bumpy_ball(4, 7);
        let index = OccluderIndex::new(&scene);
        let [floor, ceiling] = [0, 1].map(|k| scene.polygon(FaceId(k)));
        let PairVisibility::Partial(among) = index.classify(&floor, &ceiling) else {
            panic!("the ball occludes");
        };
        let split = split_within(&index, 10_000_000);
        let whole = Whole::of(&floor, &ceiling, 0.0);
        let found = |goal: f64| split.exchange_area(&floor, &ceiling, &among, goal, whole);
        let (loose, tight) = (found(3e-2), found(1e-4));
        assert!(
            loose.n_rays > 0 && tight.n_rays == 0 && tight.reached,
            "{loose:?} {tight:?}"
        );
        let off = (loose.exchange_area - tight.exchange_area).abs();
        assert!(
            loose.reached && off <= loose.error + tight.error,
            "{off:e} {loose:?} {tight:?}"
        );
    }

    #[test]
    fn a_budget_that_is_spent_serves_all_parts() {
        let scene = leaves(9);
        let index = OccluderIndex::new(&scene);
        let [p, q] = [0, 1].map(|k| scene.polygon(FaceId(k)));
        let PairVisibility::Partial(among) = index.classify(&p, &q) else {
            panic!("leaves occlude");
        };
        let occluders = index.occluders(&p, &q, &among);
        let accuracy = |tolerance: f64| Accuracy {
            tolerance,
            budget: 10_000_000,
        };
        let reference = partial::exchange_area(&p, &q, &occluders, accuracy(1e-6));
        assert!(reference.reached, "{reference:?}");
        let with = |budget: usize| split_within(&index, budget);
        let whole = Whole::of(&p, &q, 0.0);
        let n_parts = with(0).parts(&p, &q, &among, 1e-5, whole).leaves.len();
        assert!(n_parts >= 3, "{n_parts}");
        let split = |goal: f64, budget: usize| {
            let split = with(budget);
            let found = split.exchange_area(&p, &q, &among, goal, whole);
            let difference = (found.exchange_area - reference.exchange_area).abs();
            assert!(difference <= found.error + reference.error, "{found:?} {reference:?}");
            assert_eq!(found.reached, found.error <= goal);
            found
        };
        // As a whole it is seen from fewer points, each with more occluders.
        assert!(split(1e-5, 10_000_000).reached);
        let spent = [5_000, 20_000, 80_000].map(|budget| split(1e-10, budget));
        assert!(spent.iter().all(|found| !found.reached));
        assert!(spent.is_sorted_by(|less, more| more.error < 0.5 * less.error));
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| split(1e-10, 20_000)), spent[1], "{threads}");
        }
    }
}
