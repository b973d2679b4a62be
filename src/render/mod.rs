//! From a job to files: settings, budgets, progress, log, output.

pub mod log;
pub mod output;
pub mod progress;
pub mod settings;
pub mod status;

pub use output::{Output, Picture};
pub use settings::{Combine, LadderChoice, Method, PacketChoice, Settings};
pub use status::{Observer, RunStart, Status, Summary};
