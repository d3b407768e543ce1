//! The exchange area of two polygons past many occluders, from rays between them.

use std::cell::LazyCell;

use glam::DVec3;

use super::between::Between;
use super::{Partial, Whole};
use crate::visibility::occluders::Occluder;

/// Independent scrambles, whose spread is the error.
const SCRAMBLES: usize = 16;

/// The first number of rays of each scramble; it is doubled until the error is small enough.
const FIRST: usize = 2;

/// The error in standard errors of the mean.
///
/// Of Student's distribution with 15 degrees of freedom, 999 in 1,000 are within 4.07; a stop at a spread that is small by chance needs a margin.
const SPREADS: f64 = 4.5;

/// The number of rays that may have missed an occluder, where some were stopped and others passed.
const MISSED: f64 = 3.0;

/// The same where all were stopped, or none: in three of 10,000 cases, n rays all miss a part that 8 in n would meet.
const MISSED_BY_ALL: f64 = 8.0;

/// The fewest occluders apart from sides of solids for rays; fewer are clipped, unless there are solids too.
const MIN_LOOSE: usize = 3;

/// The same for all occluders.
const MIN_ALL: usize = 5;

/// The share of the allowed error for rays of most pairs: the true errors of clipping are mostly far smaller than stated, those of rays are not, and rows have many of them.
const SHARE: f64 = 0.3;

/// The same for pairs that exchange far more than the allowed error: rows have few of them, and each takes many rays.
const MOST: f64 = 0.9;

/// The exchange area without occluders, in units of the allowed error, from which on the share grows.
const LARGE: f64 = 10.0;

/// The power by which it grows: with n rays for an error of n^(−5/8), the squared error of a row is least for its rays if errors grow by 4/9.
const GROWTH: f64 = 4.0 / 9.0;

/// The rays beyond the first that take about as long as clipping, for the number of occluders to the power 1.5.
///
/// Fitted to the times of both for pairs in rooms, cities, hills and trees: `docs/performance.md`.
const PER_OCCLUDER: f64 = 10.0;

/// The same for the square of the number of corners that loose occluders have beyond those of a connected surface: each pair of their edges may cross in a view.
const PER_CROSSING: f64 = 5.0;

/// How many times more than that may be traced before rays count as in vain.
const IN_VAIN: f64 = 4.0;

/// Rays of a scramble after which it is asked whether to go on; some milliseconds.
const UNTIL_ASKED: usize = 4096;

/// The cuts of a fragment of the target by a shadow that count as a ray.
///
/// Chosen such that a ball that is not quite round is left to rays, and a furnished room takes no longer: `docs/performance.md`.
const CUTS_OF_RAY: f64 = 50.0;

/// How many times the expected time of rays clipping may take before it is given up.
const PATIENCE: f64 = 2.0;

/// Returns the error that rays are to reach, m².
fn enough(goal: f64, whole: Whole) -> f64 {
    goal * (SHARE * (whole.area / (LARGE * goal)).powf(GROWTH)).clamp(SHARE, MOST)
}

/// Returns the number of rays that a pair is expected to need, by its exchange area without occluders in units of the error allowed.
///
/// The error of n scrambled rays falls as n^(−5/8), as each is stopped or passes: between n^(−1/2) of independent rays and n^(−3/4) of the best for regions of four dimensions.
fn expected(ratio: f64) -> f64 {
    (SCRAMBLES * FIRST) as f64 + (0.5 * SPREADS * ratio).powf(1.6)
}

/// Returns the expected cost of a pair in rays, by its exchange area without occluders in units of the error allowed and by the number of occluders.
///
/// It is that of rays or of clipping, whichever is less; the power is that of the times of 59,725 pairs among loose triangles.
pub(in crate::form_factor) fn expected_cost(ratio: f64, n_occluders: usize) -> f64 {
    let whole = Whole {
        area: ratio,
        error: 0.0,
    };
    let n = 1.0 + n_occluders as f64;
    expected(ratio / enough(1.0, whole)).min((SCRAMBLES * FIRST) as f64 + n * n * n.sqrt())
}

/// Returns the number of cuts of fragments that take twice as long as rays are expected to take; `None` for pairs without rays.
///
/// See [`by_rays`] for the arguments. How many fragments shadows leave is known only once they are cut; where more cuts are needed, [`after_all_by_rays`] takes less time.
pub(in crate::form_factor) fn clipping_worth(
    occluders: &[Occluder<'_>],
    count: usize,
    goal: f64,
    whole: Whole,
) -> Option<usize> {
    let n_cuts = PATIENCE * CUTS_OF_RAY * expected(whole.area / enough(goal, whole));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    may_be_traced(occluders, count).then_some(n_cuts as usize)
}

/// Returns whether there are enough occluders for rays.
fn may_be_traced(occluders: &[Occluder<'_>], count: usize) -> bool {
    let n_loose = occluders.iter().filter(|occluder| !occluder.one_sided).count();
    n_loose >= MIN_LOOSE || count >= MIN_ALL
}

/// Returns whether rays take less time than clipping past `n_occluders`, of which the loose ones have `n_corners`.
fn are_worth(n_rays: f64, n_occluders: usize, n_corners: impl FnOnce() -> usize) -> bool {
    let of_occluders = (SCRAMBLES * FIRST) as f64 + PER_OCCLUDER * (n_occluders as f64).powf(1.5);
    n_rays <= of_occluders || {
        let beyond = n_corners().saturating_sub(n_occluders) as f64;
        n_rays <= of_occluders + PER_CROSSING * beyond * beyond
    }
}

/// Returns the exchange area of two polygons with occluders between them to within `goal`, m², by rays.
///
/// `None` where clipping takes less time, or rays turn out to take more than expected.
/// `count` is the number of occluders, at most three sides for each solid; `whole` is the exchange area without them. After `budget` rays, or once `go_on` returns false, the result is that of the rays so far.
///
/// A F = whole − ∫∫ K (1 − V) dA dA, by scrambled Sobol points on one polygon and on the other, or in the solid angle of the other where that is near; the part of `whole` that the unoccluded kernel K misses on the same rays
/// is corrected in proportion. Sixteen independent scrambles: the error is 4.5 standard errors of their mean, and the part that all rays may have missed. Equal arguments give equal bits.
/// Source: [`OWEN_1997`](crate::references::OWEN_1997) for the points; directions by J. Arvo, "Stratified Sampling of Spherical Triangles", SIGGRAPH 1995. Departures: none.
pub(in crate::form_factor) fn by_rays(
    sides: [&[DVec3]; 2],
    occluders: &[Occluder<'_>],
    count: usize,
    goal: f64,
    budget: usize,
    whole: Whole,
    go_on: &dyn Fn() -> bool,
) -> Option<Partial> {
    if !may_be_traced(occluders, count) {
        return None;
    }
    let corners = LazyCell::new(|| n_corners(occluders.iter().filter(|occluder| !occluder.one_sided)));
    let are_worth = |n_rays: f64| are_worth(n_rays, count, || *corners);
    if !are_worth(expected(whole.area / enough(goal, whole))) {
        return None;
    }
    trace(sides, occluders, goal, budget, &are_worth, whole, go_on)
}

/// Returns the same where clipping turned out to take more time.
pub(in crate::form_factor) fn after_all_by_rays(
    sides: [&[DVec3]; 2],
    occluders: &[Occluder<'_>],
    goal: f64,
    budget: usize,
    whole: Whole,
    go_on: &dyn Fn() -> bool,
) -> Option<Partial> {
    // As much again as clipping has taken in vain: how much more it would take is unknown.
    let most = PATIENCE * expected(whole.area / enough(goal, whole));
    trace(sides, occluders, goal, budget, &|n_rays| n_rays <= most, whole, go_on)
}

/// Traces rays until their share of the goal is reached; once they are more than [`IN_VAIN`] times as many as `are_worth` it, the goal itself is enough, or the result is `None`.
fn trace(
    sides: [&[DVec3]; 2],
    occluders: &[Occluder<'_>],
    goal: f64,
    budget: usize,
    are_worth: &dyn Fn(f64) -> bool,
    whole: Whole,
    go_on: &dyn Fn() -> bool,
) -> Option<Partial> {
    let enough = enough(goal, whole);
    if budget < SCRAMBLES * FIRST {
        return None;
    }
    let mut between = Between::new(sides, occluders)?;
    let mut streams: [_; SCRAMBLES] = std::array::from_fn(|k| between.stream(k));
    let (mut n, mut sums) = (FIRST, [[0.0; 3]; SCRAMBLES]);
    let (mut n_done, mut n_seeing, mut n_stopped) = (0, 0, 0);
    let mut found = None;
    loop {
        between.expect(n * SCRAMBLES);
        for (stream, [all, hidden, squared]) in streams.iter_mut().zip(&mut sums) {
            for k in n_done..n {
                if k % UNTIL_ASKED == 0 && found.is_some() && !go_on() {
                    return found;
                }
                let (weight, ends) = between.ray(stream.next_point());
                *all += weight;
                *squared += weight * weight;
                if weight > 0.0 {
                    n_seeing += 1;
                    if between.stop(ends) {
                        *hidden += weight;
                        n_stopped += 1;
                    }
                }
            }
        }
        n_done = n;
        let n_rays = n * SCRAMBLES;
        let are_alike = n_stopped == 0 || n_stopped == n_seeing;
        let Whole { area, error } = estimate(&sums, n, are_alike, whole);
        found = Some(Partial {
            exchange_area: area,
            error,
            n_evaluations: 0,
            n_rays,
            reached: error <= goal,
        });
        if error <= enough {
            return found;
        }
        n *= 2;
        if n * SCRAMBLES > budget {
            return found;
        }
        if !are_worth((n * SCRAMBLES) as f64 / IN_VAIN) {
            return found.filter(|found| found.reached);
        }
    }
}

/// Returns the number of distinct corners of some polygons.
fn n_corners<'a>(polygons: impl Iterator<Item = &'a Occluder<'a>>) -> usize {
    let corners = polygons.flat_map(|polygon| polygon.corners.iter());
    let mut places: Vec<[u64; 3]> = corners.map(|v| v.to_array().map(|x| (x + 0.0).to_bits())).collect();
    places.sort_unstable();
    places.dedup();
    places.len()
}

/// Returns the estimate from `n` rays of each scramble; the sums are of the kernel on all rays, on the stopped ones, and of its squares on all. `are_alike` is true if all rays of positive weight are stopped, or none.
///
/// The error sums the spread of the scrambles, the part that the rays may have missed, and the error of the kernel on the rays; it is at most the visible or the hidden part, whichever is more.
/// Where the kernel differs from ray to ray, the rays count as fewer.
fn estimate(sums: &[[f64; 3]; SCRAMBLES], n: usize, are_alike: bool, whole: Whole) -> Whole {
    let count = SCRAMBLES as f64;
    let [all, hidden, squared] = [0, 1, 2].map(|k| sums.iter().map(|sum| sum[k]).sum::<f64>());
    let share = if all > 0.0 { hidden / all } else { 0.0 };
    let of_scramble = sums.map(|[all, hidden, _]| (hidden - share * all) / n as f64 + share * whole.area);
    let mean = of_scramble.iter().sum::<f64>() / count;
    let variance = of_scramble.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let n_rays = n * SCRAMBLES;
    let missed = if are_alike { MISSED_BY_ALL } else { MISSED };
    let area = (whole.area - mean).clamp(0.0, whole.area);
    let off = (all / n_rays as f64 - whole.area).abs() * share.max(1.0 - share);
    let unseen = if squared > 0.0 {
        (missed * squared / (all * all)).min(1.0)
    } else {
        1.0
    };
    let error = SPREADS * (variance / count).sqrt() + whole.area * unseen + off + whole.error;
    Whole {
        area,
        error: whole.bounded(area, error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::partial::two_sided;
    use crate::form_factor::partial::{Accuracy, exchange_area};

    fn square(corner: DVec3, a: DVec3, b: DVec3) -> Vec<DVec3> {
        vec![corner, corner + a, corner + a + b, corner + b]
    }

    /// Squares that face each other, touch along an edge, and lie far apart, with plates between: rays against clipping, and the stated error.
    #[test]
    fn rays_agree_with_clipping() {
        let floor = square(DVec3::ZERO, DVec3::X, DVec3::Y);
        let targets = [
            square(DVec3::Z, DVec3::Y, DVec3::X),
            square(DVec3::ZERO, DVec3::Y, DVec3::Z),
            square(DVec3::new(0.0, 0.0, 12.0), DVec3::Y, DVec3::X),
        ];
        let part = |k: i32, step: f64| (f64::from(k) * step.sqrt()).fract();
        let (mut n, mut n_beyond, mut worst) = (0, 0, 0.0_f64);
        for target in &targets {
            let whole = Whole::of(&floor, target, 0.0);
            for case in 0..40 {
                let plates: Vec<Vec<DVec3>> = (0..6)
                    .map(|k| {
                        let k = 6 * case + k;
                        let corner = DVec3::new(0.9 * part(k, 2.0), 0.9 * part(k, 3.0), 0.1 + 0.7 * part(k, 5.0));
                        square(
                            corner,
                            DVec3::X * 0.3 * part(k, 7.0),
                            DVec3::new(0.0, 0.3, 0.2 * part(k, 11.0)),
                        )
                    })
                    .collect();
                let occluders = two_sided(&plates);
                let accuracy = Accuracy {
                    tolerance: 1e-5,
                    budget: 10_000_000,
                };
                let exact = exchange_area(&floor, target, &occluders, accuracy);
                for goal in [1.0, 0.1].map(|share| share * whole.area) {
                    // Enough occluders for rays to be worth it.
                    let by =
                        |p: &[DVec3], q: &[DVec3]| by_rays([p, q], &occluders, 100, goal, usize::MAX, whole, &|| true);
                    let found = by(&floor, target).expect("enough rays");
                    assert_eq!(Some(found), by(target, &floor));
                    let off = (found.exchange_area - exact.exchange_area).abs() / (found.error + exact.error);
                    assert!(found.error <= goal && found.n_rays >= SCRAMBLES * FIRST);
                    (n, n_beyond) = (n + 1, n_beyond + usize::from(off > 1.0));
                    worst = worst.max(off);
                }
            }
        }
        assert!(n == 240 && n_beyond == 0, "{n_beyond} of {n}, {worst}");
        assert!(worst > 0.2, "{worst}: the error is stated too large");
    }

    #[test]
    fn rays_end_once_they_are_told_to() {
        let floor = square(DVec3::ZERO, DVec3::X, DVec3::Y);
        let ceiling = square(DVec3::Z, DVec3::Y, DVec3::X);
        let plates = [0.1, 0.4, 0.7].map(|x| square(DVec3::new(x, x, 0.5), 0.2 * DVec3::X, DVec3::new(0.1, 0.2, 0.1)));
        let occluders = two_sided(&plates);
        let whole = Whole::of(&floor, &ceiling, 0.0);
        let by = |budget: usize, go_on: bool| {
            let goal = 1e-3 * whole.area;
            by_rays([&floor, &ceiling], &occluders, 1500, goal, budget, whole, &|| go_on)
        };
        let [all, part, cheap] = [(usize::MAX, true), (usize::MAX, false), (1000, true)]
            .map(|(budget, go_on)| by(budget, go_on).expect("rays"));
        assert!(all.reached && part.n_rays == UNTIL_ASKED * SCRAMBLES && part.n_rays < all.n_rays);
        assert!(!cheap.reached && (500..=1000).contains(&cheap.n_rays), "{cheap:?}");
        for less in [part, cheap] {
            let off = (all.exchange_area - less.exchange_area).abs();
            assert!(
                off <= all.error + less.error && all.error < less.error,
                "{all:?} {less:?}"
            );
        }
        assert_eq!(by(SCRAMBLES * FIRST - 1, true), None);
    }

    #[test]
    fn the_share_of_the_error_grows_with_the_exchange() {
        let share = |ratio: f64| {
            let whole = Whole {
                area: ratio,
                error: 0.0,
            };
            enough(1.0, whole)
        };
        let expected = [SHARE, SHARE, SHARE * 2.0_f64.powf(GROWTH), MOST];
        for (ratio, expected) in [0.0, LARGE, 2.0 * LARGE, 1e4].into_iter().zip(expected) {
            assert!((share(ratio) - expected).abs() < 1e-12, "{ratio}");
        }
    }

    #[test]
    fn the_expected_cost_is_that_of_the_cheaper_way() {
        assert!(expected_cost(100.0, 200) > 5.0 * expected_cost(10.0, 200), "by rays");
        assert!(expected_cost(1e9, 20) > 10.0 * expected_cost(1e9, 5), "by clipping");
        assert!(expected_cost(1e9, 5) < expected_cost(1e9, 200) && expected_cost(1.0, 200) < expected_cost(1e9, 200));
    }

    /// Where rays become more than they are worth, what is within the goal is not thrown away.
    #[test]
    fn rays_within_the_goal_are_kept() {
        let floor = square(DVec3::ZERO, DVec3::X, DVec3::Y);
        let ceiling = square(DVec3::Z, DVec3::Y, DVec3::X);
        let plates = [0.1, 0.4, 0.7].map(|x| square(DVec3::new(x, x, 0.5), 0.2 * DVec3::X, DVec3::new(0.1, 0.2, 0.1)));
        let occluders = two_sided(&plates);
        let whole = Whole::of(&floor, &ceiling, 0.0);
        let by = |goal: f64| {
            let are_worth = |n_rays: f64| n_rays <= 1024.0 / IN_VAIN;
            trace(
                [&floor, &ceiling],
                &occluders,
                goal,
                usize::MAX,
                &are_worth,
                whole,
                &|| true,
            )
        };
        let free = trace([&floor, &ceiling], &occluders, 0.0, 1024, &|_| true, whole, &|| true).expect("rays");
        assert!(free.n_rays == 1024 && !free.reached, "{free:?}");
        let kept = by(1.01 * free.error).expect("within the goal");
        assert_eq!(Partial { reached: true, ..free }, kept);
        assert_eq!(by(0.99 * free.error), None);
    }

    #[test]
    fn rays_are_chosen_where_clipping_would_cost_more() {
        let are_worth = |n_occluders, n_corners, ratio| are_worth(expected(ratio), n_occluders, || n_corners);
        assert!(!are_worth(5, 0, 1000.0));
        assert!(are_worth(5, 0, 1.0) && are_worth(30, 20, 20.0));
        assert!(are_worth(40, 120, 60.0), "loose leaves");
        assert!(!are_worth(40, 24, 60.0), "sides of one surface");
        assert!(!are_worth(1400, 1000, 3500.0));
        let square = square(DVec3::ZERO, DVec3::X, DVec3::Y);
        let whole = Whole { area: 1.0, error: 0.0 };
        assert_eq!(
            by_rays([&square, &square], &[], 2, 1.0, usize::MAX, whole, &|| true),
            None
        );
    }
}
