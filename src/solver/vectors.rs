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

/// Returns the channels in groups of equal reflectance, in the order of their first members.
pub(super) fn equal_channels(reflectance: &Block) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for c in 0..reflectance.n_channels() {
        let equals = |first: usize| {
            (0..reflectance.n_rows()).all(|i| {
                let row = reflectance.row(i);
                row[first].to_bits() == row[c].to_bits()
            })
        };
        match groups.iter_mut().find(|group| equals(group[0])) {
            Some(group) => group.push(c),
            None => groups.push(vec![c]),
        }
    }
    groups
}

/// Returns sqrt(Σ A e² / Σ A B²) of each channel; 0 where it has no light, NaN or infinite where the error is unknown.
pub(crate) fn relative_errors(areas: &[f64], error: &Block, radiosity: &Block) -> Vec<f64> {
    let all: Vec<usize> = (0..radiosity.n_rows()).collect();
    relative_errors_of(&all, areas, error, radiosity)
}

/// Does the work of [`relative_errors`] for some of the patches.
pub(super) fn relative_errors_of(patches: &[usize], areas: &[f64], error: &Block, radiosity: &Block) -> Vec<f64> {
    let norm = |block: &Block, c: usize| {
        let values = || patches.iter().map(|&i| (areas[i], block.row(i)[c].abs()));
        // In units of the greatest, so that no square overflows or vanishes.
        let unit = values()
            .fold(0.0, |most: f64, (_, x)| most.max(x))
            .max(f64::MIN_POSITIVE);
        let sum: f64 = values().map(|(area, x)| area * (x / unit).powi(2)).sum();
        (sum.sqrt(), unit)
    };
    let of_channel = |c: usize| {
        let ((e, e_unit), (b, b_unit)) = (norm(error, c), norm(radiosity, c));
        if b > 0.0 || b.is_nan() {
            e / b * (e_unit / b_unit)
        } else {
            0.0
        }
    };
    (0..radiosity.n_channels()).map(of_channel).collect()
}
