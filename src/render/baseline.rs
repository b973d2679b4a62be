//! `mlt`: the paper's two-pass baseline. First the normalisation c from M independent samples, then chains that start
//! from states resampled among them in proportion to g; image = c/N Σ f/g. Settings let large steps help with c and
//! with the image.

use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    engine::{Counts, Development, Diagnostics, Engine, Phase, Sheet, Stage, film_warnings, mean},
    health::ChainReport,
    settings::{MltSettings, Normalisation},
};
use crate::{
    chain::{Baseline, Evaluator, LargeSteps, Plan, SavedBaseline, Start, Whereabouts, baseline_layer, resample},
    film::{Accumulator, Footprint, Plane, Splats},
    path::{Faults, Workspace},
    ranks::Company,
    rng::{Counter, Purpose, Rng},
    sample::{Move, Points},
    saved::{Source, Unfit, expect, write_value},
    tempering::{Estimate, Mixing},
};

/// Independent samples of the first pass; half of the budget where that is less.
const BOOTSTRAP: u64 = 100_000;
/// Samples evaluated together in the first pass, at most.
const BOOTSTRAP_BATCH: u64 = 1024;
/// Batches at least, where there are as many samples: the standard error of c is taken between them.
const BOOTSTRAP_BATCHES: u64 = 16;

/// The method at work.
pub struct Mlt {
    rng: Rng,
    sheet: Sheet,
    footprint: Footprint,
    plan: Plan,
    film: Accumulator,
    blocks: Vec<Block>,
    large_steps: LargeSteps,
    pools: bool,
    /// Σ g and number of samples of every batch of the first pass.
    bootstrap: Vec<(f64, f64)>,
    bootstrap_samples: u64,
    bootstrap_rays: u64,
    bootstrap_faults: Faults,
    /// c from the first pass alone, also the magnitude that states are kept in on the film.
    first_estimate: Estimate,
    /// The other ranks, where the work is shared.
    company: Option<Arc<Company>>,
}

struct Block {
    chains: Baseline<Workspace>,
    splats: Splats,
}

impl Mlt {
    /// Does the first pass and puts the chains into their first states.
    pub fn new(stage: &Stage, rng: Rng, settings: &MltSettings, mutations: Option<u64>) -> Mlt {
        let (bootstrap_samples, plan) = plan(mutations);
        let large_steps = large_steps(settings);
        let sheet = stage.sheet();
        let batches = first_pass(stage, rng, bootstrap_samples);
        let bootstrap: Vec<(f64, f64)> =
            batches.iter().map(|b| (b.ln_g.iter().map(|l| libm::exp(*l)).sum(), b.ln_g.len() as f64)).collect();
        let samples: Vec<Start> = batches.iter().flat_map(|b| &b.ln_g).enumerate().map(bootstrap_sample).collect();
        let mut bootstrap_faults = Faults::default();
        batches.iter().for_each(|batch| bootstrap_faults.merge(&batch.faults));
        // a black scene has no state to start from: no chains, a black image
        let starts = resample(&samples, 1.0, plan.blocks * plan.lanes(), rng, 0);
        let blocks = starts
            .par_chunks(plan.lanes())
            .enumerate()
            .map(|(i, starts)| Block {
                chains: Baseline::new(&stage.mapping, rng, (i * plan.lanes()) as u32, starts, large_steps),
                splats: Splats::new(large_steps.layers()),
            })
            .collect();
        Mlt {
            rng,
            sheet,
            footprint: sheet.footprint(),
            plan,
            film: sheet.accumulator(large_steps.layers()),
            blocks,
            large_steps,
            pools: settings.normalisation == Normalisation::Pooled,
            bootstrap_samples,
            bootstrap_rays: batches.iter().map(|b| b.rays).sum(),
            bootstrap_faults,
            first_estimate: Estimate::from_sums(&bootstrap),
            bootstrap,
            company: None,
        }
    }

    /// As it was saved, with the settings and the number of mutations that it was planned for.
    pub fn restored(
        sheet: &Sheet,
        rng: Rng,
        settings: &MltSettings,
        planned: Option<u64>,
        from: &mut Source,
    ) -> Result<Mlt, Unfit> {
        let (bootstrap_samples, plan) = plan(planned);
        let large_steps = large_steps(settings);
        expect(Accumulator::fewest_bytes(sheet.pixels(), large_steps.layers() as u64) <= from.left(), "film")?;
        let SavedMlt { bootstrap, bootstrap_rays, bootstrap_faults, blocks } = from.value()?;
        expect(blocks == 0 || blocks == plan.blocks, "chains")?;
        let block = |i: usize| Block::restored(rng, &plan, i, from.value()?, large_steps);
        let blocks = (0..blocks).map(block).collect::<Result<Vec<_>, Unfit>>()?;
        let mut film = sheet.accumulator(large_steps.layers());
        film.restore(from)?;
        Ok(Mlt {
            rng,
            sheet: *sheet,
            footprint: sheet.footprint(),
            plan,
            film,
            blocks,
            large_steps,
            pools: settings.normalisation == Normalisation::Pooled,
            bootstrap_samples,
            bootstrap_rays,
            bootstrap_faults,
            first_estimate: Estimate::from_sums(&bootstrap),
            bootstrap,
            company: None,
        })
    }

    /// The blocks that are worked on here: all, unless the work is shared. A block is one rank's only.
    fn own(&self) -> Range<usize> {
        let blocks = self.blocks.len();
        let Some(company) = self.company.as_ref().filter(|_| blocks > 0) else { return 0..blocks };
        let own = company.own(blocks);
        match company.ranks_at(own.start, blocks).start == company.number() {
            true => own,
            false => own.start..own.start,
        }
    }

    /// The magnitude that states are kept in on the film: c as it is known before any step.
    fn unit(&self) -> f64 {
        self.first_estimate.value
    }

    /// How well chains move and agree; `None` where there are none.
    fn report(&self) -> Option<ChainReport> {
        let first = &self.blocks.first()?.chains;
        let chains = || self.blocks.iter().map(|block| &block.chains);
        let small = chains().fold((0.0, 0), |sum, chains| (sum.0 + chains.small.0, sum.1 + chains.small.1));
        let halves = chains().flat_map(|chains| chains.halves).filter(|half| half.states > 0.0);
        let means: Vec<[f64; 1]> = halves.clone().map(|half| [half.sum / half.states]).collect();
        let whereabouts: Vec<Whereabouts> = chains().flat_map(|chains| chains.whereabouts).collect();
        let all = halves.reduce(|a, b| a.merged(b)).unwrap_or_default();
        Some(ChainReport {
            steps: first.steps(),
            acceptance: small.0 / small.1 as f64,
            longest_rejection_run: chains().map(|chains| u64::from(chains.longest_rejection)).max().unwrap_or(0),
            mixing: Mixing::of(&means, all.variance(), &whereabouts),
        })
    }

    /// c from all samples that the settings admit.
    ///
    /// Pooled, a block's large steps and its share of the first pass's batches are one group: so groups are about
    /// equal, as the standard error between them supposes.
    fn normalisation(&self) -> Estimate {
        if !self.pools || self.blocks.is_empty() {
            return self.first_estimate;
        }
        let mut groups: Vec<(f64, f64)> =
            self.blocks.iter().map(|block| (block.chains.large_sum, block.chains.large.1 as f64)).collect();
        for (i, batch) in self.bootstrap.iter().enumerate() {
            let group = &mut groups[i % self.blocks.len()];
            *group = (group.0 + batch.0, group.1 + batch.1);
        }
        Estimate::from_sums(&groups)
    }
}

impl Block {
    /// Block number `number` of that plan as it was saved.
    fn restored(
        rng: Rng,
        plan: &Plan,
        number: usize,
        saved: SavedBaseline,
        large_steps: LargeSteps,
    ) -> Result<Block, Unfit> {
        let first = (number * plan.lanes()) as u32;
        let chains = Baseline::restored(rng, first, plan.lanes(), saved, large_steps)?;
        Ok(Block { chains, splats: Splats::new(large_steps.layers()) })
    }
}

/// Samples of the first pass, and how the rest is cut up.
fn plan(mutations: Option<u64>) -> (u64, Plan) {
    let bootstrap_samples = mutations.map_or(BOOTSTRAP, |n| BOOTSTRAP.min(n / 2).max(1));
    (bootstrap_samples, Plan::new(mutations.map(|n| n.saturating_sub(bootstrap_samples).max(1)), 1))
}

fn large_steps(settings: &MltSettings) -> LargeSteps {
    LargeSteps { probability: settings.large_steps, kelemen_weights: settings.kelemen_weights }
}

/// All of [`Mlt`] but for its blocks and its film, and for what follows from settings.
#[derive(Serialize, Deserialize)]
struct SavedMlt {
    bootstrap: Vec<(f64, f64)>,
    bootstrap_rays: u64,
    bootstrap_faults: Faults,
    /// Number of blocks that follow; none where no light was found.
    blocks: usize,
}

/// What one batch of the first pass found.
struct Batch {
    ln_g: Vec<f64>,
    rays: u64,
    faults: Faults,
}

fn bootstrap_counter(sample: u64) -> Counter {
    Counter { ladder: 0, replica: 0, step: sample, purpose: Purpose::Bootstrap }
}

fn bootstrap_sample((sample, ln_g): (usize, &f64)) -> Start {
    Start { counter: bootstrap_counter(sample as u64), ln_g: *ln_g }
}

fn first_pass(stage: &Stage, rng: Rng, samples: u64) -> Vec<Batch> {
    let size = BOOTSTRAP_BATCH.min(samples.div_ceil(BOOTSTRAP_BATCHES));
    (0..samples.div_ceil(size))
        .into_par_iter()
        .map(|batch| {
            let samples = batch * size..((batch + 1) * size).min(samples);
            let counters: Vec<Counter> = samples.map(bootstrap_counter).collect();
            let mut evaluator = Evaluator::<Workspace>::new(rng, counters);
            evaluator.moves.fill(Move::Fresh);
            evaluator.evaluate(&stage.mapping, &Points::new(0));
            let out = evaluator.out;
            Batch { ln_g: out.lanes.iter().map(|c| c.ln_g).collect(), rays: out.rays, faults: out.faults }
        })
        .collect()
}

impl Engine for Mlt {
    fn sweeps_left(&self) -> Option<u64> {
        match self.blocks.first() {
            Some(block) => self.plan.sweeps.map(|sweeps| sweeps.saturating_sub(block.chains.steps())),
            None => Some(0),
        }
    }

    fn mutations_wanted(&self) -> Option<u64> {
        let sweeps = match self.blocks.first() {
            Some(block) => self.plan.sweeps.map(|sweeps| sweeps.max(block.chains.steps())),
            None => Some(0),
        };
        sweeps.map(|s| s * self.plan.a_sweep() + self.bootstrap_samples)
    }

    fn advance(&mut self, stage: &Stage, sweeps: u64, until: Option<u64>) -> u64 {
        let done = self.bootstrap_samples + self.blocks.first().map_or(0, |b| b.chains.steps()) * self.plan.a_sweep();
        let short = until.map_or(u64::MAX, |until| until.saturating_sub(done).div_ceil(self.plan.a_sweep()));
        let sweeps = sweeps.min(self.sweeps_left().unwrap_or(u64::MAX)).min(short);
        let (film, unit, own) = (&self.film, self.unit(), self.own());
        self.blocks.par_iter_mut().enumerate().with_max_len(1).for_each(|(i, block)| {
            if !own.contains(&i) {
                return block.chains.advance_elsewhere(sweeps);
            }
            block.chains.advance(&stage.mapping, sweeps, unit, &mut stage.recorder(&mut block.splats));
            film.deposit(&mut block.splats);
        });
        if self.blocks.is_empty() { 0 } else { sweeps }
    }

    /// The first pass is over when the method is made.
    fn phase(&self) -> Phase {
        Phase::Steady
    }

    fn counts(&self) -> Counts {
        let mut counts = Counts {
            mutations: self.bootstrap_samples,
            rays: self.bootstrap_rays,
            faults: self.bootstrap_faults.clone(),
            ..Counts::default()
        };
        let mut accepted = (0.0, 0);
        for block in &self.blocks {
            let (rays, faults) = block.chains.rays_and_faults();
            counts.mutations += block.chains.mutations();
            counts.rays += rays;
            counts.faults.merge(faults);
            counts.technique_changes.merge(&block.chains.changed);
            for (sum, n) in [block.chains.small, block.chains.large] {
                accepted = (accepted.0 + sum, accepted.1 + n);
            }
        }
        counts.acceptance = vec![mean(accepted.0, accepted.1)];
        counts
    }

    /// Image = pixels/N · (ĉ/ζ Σ CHAINS + Σ LARGE_STEPS) with ζ the first estimate of c.
    fn develop(&self) -> Development {
        let mut splats = Splats::new(self.large_steps.layers());
        for block in &self.blocks {
            let mut recorder = self.sheet.recorder(&self.footprint, &mut splats);
            block.chains.record_pending(self.unit(), &mut recorder);
        }
        let mut sums = self.film.layer_with(baseline_layer::CHAINS, &splats);
        let normalisation = self.normalisation();
        if self.pools && self.unit() > 0.0 {
            let later = normalisation.value / self.unit();
            sums.iter_mut().flat_map(|sum| &mut sum[..3]).for_each(|value| *value *= later);
        }
        if self.large_steps.kelemen_weights {
            let proposals = self.film.layer_with(baseline_layer::LARGE_STEPS, &splats);
            sums.iter_mut().flatten().zip(proposals.iter().flatten()).for_each(|(sum, value)| *sum += value);
        }
        let steps: u64 = self.blocks.iter().map(|b| b.chains.mutations()).sum();
        let scale = if steps > 0 { self.sheet.pixels() as f64 / steps as f64 } else { 0.0 };
        Development {
            image: self.sheet.image(|i| [0, 1, 2].map(|channel| sums[i][channel] * scale)),
            layers: vec![("density".into(), Plane::Gray(sums.iter().map(|s| s[3] as f32).collect()))],
            normalisation: Some(normalisation),
            warnings: film_warnings(&self.film),
            diagnostics: Diagnostics { chains: self.report(), ..Diagnostics::default() },
            agreement: None,
        }
    }

    /// Only steps are shared: what comes before them (the first pass and the chains' first states) all ranks have found
    /// each for itself, at most some 10⁵ samples.
    fn share(&mut self, company: &Arc<Company>) {
        self.company = Some(company.clone());
        if !company.is_first() {
            self.film = self.sheet.accumulator(self.large_steps.layers());
        }
    }

    fn gather(&mut self) {
        let Some(company) = self.company.clone() else { return };
        let own = self.own();
        let saved = self.blocks[own.clone()].iter().map(|block| block.chains.saved());
        let mut all: Vec<(usize, SavedBaseline)> = own.zip(saved).collect();
        company.fold(
            &mut all,
            |all| postcard::to_stdvec(all).expect("state that can be saved"),
            |all, bytes| all.extend(postcard::from_bytes::<Vec<_>>(bytes).expect("what a rank told")),
        );
        let (sheet, layers) = (self.sheet, self.large_steps.layers());
        company.gather_film(&mut self.film, || sheet.accumulator(layers));
        if company.is_first() {
            let own = self.own();
            for (i, saved) in all.into_iter().filter(|(i, _)| !own.contains(i)) {
                self.blocks[i] = Block::restored(self.rng, &self.plan, i, saved, self.large_steps)
                    .expect("what a rank of the same run told");
            }
        }
    }

    fn set_wanted(&mut self, mutations: Option<u64>) {
        let steps = mutations.map(|n| n.saturating_sub(self.bootstrap_samples).max(1));
        self.plan.sweeps = steps.map(|steps| steps.div_ceil(self.plan.a_sweep()));
    }

    fn save(&self, out: &mut dyn Write) -> io::Result<()> {
        let state = SavedMlt {
            bootstrap: self.bootstrap.clone(),
            bootstrap_rays: self.bootstrap_rays,
            bootstrap_faults: self.bootstrap_faults.clone(),
            blocks: self.blocks.len(),
        };
        write_value(out, &state)?;
        self.blocks.iter().try_for_each(|block| write_value(out, &block.chains.saved()))?;
        self.film.save(out)
    }
}
