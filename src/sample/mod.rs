//! Primary samples: points of the unit cube and the moves between them.
//!
//! A point is a list of *blocks* of four dimensions, each dimension a `u32` read as a fraction of the circle
//! [0, 1). On that torus a step forwards and the same step backwards are equally likely without any care at the
//! borders. Only the blocks that a path consumed exist; the others are independent of everything, so drawing
//! them anew whenever a proposal reaches further is an exact Gibbs move and needs no time stamps.

mod mutation;
mod points;
mod proposals;
mod sobol;
mod strata;

pub use mutation::StepLaw;
pub use points::{LIGHT_STREAM, Points};
pub use proposals::{Move, Proposals};
pub use strata::{PixelOrder, StratifiedPoints};

/// Four primary dimensions.
pub type Block = [u32; 4];
