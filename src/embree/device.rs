//! The Embree device.

use std::ffi::CStr;
use std::ptr::NonNull;

use super::error::{EmbreeError, Version};
use super::ffi;

/// One thread builds: the tree, and with it the face that wins a tie at a shared edge, must not depend on the number of threads.
const CONFIG: &CStr = c"threads=1";

/// An Embree device: the library, ready for use on this CPU.
#[derive(Debug)]
pub struct Device {
    handle: NonNull<ffi::radiosity_device>,
}

// SAFETY: Embree's devices are reference-counted with atomics and may be used from any thread; there is no thread-local
// state behind the handle.
unsafe impl Send for Device {}
// SAFETY: Embree allows calls with one device from many threads at once; the error that a call reports is kept per thread.
unsafe impl Sync for Device {}

impl Device {
    /// Opens Embree, and checks that the library is the one that this crate was compiled for.
    ///
    /// The versions must be equal, and one trial ray in each kind of packet must leave the bytes behind the packet alone:
    /// a build option of Embree changes the layout of hits without changing the version.
    ///
    /// # Errors
    ///
    /// [`EmbreeError::VersionMismatch`], [`EmbreeError::LayoutMismatch`], [`EmbreeError::UnsupportedCpu`], or an error of
    /// Embree.
    pub fn new() -> Result<Self, EmbreeError> {
        let device = Self::open(CONFIG)?;
        // SAFETY: the function only returns a constant.
        let headers = Version::from_number(unsafe { ffi::radiosity_version_of_headers() });
        let library = device.version();
        if headers != library {
            return Err(EmbreeError::VersionMismatch { headers, library });
        }
        let mut error = ffi::radiosity_error::NONE;
        // SAFETY: the handle is valid for as long as `device` lives, and `error` for the call.
        let n_bytes = unsafe { ffi::radiosity_device_stray_bytes(device.handle.as_ptr(), &raw mut error) };
        error.check()?;
        if n_bytes > 0 {
            return Err(EmbreeError::LayoutMismatch { n_bytes });
        }
        Ok(device)
    }

    /// Opens Embree with the given configuration string.
    fn open(config: &CStr) -> Result<Self, EmbreeError> {
        let mut error = ffi::radiosity_error::NONE;
        // SAFETY: `config` ends with a zero byte, and both arguments are valid for the call.
        let handle = unsafe { ffi::radiosity_device_new(config.as_ptr(), &raw mut error) };
        let device = NonNull::new(handle).map(|handle| Self { handle });
        error.check()?;
        device.ok_or(EmbreeError::Failed {
            code: 0,
            message: "no device".into(),
        })
    }

    /// Returns the version of the library.
    #[must_use]
    pub fn version(&self) -> Version {
        // SAFETY: the handle is valid for as long as `self` lives.
        Version::from_number(unsafe { ffi::radiosity_device_version(self.handle.as_ptr()) })
    }

    /// Returns the number of rays that the device traces at once, the width of the widest native packet: 16, 8, 4 or 1.
    #[must_use]
    pub fn packet_width(&self) -> u32 {
        // SAFETY: the handle is valid for as long as `self` lives.
        unsafe { ffi::radiosity_device_packet_width(self.handle.as_ptr()) }
    }

    pub(super) fn handle(&self) -> NonNull<ffi::radiosity_device> {
        self.handle
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the handle came from radiosity_device_new and is released only here; scenes hold references of their own.
        unsafe { ffi::radiosity_device_free(self.handle.as_ptr()) }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_the_one_of_the_headers_and_stays_within_its_structs() {
        let device = Device::new().unwrap();
        assert!(device.version().major >= 4);
        assert!([1, 4, 8, 16].contains(&device.packet_width()));
    }

    #[test]
    fn a_configuration_that_embree_refuses_is_an_error() {
        let error = Device::open(c"verbose=much").unwrap_err();
        assert!(matches!(&error, EmbreeError::Failed { .. }), "{error:?}");
    }
}
