//! One sampler on several ranks: each works on blocks of its own, and all learn the same.
//!
//! Between ends of rounds a rank's blocks need nobody; where there are more ranks than blocks, several share one and talk in
//! every sweep (see [`Block`]). At the end of a round everyone is told what all blocks saw (counts
//! and histograms, never where chains are), and draws the same conclusions from it. What is summed over all blocks (film,
//! probes, stratified points, rays) is in two places meanwhile: the first rank has what there was, the others what they
//! have added since they last gave it away. All of it are integers, so the sum of all ranks is that of one process, bit by
//! bit. Chains travel only to be saved or shown, to the first rank.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    ops::Range,
    sync::Arc,
};

use serde::{Deserialize, Serialize};

use super::{Portion, Sampler, Screen, saved::SavedPortion};
use crate::{
    film::Accumulator,
    path::Faults,
    ranks::{Company, Group},
    saved::{Source, Unfit},
    tempering::{Block, BlockStatistics, Histogram, PointGroups, Probes, SavedTally, Seen, Sum},
};

/// The other ranks, and which blocks are this one's.
pub(super) struct Share {
    company: Arc<Company>,
    own: Range<usize>,
    /// Those that share its only block with it.
    group: Group,
    /// What the first rank has of that block, while it has the whole to show.
    aside: Option<SavedPortion>,
}

/// What a rank adds to the sums over all blocks.
#[derive(Serialize, Deserialize)]
struct Added {
    groups: Vec<Seen>,
    rays: u64,
    ladder_rays: u64,
    first_rays: [[u64; 2]; 2],
    faults: Faults,
}

/// What a [`Portion`] saw, without its chains.
#[derive(Serialize, Deserialize)]
struct Statistics {
    tally: SavedTally,
    ladders: Option<BlockStatistics>,
    past: Vec<Histogram>,
    added: [Sum; 2],
    starts: Vec<crate::chain::Start>,
}

impl<W: Default + Send> Sampler<W> {
    /// Shares the work with those ranks, who all have the same sampler now.
    pub fn share(&mut self, company: Arc<Company>) {
        let own = company.own(self.portions.len());
        let group = company.group(own.start, self.portions.len());
        if !company.is_first() {
            let Screen { size, prepared, unit, .. } = &self.screen;
            self.screen.film = Accumulator::new(size[0], size[1], prepared.count, *unit);
        }
        if !group.is_alone() {
            self.portions[own.start].ladders.iter_mut().for_each(|block| block.share(&group));
        }
        self.share = Some(Share { company, own, group, aside: None });
        self.keep_own();
        self.forget_what_is_told();
    }

    /// The blocks that are worked on here: all, unless the work is shared.
    pub(super) fn own(&self) -> Range<usize> {
        self.share.as_ref().map_or(0..self.portions.len(), |share| share.own.clone())
    }

    /// The ranks that share what is worked on here.
    pub(super) fn partners(&self) -> Group {
        self.share.as_ref().map_or_else(Group::alone, |share| share.group.clone())
    }

    /// Goes on with what is this rank's of a block that it had the whole of, to show it.
    pub(super) fn take_up_own(&mut self) {
        let Some(share) = &mut self.share else { return };
        let (own, group) = (share.own.start, share.group.clone());
        if let Some(aside) = share.aside.take() {
            self.restore_portion(own, aside, &group).expect("its own state");
        }
    }

    /// Brings all sums and all chains to the first rank, which then has what a process alone would have, to save it or to show
    /// it. All ranks must call this after the same sweeps; does nothing where the work is not shared.
    pub fn gather(&mut self) {
        self.take_up_own();
        let Some(share) = &self.share else { return };
        let company = share.company.clone();
        let own: Vec<SavedPortion> = self.portions[share.own.clone()].iter().map(Portion::saved).collect();
        let own = postcard::to_stdvec(&(share.own.start, own, self.added())).expect("state that can be saved");
        let mut all = vec![own];
        // by rank, whatever way they came
        company.fold(
            &mut all,
            |all| postcard::to_stdvec(all).expect("bytes"),
            |all, bytes| all.extend(postcard::from_bytes::<Vec<Vec<u8>>>(bytes).expect("what a rank told")),
        );
        self.gather_film(&company);
        self.gather_probes(&company);
        if company.is_first() {
            self.take_all(&all);
        }
        self.keep_own();
    }

    /// Takes what all ranks have, each in a message of its own, the first of which is this one's.
    fn take_all(&mut self, all: &[Vec<u8>]) {
        let mut whole: BTreeMap<usize, SavedPortion> = BTreeMap::new();
        for (rank, bytes) in all.iter().enumerate() {
            let (first, portions, added): (usize, Vec<SavedPortion>, Added) =
                postcard::from_bytes(bytes).expect("what a rank told");
            if rank > 0 {
                self.add(added);
            }
            for (number, saved) in (first..).zip(portions) {
                match whole.entry(number) {
                    Entry::Vacant(place) => drop(place.insert(saved)),
                    Entry::Occupied(place) => place.into_mut().join(saved),
                }
            }
        }
        let Share { own, group, aside, .. } = self.share.as_mut().expect("others that told");
        let own = own.clone();
        if group.is_alone() {
            whole.retain(|number, _| !own.contains(number));
        } else {
            *aside = Some(self.portions[own.start].saved());
        }
        for (number, saved) in whole {
            self.restore_portion(number, saved, &Group::alone()).expect("what a rank of the same run told");
        }
    }

    /// Tells everyone what all blocks saw. Until [`keep_own`](Self::keep_own) all ranks have all sums, but for the film.
    pub(super) fn exchange(&mut self) {
        let Some(share) = &self.share else { return };
        let company = share.company.clone();
        let own: Vec<Statistics> = self.portions[share.own.clone()].iter().map(Portion::statistics).collect();
        let told = company.everywhere(&(share.own.start, own, self.added()));
        for (rank, (first, portions, added)) in told.into_iter().enumerate() {
            if rank != company.number() {
                self.add(added);
            }
            for (number, told) in (first..).zip(portions) {
                let ranks = company.ranks_at(number, self.portions.len());
                let portion = &mut self.portions[number];
                let learnt = match rank == ranks.start {
                    true => portion.learn(told),
                    false => portion.learn_more(told),
                };
                learnt.expect("what a rank of the same run told");
            }
        }
        self.gather_probes(&company);
        if let Some(probes) = &mut self.screen.probes {
            let mut bytes = Vec::new();
            if company.is_first() {
                probes.save(&mut bytes).expect("memory takes all");
            }
            let bytes = company.bytes_of_first(bytes);
            if !company.is_first() {
                probes.restore(&mut source(&bytes)).expect("what a rank of the same run told");
            }
        }
    }

    /// Of what is summed over all blocks, but for the film, the first rank keeps the sum; the others begin anew. Their film they
    /// keep until it is gathered.
    pub(super) fn keep_own(&mut self) {
        if self.share.as_ref().is_none_or(|share| share.company.is_first()) {
            return;
        }
        let screen = &mut self.screen;
        screen.groups = PointGroups::new(self.portions.len());
        if screen.probes.is_some() {
            screen.probes = Some(Probes::new(&screen.map, screen.unit));
        }
        let state = &mut self.state;
        (state.rays, state.ladder_rays, state.first_rays, state.faults) = (0, 0, [[0; 2]; 2], Faults::default());
    }

    /// What was seen of a block that is shared is the first's of the group, once all have been told.
    pub(super) fn forget_what_is_told(&mut self) {
        if let Some(Share { own, group, .. }) = self.share.as_ref().filter(|share| !share.group.is_first()) {
            debug_assert!(!group.is_alone());
            let Portion { tally, ladders, .. } = &mut self.portions[own.start];
            tally.forget();
            ladders.iter_mut().for_each(Block::forget);
        }
    }

    /// What the first rank finds with the whole film, for everyone.
    pub(super) fn found_by_first<T>(&mut self, find: impl FnOnce(&Self) -> T) -> T
    where
        T: Serialize + serde::de::DeserializeOwned,
    {
        let Some(share) = &self.share else { return find(self) };
        let company = share.company.clone();
        self.gather_film(&company);
        let found = company.is_first().then(|| find(self));
        company.of_first(found.as_ref())
    }

    fn added(&self) -> Added {
        let state = &self.state;
        Added {
            groups: self.screen.groups.saved(),
            rays: state.rays,
            ladder_rays: state.ladder_rays,
            first_rays: state.first_rays,
            faults: state.faults.clone(),
        }
    }

    fn add(&mut self, added: Added) {
        let state = &mut self.state;
        self.screen.groups.merge(&PointGroups::restored(added.groups));
        state.rays += added.rays;
        state.ladder_rays += added.ladder_rays;
        state.first_rays.as_flattened_mut().iter_mut().zip(added.first_rays.as_flattened()).for_each(|(s, n)| *s += n);
        state.faults.merge(&added.faults);
    }

    /// Adds up the film at the first rank.
    fn gather_film(&mut self, company: &Company) {
        let Screen { size, prepared, unit, film, .. } = &mut self.screen;
        company.gather_film(film, || Accumulator::new(size[0], size[1], prepared.count, *unit));
    }

    /// Adds up the probes at the first rank, where there are any; the others keep theirs.
    fn gather_probes(&self, company: &Company) {
        let screen = &self.screen;
        let Some(probes) = &screen.probes else { return };
        let add = |probes: &mut &Probes, bytes: &[u8]| {
            let mut other = Probes::new(&screen.map, screen.unit);
            other.restore(&mut source(bytes)).expect("what a rank of the same run told");
            probes.merge(&other);
        };
        company.fold(&mut &*probes, |probes| saved(|bytes| probes.save(bytes)), add);
    }
}

impl<W: Default + Send> Portion<W> {
    /// What this rank's portion saw.
    fn statistics(&self) -> Statistics {
        Statistics {
            tally: self.tally.saved(),
            ladders: self.ladders.as_ref().map(Block::statistics),
            past: self.past.clone(),
            added: self.added,
            starts: self.starts.clone(),
        }
    }

    /// Takes what another rank's portion saw.
    fn learn(&mut self, told: Statistics) -> Result<(), Unfit> {
        self.tally.restore(told.tally)?;
        if let (Some(block), Some(statistics)) = (&mut self.ladders, told.ladders) {
            block.set_statistics(statistics)?;
        }
        (self.past, self.added, self.starts) = (told.past, told.added, told.starts);
        Ok(())
    }

    /// Adds what another rank saw that shares the portion.
    fn learn_more(&mut self, told: Statistics) -> Result<(), Unfit> {
        let mut seen = self.tally.saved();
        seen.merge(&told.tally);
        self.tally.restore(seen)?;
        match (&mut self.ladders, told.ladders) {
            (Some(block), Some(statistics)) => block.add_statistics(statistics),
            _ => Ok(()),
        }
    }
}

/// What something writes.
fn saved(save: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> Vec<u8> {
    let mut bytes = Vec::new();
    save(&mut bytes).expect("memory takes all");
    bytes
}

/// Bytes to restore from.
fn source(bytes: &[u8]) -> Source<'_> {
    Source::new(bytes, bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        film::{Filter, Footprint},
        path::{Contribution, Contributions},
        ranks::threads::together,
        rng::{Rng, unit_f32},
        sample::Proposals,
        scene::Rgb,
        tempering::{Choices, LadderChoice, Setup},
    };

    /// Light e^(6 y) times as bright further up, so that a ladder has something to do, and none in the lower quarter.
    struct Slope;

    impl crate::chain::Target for Slope {
        type Workspace = Vec<u32>;

        fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
            proposals.begin(live);
            proposals.draw(0, live);
            for &lane in &*live {
                let lane = lane as usize;
                let [x, y, u, _] = proposals.block(0, lane).map(unit_f32);
                out.elsewhere.clear(lane);
                let g = if y < 0.25 { 0.0 } else { libm::exp(f64::from(6.0 * y + 2.0 * u)) as f32 };
                out.lanes[lane] = Contribution::settle_whole([x, y], Rgb::splat(g), &mut out.elsewhere, lane).0;
                out.rays += 1;
            }
        }
    }

    fn sampler(ladder: LadderChoice) -> Sampler<Vec<u32>> {
        Sampler::new(Setup {
            rng: Rng::new(3),
            choices: Choices { ladder, ..Choices::default() },
            footprint: Footprint::new(Filter::Box, 8, 8),
            size: [8, 8],
            unit: 3000.0,
            elsewhere: false,
            outcomes: false,
            evaluations: Some(1 << 19),
        })
    }

    fn state(sampler: &Sampler<Vec<u32>>) -> Vec<u8> {
        saved(|bytes| sampler.save(bytes))
    }

    /// Through all phases, brought together amid a round and at the end, with numbers of ranks that do not divide the eight
    /// blocks evenly or are more, so that replicas of one ladder live on two ranks or three: the first rank has all that a run
    /// alone has, chains, sums and film, bit by bit.
    #[test]
    fn ranks_come_to_the_bits_of_one_process() {
        let cases = [
            (LadderChoice::Auto, [3, 11]),
            (LadderChoice::Replicas(4), [5, 11]),
            (LadderChoice::Replicas(1), [2, 11]),
            (LadderChoice::Replicas(40), [2, 20]),
        ];
        for (ladder, counts) in cases {
            let mut alone = sampler(ladder.clone());
            let mut states = Vec::new();
            for until in [1 << 15, (1 << 18) + 77, u64::MAX] {
                while alone.sweeps_left() != Some(0) && alone.evaluations() < until {
                    alone.advance(&Slope, u64::MAX, Some(until));
                }
                states.push(state(&alone));
            }
            for count in counts {
                let shared = together(count, |company| {
                    let mut own = sampler(ladder.clone());
                    own.share(company);
                    let mut states = Vec::new();
                    for until in [1 << 15, (1 << 18) + 77, u64::MAX] {
                        while own.sweeps_left() != Some(0) && own.evaluations() < until {
                            own.advance(&Slope, u64::MAX, Some(until));
                        }
                        own.gather();
                        states.push(state(&own));
                    }
                    states
                });
                for (i, expected) in states.iter().enumerate() {
                    assert!(shared[0][i] == *expected, "{ladder:?}, {count} ranks, state {i}");
                    assert!(shared[1][i] != *expected, "a rank that leads nobody does not have it all");
                }
            }
        }
    }
}
