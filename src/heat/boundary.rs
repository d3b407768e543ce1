//! Boundary conditions of a scene: the properties of surfaces, their thermal conditions, and the surroundings with sun and sky.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::boundary_file::BoundaryFile;
use super::error::HeatError;
use crate::printable::counted;
use crate::scene::toml_file::TomlFile;
use crate::scene::{Scene, SceneError, SceneErrorKind};

/// The greatest temperature, K: its fourth power leaves a margin in the range of f64.
pub const MAX_TEMPERATURE_K: f64 = 1e30;

/// The greatest heat flux and irradiance, W·m⁻²; for the heat of a node, W.
pub const MAX_FLUX: f64 = 1e100;

/// The least emissivity: below it 1 − ε keeps fewer than six digits of ε, and the rounding of form factors' row sums exceeds 1e-6 of what a closed scene absorbs.
///
/// Solvers aim at this by default; at 1e-14 they find temperatures that are wrong by tens of kelvin, and at 1e-15 none.
pub const MIN_EMISSIVITY: f64 = 1e-10;

/// The surroundings of a scene, its sun and sky, and the boundary condition of each surface.
///
/// ```toml
/// [surroundings]              # black: receive what escapes
/// temperature_k = 3.0         # default 0
/// [sun]
/// direction = [0.0, -0.985, 0.174]   # towards the sun, of any length
/// irradiance_w_m2 = 1361.0           # on a plane that faces it
/// angular_radius_deg = 0.0           # above 0: a disc with a penumbra
/// [sky]                       # uniform over the hemisphere about `up`, solar band
/// irradiance_w_m2 = 100.0     # on an unoccluded plane that faces up
/// up = [0.0, 0.0, 1.0]        # below the horizon there are only the surroundings
/// [[surface]]
/// name = "crater"             # an exact name counts before a pattern with *
/// emissivity = 0.95           # thermal band, in [1e-10, 1]
/// absorptance = 0.88          # solar band, in [0, 1]; default: the emissivity
/// temperature_k = 300.0       # or supplied_w_m2 | adiabatic = true | node = "NAME" | other_side = "NAME"
///                             # a number may be a list of one for each patch of the surface, or of the scene
/// [[node]]                    # the surfaces of a node have one unknown temperature
/// name = "radiator"
/// supplied_w = 40.0           # heat that is supplied to the node as a whole; default 0
/// ```
///
/// If several entries match a surface, a later one replaces single keys of an earlier one, and its condition replaces the earlier condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Boundary {
    /// The name in messages: its file.
    pub file: PathBuf,
    /// The temperature of the surroundings, K.
    pub surroundings_k: f64,
    /// The sun, if it shines.
    pub sun: Option<Sun>,
    /// The sky, if it shines.
    pub sky: Option<Sky>,
    /// The boundary condition of each surface of the scene, in its order; `None` for a surface without faces.
    pub surfaces: Vec<Option<SurfaceBoundary>>,
    /// Values of single patches, in place of those of their surfaces, in the same order; empty if there are none.
    pub patch_values: Vec<PatchValues>,
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The lines of the file that set the values of each surface, in the same order; empty without a file.
    pub lines: Vec<SurfaceLines>,
}

/// The lines of a file that set the values of a surface, from 1; 0 where none does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceLines {
    /// The line of ε.
    pub emissivity: u32,
    /// The line of α, or of ε where α is not given.
    pub absorptance: u32,
    /// The line of the condition.
    pub condition: u32,
}

/// Parallel light, or light of a uniform disc, in the solar band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    pub(super) direction: DVec3,
    pub(super) irradiance: f64,
    pub(super) angular_radius_deg: f64,
}

/// Uniform light from the hemisphere about a direction, in the solar band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    irradiance: f64,
    up: DVec3,
}

/// The properties of a surface and its boundary condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceBoundary {
    /// ε, the emissivity and absorptance of the thermal band, in \[[`MIN_EMISSIVITY`], 1\].
    pub emissivity: f64,
    /// α, the absorptance of the solar band, in \[0, 1\].
    pub absorptance: f64,
    /// Its boundary condition.
    pub condition: Condition,
}

/// Values of the single patches of a surface, in the order of the mesh; empty where all patches have that of the surface.
///
/// Each list has one value for each patch of the surface, or of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchValues {
    /// ε, in \[[`MIN_EMISSIVITY`], 1\].
    pub emissivity: Vec<f64>,
    /// α, in \[0, 1\].
    pub absorptance: Vec<f64>,
    /// The numbers of the surface's condition: temperatures, K, or supplied heats, W·m⁻².
    pub condition: Vec<f64>,
}

/// The index of a patch among those of its surface and among those of the scene, each with the number of these.
#[derive(Clone, Copy, Debug)]
pub(super) struct PatchPlace {
    pub(super) in_surface: (usize, usize),
    pub(super) in_scene: (usize, usize),
}

impl PatchPlace {
    /// Returns the value of the patch; `None` where all patches of the surface share one.
    fn pick(self, key: &'static str, values: &[f64]) -> Result<Option<f64>, OutOfRange> {
        let ((k, n_own), (i, n)) = (self.in_surface, self.in_scene);
        match values.len() {
            0 => Ok(None),
            length if length == n_own => Ok(Some(values[k])),
            length if length == n => Ok(Some(values[i])),
            length => Err((
                key,
                format!(
                    "{length} values, where the surface has {} and the scene {n}; give one for each",
                    counted(n_own, "patch")
                ),
            )),
        }
    }
}

/// The thermal boundary condition of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Condition {
    /// A given temperature, K.
    Temperature(f64),
    /// A given heat supply of each patch, W·m⁻²; 0 is adiabatic.
    Supplied(f64),
    /// Membership of the node of this number, whose surfaces share one temperature.
    Node(usize),
    /// One side of a sheet whose other side is the surface of this number: coincident patches have one temperature.
    OtherSide(usize),
}

/// Surfaces that share one unknown temperature.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// The heat that is supplied to it as a whole, W.
    pub supplied_w: f64,
}

/// Returns an error of boundary conditions.
const BAD: fn(String) -> SceneErrorKind = |message| SceneErrorKind::BadBoundary { message };

/// A value out of its range: its key, and the fault.
pub(super) type OutOfRange = (&'static str, String);

impl Sun {
    /// Returns a sun in a `direction` of any length, with its `irradiance` on a plane that faces it, W·m⁻².
    ///
    /// The disc has the given angular radius; a radius of 0 is a point.
    ///
    /// # Errors
    /// The key and the fault: a direction that is zero or not finite, an irradiance that is negative or above [`MAX_FLUX`], a radius outside \[0, 45\] degrees.
    pub fn new(direction: DVec3, irradiance: f64, angular_radius_deg: f64) -> Result<Self, (&'static str, String)> {
        let direction = unit("direction", direction)?;
        expect_light(irradiance)?;
        if !(0.0..=45.0).contains(&angular_radius_deg) {
            let message = format!("{angular_radius_deg} is outside [0, 45]; correct it");
            return Err(("angular_radius_deg", message));
        }
        Ok(Self {
            direction,
            irradiance,
            angular_radius_deg,
        })
    }

    /// Returns the unit vector towards the sun.
    #[must_use]
    pub fn direction(&self) -> DVec3 {
        self.direction
    }

    /// Returns the irradiance of a plane that faces the sun, W·m⁻².
    #[must_use]
    pub fn irradiance(&self) -> f64 {
        self.irradiance
    }

    /// Returns the angular radius of the disc, degrees.
    #[must_use]
    pub fn angular_radius_deg(&self) -> f64 {
        self.angular_radius_deg
    }
}

impl Sky {
    /// Returns a sky with its `irradiance` on an unoccluded plane that faces `up`, W·m⁻².
    ///
    /// # Errors
    /// The key and the fault, as for [`Sun::new`].
    pub fn new(irradiance: f64, up: DVec3) -> Result<Self, (&'static str, String)> {
        let up = unit("up", up)?;
        expect_light(irradiance)?;
        Ok(Self { irradiance, up })
    }

    /// Returns the irradiance of an unoccluded plane that faces up, W·m⁻².
    #[must_use]
    pub fn irradiance(&self) -> f64 {
        self.irradiance
    }

    /// Returns the unit vector upwards.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.up
    }
}

fn unit(key: &'static str, direction: DVec3) -> Result<DVec3, OutOfRange> {
    let largest = direction.abs().max_element();
    // The division keeps squares within the range of f64.
    let scaled = (direction / largest).try_normalize().filter(|_| largest.is_finite());
    scaled.ok_or_else(|| (key, "zero or not finite; correct it".to_owned()))
}

fn expect_light(irradiance: f64) -> Result<(), OutOfRange> {
    if (0.0..=MAX_FLUX).contains(&irradiance) {
        return Ok(());
    }
    let message = format!("{irradiance:?} is outside [0, {MAX_FLUX:.0e}]; correct it");
    Err(("irradiance_w_m2", message))
}

/// Refuses a temperature, K, that is negative, NaN or too great.
pub(super) fn expect_temperature(kelvin: f64) -> Result<(), OutOfRange> {
    let wrong = match kelvin {
        t if t < 0.0 => "is negative; give kelvin",
        t if t <= MAX_TEMPERATURE_K => return Ok(()),
        _ => "is above 1e30 K or no number; correct it",
    };
    Err(("temperature_k", format!("{kelvin:?} {wrong}")))
}

/// Refuses a heat, W or W·m⁻², that is NaN or too great.
pub(super) fn expect_heat(key: &'static str, heat: f64) -> Result<(), OutOfRange> {
    if heat.abs() <= MAX_FLUX {
        return Ok(());
    }
    Err((
        key,
        format!("{heat:?} is above {MAX_FLUX:.0e} or no number; correct it"),
    ))
}

impl SurfaceBoundary {
    /// Returns the boundary condition with another emissivity.
    pub(super) fn with_emissivity(self, emissivity: f64) -> Self {
        Self { emissivity, ..self }
    }

    /// Returns the boundary condition with another absorptance.
    pub(super) fn with_absorptance(self, absorptance: f64) -> Self {
        Self { absorptance, ..self }
    }

    /// Returns the boundary condition with another value; nodes and sheets have none.
    pub(super) fn with_condition(self, value: f64) -> Self {
        let condition = match self.condition {
            Condition::Temperature(_) => Condition::Temperature(value),
            Condition::Supplied(_) => Condition::Supplied(value),
            other => other,
        };
        Self { condition, ..self }
    }

    /// Refuses values out of range.
    pub(super) fn checked(self) -> Result<Self, OutOfRange> {
        let Self {
            emissivity,
            absorptance,
            condition,
        } = self;
        if !(emissivity > 0.0 && emissivity <= 1.0) {
            return Err(("emissivity", format!("{emissivity:?} is outside (0, 1]; correct it")));
        }
        if emissivity < MIN_EMISSIVITY {
            let message = format!(
                "{emissivity:?} is below {MIN_EMISSIVITY:e}, where 1 - ε loses the digits of ε; give a greater one"
            );
            return Err(("emissivity", message));
        }
        if !(0.0..=1.0).contains(&absorptance) {
            return Err(("absorptance", format!("{absorptance:?} is outside [0, 1]; correct it")));
        }
        match condition {
            Condition::Temperature(kelvin) => expect_temperature(kelvin)?,
            Condition::Supplied(flux) => expect_heat("supplied_w_m2", flux)?,
            Condition::Node(_) | Condition::OtherSide(_) => {}
        }
        Ok(self)
    }
}

impl Boundary {
    /// Returns the boundary condition of a patch of a surface.
    ///
    /// # Errors
    /// Values out of range, or lists of a wrong length.
    pub(super) fn of_patch(&self, surface: usize, place: PatchPlace) -> Result<Option<SurfaceBoundary>, OutOfRange> {
        let Some(mut own) = self.surfaces[surface] else {
            return Ok(None);
        };
        let Some(values) = self.patch_values.get(surface) else {
            return Ok(Some(own));
        };
        let key = match own.condition {
            Condition::Supplied(_) => "supplied_w_m2",
            _ => "temperature_k",
        };
        if let Some(value) = place.pick("emissivity", &values.emissivity)? {
            own = own.with_emissivity(value);
        }
        if let Some(value) = place.pick("absorptance", &values.absorptance)? {
            own = own.with_absorptance(value);
        }
        if let Some(value) = place.pick(key, &values.condition)? {
            own = own.with_condition(value);
        }
        own.checked().map(Some)
    }

    /// Returns the line of the file that an error concerns, if known.
    pub(crate) fn line_of(&self, error: &HeatError, scene: &Scene) -> Option<u32> {
        let (name, key) = error.place()?;
        let k = scene.surfaces.iter().position(|surface| surface.name == name)?;
        let lines = self.lines.get(k)?;
        let line = match key {
            "emissivity" => lines.emissivity,
            "absorptance" => lines.absorptance,
            _ => lines.condition,
        };
        (line > 0).then_some(line)
    }

    /// Returns whether patches of a surface have conditions of their own.
    pub(super) fn has_patch_conditions(&self, surface: usize) -> bool {
        let values = self.patch_values.get(surface);
        values.is_some_and(|values| !values.condition.is_empty())
    }

    /// Reads the boundary conditions of a scene from a TOML file.
    ///
    /// # Errors
    /// A file that cannot be read; [`BadBoundary`](crate::scene::SceneErrorKind::BadBoundary), with the line, for text that is no such TOML, a value out of its range, two conditions in one entry, a
    /// surface without a condition or an emissivity, and names that match nothing.
    pub fn load(file: impl AsRef<Path>, scene: &Scene) -> Result<Self, SceneError> {
        let file = file.as_ref();
        Self::of(&TomlFile::read(file, BAD)?, file, scene)
    }

    /// Reads the boundary conditions of a scene from a text in TOML; messages call it `name`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(text: String, name: impl Into<PathBuf>, scene: &Scene) -> Result<Self, SceneError> {
        let name = name.into();
        Self::of(&TomlFile::of_text(name.clone(), text, BAD), &name, scene)
    }

    /// Reads the boundary conditions of a scene from named parts of a text in TOML; `name` is that of the whole.
    ///
    /// # Errors
    /// As [`load`](Self::load), with the name of the part in place of the line.
    pub fn parse_parts(
        parts: impl IntoIterator<Item = (PathBuf, String)>,
        name: impl Into<PathBuf>,
        scene: &Scene,
    ) -> Result<Self, SceneError> {
        let name = name.into();
        Self::of(&TomlFile::of_parts(name.clone(), parts, BAD), &name, scene)
    }

    fn of(text: &TomlFile, name: &Path, scene: &Scene) -> Result<Self, SceneError> {
        let parsed: BoundaryFile = text.parsed("boundary")?;
        parsed.resolved(name, text, scene)
    }
}
