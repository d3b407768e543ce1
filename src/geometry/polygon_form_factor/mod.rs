//! The exchange area of two polygons that see each other unoccluded.

mod contour;
mod double_double;
mod edge_pair;
mod facing;
mod gauss_lambert;
mod gauss_product;
mod prepared;
mod real;

#[cfg(test)]
mod tests;
