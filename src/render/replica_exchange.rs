//! `re`: replica exchange. One progressive pass gives image and normalisation.
//!
//! The first sweeps are uniform points only. Like every uniform point they enter the uniform replica's own estimate and
//! the normalisers; the chains of all rungs start from states resampled among them. (Chains that started from nothing
//! and waited for swaps left the image 10 % dark after 500 sweeps, where a bright light fills little of the picture.)
//! Then sweeps come in rounds of doubling length. During a round the weights of the combination are fixed, made from
//! the normalisers known before it.

use std::sync::Arc;

use rayon::prelude::*;

use super::{
    engine::{Counts, Development, Engine, Stage, film_warnings, layer_with, mean},
    plan::Plan,
    settings::{Combine, LadderChoice, Settings},
};
use crate::{
    chain::{Start, resample},
    film::{Accumulator, Filter, Plane, Splats},
    path::unidirectional::Workspace,
    tempering::{
        Block, Combination, Estimate, Histogram, LAYERS, Ladder, Normalisers, RungCounts, Statistics, Weights, layer,
        uniform_mean,
    },
};

/// Uniform points that a ladder draws a sweep: as many as it has replicas that move, so that half of all evaluations
/// are uniform however long the ladder is. (ALGORITHM section 4: where little of the cube is lit, the error follows the
/// number of lit uniform points.)
fn uniform_draws(ladder: &Ladder) -> usize {
    ladder.rungs() - 1
}

/// Independent samples from which chains start; a sixteenth of the run where that is less.
const BOOTSTRAP: u64 = 1 << 17;

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
    portions: Vec<Portion>,
    sweeps: u64,
    /// How many of the sweeps are uniform points only.
    bootstrap: u64,
    /// The sweep before which the next round begins: the end of the bootstrap, then twice as late each time.
    next_round: u64,
    /// The weights of the round at work.
    weights: Weights,
    /// Magnitude of c in which tempered states are kept on the film.
    unit: f64,
}

/// A block of ladders with its splats.
struct Portion {
    block: Block<Workspace>,
    splats: Splats,
}

/// What follows from all blocks' statistics.
struct Pooled {
    normalisers: Normalisers,
    uniform: Estimate,
}

impl ReplicaExchange {
    /// Ready to start.
    pub fn new(stage: &Stage, settings: &Settings, mutations: Option<u64>) -> ReplicaExchange {
        let ladder = Arc::new(ladder(settings));
        let draws = uniform_draws(&ladder);
        let plan = Plan::new(mutations, ladder.rungs() - 1 + draws);
        let portion = |i: usize| Portion {
            block: Block::new(ladder.clone(), stage.rng, (i * plan.groups) as u32, plan.groups, draws),
            splats: Splats::new(LAYERS),
        };
        let bootstrap = BOOTSTRAP.div_ceil(plan.a_sweep());
        let bootstrap = plan.sweeps.map_or(bootstrap, |sweeps| bootstrap.min(sweeps / 16).max(1));
        let combination = match settings.combine {
            Combine::Target => Combination::Target,
            Combine::Balance => Combination::Balance,
        };
        let nothing_known = vec![f64::NEG_INFINITY; ladder.rungs()];
        let counts = vec![1.0; ladder.rungs()];
        ReplicaExchange {
            film: stage.accumulator(LAYERS),
            portions: (0..plan.blocks).map(portion).collect(),
            combination,
            sweeps: 0,
            bootstrap,
            next_round: bootstrap,
            weights: Weights::new(combination, &ladder, &nothing_known, &counts, 1.0),
            unit: 1.0,
            plan,
            ladder,
        }
    }

    /// Ends the round at work and fixes the weights of the next; the first time, chains start.
    fn begin_round(&mut self, stage: &Stage) {
        let (film, weights) = (&self.film, &self.weights);
        self.portions.par_iter_mut().for_each(|portion| {
            portion.block.flush(weights, &mut stage.recorder(&mut portion.splats));
            film.deposit(&mut portion.splats);
        });
        let recorded: Vec<&Statistics> = self.portions.iter().map(|portion| portion.block.recorded()).collect();
        let ln_zeta = Pooled::solve(&self.ladder, &recorded).normalisers.ln_z;
        if self.sweeps == self.bootstrap {
            let c = libm::exp(ln_zeta[ln_zeta.len() - 1]);
            let brightest = f64::from(stage.mapping.scene().emitters.brightest());
            // lights of radiance 0 leave no magnitude at all; any will do for a black film
            self.unit = [c, brightest].into_iter().find(|unit| *unit > 0.0 && unit.is_finite()).unwrap_or(1.0);
            self.start_chains(stage);
        }
        let mut counts = vec![1.0; self.ladder.rungs()];
        counts[0] = uniform_draws(&self.ladder) as f64;
        self.weights = Weights::new(self.combination, &self.ladder, &ln_zeta, &counts, self.unit);
    }

    /// Resamples the bootstrap for every rung and puts the chains there.
    fn start_chains(&mut self, stage: &Stage) {
        let samples: Vec<Start> = self.portions.iter_mut().flat_map(|portion| portion.block.take_bootstrap()).collect();
        let ladders = self.plan.blocks * self.plan.groups;
        let starts: Vec<Vec<Start>> = self.ladder.betas()[1..]
            .par_iter()
            .enumerate()
            .map(|(rung, &beta)| resample(&samples, beta, ladders, stage.rng, rung as u32))
            .collect();
        let groups = self.plan.groups;
        self.portions.par_iter_mut().enumerate().for_each(|(i, portion)| {
            let of_block = i * groups..(i + 1) * groups;
            let starts: Vec<&[Start]> =
                starts.iter().map(|rung| rung.get(of_block.clone()).unwrap_or_default()).collect();
            portion.block.start(&stage.mapping, &starts);
        });
    }
}

impl Pooled {
    fn solve(ladder: &Ladder, statistics: &[&Statistics]) -> Pooled {
        let groups: Vec<&[Histogram]> = statistics.iter().map(|s| s.rungs.as_slice()).collect();
        Pooled { normalisers: Normalisers::solve(ladder, &groups), uniform: uniform_mean(&groups) }
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
                self.next_round = 2 * self.sweeps;
            }
            let sweeps = self.next_round.min(end) - self.sweeps;
            let chains_move = self.sweeps >= self.bootstrap;
            let (film, weights) = (&self.film, &self.weights);
            self.portions.par_iter_mut().for_each(|portion| {
                let mut recorder = stage.recorder(&mut portion.splats);
                if chains_move {
                    portion.block.advance(&stage.mapping, sweeps, weights, &mut recorder);
                } else {
                    portion.block.bootstrap(&stage.mapping, sweeps, &mut recorder);
                }
                film.deposit(&mut portion.splats);
            });
            self.sweeps += sweeps;
        }
    }

    fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        let mut rungs = vec![RungCounts::default(); self.ladder.rungs()];
        for portion in &self.portions {
            let (rays, faults) = portion.block.rays_and_faults();
            counts.mutations += portion.block.mutations();
            counts.rays += rays;
            counts.non_finite += faults;
            rungs.iter_mut().zip(portion.block.counts()).for_each(|(sum, c)| *sum += *c);
        }
        counts.acceptance = rungs[1..].iter().map(|c| mean(c.accepted, c.proposed)).collect();
        counts.swap = rungs[1..].iter().map(|c| mean(c.swapped, c.offered)).collect();
        counts
    }

    /// Image = mean of HOT over each pixel's uniform points + pixels · Ẑ/unit · Σ TEMPERED / sweeps, where sums over
    /// tempered states are scaled up for the sweeps in which chains had no state.
    fn develop(&self, stage: &Stage) -> Development {
        let mut splats = Splats::new(LAYERS);
        let mut recorder = stage.recorder(&mut splats);
        let statistics: Vec<Statistics> =
            self.portions.iter().map(|portion| portion.block.with_pending(&self.weights, &mut recorder)).collect();
        let pooled = Pooled::solve(&self.ladder, &statistics.iter().collect::<Vec<_>>());
        let layer = |number: usize| layer_with(&self.film, &splats, number);

        // one sample a sweep and rung was planned; `deposited` of them had a state and a share
        let deposited: f64 = statistics.iter().map(|s| s.deposited).sum();
        let used_rungs = match self.combination {
            Combination::Target => 1.0,
            Combination::Balance => (self.ladder.rungs() - 1) as f64,
        };
        let a_state = if deposited > 0.0 { stage.pixels() as f64 * used_rungs / deposited } else { 0.0 };
        let tempered_scale = a_state * pooled.normalisers.target.value / self.unit;

        let draws = (self.plan.blocks * self.plan.groups * uniform_draws(&self.ladder)) as u64;
        let in_rounds = self.sweeps.saturating_sub(self.bootstrap) * draws;
        let in_all = statistics.iter().map(|s| s.uniform_points).sum::<u64>();
        let (uniform_sums, hot, tempered) = (layer(layer::UNIFORM), layer(layer::HOT), layer(layer::TEMPERED));
        let (uniform_part, hot_part) = (PixelMeans::new(stage, in_all), PixelMeans::new(stage, in_rounds));
        let uniform = stage.image(|i| uniform_part.of(&uniform_sums[i]));
        let combined = |i: usize| {
            let hot = hot_part.of(&hot[i]);
            [0, 1, 2].map(|ch| hot[ch] + tempered[i][ch] * tempered_scale)
        };
        let combined_density = |(h, t): (&[f64; 4], &[f64; 4])| (h[3] + t[3]) as f32;
        // before the first round there is nothing but the uniform replica's own estimate
        let (image, density) = if in_rounds == 0 {
            (uniform.clone(), uniform_sums.iter().map(|sum| sum[3] as f32).collect())
        } else {
            (stage.image(combined), hot.iter().zip(&tempered).map(combined_density).collect())
        };
        Development {
            image,
            layers: vec![("uniform".into(), Plane::Rgb(uniform)), ("density".into(), Plane::Gray(density))],
            normalisation: Some(pooled.normalisers.target),
            warnings: [pooled.warnings(), film_warnings(&self.film)].concat(),
        }
    }
}

/// Means over the uniform points of each pixel, of which the number is random.
///
/// Dividing by the number that a pixel got, rather than by the one it should have got, takes the noise of that number
/// out of the image (post-stratification; relMSE of `cornell-box` at 60 mpp and K = 3: 0.0094 to 0.0077), without
/// touching the points themselves, which must stay independent to be offered to chains. A pixel without any counts
/// as 0; the others are scaled up for that, by the inverse of the probability of getting some, so that the estimate
/// stays unbiased at any number of points. With a filter wider than a pixel the divisor is the sum of filter weights:
/// consistent, as in Mitsuba.
struct PixelMeans {
    scale: f64,
}

impl PixelMeans {
    fn new(stage: &Stage, points: u64) -> PixelMeans {
        let box_filter = stage.mapping.scene().film.filter == Filter::Box;
        // 1 − (1 − 1/pixels)^points
        let some = -libm::expm1(points as f64 * libm::log1p(-1.0 / stage.pixels() as f64));
        PixelMeans { scale: if box_filter && points > 0 && stage.pixels() > 1 { 1.0 / some } else { 1.0 } }
    }

    fn of(&self, &[r, g, b, weight]: &[f64; 4]) -> [f64; 3] {
        if weight > 0.0 { [r, g, b].map(|v| v * self.scale / weight) } else { [0.0; 3] }
    }
}

impl Pooled {
    /// Says when the two estimates of c contradict each other: what the chains do not find, MBAR does not count.
    fn warnings(&self) -> Vec<String> {
        let (uniform, mbar) = (self.uniform, self.normalisers.target);
        if !uniform.contradicts(&mbar) {
            return Vec::new();
        }
        vec![format!(
            "the uniform replica alone estimates a mean luminance of {:.4} ± {:.4}, all replicas together {:.4} ± {:.4}: \
             chains may not find all of the light; render longer or compare with --method path",
            uniform.value, uniform.standard_error, mbar.value, mbar.standard_error
        )]
    }
}
