//! The settings of a comparison: one entry for each method.

use std::sync::LazyLock;

use crate::form_factor::registry;
use crate::form_factor::{
    FormFactorError, FormFactorMethod, MethodSettings, NORMALISE, POINTS, RAYS, RESOLUTION, SEQUENCE, TOLERANCE,
};
use crate::geometry::sampling::Sequence;
use crate::setting::Value;

/// A method and the values of the parameter that trades its time for its error.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    /// The name in tables, plots and `--methods`.
    pub name: &'static str,
    /// The method's name in the [`registry`].
    pub method: &'static str,
    /// The parameter that varies.
    pub parameter: Parameter,
    /// Its values, ascending in cost.
    pub values: &'static [u64],
    /// The source of numbers, if it is not the method's default.
    pub sequence: Option<Sequence>,
    /// True if rows are divided by their sums.
    pub normalise: bool,
    /// The use of rays.
    pub rays: RayUse,
}

/// The parameter that varies from one setting of a method to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Nothing.
    None,
    /// Rays of each patch.
    RaysPerPatch,
    /// Rays of each pair of patches.
    RaysPerPair,
    /// Points along each side of one patch.
    Points,
    /// Points along each side of both patches.
    PointsOnBoth,
    /// Cells along each edge of the hemicube's top.
    Resolution,
    /// The tolerance 10⁻ᵏ, as k.
    Tolerance,
}

/// The purpose of a method's rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayUse {
    /// All form factors: the method needs visibility.
    Everything,
    /// Visibility alone; its parameter has other effects too.
    Visibility,
    /// Visibility alone, which is also the only effect of its parameter: without visibility all of its values are equal.
    VisibilityOnly,
}

impl Parameter {
    /// Returns the name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "–",
            Self::RaysPerPatch => "rays per patch",
            Self::RaysPerPair => "rays per pair",
            Self::Points | Self::PointsOnBoth => "points per side",
            Self::Resolution => "resolution",
            Self::Tolerance => "−log10 of the tolerance",
        }
    }

    /// Returns a value of the parameter as text, or nothing if there is none.
    #[must_use]
    pub fn value(self, value: u64) -> String {
        match self {
            Self::None => String::new(),
            Self::Tolerance => format!("1e-{value}"),
            _ => value.to_string(),
        }
    }

    /// Returns a setting in words.
    #[must_use]
    pub fn setting(self, value: u64) -> String {
        let number = self.value(value);
        match self {
            Self::None => "–".to_owned(),
            Self::Tolerance => format!("tolerance {number}"),
            Self::Resolution => format!("resolution {number}"),
            Self::RaysPerPatch | Self::RaysPerPair | Self::Points | Self::PointsOnBoth => {
                let name = self.name();
                let of_one = name.replacen("s ", " ", 1);
                format!("{number} {}", if value == 1 { &of_one } else { name })
            }
        }
    }

    /// Returns the power of the parameter that the run time grows with, for forecasts.
    pub(super) fn cost_power(self) -> i32 {
        match self {
            Self::None => 0,
            Self::RaysPerPatch | Self::RaysPerPair | Self::Tolerance => 1,
            Self::Points | Self::Resolution => 2,
            Self::PointsOnBoth => 4,
        }
    }
}

impl Sweep {
    /// Returns the method with one value of the parameter and a seed.
    ///
    /// # Errors
    /// Those of the [`registry`], if the method does not have the parameter.
    pub fn build(&self, value: u64, seed: u64) -> Result<Box<dyn FormFactorMethod>, FormFactorError> {
        let mut settings = MethodSettings::default().seeded(seed).with(&NORMALISE, self.normalise);
        let values = &mut settings.values;
        if let Some(sequence) = self.sequence {
            values.set(&SEQUENCE, sequence.name());
        }
        match self.parameter {
            Parameter::None => {}
            Parameter::RaysPerPatch | Parameter::RaysPerPair => values.set(&RAYS, value),
            Parameter::Points | Parameter::PointsOnBoth => values.set(&POINTS, value),
            Parameter::Resolution => values.set(&RESOLUTION, value),
            // Parsing the text gives the same number as users get.
            Parameter::Tolerance => {
                let tolerance = TOLERANCE.parse(&format!("1e-{value}"));
                values.set(&TOLERANCE, tolerance.unwrap_or(Value::Number(f64::NAN)));
            }
        }
        registry::method(self.method, &settings)
    }

    /// Returns the values worth running: only the first if they are all equal.
    #[must_use]
    pub fn values(&self, unoccluded: bool) -> &'static [u64] {
        match self.rays {
            RayUse::VisibilityOnly if unoccluded => &self.values[..1],
            _ => self.values,
        }
    }
}

/// The rays of each patch, for the methods that shoot.
const SHOT: &[u64] = &[64, 256, 1024, 4096, 16384];

/// All methods of a comparison, in the order of tables and legends: the table below, then each other method with its own settings.
pub static SWEEPS: LazyLock<Vec<Sweep>> = LazyLock::new(|| {
    let mut sweeps = TABLE.to_vec();
    for entry in registry::METHODS {
        // The method `sg` is included with its two usual numbers of points.
        if entry.name != "sg" && sweeps.iter().all(|sweep| sweep.method != entry.name) {
            let rays = if entry.by_rows() {
                RayUse::Everything
            } else {
                RayUse::Visibility
            };
            sweeps.push(sweep(entry.name, Parameter::None, &[1], rays));
        }
    }
    sweeps
});

#[rustfmt::skip]
const TABLE: &[Sweep] = &[
    sweep("centre", Parameter::None, &[1], RayUse::Visibility),
    Sweep { name: "centre-normalised", normalise: true, ..sweep("centre", Parameter::None, &[1], RayUse::Visibility) },
    sweep("pdm", Parameter::PointsOnBoth, &[2, 3, 5, 8], RayUse::Visibility),
    sweep("sr", Parameter::RaysPerPatch, SHOT, RayUse::Everything),
    Sweep { name: "sr-random", sequence: Some(Sequence::Random), ..sweep("sr", Parameter::RaysPerPatch, SHOT, RayUse::Everything) },
    sweep("sg5", Parameter::RaysPerPatch, SHOT, RayUse::Everything),
    sweep("sg10", Parameter::RaysPerPatch, SHOT, RayUse::Everything),
    sweep("hemicube", Parameter::Resolution, &[16, 32, 64, 128, 256], RayUse::Everything),
    sweep("gauss-lambert", Parameter::Points, &[1, 2, 3, 5, 10], RayUse::Visibility),
    sweep("contour", Parameter::PointsOnBoth, &[2, 3, 5, 8], RayUse::VisibilityOnly),
    sweep("closed-form", Parameter::PointsOnBoth, &[2, 3, 5, 8], RayUse::VisibilityOnly),
    sweep("qmc", Parameter::RaysPerPair, &[4, 16, 64, 256, 1024], RayUse::VisibilityOnly),
    sweep("exact", Parameter::Tolerance, &[3, 4, 5, 6], RayUse::Visibility),
];

/// Returns the sweep of that name.
#[must_use]
pub fn sweep_by_name(name: &str) -> Option<&'static Sweep> {
    SWEEPS.iter().find(|sweep| sweep.name == name)
}

const fn sweep(name: &'static str, parameter: Parameter, values: &'static [u64], rays: RayUse) -> Sweep {
    Sweep {
        name,
        method: name,
        parameter,
        values,
        sequence: None,
        normalise: false,
        rays,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_counted_in_words() {
        let words = [Parameter::Points.setting(1), Parameter::RaysPerPair.setting(4)];
        assert_eq!(words, ["1 point per side", "4 rays per pair"]);
    }

    #[test]
    fn every_entry_makes_its_method_and_every_method_has_an_entry() {
        for (k, sweep) in SWEEPS.iter().enumerate() {
            assert!(SWEEPS[..k].iter().all(|other| other.name != sweep.name));
            assert!(!sweep.values.is_empty() && sweep.values.is_sorted_by(|a, b| a < b));
            for &value in sweep.values {
                assert!(sweep.build(value, 1).is_ok(), "{} {value}", sweep.name);
            }
        }
        for entry in registry::METHODS {
            // The method `sg` is included with its two usual numbers of points.
            let name = if entry.name == "sg" { "sg5" } else { entry.name };
            assert!(sweep_by_name(name).is_some(), "{name}");
        }
        assert!(sweep_by_name("nothing").is_none());
    }
}
