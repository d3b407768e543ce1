//! The arguments of discrete radiosity.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::byte::parse_byte;
use super::solve::solver_name_without_symmetry;
use super::{AuditArgs, ClosureArgs, CommonArgs, ImageArgs, MeshArgs, parse_positive, parse_tolerance};
use crate::voxel::{Form, RowWeights, SolidAngle};
use crate::workflow::{LinkPlace, SolveRequest, VoxelLight, VoxelRequest};

/// Where links are between passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LinksName {
    /// In memory where all together stays below --memory-limit, else on disk
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
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of its own")]
pub(crate) struct VoxelArgs {
    /// The scene: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// A file to write: a picture (.exr, and a PNG preview beside it) or the voxels with their radiosity (.vtu)
    #[arg(short, long, value_name = "IMAGE.exr|B.vtu")]
    pub output: Option<PathBuf>,
    /// Voxels along the longest axis, 4 to 4096
    #[arg(long, value_name = "N", default_value_t = VoxelRequest::VOXELS, help_heading = "Voxels")]
    pub voxels: u32,
    /// Radius of the discrete sphere of directions, 1 to 255
    #[arg(long, value_name = "R", default_value_t = VoxelRequest::RADIUS, help_heading = "Voxels")]
    pub radius: u32,
    /// Propagations of light
    #[arg(long, value_name = "K", default_value_t = VoxelRequest::PASSES, help_heading = "Voxels")]
    pub passes: usize,
    /// The input of a propagation
    #[arg(long, value_enum, default_value_t, help_heading = "Voxels")]
    pub form: Form,
    /// Join voxels to cells where the irradiance changes by less than T times its mean from cell to cell, as 0.05
    #[arg(long, value_name = "T", value_parser = parse_positive, conflicts_with_all = ["solver", "form", "links", "link_file"], help_heading = "Voxels")]
    pub adaptive: Option<f64>,
    /// With `--adaptive`, the largest cells: 2^L voxels wide, L up to 6
    #[arg(long, value_name = "L", default_value_t = VoxelRequest::COARSEST, requires = "adaptive", value_parser = clap::value_parser!(u8).range(0..=6), help_heading = "Voxels")]
    pub coarsest: u8,
    /// Leave the weights of a voxel's directions as they are, not divided by their sum
    #[arg(long, help_heading = "Voxels")]
    pub unnormalised: bool,
    /// Let every voxel of an emitter send its exitance, not scaled so that the power is that of the emitter's true area
    #[arg(long, help_heading = "Voxels")]
    pub plain_emission: bool,
    /// Weigh directions by exact solid angles, not by those of the faces' centres
    #[arg(long, help_heading = "Voxels")]
    pub exact_solid_angles: bool,
    /// Where the links between voxels are kept from pass to pass
    #[arg(long, value_enum, default_value_t = LinksName::Auto, help_heading = "Voxels")]
    pub links: LinksName,
    /// The file of links on disk, used again where it fits; with it, `--links auto` is `--links disk` [default: the scene's name with .links]
    #[arg(long, value_name = "FILE", help_heading = "Voxels")]
    pub link_file: Option<PathBuf>,
    /// The most memory to use, as in 512MiB or 2G; links that do not fit go to disk [default: 80 % of what is available]
    #[arg(long, value_name = "BYTES", value_parser = parse_byte, help_heading = "Voxels")]
    pub memory_limit: Option<u64>,
    /// Show the voxels themselves, not the surfaces that they stand for
    #[arg(long, help_heading = "Voxels")]
    pub show_voxels: bool,
    /// Solve to a tolerance with a solver, in place of a number of propagations
    #[arg(long, value_name = "NAME", value_parser = solver_name_without_symmetry(), conflicts_with_all = ["passes", "form"], help_heading = "Voxels")]
    pub solver: Option<String>,
    /// The solver's tolerance on sqrt(Σ A r² / Σ A E²), worst channel
    #[arg(
        long,
        value_name = "T",
        default_value_t = SolveRequest::TOLERANCE,
        value_parser = parse_tolerance,
        requires = "solver",
        help_heading = "Voxels"
    )]
    pub tolerance: f64,
    #[command(flatten)]
    pub image: ImageArgs,
    #[command(flatten)]
    pub mesh: MeshArgs,
    #[command(flatten)]
    pub closure: ClosureArgs,
    #[command(flatten)]
    pub audit: AuditArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl VoxelArgs {
    /// Returns the request that the flags set; the output determines whether voxels are written and whether an image of the patches follows.
    #[must_use]
    pub(crate) fn request(&self, is_written: bool, is_shown: bool) -> VoxelRequest {
        VoxelRequest {
            n_voxels: self.voxels,
            radius: self.radius,
            solid_angle: if self.exact_solid_angles {
                SolidAngle::Exact
            } else {
                SolidAngle::Centre
            },
            row_weights: if self.unnormalised {
                RowWeights::Plain
            } else {
                RowWeights::Normalised
            },
            plain_emission: self.plain_emission,
            light: match (self.adaptive, &self.solver) {
                (Some(tolerance), _) => VoxelLight::Cells {
                    passes: self.passes,
                    tolerance,
                    coarsest: self.coarsest,
                },
                (None, Some(name)) => VoxelLight::Solver {
                    name: name.clone(),
                    tolerance: self.tolerance,
                },
                (None, None) => VoxelLight::Propagations {
                    passes: self.passes,
                    form: self.form,
                },
            },
            links: match self.links {
                LinksName::Auto => LinkPlace::Auto {
                    has_file: self.link_file.is_some(),
                },
                LinksName::Memory => LinkPlace::Memory,
                LinksName::Disk => LinkPlace::Disk,
                LinksName::Recompute => LinkPlace::Recompute,
            },
            link_file: self.link_file(),
            closure: self.closure.closure(),
            is_written,
            is_shown,
        }
    }

    /// Returns the file of links on disk.
    #[must_use]
    pub(crate) fn link_file(&self) -> PathBuf {
        let beside = || self.scene.with_extension("links");
        self.link_file.clone().unwrap_or_else(beside)
    }

    /// Refuses flags that do not fit together.
    ///
    /// # Errors
    /// Their fault, and the remedy.
    pub(crate) fn expect_sensible(&self, is_image: bool) -> Result<(), &'static str> {
        if !is_image && (self.show_voxels || self.image.is_given()) {
            return Err("a picture wants a file; add -o IMAGE.exr");
        }
        if self.link_file.is_some() && matches!(self.links, LinksName::Memory | LinksName::Recompute) {
            return Err("--link-file is for links on disk: leave it out, or take --links disk");
        }
        if self.image.direct.is_some() || self.image.direct_samples.is_some() {
            return Err("--direct: voxels show their own light; use `radiosity render` for a direct pass");
        }
        Ok(())
    }
}
