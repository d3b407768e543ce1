//! The base of all storages: numbers, sizes, memory that suits the processor, and the inner loops.

pub(super) mod aligned;
pub(super) mod coefficients;
pub(super) mod dot;
pub(super) mod expand;
pub(super) mod lanes;
pub(super) mod planes;
pub(super) mod prefetch;
pub(super) mod scalar;
pub(super) mod shared;
pub(super) mod sizes;
