//! What a checkpoint keeps of final gather: for each block and round the pixels that the round went on with.

use super::gather::Gathered;
use super::rare::RareLight;
use super::renderer::{BlockState, Renderer};
use crate::checkpoint::Checkpoint;

/// The part of the checkpoint: one picture at a time. Form factors have the parts from 0 on.
const PART: u32 = 1 << 20;

/// The rounds of a picture's blocks in a checkpoint.
pub(super) struct KeptRounds<'a> {
    checkpoint: &'a Checkpoint,
    n_blocks: usize,
}

impl<'a> KeptRounds<'a> {
    /// Takes up what was kept of the same picture, or begins anew.
    pub(super) fn open(checkpoint: &'a Checkpoint, renderer: &Renderer<'_>, n_blocks: usize) -> Self {
        let key = renderer.input.fingerprint(renderer.view, renderer.settings);
        checkpoint.begin_part(PART, &key);
        Self { checkpoint, n_blocks }
    }

    fn piece(&self, block: usize, round: u32) -> u64 {
        u64::from(round) * self.n_blocks as u64 + block as u64
    }

    /// Brings a block to the end of the last round that was kept.
    pub(super) fn restore(&self, block: usize, state: &mut BlockState) {
        while let Some(piece) = self.checkpoint.piece(self.piece(block, state.n_rounds)) {
            let Some((next, rare)) = decoded(&piece, &state.gathered) else {
                return;
            };
            state.end_round(next, &rare);
        }
    }

    /// Keeps what the round after `state` made.
    pub(super) fn keep(&self, block: usize, state: &BlockState, next: &[Gathered], rare: &RareLight) {
        let mut bytes = Vec::new();
        rare.encode(&mut bytes);
        for (before, after) in state.gathered.iter().zip(next) {
            if !before.is_finished() {
                after.encode(&mut bytes);
            }
        }
        self.checkpoint.keep(self.piece(block, state.n_rounds), &bytes);
    }
}

/// Returns the pixels and the rare light after a round; `None` for what is no such round.
fn decoded(piece: &[u8], before: &[Gathered]) -> Option<(Vec<Gathered>, RareLight)> {
    let (rare, pixels) = piece.split_at_checked(RareLight::N_BYTE)?;
    let (open, rest) = pixels.as_chunks::<{ Gathered::N_BYTE }>();
    let mut open = open.iter();
    let mut next = before.to_vec();
    for pixel in next.iter_mut().filter(|pixel| !pixel.is_finished()) {
        *pixel = Gathered::decode(open.next()?)?;
    }
    let is_whole = rest.is_empty() && open.next().is_none();
    is_whole.then_some((next, RareLight::decode(rare)?))
}
