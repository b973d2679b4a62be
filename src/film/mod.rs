//! Accumulation of splats, reconstruction filters, and image files.
//!
//! A splat's way: [`Footprint::spread`] gives the pixels that a film position reaches, [`Splats`] gathers what
//! one block of chains gave them, [`Accumulator::deposit`] adds it up without losing a bit, and
//! [`exr_file`] and [`png_file`] write the [`Image`] that comes of it.

pub mod accumulator;
pub mod exr_file;
pub mod file;
pub mod filter;
pub mod heuristics;
pub mod image;
pub mod png_file;

pub use accumulator::{Accumulator, Splat, Splats};
pub use exr_file::Value;
pub use file::FileError;
pub use filter::{Filter, Footprint};
pub use heuristics::Heuristic;
pub use image::{Image, PixelFormat, Plane, Window};
