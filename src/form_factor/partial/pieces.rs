//! The cells of a receiver with their integrals: of the visible or of the hidden part, whichever is known better.
//!
//! Both add up to the exchange area without occluders, ∫ F₀ dA = ∫ V dA + ∫ H dA with 0 ≤ V, H ≤ F₀, whose exact value
//! [`polygon_form_factor`](crate::geometry::polygon_form_factor) has for the whole receiver and, where it is wanted, for one cell. Thus where nothing is hidden,
//! a peak of the kernel between the points of a rule is not lost.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::cells::Shape;
use super::sight::{HIDDEN, Look, Sight, VISIBLE};
use super::{Partial, Whole};

/// A part of the receiver with its integral.
pub(super) struct Piece {
    shape: Shape,
    /// The integral of the part, visible or hidden, that is summed over all pieces of a receiver, m².
    integral: f64,
    error: f64,
    /// How much of the error has the same sign in all pieces.
    alike: f64,
}

impl Piece {
    /// Settles a cell; `base` is the part that is summed, `enough` the error allowed, by area.
    fn new(sight: &Sight, look: &Look, base: usize, enough: f64) -> Self {
        let shape = look.site.shape;
        let [integral, error, alike] = sight.settle(look, base, enough * shape.area());
        Self {
            shape,
            integral,
            error,
            alike,
        }
    }
}

impl PartialEq for Piece {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Piece {}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error)
    }
}

/// A receiver in pieces, all of which have been evaluated.
pub(super) struct Pieces {
    sight: Sight,
    /// The exchange area without occluders.
    whole: Whole,
    /// The part that is summed.
    base: usize,
    /// The error allowed, by area of the receiver.
    enough: f64,
    /// The error that no piece shows.
    unlisted: f64,
    queue: BinaryHeap<Piece>,
    integral: f64,
    errors: Errors,
    n_evaluations: usize,
    /// The cuts of fragments after which refinement ends.
    worth: usize,
}

/// The number of cuts after which `go_on` is called: about a millisecond of them.
const CUTS_AT_ONCE: u32 = 64;

/// The part to which sums of errors have shrunk when they are summed anew: squares shrink to 1e-6, and keep ten digits.
const SHRUNK: f64 = 1e-3;

/// The errors of pieces together.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    sum: f64,
    /// The sum of what has the same sign in all pieces.
    alike: f64,
    /// The sum of the squares of the rest.
    squares: f64,
}

impl Errors {
    /// Adds the error of a piece, of which `alike` has the same sign in all pieces.
    fn add(&mut self, error: f64, alike: f64) {
        self.sum += error;
        self.alike += alike;
        self.squares += (error - alike).powi(2);
    }

    /// Removes an error. Rounding is that of the largest sums so far: [`SHRUNK`] decides when to sum anew.
    fn remove(&mut self, error: f64, alike: f64) {
        self.sum -= error;
        self.alike -= alike;
        self.squares -= (error - alike).powi(2);
    }

    /// Returns the error of the sum: for few pieces the sum of their errors, for many what they have alike and twice the root of the sum of squares of the rest.
    ///
    /// The signs of the rest are independent between pieces. Where each is below half of its estimate, their sum is beyond this in at most 0.7 of 1,000 cases (Hoeffding's inequality).
    fn together(self) -> f64 {
        self.sum.min(self.alike.max(0.0) + 2.0 * self.squares.max(0.0).sqrt())
    }

    fn of_pieces<'a>(pieces: impl IntoIterator<Item = &'a Piece>) -> Self {
        let mut all = Self::default();
        pieces.into_iter().for_each(|piece| all.add(piece.error, piece.alike));
        all
    }
}

impl Pieces {
    /// Sums the smaller of the two parts; `enough` is the error allowed, by area of the receiver, and `unlisted` the error that no look shows.
    pub(super) fn new(sight: Sight, whole: Whole, looks: &[Look], enough: f64, unlisted: f64) -> Self {
        let sum = |part: usize| looks.iter().map(|look| look.estimate.integral[part]).sum::<f64>();
        let base = if sight.is_loose || sum(VISIBLE) < sum(HIDDEN) {
            VISIBLE
        } else {
            HIDDEN
        };
        let n_evaluations = looks.iter().map(|look| look.estimate.n_evaluations).sum();
        let settled = looks.iter().map(|look| Piece::new(&sight, look, base, enough));
        let queue: BinaryHeap<Piece> = settled.collect();
        Self {
            whole,
            base,
            enough,
            unlisted,
            integral: queue.iter().map(|piece| piece.integral).sum(),
            errors: Errors::of_pieces(&queue),
            queue,
            n_evaluations,
            worth: usize::MAX,
            sight,
        }
    }

    /// Ends refinement after so many cuts of fragments.
    pub(super) fn worth(self, worth: usize) -> Self {
        Self { worth, ..self }
    }

    /// Returns whether more cuts than are worth while have been made.
    pub(super) fn is_given_up(&self) -> bool {
        self.sight.n_cuts() > self.worth
    }

    pub(super) fn n_evaluations(&self) -> usize {
        self.n_evaluations
    }

    /// Counts evaluations without a result.
    pub(super) fn spent(mut self, n_evaluations: usize) -> Self {
        self.n_evaluations += n_evaluations;
        self
    }

    /// Returns the estimate of the error so far, m².
    pub(super) fn error(&self) -> f64 {
        self.exchange_area(self.integral, self.errors.together()).error
    }

    /// Cuts pieces in two, the one with the greatest error first.
    pub(super) fn refine(&mut self, goal: f64, budget: usize, go_on: &dyn Fn() -> bool) -> bool {
        let n_before = self.n_evaluations;
        // Below the errors that no cut reduces, more cuts gain nothing.
        let least = 0.1 * self.exchange_area(self.integral, 0.0).error;
        let mut summed = self.errors.sum;
        let mut n_cuts: u32 = 0;
        while self.n_evaluations < budget && !self.is_given_up() {
            n_cuts = n_cuts.wrapping_add(1);
            if n_cuts.is_multiple_of(CUTS_AT_ONCE) && !go_on() {
                break;
            }
            let is_open = |pieces: &Self| pieces.error() > goal && pieces.errors.together() > least;
            let has_shrunk = self.errors.sum.is_nan() || self.errors.sum < SHRUNK * summed;
            if has_shrunk || !is_open(self) {
                self.errors = Errors::of_pieces(&self.queue);
                summed = self.errors.sum;
                if !is_open(self) {
                    break;
                }
            }
            let Some(worst) = self.queue.pop() else {
                break;
            };
            let mut parts = worst.shape.halves().map(|corners| {
                let look = self.sight.look_at_triangle(corners, self.enough);
                self.n_evaluations += look.estimate.n_evaluations;
                Piece::new(&self.sight, &look, self.base, self.enough)
            });
            // Where the estimate has just been seen to fail, those of the parts are not trusted either.
            let change = parts.iter().map(|part| part.integral).sum::<f64>() - worst.integral;
            let excess = change.abs() / worst.error;
            self.integral += change;
            self.errors.remove(worst.error, worst.alike);
            for part in &mut parts {
                let own = &mut part.error;
                *own = own.max((*own * excess).min(0.5 * change.abs()));
                self.errors.add(*own, part.alike);
            }
            self.queue.extend(parts);
        }
        self.n_evaluations > n_before
    }

    /// Returns the exchange area from a sum of all pieces, between 0 and that without occluders.
    fn exchange_area(&self, integral: f64, error: f64) -> Whole {
        let (area, error) = if self.base == HIDDEN {
            (self.whole.area - integral, error + self.unlisted + self.whole.error)
        } else {
            (integral, error + self.unlisted)
        };
        let area = area.clamp(0.0, self.whole.area);
        Whole {
            area,
            error: self.whole.bounded(area, error),
        }
    }

    pub(super) fn result(self, goal: f64) -> Partial {
        let mut pieces: Vec<&Piece> = self.queue.iter().collect();
        pieces.sort_unstable(); // the small ones first, for the sake of the sums
        let integral = pieces.iter().map(|piece| piece.integral).sum();
        let errors = Errors::of_pieces(pieces.iter().copied());
        let found = self.exchange_area(integral, errors.together());
        Partial {
            exchange_area: found.area,
            error: found.error,
            n_evaluations: self.n_evaluations,
            n_rays: 0,
            reached: found.error <= goal,
        }
    }
}

/// Sums the smaller part of triangles without discontinuity lines between them: `unseen` is the area that a shadow between all points may hide, m².
pub(super) fn sum_uncut(looks: impl Iterator<Item = Look>, whole: Whole, unseen: f64) -> Partial {
    let (mut integrals, mut errors, mut n_evaluations) = ([0.0; 2], [Errors::default(); 2], 0);
    for look in looks {
        for part in [VISIBLE, HIDDEN] {
            integrals[part] += look.estimate.integral[part];
            errors[part].add(look.estimate.error[part], look.layers[part]);
        }
        n_evaluations += look.estimate.n_evaluations;
    }
    let missed = (integrals[VISIBLE] + integrals[HIDDEN] - whole.area).abs();
    let is_hidden = integrals[HIDDEN] < integrals[VISIBLE];
    let (value, error) = if is_hidden {
        (whole.area - integrals[HIDDEN], errors[HIDDEN].together() + whole.error)
    } else {
        (integrals[VISIBLE], errors[VISIBLE].together())
    };
    let value = value.clamp(0.0, whole.area);
    let error = whole.bounded(value, error + unseen + missed);
    Partial {
        exchange_area: value,
        error,
        n_evaluations,
        n_rays: 0,
        reached: true,
    }
}
