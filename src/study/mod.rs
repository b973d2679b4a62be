//! What runs leave behind, read and drawn.

pub mod collect;
pub mod error_image;
pub mod file;
pub mod flip;
pub mod forecast;
pub mod jobs;
pub mod ladder_page;
pub mod ladder_text;
pub mod metrics;
pub mod record;
pub mod reference;
pub mod reference_progress;
pub mod report;
pub mod results;
pub mod run_log;
pub mod runner;
pub mod statistics;
mod svg;
