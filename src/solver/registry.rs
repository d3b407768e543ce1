//! The solvers by name: one line each.

use super::{GaussSeidel, Pcg, Solver, SolverError};

/// What a user may set; `None` is the solver's own default.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SolverSettings {}

/// A solver as the registry knows it.
#[derive(Debug)]
pub struct SolverEntry {
    /// The name on the command line.
    pub name: &'static str,
    /// What it does, in a few words.
    pub summary: &'static str,
    /// Whether it needs symmetric exchange areas A_i F_ij.
    pub needs_reciprocity: bool,
    make: fn(&SolverSettings) -> Box<dyn Solver>,
}

/// All solvers, in the order in which help lists them.
#[rustfmt::skip]
pub const SOLVERS: &[SolverEntry] = &[
    SolverEntry { name: "gauss-seidel", summary: "Every patch in turn gathers from the newest radiosities", needs_reciprocity: false, make: |_| Box::new(GaussSeidel) },
    SolverEntry { name: "pcg", summary: "Conjugate gradients preconditioned with V⁻¹ = ρ/A", needs_reciprocity: true, make: |_| Box::new(Pcg) },
];

/// Returns the solver of a name with the given settings.
///
/// # Errors
/// [`SolverError::UnknownSolver`].
pub fn solver(name: &str, settings: &SolverSettings) -> Result<Box<dyn Solver>, SolverError> {
    Ok(by_name(name)?.build(settings))
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
            known: SOLVERS
                .iter()
                .map(|s| format!("`{}`", s.name))
                .collect::<Vec<_>>()
                .join(", "),
        })
}

impl SolverEntry {
    /// Returns the solver with the given settings.
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
}
