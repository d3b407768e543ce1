//! The flags for the solution of the system.

use std::path::PathBuf;

use clap::Args;
use clap::builder::TypedValueParser;

use super::settings::{OfSolvers, SettingFlags, of_computation};
use super::{
    AuditArgs, CommonArgs, MeshArgs, MethodArgs, StorageArgs, SunArgs, named, parse_positive, parse_tolerance,
};
use crate::solver::registry::SOLVERS;
use crate::solver::{SolverSettings, Start};
use crate::workflow::{Demand, SolveRequest};

/// Reads the name of a solver; help lists those of the registry.
pub(super) fn solver_name() -> impl TypedValueParser<Value = String> {
    named(SOLVERS.iter().map(|solver| (solver.name, solver.summary)))
}

/// Reads the name of a solver that needs no symmetric form factors: those of voxels are neither symmetric nor balanced.
pub(super) fn solver_name_without_symmetry() -> impl TypedValueParser<Value = String> {
    let suited = SOLVERS.iter().filter(|solver| !solver.needs_reciprocity());
    named(suited.map(|solver| (solver.name, solver.summary)))
}

/// How the system is solved.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Solver")]
pub(crate) struct SolverArgs {
    /// The solver
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = solver_name())]
    pub solver: String,
    /// Tolerance on sqrt(Σ A r² / Σ A E²), worst channel
    #[arg(long, value_name = "T", default_value_t = SolveRequest::TOLERANCE, value_parser = parse_tolerance)]
    pub tolerance: f64,
    /// The most passes over the form factors
    #[arg(long, value_name = "K", default_value_t = SolveRequest::MAX_PASSES)]
    pub max_passes: usize,
    /// The first radiosities
    #[arg(long, value_enum, default_value_t)]
    pub start: Start,
    #[command(flatten)]
    pub own: SettingFlags<OfSolvers>,
}

impl SolverArgs {
    /// Returns the demands of a solution and its output after the form factors.
    #[must_use]
    pub(crate) fn demand(&self, output: Option<&PathBuf>) -> Demand {
        Demand {
            output: output.cloned(),
            tolerance: Some(self.tolerance),
            solver: Some(self.solver.clone()),
            ..Demand::default()
        }
    }

    /// Returns the request that the flags set.
    #[must_use]
    pub(crate) fn request(&self) -> SolveRequest {
        SolveRequest {
            solver: self.solver.clone(),
            settings: SolverSettings {
                values: self.own.values.clone(),
                ..SolverSettings::default()
            },
            tolerance: self.tolerance,
            max_passes: self.max_passes,
            start: self.start,
        }
    }
}

/// `radiosity solve`.
#[derive(Args, Debug)]
pub(crate) struct SolveArgs {
    /// The scene: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// A file for the solution of each patch: .csv, .npz, .vtu, or .ply or .obj in the colours of the radiosity
    #[arg(short, long, value_name = "B.csv")]
    pub output: Option<PathBuf>,
    /// Form factors that `form-factors -o` wrote, instead of computing them; they know how the scene was cut into patches
    #[arg(long, value_name = "F.npz", conflicts_with_all = of_computation())]
    pub form_factors: Option<PathBuf>,
    /// Compute the form factors again in every pass instead of storing them; for methods that compute rows
    #[arg(long, conflicts_with_all = ["form_factors", "lighting", "balance", "checkpoint", "sun_irradiance", "sky"])]
    pub on_the_fly: bool,
    /// A file with other exitances and reflectances, by surface or material; give it several times to solve for all at once
    #[arg(long, value_name = "A.toml", conflicts_with_all = ["sun_irradiance", "sky"])]
    pub lighting: Vec<PathBuf>,
    /// An array of NumPy with exitances of the patches, W/m2, in place of the scene's. Shape (n, k) for k grey lightings, (n, k, 3) for coloured ones, all solved in the same passes
    #[arg(long, value_name = "E.npy", conflicts_with_all = ["lighting", "sun_irradiance", "on_the_fly"])]
    pub exitance: Option<PathBuf>,
    /// The error of each form factor between partly hidden patches, on A_i F_ij / min(A_i, A_j), with exact [default: a tenth of the mesh's own error, where that is known, from 1e-6 to 1e-3]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub form_factor_tolerance: Option<f64>,
    /// A table of the sun at many times, with the columns time, x, y, z, irradiance or time, latitude, longitude, irradiance. The output is a series of times: .npz, or .vtu files with a .pvd
    #[arg(long, value_name = "FILE.csv", group = "sun_direction", conflicts_with_all = ["sun_irradiance", "lighting", "exitance", "on_the_fly"], help_heading = "Sun")]
    pub sun_path: Option<PathBuf>,
    #[command(flatten)]
    pub sun: SunArgs,
    #[command(flatten)]
    pub mesh: MeshArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub solver: SolverArgs,
    #[command(flatten)]
    pub storage: StorageArgs,
    #[command(flatten)]
    pub audit: AuditArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}
