//! The warnings of a study: each has the fault, the number, the consequence and the parameter that helps.

use std::borrow::Cow;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::Parameter;
use crate::audit::Check;
use crate::form_factor::RoundingDoubt;
use crate::progress::Forecast;
use crate::scene::{Origin, SceneWarning};
use crate::solver::StopReason;

/// A doubt about a study: its results stand, but perhaps they are not what was meant, or not as exact as was asked for.
///
/// Warnings that a solution raises can be kept in a checkpoint; those with `serde(skip)` are raised before it.
/// [`Display`](std::fmt::Display) writes parameters by their names, [`text`](Self::text) as a program's users do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Warning {
    /// Of the scene as it was read.
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
        /// The surface that this face is of.
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
        /// How many do.
        count: usize,
        /// How many faces there are.
        n_faces: usize,
    },
    /// No face of a surface sees another, though from behind they would.
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
        /// How many there are.
        count: usize,
    },
    /// So it is with faces of more surfaces, which are not named.
    MoreTurned {
        /// The file of the scene.
        file: PathBuf,
        /// How many surfaces.
        count: usize,
    },
    /// Rays start far off the faces, beside the size of the smallest patch.
    FarStart {
        /// How far, m.
        offset: f64,
        /// The width of the smallest patch, m.
        width: f64,
    },
    /// Two surfaces are nearer to each other than rays can tell.
    NarrowGap {
        /// Both surfaces, each with what its face is called, as in `line 12`.
        surfaces: [(String, String); 2],
        /// Their distance, m.
        width: f64,
        /// How far off a face rays start, m.
        offset: f64,
    },
    /// Light leaks under what stands on patches that are not cut at contact edges.
    LightLeak {
        /// How many patches.
        n_patches: usize,
        /// The leak, in `unit`.
        value: f64,
        /// Its error, in `unit`.
        error: f64,
        /// W or m2.
        unit: Cow<'static, str>,
        /// The part of `whole` that it is.
        relative: f64,
        /// The whole that it is a part of.
        whole: Cow<'static, str>,
        /// True if the form factors are from a file, so that they are to be computed again.
        is_from_file: bool,
    },
    /// Work is going to take long.
    #[serde(skip)]
    LongWork(Forecast),
    /// Pairs of patches spent their budget, or the digits of f64, above the tolerance.
    #[serde(skip)]
    AboveTolerance {
        /// How many.
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
    /// Rounded coordinates leave pairs in doubt above the tolerance.
    #[serde(skip)]
    Rounded {
        /// How many, by how much, and why.
        doubt: RoundingDoubt,
        /// The parameter of the tolerance.
        tolerance: Parameter,
    },
    /// The form factors of a file are above their tolerance.
    FileAboveTolerance {
        /// The file.
        file: PathBuf,
    },
    /// So they are by rounded coordinates.
    #[serde(skip)]
    FileRounded {
        /// The file.
        file: PathBuf,
        /// How many pairs, by how much, and why.
        doubt: RoundingDoubt,
    },
    /// The checkpoint could not be written to its end.
    CheckpointIncomplete {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// The checkpoint of work that is done could not be removed.
    CheckpointLeft {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// Rays met no front in rows that are known to sum to 1.
    SlippedRays {
        /// How many.
        n_lost: u64,
        /// Of how many.
        n_rays: u64,
    },
    /// Rows are to sum to 1, but none is known to.
    NothingToClose,
    /// Rows that ought to sum to 1 are off by more than they state.
    #[serde(skip)]
    DoubtedRows {
        /// The place of the first patch's face.
        at: Origin,
        /// The surface of it.
        surface: String,
        /// How many there are.
        count: usize,
    },
    /// Row sums were not restored.
    NotBalanced {
        /// How far they are off 1 still.
        row_error_max: f64,
        /// After so many passes.
        n_passes: usize,
    },
    /// A conservation check fails.
    BrokenLaw(Check),
    /// Form factors kept in f32 change radiosities.
    RoundedToF32 {
        /// By this part of themselves.
        relative: f64,
    },
    /// Nearly all of what the solver's tolerance is relative to is the lamps' own light.
    LampsOutshine {
        /// The bound on the error, relative to the light that is reflected.
        bound: f64,
        /// A tolerance that is small enough; `None` where no solver meets one.
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
        /// Why it stopped.
        reason: StopReason,
        /// The relative residual.
        residual: f64,
    },
    /// No bound on the error of the solution can be proved.
    NoBound,
    /// The form factors are not exact enough to state an error of the solution.
    TooInexact,
    /// The mesh is too coarse for a surface.
    CoarseMesh {
        /// The surface.
        surface: String,
        /// The relative change of its mean radiosity with a quarter of the patches.
        change: f64,
    },
    /// Form factors that are not kept state no error.
    NoErrorOnTheFly,
    /// Surfaces are smaller than two voxels.
    SmallSurfaces {
        /// How many.
        count: usize,
        /// One of them.
        surface: String,
        /// How large it is, m.
        side: f64,
        /// How large a voxel is, m.
        size: f64,
        /// The voxels along the longest axis that it would be two of.
        enough: f64,
    },
    /// Gaps are narrower than two voxels.
    ThinGaps {
        /// Voxels along the longest axis.
        n_voxels: u32,
        /// The surfaces on both sides of each.
        pairs: Vec<[String; 2]>,
    },
    /// Voxels of a closed scene can be reached from outside.
    OpenVoxels {
        /// How many.
        count: usize,
        /// The surfaces that they are on.
        surfaces: Vec<String>,
    },
    /// Links leave a closed scene.
    EscapingLinks {
        /// How many.
        n_escaped: u64,
        /// Of how many.
        n_links: u64,
    },
    /// Light passes closed surfaces.
    PassedWalls {
        /// The power, W.
        power: f64,
        /// The part of what is emitted that it is.
        share: f64,
        /// The thickness of the thinnest wall, m, if there is one thinner than two voxels.
        thickness: Option<f64>,
        /// The voxels along the longest axis that would do.
        enough: Option<u32>,
    },
    /// Light is unshot after the last propagation.
    UnshotLight {
        /// How many propagations there were.
        passes: usize,
        /// The unshot part of the power.
        unshot: f64,
    },
    /// Final gather left pixels above the noise.
    NoisyPixels {
        /// The picture.
        file: PathBuf,
        /// How many.
        n_above: u64,
        /// Of how many.
        n_pixels: u64,
        /// The noise asked for.
        noise: f64,
    },
    /// No pixel shows the front of a face.
    BlankImage {
        /// The camera, in words.
        camera: String,
    },
    /// No viewer listens where one is to show an image.
    NoViewer {
        /// Where.
        address: String,
        /// Why it cannot be reached.
        reason: String,
    },
    /// The viewer that showed an image has gone.
    ViewerGone,
    /// Black backs of faces take heat.
    HeatToBacks {
        /// How much, W.
        power_w: f64,
    },
    /// The error of the mesh is in no stated error.
    NoMeshError,
    /// The error of the mesh of a heat is known from one patch a face alone, and that is much.
    OnePatchAFace {
        /// The greatest relative change of a surface's mean radiosity from there.
        change: f64,
    },
    /// Temperatures are inexact.
    InexactHeat {
        /// The greatest error of a surface's irradiance, relative to the larger of that and its emissive power.
        relative: f64,
    },
    /// A warning of the program itself.
    Other(String),
}
