//! What the tests share: scenes and runs, statistics, evidence.

mod agreement;
mod scenes;
pub mod statistics;

pub use agreement::{Agreement, Expected};
pub use scenes::{OWN, fixed_widths, load, own, render, repository, runs, scene_of, settings};
