//! Sums and products of blocks, channel by channel and in patch order: equal bytes at any number of threads.

use crate::matrix::operator::Block;

/// Multiplies entry by entry.
pub(super) fn scale(block: &mut Block, by: &Block) {
    for (value, factor) in block.values_mut().iter_mut().zip(by.values()) {
        *value *= factor;
    }
}

/// sum ← sum + factor term, with a factor for each channel.
pub(super) fn add_scaled(sum: &mut Block, factors: &[f64], term: &Block) {
    let terms = term.values().iter().zip(factors.iter().cycle());
    for (value, (addend, factor)) in sum.values_mut().iter_mut().zip(terms) {
        *value += factor * addend;
    }
}

/// Returns Σ w u v of each channel.
pub(super) fn inner(weights: &[f64], u: &Block, v: &Block) -> Vec<f64> {
    let mut sums = vec![0.0; u.n_channels()];
    for (i, weight) in weights.iter().enumerate() {
        for (sum, (a, b)) in sums.iter_mut().zip(u.row(i).iter().zip(v.row(i))) {
            *sum += weight * a * b;
        }
    }
    sums
}

/// Sets one channel of `block` to zero.
pub(super) fn clear_channel(block: &mut Block, channel: usize) {
    let n_channels = block.n_channels();
    block
        .values_mut()
        .iter_mut()
        .skip(channel)
        .step_by(n_channels)
        .for_each(|x| *x = 0.0);
}

/// Copies one channel from a block of the same shape.
pub(super) fn copy_channel(to: &mut Block, from: &Block, channel: usize) {
    let n_channels = to.n_channels();
    let pairs = to.values_mut().iter_mut().zip(from.values());
    pairs.skip(channel).step_by(n_channels).for_each(|(a, b)| *a = *b);
}
