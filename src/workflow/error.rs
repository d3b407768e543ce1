//! Errors of the steps of a study.

use std::path::PathBuf;

use super::VoxelRemedy;
use crate::checkpoint::CheckpointError;
use crate::embree::EmbreeError;
use crate::form_factor::{FormFactorError, Leak, MAX_ESCAPED};
use crate::heat::{Boundary, HeatError};
use crate::matrix::{DiskError, MatrixError};
use crate::mesh::{MeshError, Subdivision};
use crate::parameter::{Named, Parameter, plainly};
use crate::plan::{StorageError, byte_text};
use crate::printable::printable_message;
use crate::render::RenderError;
use crate::report::ReportError;
use crate::scene::{IMAGE_SIDES, MotionError, Origin, Scene, SceneError};
use crate::solver::SolverError;
use crate::voxel::VoxelError;

/// A reason why a step of a study was refused, or failed.
///
/// [`Display`](std::fmt::Display) writes parameters by their names, [`text`](Self::text) as given by a program.
#[derive(Debug)]
#[non_exhaustive]
pub enum WorkflowError {
    /// An error of the scene, a lighting or a list of frames.
    Scene(SceneError),
    /// A scene cannot take a pose.
    Motion(MotionError),
    /// Faces cannot be cut as requested.
    Mesh {
        /// The name of the scene.
        file: PathBuf,
        /// The error.
        error: MeshError,
    },
    /// The ray tracer's tree cannot be built.
    Embree {
        /// The name of the scene.
        file: PathBuf,
        /// The error.
        error: EmbreeError,
    },
    /// Work exceeds the memory limit.
    MemoryLimit {
        /// The name of the scene.
        file: PathBuf,
        /// The purpose of the memory.
        what: String,
        /// The memory that is needed, in bytes.
        needed: u64,
        /// The limit, in bytes.
        limit: u64,
        /// The remedy beside a greater limit.
        remedy: &'static str,
    },
    /// Form factors cannot be stored.
    Storage(StorageError),
    /// A method refused its settings or its input.
    FormFactor(FormFactorError),
    /// A matrix was refused, or could not be read.
    Matrix(MatrixError),
    /// A scene that was stated to be closed is not.
    NotClosed {
        /// The name of the scene.
        file: PathBuf,
        /// The place where light leaves.
        leak: Leak,
    },
    /// A solver refused its settings or its system.
    Solver(SolverError),
    /// Patches emit and reflect everything, and no light leaves.
    NoFiniteSolution {
        /// The file of the materials.
        file: PathBuf,
        /// The surface or patch.
        place: String,
        /// The number of such patches.
        n_patches: usize,
        /// The name of a reflectance in the file.
        reflectance: &'static str,
    },
    /// A file could not be read or written.
    Report(ReportError),
    /// The form factors of a file are of another geometry.
    OtherGeometry {
        /// The file of the form factors.
        file: PathBuf,
        /// The name of the scene.
        scene: PathBuf,
    },
    /// Voxels or links were refused, or could not be stored.
    Voxel(VoxelError),
    /// Voxels or links do not fit the memory.
    VoxelMemory {
        /// The demand in words.
        what: String,
        /// The limit, in bytes.
        limit: u64,
        /// The remedy.
        remedy: VoxelRemedy,
    },
    /// An image was refused, or could not be written or read.
    Render(RenderError),
    /// An image does not fit the memory.
    ImageMemory {
        /// Width and height in pixels.
        size: (u32, u32),
        /// The memory that is needed, in bytes.
        needed: u64,
        /// The limit, in bytes.
        limit: u64,
    },
    /// Boundary conditions do not fit the scene, or have no temperatures.
    Heat {
        /// The file of the boundary conditions.
        file: PathBuf,
        /// The line of the error, if known.
        line: Option<u32>,
        /// The error.
        error: HeatError,
    },
    /// The checkpoint could not be opened.
    Checkpoint(CheckpointError),
    /// Ranks that are to share work would compute different results.
    RanksDiffer {
        /// The difference.
        what: &'static str,
        /// The first rank that differs from rank 0.
        rank: usize,
        /// The machines of that rank and of rank 0.
        hosts: [String; 2],
    },
    /// Settings do not fit together.
    Unsuited(Unsuited),
    /// A file or setting of a frame of a sequence is refused.
    InFrame {
        /// The error.
        error: Box<WorkflowError>,
        /// The list of frames.
        list: PathBuf,
        /// The line of the frame.
        line: u32,
        /// The name of the frame.
        frame: String,
    },
    /// A time of a path of the sun has an error.
    AtTime {
        /// The error.
        error: Box<WorkflowError>,
        /// The table of times.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// The time.
        time: String,
    },
    /// The caller asked to stop.
    Interrupted,
}

/// Settings that do not fit together.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Unsuited {
    /// Symmetric storage without balancing.
    SymmetricUnbalanced,
    /// A solver that needs balanced form factors, which are not stored.
    UnstoredReciprocity {
        /// The solver.
        solver: &'static str,
    },
    /// A storage for form factors that are not stored.
    UnstoredStorage,
    /// A time for form factors that are not stored.
    UnstoredTimeLimit,
    /// A method of pairs, where form factors are not stored.
    UnstoredPairs {
        /// The method.
        method: String,
        /// Methods of rows.
        others: String,
    },
    /// A solver that needs the rows of links that are not stored, with its message.
    RecomputedRows(String),
    /// A file of form factors for other patches than requested.
    OtherPatches {
        /// The file.
        file: PathBuf,
        /// The subdivision of its patches.
        subdivision: Subdivision,
        /// True if whole faces are requested, but those of the file are cut at contact edges.
        is_whole: bool,
    },
    /// A sequence without frames.
    NoFrame,
    /// An unfolded view with a camera, or with a height.
    UnfoldedCamera,
    /// A camera that looks at the point where it stands.
    LookAtEye,
    /// An up along the view, or without a direction.
    UpAlongView,
    /// An image whose width and height in pixels are out of range.
    ImageSize(u32, u32),
}

impl std::error::Error for WorkflowError {}

impl std::fmt::Display for WorkflowError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text(&plainly))
    }
}

impl WorkflowError {
    /// Returns an error of boundary conditions with its line.
    pub(super) fn heat(boundary: &Boundary, error: HeatError, scene: &Scene) -> Self {
        Self::Heat {
            file: boundary.file.clone(),
            line: boundary.line_of(&error, scene),
            error,
        }
    }

    /// Returns the place where a sequence names the refused part, for the end of the message; empty for other errors.
    pub(crate) fn place(&self) -> String {
        match self {
            Self::InFrame { list, line, frame, .. } => {
                format!("; frame `{frame}` names it, {}:{line}", list.display())
            }
            Self::AtTime { path, line, time, .. } => format!("; at time `{time}`, {}:{line}", path.display()),
            _ => String::new(),
        }
    }

    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        let name = |parameter| named(parameter, None);
        let text = match self {
            Self::Scene(error) => error.text(named),
            Self::Motion(error) => error.to_string(),
            Self::Mesh { file, error } => format!("{}: {}", file.display(), error.text(named)),
            Self::Embree { file, error } => format!("{}: {error}", file.display()),
            Self::MemoryLimit {
                file,
                what,
                needed,
                limit,
                remedy,
            } => format!(
                "{}: {what} takes up to {} of memory, and the limit is {}; raise {}, {remedy}",
                file.display(),
                byte_text(*needed),
                byte_text(*limit),
                name(Parameter::MemoryLimit)
            ),
            Self::RanksDiffer { what, rank, hosts } => format!(
                "rank {rank} on {} has another {what} than rank 0 on {}; give all ranks the same files and the same build",
                hosts[0], hosts[1]
            ),
            Self::Storage(error) => error.text(named),
            Self::FormFactor(error) => error.text(named),
            Self::Matrix(error) => error.text(named),
            Self::NotClosed { file, leak } => format!(
                "{}: {leak}, and {closed} allows {MAX_ESCAPED:e}: close the gap, or leave {closed} out",
                file.display(),
                closed = name(Parameter::Closed)
            ),
            Self::Solver(error) => error.text(named),
            Self::NoFiniteSolution {
                file,
                place,
                n_patches,
                reflectance,
            } => format!(
                "{}: no finite solution: the enclosure of {place} ({n_patches} patches) emits, but absorbs nothing; \
                 lower a `{reflectance}` below 1 there, or open the scene",
                file.display()
            ),
            Self::Report(error) => error.text(named),
            Self::OtherGeometry { file, scene } => {
                let (file, scene) = (file.display(), scene.display());
                format!(
                    "{file}: holds form factors of another geometry than {scene}; compute them again: radiosity form-factors {scene} -o {file}"
                )
            }
            Self::Render(error) => error.to_string(),
            Self::ImageMemory { size, needed, limit } => format!(
                "a picture of {} × {} pixels and its scene need {} of memory, and the limit is {}; raise {} or give fewer pixels",
                size.0,
                size.1,
                byte_text(*needed),
                byte_text(*limit),
                name(Parameter::MemoryLimit)
            ),
            Self::Voxel(error) => error.to_string(),
            Self::VoxelMemory { what, limit, remedy } => format!(
                "{what} of memory, and the limit is {}; {}, or raise {}",
                byte_text(*limit),
                remedy.text(named),
                name(Parameter::MemoryLimit)
            ),
            Self::Heat { file, line, error } => format!("{}{error}", Origin::line(file, *line)),
            Self::Checkpoint(error) => error.to_string(),
            Self::Unsuited(unsuited) => unsuited.text(named),
            Self::InFrame { error, .. } | Self::AtTime { error, .. } => {
                format!("{}{}", error.text(named), self.place())
            }
            Self::Interrupted => "no output was written".to_owned(),
        };
        printable_message(&text)
    }
}

impl VoxelRemedy {
    fn text(self, named: Named<'_>) -> String {
        match self {
            Self::FewerVoxels => format!("use fewer {}", named(Parameter::Voxels, None)),
            Self::OtherLinks => format!("use {} or disk", named(Parameter::Links, Some("auto"))),
            Self::FewerThreads => format!(
                "use fewer {} or {}",
                named(Parameter::Threads, None),
                named(Parameter::Links, Some("recompute"))
            ),
        }
    }
}

impl Unsuited {
    fn text(&self, named: Named<'_>) -> String {
        let name = |parameter| named(parameter, None);
        match self {
            Self::SymmetricUnbalanced => format!(
                "{} makes form factors symmetric, and {} keeps them as they are; leave one of them out",
                named(Parameter::Storage, Some("symmetric")),
                named(Parameter::Balance, Some("off"))
            ),
            Self::UnstoredReciprocity { solver } => format!(
                "`{solver}` needs form factors that are balanced, and so stored: leave {} out, or take `gmres`",
                name(Parameter::OnTheFly)
            ),
            Self::UnstoredStorage => format!(
                "{} and {} are for form factors that are stored: leave them out, or {}",
                name(Parameter::Storage),
                name(Parameter::Precision),
                name(Parameter::OnTheFly)
            ),
            Self::UnstoredTimeLimit => format!(
                "{} chooses how form factors are stored and computed: leave it out, or {}",
                name(Parameter::TimeLimit),
                name(Parameter::OnTheFly)
            ),
            Self::UnstoredPairs { method, others } => format!(
                "`{method}` computes pairs of patches, not rows: leave {} out, or take one of {others}",
                name(Parameter::OnTheFly)
            ),
            Self::RecomputedRows(error) => format!(
                "{error}, which links have that are kept: leave {} out, or take auto, jacobi, chebyshev, gmres or anderson",
                named(Parameter::Links, Some("recompute"))
            ),
            Self::OtherPatches {
                file,
                subdivision,
                is_whole,
            } => {
                let cut = match subdivision {
                    Subdivision::Uniform(n) => named(Parameter::Subdivide, Some(&n.to_string())),
                    Subdivision::MaxEdge(length) => named(Parameter::MaxEdge, Some(&format!("{length:?}"))),
                };
                let without = if *is_whole {
                    format!(" without {}", named(Parameter::CutAtWalls, Some("false")))
                } else {
                    String::new()
                };
                format!(
                    "{} is for {cut}{without}; leave the flags out, or compute other form factors",
                    file.display()
                )
            }
            Self::NoFrame => "there is no frame".to_owned(),
            Self::UnfoldedCamera => format!(
                "{} goes with {} alone",
                named(Parameter::Camera, Some("unfolded")),
                name(Parameter::Width)
            ),
            Self::LookAtEye => format!(
                "the camera looks at the point where it stands: give {} and {} two points",
                name(Parameter::Eye),
                name(Parameter::LookAt)
            ),
            Self::UpAlongView => format!(
                "{} is zero or parallel to the view: give a direction that is up in the image",
                name(Parameter::Up)
            ),
            Self::ImageSize(width, height) => format!(
                "a picture of {width} × {height} pixels, in the proportion of the camera: its sides are {} to {} pixels; give {} and {}",
                IMAGE_SIDES.start(),
                IMAGE_SIDES.end(),
                name(Parameter::Width),
                name(Parameter::Height)
            ),
        }
    }
}

macro_rules! from {
    ($($error:ty => $variant:ident),* $(,)?) => {$(
        impl From<$error> for WorkflowError {
            fn from(error: $error) -> Self {
                Self::$variant(error)
            }
        }
    )*};
}

from! {
    Unsuited => Unsuited,
    SceneError => Scene,
    MotionError => Motion,
    MatrixError => Matrix,
    ReportError => Report,
    VoxelError => Voxel,
    CheckpointError => Checkpoint,
}

impl From<DiskError> for WorkflowError {
    fn from(error: DiskError) -> Self {
        Self::Matrix(MatrixError::Disk(error))
    }
}

impl From<FormFactorError> for WorkflowError {
    fn from(error: FormFactorError) -> Self {
        match error {
            FormFactorError::Interrupted => Self::Interrupted,
            FormFactorError::Matrix(error) => error.into(),
            other => Self::FormFactor(other),
        }
    }
}

impl From<SolverError> for WorkflowError {
    fn from(error: SolverError) -> Self {
        match error {
            SolverError::Disk(error) => error.into(),
            other => Self::Solver(other),
        }
    }
}

impl From<RenderError> for WorkflowError {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Interrupted => Self::Interrupted,
            other => Self::Render(other),
        }
    }
}
