//! The way through the runs of one face: which pairs are classified, kept, or settled at once.

use super::batches::{Batches, PartialPair, Strip};
use super::patches::Run;
use super::stated::Seen;
use super::table::Table;
use crate::form_factor::pairs::Exchange;
use crate::mesh::PatchId;
use crate::visibility::occluders::{Between, OccluderId, PairVisibility};

/// The way through the runs of one face, seen from some rows.
pub(super) struct Walk<'a> {
    pub(super) batches: &'a Batches<'a>,
    pub(super) table: Option<&'a Table>,
    pub(super) fronts: Option<&'a [Vec<Option<bool>>; 2]>,
    /// The first patches of both faces.
    pub(super) starts: [usize; 2],
    /// True if both faces stayed where they were before a change.
    pub(super) may_keep: bool,
    pub(super) rows: &'a Run,
    pub(super) runs: &'a [Run],
    pub(super) strip: &'a mut Strip,
}

impl Walk<'_> {
    /// Settles a run of columns whose visibility is known; `of_faces` is true if it is that of the rows' whole face.
    pub(super) fn settle(&mut self, columns: &Run, seen: &Between, of_faces: bool) {
        let touched = seen.touched;
        match &seen.visibility {
            PairVisibility::Full => self.each_facing_pair(columns, |walk, i, j| walk.push_full(i, j, touched)),
            PairVisibility::None => self.each_facing_pair(columns, |walk, i, j| walk.push_hidden(i, j, touched)),
            // Two patches that are their whole faces are classified already.
            PairVisibility::Partial(among) if of_faces && !self.is_one_pair() => self.look(columns, among, touched),
            PairVisibility::Partial(among) => match columns.halves {
                Some(halves) => {
                    for k in halves {
                        self.look(&self.runs[k], among, touched);
                    }
                }
                None => self.each_facing_pair(columns, |walk, i, j| walk.push_seen(i, j, among, touched)),
            },
        }
    }

    /// Returns whether both faces are one patch each.
    fn is_one_pair(&self) -> bool {
        let faces = [self.rows.patches.start, self.runs[0].patches.start];
        let patches = &self.batches.patches;
        patches.are_one_pair(faces.map(|patch| patches.face_of_patch[patch]))
    }

    /// Classifies the rows against a run of columns; `touched` is that of the larger runs.
    fn look(&mut self, columns: &Run, among: &[OccluderId], touched: bool) {
        if self.may_keep && self.batches.is_kept(&self.rows.hull, &columns.hull) {
            self.keep(columns);
            return;
        }
        let mut seen = self.batches.between(&self.rows.hull, &columns.hull, Some(among));
        // An occluder left out between the larger runs is not among the candidates here.
        seen.touched |= touched && seen.visibility != PairVisibility::None;
        self.settle(columns, &seen, false);
    }

    /// Takes over all exchange areas with a run of columns.
    pub(super) fn keep(&mut self, columns: &Run) {
        self.each_facing_pair(columns, Walk::push_kept);
    }

    fn push_kept(&mut self, i: usize, j: usize) {
        self.strip.counts.kept += 1;
        // An exchange area that is not stored was 0 for certain, and stays 0.
        if let Some(before) = self.before(i, j) {
            self.batches.count_kept([i, j], before, &mut self.strip.counts);
            self.push(i, j, before);
        }
    }

    /// Returns the stored exchange area of a pair from before.
    fn before(&self, i: usize, j: usize) -> Option<Exchange> {
        let column = PatchId::from_index(j).0;
        let before = &self.strip.before[i - self.rows.patches.start];
        let place = before.binary_search_by_key(&column, |entry| entry.0).ok()?;
        let (_, area, error) = before[place];
        Some(Exchange { area, error })
    }

    fn each_facing_pair(&mut self, columns: &Run, mut act: impl FnMut(&mut Self, usize, usize)) {
        for i in self.rows.patches.clone() {
            for j in columns.patches.clone() {
                if self.is_facing(i, j) {
                    act(self, i, j);
                } else {
                    self.strip.counts.not_facing += 1;
                }
            }
        }
    }

    fn is_facing(&self, i: usize, j: usize) -> bool {
        let sides = self
            .fronts
            .map(|[rows, columns]| (rows[i - self.starts[0]], columns[j - self.starts[1]]));
        match sides {
            Some((Some(false), _) | (_, Some(false))) => false,
            Some((Some(true), Some(true))) => true,
            _ => self.batches.facing.pair(i, j),
        }
    }

    fn push_full(&mut self, i: usize, j: usize, touched: bool) {
        self.strip.counts.full += 1;
        let exchange = self
            .table
            .map_or_else(|| self.batches.repeated(i, j), |table| table.get(i, j));
        let integrated = exchange.error <= self.batches.goal([i, j]);
        let seen = Seen::whole(exchange.area, touched);
        let stated = self.batches.stated([i, j], seen, exchange, integrated);
        self.batches.count([i, j], stated, &mut self.strip.counts);
        self.push(i, j, stated.exchange);
    }

    /// Counts a hidden pair; where it is hidden but for rounded coordinates (`touched`), the light that may pass is stated as its error.
    fn push_hidden(&mut self, i: usize, j: usize, touched: bool) {
        self.strip.counts.hidden += 1;
        if !touched {
            return;
        }
        let unoccluded = self
            .table
            .map_or_else(|| self.batches.repeated(i, j), |table| table.get(i, j));
        let error = self.batches.passing([i, j], unoccluded.area);
        if self.batches.is_stated([i, j], error) {
            self.batches.count_hidden([i, j], error, &mut self.strip.counts);
            self.push(i, j, Exchange { area: 0.0, error });
        }
    }

    fn push_seen(&mut self, i: usize, j: usize, among: &[OccluderId], touched: bool) {
        let seen = if self.rows.patches.len() > 1 {
            let [p, q] = [i, j].map(|k| self.batches.patches.corners[k].as_slice());
            if self.may_keep && self.batches.is_kept(p, q) {
                self.push_kept(i, j);
                return;
            }
            self.batches.between(p, q, Some(among))
        } else {
            Between::certain(PairVisibility::Partial(among.to_vec()))
        };
        match seen.visibility {
            PairVisibility::Full => self.push_full(i, j, seen.touched || touched),
            PairVisibility::None => self.push_hidden(i, j, seen.touched),
            PairVisibility::Partial(occluders) => {
                self.strip.counts.partial += 1;
                if let Some(known) = self.exact_enough(i, j) {
                    self.push(i, j, known);
                    return;
                }
                let (begin, place) = (self.strip.occluders.len(), self.row(i).len());
                self.strip.occluders.extend(occluders);
                self.strip.partial.push(PartialPair {
                    i,
                    j,
                    place,
                    touched: seen.touched || touched,
                    occluders: begin..self.strip.occluders.len(),
                });
                self.push(i, j, Exchange::default());
            }
        }
    }

    /// Returns the exchange area of a less exact computation that was exact enough for a pair. What it did not store was 0 for certain.
    fn exact_enough(&self, i: usize, j: usize) -> Option<Exchange> {
        self.batches.finer?;
        let known = self.before(i, j).unwrap_or_default();
        (known.error <= self.batches.goal([i, j])).then_some(known)
    }

    fn row(&mut self, i: usize) -> &mut Vec<(u32, f64, f64)> {
        &mut self.strip.rows[i - self.rows.patches.start]
    }

    fn push(&mut self, i: usize, j: usize, exchange: Exchange) {
        self.row(i)
            .push((PatchId::from_index(j).0, exchange.area, exchange.error));
    }
}
