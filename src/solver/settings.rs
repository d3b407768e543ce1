//! The values given to a solver.

use std::sync::Arc;

use crate::mesh::Hierarchy;
use crate::setting::{Setting, Value, Values};

/// The values given to a solver; the others have its own defaults.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolverSettings {
    /// The values by setting.
    pub values: Values,
    /// The levels of the mesh, for solvers that use coarser ones.
    pub hierarchy: Option<Arc<Hierarchy>>,
    /// The most memory that factorisations may take, in bytes; solvers without any ignore it.
    pub memory_limit_byte: Option<u64>,
}

impl SolverSettings {
    /// Returns the settings with one more value.
    ///
    /// # Panics
    /// If it is no value of the setting.
    #[must_use]
    pub fn with(mut self, setting: &'static Setting, value: impl Into<Value>) -> Self {
        self.values.set(setting, value);
        self
    }
}
