//! The Metropolis process: acceptance, states of many chains, and the baseline that knows no temperatures.

mod baseline;
mod metropolis;
mod recorder;
mod target;
mod walkers;

pub use baseline::{Baseline, LARGE_STEP_PROBABILITY, Start};
pub use metropolis::acceptance;
pub use recorder::Recorder;
pub use target::{Evaluator, Target};
pub use walkers::Walkers;
