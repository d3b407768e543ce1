//! Matrices in tiles of rows: in full, as lists, or as blocks of columns with a bit for each that has an entry.

mod blocks;
mod choose;
mod dense;
mod gather;
mod matrix;
mod panels;
mod sparse;
mod store;

pub(super) use matrix::Rows;
