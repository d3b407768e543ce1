//! The methods by name: one line each.

use std::num::NonZeroUsize;

use super::{
    CentrePoint, ClosedForm, ContourIntegral, ExactMethod, FormFactorError, FormFactorMethod, GaussLambert,
    GaussShooting, Hemicube, ParametricDifferential, QuasiMonteCarlo, RandomShooting,
};
use crate::geometry::sampling::Sequence;
use crate::parameter::Parameter;

/// What a user may set; `None` is the method's own default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MethodSettings {
    /// Rays for each patch where the method shoots, for each pair in `qmc`.
    pub rays: Option<u64>,
    /// Points along each side of a patch.
    pub points: Option<NonZeroUsize>,
    /// Cells along each edge of the hemicube's top.
    pub resolution: Option<NonZeroUsize>,
    /// Whether rows are divided by their sums.
    pub normalise: bool,
    /// Where the numbers of shooting come from.
    pub sequence: Option<Sequence>,
    /// The tolerance on A_i F_ij / min(A_i, A_j).
    pub tolerance: Option<f64>,
    /// The most evaluations for one pair.
    pub budget: Option<NonZeroUsize>,
    /// The seed of all numbers; methods without any ignore it.
    pub seed: u64,
}

/// A setting that some methods use and others do not, with its default.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Setting {
    /// [`MethodSettings::rays`], for each patch.
    RaysPerPatch(u64),
    /// [`MethodSettings::rays`], for each pair of patches.
    RaysPerPair(u64),
    /// [`MethodSettings::points`].
    Points(NonZeroUsize),
    /// [`MethodSettings::resolution`].
    Resolution(NonZeroUsize),
    /// [`MethodSettings::normalise`]; off.
    Normalise,
    /// [`MethodSettings::sequence`]; Sobol.
    Sequence,
    /// [`MethodSettings::tolerance`].
    Tolerance(f64),
    /// [`MethodSettings::budget`].
    Budget(NonZeroUsize),
}

impl Setting {
    /// Returns its name.
    #[must_use]
    pub fn parameter(self) -> Parameter {
        match self {
            Self::RaysPerPatch(_) | Self::RaysPerPair(_) => Parameter::Rays,
            Self::Points(_) => Parameter::Points,
            Self::Resolution(_) => Parameter::Resolution,
            Self::Normalise => Parameter::Normalise,
            Self::Sequence => Parameter::Sequence,
            Self::Tolerance(_) => Parameter::Tolerance,
            Self::Budget(_) => Parameter::Budget,
        }
    }
}

/// A method as the registry knows it.
#[derive(Debug)]
pub struct MethodEntry {
    /// The name on the command line.
    pub name: &'static str,
    /// What it does, in a few words.
    pub summary: &'static str,
    /// The settings that it uses.
    pub settings: &'static [Setting],
    make: fn(&Values) -> Box<dyn FormFactorMethod>,
}

/// All settings with defaults put in; those that a method does not use have no meaning.
struct Values {
    rays: u64,
    points: NonZeroUsize,
    resolution: NonZeroUsize,
    normalise: bool,
    sequence: Sequence,
    tolerance: f64,
    budget: NonZeroUsize,
    seed: u64,
}

const fn number(n: usize) -> NonZeroUsize {
    NonZeroUsize::new(n).expect("defaults are positive")
}

const SHOOTING: Setting = Setting::RaysPerPatch(4096);
const FIVE_POINTS: Setting = Setting::Points(number(5));

/// All methods, in the order in which help lists them.
#[rustfmt::skip]
pub const METHODS: &[MethodEntry] = &[
    MethodEntry { name: "centre", summary: "One ray between the centres (Lewis)", settings: &[Setting::Normalise], make: |v| Box::new(CentrePoint { normalise: v.normalise }) },
    MethodEntry { name: "pdm", summary: "Gauss points on both patches (parametric differential method)", settings: &[FIVE_POINTS], make: |v| Box::new(ParametricDifferential { points: v.points }) },
    MethodEntry { name: "sr", summary: "Shooting from random points", settings: &[SHOOTING, Setting::Sequence], make: |v| Box::new(RandomShooting { rays: v.rays, sequence: v.sequence, seed: v.seed }) },
    MethodEntry { name: "sg", summary: "Shooting from Q × Q Gauss points", settings: &[SHOOTING, Setting::Sequence, FIVE_POINTS], make: |v| gauss_shooting(v.points, v) },
    MethodEntry { name: "sg5", summary: "Shooting from 5 × 5 Gauss points", settings: &[SHOOTING, Setting::Sequence], make: |v| gauss_shooting(number(5), v) },
    MethodEntry { name: "sg10", summary: "Shooting from 10 × 10 Gauss points", settings: &[SHOOTING, Setting::Sequence], make: |v| gauss_shooting(number(10), v) },
    MethodEntry { name: "hemicube", summary: "Rays through the cells of a half cube (Cohen and Greenberg)", settings: &[Setting::Resolution(number(256)), Setting::Points(number(1))], make: |v| Box::new(Hemicube { resolution: v.resolution, points: v.points }) },
    MethodEntry { name: "gauss-lambert", summary: "Gauss points on one patch, exact to the other", settings: &[FIVE_POINTS], make: |v| Box::new(GaussLambert { points: v.points }) },
    MethodEntry { name: "contour", summary: "The integral around both contours, times the visible fraction", settings: &[FIVE_POINTS], make: |v| Box::new(ContourIntegral { points: v.points, seed: v.seed }) },
    MethodEntry { name: "closed-form", summary: "Rectangles with parallel edges, times the visible fraction", settings: &[FIVE_POINTS], make: |v| Box::new(ClosedForm { points: v.points, seed: v.seed }) },
    MethodEntry { name: "qmc", summary: "The exact factor times the visible fraction of low-discrepancy rays", settings: &[Setting::RaysPerPair(64)], make: |v| Box::new(QuasiMonteCarlo { rays: v.rays, seed: v.seed }) },
    MethodEntry { name: "exact", summary: "Every pair to a tolerance, shadows by exact clipping", settings: &[Setting::Tolerance(ExactMethod::DEFAULT_TOLERANCE), Setting::Budget(number(ExactMethod::DEFAULT_BUDGET))], make: |v| Box::new(ExactMethod { tolerance: v.tolerance, budget: v.budget.get() }) },
];

fn gauss_shooting(points: NonZeroUsize, values: &Values) -> Box<dyn FormFactorMethod> {
    Box::new(GaussShooting {
        points,
        rays: values.rays,
        sequence: values.sequence,
        seed: values.seed,
    })
}

/// Returns the method of a name with the given settings.
///
/// # Errors
/// [`FormFactorError::UnknownMethod`], or [`FormFactorError::UnusedSetting`] if a setting is given that the method has no use for.
pub fn method(name: &str, settings: &MethodSettings) -> Result<Box<dyn FormFactorMethod>, FormFactorError> {
    let entry = by_name(name)?;
    Ok(entry.build(&entry.resolve(settings)?))
}

/// Returns the entry of a name.
///
/// # Errors
/// [`FormFactorError::UnknownMethod`].
pub fn by_name(name: &str) -> Result<&'static MethodEntry, FormFactorError> {
    METHODS
        .iter()
        .find(|m| m.name == name)
        .ok_or_else(|| FormFactorError::UnknownMethod {
            name: name.to_owned(),
            known: joined(METHODS),
        })
}

fn joined<'a>(entries: impl IntoIterator<Item = &'a MethodEntry>) -> String {
    let quoted: Vec<String> = entries.into_iter().map(|m| format!("`{}`", m.name)).collect();
    quoted.join(", ")
}

impl MethodEntry {
    /// Returns the settings with the defaults of this method put in; those that it does not use stay `None` or `false`.
    ///
    /// # Errors
    /// [`FormFactorError::UnusedSetting`] if a setting is given that the method has no use for.
    pub fn resolve(&self, given: &MethodSettings) -> Result<MethodSettings, FormFactorError> {
        for (is_given, parameter) in [
            (given.rays.is_some(), Parameter::Rays),
            (given.points.is_some(), Parameter::Points),
            (given.resolution.is_some(), Parameter::Resolution),
            (given.normalise, Parameter::Normalise),
            (given.sequence.is_some(), Parameter::Sequence),
            (given.tolerance.is_some(), Parameter::Tolerance),
            (given.budget.is_some(), Parameter::Budget),
        ] {
            let uses = |m: &&MethodEntry| m.settings.iter().any(|s| s.parameter() == parameter);
            if is_given && !uses(&self) {
                return Err(FormFactorError::UnusedSetting {
                    parameter,
                    method: self.name,
                    used_by: joined(METHODS.iter().filter(uses)),
                });
            }
        }
        let mut resolved = *given;
        for setting in self.settings {
            match *setting {
                Setting::RaysPerPatch(n) | Setting::RaysPerPair(n) => resolved.rays = given.rays.or(Some(n)),
                Setting::Points(n) => resolved.points = given.points.or(Some(n)),
                Setting::Resolution(n) => resolved.resolution = given.resolution.or(Some(n)),
                Setting::Sequence => resolved.sequence = given.sequence.or(Some(Sequence::default())),
                Setting::Tolerance(t) => resolved.tolerance = given.tolerance.or(Some(t)),
                Setting::Budget(n) => resolved.budget = given.budget.or(Some(n)),
                Setting::Normalise => {}
            }
        }
        Ok(resolved)
    }

    /// Returns the method with settings that [`resolve`](Self::resolve) returned.
    #[must_use]
    pub fn build(&self, resolved: &MethodSettings) -> Box<dyn FormFactorMethod> {
        (self.make)(&Values {
            rays: resolved.rays.unwrap_or(1),
            points: resolved.points.unwrap_or(NonZeroUsize::MIN),
            resolution: resolved.resolution.unwrap_or(NonZeroUsize::MIN),
            normalise: resolved.normalise,
            sequence: resolved.sequence.unwrap_or_default(),
            tolerance: resolved.tolerance.unwrap_or(ExactMethod::DEFAULT_TOLERANCE),
            budget: resolved.budget.unwrap_or(NonZeroUsize::MIN),
            seed: resolved.seed,
        })
    }

    /// Returns whether the method computes whole rows; the others compute pairs, each once.
    #[must_use]
    pub fn by_rows(&self) -> bool {
        let of_rows = |s: &Setting| matches!(s, Setting::RaysPerPatch(_) | Setting::Resolution(_));
        self.settings.iter().any(of_rows)
    }

    /// Returns whether the method shoots rays from patches, so that `rays` is a number for each patch.
    #[must_use]
    pub fn shoots(&self) -> bool {
        self.settings.iter().any(|s| matches!(s, Setting::RaysPerPatch(_)))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn every_name_makes_its_method() {
        for entry in METHODS {
            let made = method(entry.name, &MethodSettings::default()).unwrap();
            let expected = if entry.name.starts_with("sg") { "sg" } else { entry.name };
            assert_eq!(made.name(), expected);
        }
        let error = method("magic", &MethodSettings::default()).err().unwrap().to_string();
        assert!(error.contains("`magic`") && error.contains("`closed-form`"), "{error}");
    }

    #[test]
    fn settings_without_a_use_are_refused() {
        let settings = MethodSettings {
            normalise: true,
            ..MethodSettings::default()
        };
        assert!(method("centre", &settings).is_ok());
        let error = method("pdm", &settings).err().unwrap().to_string();
        assert!(
            error.contains("`normalise`") && error.contains("`pdm`") && error.contains("`centre`"),
            "{error}"
        );
        let with_points = MethodSettings {
            points: Some(number(3)),
            ..MethodSettings::default()
        };
        for entry in METHODS {
            let uses = ["pdm", "sg", "hemicube", "gauss-lambert", "contour", "closed-form"].contains(&entry.name);
            assert_eq!(entry.resolve(&with_points).is_ok(), uses, "{}", entry.name);
        }
    }

    #[test]
    fn defaults_are_put_in_where_they_are_used() {
        let resolve = |name| by_name(name).unwrap().resolve(&MethodSettings::default()).unwrap();
        assert_eq!(resolve("qmc").rays, Some(64));
        assert_eq!(resolve("sr").rays, Some(4096));
        assert_eq!(resolve("pdm").points, Some(number(5)));
        assert_eq!(resolve("hemicube").resolution, Some(number(256)));
        assert_eq!(resolve("centre"), MethodSettings::default());
    }
}
