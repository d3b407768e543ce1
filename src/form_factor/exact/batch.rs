//! Rows of the upper triangle, some faces at a time: classified, then integrated pair by pair.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::borrow::Cow;
use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::prelude::*;

use super::batches::{Batches, FaceView, Known, PartialPair, Strip};
use super::method::ExactMethod;
use super::patches::{ROW_RUN, Run};
use super::split::Split;
use super::stated::{Seen, Stated};
use super::views::Views;
use super::walk::Walk;
use crate::form_factor::PairCounts;
use crate::form_factor::kept::{self, Part, Piece};
use crate::form_factor::pairs::Exchange;
use crate::form_factor::partial::Whole;
use crate::matrix::{RowTally, RowTile};
use crate::progress::{Portions, Progress};
use crate::threads;
use crate::visibility::occluders::{OccluderId, OccluderIndex};

/// The fewest pairs at which a batch ends: enough work for some threads even where rows are short.
const MIN_PAIRS_PER_BATCH: usize = 1 << 18;

/// The most pairs at which a batch ends.
const MAX_PAIRS_PER_BATCH: usize = 1 << 21;

/// The rows of a batch between these two limits: two runs for each of eight threads.
const ROWS_PER_BATCH: usize = 128;

/// A batch that may end anywhere ends when its rows have taken this long to classify.
const CLASSIFIED_AT_ONCE: Duration = Duration::from_secs(1);

/// Bytes of a pair while its batch is computed: its entry twice, as rows are put together, and its place in a table.
const PAIR_BYTE: u64 = 48;

/// Returns the pairs that bring a batch to its end.
///
/// They depend on the scene alone: where a batch ends decides which corners its tables are computed from, and so the last bits of entries.
fn pairs_per_batch(n: usize) -> usize {
    ROWS_PER_BATCH
        .saturating_mul(n)
        .clamp(MIN_PAIRS_PER_BATCH, MAX_PAIRS_PER_BATCH)
}

/// Returns the memory that a batch takes.
pub(super) fn batch_byte(n: usize) -> u64 {
    let pairs = (n as u64).saturating_mul(n as u64) / 2;
    // The last rows go beyond the end by less than a run.
    PAIR_BYTE * pairs.min((pairs_per_batch(n) + ROW_RUN * n) as u64)
}

/// The part of the exchange area without occluders up to which a partial pair's is 0: rounding leaves as much of clipped corners, and of cracks between occluders.
const NOISE: f64 = 1e-12;

/// The same as an error of the visible exchange area: some roundings at each point.
const ROUNDING: f64 = 1e-13;

/// The part of the exchange without occluders up to which the effect of rounding on patches that it has parted is known to the first order.
const MOVED: f64 = 0.1;

/// Integration goes on for this many times the steps that classification counts for.
///
/// In boxes it takes about as long, in clutter a hundred times as long: a display that expects too much is put right soon.
const INTEGRATION: u64 = 7;

impl Batches<'_> {
    /// Returns the steps that the classification of pairs counts for, which is all where nothing occludes.
    fn looked(&self, n_pairs: u64) -> u64 {
        if self.index.is_some() {
            n_pairs / (1 + INTEGRATION)
        } else {
            n_pairs
        }
    }

    /// Returns whether a run of rows begins at `row`, or all rows end there.
    fn is_between_runs(&self, row: usize) -> bool {
        let Some(&f) = self.patches.face_of_patch.get(row) else {
            return row == self.patches.len();
        };
        let face = &self.patches.faces[f];
        face.row_runs.iter().any(|&k| face.runs[k].patches.start == row)
    }
}

impl Batches<'_> {
    /// Returns whole runs of rows from `first_row` on, with their faces, until there is enough to do.
    pub(super) fn runs_of_batch(&self, first_row: usize) -> Vec<(usize, usize)> {
        let n = self.patches.len();
        let mut runs = Vec::new();
        let (mut n_pairs, mut row) = (0, first_row);
        let enough = pairs_per_batch(n);
        while row < n && n_pairs < enough {
            let f = self.patches.face_of_patch[row];
            let face = &self.patches.faces[f];
            let k = face.row_runs.partition_point(|&k| face.runs[k].patches.end <= row);
            runs.push((f, face.row_runs[k]));
            let range = face.runs[face.row_runs[k]].patches.clone();
            n_pairs += range.clone().map(|i| n - 1 - i).sum::<usize>();
            row = range.end;
        }
        runs
    }

    /// Classifies the rows of a batch, and moves on to the row after them.
    ///
    /// Where every face is one patch, no table depends on the rows, and a batch may end anywhere: unless ranks share the batches, it ends after a time, so that the finished work is stored.
    fn classified_batch(&mut self) -> Vec<Strip> {
        let runs = self.runs_of_batch(self.next_row);
        let (begun, first_row) = (Instant::now(), self.next_row);
        let may_end_anywhere =
            self.end.is_none() && runs.iter().all(|&(f, _)| self.patches.faces[f].range().len() == 1);
        let mut n_at_once = if may_end_anywhere {
            rayon::current_num_threads()
        } else {
            runs.len()
        };
        let (mut strips, mut rest) = (Vec::new(), runs.as_slice());
        while !rest.is_empty() && (strips.is_empty() || begun.elapsed() < CLASSIFIED_AT_ONCE) {
            let now;
            (now, rest) = rest.split_at(n_at_once.min(rest.len()));
            strips.extend(self.classified(first_row, now));
            n_at_once *= 2;
        }
        strips
    }

    /// Classifies some runs of rows of a batch that begins at `first_row`.
    fn classified(&mut self, first_row: usize, runs: &[(usize, usize)]) -> Vec<Strip> {
        let (Some(&(first, _)), Some(&(last, run))) = (runs.first(), runs.last()) else {
            return Vec::new();
        };
        let (n, begin) = (self.patches.len(), self.next_row);
        self.next_row = self.patches.faces[last].runs[run].patches.end;
        let (rows, faces) = (first_row..self.next_row, first..last + 1);
        let until = |row: usize| self.looked((first_row..row).map(|i| (n - 1 - i) as u64).sum());
        let n_steps = until(self.next_row) - until(begin);
        let seen = Portions::new(self.progress, n_steps / 2, faces.len());
        let views: Vec<Views> = threads::collect(faces.len(), |k| {
            let views = self.views_of(faces.start + k);
            seen.part_done();
            views
        });
        let of_batch = self.patches.face_of_patch[first_row]..faces.end;
        self.find_tables((&of_batch, &rows), &faces, &views);
        let classified = Portions::new(self.progress, n_steps - n_steps / 2, runs.len());
        threads::collect_from(runs, |&(f, run)| {
            let strip = self.classify(f, &self.patches.faces[f].runs[run], &views[f - faces.start]);
            classified.part_done();
            strip
        })
    }
}

impl Iterator for Batches<'_> {
    type Item = Piece;

    fn next(&mut self) -> Option<Self::Item> {
        let n = self.patches.len();
        if self.next_row >= n || self.progress.is_cancelled() {
            return None;
        }
        let first_row = self.next_row;
        let part = Part {
            first_row,
            n,
            is_upper: true,
        };
        let is_end = |end: usize| self.end.map_or_else(|| self.is_between_runs(end), |right| right == end);
        if let Some(piece) = kept::take(self.progress, first_row as u64, part, is_end) {
            let n_rows: usize = piece.tiles.iter().map(RowTile::n_rows).sum();
            let rows = self.next_row..n.min(self.next_row + n_rows);
            self.next_row = rows.end;
            self.progress.advance(rows.map(|i| (n - 1 - i) as u64).sum());
            return Some(piece);
        }
        self.journal.begin(first_row as u64);
        let mut strips = self.classified_batch();
        let n_pairs: u64 = (first_row..self.next_row).map(|i| (n - 1 - i) as u64).sum();
        self.integrate(&mut strips, n_pairs - self.looked(n_pairs));
        if let Some(rounded) = self.rounded.as_ref().filter(|_| !self.progress.is_cancelled()) {
            threads::for_each_chunk(true, &mut strips, 1, |_, strip| {
                self.state_behind(rounded, &mut strip[0]);
            });
        }
        let counts = strips
            .iter()
            .fold(PairCounts::default(), |sum, strip| sum.plus(strip.counts));
        let tiles = threads::collect_owned(strips, |strip| {
            let mut tile = RowTile::new(strip.first_row);
            for row in &strip.rows {
                tile.push_row(row, RowTally::default());
            }
            tile
        });
        let piece = Piece {
            tiles,
            counts,
            tolerance_met: counts.tolerance_met(),
        };
        kept::keep(self.progress, first_row as u64, &piece);
        Some(piece)
    }
}

impl Batches<'_> {
    /// Classifies all pairs of a run of rows, and computes the fully visible ones.
    pub(super) fn classify(&self, f: usize, rows: &Run, views: &Views) -> Strip {
        let n_later: usize = rows.patches.clone().map(|i| self.patches.len() - 1 - i).sum();
        let columns = |view: &FaceView| &self.patches.faces[view.face].runs[0];
        let n_columns: usize = views.faces.iter().map(|view| columns(view).patches.len()).sum();
        let mut strip = Strip {
            first_row: rows.patches.start,
            rows: rows.patches.clone().map(|_| Vec::with_capacity(n_columns)).collect(),
            partial: Vec::new(),
            occluders: Vec::new(),
            counts: PairCounts::default(),
            before: self.rows_before(&rows.patches),
        };
        strip.counts.not_facing = (n_later - rows.patches.len() * n_columns - views.n_hidden) as u64;
        strip.counts.hidden = views.n_hidden as u64;
        for view in &views.faces {
            let mut walk = Walk {
                batches: self,
                table: self.table_of([f, view.face]),
                fronts: view.fronts.as_ref(),
                starts: [f, view.face].map(|k| self.patches.faces[k].range().start),
                may_keep: !self.any_moved([f, view.face]),
                rows,
                runs: &self.patches.faces[view.face].runs,
                strip: &mut strip,
            };
            match &view.known {
                Known::Kept => walk.keep(columns(view)),
                Known::Seen(seen) => walk.settle(columns(view), seen, true),
            }
        }
        strip.before = Vec::new();
        strip
    }

    /// Integrates the partial pairs of all strips, each a task of its own, as their cost differs by orders of magnitude; together they are `n_steps` of progress.
    fn integrate(&self, strips: &mut [Strip], n_steps: u64) {
        let Some(index) = &self.index else {
            self.progress.advance(n_steps);
            return;
        };
        let n_partial: Vec<usize> = strips.iter().map(|strip| strip.partial.len()).collect();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let cost = |strip: &Strip, pair: &PartialPair| self.expected_cost(strip, pair, self.method.tolerance) as usize;
        let work: Vec<(&Strip, &PartialPair, usize)> = strips
            .iter()
            .flat_map(|strip| strip.partial.iter().map(move |pair| (strip, pair, cost(strip, pair))))
            .collect();
        let integrated = Portions::new(self.progress, n_steps, work.iter().map(|(.., cost)| cost).sum());
        // Finer pieces than those of `threads`, for the same reason.
        let results: Vec<Option<Stated>> = work
            .par_iter()
            .with_max_len(16)
            .enumerate()
            .map(|(place, (strip, pair, cost))| {
                let stated = self.known_or_integrated(index, place, strip, pair);
                integrated.parts_done(*cost);
                stated
            })
            .collect();
        let mut results = results.into_iter();
        for (strip, n) in strips.iter_mut().zip(n_partial) {
            for (pair, stated) in strip.partial.iter().zip(results.by_ref().take(n)) {
                // Work that was stopped is not used.
                let Some(stated) = stated else { continue };
                let entry = &mut strip.rows[pair.i - strip.first_row][pair.place];
                (entry.1, entry.2) = (stated.exchange.area, stated.exchange.error);
                self.count([pair.i, pair.j], stated, &mut strip.counts);
                strip.counts.clipped += u64::from(stated.n_rays == 0);
                strip.counts.by_rays += u64::from(stated.n_rays > 0);
                strip.counts.n_rays += stated.n_rays;
            }
        }
    }

    /// Returns a partial pair from the journal, or integrates it; `None` if that is to stop.
    fn known_or_integrated(
        &self,
        index: &OccluderIndex,
        place: usize,
        strip: &Strip,
        pair: &PartialPair,
    ) -> Option<Stated> {
        if self.progress.is_cancelled() {
            return None;
        }
        if let Some(stated) = self.journal.get(place).and_then(Stated::from_record) {
            return Some(stated);
        }
        let begun = Instant::now();
        let stated = self.partial(
            index,
            pair,
            &strip.occluders[pair.occluders.clone()],
            self.method,
            self.progress,
        );
        // An integral that was stopped is not stored.
        if !self.progress.is_cancelled() {
            self.journal.keep(place, stated.to_record(), begun.elapsed());
        }
        Some(stated)
    }

    /// Integrates a partial pair by a method, which may differ from the one asked for, until `progress` ends it.
    pub(super) fn partial(
        &self,
        index: &OccluderIndex,
        pair: &PartialPair,
        occluders: &[OccluderId],
        method: &ExactMethod,
        progress: &dyn Progress,
    ) -> Stated {
        let flat = [pair.i, pair.j].map(|k| self.patches.flat_corners(k));
        let ends = flat.each_ref().map(AsRef::as_ref);
        let most = self.unoccluded(pair.i, pair.j);
        if progress.is_late() {
            return self.bounded(pair, most);
        }
        let goal = self.goal_of(method, [pair.i, pair.j]);
        let meeting = Meeting::of(index, ends, most.area, 1e-3 * goal);
        let [p, q] = meeting
            .as_ref()
            .map_or(ends, |meant| meant.ends.each_ref().map(Vec::as_slice));
        let touched = pair.touched || meeting.is_some() || index.any_stands_on(p, q, occluders);
        let split = Split {
            index,
            budget: method.budget,
            relative: method.relative_tolerance(),
            unlike_of_few: method.unlike_of_few(),
            progress,
        };
        // Where rounding is to be added, the integral leaves room for it, so that no pair is above the tolerance by its integral's share; room would not help where rounding alone is above it.
        let seen = |exchange: f64| Seen {
            exchange,
            unoccluded: most.area,
            moved: meeting.as_ref().map_or(0.0, |meant| meant.moved),
            touched,
            occluders,
        };
        let rounding = self.rounding([pair.i, pair.j], seen(most.area));
        let clipping = ROUNDING * most.area;
        let room = if rounding < goal { rounding } else { 0.0 } + clipping;
        let room = room.min(0.5 * goal);
        let is_flat = flat.iter().all(|corners| matches!(corners, Cow::Borrowed(_)));
        let whole = match &meeting {
            Some(meant) => meant.whole,
            None if is_flat => Whole {
                area: most.area,
                error: most.error,
            },
            None => Whole::of(p, q, 1e-3 * goal),
        };
        let found = split.exchange_area(p, q, occluders, goal - room, whole);
        // The rounding errors of a pair that is hidden after all would make a row of noise.
        let is_noise = found.exchange_area <= NOISE * most.area;
        // Neither the exchange area nor its error can exceed the exchange area without occluders.
        let exchange = Exchange {
            area: if is_noise {
                0.0
            } else {
                found.exchange_area.min(most.area)
            },
            error: (found.error + clipping)
                .max(if is_noise { found.exchange_area } else { 0.0 })
                .max(if found.exchange_area > most.area {
                    most.error
                } else {
                    0.0
                })
                .min(most.area + most.error),
        };
        let reached = exchange.error
            <= if found.reached {
                goal.max(found.error + clipping)
            } else {
                goal
            };
        self.stated([pair.i, pair.j], seen(exchange.area), exchange, reached)
            .with_rays(found.n_rays)
    }
}

/// Two patches as they were meant, where rounding has parted them.
struct Meeting {
    ends: [Vec<DVec3>; 2],
    /// Their exchange area without occluders.
    whole: Whole,
    /// The change of that exchange, m², where it is more than [`MOVED`] of it: then it is unknown which of the two is meant.
    moved: f64,
}

impl Meeting {
    /// Moves two patches to meet.
    ///
    /// `most` is the exchange area without occluders of the patches as they are, m², and `error` the error to which that of the moved ones is computed.
    fn of(index: &OccluderIndex, [p, q]: [&[DVec3]; 2], most: f64, error: f64) -> Option<Self> {
        let ends = index.meeting(p, q)?;
        let whole = Whole::of(&ends[0], &ends[1], error);
        let moved = (whole.area - most).abs();
        Some(Self {
            ends,
            whole,
            moved: if moved > MOVED * most { moved } else { 0.0 },
        })
    }
}

impl Batches<'_> {
    /// Returns a pair's exchange area before its occluders are examined: between 0 and the exchange area without them.
    fn bounded(&self, pair: &PartialPair, most: Exchange) -> Stated {
        let half = 0.5 * most.area;
        let exchange = Exchange {
            area: half,
            error: half + most.error,
        };
        let ends = [pair.i, pair.j];
        self.stated(
            ends,
            Seen::whole(most.area, pair.touched),
            exchange,
            exchange.error <= self.goal(ends),
        )
    }
}
