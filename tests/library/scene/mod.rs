//! Scenes: files, built-in scenes, cameras, and which way faces look.

mod builtin;
mod camera;
mod facing;
mod load;
mod write;
