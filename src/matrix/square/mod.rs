//! Square tiles, the parts of symmetric matrices and of those on a disk.

mod both;
mod codec;
mod listed;
mod places;
mod tile;

pub(super) use both::Meeting;
pub(super) use codec::Form;
pub(super) use tile::{Placed, Square};
