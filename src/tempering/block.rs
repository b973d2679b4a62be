//! Ladders side by side: the batch that one thread works on at a time.

use std::sync::Arc;

use super::{Histogram, Ladder, Weights, ladder::swap_acceptance};
use crate::{
    chain::{Evaluator, Recorder, Start, Target, Walkers, replay},
    path::Contribution,
    rng::{Counter, Purpose, Rng, open_unit_f64},
    sample::{Move, StepLaw},
};

/// Layers of the film that replica exchange fills.
pub mod layer {
    /// f of uniform points: the uniform replica's own estimate.
    pub const UNIFORM: usize = 0;
    /// What uniform points add to the image.
    pub const HOT: usize = 1;
    /// What tempered states add to the image, in the unit of [`Weights`](super::Weights).
    pub const TEMPERED: usize = 2;
}

/// Number of [`layer`]s.
pub const LAYERS: usize = 3;

/// Counts of one tempered rung or of the swaps to it, mergeable by addition.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RungCounts {
    /// Σ of acceptance probabilities of small steps.
    pub accepted: f64,
    /// Small steps proposed.
    pub proposed: u64,
    /// Σ of acceptance probabilities of swaps with the next hotter rung.
    pub swapped: f64,
    /// Such swaps offered.
    pub offered: u64,
}

impl std::ops::AddAssign for RungCounts {
    fn add_assign(&mut self, other: RungCounts) {
        self.accepted += other.accepted;
        self.proposed += other.proposed;
        self.swapped += other.swapped;
        self.offered += other.offered;
    }
}

/// Whole ladders whose replicas and uniform points are evaluated together, one lane each.
///
/// A sweep moves every replica once, draws `uniform_draws` fresh points for every ladder, offers each of those to
/// its ladder's lowest chain, and swaps neighbours among the tempered rungs by even–odd parity (Okabe et al. 2001;
/// Syed et al. 2021). All random words are named by (ladder, replica, sweep), never by the thread.
pub struct Block<W> {
    ladder: Arc<Ladder>,
    ladders: usize,
    uniform_draws: usize,
    /// Lane of replica r of ladder l: l · (K − 1) + r.
    walkers: Walkers,
    /// Rung of each replica, 1 … K − 1.
    rung: Vec<u16>,
    /// Replica on each tempered rung of each ladder; the inverse of `rung`.
    replica_on: Vec<u16>,
    /// The replicas' lanes, then `uniform_draws` lanes for each ladder.
    evaluator: Evaluator<W>,
    /// Sweeps in which chains moved, and those before.
    sweeps: u64,
    bootstrap_sweeps: u64,
    /// Independent samples of the bootstrap, until chains start.
    bootstrap: Vec<Start>,
    /// By rung; entry 0 is unused.
    counts: Vec<RungCounts>,
    /// What has been recorded.
    seen: Statistics,
}

impl<W: Default> Block<W> {
    /// Ladders `first_ladder`, `first_ladder + 1`, …, all without states, with `uniform_draws` ≥ 1 a sweep.
    pub fn new(ladder: Arc<Ladder>, rng: Rng, first_ladder: u32, ladders: usize, uniform_draws: usize) -> Block<W> {
        let chains = ladder.rungs() - 1;
        let counter = |l: usize, replica: usize| Counter {
            ladder: first_ladder + l as u32,
            replica: replica as u16,
            step: 0,
            purpose: Purpose::Primary,
        };
        let replicas = (0..ladders * chains).map(|lane| counter(lane / chains, lane % chains));
        let uniform = (0..ladders * uniform_draws).map(|i| counter(i / uniform_draws, chains + i % uniform_draws));
        let mut evaluator = Evaluator::new(rng, StepLaw::KELEMEN, replicas.chain(uniform).collect());
        evaluator.moves.fill(Move::Fresh);
        Block {
            walkers: Walkers::new(ladders * chains),
            rung: (0..ladders * chains).map(|lane| (lane % chains) as u16 + 1).collect(),
            replica_on: (0..ladders * chains).map(|lane| (lane % chains) as u16).collect(),
            counts: vec![RungCounts::default(); ladder.rungs()],
            seen: Statistics::new(ladder.rungs()),
            bootstrap: Vec::new(),
            ladder,
            ladders,
            uniform_draws,
            evaluator,
            sweeps: 0,
            bootstrap_sweeps: 0,
        }
    }

    /// Evaluates every lane at a fresh uniform point in each of `sweeps` sweeps: independent samples for the
    /// uniform replica's own estimate, for the normalisers, and for chains to [`start`](Self::start) from.
    pub fn bootstrap<T: Target<Workspace = W>>(&mut self, target: &T, sweeps: u64, recorder: &mut Recorder) {
        self.evaluator.moves.fill(Move::Fresh);
        for _ in 0..sweeps {
            for counter in &mut self.evaluator.counters {
                (counter.step, counter.purpose) = (self.bootstrap_sweeps, Purpose::Bootstrap);
            }
            self.evaluator.evaluate(target, &self.walkers.points);
            for (counter, point) in self.evaluator.counters.iter().zip(&self.evaluator.out.lanes) {
                self.bootstrap.push(Start { counter: *counter, ln_g: point.ln_g });
                self.seen.uniform_point(point, recorder);
            }
            self.bootstrap_sweeps += 1;
        }
        self.evaluator.counters.iter_mut().for_each(|counter| counter.purpose = Purpose::Primary);
    }

    /// The samples of the bootstrap, which are forgotten here.
    pub fn take_bootstrap(&mut self) -> Vec<Start> {
        std::mem::take(&mut self.bootstrap)
    }

    /// Puts the chains into states: `starts[k - 1]` has one for rung k of every ladder of the block. Without any,
    /// chains stay null until they meet light.
    pub fn start<T: Target<Workspace = W>>(&mut self, target: &T, starts: &[&[Start]]) {
        let chains = self.ladder.rungs() - 1;
        if starts.iter().all(|rung| rung.is_empty()) {
            return;
        }
        // neighbouring rungs were resampled in the same order: rotated, so that a ladder does not start everywhere
        // from the same sample
        let of_lane = |lane: usize| {
            let (ladder, replica) = (lane / chains, lane % chains);
            starts[replica][(ladder + replica * self.ladders.div_ceil(chains)) % self.ladders]
        };
        let starts: Vec<Start> = (0..self.rung.len()).map(of_lane).collect();
        replay(target, &starts, &mut self.walkers, &mut self.evaluator);
        self.evaluator.moves.fill(Move::Fresh);
    }

    /// Goes through `sweeps` sweeps.
    pub fn advance<T: Target<Workspace = W>>(
        &mut self,
        target: &T,
        sweeps: u64,
        weights: &Weights,
        recorder: &mut Recorder,
    ) {
        for _ in 0..sweeps {
            self.propose(target);
            self.explore(weights, recorder);
            self.inject(weights, recorder);
            self.swap(weights, recorder);
            self.sweeps += 1;
        }
    }

    /// Evaluates a proposal for every replica and the fresh uniform points, all in one batch.
    fn propose<T: Target<Workspace = W>>(&mut self, target: &T) {
        for counter in &mut self.evaluator.counters {
            counter.step = self.sweeps;
        }
        for lane in 0..self.rung.len() {
            self.evaluator.moves[lane] = self.walkers.exploring(lane);
        }
        self.evaluator.evaluate(target, &self.walkers.points);
    }

    /// One Metropolis step of every replica at its own inverse temperature.
    fn explore(&mut self, weights: &Weights, recorder: &mut Recorder) {
        let rng = self.evaluator.rng();
        for lane in 0..self.rung.len() {
            let k = usize::from(self.rung[lane]);
            let counter = Counter { purpose: Purpose::Step, ..self.evaluator.counters[lane] };
            let u = open_unit_f64(rng.words(counter, 0)[0]);
            let proposed = self.evaluator.out.lanes[lane];
            let mut record = record(weights, k, &mut self.seen, recorder);
            let small = self.evaluator.moves[lane] == Move::Small;
            let beta = self.ladder.betas()[k];
            let alpha = self.walkers.step(lane, beta, (&self.evaluator.points, lane), &proposed, u, &mut record);
            if small {
                self.counts[k].accepted += alpha;
                self.counts[k].proposed += 1;
            }
        }
    }

    /// Records the uniform points and offers each to the lowest chain of its ladder, a swap that costs nothing.
    fn inject(&mut self, weights: &Weights, recorder: &mut Recorder) {
        let rng = self.evaluator.rng();
        let chains = self.ladder.rungs() - 1;
        let coldest_of_pair = self.ladder.betas()[1];
        for i in 0..self.ladders * self.uniform_draws {
            let from = self.rung.len() + i;
            let point = self.evaluator.out.lanes[from];
            self.seen.uniform_point(&point, recorder);
            if weights.use_uniform() {
                let share = if point.is_dark() { 0.0 } else { weights.uniform(point.ln_g) };
                recorder.splat(layer::HOT, &point, share, 1.0);
            }
            if point.is_dark() {
                self.counts[1].offered += 1;
                continue;
            }
            let ladder = i / self.uniform_draws;
            let lane = ladder * chains + usize::from(self.replica_on[ladder * chains]);
            let alpha = swap_acceptance(0.0, point.ln_g, coldest_of_pair, self.walkers.states[lane].ln_g);
            self.counts[1].swapped += alpha;
            self.counts[1].offered += 1;
            let counter = Counter { purpose: Purpose::Swap, ..self.evaluator.counters[from] };
            if open_unit_f64(rng.words(counter, 0)[0]) < alpha {
                let mut record = record(weights, 1, &mut self.seen, recorder);
                self.walkers.replace(lane, (&self.evaluator.points, from), &point, &mut record);
            }
        }
    }

    /// Swaps neighbouring tempered rungs (1, 2), (3, 4), … in even sweeps and (2, 3), (4, 5), … in odd ones.
    fn swap(&mut self, weights: &Weights, recorder: &mut Recorder) {
        let rng = self.evaluator.rng();
        let rungs = self.ladder.rungs();
        let chains = rungs - 1;
        for ladder in 0..self.ladders {
            let base = ladder * chains;
            for hotter in (1 + (self.sweeps % 2) as usize..rungs - 1).step_by(2) {
                let colder = hotter + 1;
                let lanes = [hotter, colder].map(|k| base + usize::from(self.replica_on[base + k - 1]));
                let betas = self.ladder.betas();
                let [h, c] = lanes.map(|lane| self.walkers.states[lane].ln_g);
                let alpha = swap_acceptance(betas[hotter], h, betas[colder], c);
                self.counts[colder].swapped += alpha;
                self.counts[colder].offered += 1;
                let counter = Counter { purpose: Purpose::Swap, ..self.evaluator.counters[base] };
                if open_unit_f64(rng.words(counter, colder as u16)[0]) < alpha {
                    for (lane, k) in lanes.into_iter().zip([hotter, colder]) {
                        let mut record = record(weights, k, &mut self.seen, recorder);
                        self.walkers.flush(lane, &mut record);
                    }
                    self.rung.swap(lanes[0], lanes[1]);
                    self.replica_on.swap(base + hotter - 1, base + colder - 1);
                }
            }
        }
    }

    /// Records what all current states have gathered; must happen before the weights change.
    pub fn flush(&mut self, weights: &Weights, recorder: &mut Recorder) {
        for lane in 0..self.rung.len() {
            let k = usize::from(self.rung[lane]);
            let mut record = record(weights, k, &mut self.seen, recorder);
            self.walkers.flush(lane, &mut record);
        }
    }

    /// The block's statistics as they are recorded.
    pub fn recorded(&self) -> &Statistics {
        &self.seen
    }

    /// The block's statistics with those of states not yet recorded; the pending splats go to `recorder`.
    pub fn with_pending(&self, weights: &Weights, recorder: &mut Recorder) -> Statistics {
        let mut seen = self.seen.clone();
        for (lane, (state, &pending)) in self.walkers.states.iter().zip(&self.walkers.pending).enumerate() {
            if pending > 0.0 {
                record(weights, usize::from(self.rung[lane]), &mut seen, recorder)(state, pending);
            }
        }
        seen
    }

    /// Acceptances and swaps by rung; entry 0 is empty.
    pub fn counts(&self) -> &[RungCounts] {
        &self.counts
    }

    /// Evaluations so far: steps of replicas and uniform points.
    pub fn mutations(&self) -> u64 {
        (self.bootstrap_sweeps + self.sweeps) * self.evaluator.moves.len() as u64
    }

    /// Rays traced and contributions settled so far.
    pub fn rays_and_faults(&self) -> (u64, u64) {
        (self.evaluator.out.rays, self.evaluator.out.non_finite)
    }
}

/// What a block has seen; input of the [`Normalisers`](super::Normalisers).
#[derive(Clone, Debug)]
pub struct Statistics {
    /// ln g of the states of each rung, weighted; of uniform points for rung 0, dark ones too.
    pub rungs: Vec<Histogram>,
    /// Number of uniform points.
    pub uniform_points: u64,
    /// Weight of states that went to the film, all rungs.
    pub deposited: f64,
}

impl Statistics {
    fn new(rungs: usize) -> Statistics {
        Statistics { rungs: vec![Histogram::default(); rungs], uniform_points: 0, deposited: 0.0 }
    }

    /// Records an independent sample; the film counts dark ones too.
    #[inline(always)]
    fn uniform_point(&mut self, point: &Contribution, recorder: &mut Recorder) {
        self.rungs[0].add(point.ln_g, 1.0);
        self.uniform_points += 1;
        recorder.splat(layer::UNIFORM, point, 1.0, 1.0);
    }
}

/// A recorder of states on rung `k`: into the statistics and, by the weights, onto the film.
#[inline(always)]
fn record<'r>(
    weights: &'r Weights,
    k: usize,
    seen: &'r mut Statistics,
    recorder: &'r mut Recorder<'_>,
) -> impl FnMut(&Contribution, f64) {
    move |state, weight| {
        seen.rungs[k].add(state.ln_g, weight);
        let value = weights.tempered(k, state.ln_g);
        if value > 0.0 {
            seen.deposited += weight;
            recorder.splat(layer::TEMPERED, state, value * weight, weight);
        }
    }
}
