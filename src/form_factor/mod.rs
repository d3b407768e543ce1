//! Form factors F_ij: the fraction of the light leaving patch i that reaches patch j.
//!
//! F_ij = 1/A_i ∫_{A_i} ∫_{A_j} V cos θ_i cos θ_j / (π r²) dA_j dA_i, dimensionless, in \[0, 1\].
//!
//! Each method is one file behind [`FormFactorMethod`], and one line in the [`registry`]. Their guarantees without occluders:
//!
//! | method | A_i F_ij symmetric | A_i F_ij ≤ min(A_i, A_j) | rows sum to 1 if closed | error of an entry from |
//! |---|---|---|---|---|
//! | [`CentrePoint`] | unless normalised | no | if normalised | the exact value |
//! | [`ParametricDifferential`] | yes | no | no | the exact value |
//! | [`RandomShooting`] | to the noise | to the noise | yes | the number of hits |
//! | [`GaussShooting`] | to the noise and the error of its grid | no | yes | the number of hits |
//! | [`Hemicube`] | no | no | yes | the exact value, and the cells' size |
//! | [`GaussLambert`] | yes | to its error | to its error | a rule with fewer points |
//! | [`ContourIntegral`] | yes | yes | to rounding | rounding |
//! | [`ClosedForm`] | yes | yes | to rounding | rounding |
//! | [`QuasiMonteCarlo`] | yes | yes | to rounding | rounding |
//! | [`ExactMethod`] | yes | yes | to rounding | rounding |
//!
//! How many entries lie within these errors, in twenty scenes, is in `docs/stated-errors.md`, with the command that measures it, and with the repair of rows that leaves
//! the smaller error ([`Need`](crate::matrix::Need)). An entry that no ray of a row hit has the error that this leaves open ([`std_error`](crate::matrix::FormFactors::std_error)).
//!
//! With occluders the methods between pairs add the standard error of the visible fraction, by rays between the two patches.
//! [`ExactMethod`] keeps to a tolerance instead: it clips, and traces f64 rays of its own past many occluders. The others trace no ray where nothing can occlude.
//!
//! Where a file [shows that its coordinates were rounded](crate::scene::Written::shows_rounding), all methods but [`OnTheFly`] add to the error of an entry the effect of half a unit of the last place:
//! the change of F_ij to the first order where the vertices of both patches and of their occluders move. Whole numbers and short decimals of a mesh that fits count as exact.

mod backs;
mod bounds;
mod centre;
mod closed_form;
mod closure;
mod contour;
mod entry;
mod error;
mod exact;
mod facing;
mod forecast;
mod fraction;
mod gauss_lambert;
mod hemicube;
mod journal;
mod kept;
mod on_the_fly;
mod pairs;
pub mod partial;
mod pdm;
mod point_errors;
mod probe;
mod qmc;
pub mod registry;
mod rounded;
mod rows;
mod sampled;
mod segments;
mod settings;
mod sg;
mod shared;
mod shooting;
mod sight;
mod sky;
mod sr;
mod update;

pub(crate) use bounds::upper_bounds;
pub use centre::{CentrePoint, NORMALISE};
pub use closed_form::ClosedForm;
pub use closure::{Closure, Enclosed, Leak, MAX_ESCAPED, closed_rows, enclosed};
pub use contour::ContourIntegral;
pub use error::FormFactorError;
pub use exact::{BUDGET, ExactMethod, ExactRows, ROW_TOLERANCE, worst_row};
pub use forecast::{Choice, within};
pub use fraction::Fraction;
pub use gauss_lambert::GaussLambert;
pub use hemicube::{Hemicube, RESOLUTION};
pub use on_the_fly::OnTheFly;
pub use pdm::ParametricDifferential;
pub use qmc::QuasiMonteCarlo;
pub use registry::method;
pub use settings::{MethodSettings, POINTS, RAYS, SEQUENCE, TOLERANCE};
pub use sg::GaussShooting;
pub(crate) use shared::waiting_byte;
pub use sky::{SkyFactors, sky_factors};
pub use sr::RandomShooting;
pub use update::{Before, Change};

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::matrix::{FormFactors, RowTile, StorageChoice};
use crate::mesh::Mesh;
use crate::printable::counted;
use crate::progress::Progress;
use crate::scene::{Scene, Written};
use crate::visibility::Visibility;

/// The input of every method.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The scene that the patches are cut from.
    pub scene: &'a Scene,
    /// The patches.
    pub mesh: &'a Mesh,
    /// The visibility between patches.
    pub visibility: &'a dyn Visibility,
    /// True if no face can occlude another (see [`is_convex_and_empty`](crate::scene::topology::is_convex_and_empty)):
    /// methods between pairs of patches then trace no ray.
    pub unoccluded: bool,
}

/// Form factors, and how a method computed them.
#[derive(Clone, Debug)]
pub struct Computed {
    /// The form factors.
    pub factors: FormFactors,
    /// The counts of pairs by their treatment; `None` for methods that do not work by pairs.
    pub pairs: Option<PairCounts>,
    /// False if the error of a pair is above the tolerance.
    ///
    /// Either a budget was spent first, or corners are rounded too coarsely ([`PairCounts`] has both counts); the entries' errors state the accuracy reached.
    pub tolerance_met: bool,
}

/// How many unordered pairs of patches went which way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(default)]
pub struct PairCounts {
    /// Pairs whose fronts do not face each other: exactly 0.
    pub not_facing: u64,
    /// Pairs that see each other whole, as far as the method can tell.
    pub full: u64,
    /// Pairs that do not see each other at all, as far as the method can tell.
    pub hidden: u64,
    /// Pairs that are occluded, or may be.
    pub partial: u64,
    /// Of the partial pairs of `exact`, those that were found by clipping.
    pub clipped: u64,
    /// Of the partial pairs of `exact`, those that were found by rays, as clipping would have cost more.
    pub by_rays: u64,
    /// Rays traced between points of pairs.
    pub n_rays: u64,
    /// Pairs whose integral has an error above the tolerance: the budget was spent, or f64 has no more digits.
    pub n_above_tolerance: u64,
    /// Pairs whose error is above the tolerance by what rounded corners add to it: more work does not help, corners with more digits do. Those whose integral is above the tolerance too count in both.
    pub n_above_by_rounding: u64,
    /// The most that rounded corners add to the error of one of `n_above_by_rounding`, as a part of A_i F_ij / min(A_i, A_j); 0 without any.
    pub rounding_error_max: f64,
    /// Pairs that face each other and were taken over from before a change; they count nowhere else but where they are above the tolerance.
    pub kept: u64,
}

impl PairCounts {
    /// Returns the sums of the counts of two sets of pairs.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            not_facing: self.not_facing + other.not_facing,
            full: self.full + other.full,
            hidden: self.hidden + other.hidden,
            partial: self.partial + other.partial,
            clipped: self.clipped + other.clipped,
            by_rays: self.by_rays + other.by_rays,
            n_rays: self.n_rays + other.n_rays,
            n_above_tolerance: self.n_above_tolerance + other.n_above_tolerance,
            n_above_by_rounding: self.n_above_by_rounding + other.n_above_by_rounding,
            rounding_error_max: self.rounding_error_max.max(other.rounding_error_max),
            kept: self.kept + other.kept,
        }
    }

    /// Returns the doubt above the tolerance that rounded coordinates leave, if any.
    #[must_use]
    pub fn doubted(self, scene: &Scene) -> Option<RoundingDoubt> {
        let n_pairs = self.n_above_by_rounding;
        (n_pairs > 0).then(|| RoundingDoubt {
            n_pairs,
            error_max: self.rounding_error_max,
            written: scene.rounded(),
            joined_m: scene.joined_beyond_digits(),
        })
    }

    /// Returns whether the error of every pair is within the tolerance, by the counts of pairs above it.
    #[must_use]
    pub fn tolerance_met(&self) -> bool {
        self.n_above_tolerance == 0 && self.n_above_by_rounding == 0
    }
}

/// The uncertainty of form factors from rounded coordinates: more digits help, or coordinates nearer to the origin, or a smaller distance over which vertices are joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundingDoubt {
    /// Pairs above the tolerance.
    pub n_pairs: u64,
    /// The most that rounding adds to the error of one of them, as a part of A_i F_ij / min(A_i, A_j).
    pub error_max: f64,
    /// How the coordinates are rounded; `None` where faces are not flat, or miss each other.
    pub written: Option<Written>,
    /// The greatest distance of joined vertices, in m, where it exceeds the rounding of the file's digits.
    pub joined_m: Option<f64>,
}

/// The remedy of coordinates that are rounded too coarsely.
const MORE_DIGITS: &str = "give coordinates with more digits or nearer to the origin";

impl fmt::Display for RoundingDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = usize::try_from(self.n_pairs).unwrap_or(usize::MAX);
        let (cause, remedy) = match (self.joined_m, self.written) {
            (Some(joined), _) => (
                format!("vertices are joined over up to {joined:.1e} m"),
                "give a smaller --merge-tolerance",
            ),
            (None, Some(written)) => (format!("coordinates are rounded {written}"), MORE_DIGITS),
            (None, None) => ("quads are not flat, or faces miss each other".to_owned(), MORE_DIGITS),
        };
        write!(
            f,
            "the stated error of {} is above the tolerance, up to {:.1e}, because {cause}; {remedy}",
            counted(n, "pair"),
            self.error_max
        )
    }
}

/// How well a method keeps A_i F_ij = A_j F_ji, and with it A_i F_ij ≤ min(A_i, A_j).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reciprocity {
    /// Each exchange area is computed once, and is at most the smaller area, up to its error.
    Exact,
    /// To the noise of rays that are counted.
    ToNoise,
    /// Not promised: points on a patch stand for all of it, or rows are rescaled.
    NotPromised,
}

/// The result of computing form factors.
pub type ComputeResult = Result<Computed, FormFactorError>;

/// A way to compute form factors.
pub trait FormFactorMethod: Sync {
    /// Returns the name on the command line.
    fn name(&self) -> &'static str;

    /// Returns how far the results are reciprocal.
    fn reciprocity(&self) -> Reciprocity {
        Reciprocity::Exact
    }

    /// Returns true if quadrature bias can violate A_i F_ij ≤ min(A_i, A_j) or Σ_j F_ij ≤ 1.
    ///
    /// False for methods that err by noise or within a tolerance, or whose rows are complete anyway.
    fn errs_by_rule(&self) -> bool {
        false
    }

    /// Returns whether exchange areas are symmetric, with the noise of rays from one patch of a pair to the other.
    fn has_noisy_pairs(&self) -> bool {
        false
    }

    /// Returns an upper bound of the memory in bytes of the method for `n_patches` patches, beside the rows that it gives away one by one.
    fn working_byte(&self, _n_patches: usize) -> u64 {
        0
    }

    /// Returns how many matrices the method holds at most beside the one that it fills.
    fn matrices_beside(&self) -> u32 {
        0
    }

    /// Computes all form factors of a mesh.
    ///
    /// The result depends on the input and the method's settings alone: equal settings give equal bytes at any number of threads.
    ///
    /// # Errors
    /// [`FormFactorError`] if the method cannot treat the scene, there is no patch, or a value does not fit the precision of the storage.
    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult;

    /// Computes the form factors after some patches have moved, and keeps those that are the same as before the move ([`PairCounts::kept`]).
    ///
    /// Methods that cannot find these compute all of them anew.
    ///
    /// # Errors
    /// As [`compute`](Self::compute).
    ///
    /// # Panics
    /// If `before` is about another number of patches or faces.
    fn update(
        &self,
        input: Input<'_>,
        _before: Before<'_>,
        storage: StorageChoice,
        progress: &dyn Progress,
    ) -> ComputeResult {
        self.compute(input, storage, progress)
    }

    /// Returns a function that computes any rows anew, the same as [`compute`](Self::compute), or `None` for methods that compute pairs of patches.
    fn rows<'a>(&'a self, _input: Input<'a>) -> Option<Box<dyn Fn(Range<usize>) -> RowTile + Sync + 'a>> {
        None
    }
}
