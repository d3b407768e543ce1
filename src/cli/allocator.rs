//! How much freed memory the C library keeps.

/// Returns freed blocks of 256 KiB and more to the system at once, in this process.
///
/// By itself glibc raises this limit to the greatest block freed so far, up to 32 MiB, and each thread keeps up to twice as much: tens of megabytes that no plan of memory can foresee.
/// Source: the GNU C library's manual page mallopt(3), `M_MMAP_THRESHOLD`.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(unsafe_code, reason = "a call of C without pointers")]
pub(super) fn keep_little() {
    const BLOCK_BYTE: libc::c_int = 256 << 10;
    // SAFETY: `mallopt` takes two numbers, may be called at any time, and returns 0 where it does not know them.
    // Then more is kept, as before.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, BLOCK_BYTE);
    }
}

/// Other C libraries keep what they keep.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn keep_little() {}
