//! `re`: replica exchange. One progressive pass gives image and normalisation.
//!
//! Sweeps come in rounds of doubling length. During a round the weights of the combination are fixed, made from the
//! normalisers known before it. The first sweeps are a warm-up, in which chains leave the places where they started;
//! only the uniform replica's own estimate and the normalisers keep anything of it.

use std::sync::Arc;

use rayon::prelude::*;

use super::{
    engine::{Counts, Development, Engine, Stage, layer_with, mean},
    plan::Plan,
    settings::{Combine, LadderChoice, Settings},
};
use crate::{
    film::{Accumulator, Plane, Splats},
    path::unidirectional::Workspace,
    tempering::{
        Block, Combination, Estimate, Group, LAYERS, Ladder, Normalisers, Phase, RungCounts, Statistics, Weights,
        layer, uniform_mean,
    },
};

/// Uniform points that each ladder draws a sweep.
const UNIFORM_DRAWS: usize = 1;
/// Sweeps of warm-up; a sixteenth of the run where that is shorter.
const WARM_UP: u64 = 64;
/// Standard errors by which the uniform mean and MBAR may differ before the person is told.
const ALARMING_DIFFERENCE: f64 = 3.0;

/// The ladder that the settings ask for.
pub fn ladder(settings: &Settings) -> Ladder {
    match &settings.ladder {
        LadderChoice::Replicas(k) => Ladder::even(*k as usize),
        LadderChoice::Betas(betas) => Ladder::new(betas.clone()),
    }
}

/// The method at work.
pub struct ReplicaExchange {
    plan: Plan,
    ladder: Arc<Ladder>,
    combination: Combination,
    film: Accumulator,
    blocks: Vec<Lane>,
    sweeps: u64,
    warm_up: u64,
    /// The sweep before which the next round begins: the end of the warm-up, then twice as late each time.
    next_round: u64,
    /// The weights of the round at work; `None` during the warm-up.
    weights: Option<Weights>,
    /// Magnitude of c in which tempered states are kept on the film, once known.
    unit: Option<f64>,
}

/// A block with its splats.
struct Lane {
    block: Block<Workspace>,
    splats: Splats,
}

/// All blocks' statistics and what follows from them.
struct Pooled {
    statistics: Vec<Statistics>,
    normalisers: Normalisers,
    uniform: Estimate,
}

impl ReplicaExchange {
    /// Ready to start.
    pub fn new(stage: &Stage, settings: &Settings, mutations: Option<u64>) -> ReplicaExchange {
        let ladder = Arc::new(ladder(settings));
        let plan = Plan::new(mutations, ladder.rungs() - 1 + UNIFORM_DRAWS);
        let block = |i: usize| Lane {
            block: Block::new(ladder.clone(), stage.rng, (i * plan.groups) as u32, plan.groups, UNIFORM_DRAWS),
            splats: Splats::new(LAYERS),
        };
        let warm_up = plan.sweeps.map_or(WARM_UP, |sweeps| WARM_UP.min(sweeps / 16));
        ReplicaExchange {
            film: stage.accumulator(LAYERS),
            blocks: (0..plan.blocks).map(block).collect(),
            combination: match settings.combine {
                Combine::Target => Combination::Target,
                Combine::Balance => Combination::Balance,
            },
            sweeps: 0,
            warm_up,
            next_round: warm_up,
            weights: None,
            unit: None,
            plan,
            ladder,
        }
    }

    fn phase(&self) -> Phase<'_> {
        self.weights.as_ref().map_or(Phase::WarmUp, Phase::Round)
    }

    /// Ends the round at work and fixes the weights of the next.
    fn begin_round(&mut self, stage: &Stage) {
        let phase = self.weights.as_ref().map_or(Phase::WarmUp, Phase::Round);
        let film = &self.film;
        self.blocks.par_iter_mut().for_each(|lane| {
            lane.block.flush(phase, &mut stage.recorder(&mut lane.splats));
            film.deposit(&mut lane.splats);
        });
        if self.weights.is_none() {
            self.blocks.iter_mut().for_each(|lane| lane.block.reset_counts());
        }
        let ln_zeta = self.pool(stage, &mut Splats::new(LAYERS)).normalisers.ln_z;
        let c = ln_zeta[ln_zeta.len() - 1].exp();
        let brightest = f64::from(stage.mapping.scene().emitters.brightest());
        let unit = *self.unit.get_or_insert(if c > 0.0 && c.is_finite() { c } else { brightest });
        let mut counts = vec![1.0; self.ladder.rungs()];
        counts[0] = UNIFORM_DRAWS as f64;
        self.weights = Some(Weights::new(self.combination, &self.ladder, &ln_zeta, &counts, unit));
    }

    /// Statistics of all blocks; splats of states not yet recorded go to `splats`.
    fn pool(&self, stage: &Stage, splats: &mut Splats) -> Pooled {
        let mut recorder = stage.recorder(splats);
        let statistics: Vec<Statistics> =
            self.blocks.iter().map(|lane| lane.block.snapshot(self.phase(), &mut recorder)).collect();
        let groups: Vec<Group> = statistics
            .iter()
            .map(|s| Group { uniform: &s.uniform, tempered: &s.tempered, weights: &s.weights })
            .collect();
        let normalisers = Normalisers::solve(&self.ladder, &groups);
        let sums: Vec<(f64, f64)> = statistics.iter().map(|s| s.uniform_sum).collect();
        Pooled { normalisers, uniform: uniform_mean(&sums), statistics }
    }
}

impl Engine for ReplicaExchange {
    fn sweeps_wanted(&self) -> Option<u64> {
        self.plan.sweeps
    }

    fn mutations_wanted(&self) -> Option<u64> {
        self.plan.sweeps.map(|s| s * self.plan.a_sweep())
    }

    fn advance(&mut self, stage: &Stage, sweeps: u64) {
        let end = self.sweeps + sweeps;
        while self.sweeps < end {
            if self.sweeps == self.next_round {
                self.begin_round(stage);
                self.next_round = (2 * self.sweeps).max(1);
            }
            let sweeps = self.next_round.min(end) - self.sweeps;
            let phase = self.weights.as_ref().map_or(Phase::WarmUp, Phase::Round);
            let film = &self.film;
            self.blocks.par_iter_mut().for_each(|lane| {
                let mut recorder = stage.recorder(&mut lane.splats);
                lane.block.advance(&stage.mapping, sweeps, phase, &mut recorder);
                film.deposit(&mut lane.splats);
            });
            self.sweeps += sweeps;
        }
    }

    fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        let mut rungs = vec![RungCounts::default(); self.ladder.rungs()];
        for lane in &self.blocks {
            let (rays, faults) = lane.block.rays_and_faults();
            counts.mutations += lane.block.mutations();
            counts.rays += rays;
            counts.non_finite += faults;
            rungs.iter_mut().zip(lane.block.counts()).for_each(|(sum, c)| *sum += *c);
        }
        counts.acceptance = rungs[1..].iter().map(|c| mean(c.accepted, c.proposed)).collect();
        counts.swap = rungs[1..].iter().map(|c| mean(c.swapped, c.offered)).collect();
        counts
    }

    /// Image = pixels · (Σ HOT / (sweeps · uniform points) + Ẑ/unit · Σ TEMPERED / sweeps), where sums over tempered
    /// states are scaled up for the sweeps in which chains had no state yet.
    fn develop(&self, stage: &Stage) -> Development {
        let mut splats = Splats::new(LAYERS);
        let pooled = self.pool(stage, &mut splats);
        let pending = stage.accumulator(LAYERS);
        pending.deposit(&mut splats);
        let layer = |number: usize| layer_with(stage, &self.film, &pending, number);

        let ladders = (self.plan.blocks * self.plan.groups) as f64;
        let pixels = stage.pixels() as f64;
        let rounds = self.sweeps.saturating_sub(self.warm_up) as f64 * ladders;
        let uniform_draws = self.sweeps as f64 * ladders * UNIFORM_DRAWS as f64;
        let inverse = |n: f64| if n > 0.0 { pixels / n } else { 0.0 };

        let used_rungs = match self.combination {
            Combination::Target => 1.0,
            Combination::Balance => (self.ladder.rungs() - 1) as f64,
        };
        let deposited: f64 = pooled.statistics.iter().flat_map(|s| &s.deposited).sum();
        let c = pooled.normalisers.target.value;
        // one sample a sweep and rung was planned; `deposited` of them had a state and a share
        let tempered_scale =
            if deposited > 0.0 { pixels * used_rungs / deposited * c / self.unit.unwrap_or(1.0) } else { 0.0 };
        let hot_scale = inverse(rounds * UNIFORM_DRAWS as f64);

        let (uniform, hot, tempered) = (layer(layer::UNIFORM), layer(layer::HOT), layer(layer::TEMPERED));
        let image = stage.image(|i| [0, 1, 2].map(|ch| hot[i][ch] * hot_scale + tempered[i][ch] * tempered_scale));
        let uniform_scale = inverse(uniform_draws);
        let uniform = stage.image(|i| [0, 1, 2].map(|ch| uniform[i][ch] * uniform_scale));
        let density = hot.iter().zip(&tempered).map(|(h, t)| (h[3] + t[3]) as f32).collect();
        Development {
            image,
            layers: vec![("uniform".into(), Plane::Rgb(uniform)), ("density".into(), Plane::Gray(density))],
            normalisation: Some(pooled.normalisers.target),
            warnings: pooled.warnings(),
        }
    }
}

impl Pooled {
    /// Says when the two estimates of c contradict each other: what the chains do not find, MBAR does not count.
    fn warnings(&self) -> Vec<String> {
        let (uniform, mbar) = (self.uniform, self.normalisers.target);
        let error = uniform.standard_error.hypot(mbar.standard_error);
        let difference = (uniform.value - mbar.value).abs();
        if difference <= ALARMING_DIFFERENCE * error || error.is_nan() {
            return Vec::new();
        }
        vec![format!(
            "the uniform replica alone estimates a mean luminance of {:.4} ± {:.4}, all replicas together {:.4} ± {:.4}: \
             chains may not find all of the light; render longer or compare with --method path",
            uniform.value, uniform.standard_error, mbar.value, mbar.standard_error
        )]
    }
}
