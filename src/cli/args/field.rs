//! The arguments of fields of form factors.

use std::path::PathBuf;

use clap::Args;

use super::byte::parse_byte;
use super::{CommonArgs, MeshArgs, PictureFileArgs, ViewArgs};
use crate::geometry::sampling::Sequence;
use crate::workflow::FieldMethod;

/// `radiosity field`.
#[derive(Args, Debug)]
pub(crate) struct FieldArgs {
    /// The scene: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The surface, by name, that the form factors are to
    #[arg(long, value_name = "NAME")]
    pub surface: String,
    /// The image to write; a PNG preview goes beside it
    #[arg(short, long, value_name = "F.exr")]
    pub output: PathBuf,
    /// The method
    #[arg(long, value_enum, default_value_t, help_heading = "Form factors")]
    pub method: FieldMethod,
    /// Rays for each sample of a pixel, with sr [default: 4096], or for each face of the surface, with qmc [default: 64]
    #[arg(long, value_name = "N", help_heading = "Form factors", value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub rays: Option<u32>,
    /// Where the numbers of sr and qmc come from [default: sobol]
    #[arg(long, value_enum, help_heading = "Form factors")]
    pub sequence: Option<Sequence>,
    /// Seed of all numbers
    #[arg(long, value_name = "S", default_value_t = 0, help_heading = "Form factors")]
    pub seed: u64,
    /// The most memory to use, as in 512MiB or 2G [default: 80 % of what is available]
    #[arg(long, value_name = "BYTES", value_parser = parse_byte)]
    pub memory_limit: Option<u64>,
    #[command(flatten)]
    pub view: ViewArgs,
    #[command(flatten)]
    pub file: PictureFileArgs,
    #[command(flatten)]
    pub mesh: MeshArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}
