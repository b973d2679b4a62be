//! Statistics over the runs of a study: pure functions of [`Results`](super::results::Results).
//!
//! Error here is √relMSE unless said otherwise. Runs of a method differ in their seeds alone and are independent, so
//! all spreads and intervals are over runs, never over the correlated samples of one. An error whose correction for the
//! reference's noise leaves nothing (relMSE ≤ 0) is below what the reference can tell; it has no logarithm and is not
//! known here.

pub mod compare;
pub mod curves;
pub mod numbers;
pub mod scaling;
pub mod summary;

pub use compare::{Brightness, Ratio};
pub use curves::{Curve, Time};
pub use numbers::{Interval, Spread};
pub use summary::{MethodSummary, SceneSummary};
