//! Form factors: stored, checked and applied.

pub mod operator;
