//! Scene files become the descriptions they mean, and faulty ones say where and why.

mod appearances;
mod cameras;
mod descriptions;
mod faults;
mod files;
mod instances;
mod memory;
