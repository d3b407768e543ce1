//! The command line: names, defaults, help.
//!
//! A group of flags has no doc comment: it would replace the help of the flags.

mod byte;
mod experiments;
mod field;
mod form_factors;
mod heat;
mod points;
mod reading;
mod render;
mod settings;
mod solve;
mod tables;
mod voxel;

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::workflow::SolveRequest;
use byte::parse_byte;

pub(super) use experiments::{CompareArgs, PaperName, ReproduceArgs, VisibilityName};
pub(super) use field::FieldArgs;
pub(super) use form_factors::{ClosureArgs, FormFactorsArgs, MemoryArgs, MeshArgs, MethodArgs, StorageArgs};
pub(super) use heat::{HeatArgs, SunArgs};
pub(super) use points::PointsArgs;
pub(super) use reading::ReadingArgs;
pub(super) use render::{DirectName, GatherArgs, ImageArgs, PictureFileArgs, RenderArgs, ViewArgs};
pub(super) use solve::{SolveArgs, SolverArgs};
pub(super) use tables::parse_tables;
pub(super) use voxel::{LinksName, VoxelArgs};

/// View factors and radiosity for diffuse scenes, with an error stated for every number.
#[derive(Debug, Parser)]
#[command(name = "radiosity", version, about, propagate_version = true, max_term_width = 110)]
#[command(
    after_help = "Exit codes: 0 done, 1 error in input or at run time, 2 usage, 3 not converged or inexact, 4 failed check, \
                  130 and 143 ended by SIGINT and SIGTERM."
)]
pub(super) struct Cli {
    /// The command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Write a built-in scene as OBJ and MTL
    Scene(SceneArgs),
    /// Compute form factors, check them, and report them by surface
    FormFactors(FormFactorsArgs),
    /// Solve for the radiosity of every patch
    Solve(SolveArgs),
    /// Temperatures and net heat fluxes, with sun and sky
    Heat(HeatArgs),
    /// View factors, irradiance and mean radiant temperature at free points
    Points(PointsArgs),
    /// Render a scene to a layered OpenEXR image and a PNG preview
    Render(RenderArgs),
    /// Render the form factor from every visible point to a surface
    Field(FieldArgs),
    /// Discrete radiosity on voxels, with visibility by integer lines
    Voxel(VoxelArgs),
    /// Check an EXR against the analytic answer of the scene that it was made from
    Verify(VerifyArgs),
    /// Run all form-factor methods side by side: true error against run time, as tables and plots
    Compare(CompareArgs),
    /// Print a paper's tables beside what we measure
    Reproduce(ReproduceArgs),
    /// Print the completions of this program for a shell
    Completions(CompletionsArgs),
    /// Write the manual pages of this program
    Man(ManArgs),
}

impl Command {
    /// Returns the common flags of commands that compute results.
    #[must_use]
    pub(super) fn common(&self) -> Option<&CommonArgs> {
        match self {
            Self::Scene(a) => Some(&a.common),
            Self::FormFactors(a) => Some(&a.common),
            Self::Solve(a) => Some(&a.common),
            Self::Heat(a) => Some(&a.common),
            Self::Points(a) => Some(&a.common),
            Self::Render(a) => Some(&a.common),
            Self::Field(a) => Some(&a.common),
            Self::Voxel(a) => Some(&a.common),
            Self::Verify(a) => Some(&a.common),
            Self::Compare(a) => Some(&a.common),
            Self::Reproduce(a) => Some(&a.common),
            Self::Completions(_) | Self::Man(_) => None,
        }
    }
}

/// `radiosity completions`.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    pub shell: ShellName,
}

/// A shell that completes commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ShellName {
    /// As in: radiosity completions bash > ~/.local/share/bash-completion/completions/radiosity
    Bash,
    /// As in: radiosity completions zsh > a folder of $fpath/_radiosity
    Zsh,
    /// As in: radiosity completions fish > ~/.config/fish/completions/radiosity.fish
    Fish,
}

/// `radiosity man`.
#[derive(Args, Clone, Debug)]
pub(super) struct ManArgs {
    /// The directory of the pages, as in ~/.local/share/man/man1; it is made if it is not there
    #[arg(value_name = "DIR")]
    pub directory: PathBuf,
}

/// Flags that every command has.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common")]
pub(super) struct CommonArgs {
    /// Number of threads [default: all cores]; results do not depend on it
    #[arg(long, value_name = "K", value_parser = |text: &str| parse_up_to(text, 4096))]
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
    #[command(flatten)]
    pub reading: ReadingArgs,
}

/// The treatment of failed conservation checks.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Common")]
pub(super) struct AuditArgs {
    /// End with exit code 4 if the result fails a conservation check (row sums, reciprocity, energy, ...); without it, that is a warning
    #[arg(long)]
    pub strict: bool,
}

/// `radiosity scene`.
#[derive(Args, Debug)]
pub(super) struct SceneArgs {
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
    pub common: CommonArgs,
}

/// `radiosity verify`.
#[derive(Args, Debug)]
pub(super) struct VerifyArgs {
    /// The image that `radiosity render` or `radiosity field` wrote
    #[arg(value_name = "IMAGE.exr")]
    pub image: PathBuf,
    /// The most memory to use, as in 512MiB or 2G [default: 80 % of what is available]
    #[arg(long, value_name = "BYTES", value_parser = parse_byte)]
    pub memory_limit: Option<u64>,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// Reads one of the names of a registry; help lists them, each with its summary.
fn named(entries: impl Iterator<Item = (&'static str, &'static str)>) -> impl TypedValueParser<Value = String> {
    PossibleValuesParser::new(entries.map(|(name, summary)| PossibleValue::new(name).help(summary)))
}

/// Reads a number for which `is_good` is true; `wanted` describes these.
fn parse_number(text: &str, wanted: &str, is_good: impl Fn(f64) -> bool) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| is_good(*number));
    number.ok_or_else(|| format!("give {wanted}"))
}

fn parse_positive(text: &str) -> Result<f64, String> {
    parse_number(text, "a number above 0", |value| value.is_finite() && value > 0.0)
}

fn parse_not_negative(text: &str) -> Result<f64, String> {
    parse_number(text, "a number from 0", |value| value.is_finite() && value >= 0.0)
}

/// Reads one number for all channels, or three numbers.
fn parse_channels(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| parse_not_negative(part.trim()))
        .collect::<Result<_, _>>()?;
    match numbers[..] {
        [grey] => Ok([grey; 3]),
        [r, g, b] => Ok([r, g, b]),
        _ => Err("give one number, or three as in 1.0,0.9,0.8".to_owned()),
    }
}

/// Reads a time: 90, 90s, 10m or 1.5h.
fn parse_time(text: &str) -> Result<Duration, String> {
    let number = text.trim_end_matches(['s', 'm', 'h']);
    let unit = match &text[number.len()..] {
        "" | "s" => 1.0,
        "m" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    let seconds = number.parse::<f64>().map_or(f64::NAN, |number| unit * number);
    match Duration::try_from_secs_f64(seconds) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => Err("give a time above 0, such as 90s, 10m or 2h".to_owned()),
    }
}

fn parse_tolerance(text: &str) -> Result<f64, String> {
    let range = SolveRequest::TOLERANCES;
    let wanted = format!(
        "a number from {:e} to below {}, such as {:e}",
        range.start,
        range.end,
        SolveRequest::TOLERANCE
    );
    parse_number(text, &wanted, |value| range.contains(&value))
}

fn parse_angle(text: &str) -> Result<f64, String> {
    parse_number(text, "degrees between 0 and 180", |value| value > 0.0 && value < 180.0)
}

/// Reads a number from 1 to `most`.
fn parse_up_to(text: &str, most: usize) -> Result<NonZeroUsize, String> {
    let number = text.parse().ok().filter(|number: &NonZeroUsize| number.get() <= most);
    number.ok_or_else(|| format!("give a number from 1 to {most}"))
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
