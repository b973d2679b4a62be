//! Ladders of inverse temperatures: rungs, swaps, normalisers, and the weights that join the rungs' estimates.
//!
//! Everything here works on any [`Target`](crate::chain::Target); nothing knows of paths or scenes.
//!
//! A *rung* is a place on the ladder, a *replica* the carrier of a state that moves between rungs by swapping
//! inverse temperatures with its neighbour. The lowest rung, β = 0, is the uniform distribution: it has no chain but
//! fresh points, some every sweep, each of which is offered to the rung above.

mod block;
mod combination;
mod histogram;
mod ladder;
mod normalisers;
mod report;

pub use block::{Block, LAYERS, RungCounts, Statistics, layer};
pub use combination::{Combination, Weights};
pub use histogram::Histogram;
pub use ladder::{Ladder, swap_acceptance};
pub use normalisers::{Estimate, Group, Normalisers, uniform_mean};
pub use report::{LnEstimate, Normaliser, NormaliserEstimates, RoundReport, RungReport, ScaleReport};
