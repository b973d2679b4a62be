//! From points of the unit cube to light paths and what they contribute.
//!
//! [`unidirectional`] is the batched mapping that renders; [`scalar`] says the same for one point at a time, to be
//! read and tested against.

mod contribution;
mod layout;
pub mod scalar;
pub mod unidirectional;
mod vertex;

pub use contribution::{Contribution, Contributions, Elsewhere, FilmSplat, Whole, luminance};
pub use layout::Layout;
