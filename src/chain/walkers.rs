//! States of many chains.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::acceptance;
use crate::{
    path::{Contribution, Contributions, Elsewhere, Whole},
    sample::Points,
};

/// The current states of a batch of chains, each with the expected weight it has gathered and not yet recorded.
///
/// Chains are put into lit states before their first step, and never leave the light: a dark proposal is not accepted.
#[derive(Clone, Debug, Serialize, Deserialize)]
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

    /// Whether these are so many chains, all of which can go on; what was read from a file may be anything.
    pub fn fits(&self, lanes: usize) -> bool {
        let of = [self.points.lanes(), self.states.len(), self.pending.len()];
        of == [lanes; 3] && self.elsewhere.fits(lanes) && self.states.iter().all(|state| !state.ln_g.is_nan())
    }

    /// Some of the chains, as a batch of their own.
    pub fn some(&self, lanes: Range<usize>) -> Walkers {
        let mut some = Walkers::new(lanes.len());
        for (to, from) in lanes.enumerate() {
            some.copy(to, self, from);
        }
        some
    }

    /// All chains of several batches as one.
    pub fn joined<'a>(batches: impl Iterator<Item = &'a Walkers> + Clone) -> Walkers {
        let mut all = Walkers::new(batches.clone().map(|batch| batch.states.len()).sum());
        let lanes = batches.flat_map(|batch| (0..batch.states.len()).map(move |lane| (batch, lane)));
        for (to, (batch, from)) in lanes.enumerate() {
            all.copy(to, batch, from);
        }
        all
    }

    fn copy(&mut self, to: usize, other: &Walkers, from: usize) {
        self.points.copy(to, &other.points, from);
        self.states[to] = other.states[from];
        self.elsewhere.copy(to, &other.elsewhere, from);
        self.pending[to] = other.pending[from];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{path::FilmSplat, scene::Rgb};

    /// Lane i contributes i + 1 at its own place and i times 1 elsewhere.
    fn proposed() -> Contributions {
        let mut out = Contributions::new(3);
        for lane in 0..3 {
            (0..lane).for_each(|_| out.elsewhere.push(lane, FilmSplat { film: [0.5; 2], rgb: Rgb::splat(1.0) }));
            let rgb = Rgb::splat(lane as f32 + 1.0);
            out.lanes[lane] = Contribution::settle_whole([0.0; 2], rgb, &mut out.elsewhere, lane).0;
        }
        out
    }

    #[test]
    fn what_a_state_gives_elsewhere_comes_and_goes_with_it() {
        let (points, out) = (Points::new(3), proposed());
        let mut walkers = Walkers::new(1);
        let mut seen = Vec::new();
        let mut record = |whole: Whole, weight: f64| seen.push((whole.main.rgb.x, whole.elsewhere.len(), weight));
        walkers.replace(0, (&points, 2), &out, &mut record);
        // from 5 to 1 with α = 1/5, refused; to 3 with α = 3/5, accepted; to nothing
        assert!((walkers.step(0, 1.0, (&points, 0), &out, 0.9, &mut record) - 0.2).abs() < 1e-6);
        assert!((walkers.step(0, 1.0, (&points, 1), &out, 0.5, &mut record) - 0.6).abs() < 1e-6);
        walkers.flush(0, &mut record);
        let expected = [(1.0, 0, 0.2), (3.0, 2, 1.2), (2.0, 1, 0.6)];
        assert_eq!(seen.len(), expected.len(), "{seen:?}");
        for (got, expected) in seen.iter().zip(expected) {
            assert_eq!((got.0, got.1), (expected.0, expected.1), "{seen:?}");
            assert!((got.2 - expected.2).abs() < 1e-6, "{seen:?}");
        }
    }
}
