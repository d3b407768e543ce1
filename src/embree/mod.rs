//! Embree: the only unsafe code of the crate.
//!
//! Rust sees a small C interface (`rays.h`) that takes whole batches of rays; Embree's own structs stay in C
//! (`rays.c`, `packet.h`), which is compiled against the installed headers.
//! A scene is gathered in a [`SceneBuilder`], committed on a [`Device`], and queried as a [`CommittedScene`]:
//!
//! ```
//! use glam::DVec3;
//! use radiosity::embree::{Device, SceneBuilder};
//! use radiosity::visibility::{Coherence, HitBatch, RayBatch};
//!
//! let device = Device::new()?;
//! let mut builder = SceneBuilder::new(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])?;
//! builder.quad([0, 1, 2, 3], 0)?;
//! let scene = builder.commit(&device)?;
//!
//! let mut rays = RayBatch::default();
//! rays.push_ray(DVec3::new(0.25, 0.75, 2.0), DVec3::NEG_Z);
//! let mut hits = HitBatch::default();
//! scene.closest_hits(&rays, Coherence::Incoherent, &mut hits);
//! assert!(hits.face(0).is_some_and(|hit| !hit.back));
//! # Ok::<(), radiosity::embree::EmbreeError>(())
//! ```
//!
//! [`return_freed_blocks`] stands here as the one other call of C.
//!
//! # Why not embree4-rs
//!
//! The crate embree4-rs 0.0.16 binds the same library, and serves here as an independent reference in the tests and
//! benchmarks. It does not trace the program's rays, because:
//!
//! - it is written against the headers of Embree 4.2. Since 4.3, `RTCHit` has one more field: the library writes four
//!   bytes behind each `RTCRayHit` of those headers, so every hit of its safe `intersect_1` damages the stack. Headers
//!   that are compiled in C, and compared with the library when a [`Device`] is opened, cannot disagree like that;
//! - it hands the configuration string to C without the zero at its end, copies (and drops) the user's object in the
//!   callbacks of user geometry, and checks no index;
//! - it reads the device's error after every ray, has no occlusion queries, and traces one ray at a time: packets of
//!   sixteen are faster for bundles that go from patch to patch.
//!
//! Rates: `docs/performance.md`.

#![allow(unsafe_code, reason = "here, and here alone, Rust meets C")]

mod allocator;
mod device;
mod error;
mod ffi;
mod rays;
mod scene;

pub use allocator::return_freed_blocks;
pub use device::Device;
pub use error::{EmbreeError, Version};
pub use scene::{CommittedScene, SceneBuilder};
