//! Many jobs on one machine: the file that lists them, the queue that survives whatever happens, who may render when, and
//! what came of it.

pub mod file;
pub mod queue;
pub mod summary;
pub mod turns;
