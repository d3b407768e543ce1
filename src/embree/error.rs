//! Errors of Embree.

use std::ffi::CStr;

use super::ffi;

/// Why Embree cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EmbreeError {
    /// The program was compiled with other headers than those of the library it runs with.
    #[error("this program was built for Embree {headers}, but the Embree library here is {library}: build it again")]
    VersionMismatch {
        /// Version of the headers.
        headers: Version,
        /// Version of the library.
        library: Version,
    },
    /// The library writes beyond the structs that its headers declare.
    #[error("the Embree library writes {n_bytes} bytes beyond its headers' structs: library and headers do not fit")]
    LayoutMismatch {
        /// The number of canary bytes behind the structs that one query of each kind overwrote.
        n_bytes: usize,
    },
    /// The CPU lacks what the library needs.
    #[error("Embree does not support this CPU: {message}")]
    UnsupportedCpu {
        /// Embree's message.
        message: String,
    },
    /// There is not enough memory for the scene.
    #[error(
        "the ray tracer (Embree) is out of memory: {message}; raise the limit of the process (`ulimit -v`), free memory, or split the scene"
    )]
    OutOfMemory {
        /// Embree's message.
        message: String,
    },
    /// Embree refused an argument or an operation, was cancelled, or failed without an explanation.
    #[error("Embree failed with error {code}: {message}")]
    Failed {
        /// The `RTCError`.
        code: i32,
        /// Embree's message.
        message: String,
    },
    /// There are more faces, vertices or triangles than 31 bits can count.
    #[error("{n} {what} are too many: at most {limit} can be told apart")]
    TooMany {
        /// The items of which there are too many.
        what: &'static str,
        /// The number (of a face: its id plus one).
        n: u64,
        /// The largest possible number.
        limit: u64,
    },
    /// A face has a corner that does not exist.
    #[error("face {face} has the corner {index}, but there are only {n_vertices} vertices")]
    IndexOutOfRange {
        /// The face.
        face: u32,
        /// The corner's index.
        index: u32,
        /// The number of vertices.
        n_vertices: usize,
    },
    /// A vertex is not finite, or so far out that Embree would silently drop its faces.
    #[error("vertex {vertex} is at {position:?}: coordinates must be finite and below 1.8e18")]
    VertexOutOfRange {
        /// The vertex's index.
        vertex: usize,
        /// Its coordinates.
        position: [f32; 3],
    },
    /// The scene is so small or so large that products of its coordinates leave the range of f32.
    #[error(
        "a vertex lies {largest:e} m from the scene's centre along an axis, and rays require 1e-30 m to 1e30 m; scale the scene, or move distant vertices"
    )]
    ExtentOutOfRange {
        /// The largest absolute coordinate after centring, in m.
        largest: f64,
    },
}

/// A version of Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    /// Changes when the API does.
    pub major: u32,
    /// Changes with features, and with the layout of structs.
    pub minor: u32,
    /// Changes with corrections.
    pub patch: u32,
}

impl Version {
    /// Splits a number major · 10000 + minor · 100 + patch.
    pub(super) fn from_number(number: u32) -> Self {
        Self {
            major: number / 10_000,
            minor: number / 100 % 100,
            patch: number % 100,
        }
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}

/// `RTC_ERROR_OUT_OF_MEMORY` of all versions of Embree.
const OUT_OF_MEMORY: i32 = 4;
/// `RTC_ERROR_UNSUPPORTED_CPU` of all versions of Embree.
const UNSUPPORTED_CPU: i32 = 5;

impl ffi::radiosity_error {
    pub(super) const NONE: Self = Self {
        code: 0,
        message: [0; 256],
    };

    /// Returns the error, if there is one.
    pub(super) fn check(&self) -> Result<(), EmbreeError> {
        let message = CStr::from_bytes_until_nul(&self.message)
            .map_or_else(|_| String::new(), |words| words.to_string_lossy().into_owned());
        match self.code {
            0 => Ok(()),
            OUT_OF_MEMORY => Err(EmbreeError::OutOfMemory { message }),
            UNSUPPORTED_CPU => Err(EmbreeError::UnsupportedCpu { message }),
            code => Err(EmbreeError::Failed { code, message }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from_c(code: i32, words: &str) -> ffi::radiosity_error {
        let mut error = ffi::radiosity_error::NONE;
        error.code = code;
        error.message[..words.len()].copy_from_slice(words.as_bytes());
        error
    }

    #[test]
    fn codes_become_variants_and_keep_embrees_words() {
        assert!(from_c(0, "").check().is_ok());
        assert!(
            matches!(from_c(4, "too large").check(), Err(EmbreeError::OutOfMemory { message }) if message == "too large")
        );
        let remedy = from_c(4, "too large").check().expect_err("out of memory").to_string();
        assert!(remedy.contains("too large") && remedy.contains("ulimit -v"), "{remedy}");
        assert!(
            matches!(from_c(5, "no SSE2").check(), Err(EmbreeError::UnsupportedCpu { message }) if message == "no SSE2")
        );
        assert!(matches!(from_c(2, "bad").check(), Err(EmbreeError::Failed { code: 2, message }) if message == "bad"));
    }

    #[test]
    fn versions_split_into_their_parts() {
        assert_eq!(Version::from_number(40_303).to_string(), "4.3.3");
        assert_eq!(Version::from_number(41_200).to_string(), "4.12.0");
    }
}
