//! From points of the unit cube to light paths and what they contribute.
//!
//! [`Mapping`] evaluates batches: `unidirectional` camera paths, or [`bidirectional`] paths from both ends.
//! [`scalar`] and [`bidirectional::scalar`] say the same for one point at a time, to be read and tested against.

pub mod bidirectional;
mod contribution;
mod layout;
mod mapping;
pub mod scalar;
mod tracing;
mod unidirectional;
mod vertex;

pub use contribution::{Contribution, Contributions, Elsewhere, FilmSplat, Lists, Outcome, Whole, luminance};
pub use layout::Layout;
pub use mapping::{Mapping, MappingKind, Workspace};
pub use tracing::{RecordedRays, Widths};
