//! Images of a solved scene: views, interpolation, an optional direct pass, OpenEXR files and their check.

mod attributes;
mod direct;
mod direct_exact;
mod direct_point;
pub mod display;
mod error;
pub mod exr;
mod field;
mod fingerprint;
mod flat_surface;
mod gather;
mod image;
mod input;
mod kept;
mod outdoors;
mod pixel;
pub mod png;
mod rare;
mod renderer;
mod run;
mod samples;
mod settings;
mod shade;
mod shared;
pub mod tone_map;
mod unfolded;
mod unfolded_view;
pub mod verify;
mod view;

pub use attributes::{Attributes, PolygonRecord, SurfaceRecord};
pub use direct::DirectMethod;
pub use error::RenderError;
pub use field::{FIELD_SHADOW_RAYS, Field, FieldInput, FieldRecord, SurfaceMean, field};
pub use gather::{GatherReport, GatherSettings};
pub use image::{Image, Layer, Samples};
pub use input::RenderInput;
pub use outdoors::{DistantSky, DistantSun, Outdoors};
pub use run::{render, render_watched};
pub use settings::RenderSettings;
pub use unfolded::{Tile, Unfolded};
pub use unfolded_view::UnfoldedView;
pub use view::{CameraRecord, RayView, Sight, View, ViewDescription};

/// The greatest exitance, in W·m⁻², of a scene for an image: a thirtieth of the range of f32, as reflected light is added.
pub const MAX_PICTURE_EXITANCE: f64 = 1e37;
