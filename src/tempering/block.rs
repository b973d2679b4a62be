//! Ladders side by side: what one thread works on at a time.

mod crew;

use std::{ops::Range, sync::Arc};

pub use crew::{Crew, MOST_BLOCKS};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    Canvas, Histogram, Round, RungCounts, SavedTally, Sum, Tally,
    ladder::swap_acceptance,
    probes::TRIALS,
    steps::SCALES,
    trips::{IndexProcess, Trips},
};
use crate::{
    chain::{Evaluator, Importance, Start, Target, Walkers, replay},
    path::{Contributions, Faults, Whole},
    ranks::Group,
    rng::{Counter, Purpose, Rng, open_unit_f64},
    sample::{Move, Points, StepLaw},
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
/// also on several threads; swaps go between them. Several blocks of one part each may go through sweeps
/// [together](Crew), as one batch.
///
/// Ranks may [share](Block::share) a block: each then has some of its replicas and some of its offers, and all know on which
/// rung every replica is. After each exploration they tell one another the ln g of their states and the points that they
/// offer, from which all draw the same swaps by the same random words. States stay where they are; rungs move. Sums of what was
/// seen are integers, so that it does not matter who has seen what.
pub struct Block<W> {
    number: usize,
    first_ladder: u32,
    ladders: usize,
    /// Replicas of a ladder that move, K − 1.
    chains: usize,
    offers: usize,
    lanes_a_part: usize,
    rng: Rng,
    /// Size of the film of the stratified points that chains start from.
    film: [u32; 2],
    importance: Option<Arc<Importance>>,
    parts: Vec<Part>,
    /// Chains of each part; lent to the crew while there is one.
    batches: Vec<Batch<W>>,
    /// The ranks that share the block, and which replicas and which offers are this one's.
    group: Group,
    own_replicas: Range<usize>,
    own_offers: Range<usize>,
    /// What they all told of the sweep at work; nothing where there is one alone.
    told: Told,
    /// Rung of each replica, 1 … K − 1.
    rung: Vec<u16>,
    /// Replica on each tempered rung of each ladder; the inverse of `rung`.
    replica_on: Vec<u16>,
    trips: Trips,
    /// Rungs of the first ladder's replicas; noted by the first block only.
    index: Option<IndexProcess>,
    sweeps: u64,
}

/// Chains, and what they are evaluated with: of a part, or of several blocks.
struct Batch<W> {
    walkers: Walkers,
    /// Replicas come first among its lanes, then offers.
    evaluator: Evaluator<W>,
    /// Inverse temperatures of the replicas, where techniques are changed.
    betas: Vec<f64>,
}

/// What all parts of all blocks work on in a sweep.
struct Work<'a, T> {
    target: &'a T,
    canvas: &'a Canvas<'a>,
    round: &'a Round,
    /// Small steps by scale.
    bank: &'a [StepLaw; SCALES],
}

/// A part in a batch, and what it takes from its block: the rungs of all replicas, the way to move that is tried, and the
/// sweep at work.
struct Seated<'a> {
    part: &'a mut Part,
    rung: &'a [u16],
    trial: usize,
    sweep: u64,
}

/// Replicas that follow one another, and offers, all of a batch.
struct Part {
    /// Number of its first replica in the block.
    first: usize,
    replicas: usize,
    offers: usize,
    /// Where its replicas and its offers begin among the lanes of the batch.
    seat: [usize; 2],
    tally: Tally,
    /// Steps in a row that each chain refused.
    refused: Vec<u32>,
    /// Scale of each replica's step at work, and the random word that will decide on it.
    scale: Vec<u8>,
    decision: Vec<u32>,
}

/// What ranks that share a block tell after an exploration.
#[derive(Serialize, Deserialize)]
struct News {
    /// Of their replicas' states.
    ln_g: Vec<f64>,
    /// The points that they offer.
    offered: Walkers,
}

/// The same of all of them.
#[derive(Default)]
struct Told {
    /// Of all replicas' states.
    ln_g: Vec<f64>,
    /// Points and what they contribute, by rank.
    offered: Vec<(Points, Contributions)>,
    /// Rank of each offer, and its place there.
    place: Vec<(usize, usize)>,
}

/// A [`Block`] as it is saved, however it was cut: what it works with between two sweeps follows from the job.
#[derive(Serialize, Deserialize)]
pub struct SavedBlock {
    walkers: Walkers,
    refused: Vec<u32>,
    tally: SavedTally,
    /// Of replayed starts, which no sweep has accounted for yet.
    rays: u64,
    faults: Faults,
    rung: Vec<u16>,
    trips: Trips,
    index: Option<IndexProcess>,
    sweeps: u64,
}

/// What a [`Block`] saw, without where its chains are: what a rank needs of the blocks of others to learn from them.
#[derive(Serialize, Deserialize)]
pub struct BlockStatistics {
    tally: SavedTally,
    trips: Trips,
    index: Option<IndexProcess>,
    sweeps: u64,
}

impl SavedBlock {
    /// What a rank that shares the block has of it. What was seen stays whole.
    fn part_of(self, group: &Group) -> SavedBlock {
        let own = group.own(self.rung.len());
        let (rays, faults) = if group.is_first() { (self.rays, self.faults) } else { (0, Faults::default()) };
        SavedBlock {
            walkers: self.walkers.some(own.clone()),
            refused: self.refused[own].to_vec(),
            rays,
            faults,
            ..self
        }
    }

    /// Adds what the next of the ranks that share the block has of it.
    pub fn join(&mut self, next: SavedBlock) {
        self.walkers = Walkers::joined([&self.walkers, &next.walkers].into_iter());
        self.refused.extend(next.refused);
        self.tally.merge(&next.tally);
        self.rays += next.rays;
        self.faults.merge(&next.faults);
    }
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
            rng,
            film,
            importance: None,
            parts: Vec::new(),
            batches: Vec::new(),
            group: Group::alone(),
            own_replicas: 0..0,
            own_offers: 0..0,
            told: Told::default(),
            rung: (0..replicas).map(|lane| (lane % chains) as u16 + 1).collect(),
            replica_on: (0..replicas).map(|lane| (lane % chains) as u16).collect(),
            trips: Trips::new(replicas, chains),
            index: (first_ladder == 0).then(IndexProcess::default),
            sweeps: 0,
        };
        block.cut(layers);
        block
    }

    /// Cuts the lanes that are worked on here into parts, all without states.
    fn cut(&mut self, layers: usize) {
        let (replicas, offers) = (self.rung.len(), self.ladders * self.offers);
        let [own_replicas, own_offers] = [replicas, offers].map(|lanes| self.group.own(lanes));
        let lanes: Vec<usize> = own_replicas.clone().chain(own_offers.clone().map(|i| replicas + i)).collect();
        let part = |(number, lanes): (usize, &[usize])| {
            let own = lanes.iter().filter(|lane| **lane < replicas).count();
            Part {
                first: (own_replicas.start + number * self.lanes_a_part).min(own_replicas.end),
                replicas: own,
                offers: lanes.len() - own,
                seat: [0, own],
                tally: Tally::new(self.chains + 1, layers),
                refused: vec![0; own],
                scale: vec![0; own],
                decision: vec![0; own],
            }
        };
        // one part at least, for what is seen of swaps
        let parts: Vec<&[usize]> = if lanes.is_empty() { vec![&[]] } else { lanes.chunks(self.lanes_a_part).collect() };
        let batch = |lanes: &&[usize]| self.batch(lanes.iter().map(|lane| self.counter(*lane)).collect());
        let batches = parts.iter().map(batch).collect();
        self.parts = parts.into_iter().enumerate().map(part).collect();
        self.batches = batches;
        self.parts.iter().zip(&mut self.batches).for_each(|(part, batch)| batch.walkers = Walkers::new(part.replicas));
        (self.own_replicas, self.own_offers) = (own_replicas, own_offers);
        let of_rank = |rank: usize| (0..self.group.of(rank, offers).len()).map(move |at| (rank, at));
        self.told.place = (0..self.group.count()).flat_map(of_rank).collect();
    }

    /// A batch with those lanes, without chains.
    fn batch(&self, counters: Vec<Counter>) -> Batch<W> {
        let mut evaluator = Evaluator::new(self.rng, counters);
        evaluator.film = self.film;
        evaluator.importance = self.importance.clone();
        Batch { walkers: Walkers::new(0), evaluator, betas: Vec::new() }
    }

    /// Cuts it anew, with all that it is at.
    fn cut_anew(&mut self, saved: SavedBlock) {
        self.cut(self.parts[0].tally.splats.layers());
        self.restore(saved).expect("its own state");
    }

    /// Leaves to other ranks what is theirs of a whole block. What was seen stays whole.
    pub fn share(&mut self, group: &Group) {
        let saved = self.saved().part_of(group);
        self.group = group.clone();
        self.cut_anew(saved);
    }

    /// Changes the number of points offered to a ladder each sweep; when all splats are deposited.
    pub fn set_offers(&mut self, offers: usize) {
        if offers != self.offers {
            self.offers = offers;
            self.cut_anew(self.saved());
        }
    }

    /// All that there is to save between sweeps; of a block that is shared, what this rank has of it.
    pub fn saved(&self) -> SavedBlock {
        let mut faults = Faults::default();
        self.batches.iter().for_each(|batch| faults.merge(&batch.evaluator.out.faults));
        SavedBlock {
            walkers: Walkers::joined(self.batches.iter().map(|batch| &batch.walkers)),
            refused: self.parts.iter().flat_map(|part| &part.refused).copied().collect(),
            tally: self.seen(),
            rays: self.batches.iter().map(|batch| batch.evaluator.out.rays).sum(),
            faults,
            rung: self.rung.clone(),
            trips: self.trips.clone(),
            index: self.index.clone(),
            sweeps: self.sweeps,
        }
    }

    /// What all parts saw.
    fn seen(&self) -> SavedTally {
        let mut seen = self.parts[0].tally.saved();
        self.parts[1..].iter().for_each(|part| seen.merge(&part.tally.saved()));
        seen
    }

    /// A block without states goes on where one with the same ladders and offers was saved.
    pub fn restore(&mut self, saved: SavedBlock) -> Result<(), Unfit> {
        let SavedBlock { walkers, refused, tally, rays, faults, rung, trips, index, sweeps } = saved;
        expect(index.is_some() == self.index.is_some(), "ladders")?;
        expect(walkers.fits(self.own_replicas.len()) && refused.len() == self.own_replicas.len(), "chains")?;
        for (part, batch) in self.parts.iter_mut().zip(&mut self.batches) {
            let first = part.first - self.own_replicas.start;
            let own = first..first + part.replicas;
            batch.walkers = walkers.some(own.clone());
            part.refused.copy_from_slice(&refused[own]);
        }
        self.parts[0].tally.restore(tally)?;
        let out = &mut self.batches[0].evaluator.out;
        (out.rays, out.faults) = (rays, faults);
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
            tally: self.seen(),
            trips: self.trips.clone(),
            index: self.index.clone(),
            sweeps: self.sweeps,
        }
    }

    /// Takes what a block with the same ladders and offers saw; chains stay as they are here.
    pub fn set_statistics(&mut self, told: BlockStatistics) -> Result<(), Unfit> {
        let BlockStatistics { tally, trips, index, sweeps } = told;
        expect(index.is_some() == self.index.is_some(), "ladders")?;
        expect(trips.fits(self.rung.len(), self.chains), "replicas")?;
        self.forget();
        self.parts[0].tally.restore(tally)?;
        (self.trips, self.index, self.sweeps) = (trips, index, sweeps);
        Ok(())
    }

    /// Adds what another rank that shares the block saw.
    pub fn add_statistics(&mut self, told: BlockStatistics) -> Result<(), Unfit> {
        let mut seen = self.seen();
        seen.merge(&told.tally);
        self.forget();
        self.parts[0].tally.restore(seen)
    }

    /// Forgets what was seen of states, swaps and points.
    pub fn forget(&mut self) {
        self.parts.iter_mut().for_each(|part| part.tally.forget());
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

    /// Part of a replica, and its lane in the batch, where it is this rank's.
    fn place(&self, replica: usize) -> Option<(usize, usize)> {
        let own = self.own_replicas.contains(&replica);
        own.then(|| {
            let slot = replica - self.own_replicas.start;
            let part = slot / self.lanes_a_part;
            (part, self.parts[part].seat[0] + slot % self.lanes_a_part)
        })
    }

    /// The same of an offer, where there is one rank alone.
    fn place_of_offer(&self, offer: usize) -> (usize, usize) {
        let slot = self.rung.len() + offer;
        let part = slot / self.lanes_a_part;
        (part, self.parts[part].seat[1] + slot % self.lanes_a_part - self.parts[part].replicas)
    }

    /// ln g of a replica's state.
    fn ln_g(&self, batches: &[Batch<W>], replica: usize) -> f64 {
        match self.place(replica).filter(|_| self.group.is_alone()) {
            Some((part, at)) => batches[part].walkers.states[at].ln_g,
            None => self.told.ln_g[replica],
        }
    }

    /// ln g of an offered point.
    fn ln_offered(&self, batches: &[Batch<W>], offer: usize) -> f64 {
        if self.group.is_alone() {
            let (part, at) = self.place_of_offer(offer);
            return batches[part].evaluator.out.lanes[at].ln_g;
        }
        let (rank, at) = self.told.place[offer];
        self.told.offered[rank].1.lanes[at].ln_g
    }

    /// Scalar contributions are weighed by this importance, if there is any; from before the first state on.
    pub fn set_importance(&mut self, importance: Option<&Arc<Importance>>) {
        self.importance = importance.cloned();
        self.batches.iter_mut().for_each(|batch| batch.evaluator.importance = importance.cloned());
    }

    /// Whether it may go through sweeps [together](Crew) with others: it is one part, and this rank's alone.
    pub fn can_join(&self) -> bool {
        self.parts.len() == 1 && self.group.is_alone()
    }

    /// Puts the chains into states: `starts[k - 1]` has one for rung k of every ladder of the block.
    pub fn start<T: Target<Workspace = W>>(&mut self, target: &T, starts: &[&[Start]]) {
        // neighbouring rungs were resampled in the same order: rotated, so that a ladder does not start everywhere
        // from the same sample
        let of_lane = |lane: usize| {
            let (ladder, replica) = (lane / self.chains, lane % self.chains);
            starts[replica][(ladder + replica * self.ladders.div_ceil(self.chains)) % self.ladders]
        };
        for (part, Batch { walkers, evaluator, .. }) in self.parts.iter().zip(&mut self.batches) {
            let starts: Vec<Start> = (part.first..part.first + part.replicas).map(of_lane).collect();
            replay(target, &starts, walkers, evaluator);
        }
    }

    /// Goes through `sweeps` sweeps.
    pub fn advance<T: Target<Workspace = W>>(&mut self, target: &T, sweeps: u64, canvas: &Canvas, round: &Round) {
        Crew::new(vec![self]).advance(target, sweeps, canvas, round);
    }

    /// Its only part, for a batch that it shares with other blocks.
    fn seated(&mut self) -> Seated<'_> {
        let (trial, sweep) = (self.trial(), self.sweeps);
        Seated { part: &mut self.parts[0], rung: &self.rung, trial, sweep }
    }

    /// Moves all replicas and draws all offers, part by part.
    fn explore<T: Target<Workspace = W>>(&mut self, batches: &mut [Batch<W>], work: &Work<T>) {
        let (trial, sweep, rung) = (self.trial(), self.sweeps, &self.rung);
        let explore = |(part, batch): (&mut Part, &mut Batch<W>)| {
            batch.explore(&mut [Seated { part, rung, trial, sweep }], work);
        };
        match (&mut self.parts[..], batches) {
            ([part], [batch]) => explore((part, batch)),
            (parts, batches) => parts.par_iter_mut().zip(batches).for_each(explore),
        }
    }

    /// What follows once all replicas have moved.
    fn exchange(&mut self, batches: &mut [Batch<W>], canvas: &Canvas, round: &Round) {
        self.tell(batches);
        self.inject(batches, canvas, round);
        self.swap_neighbours(batches, canvas, round);
        for (lane, k) in self.rung.iter().enumerate() {
            self.trips.stays(lane, usize::from(*k));
        }
        if let Some(index) = &mut self.index {
            index.note(&self.rung[..self.chains]);
        }
        self.sweeps += 1;
    }

    /// Tells the ranks that share the block how high this one's states are and which points it offers, and hears the same
    /// of theirs.
    fn tell(&mut self, batches: &[Batch<W>]) {
        if self.group.is_alone() {
            return;
        }
        let mut offered = Walkers::new(self.own_offers.len());
        let mut ln_g = Vec::with_capacity(self.own_replicas.len());
        let mut to = 0;
        for (part, Batch { walkers, evaluator, .. }) in self.parts.iter().zip(batches) {
            ln_g.extend(walkers.states.iter().map(|state| state.ln_g));
            let Evaluator { points, out, .. } = evaluator;
            for at in part.replicas..out.lanes.len() {
                offered.replace(to, (points, at), out, &mut |_, _| ());
                to += 1;
            }
        }
        let all = self.group.everywhere(&News { ln_g, offered });
        (self.told.ln_g, self.told.offered) = (Vec::new(), Vec::new());
        for News { ln_g, offered: Walkers { points, states, elsewhere, .. } } in all {
            self.told.ln_g.extend(ln_g);
            self.told.offered.push((points, Contributions { lanes: states, elsewhere, ..Contributions::new(0) }));
        }
    }

    /// Offers each fresh point to the lowest chain of its ladder, a swap that costs nothing.
    #[inline(never)] // profiles tell what it takes
    fn inject(&mut self, batches: &mut [Batch<W>], canvas: &Canvas, round: &Round) {
        let rng = self.rng;
        let replicas = self.rung.len();
        let lowest = round.ladder.betas()[1];
        for offer in 0..self.ladders * self.offers {
            let base = offer / self.offers * self.chains;
            let lane = base + usize::from(self.replica_on[base]);
            let alpha = swap_acceptance(0.0, self.ln_offered(batches, offer), lowest, self.ln_g(batches, lane));
            if let Some((part, _)) = self.place(lane) {
                self.parts[part].tally.counts[1].swaps.add(alpha);
            }
            if alpha == 0.0 {
                continue;
            }
            let counter = Counter { purpose: Purpose::Swap, ..self.counter(replicas + offer) };
            if open_unit_f64(rng.words(counter, 0)[0]) < alpha {
                self.trips.renewed(lane);
                self.take(batches, lane, offer, canvas, round);
            }
        }
    }

    /// Puts the lowest chain of a ladder into an offered point.
    fn take(&mut self, batches: &mut [Batch<W>], lane: usize, offer: usize, canvas: &Canvas, round: &Round) {
        if !self.group.is_alone() {
            self.told.ln_g[lane] = self.ln_offered(batches, offer);
        }
        let Some((to, place)) = self.place(lane) else { return };
        let alone = self.group.is_alone();
        let (from, at) = if alone { self.place_of_offer(offer) } else { self.told.place[offer] };
        let tally = &mut self.parts[to].tally;
        let mut record = |state: Whole, w: f64| tally.state(canvas, round, 1, state, w);
        if !alone {
            let (points, out) = &self.told.offered[from];
            return batches[to].walkers.replace(place, (points, at), out, &mut record);
        }
        if from == to {
            let Batch { walkers, evaluator, .. } = &mut batches[to];
            walkers.replace(place, (&evaluator.points, at), &evaluator.out, &mut record);
        } else {
            let [Batch { evaluator, .. }, Batch { walkers, .. }] =
                batches.get_disjoint_mut([from, to]).expect("two parts");
            walkers.replace(place, (&evaluator.points, at), &evaluator.out, &mut record);
        }
    }

    /// Swaps neighbours; a part of [`advance`](Self::advance).
    pub fn swap(&mut self, canvas: &Canvas, round: &Round) {
        let mut batches = std::mem::take(&mut self.batches);
        self.swap_neighbours(&mut batches, canvas, round);
        self.batches = batches;
    }

    /// Swaps neighbouring tempered rungs (1, 2), (3, 4), … in even sweeps and (2, 3), (4, 5), … in odd ones.
    #[inline(never)] // profiles tell what it takes
    fn swap_neighbours(&mut self, batches: &mut [Batch<W>], canvas: &Canvas, round: &Round) {
        let rng = self.rng;
        let betas = round.ladder.betas();
        for ladder in 0..self.ladders {
            let base = ladder * self.chains;
            let counter = Counter { purpose: Purpose::Swap, ..self.counter(base) };
            for hotter in (1 + (self.sweeps % 2) as usize..self.chains).step_by(2) {
                let colder = hotter + 1;
                let lanes = [hotter, colder].map(|k| base + usize::from(self.replica_on[base + k - 1]));
                let places = lanes.map(|lane| self.place(lane));
                let [h, c] = lanes.map(|lane| self.ln_g(batches, lane));
                let alpha = swap_acceptance(betas[hotter], h, betas[colder], c);
                if let Some((part, _)) = places[1] {
                    self.parts[part].tally.counts[colder].swaps.add(alpha);
                }
                if open_unit_f64(rng.words(counter, colder as u16)[0]) < alpha {
                    for (place, k) in places.into_iter().zip([hotter, colder]) {
                        let Some((part, at)) = place else { continue };
                        let tally = &mut self.parts[part].tally;
                        batches[part].walkers.flush(at, &mut |state, w| tally.state(canvas, round, k, state, w));
                    }
                    self.rung.swap(lanes[0], lanes[1]);
                    self.replica_on.swap(base + hotter - 1, base + colder - 1);
                }
            }
        }
    }

    /// Records what all current states have gathered; must happen before the round ends.
    pub fn flush(&mut self, canvas: &Canvas, round: &Round) {
        for (part, batch) in self.parts.iter_mut().zip(&mut self.batches) {
            part.tally.half = usize::from(self.sweeps > round.half);
            for at in 0..part.replicas {
                let k = usize::from(self.rung[part.first + at]);
                let tally = &mut part.tally;
                batch.walkers.flush(at, &mut |state, w| tally.state(canvas, round, k, state, w));
            }
        }
    }

    /// Records into `tally` what the current states have gathered, and leaves them as they are.
    pub fn pending(&self, canvas: &Canvas, round: &Round, tally: &mut Tally) {
        for (part, Batch { walkers, .. }) in self.parts.iter().zip(&self.batches) {
            for (at, &weight) in walkers.pending.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
                let k = usize::from(self.rung[part.first + at]);
                tally.state(canvas, round, k, walkers.whole(at), weight);
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
        for Batch { evaluator, .. } in &mut self.batches {
            rays += std::mem::take(&mut evaluator.out.rays);
            faults.merge(&std::mem::take(&mut evaluator.out.faults));
        }
        (rays, faults)
    }
}

impl<W: Default> Batch<W> {
    /// Moves the replicas and draws the offers of all parts that sit in the batch.
    fn explore<T: Target<Workspace = W>>(&mut self, seated: &mut [Seated], work: &Work<T>) {
        if self.evaluator.counters.is_empty() {
            return;
        }
        if work.target.changes_techniques() {
            seated.iter_mut().for_each(|seated| seated.warm(self, work));
            let Batch { walkers, evaluator, betas } = self;
            evaluator.propose_changes(work.target, &walkers.points, betas.len(), |lane| betas[lane]);
            seated.iter_mut().for_each(|seated| seated.settle_changes(self, work));
        }
        seated.iter_mut().for_each(|seated| seated.propose(self, work));
        self.evaluator.evaluate(work.target, &self.walkers.points);
        seated.iter_mut().for_each(|seated| seated.settle(self, work));
    }
}

impl Part {
    /// Lanes of its replicas and of its offers.
    fn lanes(&self) -> [Range<usize>; 2] {
        let [replicas, offers] = self.seat;
        [replicas..replicas + self.replicas, offers..offers + self.offers]
    }
}

impl Seated<'_> {
    /// Has its lanes draw the words of the sweep.
    fn begin<W>(&self, batch: &mut Batch<W>) {
        for lanes in self.part.lanes() {
            batch.evaluator.counters[lanes].iter_mut().for_each(|counter| counter.step = self.sweep);
        }
    }

    /// Rung of its replica in that place.
    fn rung(&self, at: usize) -> usize {
        usize::from(self.rung[self.part.first + at])
    }

    /// Tells the inverse temperatures of its replicas.
    fn warm<W, T>(&self, batch: &mut Batch<W>, work: &Work<T>) {
        self.begin(batch);
        let [lanes, _] = self.part.lanes();
        batch.betas.resize(batch.walkers.states.len(), 0.0);
        for (at, beta) in batch.betas[lanes].iter_mut().enumerate() {
            *beta = work.round.ladder.betas()[self.rung(at)];
        }
    }

    /// Settles changes of technique of some replicas, before they step: states and weights of the sweep are those that steps
    /// lead to, so this costs evaluations and no weight.
    fn settle_changes<W: Default, T>(&mut self, batch: &mut Batch<W>, work: &Work<T>) {
        let &Work { canvas, round, .. } = work;
        let Batch { walkers, evaluator, .. } = batch;
        let [lanes, _] = self.part.lanes();
        for i in 0..evaluator.drawn.len() {
            let lane = evaluator.drawn[i];
            if !lanes.contains(&lane) {
                continue;
            }
            let k = self.rung(lane - lanes.start);
            let tally = &mut self.part.tally;
            let mut record = |state: Whole, w: f64| tally.state(canvas, round, k, state, w);
            let alpha = evaluator.settle_change(walkers, lane, round.ladder.betas()[k], &mut record);
            tally.counts[k].changes.count(alpha);
        }
    }

    /// Says how each of its lanes moves next.
    fn propose<W: Default, T>(&mut self, batch: &mut Batch<W>, work: &Work<T>) {
        self.begin(batch);
        let (evaluator, mixes) = (&mut batch.evaluator, &work.round.mixes[self.trial]);
        let ([replicas, offers], rng) = (self.part.lanes(), evaluator.rng());
        evaluator.moves[offers].fill(Move::Fresh);
        for (at, lane) in replicas.enumerate() {
            let counter = Counter { purpose: Purpose::Step, ..evaluator.counters[lane] };
            let [decision, choice, ..] = rng.words(counter, 0);
            let scale = mixes[self.rung(at)].pick(open_unit_f64(choice));
            (self.part.decision[at], self.part.scale[at]) = (decision, scale as u8);
            evaluator.moves[lane] = Move::Small(work.bank[scale]);
        }
    }

    /// Accepts or refuses what was proposed, and records it.
    fn settle<W: Default, T>(&mut self, batch: &mut Batch<W>, work: &Work<T>) {
        let &Work { canvas, round, .. } = work;
        let Batch { walkers, evaluator, .. } = batch;
        let [replicas, offers] = self.part.lanes();
        self.part.tally.half = usize::from(self.sweep >= round.half);
        for (at, lane) in replicas.enumerate() {
            let k = self.rung(at);
            let Part { tally, decision, scale, refused, .. } = &mut *self.part;
            let u = open_unit_f64(decision[at]);
            let mut record = |state: Whole, w: f64| tally.state(canvas, round, k, state, w);
            let beta = round.ladder.betas()[k];
            let alpha = walkers.step(lane, beta, (&evaluator.points, lane), &evaluator.out, u, &mut record);
            let counts = &mut tally.counts[k];
            counts.steps[usize::from(scale[at])].add(alpha);
            counts.halves[tally.half].add(walkers.states[lane].ln_g);
            refused[at] = if u < alpha { 0 } else { refused[at] + 1 };
            counts.longest_rejection = counts.longest_rejection.max(refused[at]);
        }
        for lane in offers {
            if round.open {
                self.part.tally.only_seen(evaluator.out.whole(lane));
            } else {
                self.part.tally.uniform_point(canvas, round, evaluator.out.whole(lane), false);
            }
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
                blocks.iter_mut().for_each(|block| block.set_offers(offers));
                let batches = blocks.iter().flat_map(|block| &block.batches);
                let counters: Vec<Counter> = batches.flat_map(|batch| batch.evaluator.counters.clone()).collect();
                let words: HashSet<[u32; 4]> = counters.iter().map(|counter| rng.words(*counter, 0)).collect();
                assert_eq!(counters.len(), 3 * 3 * (rungs - 1 + offers));
                assert_eq!(words.len(), counters.len(), "{rungs} rungs, {offers} offers");
            }
        }
    }
}
