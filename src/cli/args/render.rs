//! The arguments of images.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::DVec3;

use super::{
    AuditArgs, CommonArgs, MeshArgs, MethodArgs, SolverArgs, StorageArgs, SunArgs, parse_angle, parse_positive,
    parse_vector,
};
use crate::render::exr::{Parts, Pixels};
use crate::scene::IMAGE_SIDES;
use crate::workflow::{CameraChoice, ViewRequest};

/// The direct pass: light from the emitters, integrated at each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DirectName {
    /// None: the radiosity of the patches alone, interpolated
    Off,
    /// Cosine-distributed rays, with a standard error for every pixel; for `verify`
    Rays,
    /// The exact form factor of each emitter times its visible fraction
    Polygons,
    /// The exact form factor of each emitter's visible part
    Exact,
}

/// `radiosity render`.
#[derive(Args, Debug)]
pub(crate) struct RenderArgs {
    /// The scene: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The image to write; a PNG preview goes beside it
    #[arg(short, long, value_name = "IMAGE.exr")]
    pub output: PathBuf,
    /// The error of each form factor between partly hidden patches, on A_i F_ij / min(A_i, A_j), with exact [default: a tenth of the mesh's own error, where that is known, from 1e-5 to 1e-3]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub form_factor_tolerance: Option<f64>,
    /// Compute the form factors again in every pass instead of storing them; for methods that compute rows
    #[arg(long, conflicts_with_all = ["frames", "balance", "checkpoint", "sun_irradiance", "sky"])]
    pub on_the_fly: bool,
    /// Render a sequence: a TOML file of frames, each with a name, a lighting, a camera and objects that move; writes IMAGE-NAME.exr for each
    #[arg(long, value_name = "FILE.toml", help_heading = "Picture")]
    pub frames: Option<PathBuf>,
    /// Show the picture while it is rendered in the viewer tev that listens there, as in localhost:14158
    #[arg(long, value_name = "HOST:PORT", help_heading = "Picture")]
    pub display: Option<String>,
    #[command(flatten)]
    pub image: ImageArgs,
    #[command(flatten)]
    pub gather: GatherArgs,
    #[command(flatten)]
    pub file: PictureFileArgs,
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

/// Final gather.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Picture")]
pub(crate) struct GatherArgs {
    /// Gather the light between surfaces at each pixel by rays, in place of interpolating it between patches
    #[arg(long)]
    pub final_gather: bool,
    /// The standard error that a pixel may have, relative to its irradiance, with --final-gather [default: 0.02]
    #[arg(long, value_name = "T", value_parser = parse_positive, requires = "final_gather")]
    pub noise: Option<f64>,
    /// The most rays to gather for one pixel; 16 for each of its samples that sees a surface are taken all the same [default: 16384]
    #[arg(long, value_name = "N", requires = "final_gather", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub gather_rays: Option<u32>,
}

/// The file of a picture.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Picture")]
pub(crate) struct PictureFileArgs {
    /// The kind of floats
    #[arg(long, value_enum, default_value_t)]
    pub pixels: Pixels,
    /// The parts of the file
    #[arg(long, value_enum, default_value_t)]
    pub parts: Parts,
}

/// The picture.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Picture")]
pub(crate) struct ImageArgs {
    #[command(flatten)]
    pub view: ViewArgs,
    /// Show each patch's own radiosity, not interpolated
    #[arg(long)]
    pub flat: bool,
    /// Integrate the light of the emitters at each pixel [default: polygons; unfolded: rays; with --flat: off]
    #[arg(long, value_enum)]
    pub direct: Option<DirectName>,
    /// Rays of the direct pass for each pixel (for each emitter with `polygons`) [default: 16; rays: 4096]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub direct_samples: Option<u32>,
}

/// Returns a parser of the sides that camera files may have as well.
fn image_side() -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(i64::from(*IMAGE_SIDES.start())..=i64::from(*IMAGE_SIDES.end()))
}

/// Where the picture is seen from, and how many pixels it has.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Picture")]
pub(crate) struct ViewArgs {
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
    #[arg(long, value_name = "DEGREES", value_parser = parse_angle, allow_hyphen_values = true)]
    pub fov: Option<f64>,
    /// Width in pixels; with `--camera unfolded`, of the largest tile's longer side [default: in proportion to --height, else as the camera file says, else 512; unfolded: 64]
    #[arg(long, value_name = "PIXELS", value_parser = image_side())]
    pub width: Option<u32>,
    /// Height in pixels [default: in proportion to --width as the camera file says, else as wide]
    #[arg(long, value_name = "PIXELS", value_parser = image_side())]
    pub height: Option<u32>,
    /// N² samples for each pixel, averaged in the colour layers. From 2 on four times as many at edges, and 16 times at edges of emitters, but in unfolded views a regular grid [default: 2; unfolded: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub samples: Option<u32>,
}

impl ImageArgs {
    /// Returns whether any flag about the image is given.
    #[must_use]
    pub(crate) fn is_given(&self) -> bool {
        self.view.request() != ViewRequest::default() || self.flat || self.view.samples.is_some()
    }
}

impl ViewArgs {
    /// Returns the view that the flags request.
    #[must_use]
    pub(crate) fn request(&self) -> ViewRequest {
        ViewRequest {
            camera: match &self.camera {
                None => CameraChoice::OfScene,
                Some(camera) => CameraChoice::of_list(Path::new(""), camera),
            },
            eye: self.eye.map(DVec3::from_array),
            look_at: self.look_at.map(DVec3::from_array),
            up: self.up.map(DVec3::from_array),
            fov: self.fov,
            width: self.width,
            height: self.height,
        }
    }
}
