//! Images of solved scenes: layout, layers, files and verification.

mod daylight;
mod display;
mod exr_tools;
mod field;
mod files;
mod gather;
mod gathered_points;
mod layers;
mod perspective;
mod pixel_samples;
mod scenes;
mod unfolded;
mod verification;
