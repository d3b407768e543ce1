//! Patches: the faces of a scene, subdivided, with the vertices that carry interpolated values.

mod build;
mod contact_edge;
mod contact_edges;
mod crossed;
mod face_shape;
mod grid;
mod hash;
pub mod hierarchy;
mod join;
mod patch;
mod patches;
mod pieces;
mod planes;
mod seams;
mod subdivide;

pub use contact_edges::ContactEdges;
pub use crossed::CrossedPatch;
pub use hierarchy::{Hierarchy, Prolongation};
pub use patch::{Patch, PatchId, PatchPoint};
pub use patches::Mesh;
pub(crate) use seams::mean_value_weights;
pub use subdivide::{MeshError, MeshOptions, Subdivision};
