//! View factors and radiosity for diffuse scenes, with an error stated for every number.
//!
//! A scene of flat faces becomes form factors, radiosities and images:
//!
//! ```text
//! scene file ──▶ Scene ──▶ Mesh (patches) ──▶ FormFactors ──▶ RadiositySystem ──▶ Solution ──▶ Image ──▶ .exr
//!    scene/          mesh/     visibility/ +       matrix/          solver/          render/
//!                             form_factor/
//!                   plan examines the scene first and omits unneeded work; report describes the work and its accuracy.
//! ```
//!
//! Each arrow is one call with one input and one output. Dependencies point one way; no module imports one on its left:
//!
//! ```text
//! cli, python → document → experiment → workflow → audit → report, render → heat, solver → form_factor → matrix, visibility → mesh → scene, geometry
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`scene`] | a validated scene; OBJ and MTL files; cameras; the built-in scenes |
//! | [`mesh`] | patches: faces cut so that flat neighbours match |
//! | [`embree`] | Embree 4 behind a small C interface: the only unsafe code |
//! | [`visibility`] | visibility: through Embree, or in f64 by brute force |
//! | [`form_factor`] | the methods, one file each |
//! | [`matrix`] | form factors stored, checked, made symmetric, applied |
//! | [`solver`] | the solvers, one file each, behind one trait |
//! | [`voxel`] | discrete radiosity: integer lines between voxels |
//! | [`heat`] | boundary conditions, solar and thermal band, temperatures; sun and sky |
//! | [`render`] | images: layers, OpenEXR, preview, and their verification |
//! | [`workflow`] | whole studies: all of the above in turn, with the stated errors, the audit and the warnings |
//! | [`audit`] | conservation checks of form factors, solutions and images |
//! | [`experiment`] | methods side by side; the papers' tables beside ours; solvers on stiff and extreme systems |
//! | [`plan`], [`report`], [`progress`] | the needed work, the results, and the state of the work |
//! | [`checkpoint`] | finished pieces of long work, which a later run reuses |
//! | [`ranks`] | several processes that share the work, by MPI |
//! | [`geometry`] | polygons, closed forms, quadrature, sampling |
//! | [`document`] | the JSON that the program prints, one typed structure for each command |
//! | [`cli`] | the command-line program |
//! | [`notation`], [`references`] | symbols and sources |
//!
//! # Example
//!
//! The light of the Lewis room, with its error:
//!
//! ```
//! use radiosity::matrix::Need;
//! use radiosity::mesh::Subdivision;
//! use radiosity::scene::builtin;
//! use radiosity::workflow::{Context, FormFactorRequest, Model, SolveRequest, Use};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut cx = Context::default();
//! let scene = builtin::build("lewis-room", Some(1))?.scene;
//! let mut model = Model::new(scene, "lewis-room", Subdivision::Uniform(1).into(), Use::Light, &mut cx)?;
//! let factors = model.form_factors(&FormFactorRequest::default(), Need::default(), &mut cx)?;
//! let study = model.solve(&factors, &SolveRequest::default(), &mut cx)?;
//! println!("{:?} W/m², {:?}", model.surface_means(&study.solution.radiosity), study.error);
//! # assert!(study.error.relative().is_some_and(|error| error < 1e-4));
//! # Ok(())
//! # }
//! ```
//!
//! Two squares from arrays, one above the other, of which the lower one emits 1 W/m²:
//!
//! ```
//! use radiosity::matrix::Need;
//! use radiosity::mesh::Subdivision;
//! use radiosity::scene::{Material, SceneBuilder};
//! use radiosity::workflow::{Context, FormFactorRequest, Model, SolveRequest, Use};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut builder = SceneBuilder::new();
//! let surfaces = [builder.surface("lower")?, builder.surface("upper")?];
//! let mut grey = |name: &str, exitance: f64| {
//!     builder.material(Material { name: name.into(), reflectance: [0.5; 3], exitance: [exitance; 3] })
//! };
//! let materials = [grey("lamp", 1.0)?, grey("wall", 0.0)?];
//! let vertices = [
//!     [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0],
//!     [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0],
//! ];
//! builder.faces(&vertices, &[[0, 1, 2, 3], [4, 7, 6, 5]], &surfaces, &materials)?;
//!
//! let mut cx = Context::default();
//! let mut model = Model::new(builder.build()?.scene, "squares", Subdivision::Uniform(1).into(), Use::Light, &mut cx)?;
//! let factors = model.form_factors(&FormFactorRequest::default(), Need::default(), &mut cx)?;
//! let study = model.solve(&factors, &SolveRequest::default(), &mut cx)?;
//!
//! // B of the lower square is 1 / (1 − ρ² F²), with F = 0.199825 (closed form of opposed squares).
//! let lower = study.solution.radiosity.row(0)[0];
//! let error = study.error.relative().expect("the form factors state their errors");
//! println!("{lower:.6} W/m², off by about {error:.1e} of it");
//! assert!((lower - 1.0 / (1.0 - 0.25 * 0.199_824_9_f64.powi(2))).abs() < 2.0 * error * lower);
//! assert!(cx.warnings().is_empty());
//! # Ok(())
//! # }
//! ```

pub mod audit;
pub mod checkpoint;
#[cfg(feature = "cli")]
pub mod cli;
mod disjoint_sets;
pub mod document;
pub mod embree;
#[cfg(feature = "reports")]
pub mod experiment;
pub mod form_factor;
pub mod geometry;
pub mod heat;
mod in_order;
mod input_file;
pub mod matrix;
pub mod mesh;
pub mod notation;
mod parameter;
pub mod plan;
mod printable;
pub mod progress;
pub mod ranks;
pub mod references;
pub mod render;
pub mod report;
pub mod scene;
pub mod setting;
pub mod solver;
mod threads;
pub mod visibility;
pub mod voxel;
mod whole_file;
pub mod workflow;
