//! What runs leave behind, read and drawn.

pub mod error_image;
pub mod flip;
pub mod ladder_page;
pub mod ladder_text;
pub mod metrics;
pub mod reference;
pub mod reference_progress;
pub mod results;
pub mod run_log;
mod svg;
