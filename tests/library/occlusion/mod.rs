//! Form factors behind occluders: against certified values, closed rooms, brute force and themselves.

use crate::embree::scenes;

mod bodies;
mod careless;
mod certified;
mod closed_rooms;
mod error_estimates;
mod independent;
mod invariants;
mod monte_carlo;
mod occluder_index;
mod piercing;
mod search;
mod shapes;
