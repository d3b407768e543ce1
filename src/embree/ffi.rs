//! The bindings to `rays.h`, made by bindgen when the crate is built.
#![allow(
    missing_docs,
    non_camel_case_types,
    unreachable_pub,
    clippy::pedantic,
    clippy::allow_attributes_without_reason,
    reason = "generated from C, and private to this module"
)]

include!(concat!(env!("OUT_DIR"), "/rays.rs"));
