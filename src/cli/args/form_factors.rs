//! The flags for the subdivision of a scene, and for the computation and storage of form factors.

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::TypedValueParser;
use clap::{Args, ValueEnum};

use super::byte::parse_byte;
use super::settings::{OfMethods, SettingFlags};
use super::{AuditArgs, CommonArgs, named, parse_positive, parse_time};
use crate::form_factor::registry::METHODS;
use crate::form_factor::{Closure, ExactMethod, MethodSettings, TOLERANCE};
use crate::geometry::sampling::Sequence;
use crate::matrix::Precision;
use crate::mesh::{MeshOptions, Subdivision};
use crate::report::form_factors::FormFactorFile;
use crate::workflow::{
    Afterwards, Balance, DEFAULT_RAYS, FormFactorRequest, IMAGE_RAYS, IMAGE_TOLERANCE, Memory, Parameter, Storage,
    SurfaceTable, WorkflowError, mesh_options,
};

/// How faces are cut into patches.
#[derive(Args, Clone, Copy, Debug, Default)]
#[command(next_help_heading = "Patches")]
pub(crate) struct MeshArgs {
    /// Cut every edge into N parts: a quad into N×N patches, a triangle into N² [default: 1; render and voxel: by size; compare: for 200 patches or more]
    #[arg(long, value_name = "N", conflicts_with = "max_edge", value_parser = clap::value_parser!(u32).range(1..))]
    pub subdivide: Option<u32>,
    /// Cut every edge into parts of at most L metres
    #[arg(long, value_name = "L", value_parser = parse_positive)]
    pub max_edge: Option<f64>,
    /// Keep faces whole where others stand on them or pierce them. Light leaks under these then: the run warns how much, with exit code 3 above 1e-3 of what is emitted
    #[arg(long)]
    pub no_cut: bool,
    /// No effect: faces are cut at contact edges anyway
    #[arg(long, hide = true, conflicts_with = "no_cut")]
    pub cut_at_walls: bool,
}

impl MeshArgs {
    /// Returns whether any of the flags is given.
    #[must_use]
    pub(crate) fn is_given(&self) -> bool {
        self.subdivide.is_some() || self.max_edge.is_some() || self.no_cut || self.cut_at_walls
    }

    /// Returns the options that the flags set; `default` is the subdivision without a flag for it.
    #[must_use]
    pub(crate) fn options(self, default: Subdivision) -> MeshOptions {
        MeshOptions {
            subdivision: match (self.subdivide, self.max_edge) {
                (Some(n), _) => Subdivision::Uniform(n),
                (None, Some(length)) => Subdivision::MaxEdge(length),
                (None, None) => default,
            },
            cut_at_walls: !self.no_cut,
        }
    }

    /// Returns the flags that match the patches of a file of form factors.
    ///
    /// # Errors
    /// Flags that request other patches.
    pub(crate) fn of_file(self, file: &FormFactorFile) -> Result<Self, WorkflowError> {
        let default = self.options(Subdivision::Uniform(1));
        // An absent flag requests nothing.
        let is_asked = self.subdivide.is_some() || self.max_edge.is_some();
        let asked = is_asked.then_some(default.subdivision);
        let options = mesh_options(file, asked, self.no_cut, default)?;
        let (subdivide, max_edge) = match options.subdivision {
            Subdivision::Uniform(n) => (Some(n), None),
            Subdivision::MaxEdge(length) => (None, Some(length)),
        };
        Ok(Self {
            subdivide,
            max_edge,
            no_cut: !options.cut_at_walls,
            cut_at_walls: false,
        })
    }
}

/// Reads the name of a form-factor method; help lists those of the registry.
fn method_name() -> impl TypedValueParser<Value = String> {
    named(METHODS.iter().map(|method| (method.name, method.summary)))
}

/// How form factors are computed.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Form factors")]
pub(crate) struct MethodArgs {
    /// The method
    #[arg(long, value_name = "NAME", value_parser = method_name(), default_value = "exact")]
    pub method: String,
    #[command(flatten)]
    pub own: SettingFlags<OfMethods>,
    /// Choose the method and its tolerance so that all is done within this time, as in 90s, 10m or 2h; results then depend on the machine
    #[arg(long, value_name = "TIME", value_parser = parse_time, conflicts_with_all = ["method", "rays", "points", "resolution", "budget"])]
    pub time_limit: Option<Duration>,
    /// Seed of all numbers
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Average each pair with its reverse, and restore the sums of the rows
    #[arg(long, value_enum, default_value_t)]
    pub balance: Balance,
    #[command(flatten)]
    pub closure: ClosureArgs,
}

impl MethodArgs {
    fn settings(&self, tolerance: Option<f64>) -> MethodSettings {
        let mut values = self.own.values.clone();
        if let Some(tolerance) = tolerance {
            values.set(&TOLERANCE, tolerance);
        }
        MethodSettings {
            values,
            seed: self.seed,
        }
    }

    /// Returns the sequence of the rays' numbers.
    #[must_use]
    pub(crate) fn sequence(&self) -> Sequence {
        self.settings(None).sequence().unwrap_or_default()
    }

    /// Returns the request of the flags, with the tolerance of another flag and the steps after the form factors.
    #[must_use]
    pub(crate) fn request(&self, tolerance: Option<f64>, afterwards: Afterwards) -> FormFactorRequest {
        let (default_rays, default_tolerance) = match afterwards {
            Afterwards::Image => (IMAGE_RAYS, IMAGE_TOLERANCE),
            Afterwards::Nothing | Afterwards::Light => (DEFAULT_RAYS, ExactMethod::DEFAULT_TOLERANCE),
        };
        FormFactorRequest {
            method: self.method.clone(),
            settings: self.settings(tolerance),
            default_rays,
            default_tolerance,
            tolerance_is_by_mesh: false,
            tolerance_parameter: match afterwards {
                Afterwards::Nothing => Parameter::Tolerance,
                Afterwards::Light | Afterwards::Image => Parameter::FormFactorTolerance,
            },
            // The direct pass of an image uses its numbers too.
            is_sequence_shared: afterwards == Afterwards::Image,
            balance: self.balance,
            closure: self.closure.closure(),
            time_limit: self.time_limit.map(|limit| (limit, afterwards)),
            explain: false,
        }
    }
}

/// Whether the scene is closed.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ClosureArgs {
    /// The scene is closed: its rows sum to 1 where no back is seen. Refused where more than 1e-3 of the rays of a patch leave [default: by the shape of the scene, and by rays that are counted]
    #[arg(long, conflicts_with = "open")]
    pub closed: bool,
    /// The scene is open: no row has to sum to 1
    #[arg(long)]
    pub open: bool,
}

impl ClosureArgs {
    /// Returns the user's statement whether the scene is closed.
    #[must_use]
    pub(crate) fn closure(self) -> Closure {
        match (self.closed, self.open) {
            (true, _) => Closure::Closed,
            (_, true) => Closure::Open,
            _ => Closure::Detect,
        }
    }
}

/// How many digits of form factors are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum PrecisionName {
    /// f64, or f32 where that keeps a system in memory and suffices for its tolerance
    #[default]
    Auto,
    /// 24 bits
    F32,
    /// 53 bits
    F64,
}

/// The limits and places of form factors.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Memory")]
pub(crate) struct MemoryArgs {
    /// The most memory to use, as in 512MiB or 2G [default: 80 % of what is available]
    #[arg(long, value_name = "BYTES", value_parser = parse_byte)]
    pub memory_limit: Option<u64>,
    /// How form factors are stored
    #[arg(long, value_enum, default_value_t)]
    pub storage: Storage,
    /// The digits of stored form factors
    #[arg(long, value_enum, default_value_t = PrecisionName::Auto)]
    pub precision: PrecisionName,
    /// The directory of the scratch file, if one is needed [default: that of the output, else the system's for temporary files]
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<PathBuf>,
}

impl MemoryArgs {
    /// Returns the memory limit and the storage that the flags set.
    #[must_use]
    pub(crate) fn memory(&self) -> Memory {
        Memory {
            limit_byte: self.memory_limit,
            storage: self.storage,
            precision: match self.precision {
                PrecisionName::Auto => None,
                PrecisionName::F32 => Some(Precision::F32),
                PrecisionName::F64 => Some(Precision::F64),
            },
            scratch: self.scratch.clone(),
            ..Memory::default()
        }
    }
}

/// Where form factors are kept.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Memory")]
pub(crate) struct StorageArgs {
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// A file for finished form factors and gathered light: after an interruption the same command goes on from there; it is removed when the command is done
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
}

/// `radiosity form-factors`.
#[derive(Args, Debug)]
pub(crate) struct FormFactorsArgs {
    /// The scene: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// A file for the form factors. Between patches: .npz, .npy, .mtx or .exr; between surfaces: .csv or View3D's .vf; sums and errors of each patch: .vtu; patches in colours: .ply or .obj
    #[arg(short, long, value_name = "F.npz")]
    pub output: Option<PathBuf>,
    /// A surface by name: with `-o F.vtu`, .ply or .obj, the form factor from each patch to it
    #[arg(long, value_name = "NAME", requires = "output")]
    pub surface: Option<String>,
    /// Write `F` and `error` in full, with `-o F.npz`, in place of compressed sparse rows
    #[arg(long, requires = "output")]
    pub dense: bool,
    /// Print the form factors between more than 200 surfaces too, with --json
    #[arg(long, requires = "json")]
    pub full: bool,
    /// The error that each form factor between partly hidden patches may have, on A_i F_ij / min(A_i, A_j), with exact [default: 1e-6]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub tolerance: Option<f64>,
    #[command(flatten)]
    pub mesh: MeshArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub storage: StorageArgs,
    #[command(flatten)]
    pub audit: AuditArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl FormFactorsArgs {
    /// Returns the greatest number of surfaces for which the factors between them are computed.
    #[must_use]
    pub(crate) fn surfaces_up_to(&self) -> usize {
        match (self.common.json, self.full) {
            (false, _) => SurfaceTable::MAX_READ,
            (true, false) => SurfaceTable::MAX_PRINTED,
            (true, true) => usize::MAX,
        }
    }
}
