//! An integral over a receiver that more work can refine, and the most work for it.

use glam::DVec3;

use super::pieces::Pieces;
use super::{Partial, View, Whole};
use crate::visibility::occluders::Occluder;

/// The most work for an integral.
#[derive(Clone, Copy, Debug)]
pub(in crate::form_factor) struct Limits {
    /// See [`Accuracy::budget`].
    pub(in crate::form_factor) budget: usize,
    /// The cuts of fragments that are worth while: a first look that takes more is given up.
    pub(in crate::form_factor) worth: usize,
}

impl Limits {
    /// Returns a budget that is worth while in any case.
    pub(in crate::form_factor) fn of(budget: usize) -> Self {
        Self {
            budget,
            worth: usize::MAX,
        }
    }

    /// Returns a share of both.
    pub(in crate::form_factor) fn share(self, part: usize, of: usize) -> Self {
        let share = |n: usize| n.saturating_mul(part) / of;
        Self {
            budget: share(self.budget),
            worth: if self.worth == usize::MAX {
                self.worth
            } else {
                share(self.worth)
            },
        }
    }
}

/// An integral that more work can refine.
pub(in crate::form_factor) struct Integration {
    state: State,
}

enum State {
    /// More work would gain nothing.
    Done(Partial),
    Open(Box<Pieces>),
}

impl Integration {
    /// Looks at all cells once.
    ///
    /// See [`exchange_area`] for the arguments; `goal` is the error wanted, m², and `whole` the exchange area without occluders.
    pub(in crate::form_factor) fn begin(
        sides: [&[DVec3]; 2],
        occluders: &[Occluder<'_>],
        goal: f64,
        limits: Limits,
        whole: Whole,
    ) -> Self {
        let view = || View::new(sides, occluders, whole);
        match view() {
            Ok(first) => match first.look(view, goal, limits) {
                Some(pieces) => Self::open(pieces),
                None => Self::given_up(whole),
            },
            Err(nothing) => Self::without_looking(nothing),
        }
    }

    fn open(pieces: Pieces) -> Self {
        Self {
            state: State::Open(Box::new(pieces)),
        }
    }

    /// Anything between all and nothing.
    fn given_up(whole: Whole) -> Self {
        Self {
            state: State::Done(Partial {
                exchange_area: 0.5 * whole.area,
                error: 0.5 * whole.area + whole.error,
                n_evaluations: 0,
                n_rays: 0,
                reached: false,
            }),
        }
    }

    fn without_looking(value: f64) -> Self {
        Self {
            state: State::Done(Partial {
                exchange_area: value,
                error: value,
                n_evaluations: 0,
                n_rays: 0,
                reached: !value.is_nan(),
            }),
        }
    }

    /// Cuts the worst pieces until the error is within `goal`, m², `budget` evaluations are spent in all, or `go_on` returns false. Returns whether it did any work.
    pub(in crate::form_factor) fn refine(&mut self, goal: f64, budget: usize, go_on: &dyn Fn() -> bool) -> bool {
        match &mut self.state {
            State::Done(_) => false,
            State::Open(pieces) => pieces.refine(goal, budget, go_on),
        }
    }

    /// Returns whether more work would change anything.
    pub(in crate::form_factor) fn is_open(&self) -> bool {
        matches!(self.state, State::Open(_))
    }

    /// Returns the estimate of the error so far, m².
    pub(in crate::form_factor) fn error(&self) -> f64 {
        match &self.state {
            State::Done(partial) => partial.error,
            State::Open(pieces) => pieces.error(),
        }
    }

    pub(in crate::form_factor) fn n_evaluations(&self) -> usize {
        match &self.state {
            State::Done(partial) => partial.n_evaluations,
            State::Open(pieces) => pieces.n_evaluations(),
        }
    }

    /// Returns the result, and whether `goal`, m², is reached.
    pub(in crate::form_factor) fn result(self, goal: f64) -> Partial {
        match self.state {
            State::Done(partial) => partial,
            State::Open(pieces) => pieces.result(goal),
        }
    }
}
