//! The machine on which times are measured.

use serde::Serialize;

/// The facts about a machine that a measured time depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Machine {
    /// The processor's name, or `None` where the system does not tell.
    pub cpu_model: Option<String>,
    /// The number of hardware threads that this process may use, or `None` where the system does not tell.
    pub n_cores: Option<usize>,
    /// The number of threads in use.
    pub n_threads: usize,
    /// The processor's architecture.
    pub architecture: &'static str,
    /// The operating system.
    pub system: &'static str,
}

/// Returns the load average of the last minute: the mean number of processes that ran or waited to run; `None` if the system does not provide it.
#[must_use]
pub fn load_average() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().next()?.parse().ok()
}

impl Machine {
    /// Describes this machine, and the thread pool of the caller.
    #[must_use]
    pub fn here() -> Self {
        let facts = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = facts
            .lines()
            .find_map(|line| line.strip_prefix("model name")?.split_once(':'));
        Self {
            cpu_model: name.map(|(_, name)| name.trim().to_owned()),
            n_cores: std::thread::available_parallelism().ok().map(std::num::NonZero::get),
            n_threads: rayon::current_num_threads(),
            architecture: std::env::consts::ARCH,
            system: std::env::consts::OS,
        }
    }

    /// Returns the processor's name, or its architecture where the system does not tell.
    #[must_use]
    pub fn processor(&self) -> &str {
        self.cpu_model.as_deref().unwrap_or(self.architecture)
    }
}
