//! Reads exitances of single patches: many lightings of one scene.

use std::path::Path;

use super::ReportError;
use super::npy::{Header, push_reals};
use crate::input_file;
use crate::matrix::operator::Block;
use crate::scene::{MAX_EXITANCE, MIN_EXITANCE};

/// The most bytes of a file of exitances.
const LIMIT: u64 = 1 << 34;

/// Exitances of the patches of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Exitances {
    /// The number of lightings.
    pub n_lightings: usize,
    /// True if each has three channels.
    pub is_coloured: bool,
    /// E, W·m⁻², \[n, c\]: the channels of the first lighting, then those of the second, and so on.
    pub values: Block,
}

/// Reads exitances, W·m⁻², from an array of NumPy: \[n\] or \[n, k\] for k grey lightings, \[n, k, 3\] for coloured ones, of f64 or f32.
///
/// # Errors
/// [`ReportError::Unreadable`], and [`ReportError::BadArray`] for any other content, a shape that does not fit `n_patches` patches, or a number that is neither 0 nor from [`MIN_EXITANCE`] to
/// [`MAX_EXITANCE`].
pub fn read(path: &Path, n_patches: usize) -> Result<Exitances, ReportError> {
    let bytes = input_file::read(path, LIMIT).map_err(|source| ReportError::unreadable(path, source))?;
    let bad = |reason: String| ReportError::BadArray {
        path: path.to_owned(),
        reason,
    };
    let mut rest = bytes.as_slice();
    let (header, _) = Header::read(&mut rest).map_err(|reason| {
        bad(format!(
            "{reason}; save it with `numpy.save(file, numpy.ascontiguousarray(exitance, '<f8'))`"
        ))
    })?;
    let shape = &header.shape;
    let expected = format!("expected ({n_patches}, k) for k grey lightings or ({n_patches}, k, 3) for coloured ones");
    let (n_lightings, is_coloured) = match shape[..] {
        [n] if n == n_patches as u64 => (1, false),
        [n, k] if n == n_patches as u64 && k > 0 => (k, false),
        [n, k, 3] if n == n_patches as u64 && k > 0 => (k, true),
        _ => return Err(bad(format!("its shape is {shape:?}; {expected}"))),
    };
    if header.data_byte() != Some(rest.len() as u64) {
        return Err(bad(format!("its shape is {shape:?} in {} bytes", rest.len())));
    }
    let mut values = Vec::new();
    if !push_reals(header.dtype, rest, &mut values) {
        return Err(bad(format!("numbers of type {:?}; save it as float64", header.dtype)));
    }
    let n_channels = values.len() / n_patches;
    let is_possible = |value: f64| (MIN_EXITANCE..=MAX_EXITANCE).contains(&value) || value.abs() <= 0.0;
    if let Some(k) = values.iter().position(|value| !is_possible(*value)) {
        let (patch, value) = (k / n_channels, values[k]);
        return Err(bad(format!(
            "{value:?} of patch {patch} is neither 0 nor from {MIN_EXITANCE:e} to {MAX_EXITANCE:e}; correct it"
        )));
    }
    Ok(Exitances {
        n_lightings: usize::try_from(n_lightings).unwrap_or(usize::MAX),
        is_coloured,
        values: Block::from_values(values, n_channels),
    })
}

impl Exitances {
    /// Returns reflectances \[n, 1\] or \[n, 3\] for all channels of all lightings; `None` if coloured ones meet grey lightings.
    #[must_use]
    pub fn reflectances(&self, reflectance: &Block) -> Option<Block> {
        let (own, n_channels) = (reflectance.n_channels(), self.values.n_channels());
        if own > 1 && !self.is_coloured {
            return None;
        }
        let rows = (0..reflectance.n_rows()).flat_map(|i| (0..n_channels).map(move |c| reflectance.row(i)[c % own]));
        Some(Block::from_values(rows.collect(), n_channels))
    }
}
