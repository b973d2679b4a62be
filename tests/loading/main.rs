//! Scene files become the descriptions they mean, and faulty ones say where and why.

mod appearances;
mod cameras;
mod corpora;
mod descriptions;
mod faults;
mod files;
mod harm;
mod instances;
mod memory;
