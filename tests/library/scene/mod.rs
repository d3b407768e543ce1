//! Scenes: files, arrays, built-in scenes, cameras, and the orientation of faces.

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
