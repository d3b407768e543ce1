//! The best radiosities of an iteration so far, channel by channel.

use super::scaled::{Scaled, TrueResidual};
use super::stop::Tolerance;
use super::vectors::copy_channel;
use crate::matrix::operator::Block;

/// The radiosities of each channel at its least excess over the tolerance; the channels are independent.
pub(super) struct Best {
    excess: Vec<f64>,
    radiosity: Option<Block>,
}

impl Best {
    pub(super) fn new(n_channels: usize) -> Self {
        Self {
            excess: vec![f64::INFINITY; n_channels],
            radiosity: None,
        }
    }

    /// Stores the radiosities of a pass where they are the best.
    pub(super) fn observe(&mut self, excess: &[f64], radiosity: impl FnOnce() -> Block) {
        let better: Vec<usize> = (0..excess.len()).filter(|&c| excess[c] < self.excess[c]).collect();
        if better.is_empty() {
            return;
        }
        let now = radiosity();
        for &c in &better {
            self.excess[c] = excess[c];
        }
        match &mut self.radiosity {
            Some(kept) if better.len() < excess.len() => better.into_iter().for_each(|c| copy_channel(kept, &now, c)),
            kept => *kept = Some(now),
        }
    }

    /// Returns in each channel the better of the stored and the last radiosities, by their true residuals, and the passes over F that this took.
    pub(super) fn or_last(
        self,
        scaled: &Scaled,
        tolerance: Tolerance,
        last: Block,
        truth: TrueResidual,
    ) -> (Block, TrueResidual, usize) {
        let now = tolerance.excess(&truth.norms);
        let (Some(kept), true) = (
            self.radiosity,
            self.excess.iter().zip(&now).any(|(kept, own)| kept < own),
        ) else {
            return (last, truth, 0);
        };
        let kept_truth = scaled.true_residual(&kept);
        let before = tolerance.excess(&kept_truth.norms);
        let mut chosen = last;
        let better: Vec<usize> = (0..now.len()).filter(|&c| before[c] < now[c]).collect();
        if better.is_empty() {
            return (chosen, truth, 1);
        }
        for &c in &better {
            copy_channel(&mut chosen, &kept, c);
        }
        let chosen_truth = scaled.true_residual(&chosen);
        (chosen, chosen_truth, 2)
    }
}
