//! `mlt`: the paper's two-pass baseline. First the normalisation c from M independent samples, then chains that start
//! from states resampled among them in proportion to g; image = c/N Σ f/g.

use rayon::prelude::*;

use super::{
    engine::{Counts, Development, Engine, Stage, film_warnings, layer_with, mean},
    plan::Plan,
};
use crate::{
    chain::{Baseline, Evaluator, Start, resample},
    film::{Accumulator, Plane, Splats},
    path::unidirectional::Workspace,
    rng::{Counter, Purpose},
    sample::{Move, Points, StepLaw},
    tempering::Estimate,
};

/// Independent samples of the first pass; half of the budget where that is less.
const BOOTSTRAP: u64 = 100_000;
/// Samples evaluated together in the first pass, at most.
const BOOTSTRAP_BATCH: u64 = 1024;
/// Batches at least, where there are as many samples: the standard error of c is taken between them.
const BOOTSTRAP_BATCHES: u64 = 16;

/// The method at work.
pub struct TwoPassMlt {
    plan: Plan,
    film: Accumulator,
    blocks: Vec<Block>,
    bootstrap: u64,
    bootstrap_rays: u64,
    bootstrap_faults: u64,
    normalisation: Estimate,
}

struct Block {
    chains: Baseline<Workspace>,
    splats: Splats,
}

impl TwoPassMlt {
    /// Does the first pass and puts the chains into their first states.
    pub fn new(stage: &Stage, mutations: Option<u64>) -> TwoPassMlt {
        let bootstrap = mutations.map_or(BOOTSTRAP, |n| BOOTSTRAP.min(n / 2).max(1));
        let plan = Plan::new(mutations.map(|n| n.saturating_sub(bootstrap).max(1)), 1);
        let batches = first_pass(stage, bootstrap);
        let groups: Vec<(f64, f64)> =
            batches.iter().map(|b| (b.ln_g.iter().map(|l| libm::exp(*l)).sum(), b.ln_g.len() as f64)).collect();
        let normalisation = Estimate::from_sums(&groups);
        let samples: Vec<Start> = batches.iter().flat_map(|b| &b.ln_g).enumerate().map(bootstrap_sample).collect();
        // a black scene has no state to start from: no chains, a black image
        let starts = resample(&samples, 1.0, plan.blocks * plan.lanes(), stage.rng, 0);
        let blocks = starts
            .par_chunks(plan.lanes())
            .enumerate()
            .map(|(i, starts)| Block {
                chains: Baseline::new(&stage.mapping, stage.rng, (i * plan.lanes()) as u32, starts),
                splats: Splats::new(1),
            })
            .collect();
        TwoPassMlt {
            plan,
            film: stage.accumulator(1),
            blocks,
            bootstrap,
            bootstrap_rays: batches.iter().map(|b| b.rays).sum(),
            bootstrap_faults: batches.iter().map(|b| b.faults).sum(),
            normalisation,
        }
    }

    /// The magnitude that states are kept in on the film: c itself.
    fn unit(&self) -> f64 {
        self.normalisation.value
    }
}

/// What one batch of the first pass found.
struct Batch {
    ln_g: Vec<f64>,
    rays: u64,
    faults: u64,
}

fn bootstrap_counter(sample: u64) -> Counter {
    Counter { ladder: 0, replica: 0, step: sample, purpose: Purpose::Bootstrap }
}

fn bootstrap_sample((sample, ln_g): (usize, &f64)) -> Start {
    Start { counter: bootstrap_counter(sample as u64), ln_g: *ln_g }
}

fn first_pass(stage: &Stage, samples: u64) -> Vec<Batch> {
    let size = BOOTSTRAP_BATCH.min(samples.div_ceil(BOOTSTRAP_BATCHES));
    (0..samples.div_ceil(size))
        .into_par_iter()
        .map(|batch| {
            let samples = batch * size..((batch + 1) * size).min(samples);
            let counters: Vec<Counter> = samples.map(bootstrap_counter).collect();
            let mut evaluator = Evaluator::<Workspace>::new(stage.rng, StepLaw::KELEMEN, counters);
            evaluator.moves.fill(Move::Fresh);
            evaluator.evaluate(&stage.mapping, &Points::new(0));
            let out = evaluator.out;
            Batch { ln_g: out.lanes.iter().map(|c| c.ln_g).collect(), rays: out.rays, faults: out.non_finite }
        })
        .collect()
}

impl Engine for TwoPassMlt {
    fn sweeps_wanted(&self) -> Option<u64> {
        if self.blocks.is_empty() { Some(0) } else { self.plan.sweeps }
    }

    fn mutations_wanted(&self) -> Option<u64> {
        self.sweeps_wanted().map(|s| s * self.plan.a_sweep() + self.bootstrap)
    }

    fn advance(&mut self, stage: &Stage, sweeps: u64) {
        let (film, unit) = (&self.film, self.unit());
        self.blocks.par_iter_mut().for_each(|block| {
            block.chains.advance(&stage.mapping, sweeps, unit, &mut stage.recorder(&mut block.splats));
            film.deposit(&mut block.splats);
        });
    }

    fn counts(&self) -> Counts {
        let mut counts = Counts {
            mutations: self.bootstrap,
            rays: self.bootstrap_rays,
            non_finite: self.bootstrap_faults,
            ..Counts::default()
        };
        let mut accepted = (0.0, 0);
        for block in &self.blocks {
            let (rays, faults) = block.chains.rays_and_faults();
            counts.mutations += block.chains.mutations();
            counts.rays += rays;
            counts.non_finite += faults;
            for (sum, n) in [block.chains.small, block.chains.large] {
                accepted = (accepted.0 + sum, accepted.1 + n);
            }
        }
        counts.acceptance = vec![mean(accepted.0, accepted.1)];
        counts
    }

    fn develop(&self, stage: &Stage) -> Development {
        let mut splats = Splats::new(1);
        for block in &self.blocks {
            block.chains.record_pending(self.unit(), &mut stage.recorder(&mut splats));
        }
        let sums = layer_with(&self.film, &splats, 0);
        let steps: u64 = self.blocks.iter().map(|b| b.chains.mutations()).sum();
        let scale = if steps > 0 { stage.pixels() as f64 / steps as f64 } else { 0.0 };
        Development {
            image: stage.image(|i| [0, 1, 2].map(|channel| sums[i][channel] * scale)),
            layers: vec![("density".into(), Plane::Gray(sums.iter().map(|s| s[3] as f32).collect()))],
            normalisation: Some(self.normalisation),
            warnings: film_warnings(&self.film),
        }
    }
}
