//! The solvers by name: one line each.

use std::num::NonZeroUsize;
use std::sync::Arc;

use super::anderson::Anderson;
use super::auto::Auto;
use super::cg::ConjugateGradients;
use super::chebyshev::{Chebyshev, SpectrumBounds};
use super::deflation::Deflate;
use super::direct::Direct;
use super::error::SolverError;
use super::gauss_seidel::GaussSeidel;
use super::gauss_seidel_ambient::GaussSeidelAmbient;
use super::gmres::Gmres;
use super::jacobi::Jacobi;
use super::multigrid::Multigrid;
use super::overshooting::Overshooting;
use super::pcg::Pcg;
use super::progressive_refinement::ProgressiveRefinement;
use super::solve::Solver;
use super::sor::Sor;
use crate::mesh::Hierarchy;
use crate::parameter::Parameter;

/// What a user may set; `None` is the solver's own default.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SolverSettings {
    /// The relaxation factor ω of `sor`.
    pub omega: Option<f64>,
    /// Where `chebyshev` takes the interval of the eigenvalues from.
    pub bounds: Option<SpectrumBounds>,
    /// Steps that count as one pass where patches shoot one by one.
    pub steps_per_pass: Option<NonZeroUsize>,
    /// Whether [`Solution::display`](super::Solution::display) is wanted; solvers that have it give it always.
    pub display: bool,
    /// The levels of the mesh, for solvers that use coarser ones.
    pub hierarchy: Option<Arc<Hierarchy>>,
    /// Passes between restarts, of `gmres`.
    pub restart: Option<NonZeroUsize>,
    /// Whether `pcg` and `gmres` deflate the even light of each room.
    pub deflation: Option<Deflate>,
    /// Steps that `anderson` remembers.
    pub depth: Option<NonZeroUsize>,
    /// The most memory that factorisations may take, in bytes.
    pub memory_limit_byte: Option<u64>,
}

/// A setting that some solvers use and others do not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// [`SolverSettings::omega`].
    Omega,
    /// [`SolverSettings::bounds`].
    Bounds,
    /// [`SolverSettings::steps_per_pass`].
    StepsPerPass,
    /// [`SolverSettings::display`].
    Display,
    /// [`SolverSettings::restart`].
    Restart,
    /// [`SolverSettings::deflation`].
    Deflation,
    /// [`SolverSettings::depth`].
    Depth,
    /// [`SolverSettings::memory_limit_byte`].
    MemoryLimit,
}

impl Setting {
    /// All settings.
    const ALL: [Self; 8] = [
        Self::Omega,
        Self::Bounds,
        Self::StepsPerPass,
        Self::Display,
        Self::Restart,
        Self::Deflation,
        Self::Depth,
        Self::MemoryLimit,
    ];

    /// Returns its name.
    #[must_use]
    pub fn parameter(self) -> Parameter {
        match self {
            Self::Omega => Parameter::Omega,
            Self::Bounds => Parameter::Bounds,
            Self::StepsPerPass => Parameter::StepsPerPass,
            Self::Display => Parameter::DisplayAmbient,
            Self::Restart => Parameter::Restart,
            Self::Deflation => Parameter::Deflation,
            Self::Depth => Parameter::Depth,
            Self::MemoryLimit => Parameter::MemoryLimit,
        }
    }

    fn is_given(self, settings: &SolverSettings) -> bool {
        match self {
            Self::Omega => settings.omega.is_some(),
            Self::Bounds => settings.bounds.is_some(),
            Self::StepsPerPass => settings.steps_per_pass.is_some(),
            Self::Display => settings.display,
            Self::Restart => settings.restart.is_some(),
            Self::Deflation => settings.deflation.is_some(),
            Self::Depth => settings.depth.is_some(),
            Self::MemoryLimit => settings.memory_limit_byte.is_some(),
        }
    }
}

/// A solver as the registry knows it.
#[derive(Debug)]
pub struct SolverEntry {
    /// The name on the command line.
    pub name: &'static str,
    /// What it does, in a few words.
    pub summary: &'static str,
    /// Whether it needs symmetric exchange areas A_i F_ij.
    pub needs_reciprocity: bool,
    /// The settings that it uses.
    pub settings: &'static [Setting],
    make: fn(&SolverSettings) -> Box<dyn Solver>,
}

/// All solvers, in the order in which help lists them.
#[rustfmt::skip]
pub const SOLVERS: &[SolverEntry] = &[
    SolverEntry { name: "auto", summary: "Whichever of the others suits the system; says which, and why", needs_reciprocity: false, settings: &[Setting::Restart, Setting::Deflation, Setting::MemoryLimit], make: |s| Box::new(auto(s)) },
    SolverEntry { name: "jacobi", summary: "Every patch gathers from the radiosities of the pass before", needs_reciprocity: false, settings: &[], make: |_| Box::new(Jacobi) },
    SolverEntry { name: "gauss-seidel", summary: "Every patch in turn gathers from the newest radiosities", needs_reciprocity: false, settings: &[], make: |_| Box::new(GaussSeidel) },
    SolverEntry { name: "sor", summary: "Gauss-Seidel with overrelaxation", needs_reciprocity: false, settings: &[Setting::Omega], make: |s| Box::new(Sor { omega: s.omega }) },
    SolverEntry { name: "gauss-seidel-ambient", summary: "Gauss-Seidel with the total light of each room put right after every sweep", needs_reciprocity: false, settings: &[], make: |_| Box::new(GaussSeidelAmbient) },
    SolverEntry { name: "progressive-refinement", summary: "The patch with the most unshot power shoots first", needs_reciprocity: false, settings: &[Setting::StepsPerPass, Setting::Display], make: |s| Box::new(ProgressiveRefinement { steps_per_pass: s.steps_per_pass }) },
    SolverEntry { name: "overshooting", summary: "Patches shoot what they have and what will come back (Feda)", needs_reciprocity: false, settings: &[Setting::StepsPerPass, Setting::Display], make: |s| Box::new(Overshooting { steps_per_pass: s.steps_per_pass }) },
    SolverEntry { name: "chebyshev", summary: "The best polynomial for an interval that holds the spectrum", needs_reciprocity: false, settings: &[Setting::Bounds], make: |s| Box::new(Chebyshev { bounds: s.bounds.unwrap_or_default() }) },
    SolverEntry { name: "cg", summary: "Conjugate gradients on V G, V = A/ρ, as in the paper", needs_reciprocity: true, settings: &[], make: |_| Box::new(ConjugateGradients) },
    SolverEntry { name: "pcg", summary: "Conjugate gradients preconditioned with V⁻¹ = ρ/A, deflated where that pays", needs_reciprocity: true, settings: &[Setting::Deflation], make: |s| Box::new(pcg(s)) },
    SolverEntry { name: "gmres", summary: "The least residual over a Krylov space; for form factors without symmetry", needs_reciprocity: false, settings: &[Setting::Restart, Setting::Deflation], make: |s| Box::new(gmres(s)) },
    SolverEntry { name: "anderson", summary: "Jacobi iteration with Anderson acceleration", needs_reciprocity: false, settings: &[Setting::Depth], make: |s| Box::new(s.depth.map_or_else(Anderson::default, |depth| Anderson { depth })) },
    SolverEntry { name: "direct", summary: "Dense factorisation; for many lightings, and as the oracle", needs_reciprocity: false, settings: &[Setting::MemoryLimit], make: |s| Box::new(direct(s)) },
    SolverEntry { name: "multigrid", summary: "Gauss-Seidel, corrected on ever coarser levels of the mesh", needs_reciprocity: false, settings: &[], make: |s| Box::new(Multigrid { hierarchy: s.hierarchy.clone(), ..Multigrid::default() }) },
];

fn pcg(settings: &SolverSettings) -> Pcg {
    Pcg {
        deflation: settings.deflation.unwrap_or_default(),
    }
}

fn gmres(settings: &SolverSettings) -> Gmres {
    Gmres {
        restart: settings.restart.unwrap_or(Gmres::default().restart),
        deflation: settings.deflation.unwrap_or_default(),
    }
}

fn direct(settings: &SolverSettings) -> Direct {
    let limit = settings.memory_limit_byte;
    limit.map_or_else(Direct::default, |memory_limit_byte| Direct { memory_limit_byte })
}

fn auto(settings: &SolverSettings) -> Auto {
    Auto {
        pcg: pcg(settings),
        gmres: gmres(settings),
        direct: direct(settings),
    }
}

/// Returns the solver of a name with the given settings.
///
/// # Errors
/// [`SolverError::UnknownSolver`], or [`SolverError::UnusedSetting`] if a setting is given that the solver has no use for.
pub fn solver(name: &str, settings: &SolverSettings) -> Result<Box<dyn Solver>, SolverError> {
    by_name(name)?.checked(settings)
}

/// Returns the entry of a name.
///
/// # Errors
/// [`SolverError::UnknownSolver`].
pub fn by_name(name: &str) -> Result<&'static SolverEntry, SolverError> {
    SOLVERS
        .iter()
        .find(|entry| entry.name == name)
        .ok_or_else(|| SolverError::UnknownSolver {
            name: name.to_owned(),
            known: joined(SOLVERS),
        })
}

fn joined<'a>(entries: impl IntoIterator<Item = &'a SolverEntry>) -> String {
    let quoted: Vec<String> = entries.into_iter().map(|s| format!("`{}`", s.name)).collect();
    quoted.join(", ")
}

impl SolverEntry {
    /// Tells whether the solver uses [`SolverSettings::hierarchy`].
    #[must_use]
    pub fn uses_hierarchy(&self) -> bool {
        self.name == "multigrid"
    }

    /// Returns the solver with the given settings.
    ///
    /// # Errors
    /// [`SolverError::UnusedSetting`] if a setting is given that the solver has no use for.
    pub fn checked(&self, settings: &SolverSettings) -> Result<Box<dyn Solver>, SolverError> {
        let unused = |s: &&Setting| s.is_given(settings) && !self.settings.contains(s);
        if let Some(unused) = Setting::ALL.iter().find(unused) {
            let users = SOLVERS.iter().filter(|solver| solver.settings.contains(unused));
            return Err(SolverError::UnusedSetting {
                parameter: unused.parameter(),
                solver: self.name,
                used_by: joined(users),
            });
        }
        Ok(self.build(settings))
    }

    /// Tells whether it needs symmetric exchange areas with these settings, or is better off with them.
    #[must_use]
    pub fn gains_by_reciprocity(&self, settings: &SolverSettings) -> bool {
        // Lanczos steps find the spectrum of a symmetric matrix.
        let measures_spectrum =
            self.settings.contains(&Setting::Bounds) && matches!(settings.bounds, Some(SpectrumBounds::Lanczos(_)));
        self.needs_reciprocity || self.name == "auto" || measures_spectrum
    }

    /// Returns the solver with the given settings; those that it has no use for are passed over.
    #[must_use]
    pub fn build(&self, settings: &SolverSettings) -> Box<dyn Solver> {
        (self.make)(settings)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn every_name_makes_its_solver() {
        for entry in SOLVERS {
            assert_eq!(entry.build(&SolverSettings::default()).name(), entry.name);
        }
        let error = solver("magic", &SolverSettings::default()).err().unwrap().to_string();
        assert!(error.contains("`magic`") && error.contains("`pcg`"), "{error}");
    }

    #[test]
    fn settings_that_do_nothing_are_refused() {
        let settings = SolverSettings {
            depth: NonZeroUsize::new(3),
            ..SolverSettings::default()
        };
        let error = solver("pcg", &settings).err().unwrap();
        let expected = SolverError::UnusedSetting {
            parameter: Parameter::Depth,
            solver: "pcg",
            used_by: "`anderson`".to_owned(),
        };
        assert_eq!(error, expected);
        assert!(solver("anderson", &settings).is_ok());
    }
}
