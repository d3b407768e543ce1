//! Work on the blocks of an image, in order: computed here, or shared by ranks.

use super::error::RenderError;
use super::gather::Gathered;
use super::kept::BlockState;
use super::pixel::Pixel;
use super::rare::RareLight;
use super::renderer::SurfaceSums;
use crate::progress::Progress;
use crate::ranks::{Code, InTurn};
use crate::threads;

/// The least number of chunks of blocks for each rank, if there are enough blocks.
const CHUNKS_PER_RANK: usize = 16;

/// The greatest number of blocks of a chunk.
const MAX_BLOCKS: usize = 16;

/// The value in place of the length of a result when the rank was interrupted.
const INTERRUPTED: u64 = u64::MAX;

/// Computes blocks 0, 1, ..., `n` − 1, up to `at_once` in parallel, and calls `take(k, result)` in order.
///
/// `work` returns `None` once it is to stop, and advances the progress by a step.
///
/// # Errors
/// [`RenderError::Interrupted`].
pub(super) fn for_each<T: Send>(
    progress: &dyn Progress,
    (n, at_once): (usize, usize),
    work: impl Fn(usize) -> Option<T> + Sync,
    code: &Code<impl Fn(&T) -> Vec<u8>, impl Fn(usize, &[u8]) -> Option<T>>,
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
        encode: |results: &Vec<Option<T>>| encode(results, &code.encode),
        decode: |c: usize, bytes: &[u8]| {
            let mut rest = bytes;
            let part = |k| next_part(&mut rest).and_then(|own| (code.decode)(k, own));
            chunk(c).map(part).collect::<Vec<_>>()
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

fn encode<T>(results: &[Option<T>], encode: impl Fn(&T) -> Vec<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for result in results {
        let part = result.as_ref().map(&encode);
        let length = part.as_ref().map_or(INTERRUPTED, |own| own.len() as u64);
        bytes.extend(length.to_le_bytes());
        bytes.extend(part.unwrap_or_default());
    }
    bytes
}

/// Returns the next part of the bytes; `None` if its rank was interrupted.
fn next_part<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, after) = rest.split_first_chunk()?;
    let length = u64::from_le_bytes(*length);
    if length == INTERRUPTED {
        *rest = after;
        return None;
    }
    let (own, after) = after.split_at_checked(usize::try_from(length).ok()?)?;
    *rest = after;
    Some(own)
}

/// Returns rendered pixels as bytes.
pub(super) fn encode_pixels(block: &(Vec<Pixel>, SurfaceSums)) -> Vec<u8> {
    to_bytes(block)
}

/// Returns rendered pixels from their bytes.
pub(super) fn decode_pixels(_: usize, bytes: &[u8]) -> Option<(Vec<Pixel>, SurfaceSums)> {
    ciborium::from_reader(bytes).ok()
}

/// Returns a block during final gather as bytes.
pub(super) fn encode_state(state: &BlockState) -> Vec<u8> {
    let mut gathered = Vec::new();
    if state.n_rounds > 0 {
        for pixel in &state.gathered {
            pixel.encode(&mut gathered);
        }
    }
    let mut rare = Vec::new();
    if let Some(own) = &state.rare {
        own.encode(&mut rare);
    }
    to_bytes(&(&state.pixels, gathered, rare, state.n_rounds))
}

/// Returns a block during final gather from its bytes.
pub(super) fn decode_state(_: usize, bytes: &[u8]) -> Option<BlockState> {
    let (pixels, gathered, rare, n_rounds): (Vec<Pixel>, Vec<u8>, Vec<u8>, u32) = ciborium::from_reader(bytes).ok()?;
    let gathered = if n_rounds > 0 {
        let (all, []) = gathered.as_chunks::<{ Gathered::N_BYTE }>() else {
            return None;
        };
        all.iter().map(|own| Gathered::decode(own)).collect::<Option<_>>()?
    } else {
        vec![Gathered::default(); pixels.len()]
    };
    Some(BlockState {
        pixels,
        gathered,
        rare: if rare.is_empty() {
            None
        } else {
            Some(RareLight::decode(&rare)?)
        },
        n_rounds,
    })
}

fn to_bytes(value: &impl serde::Serialize) -> Vec<u8> {
    let mut bytes = Vec::new();
    ciborium::into_writer(value, &mut bytes).expect("memory takes all bytes");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_back_in_order_and_none_where_work_stopped() {
        let bytes = encode(&[Some(0), Some(1), None, Some(3)], |&k| vec![1; k]);
        let mut rest = bytes.as_slice();
        let parts: Vec<Option<usize>> = (0..4).map(|_| next_part(&mut rest).map(<[u8]>::len)).collect();
        assert_eq!(parts, [Some(0), Some(1), None, Some(3)]);
        assert!(rest.is_empty() && next_part(&mut rest).is_none());
    }

    #[test]
    fn pixels_come_back_to_the_last_bit() {
        let mut pixel = Pixel::default();
        pixel.shade.irradiance = [0.1, 1.0 / 3.0, 1e-300];
        pixel.direct.variance = [f64::MIN_POSITIVE, -0.0, 5e300];
        let (back, sums) = decode_pixels(0, &encode_pixels(&(vec![pixel; 3], SurfaceSums::new()))).expect("pixels");
        assert!(sums.is_empty() && back.len() == 3);
        let bits = |own: &Pixel| [own.shade.irradiance, own.direct.variance].map(|numbers| numbers.map(f64::to_bits));
        assert_eq!(bits(&back[2]), bits(&pixel));
    }
}
