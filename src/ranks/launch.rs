//! The ranks among which this process was started.

use std::env;
use std::sync::Arc;

use thiserror::Error;

use super::{Alone, Ranks};

/// The variables in which launchers set the number of ranks, and the number of this one: MPICH's, Open MPI's.
const LAUNCHERS: [[&str; 2]; 2] = [
    ["PMI_SIZE", "PMI_RANK"],
    ["OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"],
];

/// Several processes were started that cannot work together.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum RanksError {
    /// The program is built without MPI.
    #[error(
        "{n} ranks are started, and this build runs one; build it with `cargo build --release --features mpi`, or start one"
    )]
    NoMpi {
        /// The ranks that were started.
        n: usize,
        /// The number of this one.
        rank: usize,
    },
    /// The MPI library of the program does not know the launcher's ranks.
    #[error(
        "{n} ranks are started, and the MPI library of this build finds {found}; start them with the mpirun of the library that it is built with"
    )]
    OtherMpi {
        /// The ranks that were started.
        n: usize,
        /// The ranks that the library finds.
        found: usize,
        /// The number of this one.
        rank: usize,
    },
}

impl RanksError {
    /// Returns the number of this rank by the launcher; the first rank prints the error.
    #[must_use]
    pub fn rank(&self) -> usize {
        match self {
            Self::NoMpi { rank, .. } | Self::OtherMpi { rank, .. } => *rank,
        }
    }
}

/// Returns the number of ranks that a launcher started, and that of this one; `None` without a launcher.
fn launched(variable: impl Fn(&str) -> Option<String>) -> Option<(usize, usize)> {
    let number = |name: &str| variable(name)?.trim().parse().ok();
    LAUNCHERS
        .iter()
        .find_map(|[size, rank]| Some((number(size)?, number(rank).unwrap_or(0))))
}

/// Returns the ranks that this process is one of: those of `mpirun`, or itself alone.
///
/// Without a launcher, and in a build without the feature `mpi`, no MPI library is called.
///
/// # Errors
/// [`RanksError`]: a launcher started several processes that are not ranks of one program.
pub fn start() -> Result<Arc<dyn Ranks>, RanksError> {
    let Some((n, rank)) = launched(|name| env::var(name).ok()) else {
        return Ok(Arc::new(Alone));
    };
    of_launcher(n, rank)
}

#[cfg(feature = "mpi")]
fn of_launcher(n: usize, rank: usize) -> Result<Arc<dyn Ranks>, RanksError> {
    let world = super::world::World::start();
    let found = world.size();
    if found == n {
        return Ok(Arc::new(world));
    }
    world.end(super::End { code: 0, failed: false });
    Err(RanksError::OtherMpi { n, found, rank })
}

#[cfg(not(feature = "mpi"))]
fn of_launcher(n: usize, rank: usize) -> Result<Arc<dyn Ranks>, RanksError> {
    if n <= 1 {
        return Ok(Arc::new(Alone));
    }
    Err(RanksError::NoMpi { n, rank })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launchers_are_known_by_their_variables() {
        let with = |variables: &[(&str, &str)]| {
            launched(|name| {
                let found = variables.iter().find(|(own, _)| *own == name);
                found.map(|(_, value)| (*value).to_owned())
            })
        };
        assert_eq!(with(&[]), None);
        assert_eq!(with(&[("PMI_SIZE", "3"), ("PMI_RANK", "2")]), Some((3, 2)));
        assert_eq!(
            with(&[("OMPI_COMM_WORLD_SIZE", "8"), ("OMPI_COMM_WORLD_RANK", "7")]),
            Some((8, 7))
        );
        assert_eq!(with(&[("PMI_RANK", "2"), ("PMI_SIZE", "?")]), None);
    }
}
