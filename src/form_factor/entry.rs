//! The entry of a method in the registry.

use super::FormFactorMethod;
use super::settings::MethodSettings;
use crate::setting::Use;

/// A method in the registry; the method's own file fills it in.
#[derive(Debug)]
pub struct MethodEntry {
    /// The name on the command line.
    pub name: &'static str,
    /// A description in a few words.
    pub summary: &'static str,
    /// The settings that it uses.
    pub settings: &'static [Use],
    /// Whether it computes whole rows, or pairs, each once.
    pub work: Work,
    /// Makes the method from settings with the defaults put in.
    pub make: fn(&MethodSettings) -> Option<Box<dyn FormFactorMethod>>,
}

/// The parts in which a method computes form factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Rows, by rays from patches; [`RAYS`](super::RAYS) is a number for each of them, and no row has more entries than rays.
    RowsOfRays,
    /// Rows, by other means.
    Rows,
    /// Pairs of patches, each once.
    Pairs,
}
