//! The solvers by name: one line each.

pub use super::entry::{SolverEntry, Symmetry};
use super::error::SolverError;
use super::settings::SolverSettings;
use super::solve::Solver;
use super::{
    anderson, auto, cg, chebyshev, direct, gauss_seidel, gauss_seidel_ambient, gmres, jacobi, multigrid, overshooting,
    pcg, progressive_refinement, sor,
};
use crate::parameter::Parameter;
use crate::setting::{Setting, Use, ticked};

/// All solvers, in the order in which help lists them.
pub const SOLVERS: &[&SolverEntry] = &[
    &auto::ENTRY,
    &jacobi::ENTRY,
    &gauss_seidel::ENTRY,
    &sor::ENTRY,
    &gauss_seidel_ambient::ENTRY,
    &progressive_refinement::ENTRY,
    &overshooting::ENTRY,
    &chebyshev::ENTRY,
    &cg::ENTRY,
    &pcg::ENTRY,
    &gmres::ENTRY,
    &anderson::ENTRY,
    &direct::ENTRY,
    &multigrid::ENTRY,
];

/// Returns the solver of a name with the given settings.
///
/// # Errors
/// [`SolverError::UnknownSolver`], or [`SolverError::UnusedSetting`] if a setting is given that the solver does not use.
pub fn solver(name: &str, settings: &SolverSettings) -> Result<Box<dyn Solver>, SolverError> {
    by_name(name)?.checked(settings)
}

/// Returns the entry of a name.
///
/// # Errors
/// [`SolverError::UnknownSolver`].
pub fn by_name(name: &str) -> Result<&'static SolverEntry, SolverError> {
    let found = SOLVERS.iter().find(|entry| entry.name == name).copied();
    found.ok_or_else(|| SolverError::UnknownSolver {
        name: name.to_owned(),
        known: ticked(SOLVERS.iter().map(|solver| solver.name)),
    })
}

/// Returns the settings that solvers have, each once, with the names and uses of those that use it.
#[must_use]
pub fn settings() -> Vec<(&'static Setting, Vec<(&'static str, Use)>)> {
    crate::setting::gathered(SOLVERS.iter().map(|solver| (solver.name, solver.settings)))
}

impl SolverEntry {
    /// Returns the solver with the given settings.
    ///
    /// # Errors
    /// [`SolverError::UnusedSetting`] if a setting is given that the solver does not use.
    pub fn checked(&self, settings: &SolverSettings) -> Result<Box<dyn Solver>, SolverError> {
        if let Some(unused) = settings.values.unused(self.settings) {
            let uses = |solver: &&SolverEntry| solver.settings.iter().any(|used| used.setting.name == unused.name);
            return Err(SolverError::UnusedSetting {
                parameter: Parameter::Of(unused),
                solver: self.name,
                used_by: ticked(SOLVERS.iter().copied().filter(uses).map(|solver| solver.name)),
            });
        }
        Ok(self.build(settings))
    }

    /// Returns whether it needs symmetric exchange areas, unless settings change that.
    #[must_use]
    pub fn needs_reciprocity(&self) -> bool {
        (self.symmetry)(&SolverSettings::default()) == Symmetry::Needed
    }

    /// Returns the solver with the given settings; those that it does not use are ignored.
    ///
    /// # Panics
    /// If a setting that the solver needs is missing.
    #[must_use]
    pub fn build(&self, settings: &SolverSettings) -> Box<dyn Solver> {
        let resolved = SolverSettings {
            values: settings.values.resolved(self.settings),
            ..settings.clone()
        };
        (self.make)(&resolved).unwrap_or_else(|| panic!("`{}` reads a setting that it does not list", self.name))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::DEPTH;
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
        let settings = SolverSettings::default().with(&DEPTH, 3_u64);
        let error = solver("pcg", &settings).err().unwrap();
        let expected = SolverError::UnusedSetting {
            parameter: Parameter::Of(&DEPTH),
            solver: "pcg",
            used_by: "`anderson`".to_owned(),
        };
        assert_eq!(error, expected);
        assert!(solver("anderson", &settings).is_ok());
    }
}
