//! Square tiles, of which symmetric matrices and those on a disk are made.

mod both;
mod codec;
mod listed;
mod places;
mod tile;

pub(super) use both::Meeting;
pub(super) use codec::Form;
pub(super) use tile::{Placed, Square};
