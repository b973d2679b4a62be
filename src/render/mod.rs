//! From a job to files: settings, budgets, progress, log, output.

pub mod allocation;
mod baseline;
pub mod calibration;
pub mod checkpoint;
pub mod clock;
pub mod engine;
pub mod health;
pub mod log;
pub mod memory;
mod merge;
pub mod output;
pub mod parts;
pub mod progress;
pub mod replay;
mod replica_exchange;
mod run;
pub mod settings;
pub mod shared;
pub mod status;
#[cfg(test)]
mod tests;
pub mod trial;

pub use checkpoint::{Checkpoint, CheckpointError, Resumed};
pub use health::{Health, Verdict};
pub use merge::{Merged, MergedPart, merge};
pub use output::{Output, Picture};
pub use run::{FLUSHED, Job, Outcome, RenderError, engine, restored, run, run_from, run_on, thread_pool};
pub use settings::{
    Combine, LadderChoice, MappingChoice, Measure, Method, MltSettings, Normalisation, PacketChoice, Parts, Settings,
};
pub use status::{Observer, RunStart, SetUp, Status, Stop, Summary};
