//! Ladders of inverse temperatures: rungs, swaps, normalisers, and the weights that join the rungs' estimates.
//!
//! Everything here works on any [`Target`](crate::chain::Target); nothing knows of paths or scenes.
//!
//! A *rung* is a place on the ladder, a *replica* the carrier of a state that moves between rungs by swapping
//! inverse temperatures with its neighbour. The lowest rung, β = 0, is the uniform distribution: it has no chain but
//! fresh points, some every sweep, each of which is offered to the rung above.

mod block;
mod combination;
mod density;
mod estimate;
mod histogram;
mod ladder;
mod likelihood;
mod normalisers;
mod placement;
mod stepping;
#[cfg(test)]
mod test_targets;

pub use block::{Block, LAYERS, RungCounts, Statistics, layer};
pub use combination::{Combination, Weights};
pub use density::DensityOfStates;
pub use estimate::{Estimate, uniform_mean};
pub use histogram::Histogram;
pub use ladder::{Ladder, swap_acceptance};
pub use normalisers::Normalisers;
pub use placement::rungs;
pub use stepping::stepping_stones;
