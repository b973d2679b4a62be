//! Scene files become the descriptions they mean, and faulty ones say where and why.

mod appearances;
mod descriptions;
mod faults;
mod files;
