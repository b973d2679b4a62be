//! Ladders side by side: what one thread works on at a time.

use std::{ops::Range, sync::Arc};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    Canvas, Histogram, Round, RungCounts, SavedTally, Sum, Tally,
    ladder::swap_acceptance,
    probes::TRIALS,
    steps::{self, SCALES, StepMix},
    trips::{IndexProcess, Trips},
};
use crate::{
    chain::{Evaluator, Importance, Start, Target, Walkers, draw_decisions, replay},
    path::{Faults, Whole},
    rng::{Counter, Purpose, Rng, open_unit_f64},
    sample::{Move, StepLaw},
    saved::{Unfit, expect},
};

/// Whole ladders whose replicas and offered points are evaluated together.
///
/// A sweep moves every replica once, draws `offers` independent uniform points for every ladder and offers each to its
/// ladder's lowest chain, then swaps neighbours among the tempered rungs by even–odd parity (Okabe et al. 2001; Syed et
/// al. 2021). All random words are named by (ladder, replica, sweep), never by the thread or the batch.
///
/// Lanes are the replicas, ladder by ladder, and behind them the offers, ladder by ladder. They are cut into *parts* of
/// a batch each: one where ladders are short, several where a ladder is longer than a batch. Parts explore side by side,
/// also on several threads; swaps go between them.
pub struct Block<W> {
    number: usize,
    first_ladder: u32,
    ladders: usize,
    /// Replicas of a ladder that move, K − 1.
    chains: usize,
    offers: usize,
    lanes_a_part: usize,
    parts: Vec<Part<W>>,
    /// Rung of each replica, 1 … K − 1.
    rung: Vec<u16>,
    /// Replica on each tempered rung of each ladder; the inverse of `rung`.
    replica_on: Vec<u16>,
    trips: Trips,
    /// Rungs of the first ladder's replicas; noted by the first block only.
    index: Option<IndexProcess>,
    sweeps: u64,
}

/// A batch of lanes.
struct Part<W> {
    /// Lanes of the block that lie here.
    lanes: Range<usize>,
    /// Those of them that are replicas come first.
    replicas: usize,
    walkers: Walkers,
    evaluator: Evaluator<W>,
    tally: Tally,
    /// Steps in a row that each chain refused.
    refused: Vec<u32>,
    /// Scale of each replica's step at work, and the random word that will decide on it.
    scale: Vec<u8>,
    decision: Vec<u32>,
    /// All words that decide on a step, while one is prepared.
    words: Vec<[u32; 4]>,
}

/// A [`Block`] as it is saved.
#[derive(Serialize, Deserialize)]
pub struct SavedBlock {
    parts: Vec<SavedPart>,
    rung: Vec<u16>,
    trips: Trips,
    index: Option<IndexProcess>,
    sweeps: u64,
}

/// What a [`Block`] saw, without where its chains are: what a rank needs of the blocks of others to learn from them.
#[derive(Serialize, Deserialize)]
pub struct BlockStatistics {
    tallies: Vec<SavedTally>,
    trips: Trips,
    index: Option<IndexProcess>,
    sweeps: u64,
}

/// A [`Part`] as it is saved: what it works with between two sweeps follows from the job.
#[derive(Serialize, Deserialize)]
struct SavedPart {
    walkers: Walkers,
    tally: SavedTally,
    refused: Vec<u32>,
    /// Of replayed starts, which no sweep has accounted for yet.
    rays: u64,
    faults: Faults,
}

impl<W: Default + Send> Block<W> {
    /// Block number `number` of `ladders` ladders with `rungs` ≥ 2, all without states, with `offers` ≥ 1 a sweep, in parts
    /// of at most `lanes_a_part`.
    pub fn new(
        rng: Rng,
        (number, ladders): (usize, usize),
        rungs: usize,
        offers: usize,
        lanes_a_part: usize,
        layers: usize,
        film: [u32; 2],
    ) -> Block<W> {
        let chains = rungs - 1;
        let replicas = ladders * chains;
        let first_ladder = (number * ladders) as u32;
        let mut block = Block {
            number,
            first_ladder,
            ladders,
            chains,
            offers,
            lanes_a_part,
            parts: Vec::new(),
            rung: (0..replicas).map(|lane| (lane % chains) as u16 + 1).collect(),
            replica_on: (0..replicas).map(|lane| (lane % chains) as u16).collect(),
            trips: Trips::new(replicas, chains),
            index: (first_ladder == 0).then(IndexProcess::default),
            sweeps: 0,
        };
        let lanes = block.lanes();
        for start in (0..lanes).step_by(lanes_a_part) {
            let range = start..(start + lanes_a_part).min(lanes);
            let own = replicas.clamp(range.start, range.end) - range.start;
            let mut evaluator = Evaluator::new(rng, range.clone().map(|lane| block.counter(lane)).collect());
            evaluator.film = film; // of the stratified points that chains start from
            block.parts.push(Part {
                replicas: own,
                walkers: Walkers::new(own),
                evaluator,
                tally: Tally::new(rungs, layers),
                refused: vec![0; own],
                scale: vec![0; own],
                decision: vec![0; own],
                words: Vec::new(),
                lanes: range,
            });
        }
        block
    }

    /// All that there is to save between sweeps.
    pub fn saved(&self) -> SavedBlock {
        let part = |part: &Part<W>| SavedPart {
            walkers: part.walkers.clone(),
            tally: part.tally.saved(),
            refused: part.refused.clone(),
            rays: part.evaluator.out.rays,
            faults: part.evaluator.out.faults.clone(),
        };
        SavedBlock {
            parts: self.parts.iter().map(part).collect(),
            rung: self.rung.clone(),
            trips: self.trips.clone(),
            index: self.index.clone(),
            sweeps: self.sweeps,
        }
    }

    /// Goes on where a block with the same ladders and offers was saved.
    pub fn restore(&mut self, saved: SavedBlock) -> Result<(), Unfit> {
        let SavedBlock { parts, rung, trips, index, sweeps } = saved;
        expect(parts.len() == self.parts.len() && index.is_some() == self.index.is_some(), "ladders")?;
        for (part, saved) in self.parts.iter_mut().zip(parts) {
            expect(saved.walkers.fits(part.replicas) && saved.refused.len() == part.replicas, "chains")?;
            part.tally.restore(saved.tally)?;
            (part.walkers, part.refused) = (saved.walkers, saved.refused);
            (part.evaluator.out.rays, part.evaluator.out.faults) = (saved.rays, saved.faults);
        }
        expect(rung.len() == self.rung.len() && trips.fits(rung.len(), self.chains), "replicas")?;
        let mut replica_on = vec![u16::MAX; rung.len()];
        for (lane, k) in rung.iter().enumerate() {
            let (ladder, replica) = (lane / self.chains, lane % self.chains);
            expect((1..=self.chains).contains(&usize::from(*k)), "rungs")?;
            replica_on[ladder * self.chains + usize::from(*k) - 1] = replica as u16;
        }
        expect(replica_on.iter().all(|replica| *replica != u16::MAX), "rungs")?;
        (self.rung, self.replica_on, self.trips, self.index, self.sweeps) = (rung, replica_on, trips, index, sweeps);
        Ok(())
    }

    /// What was seen, without where chains are.
    pub fn statistics(&self) -> BlockStatistics {
        BlockStatistics {
            tallies: self.parts.iter().map(|part| part.tally.saved()).collect(),
            trips: self.trips.clone(),
            index: self.index.clone(),
            sweeps: self.sweeps,
        }
    }

    /// Takes what a block with the same ladders and offers saw; chains stay as they are here.
    pub fn set_statistics(&mut self, told: BlockStatistics) -> Result<(), Unfit> {
        let BlockStatistics { tallies, trips, index, sweeps } = told;
        expect(tallies.len() == self.parts.len() && index.is_some() == self.index.is_some(), "ladders")?;
        expect(trips.fits(self.rung.len(), self.chains), "replicas")?;
        for (part, tally) in self.parts.iter_mut().zip(tallies) {
            part.tally.restore(tally)?;
        }
        (self.trips, self.index, self.sweeps) = (trips, index, sweeps);
        Ok(())
    }

    /// Changes the number of points offered to a ladder each sweep.
    pub fn set_offers(&mut self, rng: Rng, offers: usize) {
        if offers == self.offers {
            return;
        }
        self.offers = offers;
        let layers = self.parts[0].tally.splats.layers();
        let rungs = self.chains + 1;
        let (lanes, replicas) = (self.lanes(), self.rung.len());
        let parts = lanes.div_ceil(self.lanes_a_part);
        self.parts.truncate(parts.max(replicas.div_ceil(self.lanes_a_part)));
        for number in 0..parts {
            let start = number * self.lanes_a_part;
            let range = start..(start + self.lanes_a_part).min(lanes);
            let mut evaluator = Evaluator::new(rng, range.clone().map(|lane| self.counter(lane)).collect());
            evaluator.importance = self.parts[0].evaluator.importance.clone();
            match self.parts.get_mut(number) {
                Some(part) => (part.lanes, part.evaluator) = (range, evaluator),
                None => self.parts.push(Part {
                    lanes: range,
                    replicas: 0,
                    walkers: Walkers::new(0),
                    evaluator,
                    tally: Tally::new(rungs, layers),
                    refused: Vec::new(),
                    scale: Vec::new(),
                    decision: Vec::new(),
                    words: Vec::new(),
                }),
            }
        }
    }

    /// The counter of a lane: replicas are numbered from 0, offers behind them.
    fn counter(&self, lane: usize) -> Counter {
        let replicas = self.rung.len();
        let (ladder, number) = if lane < replicas {
            (lane / self.chains, lane % self.chains)
        } else {
            ((lane - replicas) / self.offers, self.chains + (lane - replicas) % self.offers)
        };
        Counter {
            ladder: self.first_ladder + ladder as u32,
            replica: number as u16,
            step: self.sweeps,
            purpose: Purpose::Primary,
        }
    }

    /// The way to move that the block tries: neighbouring blocks are halves of one trial.
    pub fn trial(&self) -> usize {
        self.number / 2 % TRIALS
    }

    /// Evaluations of a sweep.
    pub fn lanes(&self) -> usize {
        self.ladders * (self.chains + self.offers)
    }

    /// Part of a lane, and its place there.
    fn place(&self, lane: usize) -> (usize, usize) {
        (lane / self.lanes_a_part, lane % self.lanes_a_part)
    }

    /// Scalar contributions are weighed by this importance, if there is any; from before the first state on.
    pub fn set_importance(&mut self, importance: Option<&Arc<Importance>>) {
        self.parts.iter_mut().for_each(|part| part.evaluator.importance = importance.cloned());
    }

    /// Puts the chains into states: `starts[k - 1]` has one for rung k of every ladder of the block.
    pub fn start<T: Target<Workspace = W>>(&mut self, target: &T, starts: &[&[Start]]) {
        // neighbouring rungs were resampled in the same order: rotated, so that a ladder does not start everywhere
        // from the same sample
        let of_lane = |lane: usize| {
            let (ladder, replica) = (lane / self.chains, lane % self.chains);
            starts[replica][(ladder + replica * self.ladders.div_ceil(self.chains)) % self.ladders]
        };
        for part in &mut self.parts {
            let starts: Vec<Start> = part.lanes.clone().take(part.replicas).map(of_lane).collect();
            replay(target, &starts, &mut part.walkers, &mut part.evaluator);
        }
    }

    /// Goes through `sweeps` sweeps.
    pub fn advance<T: Target<Workspace = W>>(&mut self, target: &T, sweeps: u64, canvas: &Canvas, round: &Round) {
        let bank = steps::bank();
        for _ in 0..sweeps {
            let (rung, sweep, mixes) = (&self.rung, self.sweeps, &round.mixes[self.trial()]);
            let explore = |part: &mut Part<W>| part.explore(target, canvas, round, (&bank, mixes), rung, sweep);
            match &mut self.parts[..] {
                [part] => explore(part),
                parts => parts.par_iter_mut().for_each(explore),
            }
            self.inject(canvas, round);
            self.swap(canvas, round);
            for (lane, k) in self.rung.iter().enumerate() {
                self.trips.stays(lane, usize::from(*k));
            }
            if let Some(index) = &mut self.index {
                index.note(&self.rung[..self.chains]);
            }
            self.sweeps += 1;
        }
    }

    /// Offers each fresh point to the lowest chain of its ladder, a swap that costs nothing.
    #[inline(never)] // profiles tell what it takes
    fn inject(&mut self, canvas: &Canvas, round: &Round) {
        let replicas = self.rung.len();
        let lowest = round.ladder.betas()[1];
        for i in 0..self.ladders * self.offers {
            let ladder = i / self.offers;
            let lane = ladder * self.chains + usize::from(self.replica_on[ladder * self.chains]);
            let ((from, at), (to, place)) = (self.place(replicas + i), self.place(lane));
            let ln_offered = self.parts[from].evaluator.out.lanes[at].ln_g;
            let alpha = swap_acceptance(0.0, ln_offered, lowest, self.parts[to].walkers.states[place].ln_g);
            self.parts[to].tally.counts[1].swaps.add(alpha);
            if alpha == 0.0 {
                continue;
            }
            let evaluator = &self.parts[from].evaluator;
            let counter = Counter { purpose: Purpose::Swap, ..evaluator.counters[at] };
            if open_unit_f64(evaluator.rng().words(counter, 0)[0]) < alpha {
                self.trips.renewed(lane);
                if from == to {
                    let Part { walkers, evaluator, tally, .. } = &mut self.parts[to];
                    let mut record = |state: Whole, w: f64| tally.state(canvas, round, 1, state, w);
                    walkers.replace(place, (&evaluator.points, at), &evaluator.out, &mut record);
                } else {
                    let parts = self.parts.get_disjoint_mut([from, to]).expect("two parts");
                    let [Part { evaluator, .. }, Part { walkers, tally, .. }] = parts;
                    let mut record = |state: Whole, w: f64| tally.state(canvas, round, 1, state, w);
                    walkers.replace(place, (&evaluator.points, at), &evaluator.out, &mut record);
                }
            }
        }
    }

    /// Swaps neighbouring tempered rungs (1, 2), (3, 4), … in even sweeps and (2, 3), (4, 5), … in odd ones; a part of
    /// [`advance`](Self::advance).
    #[inline(never)] // profiles tell what it takes
    pub fn swap(&mut self, canvas: &Canvas, round: &Round) {
        let rng = self.parts[0].evaluator.rng();
        let betas = round.ladder.betas();
        for ladder in 0..self.ladders {
            let base = ladder * self.chains;
            let counter = Counter { purpose: Purpose::Swap, ..self.counter(base) };
            for hotter in (1 + (self.sweeps % 2) as usize..self.chains).step_by(2) {
                let colder = hotter + 1;
                let lanes = [hotter, colder].map(|k| base + usize::from(self.replica_on[base + k - 1]));
                let places = lanes.map(|lane| self.place(lane));
                let [h, c] = places.map(|(part, at)| self.parts[part].walkers.states[at].ln_g);
                let alpha = swap_acceptance(betas[hotter], h, betas[colder], c);
                self.parts[places[1].0].tally.counts[colder].swaps.add(alpha);
                if open_unit_f64(rng.words(counter, colder as u16)[0]) < alpha {
                    for ((part, at), k) in places.into_iter().zip([hotter, colder]) {
                        let Part { walkers, tally, .. } = &mut self.parts[part];
                        walkers.flush(at, &mut |state, w| tally.state(canvas, round, k, state, w));
                    }
                    self.rung.swap(lanes[0], lanes[1]);
                    self.replica_on.swap(base + hotter - 1, base + colder - 1);
                }
            }
        }
    }

    /// Records what all current states have gathered; must happen before the round ends.
    pub fn flush(&mut self, canvas: &Canvas, round: &Round) {
        for part in &mut self.parts {
            for at in 0..part.replicas {
                let k = usize::from(self.rung[part.lanes.start + at]);
                let tally = &mut part.tally;
                part.walkers.flush(at, &mut |state, w| tally.state(canvas, round, k, state, w));
            }
        }
    }

    /// Records into `tally` what the current states have gathered, and leaves them as they are.
    pub fn pending(&self, canvas: &Canvas, round: &Round, tally: &mut Tally) {
        for part in &self.parts {
            for (at, &weight) in part.walkers.pending.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
                let k = usize::from(self.rung[part.lanes.start + at]);
                tally.state(canvas, round, k, part.walkers.whole(at), weight);
            }
        }
    }

    /// Puts what was splatted onto the film, and into a half and a trial of the probes.
    pub fn deposit(&mut self, canvas: &Canvas) {
        let (half, trial) = (self.number % 2, Some(self.trial()));
        self.parts.iter_mut().for_each(|part| part.tally.deposit(canvas, half, trial));
    }

    /// Adds the histograms to those of the group, by rung.
    pub fn add_histograms(&self, group: &mut [Histogram]) {
        for part in &self.parts {
            group.iter_mut().zip(&part.tally.histograms).for_each(|(sum, h)| sum.merge(h));
        }
    }

    /// Forgets the states seen on tempered rungs, whose inverse temperatures are about to change; what was seen of
    /// the uniform rung stays.
    pub fn forget_tempered(&mut self) {
        for part in &mut self.parts {
            part.tally.histograms[1..].fill(Histogram::default());
        }
    }

    /// What uniform points and tempered states added to the balanced image.
    pub fn added(&self) -> [Sum; 2] {
        let mut sums = [Sum::default(); 2];
        for Part { tally, .. } in &self.parts {
            sums[0].merge(tally.hot);
            sums[1].merge(tally.tempered);
        }
        sums
    }

    /// Adds the round's counts, by rung.
    pub fn add_counts(&self, sums: &mut [RungCounts]) {
        for part in &self.parts {
            sums.iter_mut().zip(&part.tally.counts).for_each(|(sum, counts)| sum.add(counts));
        }
    }

    /// Empties the round's counts.
    pub fn reset_counts(&mut self) {
        self.parts.iter_mut().for_each(|part| part.tally.reset_counts());
        self.trips.reset_counts();
        self.index = self.index.is_some().then(IndexProcess::default);
    }

    /// Round trips, restarts and dwell times of the round.
    pub fn trips(&self) -> &Trips {
        &self.trips
    }

    /// The rungs of the first ladder's replicas over the round; of the first block only.
    pub fn index(&self) -> Option<&IndexProcess> {
        self.index.as_ref()
    }

    /// Sweeps so far.
    pub fn sweeps(&self) -> u64 {
        self.sweeps
    }

    /// Rays traced and contributions settled since this was last asked for.
    pub fn take_rays_and_faults(&mut self) -> (u64, Faults) {
        let (mut rays, mut faults) = (0, Faults::default());
        for part in &mut self.parts {
            rays += std::mem::take(&mut part.evaluator.out.rays);
            faults.merge(&std::mem::take(&mut part.evaluator.out.faults));
        }
        (rays, faults)
    }
}

impl<W: Default> Part<W> {
    /// One Metropolis step of every replica at its own inverse temperature, and fresh points to offer, in one batch.
    fn explore<T: Target<Workspace = W>>(
        &mut self,
        target: &T,
        canvas: &Canvas,
        round: &Round,
        (bank, mixes): (&[StepLaw; SCALES], &[StepMix]),
        rung: &[u16],
        sweep: u64,
    ) {
        let rng = self.evaluator.rng();
        self.evaluator.counters.iter_mut().for_each(|counter| counter.step = sweep);
        if target.changes_techniques() {
            self.change_techniques(target, canvas, round, rung);
        }
        self.evaluator.moves[self.replicas..].fill(Move::Fresh);
        draw_decisions(rng, &self.evaluator.counters[..self.replicas], &mut self.words);
        for (at, &[decision, choice, ..]) in self.words.iter().enumerate() {
            let k = usize::from(rung[self.lanes.start + at]);
            self.decision[at] = decision;
            self.scale[at] = mixes[k].pick(open_unit_f64(choice)) as u8;
            self.evaluator.moves[at] = Move::Small(bank[usize::from(self.scale[at])]);
        }
        self.evaluator.evaluate(target, &self.walkers.points);

        let Part { walkers, evaluator, tally, .. } = self;
        let half = usize::from(sweep >= round.half);
        for at in 0..self.replicas {
            let k = usize::from(rung[self.lanes.start + at]);
            let beta = round.ladder.betas()[k];
            let u = open_unit_f64(self.decision[at]);
            let mut record = |state: Whole, w: f64| tally.state(canvas, round, k, state, w);
            let alpha = walkers.step(at, beta, (&evaluator.points, at), &evaluator.out, u, &mut record);
            let counts = &mut tally.counts[k];
            counts.steps[usize::from(self.scale[at])].add(alpha);
            let [sum, weight] = &mut counts.halves[half];
            (*sum, *weight) = (*sum + walkers.states[at].ln_g, *weight + 1.0);
            self.refused[at] = if u < alpha { 0 } else { self.refused[at] + 1 };
            counts.longest_rejection = counts.longest_rejection.max(self.refused[at]);
        }
        for at in self.replicas..evaluator.out.lanes.len() {
            if round.open {
                tally.only_seen(evaluator.out.whole(at));
            } else {
                tally.uniform_point(canvas, round, evaluator.out.whole(at), false);
            }
        }
    }

    /// Changes of technique of some replicas, before they step: states and weights of the sweep are those that steps lead
    /// to, so this costs evaluations and no weight.
    fn change_techniques<T: Target<Workspace = W>>(
        &mut self,
        target: &T,
        canvas: &Canvas,
        round: &Round,
        rung: &[u16],
    ) {
        let Part { walkers, evaluator, tally, lanes, replicas, .. } = self;
        let rung_of = |at: usize| usize::from(rung[lanes.start + at]);
        let beta_of = |at: usize| round.ladder.betas()[rung_of(at)];
        evaluator.propose_changes(target, &walkers.points, *replicas, beta_of);
        for i in 0..evaluator.drawn.len() {
            let at = evaluator.drawn[i];
            let k = rung_of(at);
            let mut record = |state: Whole, w: f64| tally.state(canvas, round, k, state, w);
            let alpha = evaluator.settle_change(walkers, at, beta_of(at), &mut record);
            tally.counts[k].changes.count(alpha);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    /// Replicas and offers of all ladders draw words of their own, however a ladder is cut into parts and also when there
    /// come to be more offers. (Two that share them look right each by itself; they are no longer independent.)
    #[test]
    fn no_two_lanes_draw_the_same_words() {
        let rng = Rng::new(1);
        for (rungs, lanes_a_part) in [(2, 512), (5, 512), (5, 8), (40, 16)] {
            let blocks = (0..3).map(|number| Block::<()>::new(rng, (number, 3), rungs, 1, lanes_a_part, 1, [1, 1]));
            let mut blocks: Vec<Block<()>> = blocks.collect();
            for offers in [1, 4] {
                blocks.iter_mut().for_each(|block| block.set_offers(rng, offers));
                let parts = blocks.iter().flat_map(|block| &block.parts);
                let counters: Vec<Counter> = parts.flat_map(|part| part.evaluator.counters.clone()).collect();
                let words: HashSet<[u32; 4]> = counters.iter().map(|counter| rng.words(*counter, 0)).collect();
                assert_eq!(counters.len(), 3 * 3 * (rungs - 1 + offers));
                assert_eq!(words.len(), counters.len(), "{rungs} rungs, {offers} offers");
            }
        }
    }
}
