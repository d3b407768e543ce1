//! Form factors behind occluders: against certified values, closed rooms, brute force and themselves.

#[path = "../embree/scenes.rs"]
#[allow(
    dead_code,
    reason = "made for rays; only the random numbers, motions and the builder are used here"
)]
mod scenes;

#[path = "../support/mod.rs"]
mod support;

mod blocker_index;
mod certified;
mod closed_rooms;
mod error_estimates;
mod independent;
mod invariants;
mod monte_carlo;
mod piercing;
mod search;
mod shapes;
