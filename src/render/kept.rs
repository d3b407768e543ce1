//! Stores final gather in a checkpoint: for each block and round the pixels that the round continued.

use super::gather::Gathered;
use super::pixel::Pixel;
use super::rare::RareLight;
use crate::checkpoint::Checkpoint;

/// The part of the checkpoint, for one image at a time; form factors have the parts from 0 on.
const PART: u32 = 1 << 20;

/// A block during final gather.
#[derive(Default)]
pub(super) struct BlockState {
    pub(super) pixels: Vec<Pixel>,
    pub(super) gathered: Vec<Gathered>,
    /// The rare light found by the first round's rays.
    pub(super) rare: Option<RareLight>,
    /// The number of rounds so far.
    pub(super) n_rounds: u32,
}

impl BlockState {
    pub(super) fn is_open(&self) -> bool {
        self.gathered.iter().any(|pixel| !pixel.is_finished())
    }

    /// Stores the result of a round.
    pub(super) fn end_round(&mut self, gathered: Vec<Gathered>, rare: &RareLight) {
        self.gathered = gathered;
        self.rare = Some(*rare);
        self.n_rounds += 1;
    }

    /// Returns the result of a round as bytes: the pixels that were not finished before it.
    pub(super) fn encode_round(&self, next: &[Gathered], rare: &RareLight) -> Vec<u8> {
        let mut bytes = Vec::new();
        rare.encode(&mut bytes);
        for (before, after) in self.gathered.iter().zip(next) {
            if !before.is_finished() {
                after.encode(&mut bytes);
            }
        }
        bytes
    }

    /// Stores the result of a round on another rank, from its bytes.
    ///
    /// # Panics
    /// If the bytes are not a round after this state: ranks have equal states.
    #[track_caller]
    pub(super) fn end_other_round(&mut self, round: &[u8]) {
        let (next, rare) = decoded(round, &self.gathered).expect("what a rank sends is a round");
        self.end_round(next, &rare);
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
            let Some((next, rare)) = decoded(&piece, &state.gathered) else {
                return;
            };
            state.end_round(next, &rare);
        }
    }

    /// Stores the result of the round after `state`.
    pub(super) fn keep(&self, block: usize, state: &BlockState, next: &[Gathered], rare: &RareLight) {
        let bytes = state.encode_round(next, rare);
        self.checkpoint.keep(self.piece(block, state.n_rounds), &bytes);
    }
}

/// Returns the pixels and the rare light after a round; `None` for other bytes.
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
