//! Targets of ladders whose integrals are known, and runs on them without a scene.

use rayon::prelude::*;

use crate::chain::{Measure, Target};
use crate::film::{Filter, Footprint};
use crate::path::{Contribution, Contributions, luminance};
use crate::rng::{Rng, open_unit_f64, unit_f32};
use crate::sample::Proposals;
use crate::scene::Rgb;
use crate::tempering::{Choices, Combine, LadderChoice, Learnt, RoundReport, Sampler, Setup};

/// f and ln g of a point, of which film position and three more numbers in (0, 1) are given.
pub struct Analytic<F>(pub F);

impl<F: Fn(f32, [f64; 3]) -> (f32, f64) + Sync> Target for Analytic<F> {
    type Workspace = Vec<u32>;

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
        proposals.begin(live);
        proposals.draw(0, live);
        for &lane in &*live {
            let lane = lane as usize;
            let [x, rest @ ..] = proposals.block(0, lane);
            let x = unit_f32(x);
            let (f, ln_g) = (self.0)(x, rest.map(open_unit_f64));
            let rgb = Rgb::splat(f);
            out.lanes[lane] = Contribution { film: [x, 0.5], rgb, luminance: luminance(rgb), ln_g, chance: 1.0 };
        }
    }
}

/// What chains follow where that is the luminance, f being grey.
pub fn ln_of(f: f64) -> f64 {
    if f > 0.0 { libm::log(f64::from(luminance(Rgb::splat(f as f32)))) } else { f64::NEG_INFINITY }
}

/// What a run came to.
pub struct Run {
    /// Mean luminance of the image.
    pub mean: f64,
    /// Statistics.
    pub learnt: Learnt,
    /// All rounds.
    pub reports: Vec<RoundReport>,
    /// Values of the image that are no numbers.
    pub wrong: usize,
}

/// A whole run on a film of eight pixels in a row.
pub fn run<T: Target>(target: &T, choices: &Choices, evaluations: u64, seed: u64) -> Run {
    const SIZE: [u32; 2] = [8, 1];
    let mut sampler = Sampler::<T::Workspace>::new(Setup {
        rng: Rng::new(seed),
        choices: choices.clone(),
        footprint: Footprint::new(Filter::Box, SIZE[0], SIZE[1]),
        size: SIZE,
        unit: 1.0,
        elsewhere: false,
        outcomes: false,
        evaluations: Some(evaluations),
    });
    while sampler.sweeps_left() != Some(0) {
        sampler.advance(target, u64::MAX, None);
    }
    let development = sampler.develop();
    let luminance = development.image.luminance();
    Run {
        mean: luminance.iter().map(|v| f64::from(*v)).sum::<f64>() / luminance.len() as f64,
        learnt: development.learnt,
        reports: sampler.take_reports(),
        wrong: development.image.pixels.as_flattened().iter().filter(|v| !v.is_finite()).count(),
    }
}

/// Runs with the seeds 1, 2, …
pub fn runs<T: Target>(target: &T, choices: &Choices, evaluations: u64, n: u64) -> Vec<Run> {
    (1..=n).into_par_iter().map(|seed| run(target, choices, evaluations, seed)).collect()
}

/// K replicas that follow g itself.
pub fn replicas(k: u32) -> Choices {
    Choices { ladder: LadderChoice::Replicas(k), measure: Measure::Absolute, ..Choices::default() }
}

/// Inverse temperatures as given.
pub fn betas(betas: &[f64]) -> Choices {
    Choices { ladder: LadderChoice::Betas(betas.to_vec()), ..replicas(2) }
}

/// The same combined in another way.
pub fn combined(choices: &Choices, combine: Combine) -> Choices {
    Choices { combine, ..choices.clone() }
}
