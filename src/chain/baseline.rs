//! The baseline: Metropolis light transport in primary sample space, one chain a lane.
//!
//! Source: Kelemen et al. 2002; the paper's comparison renders with it in two passes.

use super::{Evaluator, Recorder, Start, Target, Walkers, replay};
use crate::{
    path::Contribution,
    rng::{Counter, Purpose, Rng, open_unit_f64},
    sample::{Move, StepLaw},
};

/// Probability of proposing a fresh point of the cube instead of a small step (Kelemen et al. 2002 use 0.25 to 0.75
/// and report little difference; 0.3 is what their renderers' descendants ship).
pub const LARGE_STEP_PROBABILITY: f64 = 0.3;

/// A block of independent chains on g, started from given states.
pub struct Baseline<W> {
    walkers: Walkers,
    evaluator: Evaluator<W>,
    /// Uniform number of each lane's decision at this step.
    decisions: Vec<f64>,
    steps: u64,
    /// Σ of acceptance probabilities of small steps and how many there were.
    pub small: (f64, u64),
    /// The same of large steps.
    pub large: (f64, u64),
}

impl<W: Default> Baseline<W> {
    /// Chains `first_chain`, `first_chain + 1`, … put into those states by replaying them.
    pub fn new<T: Target<Workspace = W>>(target: &T, rng: Rng, first_chain: u32, starts: &[Start]) -> Baseline<W> {
        let counter =
            |lane: usize| Counter { ladder: first_chain + lane as u32, replica: 0, step: 0, purpose: Purpose::Primary };
        let mut walkers = Walkers::new(starts.len());
        let mut evaluator = Evaluator::new(rng, (0..starts.len()).map(counter).collect());
        replay(target, starts, &mut walkers, &mut evaluator);
        Baseline { walkers, evaluator, decisions: vec![0.0; starts.len()], steps: 0, small: (0.0, 0), large: (0.0, 0) }
    }

    /// Every chain makes `steps` steps; states go to layer 0 as `unit` · f/g.
    pub fn advance<T: Target<Workspace = W>>(&mut self, target: &T, steps: u64, unit: f64, recorder: &mut Recorder) {
        let mut record = record_luminance_normalised(unit, recorder);
        for _ in 0..steps {
            self.step(target, &mut record);
        }
    }

    fn step<T: Target<Workspace = W>>(&mut self, target: &T, record: &mut impl FnMut(&Contribution, f64)) {
        let rng = self.evaluator.rng();
        for lane in 0..self.decisions.len() {
            self.evaluator.counters[lane].step = self.steps;
            let counter = Counter { purpose: Purpose::Step, ..self.evaluator.counters[lane] };
            let [decision, kind, ..] = rng.words(counter, 0).map(open_unit_f64);
            self.decisions[lane] = decision;
            self.evaluator.moves[lane] = if kind < LARGE_STEP_PROBABILITY { Move::Fresh } else { Move::Small(StepLaw::KELEMEN) };
        }
        self.evaluator.evaluate(target, &self.walkers.points);
        for lane in 0..self.evaluator.moves.len() {
            let u = self.decisions[lane];
            let proposed = self.evaluator.out.lanes[lane];
            let alpha = self.walkers.step(lane, 1.0, (&self.evaluator.points, lane), &proposed, u, record);
            let count = if self.evaluator.moves[lane] == Move::Fresh { &mut self.large } else { &mut self.small };
            *count = (count.0 + alpha, count.1 + 1);
        }
        self.steps += 1;
    }

    /// Records what the current states have gathered, without changing them.
    pub fn record_pending(&self, unit: f64, recorder: &mut Recorder) {
        let mut record = record_luminance_normalised(unit, recorder);
        for (state, &weight) in self.walkers.states.iter().zip(&self.walkers.pending) {
            if weight > 0.0 {
                record(state, weight);
            }
        }
    }

    /// Mutations so far.
    pub fn mutations(&self) -> u64 {
        self.steps * self.walkers.states.len() as u64
    }

    /// Rays traced and contributions settled so far.
    pub fn rays_and_faults(&self) -> (u64, u64) {
        (self.evaluator.out.rays, self.evaluator.out.non_finite)
    }
}

/// Records f/g · weight · `unit` in layer 0.
fn record_luminance_normalised(unit: f64, recorder: &mut Recorder) -> impl FnMut(&Contribution, f64) {
    move |state, weight| recorder.splat(0, state, unit * weight / state.g(), weight)
}
