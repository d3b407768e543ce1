//! The settings of a result, by name, as documents and files of results have them.

use serde::Serialize;
use serde_json::{Map, Value};

use crate::mesh::{MeshOptions, Subdivision};
use crate::setting::Values;
use crate::solver::Start;
use crate::voxel::Form;

/// Whether form factors were made symmetric, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Balanced {
    /// `true`: each pair averaged with its reverse, rows rescaled symmetrically; `false`: no.
    Rescaled(bool),
    /// By the variances of the entries.
    ByVariance(VarianceRepair),
}

/// Repairs that weigh entries by their variances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum VarianceRepair {
    /// The defect of each row sum is spread over its entries by their variances.
    Closure,
    /// Each pair is averaged with its reverse; rows keep the sums that their rays count.
    Pooled,
}

/// The user's statement whether the scene is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum StatedClosure {
    /// No light leaves the scene.
    Closed,
    /// Light leaves the scene.
    Open,
}

/// The sun that was asked for, by its direction or by place and time.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SunRecord {
    /// The name of the table of where it stands at many times, without directory and ending.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// The direction towards the sun.
    pub sun: Option<[f64; 3]>,
    /// The place, in degrees north.
    pub latitude: Option<f64>,
    /// The place, in degrees east.
    pub longitude: Option<f64>,
    /// The time in RFC 3339.
    pub time: Option<String>,
    /// The direction of the scene that is north.
    pub north: [f64; 3],
    /// The irradiance of a plane that faces the sun, W·m⁻², of each channel.
    pub sun_irradiance: Option<[f64; 3]>,
    /// The angular radius, in degrees.
    pub sun_radius: Option<f64>,
}

macro_rules! settings {
    ($($(#[$doc:meta])* $name:ident: $kind:ty,)*) => {
        /// The settings of the steps that led to a result, each `None` where it plays no part.
        ///
        /// It holds no time, number of threads or path but those that a result is named by.
        #[derive(Clone, Debug, Default, PartialEq, Serialize)]
        #[cfg_attr(test, derive(schemars::JsonSchema))]
        pub struct Settings {
            $($(#[$doc])* #[serde(skip_serializing_if = "Option::is_none")] pub $name: Option<$kind>,)*
            /// The settings of the method and of the solver.
            #[serde(flatten)]
            #[cfg_attr(test, schemars(schema_with = "own"))]
            pub own: Values,
        }
    };
}

settings! {
    /// The tolerance of cells of voxels: the change of the irradiance from cell to cell, relative to its mean.
    adaptive: f64,
    /// Whether form factors were made symmetric, and how.
    balance: Balanced,
    /// False where a repair of the form factors did not restore the row sums.
    balance_converged: bool,
    /// Where the camera comes from.
    camera: String,
    /// The user's statement whether the scene is closed.
    closure: StatedClosure,
    /// The level of the largest cells of voxels: 2^level voxels wide.
    coarsest: u8,
    /// The angle between faces above which surfaces of scenes without names end, in degrees.
    crease_angle_degrees: f64,
    /// True if faces are cut at contact edges.
    cut_at_walls: bool,
    /// True if directions of voxels are weighed by exact solid angles.
    exact_solid_angles: bool,
    /// Surfaces whose faces are reversed; an empty name stands for all.
    flip: Vec<String>,
    /// The input of a propagation on voxels.
    form: Form,
    /// The tolerance of form factors, on A_i F_ij / min(A_i, A_j), where a solver has a tolerance too.
    form_factor_tolerance: f64,
    /// The format of the scene file, where it was given.
    format: String,
    /// The settings of form factors that were read from a file, as the file states them.
    form_factors: Map<String, Value>,
    /// The level of an experiment.
    level: u32,
    /// The names of the lightings.
    lightings: Vec<String>,
    /// The file of materials of the scene.
    materials: String,
    /// Edges are cut into parts of at most this length, m.
    max_edge_m: f64,
    /// Vertices nearer to each other are one, in m.
    merge_tolerance_m: f64,
    /// The most passes over the form factors.
    max_passes: u64,
    /// The form-factor method.
    method: String,
    /// The methods that are compared.
    methods: Vec<String>,
    /// True if form factors are computed again in every pass.
    on_the_fly: bool,
    /// True if the whole scene is one surface.
    one_surface: bool,
    /// The paper whose tables are reproduced.
    paper: String,
    /// Propagations of light on voxels.
    passes: u64,
    /// True if every voxel of an emitter sends its exitance, not scaled to the power of the emitter's true area.
    plain_emission: bool,
    /// The radius of the discrete sphere of directions, voxels.
    radius: u32,
    /// The (first) seed of all random numbers.
    seed: u64,
    /// Runs of every setting, each with a seed of its own.
    seeds: u64,
    /// True if a picture shows the voxels themselves.
    show_voxels: bool,
    /// The irradiance of the sky on an unoccluded plane that faces up, W·m⁻², of each channel.
    sky_irradiance: [f64; 3],
    /// The solver.
    solver: String,
    /// The first radiosities.
    start: Start,
    /// Every edge is cut into so many parts.
    subdivide: u32,
    /// The surface that a field of form factors is to.
    surface: String,
    /// The sun.
    sun: SunRecord,
    /// The array of cells that gives the surfaces.
    surface_array: String,
    /// The numbers of the tables that are reproduced.
    tables: Vec<u8>,
    /// The time that all may take, or that one run of an experiment may, s.
    time_limit_s: f64,
    /// The tolerance: of form factors where these are all that is wanted, else of the solver on sqrt(Σ A r² / Σ A E²), the worst channel.
    tolerance: f64,
    /// The unit of length of the file, in m.
    unit_m: f64,
    /// True if the weights of a voxel's directions are not divided by their sum.
    unnormalised: bool,
    /// The axis of the file that points up.
    up_axis: String,
    /// Whether occluders were looked at in a comparison: `on`, `off` or `both`.
    visibility: String,
    /// Voxels along the longest axis.
    voxels: u32,
}

/// Describes the settings that methods and solvers list.
#[cfg(test)]
fn own(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    use crate::setting::Kind;
    use crate::{form_factor, solver};

    let of_methods = form_factor::registry::settings();
    let mut properties = Map::new();
    for (setting, users) in of_methods.into_iter().chain(solver::registry::settings()) {
        let mut property = Map::new();
        property.insert("description".into(), format!("{}.", setting.described(&users)).into());
        match setting.kind {
            Kind::Flag => property.insert("type".into(), "boolean".into()),
            Kind::Count(_) => {
                property.insert("minimum".into(), 1.into());
                property.insert("type".into(), "integer".into())
            }
            Kind::Number => property.insert("type".into(), "number".into()),
            Kind::Choice(words) => property.insert("enum".into(), words.iter().map(|(word, _)| *word).collect()),
        };
        properties.entry(setting.name).or_insert(Value::Object(property));
    }
    schemars::json_schema!({ "type": "object", "properties": properties })
}

impl Settings {
    /// Records the subdivision of faces and the cuts at contact edges.
    pub fn note_mesh(&mut self, options: MeshOptions) {
        self.note_subdivision(options.subdivision);
        self.cut_at_walls = Some(options.cut_at_walls);
    }

    /// Records the subdivision of faces.
    pub fn note_subdivision(&mut self, subdivision: Subdivision) {
        match subdivision {
            Subdivision::Uniform(n) => self.subdivide = Some(n),
            Subdivision::MaxEdge(length) => self.max_edge_m = Some(length),
        }
    }

    /// Returns the settings by name, for files of results.
    ///
    /// # Panics
    /// Never: all names are text.
    #[must_use]
    pub fn record(&self) -> Map<String, Value> {
        match serde_json::to_value(self) {
            Ok(Value::Object(record)) => record,
            other => unreachable!("settings are an object: {other:?}"),
        }
    }
}
