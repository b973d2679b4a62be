//! Ends of rounds: what was learnt, and what follows from it.

use std::sync::Arc;

use rayon::prelude::*;

use super::{Learnt, Luminance, MOST_AUTOMATIC, Sampler, at_most};
use crate::{
    chain::{Importance, Start, Target, resample},
    path::luminance_of_sums,
    tempering::{
        Block, Estimate, Histogram, Ladder, LadderChoice, Probes, RungCounts, StepMix, Sum, Weights,
        placement::rungs,
        probes::{RATIOS, TRIALS},
        steps,
        tuning::{Choice, Measured, Variances},
    },
};

/// The part of a run of known length within which everything is learnt; what comes after is frozen.
const LEARNING_PART: f64 = 0.25;
/// Length of the rounds in which settings are learnt, from the first to the last: 2¹⁸ to 2²² evaluations, or 4 to 64 a
/// pixel where that is more.
const FIRST_ROUND: u64 = 1 << 18;
const FIRST_ROUND_A_PIXEL: u64 = 4;
const LEARNING_ROUNDS: u32 = 5;
/// Rounds from which on chains may be given up.
const ROUNDS_OF_GRACE: u32 = 3;
/// The same where uniform points leave chains little to gain from the first. (`relt render scenes/cornell-box/scene.xml --time
/// 5s --threads 2` against `--method path --mapping unidirectional`, medians of seeds 1 to 5: 1.22 times the relMSE with three
/// rounds and no [`SURPRISE`] asked for at their end, 1.14 times as it is.)
const ROUNDS_OF_LITTLE_PROMISE: u32 = 2;
/// Lanes that are evaluated together; a ladder longer than that is cut into parts.
pub(super) const LANES_A_PART: usize = 512;
/// Rungs are placed anew where the rejections that the density of states predicts differ by more.
const UNEQUAL_REJECTION: f64 = 0.05;
/// Uniform points that a chain should take over a sweep, if offers are to be had: it then forgets its past as fast as
/// it can make use of.
const OFFERS_TAKEN: f64 = 0.5;
/// What an evaluation costs beside its rays, in rays: random numbers, shading, recording (benches/mutations.rs: half of
/// the time of paths with some eight rays is spent outside Embree).
const COST_BESIDE_RAYS: f64 = 6.0;
/// The trial of steps as they are; the ones beside it take shorter and longer ones.
const UNSHIFTED: usize = TRIALS / 2;
/// Noise, by that of steps as they are, from which on others are taken.
const CLEARLY_LESS: f64 = 0.95;

/// Scales by which a trial's steps are shifted.
fn shift(trial: usize) -> f64 {
    0.75 * (trial as f64 - UNSHIFTED as f64)
}

/// Independent points that a block should draw at a time.
const BATCH: f64 = 256.0;
/// The same of open points, each of which is many connections.
const OPEN_BATCH: f64 = 16.0;
/// Sweeps of ladders in which they are drawn, at most: a run ends and is looked at between those.
const MOST_LADDER_SWEEPS: f64 = 256.0;
/// What a state counts for in the first round, before that is measured.
const FIRST_RATIO: f64 = 0.25;
/// Share of uniform points, at least, and at most where chains are asked for.
const LEAST_UNIFORM: f64 = 0.1;
const MOST_UNIFORM_WITH_CHAINS: f64 = 15.0 / 16.0;
/// States of chains have at least the noise of a number of samples that chance decides: a relative variance of 1 a state in
/// the pixel. Where that of a uniform point is not more than this, chains are to be given up, unless they find what those
/// points do not know of: they get a small part of the work from the start. (The bootstrap of 100 mutations per pixel finds
/// 0.55 on `cornell-box` and 350 on `lattice` by camera paths, 7.4 on the latter by `--mapping light`. `relt render
/// scenes/cornell-box/scene.xml --mpp 100 --mapping unidirectional`, seeds 1 and 2: relMSE 0.00151 without this and 0.0014
/// with it, by `--method path` 0.00137.)
const LEAST_NOISE: f64 = 1.0;
/// Error, by that of path tracing, from which down chains that had not promised anything get a say after all. (The first
/// round of the run above told 0.62, where there was nothing to gain.)
const SURPRISE: f64 = 0.25;

impl<W: Default + Send> Sampler<W> {
    /// Ends the round at work and begins the next.
    pub(super) fn end_round<T: Target<Workspace = W>>(&mut self, target: &T) {
        self.flush();
        self.exchange();
        self.conclude_round(target);
        self.keep_own();
        self.forget_what_is_told();
    }

    /// What follows from the round at work, with all that was seen in it at hand.
    fn conclude_round<T: Target<Workspace = W>>(&mut self, target: &T) {
        let learnt = self.learn();
        let measured = self.measured(&learnt);
        self.state.image_correlation = measured.as_ref().and_then(Measured::correlation);
        let mut report = self.report(&learnt);
        let choices = match (self.state.schedule.round, learnt.normalisers.target.ln_value.is_finite()) {
            // nothing lit yet: nothing to start chains from, nothing else to do but to go on
            (0, false) => {
                self.state.schedule.length *= 2;
                return;
            }
            (0, true) if self.weighs() && self.importance.is_none() => {
                self.weigh();
                return;
            }
            (0, true) => self.raise_ladders(target, &learnt),
            _ if self.state.schedule.frozen => Vec::new(),
            _ => self.adapt(&learnt, measured.as_ref()),
        };
        report.choices = choices;
        report.image_share_before =
            self.state.schedule.frozen.then(|| self.state.schedule.learning as f64 / self.state.evaluations as f64);
        self.reports.push(report);
        self.begin_round(&learnt);
    }

    /// Fixes where chains are wanted. What was seen of g until now goes to the image only.
    fn weigh(&mut self) {
        let importance = Arc::new(self.found_by_first(Self::importance_found));
        for portion in &mut self.portions {
            portion.uniform.set_importance(&importance);
            portion.starts.clear();
        }
        self.importance = Some(importance);
        self.screen.groups.forget_histograms();
        let a_sweep = self.a_sweep();
        self.state.schedule.length =
            self.state.schedule.done + at_most(super::BOOTSTRAP, self.planned, 1.0 / 32.0).div_ceil(a_sweep);
    }

    /// Where chains are wanted, by what stratified points have shown on the film.
    fn importance_found(&self) -> Importance {
        let layer = self.screen.layers.even.expect("a layer of stratified points");
        let mut sums = self.screen.film.layer(layer.own);
        if let Some(elsewhere) = layer.elsewhere {
            let more = self.screen.film.layer(elsewhere);
            sums.iter_mut().flatten().zip(more.as_flattened()).for_each(|(sum, more)| *sum += more);
        }
        // sums may be beyond f32 where their terms are not
        let luminance = |[r, g, b, points]: [f64; 4]| [luminance_of_sums([r, g, b]), points];
        let found: Vec<[f64; 2]> = sums.into_iter().map(luminance).collect();
        Importance::new(self.screen.size, &found)
    }

    /// Records what states have gathered; the round's settings still hold.
    fn flush(&mut self) {
        let own = self.own();
        let (screen, round) = (&self.screen, &self.state.round);
        self.portions[own].par_iter_mut().for_each(|portion| {
            if let Some(block) = &mut portion.ladders {
                block.flush(&screen.canvas(), round);
                block.deposit(&screen.canvas());
            }
        });
    }

    /// What all that is recorded says.
    fn learn(&self) -> Learnt {
        let groups: Vec<Vec<Histogram>> = (0..self.portions.len()).map(|number| self.group(number)).collect();
        self.learnt(&groups, &[])
    }

    /// What groups of histograms say; `pending` is what each block's states would add to the balanced image.
    pub(super) fn learnt(&self, groups: &[Vec<Histogram>], pending: &[Sum]) -> Learnt {
        let estimate = |sums: &[(f64, f64)]| {
            let sums: Vec<(f64, f64)> = sums.iter().map(|(s, n)| (s * self.screen.unit, *n)).collect();
            Estimate::from_sums(&sums)
        };
        let [mut hot, mut tempered, mut even] = [(); 3].map(|()| Vec::new());
        for (number, portion) in self.portions.iter().enumerate() {
            let [mut points, mut states] = portion.ladders.as_ref().map_or(portion.added, Block::added);
            let [more, all] = self.screen.groups.hot_and_even(number);
            points.merge(more);
            pending.get(number).into_iter().for_each(|sum| states.merge(*sum));
            hot.push(points.values());
            // each block's states stand for as much of the image as any other's
            tempered.push((states.values().0, self.state.effort / self.portions.len() as f64));
            even.push(all.values());
        }
        let layers = &self.screen.layers;
        let luminance = match (layers.hot, layers.even) {
            (Some(_), _) => {
                Luminance::Balanced { hot: estimate(&hot), tempered: estimate(&tempered), ln_unit: self.state.ln_unit }
            }
            (None, Some(_)) => Luminance::Mean(estimate(&even)),
            (None, None) => Luminance::Normaliser,
        };
        Learnt::of(&self.state.round.ladder, groups, luminance)
    }

    /// Histograms by rung of group `number`: what block `number` of the ladders saw, and stratified points.
    pub(super) fn group(&self, number: usize) -> Vec<Histogram> {
        let portion = &self.portions[number];
        let mut group = vec![Histogram::default(); self.state.round.ladder.rungs()];
        self.screen.groups.add_to(number, &mut group[0]);
        group.iter_mut().zip(&portion.past).for_each(|(sum, past)| sum.merge(past));
        if let Some(block) = &portion.ladders {
            block.add_histograms(&mut group);
        }
        group
    }

    /// The first ladders: their rungs follow from how g is spread, their states from the points seen so far.
    fn raise_ladders<T: Target<Workspace = W>>(&mut self, target: &T, learnt: &Learnt) -> Vec<String> {
        let density = &learnt.density;
        let barrier = density.barrier();
        self.state.round.ladder = match &self.choices.ladder {
            LadderChoice::Auto => density.place(rungs(barrier).min(MOST_AUTOMATIC)),
            LadderChoice::Replicas(k) => density.place(*k as usize),
            LadderChoice::Betas(betas) => Ladder::new(betas.clone()),
        };
        let ladder = &self.state.round.ladder;
        let chains = ladder.chains();
        self.state.ln_unit = learnt.normalisers.target.ln_value;
        self.state.offers = 1;
        let remaining = self.planned.map(|wanted| wanted.saturating_sub(self.state.evaluations));
        let ladders = self.plan.groups_a_block(remaining, 2 * chains);
        let samples: Vec<Start> =
            self.portions.iter_mut().flat_map(|portion| std::mem::take(&mut portion.starts)).collect();
        let all = ladders * self.portions.len();
        let starts: Vec<Vec<Start>> = ladder.betas()[1..]
            .par_iter()
            .enumerate()
            .map(|(rung, &beta)| resample(&samples, beta, all, self.rng, rung as u32))
            .collect();
        let (rng, layers, offers, size) = (self.rng, self.screen.layers.count, self.state.offers, self.screen.size);
        let importance = self.importance.as_ref();
        let (own, group) = (self.own(), self.partners());
        self.portions.par_iter_mut().enumerate().for_each(|(i, portion)| {
            let first = i * ladders;
            let starts: Vec<&[Start]> = starts.iter().map(|rung| &rung[first..first + ladders]).collect();
            let mut block = Block::new(rng, (i, ladders), chains + 1, offers, LANES_A_PART, layers, size);
            block.set_importance(importance);
            // what others work on they start themselves
            if own.contains(&i) {
                block.share(&group);
                block.start(target, &starts);
            }
            portion.ladders = Some(block);
        });
        self.state.ladders_a_block = ladders;
        self.screen.layers = self.screen.prepared;
        self.state.bootstrap = self.state.points[0];
        let noise = self.measured(learnt).and_then(|measured| measured.noise_of_points());
        // no noise at all tells nothing: perhaps no probe has seen light yet
        let quiet = noise.is_some_and(|noise| noise > 0.0 && noise <= LEAST_NOISE);
        self.state.promising = self.choices.ladder != LadderChoice::Auto || !quiet;
        let share = if self.state.promising { 0.5 } else { MOST_UNIFORM_WITH_CHAINS };
        let share = self.choices.uniform_share.unwrap_or_else(|| self.share_of_evaluations(share));
        self.state.choice = Choice { ratio: FIRST_RATIO, share, relative_error: f64::NAN };
        let how = match self.choices.ladder {
            LadderChoice::Auto => format!("{} replicas, as the barrier is {barrier:.2}", chains + 1),
            LadderChoice::Replicas(_) => format!("{} replicas placed at equal rejection", chains + 1),
            LadderChoice::Betas(_) => "inverse temperatures as given".into(),
        };
        vec![how]
    }

    /// Settles rungs, steps, weights and shares for the next round.
    fn adapt(&mut self, learnt: &Learnt, measured: Option<&Measured>) -> Vec<String> {
        let mut said = Vec::new();
        let last = self.is_last_lesson();
        let choice = measured.map(|measured| self.tune(measured, last));
        let counts = self.counts_by_rung();
        said.extend(measured.and_then(|measured| self.choose_steps(measured)));
        let goes_on = !last && choice.is_none_or(|choice| choice.ratio > 0.0);
        if goes_on && !matches!(self.choices.ladder, LadderChoice::Betas(_)) {
            said.extend(self.place_anew(learnt));
        }
        if let Some(choice) = choice {
            self.state.choice = choice;
            said.push(match choice.ratio {
                0.0 => "path tracing: no share of chains makes the error less".into(),
                ratio => format!(
                    "{:.0} % uniform points, a state counts for {ratio} of one: {:.2} times the error of path tracing",
                    100.0 * choice.share,
                    choice.relative_error
                ),
            });
        }
        if self.state.choice.ratio == 0.0 {
            self.give_up_ladders();
        } else {
            if last {
                self.screen.layers.even = None; // never looked at again
            }
            let accepted = counts[1].swaps.acceptance();
            let most = self.uniform_a_ladder(self.state.round.ladder.chains()).floor().max(1.0);
            self.state.offers = (OFFERS_TAKEN / accepted.max(1e-9)).ceil().min(most) as usize;
            let offers = self.state.offers;
            self.portions.iter_mut().flat_map(|p| &mut p.ladders).for_each(|block| block.set_offers(offers));
        }
        if last || self.state.choice.ratio == 0.0 {
            self.state.schedule.frozen = true;
            self.state.schedule.learning = self.state.evaluations;
            self.screen.probes = None;
        }
        said
    }

    /// Shifts the sizes of steps where the trials show that this pays.
    fn choose_steps(&mut self, measured: &Measured) -> Option<String> {
        let probes = self.screen.probes.as_ref()?;
        let blocks =
            |trial| self.portions.iter().flat_map(|p| &p.ladders).filter(|block| block.trial() == trial).count();
        // a sum of n blocks has √n times the noise of one
        let noise: [f64; TRIALS] =
            std::array::from_fn(|trial| measured.noise(&probes.trial(trial)) / (blocks(trial) as f64).sqrt());
        let best = (0..TRIALS).min_by(|a, b| noise[*a].total_cmp(&noise[*b]))?;
        if noise[best] > CLEARLY_LESS * noise[UNSHIFTED] {
            return None;
        }
        self.state.centre = (self.state.centre + shift(best)).clamp(0.0, (steps::SCALES - 1) as f64);
        Some(format!(
            "{} steps, of about 2^{:.0}: {:.2} times the noise",
            if best < UNSHIFTED { "shorter" } else { "longer" },
            2.0 * self.state.centre - 12.0,
            noise[best] / noise[UNSHIFTED]
        ))
    }

    /// The mixes of step sizes for the trials of the next round; all the same once settings are frozen.
    fn mixes(&self, counts: &[RungCounts]) -> [Vec<StepMix>; TRIALS] {
        let target = &counts[counts.len() - 1].steps;
        std::array::from_fn(|trial| {
            let centre = self.state.centre + if self.state.schedule.frozen { 0.0 } else { shift(trial) };
            let of_rung = |counts: &RungCounts| {
                StepMix::about(StepMix::centre_of_equal_acceptance(centre, target, &counts.steps))
            };
            counts.iter().map(of_rung).collect()
        })
    }

    /// Rays of a point that chose and of an open one, as the first sweeps had them.
    fn rays_a_point(&self) -> [f64; 2] {
        self.state.first_rays.map(|[points, rays]| rays as f64 / (points as f64).max(1.0))
    }

    /// The share of evaluations that are uniform points, where these have that share of the cost, as far as it is known. Where
    /// points that choose are alike on all rungs, shares of cost are taken for those of evaluations.
    fn share_of_evaluations(&self, of_cost: f64) -> f64 {
        if !self.state.round.open {
            return of_cost;
        }
        let [chosen, open] = self.rays_a_point().map(|rays| rays + COST_BESIDE_RAYS);
        let chain = chosen * (1.0 + self.state.offers as f64 / self.state.round.ladder.chains() as f64);
        let (points, states) = (of_cost / open, (1.0 - of_cost) / chain);
        points / (points + states)
    }

    /// Stratified points of which both halves of a round have one in every pixel.
    fn two_passes(&self) -> f64 {
        let [width, height] = self.screen.size;
        2.0 * f64::from(width) * f64::from(height)
    }

    /// Uniform points a sweep for each ladder of `chains` chains, by the share that is chosen.
    fn uniform_a_ladder(&self, chains: usize) -> f64 {
        chains as f64 * self.state.choice.share / (1.0 - self.state.choice.share)
    }

    /// Whether what is learnt now is the last.
    fn is_last_lesson(&self) -> bool {
        let next = self.state.evaluations as f64 + 2.0 * (self.state.schedule.length * self.a_sweep()) as f64;
        self.state.schedule.round >= LEARNING_ROUNDS
            || self.planned.is_some_and(|wanted| next > LEARNING_PART * wanted as f64)
    }

    /// The weights and the share that serve best, where they are free.
    fn tune(&mut self, measured: &Measured, last: bool) -> Choice {
        // longer rounds see more of how states hang together
        self.state.variances.push((self.state.schedule.evaluations as f64, measured.variances()));
        let variances = Variances::pooled(&self.state.variances);
        let grace = if self.state.promising { ROUNDS_OF_GRACE } else { ROUNDS_OF_LITTLE_PROMISE };
        // while chains are to show what they can do they keep a part of the work, less in each round
        let most = match (self.choices.ladder == LadderChoice::Auto, last) {
            // chains that promise nothing after some rounds are not listened to any longer
            (true, last) if last || self.state.schedule.round >= grace => 1.0,
            (false, true) => MOST_UNIFORM_WITH_CHAINS,
            _ if !self.state.promising => MOST_UNIFORM_WITH_CHAINS,
            _ => 1.0 - 0.5f64.powi(self.state.schedule.round as i32 + 1),
        };
        let [least, most] = [LEAST_UNIFORM, most].map(|share| self.share_of_evaluations(share));
        // what the next round is to learn takes a point in every pixel and half
        let seen = match self.state.round.open && !last {
            true => self.two_passes() / (2 * self.state.schedule.evaluations) as f64,
            false => 0.0,
        };
        let least = least.max(seen).min(most);
        let shares = self.choices.uniform_share.map_or(least..=most, |share| share..=share);
        let unmeasured = self.share_of_evaluations(0.5);
        let choice = variances.choose(measured.cost, &shares, unmeasured);
        let surprise = choice.relative_error < SURPRISE;
        if self.state.promising || surprise || self.choices.uniform_share.is_some() {
            return choice;
        }
        // what little promise came to is measured with noise, and half the error may be chance: chains are only watched
        match most < 1.0 {
            true => variances.choose(measured.cost, &(most..=most), unmeasured),
            false => Choice { ratio: 0.0, share: 1.0, relative_error: 1.0 },
        }
    }

    /// What the round has measured, if it has.
    fn measured(&self, learnt: &Learnt) -> Option<Measured> {
        let probes = self.screen.probes.as_ref()?;
        let states = self.ladder_steps(self.state.schedule.done) as f64;
        let chains = self.state.round.ladder.chains() as f64;
        let pixels = f64::from(self.screen.size[0]) * f64::from(self.screen.size[1]);
        let target = learnt.normalisers.target;
        let (by_halves, squares) = (0..RATIOS.len()).map(|ratio| probes.sums(ratio)).unzip();
        Some(Measured {
            probes: by_halves,
            squares,
            pixels,
            states: chains * states,
            tempered_scale: match states {
                0.0 => 0.0,
                states => pixels * libm::exp(target.ln_value - self.state.ln_unit) / (0.5 * states),
            },
            normaliser_variance: target.relative_error.powi(2),
            measure: self.choices.measure,
            mean: learnt.luminance.value,
            cost: self.costs(chains * states),
        })
    }

    /// Cost of a uniform point and of a step of a chain, in rays.
    fn costs(&self, states: f64) -> [f64; 2] {
        let offered = self.ladder_steps(self.state.schedule.done) as f64 * self.state.offers as f64;
        let [chosen, open] = self.rays_a_point();
        if self.state.round.open {
            // offered points add nothing to the image: chains bear their cost
            let a_state = (self.state.ladder_rays as f64 + offered * COST_BESIDE_RAYS) / states.max(1.0);
            return [open + COST_BESIDE_RAYS, a_state + COST_BESIDE_RAYS];
        }
        let a_state = (self.state.ladder_rays as f64 - offered * chosen).max(0.0) / states.max(1.0);
        [chosen + COST_BESIDE_RAYS, a_state + COST_BESIDE_RAYS]
    }

    /// Places rungs at equal rejection, unless they are near enough.
    fn place_anew(&mut self, learnt: &Learnt) -> Option<String> {
        let ladder = &self.state.round.ladder;
        let rejections = |ladder: &Ladder| -> Vec<f64> {
            ladder.betas().windows(2).map(|pair| learnt.density.rejection(pair[0], pair[1])).collect()
        };
        let now = rejections(ladder);
        let [least, most] = [f64::min, f64::max].map(|f| now.iter().copied().reduce(f).unwrap_or(0.0));
        if most - least <= UNEQUAL_REJECTION {
            return None;
        }
        let placed = learnt.density.place(ladder.rungs());
        if placed == *ladder {
            return None;
        }
        self.state.round.ladder = placed;
        self.state.moved = true;
        Some(format!("rungs placed anew: neighbours rejected {least:.2} to {most:.2} of their swaps"))
    }

    /// Chains stop; what they found stays in the image and in the normalisers.
    fn give_up_ladders(&mut self) {
        // a stratified point is worth more than an offered one, and there are many more of them to come
        if self.choices.ladder == LadderChoice::Auto {
            self.screen.layers.hot = None;
        }
        for portion in &mut self.portions {
            if let Some(block) = portion.ladders.take() {
                let mut past = vec![Histogram::default(); self.state.round.ladder.rungs()];
                block.add_histograms(&mut past);
                portion.past = past;
                portion.added = block.added();
            }
        }
    }

    /// Fixes what holds in the next round.
    fn begin_round(&mut self, learnt: &Learnt) {
        let ladders = self.ladders() as usize;
        let density = &learnt.density;
        if ladders > 0 {
            let ln_zeta: Vec<f64> = self
                .state
                .round
                .ladder
                .betas()
                .iter()
                .map(|b| if *b == 0.0 { 0.0 } else { density.ln_z(*b) })
                .collect();
            let open = self.state.round.open;
            let offered = if open { 0.0 } else { self.state.offers as f64 };
            let a_sweep = self.uniform_a_ladder(self.state.round.ladder.chains()) - offered;
            let points = a_sweep.max(0.0) * self.state.ladders_a_block as f64;
            let ladder_sweeps = match open {
                true => (OPEN_BATCH / points).ceil().clamp(1.0, MOST_LADDER_SWEEPS),
                false if points < 1.0 => 1.0,
                false => (BATCH / points).ceil().max(1.0),
            };
            // without open points their part of the image would be missing: nothing stands in for them
            let fewest = if open { 1.0 } else { 0.0 };
            self.state.schedule.ladder_sweeps = ladder_sweeps as u64;
            self.state.schedule.points = (points * ladder_sweeps).round().max(fewest) as usize;
            self.state.round.weights =
                Weights::new(&self.state.round.ladder, &ln_zeta, self.state.choice.ratio, self.state.ln_unit);
            self.state.round.mixes = self.mixes(&self.counts_by_rung());
        } else {
            self.state.schedule.points = self.plan.lanes();
            self.state.round.weights = Weights::uniform_alone();
        }
        let a_sweep = self.a_sweep() as f64;
        let points = (self.portions.len() * self.points_a_block()) as f64;
        self.state.round.effort =
            [a_sweep / points, if ladders > 0 { a_sweep / self.ladder_steps(1) as f64 } else { 0.0 }];
        for portion in &mut self.portions {
            portion.tally.reset_counts();
            if let Some(block) = &mut portion.ladders {
                block.reset_counts();
                if self.state.moved {
                    block.forget_tempered();
                }
            }
        }
        self.state.moved = false;
        if self.screen.probes.is_some() {
            self.screen.probes = Some(Probes::new(&self.screen.map, self.screen.unit));
        }
        self.state.ladder_rays = 0;
        self.state.schedule.round += 1;
        let evaluations = match (self.state.schedule.round, self.state.schedule.frozen) {
            (1, _) => {
                let pixels = u64::from(self.screen.size[0]) * u64::from(self.screen.size[1]);
                let first = FIRST_ROUND.max(FIRST_ROUND_A_PIXEL * pixels);
                // both halves need a stratified point in every pixel
                let passes = if self.state.round.open { (self.two_passes() / self.uniform_share()) as u64 } else { 0 };
                at_most(first, self.planned, LEARNING_PART / 4.0).max(at_most(passes, self.planned, LEARNING_PART))
            }
            (_, false) => 2 * self.state.schedule.evaluations,
            // as long as all that came before
            (_, true) => self.state.evaluations,
        };
        self.state.schedule.evaluations = evaluations;
        self.state.schedule.length = evaluations.div_ceil(self.a_sweep()).max(1);
        self.state.schedule.done = 0;
        let sweeps = self.portions[0].ladders.as_ref().map_or(0, Block::sweeps);
        self.state.round.only_offers = self.state.schedule.points == 0;
        self.state.round.half = sweeps + self.state.schedule.middle() * self.state.schedule.ladder_sweeps;
    }

    /// Uniform points of a block in a sweep, offered or not.
    pub(super) fn points_a_block(&self) -> usize {
        let ladders = if self.ladders() > 0 && !self.state.round.open { self.state.ladders_a_block } else { 0 };
        self.state.offers * ladders * self.state.schedule.ladder_sweeps as usize + self.state.schedule.points
    }

    /// States on each rung of all ladders in so many sweeps.
    pub(super) fn ladder_steps(&self, sweeps: u64) -> u64 {
        sweeps * self.state.schedule.ladder_sweeps * self.ladders()
    }

    /// Counts of the round, by rung.
    pub(super) fn counts_by_rung(&self) -> Vec<RungCounts> {
        let mut sums = vec![RungCounts::default(); self.state.round.ladder.rungs()];
        for portion in &self.portions {
            sums[0].add(&portion.tally.counts[0]);
            if let Some(block) = &portion.ladders {
                block.add_counts(&mut sums);
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        film::{Filter, Footprint},
        path::{Contribution, Contributions, FilmSplat},
        rng::{Rng as Random, unit_f32},
        sample::Proposals,
        scene::Rgb,
        tempering::{Choices, Setup},
    };

    /// Points light the place where they lie evenly, and the right half of the film from anywhere.
    struct LitFromElsewhere;

    impl Target for LitFromElsewhere {
        type Workspace = Vec<u32>;

        fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
            proposals.begin(live);
            proposals.draw(0, live);
            for &lane in &*live {
                let lane = lane as usize;
                let [x, y, u, v] = proposals.block(0, lane).map(unit_f32);
                out.elsewhere.clear(lane);
                out.elsewhere.push(lane, FilmSplat { film: [0.5 + 0.5 * u, v], rgb: Rgb::splat(3.0) });
                out.lanes[lane] = Contribution::settle_whole([x, y], Rgb::splat(1.0), &mut out.elsewhere, lane).0;
            }
        }

        fn splats_elsewhere(&self) -> bool {
            true
        }
    }

    /// Luminance 1 on the left and 1 + 6 on the right, of mean 4: W = 1/(1/4 + 1/2) and 1/(7/4 + 1/2). The bootstrap's
    /// 2¹² points give each of four tiles a mean to some 1.5 % (ten times that is let pass).
    #[test]
    fn importance_knows_of_light_from_elsewhere() {
        let mut sampler = Sampler::new(Setup {
            rng: Random::new(1),
            choices: Choices { ladder: LadderChoice::Replicas(2), ..Choices::default() },
            footprint: Footprint::new(Filter::Box, 2, 2),
            size: [2, 2],
            unit: 1.0,
            elsewhere: true,
            outcomes: false,
            evaluations: Some(1 << 17),
        });
        while sampler.importance.is_none() {
            sampler.advance(&LitFromElsewhere, 1, None);
        }
        let importance = sampler.importance.as_ref().unwrap();
        for (x, expected) in [(0.25, 0.75), (0.75, 2.25)] {
            for y in [0.25, 0.75] {
                let inverse = (-importance.ln_at([x, y])).exp();
                assert!((inverse / expected - 1.0).abs() < 0.15, "1/W at ({x}, {y}) is {inverse}, not {expected}");
            }
        }
    }
}
