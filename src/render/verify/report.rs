//! The report of a verification.

use serde::Serialize;

/// The result of a verification; see [`verify`](super::verify()).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct VerifyReport {
    /// The surface that the form factors are to, where the image is a field of them; all errors and means are then form factors.
    pub field: Option<String>,
    /// Whether everything that could be checked was right, and something could.
    pub passed: bool,
    /// Whether this says all: no pixel that shows a front was left out.
    pub complete: bool,
    /// Whether the scene in the file is the one that its hash was made from.
    pub scene_intact: bool,
    /// Pixels that show the front of a face, or may.
    pub n_pixels: usize,
    /// Pixels that show nothing.
    pub n_background: usize,
    /// Pixels that show backs of faces alone: these are black, and are checked to be.
    pub n_backs: usize,
    /// Pixels that were compared with the exact irradiance.
    pub n_checked: usize,
    /// Those among them whose light depends on shadow rays, which were drawn again.
    pub n_drawn: usize,
    /// Pixels with a sample on the border of a surface, or of which the method's own answer is not known: nothing is said of their light.
    pub n_not_checkable: usize,
    /// Checked pixels outside their tolerance.
    pub n_outside: usize,
    /// Rows and columns, of a tile or of a perspective image, whose mean is outside its tolerance.
    pub n_strips_outside: usize,
    /// Pixels whose position `P`, depth `Z` or normal `N` is not that of the point in view, or whose `patch` is none on a face, or some beside all faces.
    pub n_misplaced: usize,
    /// Pixels whose layers contradict each other or the scene. A radiosity is not E + ρ H, a radiance not radiosity/π, or an albedo not ρ; an irradiance is below the direct
    /// one (or not equal to it although nothing reflects) or above that of a furnace; an error is negative or no number; there is light in the background, or a patch is on two faces.
    pub n_inconsistent: usize,
    /// The largest error of a checked pixel and channel, in W·m⁻².
    pub max_error: f64,
    /// The root of the mean squared error over checked pixels and channels, in W·m⁻².
    pub rms_error: f64,
    /// The root mean square of error / standard deviation over all pixels and channels where a normal distribution fits: 1 for independent rays, less for scrambled nets.
    /// `None` where there is no noise, or too few rays. The standard deviation is that of the emitters' true form factors and the rays that the file tells of.
    pub deviation: Option<f64>,
    /// The tolerance and its parts.
    pub tolerance: Tolerance,
    /// One row per tile, or per surface that a perspective image shows.
    pub walls: Vec<WallReport>,
    /// How far each layer was checked.
    pub layers: Vec<LayerReport>,
}

/// How a layer was checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum LayerCheck {
    /// Against the closed form, wherever it is known.
    ClosedForm,
    /// Against the scene and the view, wherever what a pixel shows does not depend on rounding.
    Scene,
    /// Against other layers, from which it follows.
    OtherLayers,
    /// By bounds alone: no closed form describes it.
    Bounds,
    /// The file does not have it.
    Missing,
}

/// One layer, or the channels of one name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LayerReport {
    /// The name before the dot, or of the channels.
    pub name: String,
    /// How it was checked.
    pub check: LayerCheck,
}

/// The tolerance of a pixel: statistical + offset + rounding, each computed per pixel and channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "VerifyTolerance"))]
pub struct Tolerance {
    /// The probability with which a correct image may fail, all checks together.
    pub false_alarm: f64,
    /// The number of comparisons that this probability is shared by.
    pub n_comparisons: usize,
    /// Rays per pixel whose noise is allowed for; 0 where the image has none, or where its shadow rays are drawn again.
    pub n_rays: u64,
    /// The number of independent samples that these rays are worth; 0 where the image has none.
    pub n_effective: f64,
    /// The largest statistical part of a pixel's tolerance, in W·m⁻²: the proven bound, or what its neighbours' errors allow. For shadow rays that were drawn again, their distance from the truth.
    pub max_statistical: f64,
    /// The largest part due to the rays' start above the surface, in W·m⁻²: the exact change of the answer over 1.1 offsets.
    pub max_offset: f64,
    /// The largest part due to rounding, that of the corners' coordinates among it, in W·m⁻².
    pub max_rounding: f64,
    /// The largest [`VerifyReport::deviation`] that is right.
    pub max_deviation: Option<f64>,
}

/// One tile, or what a perspective image shows of one surface: its mean over all checked pixels.
///
/// The wall is right if |mean − expected| ≤ statistical + offset + rounding in every channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct WallReport {
    /// The surface's name.
    pub name: String,
    /// Pixels that were compared.
    pub n_checked: usize,
    /// The mean direct irradiance in the image.
    pub mean: [f64; 3],
    /// The mean of the exact irradiance at the same points.
    pub expected: [f64; 3],
    /// The exact mean over the whole wall, where a tile shows all of a rectangle and was checked everywhere.
    pub exact: Option<[f64; 3]>,
    /// expected − exact: what pixel centres miss of the wall's mean.
    pub quadrature: Option<[f64; 3]>,
    /// mean − exact, or mean − expected where there is no `exact`.
    pub error: [f64; 3],
    /// The bound on `error`: statistical + offset + rounding + |quadrature|.
    pub tolerance: [f64; 3],
    /// The statistical part.
    pub statistical: [f64; 3],
    /// Whether the wall is right.
    pub passed: bool,
}
