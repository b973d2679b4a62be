//! How often chains change the technique of their paths, and what comes of it.

use serde::Serialize;

/// Probability that a step that is not large is a change of technique, where the target has any.
pub const TECHNIQUE_CHANGES: f64 = 0.25;

/// What became of changes of technique.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TechniqueChanges {
    /// Those that were drawn and led to the technique at work.
    pub stayed: u64,
    /// Those that led to another.
    pub proposed: u64,
    /// Σ of acceptance probabilities of the latter.
    pub accepted: f64,
}

impl TechniqueChanges {
    /// Counts a change to another technique that was accepted with probability `alpha`.
    pub fn count(&mut self, alpha: f64) {
        self.proposed += 1;
        self.accepted += alpha;
    }

    /// Adds another count.
    pub fn merge(&mut self, other: &TechniqueChanges) {
        self.stayed += other.stayed;
        self.proposed += other.proposed;
        self.accepted += other.accepted;
    }
}
