//! Solvers of the radiosity system B = E + diag(ρ) F B.

pub use crate::matrix::operator;
