//! Batches that ranks share.

use super::batch::batch_byte;
use super::batches::Batches;
use crate::form_factor::kept::Piece;
use crate::form_factor::shared::window;
use crate::ranks::{Code, InTurn};

impl<'a> Batches<'a> {
    /// Yields the pieces of all batches, each computed by one of several ranks; `None` once a rank was to stop.
    ///
    /// Batches are those of a single rank. Results do not depend on earlier batches: a rank computes some of them, as a run does that continues from a checkpoint.
    pub(super) fn shared(mut self, waiting_byte: u64) -> impl Iterator<Item = Option<Piece>> + use<'a> {
        let (n, progress) = (self.patches.len(), self.progress);
        let ends = self.ends();
        let starts: Vec<usize> = std::iter::once(0).chain(ends.iter().copied()).collect();
        let rows = move |k: usize| starts[k]..starts[k + 1];
        let of_batch = rows.clone();
        let work = move |k: usize| {
            let own = of_batch(k);
            (self.next_row, self.end) = (own.start, Some(own.end));
            // Work that was stopped is not sent.
            self.next().filter(|_| !self.progress.is_cancelled())
        };
        let code = Code {
            encode: |piece: &Option<Piece>| piece.as_ref().map_or_else(Vec::new, Piece::encode),
            decode: |_: usize, bytes: &[u8]| Piece::decode(bytes),
        };
        let window = window(progress.ranks(), batch_byte(n), waiting_byte);
        let results = InTurn::new(progress.ranks(), (ends.len(), window), work, code);
        results.enumerate().map(move |(k, (piece, is_own))| {
            if !is_own {
                progress.advance(rows(k).map(|i| (n - 1 - i) as u64).sum());
            }
            piece
        })
    }

    /// Returns the row after the last of each batch.
    fn ends(&self) -> Vec<usize> {
        let mut ends = Vec::new();
        let mut row = 0;
        while row < self.patches.len() {
            if let Some(&(f, run)) = self.runs_of_batch(row).last() {
                row = self.patches.faces[f].runs[run].patches.end;
            }
            ends.push(row);
        }
        ends
    }
}
