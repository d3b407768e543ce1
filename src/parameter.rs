//! Settings that warnings and errors name as remedies.

use crate::setting::Setting;

/// A setting that remedies name; a program supplies the syntax of its users.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
#[non_exhaustive]
pub enum Parameter {
    /// [`LoadOptions::flip`](crate::scene::LoadOptions::flip).
    Flip,
    /// [`MeshOptions::cut_at_walls`](crate::mesh::MeshOptions::cut_at_walls).
    CutAtWalls,
    /// The tolerance [`TOLERANCE`](crate::form_factor::TOLERANCE), in a run for form factors alone.
    Tolerance,
    /// The same, if a solver has a tolerance too.
    FormFactorTolerance,
    /// The tolerance of the solver.
    #[strum(serialize = "tolerance")]
    SolverTolerance,
    /// [`BUDGET`](crate::form_factor::BUDGET).
    Budget,
    /// The method of the form factors.
    Method,
    /// The solver.
    Solver,
    /// [`FormFactorRequest::balance`](crate::workflow::FormFactorRequest::balance).
    Balance,
    /// [`FormFactorRequest::closure`](crate::workflow::FormFactorRequest::closure).
    Closed,
    /// [`Memory::limit_byte`](crate::workflow::Memory::limit_byte).
    MemoryLimit,
    /// [`Memory::storage`](crate::workflow::Memory::storage).
    Storage,
    /// [`Memory::precision`](crate::workflow::Memory::precision).
    Precision,
    /// Form factors that are recomputed in every pass.
    OnTheFly,
    /// [`FormFactorRequest::time_limit`](crate::workflow::FormFactorRequest::time_limit).
    TimeLimit,
    /// The number of threads.
    Threads,
    /// [`VoxelRequest::n_voxels`](crate::workflow::VoxelRequest::n_voxels).
    Voxels,
    /// [`VoxelRequest::links`](crate::workflow::VoxelRequest::links).
    Links,
    /// The number of propagations.
    Passes,
    /// [`GatherSettings::max_rays`](crate::render::GatherSettings::max_rays).
    GatherRays,
    /// [`GatherSettings::noise`](crate::render::GatherSettings::noise).
    Noise,
    /// The position of the camera.
    Eye,
    /// The point at which the camera looks.
    LookAt,
    /// The direction that is up in the image.
    Up,
    /// The vertical field of view.
    Fov,
    /// The camera.
    Camera,
    /// The width of an image.
    Width,
    /// The height of an image.
    Height,
    /// The viewer that shows an image while it is rendered.
    Display,
    /// [`Subdivision::Uniform`](crate::mesh::Subdivision::Uniform).
    Subdivide,
    /// [`Subdivision::MaxEdge`](crate::mesh::Subdivision::MaxEdge).
    MaxEdge,
    /// [`LoadOptions::allow_outside`](crate::scene::LoadOptions::allow_outside).
    AllowOutside,
    /// [`Memory::scratch`](crate::workflow::Memory::scratch).
    Scratch,
    /// The file of the result.
    Output,
    /// The direction of the scene that is north, for a sun that is given by a place on Earth.
    North,
    /// The angular radius of the sun, in degrees.
    AngularRadius,
    /// The option of complete long tables.
    Full,
    /// A setting of methods or solvers.
    Of(&'static Setting),
}

impl Parameter {
    /// Returns its name, in snake case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Of(setting) => setting.name,
            own => own.into(),
        }
    }
}

/// Formats a parameter in the syntax of a program's users, with its value if there is one.
pub type Named<'a> = &'a dyn Fn(Parameter, Option<&str>) -> String;

/// Returns a parameter as [`Display`](fmt::Display) writes it: its name, and `name=value`.
pub(crate) fn plainly(parameter: Parameter, value: Option<&str>) -> String {
    let name = parameter.name();
    value.map_or_else(|| name.to_owned(), |value| format!("{name}={value}"))
}
