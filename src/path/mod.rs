//! From points of the unit cube to light paths and what they contribute.
//!
//! [`Mapping`] evaluates batches: `unidirectional` camera paths, or [`bidirectional`] paths from both ends.
//! `scalar` and `bidirectional::scalar` say the same for one point at a time ([`Mapping::walk`]), to be read and tested against.

pub mod bidirectional;
mod contribution;
mod faults;
mod lanes;
mod layout;
mod mapping;
mod scalar;
mod tracing;
mod unidirectional;
mod vertex;
mod walk;

pub use contribution::{
    Contribution, Contributions, Elsewhere, FilmSplat, Lists, Outcome, Whole, luminance, luminance_of_sums,
};
pub use faults::{Cause, Causes, Evaluation, Fault, Faults, Origin, Point};
pub use layout::Layout;
pub use mapping::{Mapping, MappingKind, Retraced, Workspace};
pub use tracing::{RecordedRays, Widths};
pub use walk::{Event, Narration, Quantity, first_fault};
