//! Mathematics that knows nothing of rendering: frames, warps with density and inverse, elementary functions.

mod cumulative;
pub mod denormals;
mod elementary;
mod frame;
mod instructions;
pub mod warp;

pub use cumulative::{Cumulative, place_within};
pub use elementary::{lift, ln2_scaled_exp, offset_origin, sin_cos_turn};
pub use frame::Frame;
pub use instructions::{in_use, widest};
