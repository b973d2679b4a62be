//! States of many chains.

use super::acceptance;
use crate::{
    path::{Contribution, Contributions, Elsewhere, Whole},
    sample::Points,
};

/// The current states of a batch of chains, each with the expected weight it has gathered and not yet recorded.
///
/// Chains are put into lit states before their first step, and never leave the light: a dark proposal is not accepted.
pub struct Walkers {
    /// Where each chain is.
    pub points: Points,
    /// What it contributes there.
    pub states: Vec<Contribution>,
    /// What it gives to the film elsewhere.
    pub elsewhere: Elsewhere,
    /// Expected weight since the state was entered or last recorded.
    pub pending: Vec<f64>,
}

impl Walkers {
    /// `lanes` chains that wait to be put into a state.
    pub fn new(lanes: usize) -> Walkers {
        Walkers {
            points: Points::new(lanes),
            states: vec![Contribution::NONE; lanes],
            elsewhere: Elsewhere::new(lanes),
            pending: vec![0.0; lanes],
        }
    }

    /// All that a chain's state contributes.
    #[inline(always)]
    pub fn whole(&self, lane: usize) -> Whole<'_> {
        Whole { main: &self.states[lane], elsewhere: self.elsewhere.of(lane) }
    }

    /// One Metropolis step of a chain at inverse temperature `beta` towards lane `from` of the proposed points and of what
    /// they contribute: both states are weighted by their probabilities, whatever `u`, uniform in (0, 1), then decides.
    ///
    /// `record` receives states with their expected weights, once nothing more will be added to them; the weights
    /// of a step sum to one. Returns the acceptance probability.
    #[inline(always)]
    pub fn step(
        &mut self,
        lane: usize,
        beta: f64,
        (points, from): (&Points, usize),
        proposed: &Contributions,
        u: f64,
        record: &mut impl FnMut(Whole, f64),
    ) -> f64 {
        let alpha = acceptance(beta, self.states[lane].ln_g, proposed.lanes[from].ln_g);
        self.pending[lane] += 1.0 - alpha;
        if u < alpha {
            self.replace(lane, (points, from), proposed, record);
            self.pending[lane] = alpha;
        } else if alpha > 0.0 {
            record(proposed.whole(from), alpha);
        }
        alpha
    }

    /// Puts a chain into lane `from` of those points and of what they contribute, with no weight yet; the old state is
    /// recorded.
    #[inline(always)]
    pub fn replace(
        &mut self,
        lane: usize,
        (points, from): (&Points, usize),
        out: &Contributions,
        record: &mut impl FnMut(Whole, f64),
    ) {
        self.flush(lane, record);
        self.points.copy(lane, points, from);
        self.states[lane] = out.lanes[from];
        self.elsewhere.copy(lane, &out.elsewhere, from);
    }

    /// Records what the chain's state has gathered.
    #[inline(always)]
    pub fn flush(&mut self, lane: usize, record: &mut impl FnMut(Whole, f64)) {
        let weight = std::mem::replace(&mut self.pending[lane], 0.0);
        if weight > 0.0 {
            record(self.whole(lane), weight);
        }
    }
}
