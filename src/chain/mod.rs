//! The Metropolis process: acceptance, states of many chains, and the baseline that knows no temperatures.

mod baseline;
mod changes;
mod importance;
mod metropolis;
mod plan;
mod recorder;
mod start;
mod target;
mod walkers;
mod whereabouts;

pub use baseline::{Baseline, LARGE_STEP_PROBABILITY, LargeSteps, Moments, SavedBaseline, baseline_layer};
pub use changes::{TECHNIQUE_CHANGES, TechniqueChanges};
pub use importance::{Importance, Measure};
pub use metropolis::acceptance;
pub use plan::{FEWEST_BLOCKS, Plan};
pub use recorder::Recorder;
pub use start::{Start, replay, resample};
pub use target::{Evaluator, Target};
pub use walkers::Walkers;
pub use whereabouts::Whereabouts;
