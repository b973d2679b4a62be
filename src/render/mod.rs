//! From a job to files: settings, budgets, progress, log, output.

mod baseline;
pub mod calibration;
pub mod clock;
pub mod engine;
pub mod log;
pub mod memory;
pub mod output;
pub mod progress;
mod replica_exchange;
mod run;
pub mod settings;
pub mod status;
#[cfg(test)]
mod tests;
pub mod trial;

pub use output::{Output, Picture};
pub use run::{Job, Outcome, RenderError, engine, run};
pub use settings::{
    Combine, LadderChoice, MappingChoice, Measure, Method, MltSettings, Normalisation, PacketChoice, Settings,
};
pub use status::{Observer, RunStart, SetUp, Status, Stop, Summary};
