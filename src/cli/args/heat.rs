//! The arguments of heat, and the flags for the sun.

use std::path::{Path, PathBuf};

use clap::Args;

use super::settings::of_computation;
use super::{
    AuditArgs, CommonArgs, MeshArgs, MethodArgs, SolverArgs, StorageArgs, ViewArgs, parse_channels, parse_not_negative,
    parse_positive, parse_vector,
};
use crate::workflow::{Context, ExchangeNodes, SunRecord};

/// The sun.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Sun")]
#[group(skip)]
#[command(group = clap::ArgGroup::new("sun_direction").args(["sun", "latitude"]))]
pub(crate) struct SunArgs {
    /// The direction towards the sun, of any length; instead of that of the file
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, requires = "sun_irradiance", allow_hyphen_values = true)]
    pub sun: Option<[f64; 3]>,
    /// The place on Earth whose sun shines, in degrees north; with --longitude and --time in the place of --sun
    #[arg(long, value_name = "DEG", conflicts_with = "sun", requires_all = ["longitude", "time", "sun_irradiance"])]
    pub latitude: Option<f64>,
    /// The place, in degrees east
    #[arg(long, value_name = "DEG", requires = "latitude")]
    pub longitude: Option<f64>,
    /// The time in RFC 3339, as 2026-06-21T12:00:00+02:00
    #[arg(long, value_name = "TIME", requires = "latitude")]
    pub time: Option<String>,
    /// The direction of the scene that is north, with --latitude; up is that of the sky, or +z
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, default_value = "0,1,0", allow_hyphen_values = true)]
    pub north: [f64; 3],
    /// The irradiance of a plane that faces the sun, W/m²: one number, or red, green and blue
    #[arg(long, value_name = "W[,G,B]", value_parser = parse_channels, requires = "sun_direction")]
    pub sun_irradiance: Option<[f64; 3]>,
    /// The angular radius of the sun in degrees: above 0 its shadows have penumbras [default: 0]
    #[arg(long, value_name = "DEG", value_parser = parse_not_negative, requires = "sun_direction")]
    pub sun_radius: Option<f64>,
    /// The irradiance of a uniform sky on an unobstructed plane that faces up, W/m²: one number, or red, green and blue. Up is that of the boundary file's sky, or +z
    #[arg(long, value_name = "W[,G,B]", value_parser = parse_channels)]
    pub sky: Option<[f64; 3]>,
}

impl SunArgs {
    /// Records the given flags in the settings of a run.
    pub(in crate::cli) fn note(&self, cx: &mut Context) {
        cx.settings.sky_irradiance = self.sky;
        cx.settings.sun = self.sun_irradiance.map(|_| self.record());
    }

    /// Records the given flags, and the table of the sun's positions, in the settings of a run.
    pub(in crate::cli) fn note_path(&self, file: Option<&Path>, cx: &mut Context) {
        cx.settings.sky_irradiance = self.sky;
        let name = file
            .and_then(Path::file_stem)
            .map(|name| name.to_string_lossy().into_owned());
        cx.settings.sun = Some(SunRecord {
            path: name,
            ..self.record()
        });
    }

    fn record(&self) -> SunRecord {
        SunRecord {
            path: None,
            sun: self.sun,
            latitude: self.latitude,
            longitude: self.longitude,
            time: self.time.clone(),
            north: self.north,
            sun_irradiance: self.sun_irradiance,
            sun_radius: self.sun_radius,
        }
    }
}

/// `radiosity heat`.
#[derive(Args, Debug)]
pub(crate) struct HeatArgs {
    /// The scene: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The boundary conditions: emissivities, temperatures, supplied heat, nodes; surroundings, sun and sky
    #[arg(long, value_name = "FILE.toml")]
    pub boundary: PathBuf,
    /// A file for the temperatures and fluxes of each patch: .csv, .npz, .vtu, or .ply or .obj in the colours of the temperature
    #[arg(short, long, value_name = "OUT.csv")]
    pub output: Option<PathBuf>,
    /// A file for Gebhart factors, script-F and conductors of a thermal network: .npz, or .csv with the conductors alone
    #[arg(long, value_name = "G.npz")]
    pub exchange_factors: Option<PathBuf>,
    /// The nodes of the exchange factors
    #[arg(long, value_enum, default_value_t, requires = "exchange_factors")]
    pub by: ExchangeNodes,
    /// Form factors that `form-factors -o` wrote, instead of computing them; they know how the scene was cut into patches
    #[arg(long, value_name = "F.npz", conflicts_with_all = of_computation())]
    pub form_factors: Option<PathBuf>,
    /// The error of each form factor between partly hidden patches, on A_i F_ij / min(A_i, A_j), with exact [default: 1e-6]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub form_factor_tolerance: Option<f64>,
    /// A table of the sun at many times, with the columns time, x, y, z, irradiance or time, latitude, longitude, irradiance. The output is a series of times: .npz, or .vtu files with a .pvd. Surfaces store no heat: each time is a steady state
    #[arg(long, value_name = "FILE.csv", group = "sun_direction", conflicts_with_all = ["sun_irradiance", "picture", "exchange_factors"], help_heading = "Sun")]
    pub sun_path: Option<PathBuf>,
    /// A picture of the temperature in false colour, with a scale: a PNG
    #[arg(long, value_name = "T.png", help_heading = "Picture")]
    pub picture: Option<PathBuf>,
    #[command(flatten)]
    pub view: ViewArgs,
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
