//! The methods by name: one line each.

pub use super::entry::{MethodEntry, Work};
use super::settings::MethodSettings;
use super::{
    FormFactorError, FormFactorMethod, centre, closed_form, contour, exact, gauss_lambert, hemicube, pdm, qmc, sg, sr,
};
use crate::parameter::Parameter;
use crate::setting::{Setting, Use, ticked};

/// All methods, in the order in which help lists them.
pub const METHODS: &[&MethodEntry] = &[
    &centre::ENTRY,
    &pdm::ENTRY,
    &sr::ENTRY,
    &sg::ENTRY,
    &sg::OF_5_POINTS,
    &sg::OF_10_POINTS,
    &hemicube::ENTRY,
    &gauss_lambert::ENTRY,
    &contour::ENTRY,
    &closed_form::ENTRY,
    &qmc::ENTRY,
    &exact::ENTRY,
];

/// Returns the method of a name with the given settings.
///
/// # Errors
/// [`FormFactorError::UnknownMethod`], or [`FormFactorError::UnusedSetting`] if a setting is given that the method does not use.
pub fn method(name: &str, settings: &MethodSettings) -> Result<Box<dyn FormFactorMethod>, FormFactorError> {
    let entry = by_name(name)?;
    Ok(entry.build(&entry.resolve(settings)?))
}

/// Returns the entry of a name.
///
/// # Errors
/// [`FormFactorError::UnknownMethod`].
pub fn by_name(name: &str) -> Result<&'static MethodEntry, FormFactorError> {
    let found = METHODS.iter().find(|m| m.name == name).copied();
    found.ok_or_else(|| FormFactorError::UnknownMethod {
        name: name.to_owned(),
        known: ticked(METHODS.iter().map(|method| method.name)),
    })
}

/// Returns the settings that methods have, each once, with the names and uses of those that use it.
#[must_use]
pub fn settings() -> Vec<(&'static Setting, Vec<(&'static str, Use)>)> {
    crate::setting::gathered(METHODS.iter().map(|method| (method.name, method.settings)))
}

impl MethodEntry {
    /// Returns the settings that the method uses, with its defaults put in.
    ///
    /// # Errors
    /// [`FormFactorError::UnusedSetting`] if a setting is given that the method does not use.
    pub fn resolve(&self, given: &MethodSettings) -> Result<MethodSettings, FormFactorError> {
        if let Some(setting) = given.values.unused(self.settings) {
            let users = METHODS.iter().copied().filter(|method| method.uses(setting));
            return Err(FormFactorError::UnusedSetting {
                parameter: Parameter::Of(setting),
                method: self.name,
                used_by: ticked(users.map(|method| method.name)),
            });
        }
        Ok(MethodSettings {
            values: given.values.resolved(self.settings),
            seed: given.seed,
        })
    }

    /// Returns the method with settings that [`resolve`](Self::resolve) returned.
    ///
    /// # Panics
    /// If a setting that the method needs is missing.
    #[must_use]
    pub fn build(&self, resolved: &MethodSettings) -> Box<dyn FormFactorMethod> {
        (self.make)(resolved).unwrap_or_else(|| panic!("`{}` reads a setting that it does not list", self.name))
    }

    /// Returns whether the method uses a setting.
    #[must_use]
    pub fn uses(&self, setting: &Setting) -> bool {
        self.settings.iter().any(|used| used.setting.name == setting.name)
    }

    /// Returns whether the method computes whole rows; the others compute pairs, each once.
    #[must_use]
    pub fn by_rows(&self) -> bool {
        self.work != Work::Pairs
    }

    /// Returns whether the method shoots rays from patches, so that [`RAYS`](super::RAYS) is a number for each patch.
    #[must_use]
    pub fn shoots(&self) -> bool {
        self.work == Work::RowsOfRays
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use std::num::NonZeroUsize;

    use super::super::{NORMALISE, POINTS, RESOLUTION};
    use super::*;
    use crate::setting::Value;

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
        let settings = MethodSettings::default().with(&NORMALISE, true);
        assert!(method("centre", &settings).is_ok());
        let error = method("pdm", &settings).err().unwrap().to_string();
        assert!(
            error.contains("`normalise`") && error.contains("`pdm`") && error.contains("`centre`"),
            "{error}"
        );
        let with_points = MethodSettings::default().with(&POINTS, 3_u64);
        for entry in METHODS {
            let uses = ["pdm", "sg", "hemicube", "gauss-lambert", "contour", "closed-form"].contains(&entry.name);
            assert_eq!(entry.resolve(&with_points).is_ok(), uses, "{}", entry.name);
        }
    }

    #[test]
    fn defaults_are_put_in_where_they_are_used() {
        let resolve = |name| by_name(name).unwrap().resolve(&MethodSettings::default()).unwrap();
        assert_eq!(resolve("qmc").rays(), Some(64));
        assert_eq!(resolve("sr").rays(), Some(4096));
        assert_eq!(resolve("pdm").points(), NonZeroUsize::new(5));
        assert_eq!(resolve("hemicube").values.get(&RESOLUTION), Some(Value::Count(256)));
        assert_eq!(resolve("centre").values.get(&NORMALISE), Some(Value::Flag(false)));
    }
}
