//! Replica exchange from the first point to the image: rounds, what is learnt in them, and what is made of it.
//!
//! The first sweeps are uniform points only. They tell how much of the cube is lit and how g is spread: from that the
//! rungs follow, and the states that chains start from. (Chains that started from nothing and waited for swaps left the
//! image 10 % dark after 500 sweeps, where a bright light fills little of the picture.) Then sweeps come in rounds of
//! doubling length. Within a round nothing changes; between rounds normalisers, rungs, step sizes, the weights of the
//! image and the share of uniform points are made from what was seen before, until they are frozen.

mod development;
mod learnt;
mod pooling;
mod reporting;
mod rounds;
mod saved;
mod sharing;

use std::sync::Arc;

use rayon::prelude::*;

pub use development::Development;
pub use learnt::Learnt;
use learnt::Luminance;

use serde::{Deserialize, Serialize};
use sharing::Share;

use super::{
    Block, Canvas, Choices, Combine, Crew, Histogram, Ladder, LadderChoice, Layers, PointGroups, ProbeMap, Probes,
    Round, RoundReport, Sum, Tally, Weights,
    block::MOST_BLOCKS,
    independent::{Independent, Use},
    probes::TRIALS,
    steps::{self, StepCount},
    tuning::{Choice, Variances},
};
use crate::{
    chain::{FEWEST_BLOCKS, Importance, Measure, Plan, Start, Target, TechniqueChanges},
    film::{Accumulator, Footprint},
    path::Faults,
    ranks::Group,
    rng::Rng,
};

/// Uniform points before chains start, and before that where it is to be learnt where chains are wanted; a 32nd of the
/// run where that is less.
const BOOTSTRAP: u64 = 1 << 17;
/// The same of open points, which are those of many choices, where it is to be learnt where chains are wanted.
const OPEN_BOOTSTRAP: u64 = 1 << 14;
/// Ladders longer than 64 rungs get fewer blocks, with no more rungs together than this: each block has histograms for
/// each rung, of some ten kilobytes.
const RUNGS_OF_ALL_BLOCKS: usize = 4096;
/// Replicas where their number is free, at most.
const MOST_AUTOMATIC: usize = 8;

/// Lanes of ladders that are evaluated together where blocks have fewer.
const LANES_TOGETHER: usize = 128;
/// Turns of work that a thread has at least where blocks go together, so that none waits long for another.
const TURNS_A_THREAD: usize = 4;
/// Towards the end of a slice crews get smaller, down to this part of their size: the last one is what others wait for.
const SMALLEST_CREW: usize = 4;

/// Portions that one thread works on at once: packets of rays are full only if blocks of few lanes go together. Nothing that
/// is computed depends on it.
fn portions_together<W: Default + Send>(portions: &[Portion<W>]) -> usize {
    let blocks = || portions.iter().filter_map(|portion| portion.ladders.as_ref());
    if !blocks().all(Block::can_join) {
        return 1;
    }
    let lanes = blocks().map(Block::lanes).max().unwrap_or(LANES_TOGETHER);
    let at_most = portions.len() / (TURNS_A_THREAD * rayon::current_num_threads());
    LANES_TOGETHER.div_ceil(lanes).min(at_most).clamp(1, MOST_BLOCKS)
}

/// Portions in crews of at most so many, in the order in which threads shall take them.
fn crews<W>(mut portions: &mut [Portion<W>], together: usize) -> Vec<&mut [Portion<W>]> {
    let mut crews = Vec::new();
    while !portions.is_empty() {
        let a_turn = portions.len() / (2 * rayon::current_num_threads());
        let size = a_turn.clamp(together.div_ceil(SMALLEST_CREW), together).min(portions.len());
        let (crew, rest) = std::mem::take(&mut portions).split_at_mut(size);
        crews.push(crew);
        portions = rest;
    }
    crews
}

/// Replica exchange at work on one target.
pub struct Sampler<W> {
    rng: Rng,
    choices: Choices,
    screen: Screen,
    plan: Plan,
    portions: Vec<Portion<W>>,
    /// Where chains are wanted; absent where they follow the luminance itself, and before that is known.
    importance: Option<Arc<Importance>>,
    state: State,
    /// Stratified points of the longest run that is pooled; 0 where the sampler did all itself.
    longest: u64,
    /// Evaluations that the run was planned for: how it is cut up and how long it learns follow from that.
    planned: Option<u64>,
    /// Evaluations to go through.
    wanted: Option<u64>,
    reports: Vec<RoundReport>,
    /// The other ranks, where the work is shared.
    share: Option<Share>,
}

/// All that changes between sweeps, but for portions, film and importance: what there is to save of it.
#[derive(Clone, Serialize, Deserialize)]
struct State {
    round: Round,
    schedule: Schedule,
    /// Magnitude of c, fixed when chains start.
    ln_unit: f64,
    /// Points offered to a ladder each sweep.
    offers: usize,
    ladders_a_block: usize,
    /// Weights and shares of the round.
    choice: Choice,
    /// What each round has measured of the errors of points and of states, and its evaluations.
    variances: Vec<(f64, Variances)>,
    /// Whether uniform points leave chains anything to gain, as far as is known before there are any.
    promising: bool,
    /// Centre of the sizes of steps on the target, in scales of the bank.
    centre: f64,
    /// Rungs were moved for the next round.
    moved: bool,
    /// Rays of the ladders in this round, offered points included.
    ladder_rays: u64,
    /// The part of the film's weight that each pixel has got, in evaluations.
    effort: f64,
    /// Correlation of chains as the image sees it, from the last round that was probed.
    image_correlation: Option<f64>,
    /// States of chains on each rung so far, of all ladders.
    states_a_rung: u64,
    /// Uniform points for the image before chains started.
    bootstrap: u64,
    /// Uniform points for the image so far: those that came in the order of pixels, and those offered to ladders.
    points: [u64; 2],
    /// Stratified points before chains started, and their rays: of those that chose, and of open ones.
    first_rays: [[u64; 2]; 2],
    sweeps: u64,
    evaluations: u64,
    faults: Faults,
    rays: u64,
}

impl State {
    /// Before the first sweep.
    fn new(schedule: Schedule, open: bool) -> State {
        State {
            round: Round {
                ladder: Ladder::uniform(),
                weights: Weights::uniform_alone(),
                mixes: [(); TRIALS].map(|()| Vec::new()),
                effort: [1.0, 0.0],
                only_offers: false,
                open,
                half: u64::MAX,
            },
            schedule,
            ln_unit: 0.0,
            offers: 0,
            ladders_a_block: 0,
            choice: Choice { ratio: 0.0, share: 1.0, relative_error: 1.0 },
            variances: Vec::new(),
            promising: true,
            centre: steps::KELEMEN,
            moved: false,
            ladder_rays: 0,
            effort: 0.0,
            image_correlation: None,
            states_a_rung: 0,
            bootstrap: 0,
            points: [0; 2],
            first_rays: [[0; 2]; 2],
            sweeps: 0,
            evaluations: 0,
            faults: Faults::default(),
            rays: 0,
        }
    }
}

/// The film and all that belongs to it.
struct Screen {
    footprint: Footprint,
    size: [u32; 2],
    film: Accumulator,
    unit: f64,
    /// Whether there is room for what points contribute elsewhere than at their own positions.
    elsewhere: bool,
    /// The layers that are recorded to.
    layers: Layers,
    /// All that there are.
    prepared: Layers,
    map: ProbeMap,
    probes: Option<Probes>,
    groups: PointGroups,
}

/// One block of ladders and one of independent points, with what they saw.
struct Portion<W> {
    uniform: Independent<W>,
    tally: Tally,
    ladders: Option<Block<W>>,
    /// What ladders saw that are given up, and what they added to the image.
    past: Vec<Histogram>,
    added: [Sum; 2],
    starts: Vec<Start>,
}

/// Where the run stands among its rounds.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Schedule {
    /// Number of the round; 0 has uniform points only.
    round: u32,
    /// Sweeps of the round, and those done.
    length: u64,
    done: u64,
    /// Sweeps of the ladders in a sweep of the run, so many that independent points come in batches.
    ladder_sweeps: u64,
    /// Independent points of a block in each sweep, beside its ladders.
    points: usize,
    /// Evaluations that the round was planned for.
    evaluations: u64,
    /// Nothing is learnt any more.
    frozen: bool,
    /// Evaluations before settings were frozen.
    learning: u64,
}

/// What a run of replica exchange still learns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learning {
    /// Where the light is: uniform points only.
    Bootstrap,
    /// Rungs, weights, shares, sizes of steps.
    Rounds,
    /// Nothing: settings are frozen.
    Over,
}

/// What a run of replica exchange is about, beside what is sampled.
pub struct Setup {
    /// Random numbers.
    pub rng: Rng,
    /// What was chosen.
    pub choices: Choices,
    /// From film positions to pixels.
    pub footprint: Footprint,
    /// Width and height of the film in pixels.
    pub size: [u32; 2],
    /// Typical magnitude of the brightest f.
    pub unit: f64,
    /// Whether points may contribute elsewhere than at their own film positions, as [`Target::splats_elsewhere`] says;
    /// that takes further layers of the film.
    pub elsewhere: bool,
    /// Whether points choose among outcomes that can be had all at once, as [`Target::has_outcomes`] says.
    pub outcomes: bool,
    /// Evaluations to go through; without end where absent.
    pub evaluations: Option<u64>,
}

impl<W: Default + Send> Sampler<W> {
    /// Ready to start.
    pub fn new(setup: Setup) -> Sampler<W> {
        let Setup { rng, choices, footprint, size, unit, elsewhere, outcomes, evaluations } = setup;
        let most_rungs = most_rungs(&choices);
        let mut plan = Plan::new(evaluations, 1);
        plan.blocks = plan.blocks.min((RUNGS_OF_ALL_BLOCKS / most_rungs).max(FEWEST_BLOCKS) & !1); // halves are compared
        let layers = Layers::of(&choices, most_rungs, elsewhere);
        let map = ProbeMap::new(size);
        let learns = choices.combine == Combine::Balance && !choices.is_uniform_alone();
        let screen = Screen {
            footprint,
            size,
            elsewhere,
            film: Accumulator::new(size[0], size[1], layers.count, unit),
            unit,
            // before chains start there is nothing to balance: whole points, fireflies and all, would stay in the image
            layers: Layers { hot: None, ..layers },
            prepared: layers,
            probes: learns.then(|| Probes::new(&map, unit)),
            map,
            groups: PointGroups::new(plan.blocks),
        };
        let portion = |number: usize| Portion {
            uniform: Independent::new(rng, (number, plan.blocks), size),
            tally: Tally::new(1, layers.count),
            ladders: None,
            past: Vec::new(),
            added: [Sum::default(); 2],
            starts: Vec::new(),
        };
        let a_sweep = (plan.blocks * plan.lanes()) as u64;
        let only_uniform = choices.is_uniform_alone();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let open = outcomes && choices.opens(evaluations, pixels);
        let first = if open && choices.measure == Measure::Relative { OPEN_BOOTSTRAP } else { BOOTSTRAP };
        let length = if only_uniform { u64::MAX } else { at_most(first, evaluations, 1.0 / 32.0).div_ceil(a_sweep) };
        let schedule = Schedule { length, points: plan.lanes(), frozen: only_uniform, ..Schedule::default() };
        Sampler {
            rng,
            screen,
            portions: (0..plan.blocks).map(portion).collect(),
            plan,
            choices,
            importance: None,
            state: State::new(schedule, open),
            longest: 0,
            planned: evaluations,
            wanted: evaluations,
            reports: Vec::new(),
            share: None,
        }
    }

    /// Changes the evaluations to go through; the run stays what it was planned as.
    pub fn set_wanted(&mut self, evaluations: Option<u64>) {
        self.wanted = evaluations;
    }

    /// Evaluations so far.
    pub fn evaluations(&self) -> u64 {
        self.state.evaluations
    }

    /// Sweeps that are left of the budget, as long as sweeps are now; none without a budget.
    pub fn sweeps_left(&self) -> Option<u64> {
        self.wanted.map(|wanted| wanted.saturating_sub(self.state.evaluations).div_ceil(self.a_sweep()))
    }

    /// Evaluations of a sweep.
    fn a_sweep(&self) -> u64 {
        let ladders: usize = self.portions.iter().flat_map(|portion| &portion.ladders).map(Block::lanes).sum();
        ladders as u64 * self.state.schedule.ladder_sweeps + (self.portions.len() * self.state.schedule.points) as u64
    }

    /// What is still being learnt.
    pub fn learning(&self) -> Learning {
        match self.state.schedule {
            Schedule { frozen: true, .. } => Learning::Over,
            Schedule { round: 0, .. } => Learning::Bootstrap,
            _ => Learning::Rounds,
        }
    }

    /// Goes through `sweeps` more sweeps, or what is left of the budget, in parallel over blocks; through fewer where
    /// the first end of a sweep with `until` evaluations done, or a change of what is [learnt](Sampler::learning), comes
    /// before. Returns how many they were. All state is a function of the job and the evaluations done, never of the threads or of how sweeps were
    /// sliced.
    ///
    /// # Panics
    /// If the target contributes elsewhere than where its points lie and the set-up did not say so, or needs open points and there are
    /// none.
    pub fn advance<T: Target<Workspace = W>>(&mut self, target: &T, sweeps: u64, until: Option<u64>) -> u64 {
        assert!(self.screen.elsewhere || !target.splats_elsewhere(), "no layers for what points contribute elsewhere");
        assert!(self.state.round.open || !target.needs_open_points(), "what only open points find would be missing");
        let learning = self.learning();
        let until = until.unwrap_or(u64::MAX);
        self.take_up_own();
        let mut gone = 0;
        while gone < sweeps && self.state.evaluations < until && self.sweeps_left() != Some(0) {
            if self.state.schedule.done == self.state.schedule.length {
                self.end_round(target);
                if self.learning() != learning {
                    break;
                }
            }
            let stop = if self.state.schedule.done < self.state.schedule.middle() {
                self.state.schedule.middle()
            } else {
                self.state.schedule.length
            };
            let now = (sweeps - gone)
                .min(stop - self.state.schedule.done)
                .min(self.sweeps_left().unwrap_or(u64::MAX))
                .min((until - self.state.evaluations).div_ceil(self.a_sweep()));
            self.work(target, now);
            gone += now;
        }
        gone
    }

    /// Sweeps within a round.
    fn work<T: Target<Workspace = W>>(&mut self, target: &T, sweeps: u64) {
        let own = self.own();
        let (round, schedule, screen) = (&self.state.round, self.state.schedule, &self.screen);
        let keeps = schedule.round == 0 && !schedule.frozen;
        let purpose = match round.open {
            true if keeps && !(self.weighs() && self.importance.is_none()) => Use::Starts,
            true => Use::OpenImage,
            false => Use::Image,
        };
        let half = usize::from(schedule.done >= schedule.middle());
        let (group, alone) = (self.partners(), Group::alone());
        // what chains start from is put in its order by one rank of those that share a block
        let of_points = match (keeps, group.is_first()) {
            (true, first) => first.then_some(&alone),
            (false, _) => Some(&group),
        };
        let work = |portions: &mut [Portion<W>]| {
            let canvas = screen.canvas();
            let (mut ladders, mut others) = (Vec::new(), Vec::new());
            for Portion { uniform, tally, ladders: block, starts, .. } in portions.iter_mut() {
                ladders.extend(block);
                others.push((uniform, tally, starts));
            }
            let mut crew = (!ladders.is_empty()).then(|| Crew::new(ladders));
            for _ in 0..sweeps {
                if let Some(crew) = &mut crew {
                    crew.advance(target, schedule.ladder_sweeps, &canvas, round);
                }
                for (uniform, tally, starts) in &mut others {
                    let keep = |start: Start| {
                        if keeps && start.ln_g > f64::NEG_INFINITY {
                            starts.push(start);
                        }
                    };
                    uniform.sweep(target, (schedule.points, purpose, of_points), &canvas, round, tally, keep);
                }
            }
            drop(crew);
            for Portion { uniform, tally, ladders, .. } in portions {
                uniform.settle(&canvas, tally);
                tally.deposit(&canvas, half, None);
                if let Some(block) = ladders {
                    block.deposit(&canvas);
                }
            }
        };
        let together = portions_together(&self.portions[own.clone()]);
        match &mut self.portions[own.clone()] {
            // on this very thread, which then may wait for others that share it
            [portion] => work(std::slice::from_mut(portion)),
            portions => crews(portions, together).into_iter().par_bridge().for_each(work),
        }
        let drawn = sweeps * (self.portions.len() * self.state.schedule.points) as u64;
        let drawn_here = if group.is_first() { sweeps * (own.len() * self.state.schedule.points) as u64 } else { 0 };
        let mut uniform_rays = 0;
        for portion in &mut self.portions[own] {
            let (uniform, faults) = portion.uniform.take_rays_and_faults();
            uniform_rays += uniform;
            let (ladders, more) = portion.ladders.as_mut().map(Block::take_rays_and_faults).unwrap_or_default();
            self.state.rays += uniform + ladders;
            [faults, more].iter().for_each(|faults| self.state.faults.merge(faults));
            self.state.ladder_rays += ladders;
        }
        if keeps {
            let first = &mut self.state.first_rays[usize::from(purpose == Use::OpenImage)];
            *first = [first[0] + drawn_here, first[1] + uniform_rays];
        }
        if purpose != Use::Starts {
            self.state.points[0] += drawn;
        }
        if !self.state.round.open {
            self.state.points[1] += sweeps * schedule.ladder_sweeps * self.ladders() * self.state.offers as u64;
        }
        self.state.sweeps += sweeps;
        let evaluations = sweeps * self.a_sweep();
        self.state.evaluations += evaluations;
        if self.screen.layers.hot.is_some() {
            self.state.effort += evaluations as f64;
        }
        self.state.schedule.done += sweeps;
        self.state.states_a_rung += sweeps * schedule.ladder_sweeps * self.ladders();
    }

    /// Ladders at work.
    fn ladders(&self) -> u64 {
        self.portions.iter().filter(|p| p.ladders.is_some()).count() as u64 * self.state.ladders_a_block as u64
    }

    /// Evaluations in all, where they are limited: whole sweeps, so a little more than was asked for.
    pub fn evaluations_wanted(&self) -> Option<u64> {
        self.sweeps_left().map(|sweeps| self.state.evaluations + sweeps * self.a_sweep())
    }

    /// Rays traced so far.
    pub fn rays(&self) -> u64 {
        self.state.rays
    }

    /// Contributions so far that could not be used and were taken as zero.
    pub fn faults(&self) -> &Faults {
        &self.state.faults
    }

    /// The film.
    pub fn film(&self) -> &Accumulator {
        &self.screen.film
    }

    /// The ladder at work; of one rung as long as there is none.
    pub fn ladder(&self) -> &Ladder {
        &self.state.round.ladder
    }

    /// Mean acceptance of mutations by tempered rung and of swaps by pair, in this round; empty where not all of them are
    /// known, as at its start and once chains are given up.
    pub fn acceptances(&self) -> (Vec<f64>, Vec<f64>) {
        let counts = self.counts_by_rung();
        let steps = counts[1..].iter().map(|counts| {
            let mut all = StepCount::default();
            counts.steps.iter().for_each(|count| all += *count);
            all.acceptance()
        });
        let swaps = counts[1..].iter().map(|counts| counts.swaps.acceptance());
        let known = |rates: Vec<f64>| if rates.iter().any(|rate| rate.is_nan()) { Vec::new() } else { rates };
        (known(steps.collect()), known(swaps.collect()))
    }

    /// What became of changes of technique, in this round.
    pub fn technique_changes(&self) -> TechniqueChanges {
        let mut all = TechniqueChanges::default();
        self.counts_by_rung().iter().for_each(|counts| all.merge(&counts.changes));
        all
    }

    /// Whether chains follow the luminance weighed by an importance: only the balanced image allows for that.
    fn weighs(&self) -> bool {
        self.choices.combine == Combine::Balance && self.choices.measure == Measure::Relative
    }

    /// Reports of the rounds that ended since this was last asked for.
    pub fn take_reports(&mut self) -> Vec<RoundReport> {
        std::mem::take(&mut self.reports)
    }
}

impl Schedule {
    /// Sweep of the round at which its second half begins.
    fn middle(&self) -> u64 {
        self.length / 2
    }
}

impl Screen {
    fn canvas(&self) -> Canvas<'_> {
        Canvas {
            footprint: &self.footprint,
            size: self.size,
            film: &self.film,
            unit: self.unit,
            layers: self.layers,
            probes: self.probes.as_ref().map(|probes| (&self.map, probes)),
            groups: &self.groups,
        }
    }
}

/// Rungs that ladders may come to have.
fn most_rungs(choices: &Choices) -> usize {
    match &choices.ladder {
        LadderChoice::Auto => MOST_AUTOMATIC,
        LadderChoice::Replicas(k) => *k as usize,
        LadderChoice::Betas(betas) => betas.len(),
    }
}

/// `length`, or that part of the run where it is less.
fn at_most(length: u64, wanted: Option<u64>, part: f64) -> u64 {
    wanted.map_or(length, |wanted| length.min((wanted as f64 * part) as u64)).max(1)
}
