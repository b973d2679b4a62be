//! The baseline that knows no temperatures.

use rayon::prelude::*;
use relt::{
    chain::LargeSteps,
    film::{Filter, Footprint},
};

use crate::{
    pssmlt::{pssmlt, pssmlt_images},
    statistics::{f_test, mean, t_test},
    support::two_peaks,
};

const COLUMNS: u32 = 16;
const RUNS: u64 = 24;

/// Images of `RUNS` runs: by run, scaled by either estimate of c.
fn runs(large_steps: LargeSteps, zeta: f64) -> Vec<[Vec<f64>; 2]> {
    let run = |seed| pssmlt(&two_peaks(), COLUMNS, large_steps, [1 << 12, 1 << 16], zeta, seed);
    (0..RUNS).into_par_iter().map(run).collect()
}

/// Shape by F and brightness by t of 24 runs, 14 cases: level 10⁻³ each, 0.03 together. Beside it, 0.2 % for the
/// O(1/N) by which pooling biases.
#[test]
fn images_of_the_baseline_in_all_its_variants_agree_with_the_integrals() {
    let truth = two_peaks().columns(COLUMNS);
    let tolerance: Vec<f64> = truth.iter().map(|v| (0.002 * v).powi(2)).collect();
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
        let runs = runs(large_steps, zeta);
        for (estimate, name) in ["two-pass", "pooled"].iter().enumerate() {
            let images: Vec<Vec<f64>> = runs.iter().map(|run| run[estimate].clone()).collect();
            let (f, p_f) = f_test(&images, &truth, &tolerance);
            let brightness: Vec<f64> = images.iter().map(|image| mean(image.iter().copied())).collect();
            let c = two_peaks().c();
            let (t, p_t) = t_test(&brightness, c, (0.002 * c).powi(2));
            let case = format!("{large_steps:?}, ζ = {zeta} c, {name}");
            assert!(p_f > 5e-4 && p_t > 5e-4, "{case}: F = {f}, p = {p_f}; t = {t}, p = {p_t}; {brightness:?}");
        }
    }
}

/// 4096 samples of the first pass against those and some 18,400 large steps: the variance of c, which without Kelemen's
/// weights is the brightness of the image, falls to less than a fifth, that is, over 24 runs each, below a half with a
/// probability of error of some 0.02 (F-test).
#[test]
fn pooling_large_steps_makes_the_normalisation_more_precise() {
    let runs = runs(LargeSteps { probability: 0.3, kelemen_weights: false }, 1.0);
    let c = two_peaks().c();
    let mean_square = |of: usize| {
        mean(runs.iter().map(|run| (mean(run[of].iter().copied()) / c - 1.0).powi(2)).collect::<Vec<_>>().into_iter())
    };
    let (two_pass, pooled) = (mean_square(0), mean_square(1));
    assert!(pooled < 0.5 * two_pass, "relative mean square errors {two_pass} and {pooled}");
}

/// Chains tell by cells of the film, four by four, what the image has: its states, but for those that wait to be recorded,
/// which are a hundredth at most.
#[test]
fn chains_tell_where_on_the_film_they_are() {
    let footprint = Footprint::new(Filter::Box, COLUMNS, 1);
    let large_steps = LargeSteps { probability: 0.3, kelemen_weights: false };
    let ([image, _], whereabouts) =
        pssmlt_images(&two_peaks(), (&footprint, [COLUMNS, 1]), large_steps, [1 << 12, 1 << 18], 1.0, 0);
    let total: f64 = image.iter().map(|[grey, ..]| grey).sum();
    let means = whereabouts.means().expect("states");
    let mut shares = [0.0; 16];
    for (x, [grey, ..]) in image.iter().enumerate() {
        shares[2 * 4 + x / 4] += grey / total; // the toy lies on the line y = 1/2
    }
    assert!(shares.iter().filter(|share| **share > 0.05).count() > 1, "{shares:?}");
    for (mean, share) in means.iter().zip(shares) {
        assert!((mean - share).abs() < 0.01, "{means:?} for {shares:?}");
    }
}
