//! Scenes: files, arrays, built-in scenes, cameras, and which way faces look.

mod arrays;
mod builder;
mod builtin;
mod camera;
mod facing;
mod formats;
mod load;
mod odd_files;
mod streams;
mod write;
