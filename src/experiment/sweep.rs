//! The settings that are compared: one entry for each method.

use std::num::NonZeroUsize;

use crate::form_factor::{FormFactorMethod, GaussShooting, RandomShooting};
use crate::geometry::sampling::Sequence;

/// A method and the values of the parameter that trades its time for its error.
#[derive(Clone, Copy)]
pub struct Sweep {
    /// The name in tables, plots and `--methods`.
    pub name: &'static str,
    /// What the entry is, in a few words.
    pub description: &'static str,
    /// What is varied.
    pub parameter: &'static str,
    /// Its values, ascending in cost.
    pub values: &'static [u64],
    /// The run time grows with this power of the parameter, for a forecast.
    pub cost_power: i32,
    /// True if every run traces rays to their first hit: such a method cannot leave visibility out.
    pub always_traces: bool,
    make: fn(value: u64, seed: u64) -> Box<dyn FormFactorMethod>,
}

impl Sweep {
    /// Returns the method with one value of the parameter and a seed.
    #[must_use]
    pub fn method(&self, value: u64, seed: u64) -> Box<dyn FormFactorMethod> {
        (self.make)(value, seed)
    }
}

impl std::fmt::Debug for Sweep {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} over {} {:?}", self.name, self.parameter, self.values)
    }
}

/// Rays of each patch, for the methods that shoot.
const RAYS: &[u64] = &[64, 256, 1024, 4096, 16384];

/// Every method that can be compared, in the order of tables and legends.
pub const SWEEPS: &[Sweep] = &[
    shooting("sr", "random points, Sobol numbers", |rays, seed| {
        random(rays, seed, Sequence::Sobol)
    }),
    shooting("sr-random", "random points, pseudo-random numbers", |rays, seed| {
        random(rays, seed, Sequence::Random)
    }),
    shooting("sg5", "5 × 5 Gauss points, Sobol numbers", |rays, seed| {
        gauss(5, rays, seed)
    }),
    shooting("sg10", "10 × 10 Gauss points, Sobol numbers", |rays, seed| {
        gauss(10, rays, seed)
    }),
];

/// Returns the sweep of that name.
#[must_use]
pub fn sweep_by_name(name: &str) -> Option<&'static Sweep> {
    SWEEPS.iter().find(|sweep| sweep.name == name)
}

const fn shooting(
    name: &'static str,
    description: &'static str,
    make: fn(u64, u64) -> Box<dyn FormFactorMethod>,
) -> Sweep {
    Sweep {
        name,
        description,
        parameter: "rays per patch",
        values: RAYS,
        cost_power: 1,
        always_traces: true,
        make,
    }
}

fn random(rays: u64, seed: u64, sequence: Sequence) -> Box<dyn FormFactorMethod> {
    Box::new(RandomShooting { rays, sequence, seed })
}

fn gauss(points: usize, rays: u64, seed: u64) -> Box<dyn FormFactorMethod> {
    Box::new(GaussShooting {
        points: NonZeroUsize::new(points).unwrap_or(NonZeroUsize::MIN),
        rays,
        sequence: Sequence::Sobol,
        seed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_values_ascend() {
        for (k, sweep) in SWEEPS.iter().enumerate() {
            assert!(SWEEPS[..k].iter().all(|other| other.name != sweep.name));
            assert!(!sweep.values.is_empty() && sweep.values.is_sorted_by(|a, b| a < b));
            assert!(std::ptr::eq(
                sweep_by_name(sweep.name).into_iter().next().unwrap_or(sweep),
                sweep
            ));
        }
        assert!(sweep_by_name("nothing").is_none());
    }
}
