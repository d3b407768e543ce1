//! Whole studies: from a scene to form factors and light, each number with its error, and with warnings.
//!
//! The modules of the single steps are independent of each other. Here a [`Model`] takes the steps in turn and keeps their account: steps that the scene does not need are left out
//! ([`Model::plan`]), form factors are stored within the memory limit, rows of enclosures sum to 1, results pass conservation checks ([`Context::audit`]), and the errors of the form factors
//! are propagated into the light ([`SolutionStudy::error`]). The program, the experiments and other languages call the same functions.

mod context;
mod daylight;
mod error;
mod exchange;
mod field;
mod form_factors;
mod heat;
mod heat_path;
mod image;
mod image_light;
mod leaks;
mod light_path;
mod lightings;
mod lit_surface;
mod mesh_error;
mod mesh_tolerance;
mod model;
mod on_the_fly;
mod patch_picture;
mod points;
mod quality;
mod ranks;
mod repair;
mod reuse;
mod sequence;
mod settings;
mod solve;
mod storage;
mod sun_path;
mod surfaces;
mod total_error;
mod view;
mod voxel;
mod voxel_image;
mod voxel_links;
mod warning;
mod warning_text;

pub use context::{Context, Demand, Watch};
pub use daylight::{Daylight, DirectDaylight, SkyRequest, SunRequest, is_grey};
pub use error::{Unsuited, WorkflowError};
pub use exchange::ExchangeNodes;
pub use field::{FieldMethod, FieldRequest};
pub use form_factors::{Afterwards, Balance, DEFAULT_RAYS, FormFactorRequest, FormFactorStudy, Raw};
pub use heat::{HeatStudy, MAX_HEAT_ERROR};
pub use heat_path::HeatStep;
pub use image::{
    IMAGE_RAYS, IMAGE_TOLERANCE, ImageFile, ImageRequest, gathered, image_byte, image_patches, render_shown,
    render_to_files, rendered, warn_if_blank,
};
pub use image_light::{ImageLight, NO_SOLVER};
pub use leaks::{Amount, Leak, Leaks};
pub use light_path::LightStep;
pub use lightings::{LightingStudy, Stack};
pub use lit_surface::{LitSurface, SkylitSurface, SunlitSurface, SurfaceRecord};
pub use mesh_error::MeshError;
#[cfg(feature = "reports")]
pub(crate) use model::materials;
pub use model::{Model, Use, expect_room, load, load_arrays};
pub use on_the_fly::indirect_irradiance;
pub use quality::Quality;
pub use reuse::mesh_options;
pub use sequence::{
    Frame, FrameDefaults, FrameStudy, PoseStudy, Sequence, SequenceObserver, SequenceRequest, with_suffix,
};
pub use settings::{Balanced, Settings, StatedClosure, SunRecord, VarianceRepair};
pub use solve::{Known, SolutionStudy, SolveRequest, go_on};
pub use storage::{ChosenStorage, MatrixDemand, Memory, Storage, choice_text, choose_storage, place_text};
pub use sun_path::{BlockSink, PathStudy};
pub use surfaces::SurfaceTable;
pub use total_error::TotalError;
pub use view::{CameraChoice, CameraOrigin, ImageView, ViewRequest};
pub use voxel::{LinkFigures, VoxelLight, VoxelRequest, VoxelResult, VoxelStudy};
pub use voxel_image::{VoxelImageRequest, voxel_patches};
pub use voxel_links::{LinkPlace, VoxelRemedy};
pub use warning::Warning;

pub use crate::parameter::{Named, Parameter};
