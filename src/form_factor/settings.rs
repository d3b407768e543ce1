//! Settings that several methods use; those of one method are in its file.

use std::num::NonZeroUsize;

use crate::geometry::sampling::Sequence;
use crate::setting::{Kind, Setting, Use, Value, Values};

/// Rays of each patch where a method shoots, of each pair of patches in `qmc`.
pub static RAYS: Setting = Setting {
    name: "rays",
    help: "Rays for each patch (render: 16384), of qmc for each pair",
    letter: "N",
    kind: Kind::Count(u64::MAX),
};

/// Points along each side of a patch.
pub static POINTS: Setting = Setting {
    name: "points",
    help: "Points along each side of a patch",
    letter: "Q",
    kind: Kind::Count(256),
};

/// The source of the numbers of shooting: a [`Sequence`].
pub static SEQUENCE: Setting = Setting {
    name: "sequence",
    help: "Where the numbers of rays come from",
    letter: "NAME",
    kind: Kind::Choice(Sequence::NAMES),
};

/// The tolerance on A_i F_ij / min(A_i, A_j).
pub static TOLERANCE: Setting = Setting {
    name: "tolerance",
    help: "The error of each form factor between partly hidden patches, on A_i F_ij / min(A_i, A_j)",
    letter: "T",
    kind: Kind::Number,
};

pub(super) const SHOT_RAYS: Use = RAYS.or(Value::Count(4096));
pub(super) const SOBOL: Use = SEQUENCE.or(Value::Choice("sobol"));
pub(super) const FIVE_POINTS: Use = POINTS.or(Value::Count(5));

/// The values given to a method; the others have its own defaults.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MethodSettings {
    /// The values by setting.
    pub values: Values,
    /// The seed of all random numbers; methods without any ignore it.
    pub seed: u64,
}

impl MethodSettings {
    /// Returns the settings with one more value.
    ///
    /// # Panics
    /// If it is no value of the setting.
    #[must_use]
    pub fn with(mut self, setting: &'static Setting, value: impl Into<Value>) -> Self {
        self.values.set(setting, value);
        self
    }

    /// Returns the settings with another seed.
    #[must_use]
    pub fn seeded(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Returns the number of rays.
    #[must_use]
    pub fn rays(&self) -> Option<u64> {
        self.values.get(&RAYS)?.count()
    }

    /// Returns the number of points along each side.
    #[must_use]
    pub fn points(&self) -> Option<NonZeroUsize> {
        self.values.get(&POINTS)?.size()
    }

    /// Returns the source of the numbers.
    #[must_use]
    pub fn sequence(&self) -> Option<Sequence> {
        Sequence::named(self.values.get(&SEQUENCE)?.choice()?)
    }

    /// Returns the tolerance.
    #[must_use]
    pub fn tolerance(&self) -> Option<f64> {
        self.values.get(&TOLERANCE)?.number()
    }
}
