//! The run times of the stages.

use std::time::{Duration, Instant};

use serde::{Serialize, Serializer};

/// Wall times of the stages of a run, in order.
#[derive(Clone, Debug, Default)]
pub struct StageTimes {
    stages: Vec<(&'static str, Duration)>,
}

impl StageTimes {
    /// Runs `work` and adds its wall time to the stage `name`.
    pub fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.add(name, start.elapsed());
        result
    }

    /// Adds a wall time to the stage `name`.
    pub fn add(&mut self, name: &'static str, elapsed: Duration) {
        match self.stages.iter_mut().find(|(known, _)| *known == name) {
            Some((_, total)) => *total += elapsed,
            None => self.stages.push((name, elapsed)),
        }
    }

    /// Iterates over the stages and their seconds.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        self.stages.iter().map(|(name, time)| (*name, time.as_secs_f64()))
    }

    /// Returns the sum of all stages in seconds.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.iter().map(|(_, seconds)| seconds).sum()
    }
}

/// Serialises one entry `NAME_s` per stage, s.
impl Serialize for StageTimes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(name, seconds)| (format!("{name}_s"), seconds)))
    }
}
