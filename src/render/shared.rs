//! Work on the blocks of an image, in order: computed here, or shared by ranks.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::RenderError;
use crate::progress::Progress;
use crate::ranks::{Code, InTurn};
use crate::threads;

/// The least number of chunks of blocks for each rank, if there are enough blocks.
const CHUNKS_PER_RANK: usize = 16;

/// The greatest number of blocks of a chunk.
const MAX_BLOCKS: usize = 16;

/// Computes blocks 0, 1, ..., `n` − 1, up to `at_once` in parallel, and calls `take(k, result)` in order.
///
/// `work` returns `None` once it is to stop, and advances the progress by a step.
///
/// # Errors
/// [`RenderError::Interrupted`].
pub(super) fn for_each<T: Send + Serialize + DeserializeOwned>(
    progress: &dyn Progress,
    (n, at_once): (usize, usize),
    work: impl Fn(usize) -> Option<T> + Sync,
    mut take: impl FnMut(usize, T),
) -> Result<(), RenderError> {
    let ranks = progress.ranks();
    if ranks.size() == 1 {
        for begin in (0..n).step_by(at_once) {
            let end = n.min(begin + at_once);
            let results = threads::collect(end - begin, |k| work(begin + k));
            for (k, result) in (begin..end).zip(results) {
                take(k, result.ok_or(RenderError::Interrupted)?);
            }
        }
        return Ok(());
    }
    let n_together = (n / (CHUNKS_PER_RANK * ranks.size())).clamp(1, MAX_BLOCKS);
    let chunk = |c: usize| c * n_together..n.min((c + 1) * n_together);
    let window = (at_once / n_together).max(2 * ranks.size());
    let of_chunk = |c: usize| -> Vec<Option<T>> { threads::collect(chunk(c).len(), |k| work(chunk(c).start + k)) };
    let of_chunks = Code {
        encode: |results: &Vec<Option<T>>| to_bytes(results),
        decode: |c: usize, bytes: &[u8]| {
            let came: Option<Vec<Option<T>>> = ciborium::from_reader(bytes).ok();
            came.unwrap_or_else(|| chunk(c).map(|_| None).collect())
        },
    };
    let sizes = (n.div_ceil(n_together), window);
    for (c, (results, is_own)) in InTurn::new(ranks, sizes, of_chunk, of_chunks).enumerate() {
        for (k, result) in chunk(c).zip(results) {
            take(k, result.ok_or(RenderError::Interrupted)?);
            if !is_own {
                progress.advance(1);
            }
        }
    }
    Ok(())
}

/// Returns a value as bytes, with which `ciborium::from_reader` makes the same value to the last bit.
pub(super) fn to_bytes(value: &impl Serialize) -> Vec<u8> {
    let mut bytes = Vec::new();
    ciborium::into_writer(value, &mut bytes).expect("memory takes all bytes");
    bytes
}

#[cfg(test)]
mod tests {
    use super::to_bytes;
    use crate::render::pixel::Pixel;

    #[test]
    fn pixels_come_back_to_the_last_bit() {
        let mut pixel = Pixel::default();
        pixel.shade.irradiance = [0.1, 1.0 / 3.0, 1e-300];
        pixel.direct.variance = [f64::MIN_POSITIVE, -0.0, 5e300];
        let back: Vec<Pixel> = ciborium::from_reader(&to_bytes(&vec![pixel; 3])[..]).expect("pixels");
        assert_eq!(back.len(), 3);
        let bits = |own: &Pixel| [own.shade.irradiance, own.direct.variance].map(|numbers| numbers.map(f64::to_bits));
        assert_eq!(bits(&back[2]), bits(&pixel));
    }
}
