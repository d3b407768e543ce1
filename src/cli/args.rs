//! The command line: names, defaults, help.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use serde::Serialize;

use crate::form_factor::registry::METHODS;
use crate::geometry::sampling::Sequence;
use crate::mesh::Subdivision;
use crate::solver::{SpectrumBounds, Start};
use crate::voxel::Form;

/// Light in diffuse scenes: form factors to high accuracy, radiosity, OpenEXR pictures.
#[derive(Debug, Parser)]
#[command(name = "radiosity", version, about, propagate_version = true, max_term_width = 110)]
#[command(
    after_help = "Exit codes: 0 done, 1 error in the input or at run time, 2 usage, 3 not converged or a budget \
                        spent above the tolerance, 4 a check outside its tolerance."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a built-in scene as OBJ and MTL
    Scene(SceneArgs),
    /// Compute form factors, check them, and report them by surface
    FormFactors(FormFactorsArgs),
    /// Solve for the radiosity of every patch
    Solve(SolveArgs),
    /// Render a scene to a layered OpenEXR image and a PNG preview
    Render(RenderArgs),
    /// Discrete radiosity: the light on voxels, who sees whom by integer lines
    Voxel(VoxelArgs),
    /// Check an EXR against the analytic answer of the scene that it was made from
    Verify(VerifyArgs),
    /// Run all form-factor methods side by side: true error against run time, as tables and plots
    Compare(CompareArgs),
    /// Print a paper's tables beside what we measure
    Reproduce(ReproduceArgs),
}

/// Flags that every command has.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common")]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub struct CommonArgs {
    /// Number of threads [default: all cores]; results do not depend on it
    #[arg(long, value_name = "K")]
    pub threads: Option<NonZeroUsize>,
    /// Print what was chosen and what was left out, and why
    #[arg(long)]
    pub explain: bool,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub json: bool,
    /// No progress, no warnings
    #[arg(long)]
    pub quiet: bool,
    /// Read material libraries that lie outside the scene's folder
    #[arg(long)]
    pub allow_outside: bool,
}

/// `radiosity scene`.
#[derive(Args, Debug)]
pub struct SceneArgs {
    /// The built-in scene's name
    #[arg(value_name = "NAME")]
    pub name: String,
    /// Level of refinement, for scenes that have levels
    #[arg(long, value_name = "L")]
    pub level: Option<u32>,
    /// The OBJ file to write; the MTL file goes beside it
    #[arg(short, long, value_name = "OUT.obj")]
    pub output: PathBuf,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

/// How faces are cut into patches.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Patches")]
pub struct MeshArgs {
    /// Cut every edge into N parts: a quad into N×N patches, a triangle into N² [default: 1; render: by size]
    #[arg(long, value_name = "N", conflicts_with = "max_edge")]
    pub subdivide: Option<u32>,
    /// Cut every edge into parts of at most L metres
    #[arg(long, value_name = "L")]
    pub max_edge: Option<f64>,
}

impl MeshArgs {
    /// Returns what the flags ask for, or `default`.
    #[must_use]
    pub fn subdivision(self, default: Subdivision) -> Subdivision {
        match (self.subdivide, self.max_edge) {
            (Some(n), _) => Subdivision::Uniform(n),
            (None, Some(length)) => Subdivision::MaxEdge(length),
            (None, None) => default,
        }
    }
}

/// Reads the name of a solver; help lists those that the registry has.
fn solver_name() -> impl TypedValueParser<Value = String> {
    PossibleValuesParser::new(
        crate::solver::registry::SOLVERS
            .iter()
            .map(|solver| PossibleValue::new(solver.name).help(solver.summary)),
    )
}

/// Reads the name of a form-factor method; help lists those that the registry has.
fn method_name() -> impl TypedValueParser<Value = String> {
    PossibleValuesParser::new(
        METHODS
            .iter()
            .map(|method| PossibleValue::new(method.name).help(method.summary)),
    )
}

/// The kinds of numbers that shooting uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum SequenceName {
    /// Owen-scrambled Sobol points
    Sobol,
    /// Independent pseudo-random numbers
    Random,
}

impl From<SequenceName> for Sequence {
    fn from(name: SequenceName) -> Self {
        match name {
            SequenceName::Sobol => Self::Sobol,
            SequenceName::Random => Self::Random,
        }
    }
}

/// Whether form factors are made symmetric and their rows made to sum to what they should.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum BalanceName {
    /// Where the solver needs a symmetric system
    Auto,
    /// Always
    On,
    /// Always, but each entry is moved by its own error variance instead (least squares): what is known stays
    Closure,
    /// Never
    Off,
}

/// How form factors are computed.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Form factors")]
pub struct MethodArgs {
    /// The method
    #[arg(long, value_name = "NAME", value_parser = method_name(), default_value = "exact")]
    pub method: String,
    /// Rays for each patch, with sr and sg [default: 4096; render: 16384], or for each pair, with qmc [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub rays: Option<u64>,
    /// Points along each side of a patch, with sg, pdm, gauss-lambert, contour and closed-form [default: 5] and hemicube [default: 1]
    #[arg(long, value_name = "Q")]
    pub points: Option<NonZeroUsize>,
    /// Cells along each edge of the top, with hemicube [default: 256]
    #[arg(long, value_name = "N")]
    pub resolution: Option<NonZeroUsize>,
    /// Divide each row by its sum, with centre
    #[arg(long)]
    pub normalise: bool,
    /// Where the numbers of sr and sg come from [default: sobol]
    #[arg(long, value_enum)]
    pub sequence: Option<SequenceName>,
    /// Evaluations for one pair of patches after which exact goes on to the next [default: 10000000]
    #[arg(long, value_name = "N")]
    pub budget: Option<NonZeroUsize>,
    /// Seed of all numbers
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Average each pair with its reverse and rebalance the rows (symmetric Sinkhorn scaling)
    #[arg(long, value_enum, default_value_t = BalanceName::Auto)]
    pub balance: BalanceName,
}

/// How form factors are laid out, and where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum StorageName {
    /// In memory if they fit, else on a disk; dense or sparse tile by tile
    #[default]
    Auto,
    /// In memory, every entry of each tile
    Dense,
    /// In memory, the upper triangle of the exchange areas; rows are averaged and balanced for it
    Symmetric,
    /// In memory, the entries that are not zero
    Sparse,
    /// In a scratch file
    Disk,
}

/// How many digits of form factors are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum PrecisionName {
    /// f64, or f32 where that keeps a system in memory and suffices for its tolerance
    #[default]
    Auto,
    /// 24 bits
    F32,
    /// 53 bits
    F64,
}

/// Where form factors are kept.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Memory")]
pub struct StorageArgs {
    /// The most memory to use, as in 512MiB or 2G [default: 80 % of what is available]
    #[arg(long, value_name = "BYTES", value_parser = super::storage::parse_byte)]
    pub memory_limit: Option<u64>,
    /// How form factors are stored
    #[arg(long, value_enum, default_value_t = StorageName::Auto)]
    pub storage: StorageName,
    /// The digits of stored form factors
    #[arg(long, value_enum, default_value_t = PrecisionName::Auto)]
    pub precision: PrecisionName,
    /// The directory of the scratch file, if one is needed [default: that of the output, else the system's for temporary files]
    #[arg(long, value_name = "DIR")]
    pub scratch: Option<PathBuf>,
}

/// `radiosity form-factors`.
#[derive(Args, Debug)]
pub struct FormFactorsArgs {
    /// The scene (OBJ)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// A file for the form factors: .npz, .npy, .mtx or .exr (between patches), .csv (between surfaces), .vtu (sums and errors of each patch)
    #[arg(short, long, value_name = "F.npz")]
    pub output: Option<PathBuf>,
    /// A surface by name: with `-o F.vtu`, the form factor from each patch to it
    #[arg(long, value_name = "NAME", requires = "output")]
    pub surface: Option<String>,
    /// The error that each form factor between partly hidden patches may have, on A_i F_ij / min(A_i, A_j), with exact [default: 1e-6]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub tolerance: Option<f64>,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub mesh: MeshArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub method: MethodArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub storage: StorageArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

/// How the system is solved.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Solver")]
pub struct SolverArgs {
    /// The solver
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = solver_name())]
    pub solver: String,
    /// Tolerance on sqrt(Σ A r² / Σ A E²), worst channel
    #[arg(long, value_name = "T", default_value_t = 1e-6)]
    pub tolerance: f64,
    /// The most passes over the form factors
    #[arg(long, value_name = "K", default_value_t = 1000)]
    pub max_passes: usize,
    /// The first radiosities
    #[arg(long, value_enum, default_value_t = StartName::Exitance)]
    pub start: StartName,
    /// Passes between restarts, with gmres [default: 30]
    #[arg(long, value_name = "M")]
    pub restart: Option<NonZeroUsize>,
    /// Steps that are remembered, with anderson [default: 8]
    #[arg(long, value_name = "M")]
    pub depth: Option<NonZeroUsize>,
    /// Relaxation factor, between 0 and 2, with sor [default: by the mean reflectance]
    #[arg(long, value_name = "W")]
    pub omega: Option<f64>,
    /// Where chebyshev takes the interval of the eigenvalues from [default: safe]
    #[arg(long, value_enum)]
    pub bounds: Option<BoundsName>,
    /// Steps that count as one pass, with progressive-refinement and overshooting [default: one per patch]
    #[arg(long, value_name = "N")]
    pub steps_per_pass: Option<NonZeroUsize>,
    /// Add an estimate of the light still under way to the radiosities, with progressive-refinement and overshooting: for a picture after few passes
    #[arg(long)]
    pub display_ambient: bool,
}

/// Where Chebyshev's method takes the interval of the eigenvalues from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum BoundsName {
    /// A bound that holds, from reflectances and row sums
    Safe,
    /// 1 ± the mean reflectance, as in the paper: no bound
    Average,
    /// Ten Lanczos steps
    Lanczos,
}

impl From<BoundsName> for SpectrumBounds {
    fn from(name: BoundsName) -> Self {
        match name {
            BoundsName::Safe => Self::Safe,
            BoundsName::Average => Self::Average,
            BoundsName::Lanczos => Self::Lanczos(NonZeroUsize::MIN.saturating_add(9)),
        }
    }
}

/// The radiosities that a solver starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum StartName {
    /// The exitance
    Exitance,
    /// No light
    Zero,
    /// The exitance, and the rest of the light spread evenly over each room
    Ambient,
}

impl From<StartName> for Start {
    fn from(name: StartName) -> Self {
        match name {
            StartName::Exitance => Self::Exitance,
            StartName::Zero => Self::Zero,
            StartName::Ambient => Self::Ambient,
        }
    }
}

/// `radiosity solve`.
#[derive(Args, Debug)]
pub struct SolveArgs {
    /// The scene (OBJ)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// A file for the solution of each patch: .csv, .npz or .vtu
    #[arg(short, long, value_name = "B.csv")]
    pub output: Option<PathBuf>,
    /// Form factors that `form-factors -o` wrote, instead of computing them; they know how the scene was cut into patches
    #[arg(long, value_name = "F.npz", conflicts_with_all = ["method", "rays", "points", "sequence", "seed", "resolution", "normalise", "budget", "form_factor_tolerance"])]
    pub form_factors: Option<PathBuf>,
    /// Compute the form factors again in every pass instead of storing them; for methods that compute rows
    #[arg(long, conflicts_with_all = ["form_factors", "lighting", "balance"])]
    pub on_the_fly: bool,
    /// A file with other exitances and reflectances, by surface or material; give it several times to solve for all at once
    #[arg(long, value_name = "A.toml")]
    pub lighting: Vec<PathBuf>,
    /// The error that each form factor between partly hidden patches may have, on A_i F_ij / min(A_i, A_j), with exact [default: 1e-6]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub form_factor_tolerance: Option<f64>,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub mesh: MeshArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub method: MethodArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub solver: SolverArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub storage: StorageArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

/// `radiosity verify`.
#[derive(Args, Debug)]
pub struct VerifyArgs {
    /// The image that `radiosity render` wrote
    #[arg(value_name = "IMAGE.exr")]
    pub image: PathBuf,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

/// Whether occluders are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum VisibilityName {
    /// Yes
    On,
    /// No: form factors of the bare pairs, for the methods that can leave visibility out
    Off,
    /// Both, one after the other
    Both,
}

/// `radiosity compare`.
#[derive(Args, Debug)]
pub struct CompareArgs {
    /// A scene file (OBJ), or the name of a built-in scene
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The directory for tables and plots, made if needed [default: compare-SCENE]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// The methods, separated by commas [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Runs of every setting, each with a seed of its own
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=10000))]
    pub seeds: u64,
    /// The first seed
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Leave out settings of which one run takes longer than S seconds
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = parse_positive)]
    pub time_limit: f64,
    /// Whether occluders are looked at
    #[arg(long, value_enum, default_value_t = VisibilityName::Both)]
    pub visibility: VisibilityName,
    /// The tolerance of exact that the methods are judged for: where nothing is known of the scene, the reference is exact at T/100
    #[arg(long, value_name = "T", default_value_t = 1e-6, value_parser = parse_positive)]
    pub tolerance: f64,
    /// The most memory to use, as in 512MiB or 2G [default: 80 % of what is available]
    #[arg(long, value_name = "BYTES", value_parser = super::storage::parse_byte)]
    pub memory_limit: Option<u64>,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub mesh: MeshArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

/// The papers whose tables can be repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum PaperName {
    /// Baranoski, Bramley and Shirley 1995: table 2 (solvers), tables 3 to 8 (form factors by shooting and quadrature)
    Baranoski,
    /// Every solver on stiff, extreme and impossible systems
    Stability,
    /// Lewis 1992: tables 1 and 2, figures 1, 2, 5 and 6 (multigrid against Gauss-Seidel)
    Lewis,
    /// Malgouyres 2002: the error of voxels against exact form factors, by resolution, radius and run time
    Malgouyres,
}

/// `radiosity reproduce`.
#[derive(Args, Debug)]
pub struct ReproduceArgs {
    /// The paper
    #[arg(value_enum, value_name = "PAPER")]
    pub paper: PaperName,
    /// The tables, as in `2-8` or `2,5-7` [default: all that are built]
    #[arg(long, value_name = "LIST")]
    pub tables: Option<String>,
    /// The directory for the tables as files, made if needed [default: reproduce-PAPER]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Runs of every stochastic method of `baranoski`, each with a seed of its own [default: 100]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(30..=10000))]
    pub seeds: Option<u64>,
    /// The first seed of `baranoski` [default: 0]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// The finest level: of table 2 of `lewis`; 6 (24576 patches) takes 4 GB and a minute or two [default: 5]; of `malgouyres`, 10 · 2^L voxels, L up to 4 [default: 2]
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u32).range(1..=6))]
    pub level: Option<u32>,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

/// The direct pass: light from the emitters, integrated at each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum DirectName {
    /// None: the radiosity of the patches alone, interpolated
    Off,
    /// Cosine-distributed rays, with a standard error for every pixel; for `verify`
    Rays,
    /// The exact form factor of each emitter times its visible fraction
    Polygons,
}

/// `radiosity render`.
#[derive(Args, Debug)]
pub struct RenderArgs {
    /// The scene (OBJ)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The image to write; a PNG preview goes beside it
    #[arg(short, long, value_name = "IMAGE.exr")]
    pub output: PathBuf,
    /// The error that each form factor between partly hidden patches may have, on A_i F_ij / min(A_i, A_j), with exact [default: 1e-5]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub form_factor_tolerance: Option<f64>,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub image: ImageArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub mesh: MeshArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub method: MethodArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub solver: SolverArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub storage: StorageArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

/// The picture.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Picture")]
pub struct ImageArgs {
    /// A camera file, or `unfolded` for one orthographic tile a planar surface [default: camera.toml beside the scene, else a view from inside]
    #[arg(long, value_name = "FILE|unfolded")]
    pub camera: Option<PathBuf>,
    /// The eye, in m
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub eye: Option<[f64; 3]>,
    /// The point to look at, in m
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub look_at: Option<[f64; 3]>,
    /// The direction that is up in the image
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub up: Option<[f64; 3]>,
    /// Vertical field of view in degrees
    #[arg(long, value_name = "DEGREES")]
    pub fov: Option<f64>,
    /// Width in pixels; with `--camera unfolded`, of the largest tile's longer side [default: 512; unfolded: 64]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub width: Option<u32>,
    /// Height in pixels [default: as wide]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub height: Option<u32>,
    /// Show each patch's own radiosity, not interpolated
    #[arg(long)]
    pub flat: bool,
    /// Integrate the light of the emitters at each pixel [default: polygons; unfolded: rays; with --flat: off]
    #[arg(long, value_enum)]
    pub direct: Option<DirectName>,
    /// Rays of the direct pass for each pixel (for each emitter with `polygons`) [default: 16; rays: 4096]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub direct_samples: Option<u32>,
    /// Samples along each side of a pixel, averaged in the colour layers [default: 2; unfolded: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub samples: Option<u32>,
}

impl ImageArgs {
    /// Tells whether any flag about the picture was given.
    #[must_use]
    pub fn is_given(&self) -> bool {
        self.camera.is_some()
            || self.eye.is_some()
            || self.look_at.is_some()
            || self.up.is_some()
            || self.fov.is_some()
            || self.width.is_some()
            || self.height.is_some()
            || self.flat
            || self.samples.is_some()
    }
}

/// What a propagation computes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FormName {
    /// All values of a pass from those of the pass before
    Jacobi,
    /// From the newest values there are
    InPlace,
}

impl From<FormName> for Form {
    fn from(name: FormName) -> Self {
        match name {
            FormName::Jacobi => Self::Jacobi,
            FormName::InPlace => Self::InPlace,
        }
    }
}

/// Where links are between passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LinksName {
    /// In memory up to --memory-limit, else on disk
    Auto,
    /// In memory
    Memory,
    /// In a file, checksummed; a killed run goes on where it was
    Disk,
    /// Nowhere: every pass finds them again
    Recompute,
}

/// `radiosity voxel`.
#[derive(Args, Debug)]
pub struct VoxelArgs {
    /// The scene (OBJ)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// A file to write: a picture (.exr, and a PNG preview beside it) or the voxels with their radiosity (.vtu)
    #[arg(short, long, value_name = "IMAGE.exr|B.vtu")]
    pub output: Option<PathBuf>,
    /// Voxels along the longest axis, 4 to 4096
    #[arg(long, value_name = "N", default_value_t = 100, help_heading = "Voxels")]
    pub voxels: u32,
    /// Radius of the discrete sphere of directions, 1 to 255
    #[arg(long, value_name = "R", default_value_t = 20, help_heading = "Voxels")]
    pub radius: u32,
    /// Propagations of light
    #[arg(long, value_name = "K", default_value_t = 10, help_heading = "Voxels")]
    pub passes: usize,
    /// What a propagation computes from
    #[arg(long, value_enum, default_value_t = FormName::InPlace, help_heading = "Voxels")]
    pub form: FormName,
    /// Join voxels to cells where the irradiance changes by less than T times its mean from cell to cell, as 0.05
    #[arg(long, value_name = "T", value_parser = parse_positive, conflicts_with_all = ["solver", "form", "links", "link_file"], help_heading = "Voxels")]
    pub adaptive: Option<f64>,
    /// With `--adaptive`, the largest cells: 2^L voxels wide, L up to 6
    #[arg(long, value_name = "L", default_value_t = 3, requires = "adaptive", value_parser = clap::value_parser!(u8).range(0..=6), help_heading = "Voxels")]
    pub coarsest: u8,
    /// Leave the weights of a voxel's directions as they are, not divided by their sum
    #[arg(long, help_heading = "Voxels")]
    pub unnormalised: bool,
    /// Weigh directions by exact solid angles, not by those of the faces' centres
    #[arg(long, help_heading = "Voxels")]
    pub exact_solid_angles: bool,
    /// Where the links between voxels are kept from pass to pass
    #[arg(long, value_enum, default_value_t = LinksName::Auto, help_heading = "Voxels")]
    pub links: LinksName,
    /// The file of `--links disk`, used again where it fits [default: the scene's name with .links]
    #[arg(long, value_name = "FILE", help_heading = "Voxels")]
    pub link_file: Option<PathBuf>,
    /// With `--links auto`, the most memory for links, in bytes; beyond it they go to disk
    #[arg(long, value_name = "BYTES", default_value_t = 4 << 30, help_heading = "Voxels")]
    pub memory_limit: u64,
    /// Show the voxels themselves, not the surfaces that they stand for
    #[arg(long, help_heading = "Voxels")]
    pub show_voxels: bool,
    /// Solve to a tolerance with a solver, in place of a number of propagations
    #[arg(long, value_name = "NAME", value_parser = solver_name(), conflicts_with_all = ["passes", "form"], help_heading = "Voxels")]
    pub solver: Option<String>,
    /// The solver's tolerance on sqrt(Σ A r² / Σ A E²), worst channel
    #[arg(
        long,
        value_name = "T",
        default_value_t = 1e-6,
        requires = "solver",
        help_heading = "Voxels"
    )]
    pub tolerance: f64,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub image: ImageArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub mesh: MeshArgs,
    #[command(flatten)]
    #[expect(missing_docs, reason = "a doc comment here would replace the help of the flags")]
    pub common: CommonArgs,
}

fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a number above 0".to_owned()),
    }
}

fn parse_vector(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| {
            part.trim()
                .parse::<f64>()
                .map_err(|_| format!("'{part}' is not a number"))
        })
        .collect::<Result<_, _>>()?;
    let vector: [f64; 3] = numbers
        .try_into()
        .map_err(|_| "give three numbers, as in 1,2.5,0".to_owned())?;
    if vector.iter().all(|x| x.is_finite()) {
        Ok(vector)
    } else {
        Err("give finite numbers".to_owned())
    }
}
