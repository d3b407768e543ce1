//! Settings that warnings and refusals name as remedies.

/// A setting that remedies name; a program says how its users write it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Parameter {
    /// [`LoadOptions::flip`](crate::scene::LoadOptions::flip).
    Flip,
    /// [`MeshOptions::cut_at_walls`](crate::mesh::MeshOptions::cut_at_walls).
    CutAtWalls,
    /// [`Subdivision::Uniform`](crate::mesh::Subdivision::Uniform).
    Subdivide,
    /// [`MethodSettings::tolerance`](crate::form_factor::MethodSettings::tolerance), where form factors are all that is wanted.
    Tolerance,
    /// The same, where a solver has a tolerance too.
    FormFactorTolerance,
    /// The tolerance of the solver.
    SolverTolerance,
    /// [`MethodSettings::budget`](crate::form_factor::MethodSettings::budget).
    Budget,
    /// The method of the form factors.
    Method,
    /// The solver.
    Solver,
    /// [`FormFactorRequest::balance`](super::FormFactorRequest::balance).
    Balance,
    /// [`FormFactorRequest::closure`](super::FormFactorRequest::closure).
    Closed,
    /// [`Memory::limit_byte`](super::Memory::limit_byte).
    MemoryLimit,
    /// [`Memory::storage`](super::Memory::storage).
    Storage,
    /// [`Memory::precision`](super::Memory::precision).
    Precision,
    /// Form factors that are computed in every pass.
    OnTheFly,
    /// [`FormFactorRequest::time_limit`](super::FormFactorRequest::time_limit).
    TimeLimit,
    /// The number of threads.
    Threads,
    /// [`VoxelRequest::n_voxels`](super::VoxelRequest::n_voxels).
    Voxels,
    /// [`VoxelRequest::links`](super::VoxelRequest::links).
    Links,
    /// The number of propagations.
    Passes,
    /// [`GatherSettings::max_rays`](crate::render::GatherSettings::max_rays).
    GatherRays,
    /// [`GatherSettings::noise`](crate::render::GatherSettings::noise).
    Noise,
    /// Where the camera stands.
    Eye,
    /// Where the camera looks.
    LookAt,
}

impl Parameter {
    /// Returns its name, in snake case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Flip => "flip",
            Self::CutAtWalls => "cut_at_walls",
            Self::Subdivide => "subdivide",
            Self::Tolerance | Self::SolverTolerance => "tolerance",
            Self::FormFactorTolerance => "form_factor_tolerance",
            Self::Budget => "budget",
            Self::Method => "method",
            Self::Solver => "solver",
            Self::Balance => "balance",
            Self::Closed => "closed",
            Self::MemoryLimit => "memory_limit",
            Self::Storage => "storage",
            Self::Precision => "precision",
            Self::OnTheFly => "on_the_fly",
            Self::TimeLimit => "time_limit",
            Self::Threads => "threads",
            Self::Voxels => "voxels",
            Self::Links => "links",
            Self::Passes => "passes",
            Self::GatherRays => "gather_rays",
            Self::Noise => "noise",
            Self::Eye => "eye",
            Self::LookAt => "look_at",
        }
    }
}

/// Returns how the users of a program write a parameter, with its value if there is one.
pub type Named<'a> = &'a dyn Fn(Parameter, Option<&str>) -> String;

/// Returns a parameter as [`Display`](fmt::Display) writes it: its name, and `name=value`.
pub(super) fn plainly(parameter: Parameter, value: Option<&str>) -> String {
    let name = parameter.name();
    value.map_or_else(|| name.to_owned(), |value| format!("{name}={value}"))
}
