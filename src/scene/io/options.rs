//! Options for reading a scene file.

use std::path::PathBuf;

use glam::DVec3;

use super::Format;
use crate::scene::MAX_EXITANCE;

/// The angle, in degrees, beyond which two faces that share an edge belong to different surfaces, where the file names none.
pub const DEFAULT_CREASE_ANGLE: f64 = 40.0;

/// Options for reading a scene file.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LoadOptions {
    /// The format; `None` detects it by the content of the file, then by its suffix.
    pub format: Option<Format>,
    /// True if the files that a scene file names, as material libraries or buffers, may lie outside its folder.
    ///
    /// It is off by default: a scene from an untrusted source must not make the program read arbitrary paths.
    pub allow_outside: bool,
    /// The faces whose winding is reversed: their normals were inverted.
    pub flip: Flip,
    /// The greatest exitance of a material, in W·m⁻²: [`MAX_EXITANCE`], or less where light is stored with a smaller range.
    pub max_exitance: f64,
    /// The unit of the file's lengths.
    pub unit: LengthUnit,
    /// The file's axis that points upwards; in the scene it is z.
    pub up_axis: UpAxis,
    /// The distance, in m, up to which vertices become one: 0 joins equal ones only.
    pub merge_tolerance: f64,
    /// The angle, in degrees, beyond which two faces that share an edge belong to different surfaces, where the file names none.
    pub crease_angle: f64,
    /// True if all faces are one surface, whatever the file states.
    pub one_surface: bool,
    /// The cell array of a VTK or PLY file whose values are surfaces; `None` takes the first of the [usual names](super::USUAL_ARRAYS).
    pub surface_array: Option<String>,
    /// A TOML file of reflectances and exitances, in the syntax of [`Lighting`](crate::scene::Lighting).
    pub materials: Option<PathBuf>,
}

/// The faces whose winding is reversed while a scene is read, before all other steps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Flip {
    /// None.
    #[default]
    Nothing,
    /// All faces.
    All,
    /// The faces of surfaces, by their names.
    Surfaces(Vec<String>),
}

/// A unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum LengthUnit {
    /// Metres.
    #[default]
    #[cfg_attr(feature = "cli", value(name = "m"))]
    Metre,
    /// Millimetres.
    #[cfg_attr(feature = "cli", value(name = "mm"))]
    Millimetre,
    /// Centimetres.
    #[cfg_attr(feature = "cli", value(name = "cm"))]
    Centimetre,
    /// Inches, 25.4 mm.
    #[cfg_attr(feature = "cli", value(name = "in"))]
    Inch,
    /// Feet, 304.8 mm.
    #[cfg_attr(feature = "cli", value(name = "ft"))]
    Foot,
}

impl LengthUnit {
    /// Returns a length of this unit in m.
    ///
    /// Accuracy: the f64 nearest to it for metres, millimetres and centimetres; 1 ulp for the others.
    #[must_use]
    pub fn metres(self, length: f64) -> f64 {
        match self {
            Self::Metre => length,
            Self::Millimetre => length / 1000.0,
            Self::Centimetre => length / 100.0,
            Self::Inch => length * 0.0254,
            Self::Foot => length * 0.3048,
        }
    }
}

/// The axis of a file that points upwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum UpAxis {
    /// y: the scene is turned about x, so that (x, y, z) becomes (x, −z, y).
    Y,
    /// z: coordinates stay as they are.
    #[default]
    Z,
}

impl UpAxis {
    /// Returns the scene's coordinates of a point of the file.
    #[must_use]
    pub fn turned(self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        match self {
            Self::Y => DVec3::new(x, -z, y),
            Self::Z => DVec3::new(x, y, z),
        }
    }
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            format: None,
            allow_outside: false,
            flip: Flip::Nothing,
            max_exitance: MAX_EXITANCE,
            unit: LengthUnit::default(),
            up_axis: UpAxis::default(),
            merge_tolerance: 0.0,
            crease_angle: DEFAULT_CREASE_ANGLE,
            one_surface: false,
            surface_array: None,
            materials: None,
        }
    }
}

impl LoadOptions {
    /// Returns the options with another format; `None` detects it.
    #[must_use]
    pub fn format(self, format: Option<Format>) -> Self {
        Self { format, ..self }
    }

    /// Returns the options with files outside the scene's folder allowed or not.
    #[must_use]
    pub fn allow_outside(self, allow_outside: bool) -> Self {
        Self { allow_outside, ..self }
    }

    /// Returns the options with the winding of faces reversed.
    #[must_use]
    pub fn flip(self, flip: Flip) -> Self {
        Self { flip, ..self }
    }

    /// Returns the options with another limit of exitances, in W·m⁻².
    #[must_use]
    pub fn max_exitance(self, max_exitance: f64) -> Self {
        Self { max_exitance, ..self }
    }

    /// Returns the options with another unit of the file's lengths.
    #[must_use]
    pub fn unit(self, unit: LengthUnit) -> Self {
        Self { unit, ..self }
    }

    /// Returns the options with another axis that points upwards.
    #[must_use]
    pub fn up_axis(self, up_axis: UpAxis) -> Self {
        Self { up_axis, ..self }
    }

    /// Returns the options with another distance, in m, up to which vertices become one.
    #[must_use]
    pub fn merge_tolerance(self, merge_tolerance: f64) -> Self {
        Self {
            merge_tolerance,
            ..self
        }
    }

    /// Returns the options with another crease angle between unnamed surfaces, in degrees.
    #[must_use]
    pub fn crease_angle(self, crease_angle: f64) -> Self {
        Self { crease_angle, ..self }
    }

    /// Returns the options with all faces in one surface or not.
    #[must_use]
    pub fn one_surface(self, one_surface: bool) -> Self {
        Self { one_surface, ..self }
    }

    /// Returns the options with another cell array whose values are surfaces.
    #[must_use]
    pub fn surface_array(self, surface_array: Option<String>) -> Self {
        Self { surface_array, ..self }
    }

    /// Returns the options with a file of reflectances and exitances.
    #[must_use]
    pub fn materials(self, materials: Option<PathBuf>) -> Self {
        Self { materials, ..self }
    }
}
