//! Memory in use, and available memory.

/// Returns the peak memory of this process, in bytes, or `None` if the system does not provide it.
#[must_use]
pub fn memory_peak_byte() -> Option<u64> {
    byte_of("/proc/self/status", "VmHWM:")
}

/// Returns the memory of this process, in bytes, or `None` if the system does not provide it.
#[must_use]
pub fn memory_used_byte() -> Option<u64> {
    byte_of("/proc/self/status", "VmRSS:")
}

/// Returns the memory available to programs without swapping, in bytes, or `None` if the system does not provide it.
#[must_use]
pub fn memory_available_byte() -> Option<u64> {
    byte_of("/proc/meminfo", "MemAvailable:")
}

/// Returns the bytes in a line of a file of the system.
fn byte_of(file: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}
