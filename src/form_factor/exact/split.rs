//! Pairs with something between them, taken apart where there is less between the parts.
//!
//! What an integral with m blockers costs grows faster than m², as lines of change are those of pairs of edges. Halves of a patch mostly have fewer blockers before them, and some see all or nothing.
//! Nine houses on a ground, twelve tetrahedra in a room, ten baffles in a corridor and a hundred leaves over a floor take a fifth to a seventh of the time that they took whole, the baffles a fourth
//! (1.2 s of CPU time for 6.2 s, 1.5 for 11, 2.2 for 9 and 1.4 for 7.9; one run each, at 1e-6).

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use glam::DVec3;

use crate::form_factor::partial::{self, Accuracy, Partial};
use crate::form_factor::sight::whole_where_grazing;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};
use crate::progress::Progress;
use crate::visibility::blockers::{BlockerId, BlockerIndex, PairVisibility};

/// A pair with fewer blockers is not taken apart; of a convex solid no more than three sides count, as the view of one changes little.
const LEAST_BLOCKERS: usize = 5;

/// Times that a pair is halved, at most.
const MOST_HALVINGS: u32 = 12;

/// Halves are worth while if the squares of their numbers of blockers add up to no more than so many times that of the whole.
///
/// The halves of an integral with as many blockers take about as long as the whole.
const WORTH: f64 = 1.9;

/// What a half takes besides, in squares of blockers.
const HALF: f64 = 8.0;

/// Integrates pairs, in parts or as a whole.
pub(super) struct Split<'a> {
    pub(super) index: &'a BlockerIndex,
    pub(super) budget: usize,
    pub(super) progress: &'a dyn Progress,
}

/// What a pair may have.
#[derive(Clone, Copy)]
struct Most {
    /// Its exchange area without blockers, m².
    exchange_area: f64,
    n_evaluations: usize,
    n_halvings: u32,
}

/// A part of a pair: one polygon is a part of that of the pair, the other the pair's own.
struct Half {
    polygons: [Vec<DVec3>; 2],
    view: PairVisibility,
    /// What it takes, in squares of blockers.
    cost: f64,
}

impl Split<'_> {
    /// Returns the exchange area of two polygons to within `goal`, m², where `among` are the blockers that may stand between them and `most` is the exchange area without these.
    pub(super) fn exchange_area(&self, p: &[DVec3], q: &[DVec3], among: &[BlockerId], goal: f64, most: f64) -> Partial {
        let most = Most {
            exchange_area: most,
            n_evaluations: self.budget,
            n_halvings: MOST_HALVINGS,
        };
        self.take([p, q], among, goal, most)
    }

    fn take(&self, [p, q]: [&[DVec3]; 2], among: &[BlockerId], goal: f64, most: Most) -> Partial {
        if self.progress.is_cancelled() {
            return NOTHING;
        }
        let is_many = self.index.count(among) >= LEAST_BLOCKERS && most.n_halvings > 0;
        let Some(halves) = is_many.then(|| self.halves(p, q, among)).flatten() else {
            let smaller_area = [p, q].map(|side| polygon::area_vector(side).length());
            let accuracy = Accuracy {
                tolerance: goal / smaller_area[0].min(smaller_area[1]),
                budget: most.n_evaluations,
            };
            return partial::exchange_area_below(p, q, &self.index.blockers(p, q, among), accuracy, most.exchange_area);
        };
        let part = |half: &Half, n_before: usize| {
            let [p, q] = half.polygons.each_ref().map(Vec::as_slice);
            if half.view == PairVisibility::None {
                return NOTHING;
            }
            let [own, other] = [p, q].map(PreparedPolygon::new);
            let whole = exchange_area(
                &own,
                &other,
                Tolerance {
                    rel: 1e-12,
                    abs: 1e-3 * goal,
                },
            );
            match &half.view {
                PairVisibility::Partial(among) => {
                    let most = Most {
                        exchange_area: whole.value,
                        n_evaluations: most.n_evaluations.saturating_sub(n_before),
                        n_halvings: most.n_halvings - 1,
                    };
                    self.take([p, q], among, 0.5 * goal, most)
                }
                _ => Partial {
                    exchange_area: whole.value,
                    error: whole.error,
                    n_evaluations: 0,
                    reached: whole.error <= 0.5 * goal,
                },
            }
        };
        let one = part(&halves[0], 0);
        let other = part(&halves[1], one.n_evaluations);
        Partial {
            exchange_area: one.exchange_area + other.exchange_area,
            error: one.error + other.error,
            n_evaluations: one.n_evaluations + other.n_evaluations,
            reached: one.error + other.error <= goal,
        }
    }

    /// Returns the halves of the polygon that leaves less between its halves and the other, if that is worth while.
    fn halves(&self, p: &[DVec3], q: &[DVec3], among: &[BlockerId]) -> Option<[Half; 2]> {
        let of_both = [0, 1].map(|k| {
            let cut = if k == 0 { p } else { q };
            halved(cut).map(|half| {
                let polygons = if k == 0 { [half, q.to_vec()] } else { [p.to_vec(), half] };
                let [p, q] = polygons.each_ref().map(Vec::as_slice);
                let found = self.index.classify_cut(p, q, among);
                let view = whole_where_grazing(self.index, found, p, q);
                let cost = match &view {
                    PairVisibility::None => 0.0,
                    PairVisibility::Full => HALF,
                    PairVisibility::Partial(among) => (self.index.count(among) as f64).powi(2) + HALF,
                };
                Half { polygons, view, cost }
            })
        });
        let cost = |halves: &[Half; 2]| halves.iter().map(|half| half.cost).sum::<f64>();
        let [of_p, of_q] = of_both;
        let best = if cost(&of_q) < cost(&of_p) { of_q } else { of_p };
        (cost(&best) <= WORTH * (self.index.count(among) as f64).powi(2)).then_some(best)
    }
}

const NOTHING: Partial = Partial {
    exchange_area: 0.0,
    error: 0.0,
    n_evaluations: 0,
    reached: true,
};

/// Cuts a polygon across its longest edge, through the middle of it.
fn halved(corners: &[DVec3]) -> [Vec<DVec3>; 2] {
    let edges = (0..corners.len()).map(|k| (corners[k], corners[(k + 1) % corners.len()]));
    let longest = edges.max_by(|a, b| a.0.distance_squared(a.1).total_cmp(&b.0.distance_squared(b.1)));
    let Some((a, b)) = longest else {
        return [Vec::new(), Vec::new()];
    };
    [a - b, b - a].map(|side| clip_to_half_space(corners, a.midpoint(b), side))
}
