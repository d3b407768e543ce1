//! Pictures.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::{AuditArgs, CommonArgs, MeshArgs, MethodArgs, SolverArgs, StorageArgs, parse_positive, parse_vector};

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
    pub audit: AuditArgs,
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
