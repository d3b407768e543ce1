//! Sums and products of blocks, channel by channel and in patch order: equal bytes at any number of threads.

use crate::matrix::operator::Block;
use crate::matrix::weighted_products;

/// Multiplies entry by entry.
pub(super) fn scale(block: &mut Block, by: &Block) {
    for (value, factor) in block.values_mut().iter_mut().zip(by.values()) {
        *value *= factor;
    }
}

/// sum ← sum + factor term, with a factor for each channel.
pub(super) fn add_scaled(sum: &mut Block, factors: &[f64], term: &Block) {
    combine(sum, &vec![1.0; factors.len()], factors, term);
}

/// sum ← keep sum + factor term, with two factors for each channel.
pub(super) fn combine(sum: &mut Block, keep: &[f64], factors: &[f64], term: &Block) {
    fn fixed<const C: usize>(sum: &mut [f64], keep: &[f64], factors: &[f64], term: &[f64]) {
        let (keep, factors): ([f64; C], [f64; C]) =
            (std::array::from_fn(|c| keep[c]), std::array::from_fn(|c| factors[c]));
        for (values, addends) in sum.as_chunks_mut::<C>().0.iter_mut().zip(term.as_chunks::<C>().0) {
            for c in 0..C {
                values[c] = keep[c] * values[c] + factors[c] * addends[c];
            }
        }
    }
    let (sum, term) = (sum.values_mut(), term.values());
    match factors.len() {
        1 => fixed::<1>(sum, keep, factors, term),
        3 => fixed::<3>(sum, keep, factors, term),
        n_channels => {
            for (values, addends) in sum.chunks_mut(n_channels).zip(term.chunks(n_channels)) {
                for c in 0..n_channels {
                    values[c] = keep[c] * values[c] + factors[c] * addends[c];
                }
            }
        }
    }
}

/// Returns Σ w u v of each channel.
pub(super) fn inner(weights: &[f64], u: &Block, v: &Block) -> Vec<f64> {
    weighted_products(weights, u.values(), v.values())
}

/// Sets one channel of `block` to zero.
fn clear_channel(block: &mut Block, channel: usize) {
    let n_channels = block.n_channels();
    block
        .values_mut()
        .iter_mut()
        .skip(channel)
        .step_by(n_channels)
        .for_each(|x| *x = 0.0);
}

/// Sets all channels to zero but those that are `kept`.
pub(super) fn keep_channels(block: &mut Block, kept: impl Fn(usize) -> bool) {
    for c in (0..block.n_channels()).filter(|&c| !kept(c)) {
        clear_channel(block, c);
    }
}

/// Copies one channel from a block of the same shape.
pub(super) fn copy_channel(to: &mut Block, from: &Block, channel: usize) {
    let n_channels = to.n_channels();
    let pairs = to.values_mut().iter_mut().zip(from.values());
    pairs.skip(channel).step_by(n_channels).for_each(|(a, b)| *a = *b);
}
