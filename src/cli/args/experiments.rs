//! The arguments of comparisons and of the reproduction of papers' tables.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{ClosureArgs, CommonArgs, MemoryArgs, MeshArgs, parse_positive};
use crate::experiment::CompareSettings;
use crate::form_factor::ExactMethod;

/// Whether occluders are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum VisibilityName {
    /// Yes
    On,
    /// No: form factors of the bare pairs, for the methods that can leave visibility out
    Off,
    /// Both, one after the other
    Both,
}

/// `radiosity compare`.
#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// A scene file of any format, or the name of a built-in scene
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The directory for tables and plots, made if needed [default: compare-SCENE]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// The methods, separated by commas [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Runs of every setting, each with a seed of its own
    #[arg(long, value_name = "N", default_value_t = CompareSettings::SEEDS, value_parser = clap::value_parser!(u64).range(1..=10000))]
    pub seeds: u64,
    /// The first seed
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Leave out settings of which one run takes longer than S seconds
    #[arg(long, value_name = "S", default_value_t = CompareSettings::TIME_LIMIT_S, value_parser = parse_positive)]
    pub time_limit: f64,
    /// Whether occluders are looked at
    #[arg(long, value_enum, default_value_t = VisibilityName::Both)]
    pub visibility: VisibilityName,
    /// The tolerance of exact that the methods are judged for: where nothing is known of the scene, the reference is exact at T/100
    #[arg(long, value_name = "T", default_value_t = ExactMethod::DEFAULT_TOLERANCE, value_parser = parse_positive)]
    pub tolerance: f64,
    #[command(flatten)]
    pub closure: ClosureArgs,
    #[command(flatten)]
    pub mesh: MeshArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// The papers whose tables can be repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PaperName {
    /// Baranoski, Bramley and Shirley 1995: table 2 (solvers), tables 3 to 8 (form factors by shooting and quadrature)
    Baranoski,
    /// Every solver on stiff, extreme and impossible systems
    Stability,
    /// Lewis 1992: tables 1 and 2, figures 1, 2, 5 and 6 (multigrid against Gauss-Seidel)
    Lewis,
    /// Malgouyres 2002: the error of voxels against exact form factors, by resolution, radius and run time
    Malgouyres,
    /// Ingersoll, Svitek and Murray 1992: the temperature of the shadow in a bowl-shaped crater
    Crater,
    /// The Cornell box, flat, interpolated and with final gather: the error of the irradiance against the rendering time
    Pictures,
}

/// `radiosity reproduce`.
#[derive(Args, Debug)]
pub(crate) struct ReproduceArgs {
    /// The paper
    #[arg(value_enum, value_name = "PAPER")]
    pub paper: PaperName,
    /// The tables, as in `2-8` or `2,5-7` [default: all that are built]
    #[arg(long, visible_alias = "table", value_name = "LIST")]
    pub tables: Option<String>,
    /// The directory for the tables as files, made if needed [default: reproduce-PAPER]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Runs of every stochastic method of `baranoski`, each with a seed of its own [default: 100]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(30..=10000))]
    pub seeds: Option<u64>,
    /// The first seed of `baranoski`, the seed of `stability` [default: 0]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// The finest level. Of table 2 of `lewis`: 6 (24576 patches) takes 4 GB and a minute or two [default: 5]. Of `crater`: 4^(L+1) faces, 2 to 6 [default: 4]. Of `malgouyres`: 10 · 2^L voxels; of `pictures`: 24 · 2^L pixels, L up to 4 [default: 2]
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u32).range(1..=6))]
    pub level: Option<u32>,
    #[command(flatten)]
    pub common: CommonArgs,
}
