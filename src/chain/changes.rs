//! How often chains change the technique of their paths, and what comes of it.
//!
//! Changes are made beside the steps: some chains, before they step, go on to another technique of their path. That leaves
//! the distribution unchanged, so the weights of steps stay what they are; only the old state's is recorded where it ends.

use serde::{Deserialize, Serialize};

use super::{Evaluator, Target, Walkers, acceptance};
use crate::{
    path::Whole,
    rng::{Counter, Purpose, open_unit_f64},
    sample::{Move, Points},
};

/// Probability that a chain changes its technique before a step, where the target has any.
///
/// What that brings and costs on the multiplexed mapping: relMSE without / with at 32 mutations per pixel of 256 × 256,
/// medians of three seeds, and how much more processor time a mutation takes:
///
/// | | `cornell-box` | `caustic` | `lattice` |
/// |---|---|---|---|
/// | `mlt` | 0.062 / 0.058, × 1.4 | 0.092 / 0.088, × 1.6 | 0.82 / 0.68, × 1.9 |
/// | `re`, K = 3 | 0.052 / 0.051, × 1.3 | 0.129 / 0.137, × 1.25 | 0.86 / 0.78, × 1.5 |
///
/// At equal time that loses, so runs do it only where asked to. In the place of steps instead of beside them, chains lost
/// a third at equal numbers of steps too: a path that stays where it is lights no other pixel.
pub const TECHNIQUE_CHANGES: f64 = 0.25;
/// First of the blocks that draw techniques: those before are the proposals'.
const FIRST_BLOCK: u16 = 1 << 14;

/// What became of changes of technique, whose evaluations are not counted as mutations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TechniqueChanges {
    /// Those that were drawn and led to the technique at work.
    pub stayed: u64,
    /// Those that led to another.
    pub proposed: u64,
    /// Σ of acceptance probabilities of the latter.
    pub accepted: f64,
}

impl TechniqueChanges {
    /// Counts a change that was accepted with that probability; `None` where it led to the technique at work.
    pub fn count(&mut self, alpha: Option<f64>) {
        match alpha {
            None => self.stayed += 1,
            Some(alpha) => (self.proposed, self.accepted) = (self.proposed + 1, self.accepted + alpha),
        }
    }

    /// Adds another count.
    pub fn merge(&mut self, other: &TechniqueChanges) {
        self.stayed += other.stayed;
        self.proposed += other.proposed;
        self.accepted += other.accepted;
    }
}

impl<W: Default> Evaluator<W> {
    /// Draws which of the first `lanes` lanes change their technique and how, at the inverse temperature that each has, and
    /// evaluates what that leads to; all others rest. `drawn` lists those lanes, also such that keep their technique.
    pub fn propose_changes<T: Target<Workspace = W>>(
        &mut self,
        target: &T,
        current: &Points,
        lanes: usize,
        beta: impl Fn(usize) -> f64,
    ) {
        self.moves.fill(Move::Rest);
        self.drawn.clear();
        let mut any = false;
        for lane in 0..lanes {
            let counter = Counter { purpose: Purpose::Step, ..self.counters[lane] };
            if open_unit_f64(self.rng().words(counter, 0)[2]) < TECHNIQUE_CHANGES {
                self.drawn.push(lane);
                any |= self.change_technique(target, current, lane, beta(lane));
            }
        }
        if any {
            // words of the steps to come are others
            self.counters[..lanes].iter_mut().for_each(|counter| counter.purpose = Purpose::Technique);
            self.evaluate(target, current);
            self.counters[..lanes].iter_mut().for_each(|counter| counter.purpose = Purpose::Primary);
        }
    }

    /// Makes a lane's next move a change of technique at that inverse temperature, or rest where there is nothing to change;
    /// whether there is.
    pub fn change_technique<T: Target<Workspace = W>>(
        &mut self,
        target: &T,
        current: &Points,
        lane: usize,
        beta: f64,
    ) -> bool {
        let counter = Counter { purpose: Purpose::Technique, ..self.counters[lane] };
        let (rng, mut blocks) = (self.rng(), FIRST_BLOCK..);
        let mut random = || rng.words(counter, blocks.next().expect("paths are shorter"));
        let rays = &mut self.out.rays;
        self.given.clear(lane);
        let change = target.change_technique((current, lane), beta, &mut random, &mut self.given, rays);
        // nothing is known of the odds of a change that is not finite: it must not reach an acceptance probability
        let change = change.filter(|expected| expected.is_finite());
        self.moves[lane] = if change.is_some() { Move::Given } else { Move::Rest };
        self.expected[lane] = change.unwrap_or(0.0);
        change.is_some()
    }

    /// Puts a drawn lane's chain into what its change led to, or leaves it. The probability of the former; `None` where
    /// the technique stays the same.
    pub fn settle_change(
        &self,
        walkers: &mut Walkers,
        lane: usize,
        beta: f64,
        record: &mut impl FnMut(Whole, f64),
    ) -> Option<f64> {
        if self.moves[lane] == Move::Rest {
            return None;
        }
        let alpha = acceptance(beta, walkers.states[lane].ln_g + self.expected[lane], self.out.lanes[lane].ln_g);
        let counter = Counter { purpose: Purpose::Step, ..self.counters[lane] };
        if open_unit_f64(self.rng().words(counter, 0)[3]) < alpha {
            walkers.replace(lane, (&self.points, lane), &self.out, record);
        }
        Some(alpha)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        path::Contributions,
        rng::Rng,
        sample::{Block, Proposals},
    };

    /// Has nothing but changes of technique, whose expected change of ln g is known beforehand.
    struct Expecting(f64);

    impl Target for Expecting {
        type Workspace = ();

        fn evaluate(&self, _: &mut Proposals, _: &mut Contributions, _: &mut ()) {}

        fn change_technique(
            &self,
            _: (&Points, usize),
            _: f64,
            _: &mut dyn FnMut() -> Block,
            _: &mut Points,
            _: &mut u64,
        ) -> Option<f64> {
            Some(self.0)
        }
    }

    #[test]
    fn a_change_of_unknown_odds_is_none() {
        for (expected, changes) in [(0.5, true), (f64::NAN, false), (f64::INFINITY, false), (f64::NEG_INFINITY, false)]
        {
            let counter = Counter { ladder: 0, replica: 0, step: 0, purpose: Purpose::Primary };
            let mut evaluator = Evaluator::<()>::new(Rng::new(1), vec![counter]);
            assert_eq!(
                evaluator.change_technique(&Expecting(expected), &Points::new(1), 0, 1.0),
                changes,
                "{expected}"
            );
            assert_eq!(evaluator.moves[0] == Move::Rest, !changes);
            assert!(evaluator.expected[0].is_finite());
            let alpha = evaluator.settle_change(&mut Walkers::new(1), 0, 1.0, &mut |_, _| {});
            assert_eq!(alpha.is_some(), changes, "{expected}: {alpha:?}");
        }
    }
}
