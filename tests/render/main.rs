//! Images of solved scenes: layout, layers, files and verification.

#![expect(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod files;
mod layers;
mod scenes;
mod unfolded;
mod verification;
