//! The solvers by name: one line each.

use std::num::NonZeroUsize;

use super::{
    Chebyshev, ConjugateGradients, GaussSeidel, Jacobi, Overshooting, Pcg, ProgressiveRefinement, Solver, SolverError,
    Sor, SpectrumBounds,
};

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
}

impl SolverSettings {
    /// Returns the flags of the settings that are given.
    fn given(&self) -> impl Iterator<Item = &'static str> {
        let all = [
            (OMEGA, self.omega.is_some()),
            (BOUNDS, self.bounds.is_some()),
            (STEPS, self.steps_per_pass.is_some()),
        ];
        all.into_iter().filter(|(_, is_given)| *is_given).map(|(flag, _)| flag)
    }
}

const OMEGA: &str = "--omega";
const BOUNDS: &str = "--bounds";
const STEPS: &str = "--steps-per-pass";

/// The flag that shows [`Solution::display`](super::Solution::display) in place of the radiosity: among the settings of the solvers that have one.
pub const DISPLAY_AMBIENT: &str = "--display-ambient";

/// A solver as the registry knows it.
#[derive(Debug)]
pub struct SolverEntry {
    /// The name on the command line.
    pub name: &'static str,
    /// What it does, in a few words.
    pub summary: &'static str,
    /// Whether it needs symmetric exchange areas A_i F_ij.
    pub needs_reciprocity: bool,
    /// The flags of the settings that it uses.
    pub settings: &'static [&'static str],
    make: fn(&SolverSettings) -> Box<dyn Solver>,
}

/// All solvers, in the order in which help lists them.
#[rustfmt::skip]
pub const SOLVERS: &[SolverEntry] = &[
    SolverEntry { name: "jacobi", summary: "Every patch gathers from the radiosities of the pass before", needs_reciprocity: false, settings: &[], make: |_| Box::new(Jacobi) },
    SolverEntry { name: "gauss-seidel", summary: "Every patch in turn gathers from the newest radiosities", needs_reciprocity: false, settings: &[], make: |_| Box::new(GaussSeidel) },
    SolverEntry { name: "sor", summary: "Gauss-Seidel with overrelaxation", needs_reciprocity: false, settings: &[OMEGA], make: |s| Box::new(Sor { omega: s.omega }) },
    SolverEntry { name: "progressive-refinement", summary: "The patch with the most unshot power shoots first", needs_reciprocity: false, settings: &[STEPS, DISPLAY_AMBIENT], make: |s| Box::new(ProgressiveRefinement { steps_per_pass: s.steps_per_pass }) },
    SolverEntry { name: "overshooting", summary: "Patches shoot what they have and what will come back (Feda)", needs_reciprocity: false, settings: &[STEPS, DISPLAY_AMBIENT], make: |s| Box::new(Overshooting { steps_per_pass: s.steps_per_pass }) },
    SolverEntry { name: "chebyshev", summary: "The best polynomial for an interval that holds the spectrum", needs_reciprocity: false, settings: &[BOUNDS], make: |s| Box::new(Chebyshev { bounds: s.bounds.unwrap_or_default() }) },
    SolverEntry { name: "cg", summary: "Conjugate gradients on V G, V = A/ρ, as in the paper", needs_reciprocity: true, settings: &[], make: |_| Box::new(ConjugateGradients) },
    SolverEntry { name: "pcg", summary: "Conjugate gradients preconditioned with V⁻¹ = ρ/A", needs_reciprocity: true, settings: &[], make: |_| Box::new(Pcg) },
];

/// Returns the solver of a name with the given settings.
///
/// # Errors
/// [`SolverError::UnknownSolver`], or [`SolverError::UnusedSetting`] if a setting is given that the solver has no use for.
pub fn solver(name: &str, settings: &SolverSettings) -> Result<Box<dyn Solver>, SolverError> {
    by_name(name)?.build(settings)
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
    /// Returns the solver with the given settings.
    ///
    /// # Errors
    /// [`SolverError::UnusedSetting`] if a setting is given that the solver has no use for.
    pub fn build(&self, settings: &SolverSettings) -> Result<Box<dyn Solver>, SolverError> {
        settings.given().try_for_each(|flag| self.expect_use_of(flag))?;
        Ok((self.make)(settings))
    }

    /// Refuses a flag that the solver has no use for.
    ///
    /// # Errors
    /// [`SolverError::UnusedSetting`].
    pub fn expect_use_of(&self, flag: &'static str) -> Result<(), SolverError> {
        if self.settings.contains(&flag) {
            return Ok(());
        }
        Err(SolverError::UnusedSetting {
            flag,
            solver: self.name,
            used_by: joined(SOLVERS.iter().filter(|s| s.settings.contains(&flag))),
        })
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn settings_without_a_use_are_refused() {
        let settings = SolverSettings {
            omega: Some(1.2),
            ..SolverSettings::default()
        };
        assert!(solver("sor", &settings).is_ok());
        let error = solver("pcg", &settings).err().unwrap().to_string();
        assert!(
            error.contains("--omega") && error.contains("`pcg`") && error.contains("`sor`"),
            "{error}"
        );
    }

    #[test]
    fn every_name_makes_its_solver() {
        for entry in SOLVERS {
            assert_eq!(entry.build(&SolverSettings::default()).unwrap().name(), entry.name);
        }
        let error = solver("magic", &SolverSettings::default()).err().unwrap().to_string();
        assert!(error.contains("`magic`") && error.contains("`pcg`"), "{error}");
    }
}
