//! Solvers: their solutions, limits and stated errors.

mod classic;
mod furnace;
mod krylov;
mod limits;
mod mesh_error;
mod multigrid;
mod solvers;
mod stated_error;
