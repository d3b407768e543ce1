//! The warnings of a study: each states the fault, the number, the consequence and the parameter that helps.

use std::borrow::Cow;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::Parameter;
use crate::audit::Check;
use crate::form_factor::RoundingDoubt;
use crate::progress::Forecast;
use crate::scene::{Origin, SceneWarning};
use crate::solver::StopReason;

/// A warning of a study: its results are valid, but perhaps not as intended, or less accurate than requested.
///
/// Warnings of a solution can be stored in a checkpoint; those with `serde(skip)` occur before it.
/// [`Display`](std::fmt::Display) writes parameters by their names, [`text`](Self::text) as given by a program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Warning {
    /// A warning of the scene as read.
    #[serde(skip)]
    Scene(SceneWarning),
    /// No face emits light in one of several lightings.
    DarkLighting {
        /// The file of the lighting.
        file: PathBuf,
    },
    /// Faces are too small, beside the size of the scene, for rays to hit them.
    #[serde(skip)]
    VanishedFaces {
        /// The place of the first one.
        at: Origin,
        /// How many there are.
        count: usize,
    },
    /// A closed surface stands inside of another and faces inwards.
    #[serde(skip)]
    InsideOut {
        /// The place of its first face.
        at: Origin,
        /// The surface of this face.
        surface: String,
    },
    /// No face sees another.
    NoneSees {
        /// The file of the scene.
        file: PathBuf,
        /// The surface, if there is only one.
        surface: Option<String>,
    },
    /// No face that emits light sees another.
    NoEmitterSees {
        /// The file of the scene.
        file: PathBuf,
    },
    /// More than half of all faces see only backs.
    MostSeeBacks {
        /// The file of the scene.
        file: PathBuf,
        /// Their number.
        count: usize,
        /// The number of all faces.
        n_faces: usize,
    },
    /// No face of a surface sees another, though their backs would.
    TurnedSurface {
        /// The file of the scene.
        file: PathBuf,
        /// The surface.
        surface: String,
    },
    /// Faces of a surface see no other, and others see their backs.
    #[serde(skip)]
    TurnedFaces {
        /// The place of the first one.
        at: Origin,
        /// The surface.
        surface: String,
        /// Their number.
        count: usize,
    },
    /// Faces of further surfaces see no other; the surfaces are not named.
    MoreTurned {
        /// The file of the scene.
        file: PathBuf,
        /// The number of surfaces.
        count: usize,
    },
    /// Rays start far off the faces, relative to the size of the smallest patch.
    FarStart {
        /// Their distance from the face, m.
        offset: f64,
        /// The width of the smallest patch, m.
        width: f64,
    },
    /// Two surfaces are nearer to each other than rays can resolve.
    NarrowGap {
        /// Both surfaces, each with the label of its face, as in `line 12`.
        surfaces: [(String, String); 2],
        /// Their distance, m.
        width: f64,
        /// The distance of rays' origins from a face, m.
        offset: f64,
    },
    /// Light leaks under objects that stand on patches which are not cut at contact edges.
    LightLeak {
        /// The number of patches.
        n_patches: usize,
        /// The leak, in `unit`.
        value: f64,
        /// Its error, in `unit`.
        error: f64,
        /// The unit, W or m2.
        unit: Cow<'static, str>,
        /// The leak as a part of `whole`.
        relative: f64,
        /// The reference of `relative`.
        whole: Cow<'static, str>,
        /// True if the form factors are from a file, and have to be computed again.
        is_from_file: bool,
    },
    /// Work will take long.
    #[serde(skip)]
    LongWork(Forecast),
    /// Pairs of patches spent their budget, or the digits of f64, above the tolerance.
    #[serde(skip)]
    AboveTolerance {
        /// Their number.
        n_pairs: u64,
        /// The greatest error of A_i F_ij / min(A_i, A_j).
        worst: f64,
        /// The parameter of the tolerance.
        tolerance: Parameter,
    },
    /// Rows are above the tolerance of rows, and a tighter one of entries does not help.
    RowsAboveTolerance {
        /// The greatest error of a row.
        worst: f64,
    },
    /// Rounded coordinates leave the errors of pairs above the tolerance.
    #[serde(skip)]
    Rounded {
        /// The number of pairs, their error, and the cause.
        doubt: RoundingDoubt,
        /// The parameter of the tolerance.
        tolerance: Parameter,
    },
    /// The form factors of a file are above their tolerance.
    FileAboveTolerance {
        /// The file.
        file: PathBuf,
    },
    /// The form factors of a file are above their tolerance, by rounded coordinates.
    #[serde(skip)]
    FileRounded {
        /// The file.
        file: PathBuf,
        /// The number of pairs, their error, and the cause.
        doubt: RoundingDoubt,
    },
    /// The checkpoint could not be written completely.
    CheckpointIncomplete {
        /// The file.
        file: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The checkpoint of finished work could not be removed.
    CheckpointLeft {
        /// The file.
        file: PathBuf,
        /// The reason.
        reason: String,
    },
    /// Rays met no front in rows with known sum 1.
    SlippedRays {
        /// Their number.
        n_lost: u64,
        /// The number of all rays.
        n_rays: u64,
    },
    /// Rows are to be restored to sum 1, but no row is known to have this sum.
    NothingToClose,
    /// Enclosure rows differ from 1 by more than their stated error.
    #[serde(skip)]
    DoubtedRows {
        /// The place of the first patch's face.
        at: Origin,
        /// The surface of this face.
        surface: String,
        /// The number of rows.
        count: usize,
    },
    /// Row sums were not restored.
    NotBalanced {
        /// The remaining deviation from 1.
        row_error_max: f64,
        /// The number of passes.
        n_passes: usize,
    },
    /// A conservation check fails.
    BrokenLaw(Check),
    /// Form factors stored in f32 change radiosities.
    RoundedToF32 {
        /// The relative change.
        relative: f64,
    },
    /// The solver's tolerance is dominated by the emitters' own light.
    LampsOutshine {
        /// The bound on the error, relative to the reflected light.
        bound: f64,
        /// A sufficient tolerance; `None` if no solver meets one.
        tolerance: Option<f64>,
    },
    /// The solution of the equations is negative somewhere, so it is not physical.
    NegativeLight {
        /// The relative residual.
        residual: f64,
        /// The greatest row sum.
        row_sum_max: f64,
    },
    /// The solver did not converge.
    NotConverged {
        /// The stop reason.
        reason: StopReason,
        /// The relative residual.
        residual: f64,
    },
    /// No bound on the error of the solution can be proved.
    NoBound,
    /// The form factors are too inaccurate to state an error of the solution.
    TooInexact,
    /// The mesh is too coarse for a surface.
    CoarseMesh {
        /// The surface.
        surface: String,
        /// The relative change of its mean radiosity with a quarter of the patches.
        change: f64,
    },
    /// Form factors that are not stored state no error.
    NoErrorOnTheFly,
    /// Surfaces are smaller than two voxels.
    SmallSurfaces {
        /// Their number.
        count: usize,
        /// One of them.
        surface: String,
        /// Its size, m.
        side: f64,
        /// The size of a voxel, m.
        size: f64,
        /// The number of voxels along the longest axis at which it would be two voxels wide.
        enough: f64,
    },
    /// Gaps are narrower than two voxels.
    ThinGaps {
        /// The number of voxels along the longest axis.
        n_voxels: u32,
        /// The surfaces on both sides of each.
        pairs: Vec<[String; 2]>,
    },
    /// Voxels of a closed scene can be reached from outside.
    OpenVoxels {
        /// Their number.
        count: usize,
        /// The surfaces of these voxels.
        surfaces: Vec<String>,
    },
    /// Links leave a closed scene.
    EscapingLinks {
        /// Their number.
        n_escaped: u64,
        /// The number of all links.
        n_links: u64,
        /// The power that is lost there and at backs, W.
        power: f64,
        /// The share of the emitted power.
        share: f64,
    },
    /// Light passes through closed surfaces.
    PassedWalls {
        /// The power, W.
        power: f64,
        /// The share of the emitted power.
        share: f64,
        /// The thickness of the thinnest wall, m, if there is one thinner than two voxels.
        thickness: Option<f64>,
        /// The sufficient number of voxels along the longest axis.
        enough: Option<u32>,
    },
    /// Light is unshot after the last propagation.
    UnshotLight {
        /// The number of propagations.
        passes: usize,
        /// The unshot part of the power.
        unshot: f64,
    },
    /// Final gather left pixels above the noise.
    NoisyPixels {
        /// The image.
        file: PathBuf,
        /// Their number.
        n_above: u64,
        /// The number of all pixels.
        n_pixels: u64,
        /// The requested noise.
        noise: f64,
    },
    /// No pixel shows the front of a face.
    BlankImage {
        /// The camera, in words.
        camera: String,
    },
    /// No viewer listens at an address.
    NoViewer {
        /// The address.
        address: String,
        /// The reason.
        reason: String,
    },
    /// The viewer that showed an image disconnected.
    ViewerGone,
    /// Black backs of faces absorb heat.
    HeatToBacks {
        /// The absorbed power, W.
        power_w: f64,
    },
    /// The stated errors exclude the error of the mesh.
    NoMeshError,
    /// The error of the mesh is known only from a mesh of one patch per face, and is large.
    OnePatchAFace {
        /// The greatest relative change of a surface's mean radiosity in that mesh.
        change: f64,
    },
    /// Temperatures are inaccurate.
    InexactHeat {
        /// The greatest error of a surface's irradiance, relative to the larger of that and its emissive power.
        relative: f64,
    },
    /// A warning of the program itself.
    Other(String),
}
