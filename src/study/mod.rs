//! What runs leave behind, read and drawn.

pub mod ladder_page;
pub mod ladder_text;
pub mod metrics;
pub mod report;
pub mod results;
pub mod run_log;
pub mod statistics;
mod svg;
