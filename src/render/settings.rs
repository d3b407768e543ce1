//! The settings of an image.

use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};

use super::direct::DirectMethod;
use super::gather::GatherSettings;
use crate::geometry::sampling::Sequence;

/// The settings of an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderSettings {
    /// True if each patch is shown with its own constant value, not interpolated between patches.
    pub flat: bool,
    /// The square root s of the number of samples whose mean is the colour of a pixel: on a regular grid unless `adaptive`, the centre alone for 1.
    pub samples: NonZeroU32,
    /// True if several samples of a pixel form a scrambled net.
    ///
    /// There are then 4 s² where the pixel or one beside it shows an edge, and 16 s² at an edge of an emitter.
    /// Has no effect in an unfolded view, where the edges of rectangles run along those of pixels.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub adaptive: bool,
    /// The direct pass.
    pub direct: DirectMethod,
    /// Final gather, in place of interpolation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gather: Option<GatherSettings>,
    /// The sequence of numbers of the direct pass and of gathering.
    pub sequence: Sequence,
    /// The seed of these numbers.
    pub seed: u64,
}

impl RenderSettings {
    /// Returns the default [`samples`](Self::samples): 1 in an unfolded view, for checks by pixels; more in others, for the eye.
    #[must_use]
    pub fn default_samples(is_unfolded: bool) -> NonZeroU32 {
        NonZeroU32::MIN.saturating_add(u32::from(!is_unfolded))
    }
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            flat: false,
            samples: NonZeroU32::MIN,
            adaptive: false,
            direct: DirectMethod::Off,
            gather: None,
            sequence: Sequence::Sobol,
            seed: 0,
        }
    }
}
