//! Memory in use, and memory there is.

/// Returns the most memory that this process has held, in bytes, or `None` where the system does not tell.
#[must_use]
pub fn memory_peak_byte() -> Option<u64> {
    byte_of("/proc/self/status", "VmHWM:")
}

/// Returns the memory that this process holds now, in bytes, or `None` where the system does not tell.
#[must_use]
pub fn memory_used_byte() -> Option<u64> {
    byte_of("/proc/self/status", "VmRSS:")
}

/// Returns the memory that programs can get without swapping, in bytes, or `None` where the system does not tell.
#[must_use]
pub fn memory_available_byte() -> Option<u64> {
    byte_of("/proc/meminfo", "MemAvailable:")
}

/// Returns what a line of a file of the system says.
fn byte_of(file: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}
