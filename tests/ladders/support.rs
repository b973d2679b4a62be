//! Targets beside the toys, exact draws from them, and whole runs.

use rayon::prelude::*;
use relt::{
    chain::{Evaluator, Measure, Start, Target},
    film::{Accumulator, Filter, Footprint, Plane},
    path::{Contribution, Contributions},
    rng::{Counter, Purpose, Rng, open_unit_f64, unit_f32},
    sample::{Move, Points, Proposals},
    scene::Rgb,
    tempering::{
        Canvas, Choices, Combine, Ladder, LadderChoice, Layers, Learnt, PointGroups, Round, RoundReport, Sampler,
        Setup, StepMix, Weights,
    },
};

use crate::toys::{Shape, Toy};

/// g of the first two primary samples; the first is the position on the film.
pub struct Square<F>(pub F);

impl<F: Fn(f32, f32) -> f32 + Sync> Target for Square<F> {
    type Workspace = Vec<u32>;

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
        proposals.begin(live);
        proposals.draw(0, live);
        for &lane in &*live {
            let [x, y, ..] = proposals.block(0, lane as usize).map(unit_f32);
            out.lanes[lane as usize] = Contribution::settle([x, 0.5], Rgb::splat((self.0)(x, y))).0;
        }
    }
}

/// Two peaks of different width on a dim floor.
pub fn two_peaks() -> Toy {
    Toy::new("two peaks", 2, 0.02, Shape::Gaussian).with(1.0, &[0.25, 0.5], &[0.05, 0.05]).with(
        4.0,
        &[0.8, 0.3],
        &[0.02, 0.02],
    )
}

/// Five cells of equal width in y, one of them dark, each of its own g.
pub const CELLS: [f32; 5] = [1.0, 4.0, 0.0, 0.25, 16.0];

/// g of [`CELLS`].
pub fn cells(_: f32, y: f32) -> f32 {
    CELLS[((y * 5.0) as usize).min(4)]
}

/// π_β of the cells.
pub fn cell_shares(beta: f64) -> Vec<f64> {
    let powers: Vec<f64> = CELLS.iter().map(|g| if *g > 0.0 { f64::from(*g).powf(beta) } else { 0.0 }).collect();
    let sum: f64 = powers.iter().sum();
    powers.into_iter().map(|p| p / sum).collect()
}

/// `n` independent exact draws from g^β, as samples to start chains from: uniform points, kept with probability
/// (g/`largest`)^β.
pub fn exact_draws<T: Target>(target: &T, beta: f64, largest: f64, n: usize, rng: Rng, stream: u32) -> Vec<Start> {
    const LANES: usize = 1024;
    let counter = |step| Counter { ladder: stream, replica: u16::MAX, step, purpose: Purpose::Bootstrap };
    let mut batch = Evaluator::<T::Workspace>::new(rng, vec![counter(0); LANES]);
    batch.moves.fill(Move::Fresh);
    let mut draws = Vec::with_capacity(n);
    for first in (0..).step_by(LANES) {
        batch.counters.iter_mut().zip(first..).for_each(|(c, step)| *c = counter(step));
        batch.evaluate(target, &Points::new(0));
        for (point, counter) in batch.out.lanes.iter().zip(&batch.counters) {
            let u = open_unit_f64(rng.words(Counter { purpose: Purpose::Start, ..*counter }, 0)[0]);
            if draws.len() < n && u.ln() < beta * (point.ln_g - largest.ln()) {
                draws.push(Start { counter: *counter, ln_g: point.ln_g });
            }
        }
        if draws.len() == n {
            break;
        }
    }
    draws
}

/// What a run of the sampler gave.
pub struct Run {
    /// Mean of g over each column.
    pub image: Vec<f64>,
    /// Further layers, as luminance.
    pub layers: Vec<(String, Vec<f64>)>,
    /// Statistics.
    pub learnt: Learnt,
    /// The ladder at the end.
    pub ladder: Ladder,
    /// All reports.
    pub reports: Vec<RoundReport>,
}

/// A sampler on an image of one row.
pub fn sampler<T: Target>(choices: Choices, columns: u32, evaluations: u64, seed: u64) -> Sampler<T::Workspace> {
    Sampler::new(Setup {
        rng: Rng::new(seed),
        choices,
        footprint: Footprint::new(Filter::Box, columns, 1),
        size: [columns, 1],
        unit: 1.0,
        elsewhere: false,
        outcomes: false,
        evaluations: Some(evaluations),
    })
}

/// A whole run.
pub fn run<T: Target>(target: &T, choices: Choices, columns: u32, evaluations: u64, seed: u64) -> Run {
    let mut sampler = sampler::<T>(choices, columns, evaluations, seed);
    while sampler.sweeps_left() != Some(0) {
        sampler.advance(target, u64::MAX, None);
    }
    let development = sampler.develop();
    let grey = |values: Vec<f32>| values.into_iter().map(f64::from).collect();
    let layers = development.layers.into_iter().map(|(name, plane)| match plane {
        Plane::Rgb(image) => (name, grey(image.luminance())),
        Plane::Gray(values) => (name, grey(values)),
    });
    Run {
        image: grey(development.image.luminance()),
        layers: layers.collect(),
        learnt: development.learnt,
        ladder: sampler.ladder().clone(),
        reports: sampler.take_reports(),
    }
}

/// Runs with seeds 0 to `n` − 1.
pub fn runs<T: Target>(target: &T, choices: &Choices, columns: u32, evaluations: u64, n: u64) -> Vec<Run> {
    (0..n).into_par_iter().map(|seed| run(target, choices.clone(), columns, evaluations, seed)).collect()
}

/// K replicas that follow luminance itself, of which normalisers are known.
pub fn replicas(k: u32, combine: Combine) -> Choices {
    Choices { ladder: LadderChoice::Replicas(k), combine, ..automatic() }
}

/// Inverse temperatures as given, and the balance heuristic.
pub fn betas(betas: &[f64]) -> Choices {
    Choices { ladder: LadderChoice::Betas(betas.to_vec()), ..automatic() }
}

/// All as it comes, but for the luminance that chains follow.
pub fn automatic() -> Choices {
    Choices { measure: Measure::Absolute, ..Choices::default() }
}

/// What blocks of ladders work on where no sampler leads them: an image of one row with the layers of the balance
/// heuristic, and a round without end.
pub struct Stage {
    footprint: Footprint,
    columns: u32,
    groups: PointGroups,
    /// The film.
    pub film: Accumulator,
    /// What its layers hold.
    pub layers: Layers,
    /// The round.
    pub round: Round,
}

impl Stage {
    /// For that ladder, with weights as if ln Z were `ln_z`, and with layers for what points give elsewhere if wanted.
    pub fn new(ladder: Ladder, ln_z: &[f64], columns: u32, elsewhere: bool) -> Stage {
        let rungs = ladder.rungs();
        let layers = Layers::of(&replicas(rungs as u32, Combine::Balance), rungs, elsewhere);
        let mixes = vec![StepMix::about(2.0); rungs];
        Stage {
            footprint: Footprint::new(Filter::Box, columns, 1),
            columns,
            groups: PointGroups::new(1),
            film: Accumulator::new(columns, 1, layers.count, 1.0),
            layers,
            round: Round {
                weights: Weights::new(&ladder, ln_z, 0.25, 0.0),
                mixes: std::array::from_fn(|_| mixes.clone()),
                effort: [1.0, 1.0],
                only_offers: true,
                open: false,
                half: u64::MAX,
                ladder,
            },
        }
    }

    /// What blocks record to.
    pub fn canvas(&self) -> Canvas<'_> {
        Canvas {
            footprint: &self.footprint,
            size: [self.columns, 1],
            film: &self.film,
            unit: 1.0,
            layers: self.layers,
            probes: None,
            groups: &self.groups,
        }
    }
}
