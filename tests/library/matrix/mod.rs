//! Matrices of form factors: storage, repairs, and the errors that repairs leave.

mod balance_error;
mod disk;
mod repair;
mod storage;
mod symmetric;
