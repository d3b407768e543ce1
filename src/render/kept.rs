//! Stores final gather in a checkpoint: for each block and round the pixels that the round continued.

use serde::{Deserialize, Serialize};

use super::gather::Gathered;
use super::pixel::Pixel;
use super::rare::RareLight;
use super::shared::to_bytes;
use crate::checkpoint::Checkpoint;

/// The part of the checkpoint, for one image at a time; form factors have the parts from 0 on.
const PART: u32 = 1 << 20;

/// A block during final gather.
#[derive(Serialize, Deserialize)]
pub(super) struct BlockState {
    pub(super) pixels: Vec<Pixel>,
    pub(super) gathered: Vec<Gathered>,
    /// The rare light found by the first round's rays.
    pub(super) rare: Option<RareLight>,
    /// The number of rounds so far.
    pub(super) n_rounds: u32,
}

/// The result of a round: the pixels that were open before it, and the rare light.
#[derive(Serialize, Deserialize)]
pub(super) struct Round {
    pub(super) open: Vec<Gathered>,
    pub(super) rare: RareLight,
}

impl BlockState {
    pub(super) fn is_open(&self) -> bool {
        self.gathered.iter().any(|pixel| !pixel.is_finished())
    }

    /// Stores the result of a round; returns false if it has another number of pixels.
    pub(super) fn end_round(&mut self, round: &Round) -> bool {
        let mut open: Vec<&mut Gathered> = self.gathered.iter_mut().filter(|own| !own.is_finished()).collect();
        if open.len() != round.open.len() {
            return false;
        }
        for (pixel, next) in open.iter_mut().zip(&round.open) {
            **pixel = *next;
        }
        self.rare = Some(round.rare);
        self.n_rounds += 1;
        true
    }

    /// Returns the radiance of all pixels with the light gathered so far.
    pub(super) fn radiance(&self) -> impl Iterator<Item = [f32; 3]> {
        self.pixels.iter().zip(&self.gathered).map(|(pixel, gathered)| {
            let mut pixel = *pixel;
            pixel.add_gathered(gathered);
            pixel.radiance()
        })
    }
}

/// The rounds of an image's blocks in a checkpoint.
pub(super) struct KeptRounds<'a> {
    checkpoint: &'a Checkpoint,
    n_blocks: usize,
}

impl<'a> KeptRounds<'a> {
    /// Continues with the stored rounds of the image with this fingerprint, or begins anew.
    pub(super) fn open(checkpoint: &'a Checkpoint, key: &[u8; 32], n_blocks: usize) -> Self {
        checkpoint.begin_part(PART, key);
        Self { checkpoint, n_blocks }
    }

    fn piece(&self, block: usize, round: u32) -> u64 {
        u64::from(round) * self.n_blocks as u64 + block as u64
    }

    /// Advances a block to the end of its last stored round.
    pub(super) fn restore(&self, block: usize, state: &mut BlockState) {
        while let Some(piece) = self.checkpoint.piece(self.piece(block, state.n_rounds)) {
            let round: Option<Round> = ciborium::from_reader(&piece[..]).ok();
            if !round.is_some_and(|round| state.end_round(&round)) {
                return;
            }
        }
    }

    /// Stores the result of the round after `state`.
    pub(super) fn keep(&self, block: usize, state: &BlockState, round: &Round) {
        let piece = self.piece(block, state.n_rounds);
        self.checkpoint.keep(piece, &to_bytes(round));
    }
}
