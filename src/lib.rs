//! Light in diffuse scenes, as exactly as numbers allow, with an honest account of the error against the run time.
//!
//! A scene of flat faces goes in; form factors, radiosities and pictures come out:
//!
//! ```text
//! scene file ──▶ Scene ──▶ Mesh (patches) ──▶ FormFactors ──▶ RadiositySystem ──▶ Solution ──▶ Image ──▶ .exr
//!    scene/          mesh/     visibility/ +       matrix/          solver/          render/
//!                             form_factor/
//! plan looks at the scene first and leaves out what it does not need; report tells what was done, and how well.
//! ```
//!
//! Each arrow is one call with one input and one output. Dependencies point one way; nothing below imports anything above:
//!
//! ```text
//! cli → experiment → audit → report, render, solver → form_factor → matrix, visibility → mesh → scene, geometry
//! ```
//!
//! | module | what it holds |
//! |---|---|
//! | [`scene`] | a validated scene; OBJ and MTL files; cameras; the built-in scenes |
//! | [`mesh`] | patches: faces cut so that flat neighbours match |
//! | [`embree`] | Embree 4 behind a small C interface: the only unsafe code |
//! | [`visibility`] | who sees whom: through Embree, or in f64 by brute force |
//! | [`form_factor`] | the methods, one file each |
//! | [`matrix`] | form factors stored, checked, made symmetric, applied |
//! | [`solver`] | the solvers, one file each, behind one trait |
//! | [`voxel`] | discrete radiosity: integer lines between voxels |
//! | [`render`] | pictures: layers, OpenEXR, preview, and their verification |
//! | [`audit`] | the laws of light as a guard over form factors, solutions and pictures |
//! | [`experiment`] | methods side by side; the papers' tables beside ours; solvers on stiff and extreme systems |
//! | [`plan`], [`report`], [`progress`] | what is needed, what was done, how far it is |
//! | [`checkpoint`] | finished pieces of long work, for a later run to go on from |
//! | [`geometry`] | polygons, closed forms, quadrature, sampling |
//! | [`cli`] | the command-line program |
//! | [`notation`], [`references`] | symbols and sources |
//!
//! # Example
//!
//! The radiosity of the Lewis room, by shooting and conjugate gradients:
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use radiosity::form_factor::{FormFactorMethod, Input, RandomShooting};
//! use radiosity::geometry::sampling::Sequence;
//! use radiosity::matrix::operator::Block;
//! use radiosity::matrix::{StorageChoice, Weighting};
//! use radiosity::mesh::{Mesh, Subdivision};
//! use radiosity::progress::Silent;
//! use radiosity::scene::builtin;
//! use radiosity::solver::{self, RadiositySystem, SolveOptions, StopReason};
//! use radiosity::visibility::embree::EmbreeVisibility;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = builtin::build("lewis-room", Some(2))?.scene;
//! let mesh = Mesh::new(&scene, Subdivision::Uniform(1))?;
//! let visibility = EmbreeVisibility::new(&scene)?;
//!
//! let method = RandomShooting { rays: 4096, sequence: Sequence::Sobol, seed: 0 };
//! let input = Input { scene: &scene, mesh: &mesh, visibility: &visibility, unoccluded: false };
//! let raw = method.compute(input, StorageChoice::default(), &Silent)?.factors;
//! let (factors, _) = raw
//!     .symmetrised(Weighting::default())?
//!     .balanced(raw.row_targets(true), 1e-12, 100)?;
//!
//! let grey = |value: fn(&radiosity::scene::Material) -> f64| {
//!     let of_patch = |p: &radiosity::mesh::Patch| value(&scene.materials[p.material.0 as usize]);
//!     Block::from_values(mesh.patches.iter().map(of_patch).collect(), 1)
//! };
//! let system = RadiositySystem::new(&factors, mesh.areas(), grey(|m| m.reflectance[0]), grey(|m| m.exitance[0]))?;
//! let pcg = solver::solver("pcg", &solver::SolverSettings::default())?;
//! let solution = pcg.solve(&system, &SolveOptions::default(), &mut |_| ControlFlow::Continue(()))?;
//!
//! assert_eq!(solution.stop_reason, StopReason::Converged);
//! // What the hole in the ceiling lets in, 0.25 W, is absorbed by the walls: Σ (1 − ρ) H A.
//! let absorbed: f64 = (0..mesh.n_patches())
//!     .map(|i| {
//!         let rho = scene.materials[mesh.patches[i].material.0 as usize].reflectance[0];
//!         (1.0 - rho) * solution.irradiance.row(i)[0] * mesh.patches[i].area
//!     })
//!     .sum();
//! assert!((absorbed - 0.25).abs() < 1e-5);
//! # Ok(())
//! # }
//! ```

#![cfg_attr(
    not(feature = "cli"),
    allow(
        dead_code,
        unused_imports,
        reason = "what only the program or the experiments use inside of the crate"
    )
)]

pub mod audit;
pub mod checkpoint;
#[cfg(feature = "cli")]
pub mod cli;
mod disjoint_sets;
pub mod embree;
#[cfg(feature = "reports")]
pub mod experiment;
pub mod form_factor;
pub mod geometry;
mod in_order;
mod input_file;
pub mod matrix;
pub mod mesh;
pub mod notation;
pub mod plan;
mod printable;
pub mod progress;
pub mod references;
pub mod render;
pub mod report;
pub mod scene;
pub mod solver;
mod threads;
pub mod visibility;
pub mod voxel;
mod whole_file;
