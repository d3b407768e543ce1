//! The arguments of free points.

use std::path::PathBuf;

use clap::Args;

use super::{CommonArgs, MeshArgs, MethodArgs, SolverArgs, StorageArgs, parse_positive};

/// `radiosity points`.
#[derive(Args, Debug)]
pub(crate) struct PointsArgs {
    /// The scene: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// A table of points with the columns x, y, z in m and, where they face one way, nx, ny, nz
    #[arg(value_name = "P.csv")]
    pub points: PathBuf,
    /// Boundary conditions, for irradiances and mean radiant temperatures; without them there are view factors alone
    #[arg(long, value_name = "FILE.toml")]
    pub boundary: Option<PathBuf>,
    /// A file for what the points see: .csv or .npz [default: a table on standard output]
    #[arg(short, long, value_name = "OUT.csv")]
    pub output: Option<PathBuf>,
    /// Count the sun in the mean radiant temperature as it acts on a standing person
    #[arg(long, requires = "boundary")]
    pub person: bool,
    /// The error of each form factor between partly hidden patches, on A_i F_ij / min(A_i, A_j), with exact [default: 1e-6]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub form_factor_tolerance: Option<f64>,
    #[command(flatten)]
    pub mesh: MeshArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub solver: SolverArgs,
    #[command(flatten)]
    pub storage: StorageArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}
