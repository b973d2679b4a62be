//! The baseline: Metropolis light transport in primary sample space, one chain a lane.
//!
//! Source: Kelemen et al. 2002; the paper's comparison renders with it in two passes.

use serde::{Deserialize, Serialize};

use super::{Evaluator, Recorder, Start, Target, TechniqueChanges, Walkers, Whereabouts, replay};
use crate::{
    path::{Faults, Whole},
    rng::{Counter, Purpose, Rng, open_unit_f64},
    sample::{Move, StepLaw},
    saved::{Unfit, expect},
};

/// Probability of proposing a fresh point of the cube instead of a small step, where nothing else is asked for
/// (Kelemen et al. 2002 use 0.25 to 0.75 and report little difference; 0.3 is what their renderers' descendants ship).
pub const LARGE_STEP_PROBABILITY: f64 = 0.3;

/// Layers of the film that a baseline records into.
pub mod baseline_layer {
    /// States of the chains.
    pub const CHAINS: usize = 0;
    /// Proposals of large steps as independent samples; there only with Kelemen's weights.
    pub const LARGE_STEPS: usize = 1;
}

/// How often chains make large steps, and what becomes of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LargeSteps {
    /// p, the probability that a step is a large one, in (0, 1).
    pub probability: f64,
    /// Whether proposals of large steps enter the image once more, as the independent uniform samples that they are.
    ///
    /// Of N steps, N states follow the density g/c and about p N proposals the density 1. By the balance heuristic a
    /// sample of either kind adds f / (N g/c + p N) to the image. States then add ∫ f (g/c) / (g/c + p) on average,
    /// proposals ∫ f p / (g/c + p), both together ∫ f. Without the proposals p is 0 in the weight, which leaves the
    /// familiar c f/g. If a constant ζ stands in the place of c, all this stays true once the states' part is
    /// multiplied by c/ζ; so ζ may be a first estimate of c, and a later one the factor: unbiased given c, for any ζ.
    /// A sample adds no more than min(c f/g, f/p)/N.
    ///
    /// Source: Kelemen et al. 2002, section 3.4, where ζ = c is the estimate so far; Veach & Guibas 1995 (balance
    /// heuristic).
    pub kelemen_weights: bool,
}

/// A block of independent chains on g, started from given states.
pub struct Baseline<W> {
    walkers: Walkers,
    evaluator: Evaluator<W>,
    large_steps: LargeSteps,
    /// Uniform number of each lane's decision at this step.
    decisions: Vec<f64>,
    steps: u64,
    /// Steps in a row that each chain refused, and the most that were.
    refused: Vec<u32>,
    /// Most steps in a row that a chain refused.
    pub longest_rejection: u32,
    /// ln g of states in the earlier and the later half of the steps: the later one ends with the last step and begins with
    /// the largest power of two that is no later than that.
    pub halves: [Moments; 2],
    /// Where states lay on the film in the same halves.
    pub whereabouts: [Whereabouts; 2],
    /// Changes of technique.
    pub changed: TechniqueChanges,
    /// Σ of acceptance probabilities of small steps and how many there were.
    pub small: (f64, u64),
    /// The same of large steps.
    pub large: (f64, u64),
    /// Σ g of the proposals of large steps, what they contribute elsewhere included: over their number, an unbiased
    /// estimate of c that is independent of the chains' first states.
    pub large_sum: f64,
}

/// A [`Baseline`] as it is saved.
#[derive(Serialize, Deserialize)]
pub struct SavedBaseline {
    walkers: Walkers,
    steps: u64,
    changed: TechniqueChanges,
    small: (f64, u64),
    large: (f64, u64),
    large_sum: f64,
    refused: Vec<u32>,
    longest_rejection: u32,
    halves: [Moments; 2],
    whereabouts: [Whereabouts; 2],
    rays: u64,
    faults: Faults,
}

impl<W: Default> Baseline<W> {
    /// All that there is to save between steps.
    pub fn saved(&self) -> SavedBaseline {
        SavedBaseline {
            walkers: self.walkers.clone(),
            steps: self.steps,
            changed: self.changed,
            small: self.small,
            large: self.large,
            large_sum: self.large_sum,
            refused: self.refused.clone(),
            longest_rejection: self.longest_rejection,
            halves: self.halves,
            whereabouts: self.whereabouts,
            rays: self.evaluator.out.rays,
            faults: self.evaluator.out.faults.clone(),
        }
    }

    /// Chains `first_chain`, `first_chain + 1`, … as they were saved.
    pub fn restored(
        rng: Rng,
        first_chain: u32,
        chains: usize,
        saved: SavedBaseline,
        large_steps: LargeSteps,
    ) -> Result<Baseline<W>, Unfit> {
        let SavedBaseline { walkers, steps, changed, small, large, large_sum, .. } = saved;
        let SavedBaseline { refused, longest_rejection, halves, whereabouts, rays, faults, .. } = saved;
        expect(walkers.fits(chains) && refused.len() == chains, "chains")?;
        let mut evaluator = Baseline::evaluator(rng, first_chain, chains);
        (evaluator.out.rays, evaluator.out.faults) = (rays, faults);
        let decisions = vec![0.0; chains];
        Ok(Baseline {
            walkers,
            evaluator,
            large_steps,
            decisions,
            steps,
            refused,
            longest_rejection,
            halves,
            whereabouts,
            changed,
            small,
            large,
            large_sum,
        })
    }

    fn evaluator(rng: Rng, first_chain: u32, chains: usize) -> Evaluator<W> {
        let counter =
            |lane: usize| Counter { ladder: first_chain + lane as u32, replica: 0, step: 0, purpose: Purpose::Primary };
        Evaluator::new(rng, (0..chains).map(counter).collect())
    }

    /// Chains `first_chain`, `first_chain + 1`, … put into those states by replaying them.
    pub fn new<T: Target<Workspace = W>>(
        target: &T,
        rng: Rng,
        first_chain: u32,
        starts: &[Start],
        large_steps: LargeSteps,
    ) -> Baseline<W> {
        let mut walkers = Walkers::new(starts.len());
        let mut evaluator = Baseline::evaluator(rng, first_chain, starts.len());
        replay(target, starts, &mut walkers, &mut evaluator);
        Baseline {
            walkers,
            evaluator,
            large_steps,
            decisions: vec![0.0; starts.len()],
            refused: vec![0; starts.len()],
            longest_rejection: 0,
            halves: [Moments::default(); 2],
            whereabouts: [Whereabouts::default(); 2],
            changed: TechniqueChanges::default(),
            steps: 0,
            small: (0.0, 0),
            large: (0.0, 0),
            large_sum: 0.0,
        }
    }

    /// Every chain makes `steps` steps; see [`LargeSteps`] for what is recorded, in units of `unit`, the ζ of the weights.
    pub fn advance<T: Target<Workspace = W>>(&mut self, target: &T, steps: u64, unit: f64, recorder: &mut Recorder) {
        for _ in 0..steps {
            self.step(target, unit, recorder);
        }
    }

    /// Counts steps that these chains make somewhere else.
    pub fn advance_elsewhere(&mut self, steps: u64) {
        self.steps += steps;
    }

    fn step<T: Target<Workspace = W>>(&mut self, target: &T, unit: f64, recorder: &mut Recorder) {
        let rng = self.evaluator.rng();
        self.evaluator.counters.iter_mut().for_each(|counter| counter.step = self.steps);
        if target.changes_techniques() {
            self.change_techniques(target, unit, recorder);
        }
        for lane in 0..self.decisions.len() {
            let counter = Counter { purpose: Purpose::Step, ..self.evaluator.counters[lane] };
            let [decision, kind, ..] = rng.words(counter, 0).map(open_unit_f64);
            self.decisions[lane] = decision;
            let large = kind < self.large_steps.probability;
            self.evaluator.moves[lane] = if large { Move::Fresh } else { Move::Small(StepLaw::KELEMEN) };
        }
        self.evaluator.evaluate(target, &self.walkers.points);
        if self.steps.is_power_of_two() {
            self.halves = [self.halves[0].merged(self.halves[1]), Moments::default()];
            let [earlier, later] = &mut self.whereabouts;
            earlier.merge(&std::mem::take(later));
        }
        for lane in 0..self.evaluator.moves.len() {
            let proposed = self.evaluator.out.whole(lane);
            let small = self.evaluator.moves[lane] != Move::Fresh;
            if !small {
                self.large_sum += proposed.main.luminance();
                if self.large_steps.kelemen_weights && !proposed.main.is_dark() {
                    self.large_steps.record(baseline_layer::LARGE_STEPS, proposed, 1.0, unit, recorder);
                }
            }
            let u = self.decisions[lane];
            let large_steps = self.large_steps;
            let (Evaluator { points, out, .. }, [_, whereabouts]) = (&self.evaluator, &mut self.whereabouts);
            let alpha = self.walkers.step(lane, 1.0, (points, lane), out, u, &mut |state, weight| {
                whereabouts.add(state, weight);
                large_steps.record(baseline_layer::CHAINS, state, weight, unit, recorder);
            });
            let count = if small { &mut self.small } else { &mut self.large };
            *count = (count.0 + alpha, count.1 + 1);
            self.refused[lane] = if u < alpha { 0 } else { self.refused[lane] + 1 };
            self.longest_rejection = self.longest_rejection.max(self.refused[lane]);
            self.halves[1].add(self.walkers.states[lane].ln_g);
        }
        self.steps += 1;
    }

    /// Changes the techniques of some chains, before they step.
    fn change_techniques<T: Target<Workspace = W>>(&mut self, target: &T, unit: f64, recorder: &mut Recorder) {
        let (walkers, evaluator, large_steps) = (&mut self.walkers, &mut self.evaluator, self.large_steps);
        evaluator.propose_changes(target, &walkers.points, self.decisions.len(), |_| 1.0);
        for &lane in &evaluator.drawn {
            let alpha = evaluator.settle_change(walkers, lane, 1.0, &mut |state, weight| {
                large_steps.record(baseline_layer::CHAINS, state, weight, unit, recorder);
            });
            self.changed.count(alpha);
        }
    }

    /// Records what the current states have gathered, without changing them.
    pub fn record_pending(&self, unit: f64, recorder: &mut Recorder) {
        for (lane, &weight) in self.walkers.pending.iter().enumerate() {
            if weight > 0.0 {
                let state = self.walkers.whole(lane);
                self.large_steps.record(baseline_layer::CHAINS, state, weight, unit, recorder);
            }
        }
    }

    /// Steps of each chain so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Mutations so far.
    pub fn mutations(&self) -> u64 {
        self.steps * self.walkers.states.len() as u64
    }

    /// Rays traced and contributions settled so far.
    pub fn rays_and_faults(&self) -> (u64, &Faults) {
        (self.evaluator.out.rays, &self.evaluator.out.faults)
    }
}

/// Sums of a number over states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    /// How many states.
    pub states: f64,
    /// Σ x.
    pub sum: f64,
    /// Σ x².
    pub squares: f64,
}

impl Moments {
    #[inline(always)]
    fn add(&mut self, x: f64) {
        self.states += 1.0;
        self.sum += x;
        self.squares += x * x;
    }

    /// Of the states of both.
    pub fn merged(self, other: Moments) -> Moments {
        Moments { states: self.states + other.states, sum: self.sum + other.sum, squares: self.squares + other.squares }
    }

    /// Mean square of the distance from the mean; 0 without states.
    pub fn variance(self) -> f64 {
        let mean = self.sum / self.states;
        (self.squares / self.states - mean * mean).max(0.0)
    }
}

impl LargeSteps {
    /// Layers of the film that are recorded into.
    pub fn layers(&self) -> usize {
        1 + usize::from(self.kelemen_weights)
    }

    /// Records f · weight / (g/ζ + p) with ζ = `unit`; without Kelemen's weights p counts as 0.
    fn record(&self, layer: usize, state: Whole, weight: f64, unit: f64, recorder: &mut Recorder) {
        let uniform_share = if self.kelemen_weights { self.probability } else { 0.0 };
        recorder.splat(layer, state, unit * weight / (state.main.luminance() + uniform_share * unit), weight);
    }
}
