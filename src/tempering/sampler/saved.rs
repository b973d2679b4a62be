//! Replica exchange between two sweeps, saved and gone on with.

use std::{
    io::{self, Write},
    sync::Arc,
};

use serde::{Deserialize, Serialize};

use super::{Portion, Sampler, Setup, State, most_rungs, rounds::LANES_A_PART};
use crate::{
    chain::{Importance, Start},
    film::Accumulator,
    ranks::Group,
    rng::Purpose,
    saved::{Source, Unfit, expect, write_value},
    tempering::{Block, Histogram, Layers, PointGroups, Probes, SavedBlock, SavedTally, Seen, Sum},
};

/// All of a [`Sampler`] but for its portions and its film, and for what follows from its [`Setup`].
#[derive(Serialize, Deserialize)]
struct SavedSampler {
    state: State,
    importance: Option<Importance>,
    groups: Vec<Seen>,
    /// The film still has the layers of the balanced and of the stratified points, and there are probes.
    has_hot: bool,
    has_even: bool,
    has_probes: bool,
}

/// A [`Portion`] as it is saved.
#[derive(Serialize, Deserialize)]
pub(super) struct SavedPortion {
    uniform: (u64, usize),
    tally: SavedTally,
    ladders: Option<SavedBlock>,
    past: Vec<Histogram>,
    added: [Sum; 2],
    starts: Vec<Start>,
}

impl<W: Default + Send> Sampler<W> {
    /// Writes all that it takes to go on from here, as if nothing had been between; reports that nobody has taken yet are
    /// not kept.
    pub fn save(&self, out: &mut dyn Write) -> io::Result<()> {
        let saved = SavedSampler {
            state: self.state.clone(),
            importance: self.importance.as_deref().cloned(),
            groups: self.screen.groups.saved(),
            has_hot: self.screen.layers.hot.is_some(),
            has_even: self.screen.layers.even.is_some(),
            has_probes: self.screen.probes.is_some(),
        };
        write_value(out, &saved)?;
        for portion in &self.portions {
            write_value(out, &portion.saved())?;
        }
        self.screen.film.save(out)?;
        self.screen.probes.as_ref().map_or(Ok(()), |probes| probes.save(out))
    }

    /// The sampler that was [saved](Self::save), with the set-up that it had.
    pub fn restored(setup: Setup, from: &mut Source) -> Result<Sampler<W>, Unfit> {
        let pixels = u64::from(setup.size[0]) * u64::from(setup.size[1]);
        let layers = Layers::of(&setup.choices, most_rungs(&setup.choices), setup.elsewhere).count as u64;
        expect(Accumulator::fewest_bytes(pixels, layers) <= from.left(), "film")?;
        let mut sampler = Sampler::new(setup);
        let saved: SavedSampler = from.value()?;
        let screen = &mut sampler.screen;
        screen.layers.hot = screen.prepared.hot.filter(|_| saved.has_hot);
        screen.layers.even = screen.prepared.even.filter(|_| saved.has_even);
        expect(saved.groups.len() == sampler.portions.len(), "groups of points")?;
        screen.groups = PointGroups::restored(saved.groups);
        screen.probes = saved.has_probes.then(|| Probes::new(&screen.map, screen.unit));
        expect(saved.importance.as_ref().is_none_or(|importance| importance.fits(screen.size)), "importance")?;
        let State { round, offers, ladders_a_block, .. } = &saved.state;
        let (rungs, chains) = (round.ladder.rungs(), round.ladder.chains());
        let most_ladders = if chains > 0 { sampler.plan.groups_a_block(None, 2 * chains) } else { 0 };
        let at_work = *ladders_a_block <= most_ladders && chains + offers <= usize::from(u16::MAX);
        expect(rungs <= most_rungs(&sampler.choices) && at_work, "ladders")?;
        expect(round.open == sampler.state.round.open, "points")?;
        sampler.importance = saved.importance.map(Arc::new);
        sampler.state = saved.state;
        for number in 0..sampler.portions.len() {
            sampler.restore_portion(number, from.value()?, &Group::alone())?;
        }
        expect(sampler.a_sweep() > 0 && sampler.state.schedule.done <= sampler.state.schedule.length, "schedule")?;
        sampler.screen.film.restore(from)?;
        sampler.screen.probes.as_mut().map_or(Ok(()), |probes| probes.restore(from))?;
        Ok(sampler)
    }

    /// Puts a portion where it was saved: what a rank has of it that shares it with a group.
    pub(super) fn restore_portion(&mut self, number: usize, saved: SavedPortion, group: &Group) -> Result<(), Unfit> {
        let (rng, size, layers) = (self.rng, self.screen.size, self.screen.prepared.count);
        let rungs = self.state.round.ladder.rungs();
        let Portion { uniform, tally, ladders, past, added, starts } = &mut self.portions[number];
        uniform.restore(saved.uniform)?;
        self.importance.iter().for_each(|importance| uniform.set_importance(importance));
        tally.restore(saved.tally)?;
        if let Some(saved) = saved.ladders {
            let mixes = self.state.round.mixes.iter().all(|mixes| mixes.len() == rungs);
            expect(rungs > 1 && self.state.ladders_a_block > 0 && self.state.offers > 0 && mixes, "ladders")?;
            let mut block = Block::new(
                rng,
                (number, self.state.ladders_a_block),
                rungs,
                self.state.offers,
                LANES_A_PART,
                layers,
                size,
            );
            block.set_importance(self.importance.as_ref());
            block.share(group);
            block.restore(saved)?;
            *ladders = Some(block);
        }
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let on_film =
            |start: &Start| start.counter.purpose == Purpose::Stratified && u64::from(start.counter.ladder) < pixels;
        expect(saved.starts.iter().all(on_film), "starts")?;
        (*past, *added, *starts) = (saved.past, saved.added, saved.starts);
        Ok(())
    }
}

impl SavedPortion {
    /// Adds what the next of the ranks that share it has of it.
    pub(super) fn join(&mut self, next: SavedPortion) {
        self.tally.merge(&next.tally);
        if let (Some(block), Some(next)) = (&mut self.ladders, next.ladders) {
            block.join(next);
        }
    }
}

impl<W: Default + Send> Portion<W> {
    /// All that there is to save of it between sweeps.
    pub(super) fn saved(&self) -> SavedPortion {
        SavedPortion {
            uniform: self.uniform.saved(),
            tally: self.tally.saved(),
            ladders: self.ladders.as_ref().map(Block::saved),
            past: self.past.clone(),
            added: self.added,
            starts: self.starts.clone(),
        }
    }
}
