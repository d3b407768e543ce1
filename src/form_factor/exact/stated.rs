//! The error that is stated of a pair: the integral's own and that of rounded corners, and how both compare with the tolerance.

use glam::DVec3;

use super::batches::{Batches, Strip};
use crate::form_factor::PairCounts;
use crate::form_factor::journal::Record;
use crate::form_factor::pairs::Exchange;
use crate::form_factor::rounded::{self, Rounded};
use crate::mesh::PatchId;
use crate::visibility::occluders::{OccluderId, OccluderIndex, PairVisibility};

/// The relative rounding of errors that were stored in f32, at most.
pub(super) const STORED: f64 = 1e-6;

/// The part of the tolerance below which the error of rounding is not refined.
const NEGLIGIBLE: f64 = 1e-3;

/// The part of the tolerance below which the exchange by rounding of patches behind each other is not stated.
const UNSTATED: f64 = 1e-2;

/// The reach of rounded corners between patches that they were meant to touch, in units of the slack up to which it is ignored.
///
/// It is half a unit of the last place for each of two.
const REACH: f64 = 0.5;

/// The visible parts of two patches, as far as rounding affects them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    /// A_i F_ij, m².
    pub(super) exchange: f64,
    /// The same without occluders, m².
    pub(super) unoccluded: f64,
    /// The change of that exchange where the two were moved to meet, beyond the first order, m².
    pub(super) moved: f64,
    /// True if an occluder was left out that reaches in between the two by no more than rounding explains.
    pub(super) touched: bool,
    /// Their occluders.
    pub(super) occluders: &'a [OccluderId],
}

impl Seen<'_> {
    /// Returns the view of a pair without occluders.
    pub(super) fn whole(exchange: f64, touched: bool) -> Self {
        Self {
            exchange,
            unoccluded: exchange,
            moved: 0.0,
            touched,
            occluders: &[],
        }
    }
}

/// An exchange area with all of its error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stated {
    pub(super) exchange: Exchange,
    /// The part of the error that comes from rounded corners, m².
    rounding: f64,
    /// True if the error without that of rounding was within the tolerance.
    integrated: bool,
    /// The rays of its estimate; 0 where it was clipped.
    pub(super) n_rays: u64,
}

impl Stated {
    /// Stores the number of rays of its estimate.
    pub(super) fn with_rays(self, n_rays: usize) -> Self {
        Self {
            n_rays: n_rays as u64,
            ..self
        }
    }

    /// Returns it as a journal stores it; the sign of the rounding, which is not negative, stands for `integrated`.
    pub(super) fn to_record(self) -> Record {
        let sign = if self.integrated { 1.0_f64 } else { -1.0 };
        let Exchange { area, error } = self.exchange;
        let [area, error, rounding] = [area, error, self.rounding.copysign(sign)].map(f64::to_bits);
        [area, error, rounding, self.n_rays]
    }

    /// Reads the result of [`to_record`](Self::to_record); `None` for any other record.
    pub(super) fn from_record(record: Record) -> Option<Self> {
        let [numbers @ .., n_rays] = record;
        let [area, error, rounding] = numbers.map(f64::from_bits);
        let is_right = [area, error, rounding].iter().all(|x| x.is_finite()) && area >= 0.0 && error >= 0.0;
        is_right.then_some(Self {
            exchange: Exchange { area, error },
            rounding: rounding.abs(),
            integrated: rounding.is_sign_positive(),
            n_rays,
        })
    }
}

impl Batches<'_> {
    /// Returns an exchange area with the error of rounded corners added; `integrated` is true if the error without that is within the tolerance.
    pub(super) fn stated(&self, pair: [usize; 2], seen: Seen<'_>, exchange: Exchange, integrated: bool) -> Stated {
        let rounding = self.rounding(pair, seen);
        Stated {
            exchange: Exchange {
                error: exchange.error + rounding,
                ..exchange
            },
            rounding,
            integrated,
            n_rays: 0,
        }
    }

    /// Counts a pair whose error is above the tolerance, by its cause.
    pub(super) fn count(&self, pair: [usize; 2], stated: Stated, counts: &mut PairCounts) {
        let goal = self.goal(pair);
        counts.n_above_tolerance += u64::from(!stated.integrated);
        // An excess of an ulp is the rounding of a sum.
        if stated.rounding > 0.0
            && stated.exchange.error > goal * (1.0 + STORED)
            && (stated.integrated || stated.rounding > goal)
        {
            self.count_rounding(pair, stated.rounding, counts);
        }
    }

    /// Counts a pair taken over from before a change with its error, if that is above the tolerance.
    ///
    /// The cause is unknown here: it counts as rounding if that explains all of the excess, whether an occluder was left out between the two or not.
    pub(super) fn count_kept(&self, pair: [usize; 2], kept: Exchange, counts: &mut PairCounts) {
        if self.before.is_none_or(|before| before.tolerance_met) {
            return;
        }
        let goal = self.goal(pair);
        if kept.error <= goal * (1.0 + STORED) {
            return;
        }
        let [p, q] = pair.map(|k| self.patches.corners[k].as_slice());
        let occluders = match self.between(p, q, None).visibility {
            PairVisibility::Partial(occluders) => occluders,
            PairVisibility::Full | PairVisibility::None => Vec::new(),
        };
        let seen = Seen {
            occluders: &occluders,
            unoccluded: self.unoccluded(pair[0], pair[1]).area,
            ..Seen::whole(kept.area, true)
        };
        let rounding = self.rounding(pair, seen);
        if kept.error <= (goal + rounding) * (1.0 + STORED) {
            self.count_rounding(pair, rounding.min(kept.error), counts);
        } else {
            counts.n_above_tolerance += 1;
        }
    }

    /// Adds the errors of patches that do not face each other, but may do so as they were meant.
    pub(super) fn state_behind(&self, rounded: &Rounded, strip: &mut Strip) {
        let Strip {
            first_row,
            rows,
            counts,
            ..
        } = strip;
        for (row, i) in rows.iter_mut().zip(*first_row..) {
            let n_found = row.len();
            rounded.behind(&self.facing, i, i + 1..self.patches.len(), |j, most| {
                if !self.is_stated([i, j], most) {
                    return;
                }
                // A pair that is hidden but for a slit was counted if that is above the tolerance.
                let before = rounded::state(row, n_found, PatchId::from_index(j).0, most);
                if before.is_some_and(|before| before <= self.goal([i, j])) {
                    self.count_hidden([i, j], most, counts);
                }
            });
            row.sort_unstable_by_key(|entry| entry.0);
        }
    }

    /// Returns whether the most that a pair may exchange by rounding alone is worth an entry.
    pub(super) fn is_stated(&self, pair: [usize; 2], most: f64) -> bool {
        most > UNSTATED * self.goal(pair)
    }

    /// Counts a pair that exchanges light by rounding alone, if that is above the tolerance.
    pub(super) fn count_hidden(&self, pair: [usize; 2], most: f64, counts: &mut PairCounts) {
        if most > self.goal(pair) {
            self.count_rounding(pair, most, counts);
        }
    }

    fn count_rounding(&self, pair: [usize; 2], rounding: f64, counts: &mut PairCounts) {
        counts.n_above_by_rounding += 1;
        counts.rounding_error_max = counts.rounding_error_max.max(rounding / self.smaller_area(pair));
    }

    /// Returns the error that rounded corners add to an exchange area, m².
    ///
    /// It has the effect of moves of corners and occluders ([`Rounded::error`](crate::form_factor::rounded::Rounded::error)), or that of the border of corners off their patches' planes if that is larger.
    /// If an occluder was left out that reaches in between by no more than rounding, the border of both patches that it may hide is added.
    pub(super) fn rounding(&self, pair: [usize; 2], seen: Seen<'_>) -> f64 {
        let [i, j] = pair;
        let bent = (self.patches.borders[i] + self.patches.borders[j]) * seen.exchange;
        let hidden = if seen.touched {
            self.passing(pair, seen.exchange)
        } else {
            0.0
        };
        bent.max(self.moved(pair, seen)) + hidden + seen.moved
    }

    /// Returns the part of an exchange area, m², that passes within the width that rounding may close, or open, along the borders of both patches.
    pub(super) fn passing(&self, [i, j]: [usize; 2], exchange: f64) -> f64 {
        let slack = self.index.as_ref().map_or(0.0, OccluderIndex::slack);
        // The part left out was meant to touch, and reaches in by its rounding, which is less than the slack up to which parts are left out.
        let slack = if self.rounded.is_some() { REACH * slack } else { slack };
        let of_both = self.hidden_border([i, j], slack, exchange) + self.hidden_border([j, i], slack, exchange);
        of_both.min(exchange)
    }

    /// Returns the error from moves of corners that are rounded in the file.
    fn moved(&self, pair: [usize; 2], seen: Seen<'_>) -> f64 {
        let Some(rounded) = &self.rounded else {
            return 0.0;
        };
        let rough = rounded.rough(pair, seen.exchange, seen.occluders.len());
        if rough <= NEGLIGIBLE * self.goal(pair) {
            return rough;
        }
        let index = self.index.iter();
        let occluders = index.flat_map(|index| seen.occluders.iter().map(|&id| index.corners(id)));
        rounded.error(pair, seen.exchange, seen.unoccluded, occluders)
    }

    /// Returns the part of an exchange area, m², that an occluder on the plane of patch i may hide within `slack` of the patch's border.
    ///
    /// Light at an angle θ to the normal is hidden in a strip as wide as slack / cos θ, whose share of it is the flux without its cosine: the exchange area times slack L / (A cos θ) with L the perimeter,
    /// and at most slack L Ω / π, where Ω ≤ 2π is the solid angle of the front half-space. The angle is that of the other patch's middle, or half of that of its highest corner where that is more: the middle may
    /// lie in the plane.
    fn hidden_border(&self, [i, j]: [usize; 2], slack: f64, exchange: f64) -> f64 {
        let middle = |k: usize| {
            let corners = &self.patches.corners[k];
            corners.iter().sum::<DVec3>() / corners.len() as f64
        };
        let (from, normal) = (middle(i), self.facing.normal(i));
        let cosine = |to: DVec3| (to - from).normalize_or_zero().dot(normal);
        let corners = self.patches.corners[j].iter();
        let highest = corners.map(|&corner| cosine(corner)).fold(0.0, f64::max);
        let cosine = cosine(middle(j)).abs().max(0.5 * highest);
        let prepared = &self.patches.prepared[i];
        let strip = slack * prepared.perimeter();
        (strip * exchange / (prepared.area() * cosine)).min(2.0 * strip)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_read_as_it_was_written() {
        for (rounding, integrated) in [(0.0, true), (0.0, false), (1e-7, true), (2e-3, false)] {
            let stated = Stated {
                exchange: Exchange {
                    area: 0.25,
                    error: 1e-9,
                },
                rounding,
                integrated,
                n_rays: 1 << 40,
            };
            let read = Stated::from_record(stated.to_record()).expect("it is a record");
            assert_eq!(read.exchange, stated.exchange);
            assert_eq!(read.integrated, integrated);
            assert_eq!(read.rounding.to_bits(), rounding.to_bits());
            assert_eq!(read.n_rays, 1 << 40);
        }
        for wrong in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(Stated::from_record([wrong, 0.0, 0.0, 0.0].map(f64::to_bits)).is_none());
        }
    }
}
