//! How much freed memory the C library keeps.

use super::ffi;

/// Returns freed blocks of 256 KiB and more to the system at once, in the whole process, where the C library is glibc.
///
/// By itself glibc raises this limit to the largest block freed so far, up to 32 MiB, and each thread keeps up to twice as much, which no plan of memory can foresee.
/// The program calls this before a run; a process with a memory limit should, too. Cost: up to 2 % of the time where blocks of that size are frequent.
///
/// Source: the manual page mallopt(3), `M_MMAP_THRESHOLD`.
pub fn return_freed_blocks() {
    // SAFETY: takes one number, and may be called at any time; an allocator that does not know the setting ignores it.
    unsafe { ffi::radiosity_return_freed_blocks(256 << 10) }
}
