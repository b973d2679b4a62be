//! Ladders and chains on analytic targets, no scene needed: what is known exactly must come out.

use std::sync::Arc;

use relt::{
    chain::{Baseline, Evaluator, LargeSteps, Recorder, Start, Target, baseline_layer, resample},
    film::{Accumulator, Filter, Footprint, Splats},
    path::{Contribution, Contributions},
    rng::{Counter, Purpose, Rng, unit_f32},
    sample::{Move, Points, Proposals, StepLaw},
    scene::Rgb,
    tempering::{
        Block, Combination, Estimate, Histogram, LAYERS, Ladder, Normalisers, Statistics, Weights, layer, uniform_mean,
    },
};

/// g on the unit square, drawn as an image of one row: the film position is the first coordinate.
struct Analytic<F>(F);

impl<F: Fn(f32, f32) -> f32 + Sync> Target for Analytic<F> {
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

const COLUMNS: u32 = 16;
const BLOCKS: usize = 16;

struct Run {
    normalisers: Normalisers,
    uniform: Estimate,
    /// Estimate of the integral over each column, times the number of columns.
    image: Vec<f64>,
    statistics: Vec<Statistics>,
}

/// Replica exchange as the renderer does it: a bootstrap, then rounds of doubling length.
fn run<F: Fn(f32, f32) -> f32 + Sync>(
    g: F,
    betas: &[f64],
    combination: Combination,
    uniform_draws: usize,
    sweeps: u64,
    seed: u64,
) -> Run {
    const LADDERS: usize = 8;
    let target = Analytic(g);
    let ladder = Arc::new(Ladder::new(betas.to_vec()));
    let footprint = Footprint::new(Filter::Box, COLUMNS, 1);
    let size = [COLUMNS as f32, 1.0];
    let film = Accumulator::new(COLUMNS, 1, LAYERS, 1.0);
    let mut splats = Splats::new(LAYERS);
    let mut blocks: Vec<Block<Vec<u32>>> = (0..BLOCKS)
        .map(|b| Block::new(ladder.clone(), Rng::new(seed), (b * LADDERS) as u32, LADDERS, uniform_draws))
        .collect();
    let mut counts = vec![1.0; betas.len()];
    counts[0] = uniform_draws as f64;
    let unit = 1.0;

    let solve = |blocks: &[Block<Vec<u32>>]| {
        let groups: Vec<&[Histogram]> = blocks.iter().map(|b| b.recorded().rungs.as_slice()).collect();
        Normalisers::solve(&ladder, &groups)
    };
    let mut recorder = Recorder { footprint: &footprint, size, splats: &mut splats };
    for block in &mut blocks {
        block.bootstrap(&target, 64, &mut recorder);
    }
    let samples: Vec<Start> = blocks.iter_mut().flat_map(|b| b.take_bootstrap()).collect();
    let starts: Vec<Vec<Start>> =
        (1..betas.len()).map(|k| resample(&samples, betas[k], BLOCKS * LADDERS, Rng::new(seed), k as u32)).collect();
    for (b, block) in blocks.iter_mut().enumerate() {
        let of_block = b * LADDERS..(b + 1) * LADDERS;
        let starts: Vec<&[Start]> = starts.iter().map(|s| s.get(of_block.clone()).unwrap_or_default()).collect();
        block.start(&target, &starts);
    }
    let (mut done, mut length) = (0, 64);
    while done < sweeps {
        let weights = Weights::new(combination, &ladder, &solve(&blocks).ln_z, &counts, unit);
        for block in &mut blocks {
            block.advance(&target, length, &weights, &mut recorder);
            block.flush(&weights, &mut recorder);
        }
        done += length;
        length *= 2;
    }
    let normalisers = solve(&blocks);
    let statistics: Vec<Statistics> = blocks.iter().map(|b| b.recorded().clone()).collect();
    film.deposit(&mut splats);
    let samples = (done as usize * BLOCKS * LADDERS) as f64 / f64::from(COLUMNS);
    let hot = film.layer(layer::HOT);
    let tempered = film.layer(layer::TEMPERED);
    let c = normalisers.target.value;
    let image = (0..COLUMNS as usize)
        .map(|i| hot[i][0] / (samples * uniform_draws as f64) + tempered[i][0] / samples * c / unit);
    let groups: Vec<&[Histogram]> = statistics.iter().map(|s| s.rungs.as_slice()).collect();
    Run { image: image.collect(), uniform: uniform_mean(&groups), normalisers, statistics }
}

/// Two peaks of different width on a dim floor.
fn peaks(x: f32, y: f32) -> f32 {
    let bump = |cx: f32, cy: f32, r: f32| (-((x - cx).powi(2) + (y - cy).powi(2)) / (2.0 * r * r)).exp();
    0.02 + bump(0.25, 0.5, 0.05) + 4.0 * bump(0.8, 0.3, 0.02)
}

/// Integral of a function over each column of the unit square, times the number of columns, by the midpoint rule.
fn columns(g: impl Fn(f32, f32) -> f32) -> Vec<f64> {
    let n = 128;
    (0..COLUMNS)
        .map(|column| {
            let mut sum = 0.0;
            for i in 0..n {
                for j in 0..n * 8 {
                    let x = (column as f32 + (i as f32 + 0.5) / n as f32) / COLUMNS as f32;
                    sum += f64::from(g(x, (j as f32 + 0.5) / (8 * n) as f32));
                }
            }
            sum / f64::from(8 * n * n)
        })
        .collect()
}

fn ln_z(g: impl Fn(f32, f32) -> f32, beta: f64) -> f64 {
    let tempered = columns(|x, y| f64::from(g(x, y)).powf(beta) as f32);
    (tempered.iter().sum::<f64>() / f64::from(COLUMNS)).ln()
}

/// Over 12 independent runs of each ladder and combination, the mean of each column is within 4.5 standard errors of
/// the truth (16 columns × 8 cases: level 10⁻³ together).
#[test]
fn images_of_every_ladder_and_combination_agree_with_the_integrals() {
    let truth = columns(peaks);
    for betas in [&[0.0, 1.0][..], &[0.0, 0.5, 1.0], &[0.0, 0.2, 0.4, 0.7, 1.0], &[0.0, 0.01, 1.0]] {
        for combination in [Combination::Target, Combination::Balance] {
            let runs: Vec<Vec<f64>> = (0..12).map(|s| run(peaks, betas, combination, 1, 900, s).image).collect();
            for (i, truth) in truth.iter().enumerate() {
                let n = runs.len() as f64;
                let mean = runs.iter().map(|r| r[i]).sum::<f64>() / n;
                let variance = runs.iter().map(|r| (r[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
                let error = (variance / n).sqrt();
                assert!(
                    (mean - truth).abs() < 4.5 * error + 0.002 * truth,
                    "{betas:?} {combination:?}, column {i}: {mean} ± {error} for {truth}"
                );
            }
        }
    }
}

#[test]
fn normalisers_of_all_rungs_agree_with_the_integrals() {
    let betas = [0.0, 0.2, 0.4, 0.7, 1.0];
    let r = run(peaks, &betas, Combination::Balance, 1, 8000, 5);
    for (beta, got) in betas.iter().zip(&r.normalisers.ln_z) {
        let exact = ln_z(peaks, *beta);
        assert!((got - exact).abs() < 0.03, "β = {beta}: {got} for {exact}");
    }
    let c = r.normalisers.target;
    assert!((c.value.ln() - ln_z(peaks, 1.0)).abs() < 4.0 * c.standard_error / c.value, "{c:?}");
    assert!((r.uniform.value.ln() - ln_z(peaks, 1.0)).abs() < 4.0 * r.uniform.standard_error / c.value);
    assert!(c.standard_error < r.uniform.standard_error, "the ladder knows more than its uniform rung");
}

#[test]
fn every_rung_has_its_share_of_states() {
    let r = run(peaks, &[0.0, 0.3, 1.0], Combination::Balance, 2, 1000, 1);
    for s in &r.statistics {
        let weights = [1, 2].map(|k| s.rungs[k].total());
        assert!((weights[0] - weights[1]).abs() < 20.0, "{weights:?}");
    }
}

#[test]
fn a_dark_target_gives_a_dark_image_and_nothing_else() {
    let r = run(|_, _| 0.0, &[0.0, 0.5, 1.0], Combination::Balance, 1, 100, 1);
    assert!(r.image.iter().all(|v| *v == 0.0));
    assert_eq!(r.normalisers.target.value, 0.0);
}

#[test]
fn a_constant_target_has_its_constant_everywhere() {
    let r = run(|_, _| 3.0, &[0.0, 0.5, 1.0], Combination::Balance, 1, 4000, 1);
    assert!((r.normalisers.target.value - 3.0).abs() < 1e-4, "{:?}", r.normalisers);
    for v in r.image {
        assert!((v - 3.0).abs() < 0.1, "{v}");
    }
}

/// What Metropolis chains make of a target.
struct Baselines {
    /// c from the first pass, and from that and all large steps.
    two_pass: f64,
    pooled: f64,
    /// Estimates of the integral over each column, times the number of columns, with the one c and the other.
    images: [Vec<f64>; 2],
}

/// The baseline as the renderer does it. The ζ of the weights is `zeta` times the first estimate of c.
fn baseline<F: Fn(f32, f32) -> f32 + Sync>(g: F, large_steps: LargeSteps, zeta: f64, seed: u64) -> Baselines {
    const BOOTSTRAP: u64 = 1 << 12;
    const CHAINS: usize = 128;
    const STEPS: u64 = 1000;
    let (target, rng) = (Analytic(g), Rng::new(seed));
    let counter = |step| Counter { ladder: 0, replica: 0, step, purpose: Purpose::Bootstrap };
    let mut first = Evaluator::<Vec<u32>>::new(rng, StepLaw::KELEMEN, (0..BOOTSTRAP).map(counter).collect());
    first.moves.fill(Move::Fresh);
    first.evaluate(&target, &Points::new(0));
    let lanes = first.out.lanes.iter().zip(0..);
    let samples: Vec<Start> = lanes.map(|(c, i)| Start { counter: counter(i), ln_g: c.ln_g }).collect();
    let first_sum: f64 = first.out.lanes.iter().map(Contribution::g).sum();
    let two_pass = first_sum / BOOTSTRAP as f64;

    let footprint = Footprint::new(Filter::Box, COLUMNS, 1);
    let mut splats = Splats::new(large_steps.layers());
    let mut recorder = Recorder { footprint: &footprint, size: [COLUMNS as f32, 1.0], splats: &mut splats };
    let starts = resample(&samples, 1.0, CHAINS, rng, 0);
    let mut chains = Baseline::new(&target, rng, 0, &starts, large_steps);
    let unit = zeta * two_pass;
    chains.advance(&target, STEPS, unit, &mut recorder);
    chains.record_pending(unit, &mut recorder);
    let film = Accumulator::new(COLUMNS, 1, large_steps.layers(), 1.0);
    film.deposit(&mut splats);

    let pooled = (first_sum + chains.large_sum) / (BOOTSTRAP + chains.large.1) as f64;
    let states = film.layer(baseline_layer::CHAINS);
    let proposals = large_steps.kelemen_weights.then(|| film.layer(baseline_layer::LARGE_STEPS));
    let samples = chains.mutations() as f64 / f64::from(COLUMNS);
    let images = [two_pass, pooled].map(|c| {
        let column = |i: usize| states[i][0] * c / unit + proposals.as_ref().map_or(0.0, |p| p[i][0]);
        (0..COLUMNS as usize).map(|i| column(i) / samples).collect()
    });
    Baselines { two_pass, pooled, images }
}

/// Over 24 independent runs of each variant, the mean of each column is within 4.7 standard errors of the truth
/// (16 columns × 14 cases, t with 23 degrees of freedom: level 0.02 together). The tolerance beside them is for the
/// truth's midpoint rule and for the O(1/N) by which pooling biases.
#[test]
fn images_of_the_baseline_in_all_its_variants_agree_with_the_integrals() {
    let truth = columns(peaks);
    for (probability, kelemen_weights, zeta) in [
        (0.1, false, 1.0),
        (0.3, false, 1.0),
        (0.6, false, 1.0),
        (0.1, true, 1.0),
        (0.3, true, 1.0),
        (0.3, true, 3.0),
        (0.6, true, 0.3),
    ] {
        let large_steps = LargeSteps { probability, kelemen_weights };
        let runs: Vec<Baselines> = (0..24).map(|seed| baseline(peaks, large_steps, zeta, seed)).collect();
        for (estimate, name) in ["two-pass", "pooled"].iter().enumerate() {
            for (i, truth) in truth.iter().enumerate() {
                let n = runs.len() as f64;
                let values = runs.iter().map(|run| run.images[estimate][i]);
                let mean = values.clone().sum::<f64>() / n;
                let error = (values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
                assert!(
                    (mean - truth).abs() < 4.7 * error + 0.002 * truth,
                    "{large_steps:?}, ζ = {zeta} c, {name}, column {i}: {mean} ± {error} for {truth}"
                );
            }
        }
    }
}

/// 4096 samples of the first pass against those and some 38,400 large steps: the variance of c falls to about a tenth,
/// that is, over 24 runs each, below a half with a probability of error under 10⁻³ (F-test).
#[test]
fn pooling_large_steps_makes_the_normalisation_more_precise() {
    let large_steps = LargeSteps { probability: 0.3, kelemen_weights: false };
    let c = libm::exp(ln_z(peaks, 1.0));
    let runs: Vec<Baselines> = (0..24).map(|seed| baseline(peaks, large_steps, 1.0, seed)).collect();
    let mean_square =
        |of: fn(&Baselines) -> f64| runs.iter().map(|run| (of(run) / c - 1.0).powi(2)).sum::<f64>() / 24.0;
    let (two_pass, pooled) = (mean_square(|run| run.two_pass), mean_square(|run| run.pooled));
    assert!(pooled < 0.5 * two_pass, "relative mean square errors {two_pass} and {pooled}");
}
