//! Bindings to the installed Embree 4 for embree4-rs 0.0.16, in place of the crate that it is written against.
//!
//! That crate's headers are those of Embree 4.2. Since 4.3 `RTCHit` may have one more field, so that the library
//! writes four bytes behind the `RTCRayHit` that embree4-rs hands to it. Here the structs keep the fields that
//! embree4-rs names, and [`RTCRayHit`] is as large as the library's: the additional field falls into its padding.
//! All else comes from the installed headers.
#![allow(
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals,
    missing_docs,
    clippy::all,
    clippy::pedantic,
    reason = "generated from C, in Embree's names"
)]

use std::mem::offset_of;

include!(concat!(env!("OUT_DIR"), "/embree.rs"));

/// The geometry id of a ray that hits nothing.
pub const RTC_INVALID_GEOMETRY_ID: u32 = u32::MAX;

/// A hit, without the field that Embree 4.3 added at its end.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RTCHit {
    pub Ng_x: f32,
    pub Ng_y: f32,
    pub Ng_z: f32,
    pub u: f32,
    pub v: f32,
    pub primID: u32,
    pub geomID: u32,
    pub instID: [u32; 1],
}

/// A ray and its hit, with room at the end for the field that [`RTCHit`] lacks.
#[repr(C, align(32))]
#[derive(Debug, Clone, Copy)]
pub struct RTCRayHit {
    pub ray: RTCRay,
    pub hit: RTCHit,
}

const _: () = {
    assert!(size_of::<RTCRayHit>() >= HEADER_RAY_HIT_SIZE as usize);
    assert!(align_of::<RTCRayHit>().is_multiple_of(HEADER_RAY_HIT_ALIGN as usize));
    assert!(offset_of!(RTCRayHit, hit) == HEADER_HIT_OFFSET as usize);
    assert!(offset_of!(RTCHit, Ng_x) == HEADER_NG_X_OFFSET as usize);
    assert!(offset_of!(RTCHit, u) == HEADER_U_OFFSET as usize);
    assert!(offset_of!(RTCHit, v) == HEADER_V_OFFSET as usize);
    assert!(offset_of!(RTCHit, primID) == HEADER_PRIM_ID_OFFSET as usize);
    assert!(offset_of!(RTCHit, geomID) == HEADER_GEOM_ID_OFFSET as usize);
    assert!(offset_of!(RTCHit, instID) == HEADER_INST_ID_OFFSET as usize);
};

impl Default for RTCHit {
    fn default() -> Self {
        Self {
            Ng_x: 0.0,
            Ng_y: 0.0,
            Ng_z: 0.0,
            u: 0.0,
            v: 0.0,
            primID: RTC_INVALID_GEOMETRY_ID,
            geomID: RTC_INVALID_GEOMETRY_ID,
            instID: [RTC_INVALID_GEOMETRY_ID],
        }
    }
}

impl Default for RTCRay {
    fn default() -> Self {
        Self {
            org_x: 0.0,
            org_y: 0.0,
            org_z: 0.0,
            tnear: 0.0,
            dir_x: 0.0,
            dir_y: 0.0,
            dir_z: 0.0,
            time: 0.0,
            tfar: f32::INFINITY,
            mask: u32::MAX,
            id: 0,
            flags: 0,
        }
    }
}

impl Default for RTCBuildQuality {
    fn default() -> Self {
        Self::MEDIUM
    }
}

impl Default for RTCSceneFlags {
    fn default() -> Self {
        Self::NONE
    }
}

impl Default for RTCBounds {
    fn default() -> Self {
        Self {
            lower_x: 0.0,
            lower_y: 0.0,
            lower_z: 0.0,
            align0: 0.0,
            upper_x: 0.0,
            upper_y: 0.0,
            upper_z: 0.0,
            align1: 0.0,
        }
    }
}
