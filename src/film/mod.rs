//! Accumulation of splats, reconstruction filters, and image files.

pub mod filter;

pub use filter::Filter;
