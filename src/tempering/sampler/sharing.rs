//! One sampler on several ranks: each works on blocks of its own, and all learn the same.
//!
//! Between ends of rounds a rank's blocks need nobody. At the end of a round everyone is told what all blocks saw (counts
//! and histograms, never where chains are), and draws the same conclusions from it. What is summed over all blocks (film,
//! probes, stratified points, rays) is in two places meanwhile: the first rank has what there was, the others what they
//! have added since they last gave it away. All of it are integers, so the sum of all ranks is that of one process, bit by
//! bit. Chains travel only to be saved or shown, to the first rank.

use std::{ops::Range, sync::Arc};

use serde::{Deserialize, Serialize};

use super::{Portion, Sampler, Screen, saved::SavedPortion};
use crate::{
    film::Accumulator,
    path::Faults,
    ranks::Company,
    saved::{Source, Unfit},
    tempering::{BlockStatistics, Histogram, PointGroups, Probes, SavedTally, Seen, Sum},
};

/// The other ranks, and which blocks are this one's.
pub(super) struct Share {
    company: Arc<Company>,
    own: Range<usize>,
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
        let of = |rank: usize| self.portions.len() * rank / company.count();
        let own = of(company.number())..of(company.number() + 1);
        if !company.is_first() {
            let Screen { size, prepared, unit, .. } = &self.screen;
            self.screen.film = Accumulator::new(size[0], size[1], prepared.count, *unit);
        }
        self.share = Some(Share { company, own });
        self.keep_own();
    }

    /// The blocks that are worked on here: all, unless the work is shared.
    pub(super) fn own(&self) -> Range<usize> {
        self.share.as_ref().map_or(0..self.portions.len(), |share| share.own.clone())
    }

    /// Brings all sums and all chains to the first rank, which then has what a process alone would have, to save it or to show
    /// it. All ranks must call this after the same sweeps; does nothing where the work is not shared.
    pub fn gather(&mut self) {
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
            for (i, bytes) in all.iter().enumerate() {
                let (first, portions, added): (usize, Vec<SavedPortion>, Added) =
                    postcard::from_bytes(bytes).expect("what a rank told");
                if i > 0 {
                    self.add(added);
                    for (number, saved) in (first..).zip(portions) {
                        self.restore_portion(number, saved).expect("what a rank of the same run told");
                    }
                }
            }
        }
        self.keep_own();
    }

    /// Tells everyone what all blocks saw. Until [`keep_own`](Self::keep_own) all ranks have all sums, but for the film.
    pub(super) fn exchange(&mut self) {
        let Some(share) = &self.share else { return };
        let company = share.company.clone();
        let own: Vec<Statistics> = self.portions[share.own.clone()].iter().map(Portion::statistics).collect();
        let told = company.everywhere(&(share.own.start, own, self.added()));
        for (rank, (first, portions, added)) in told.into_iter().enumerate() {
            if rank == company.number() {
                continue;
            }
            self.add(added);
            for (portion, statistics) in self.portions[first..].iter_mut().zip(portions) {
                portion.learn(statistics).expect("what a rank of the same run told");
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
            ladders: self.ladders.as_ref().map(crate::tempering::Block::statistics),
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

    /// Through all phases, brought together amid a round and at the end, with more ranks than divide the blocks evenly: the
    /// first rank has all that a run alone has, chains, sums and film, bit by bit.
    #[test]
    fn ranks_come_to_the_bits_of_one_process() {
        for ladder in [LadderChoice::Auto, LadderChoice::Replicas(4), LadderChoice::Replicas(1)] {
            let mut alone = sampler(ladder.clone());
            let mut states = Vec::new();
            for until in [1 << 15, (1 << 18) + 77, u64::MAX] {
                while alone.sweeps_left() != Some(0) && alone.evaluations() < until {
                    alone.advance(&Slope, u64::MAX, Some(until));
                }
                states.push(state(&alone));
            }
            for count in [2, 3, 5] {
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
