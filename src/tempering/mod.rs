//! Ladders of inverse temperatures: rungs, swaps, normalisers, and the weights that join the rungs' estimates.
//!
//! Everything here works on any [`Target`](crate::chain::Target); nothing knows of paths or scenes.
//!
//! A *rung* is a place on the ladder, a *replica* the carrier of a state that moves between rungs by swapping
//! inverse temperatures with its neighbour. The lowest rung, β = 0, is the uniform distribution: it has no chain but
//! fresh points, some every sweep, each of which is offered to the rung above.

mod agreement;
mod block;
mod choices;
mod density;
mod estimate;
mod histogram;
mod independent;
mod ladder;
mod likelihood;
mod normalisers;
mod placement;
mod probes;
mod report;
mod sampler;
mod stepping;
mod steps;
mod tail;
mod tally;
#[cfg(test)]
mod test_targets;
mod trips;
mod tuning;
mod weights;

pub use agreement::{Mixing, effective_samples};
pub use block::{Block, BlockStatistics, Crew, SavedBlock};
pub use choices::{Choices, Combine, LadderChoice};
pub use density::DensityOfStates;
pub use estimate::{Estimate, uniform_mean};
pub use histogram::Histogram;
pub use ladder::{Ladder, swap_acceptance};
pub use normalisers::Normalisers;
pub use placement::rungs;
pub use probes::{ProbeMap, Probes};
pub use report::{LnEstimate, Normaliser, NormaliserEstimates, RoundReport, RungReport, ScaleReport};
pub use sampler::{Development, Learning, Learnt, Sampler, Setup};
pub use stepping::stepping_stones;
pub use steps::StepMix;
pub use tail::Tail;
pub use tally::{Canvas, Layers, PointGroups, PointLayer, Round, RungCounts, SavedTally, Seen, Sum, Tally};
pub use weights::Weights;
