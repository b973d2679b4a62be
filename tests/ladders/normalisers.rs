//! Normalisers, densities of states, and what they say of their own errors.

use statrs::distribution::{Binomial, DiscreteCDF};

use crate::{
    statistics::{mean, t_test},
    support::{Run, Square, automatic, betas, replicas, runs, two_peaks},
    toys::{self, Shape, Toy},
};
use relt::tempering::Combine;

/// ∫ f over [0, 1] by the midpoint rule with `n` cells.
fn integral(n: u32, f: impl Fn(f64) -> f64) -> f64 {
    (0..n).map(|i| f((f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() / f64::from(n)
}

/// ln Z(β) of a target of the first two primary samples, by quadrature.
fn ln_z(g: impl Fn(f32, f32) -> f32, beta: f64) -> f64 {
    integral(600, |x| integral(600, |y| f64::from(g(x as f32, y as f32)).powf(beta))).ln()
}

/// One Gaussian of width `w` in the middle of the cube: ln Z(β) = d ln ∫ e^{−β(x − ½)²/2w²} dx.
fn gaussian(dimensions: usize, w: f32) -> (Toy, impl Fn(f64) -> f64) {
    let toy = Toy::new("Gaussian", dimensions, 0.0, Shape::Gaussian);
    let toy = toy.with(1.0, &vec![0.5; dimensions], &vec![w; dimensions]);
    let of_one = move |beta: f64| integral(20_000, |x| (-0.5 * beta * ((x - 0.5) / f64::from(w)).powi(2)).exp()).ln();
    (toy, move |beta| dimensions as f64 * of_one(beta))
}

/// Two Gaussians of different height and width in the first two dimensions times one Gaussian in each of the others.
fn mixture(dimensions: usize, w: f32) -> (Toy, impl Fn(f64) -> f64) {
    let bumps = [(1.0, [0.3, 0.35], 0.12), (4.0, [0.75, 0.6], 0.05)];
    let build = |dimensions: usize| {
        bumps.iter().fold(Toy::new("mixture", dimensions, 0.0, Shape::Gaussian), |toy, (height, centre, width)| {
            let all = |first: [f32; 2], other: f32| -> Vec<f32> {
                first.into_iter().chain(std::iter::repeat(other)).take(dimensions).collect()
            };
            toy.with(*height, &all(*centre, 0.5), &all([*width; 2], w))
        })
    };
    let (flat, (_, others)) = (build(2), gaussian(dimensions.max(3) - 2, w));
    let exact = move |beta| ln_z(|x, y| flat.g(&[x, y]), beta) + if dimensions > 2 { others(beta) } else { 0.0 };
    (build(dimensions), exact)
}

/// Fails if ln Ẑ of a rung, or of a place between rungs by the density of states, differs from the exact one: t-tests
/// over the runs at level 10⁻⁴ each, beside `tolerance` for the O(1/N) by which logarithms bias.
fn agree(runs: &[Run], given: &[f64], exact: impl Fn(f64) -> f64, tolerance: f64, case: &str) {
    let check = |beta: f64, what: &str, values: Vec<f64>| {
        let exact = exact(beta);
        let (t, p) = t_test(&values, exact, tolerance * tolerance);
        assert!(p > 1e-4, "{case}, β = {beta}, {what}: t = {t}, p = {p}, exact {exact}: {values:?}");
    };
    for (k, &beta) in given.iter().enumerate().skip(1) {
        check(beta, "rung", runs.iter().map(|run| run.learnt.normalisers.ln_z[k]).collect());
    }
    for beta in [0.1, 0.35, 0.8] {
        check(beta, "density", runs.iter().map(|run| run.learnt.density.ln_z(beta)).collect());
    }
    check(1.0, "stepping stones", runs.iter().map(|run| run.learnt.stepping_stones.ln_value).collect());
    check(1.0, "uniform", runs.iter().map(|run| run.learnt.uniform.ln_value).collect());
}

const LADDER: [f64; 5] = [0.0, 0.08, 0.25, 0.55, 1.0];

/// 16 runs; six cases of nine tests: level 0.006 together.
#[test]
fn normalisers_of_gaussian_mixtures_agree_with_the_closed_form_in_2_to_20_dimensions() {
    for (dimensions, w) in [(2, 0.1), (3, 0.1), (6, 0.2)] {
        let (toy, exact) = mixture(dimensions, w);
        let runs = runs(&toy, &betas(&LADDER), 16, 1 << 16, 16);
        agree(&runs, &LADDER, exact, 0.01, &format!("mixture in {dimensions} dimensions"));
    }
    for (dimensions, w) in [(2, 0.03), (5, 0.1), (20, 0.22)] {
        let (toy, exact) = gaussian(dimensions, w);
        let runs = runs(&toy, &betas(&LADDER), 16, 1 << 16, 16);
        agree(&runs, &LADDER, exact, 0.01, &format!("Gaussian in {dimensions} dimensions"));
    }
}

/// 16 runs each, level 0.002 together.
#[test]
fn normalisers_of_islands_and_heavy_tails_agree_with_the_closed_form() {
    // four boxes of height h and area A: Z = Σ A h^β
    let boxes = [(1.0f32, 0.0016f64), (1.25, 0.00175), (0.75, 0.00175), (8.0, 0.00176)];
    let islands = Toy::new("islands", 2, 0.0, Shape::Box)
        .with(1.0, &[0.15, 0.3], &[0.02, 0.02])
        .with(1.25, &[0.4, 0.75], &[0.025, 0.0175])
        .with(0.75, &[0.62, 0.25], &[0.0175, 0.025])
        .with(8.0, &[0.85, 0.6], &[0.02, 0.022]);
    let exact = |beta: f64| boxes.iter().map(|(h, area)| area * f64::from(*h).powf(beta)).sum::<f64>().ln();
    agree(&runs(&islands, &betas(&LADDER), 16, 1 << 16, 16), &LADDER, exact, 0.01, "islands");
    // ∫ (1 + t²)^−β
    let widths = [0.1f32, 0.05, 0.08];
    let heavy = Toy::new("heavy", 3, 0.0, Shape::Cauchy).with(1.0, &[0.5, 0.3, 0.7], &widths);
    let exact = |beta: f64| {
        let of_one =
            |(m, w): (&f64, &f32)| integral(100_000, |x| (1.0 + ((x - m) / f64::from(*w)).powi(2)).powf(-beta)).ln();
        [0.5, 0.3, 0.7].iter().zip(&widths).map(of_one).sum()
    };
    agree(&runs(&heavy, &betas(&LADDER), 16, 1 << 16, 16), &LADDER, exact, 0.01, "heavy tail");
}

/// Range of ln g of the exponential target e^{s y}.
const S: f64 = 12.0;

/// The barrier Λ = ∫₀¹ λ(β) dβ, λ = ½ E|ℓ − ℓ′| = ∫ F (1 − F) dℓ with F = (e^{βℓ} − 1)/(e^{βs} − 1): t-test over 16 runs,
/// level 10⁻⁴, beside a hundredth for the bins.
#[test]
fn the_barrier_of_an_exponential_is_found() {
    let local = |beta: f64| {
        let share = |u: f64| if beta == 0.0 { u } else { (beta * S * u).exp_m1() / (beta * S).exp_m1() };
        S * integral(2000, |u| share(u) * (1.0 - share(u)))
    };
    let exact = integral(2000, local);
    let target = Square(|_: f32, y: f32| (S as f32 * y).exp());
    let runs = runs(&target, &replicas(4, Combine::Balance), 16, 1 << 16, 16);
    let barriers: Vec<f64> = runs.iter().map(|run| run.learnt.density.barrier()).collect();
    let (t, p) = t_test(&barriers, exact, 1e-4);
    assert!(p > 1e-4, "t = {t}, p = {p}, exact {exact}: {barriers:?}");
    let locals: Vec<f64> = runs.iter().map(|run| run.learnt.density.local_barrier(0.5)).collect();
    let (t, p) = t_test(&locals, local(0.5), 1e-4);
    assert!(p > 1e-4, "t = {t}, p = {p}, exact {}: {locals:?}", local(0.5));
}

/// Runs whose c is off by more than two of its own reported errors: of 200, no more than chance admits (level 10⁻³) if
/// each is off with probability 0.08, the 0.046 of a normal distribution and what few groups and skewness add.
#[test]
fn errors_that_whole_runs_report_cover_the_truth() {
    const RUNS: u64 = 200;
    let toy = two_peaks();
    let most = Binomial::new(0.08, RUNS).expect("a probability").inverse_cdf(1.0 - 1e-3);
    for choices in
        [replicas(1, Combine::Balance), replicas(2, Combine::Balance), replicas(4, Combine::Balance), automatic()]
    {
        let runs = runs(&toy, &choices, 16, 1 << 15, RUNS);
        let mbar = |run: &Run| run.learnt.normalisers.target;
        let off = |e: f64, error: f64| (e - toy.c().ln()).abs() > 2.0 * error;
        let missed = runs.iter().filter(|run| off(mbar(run).ln_value, mbar(run).relative_error)).count();
        let spread = mean(runs.iter().map(|run| (mbar(run).ln_value - toy.c().ln()).powi(2))).sqrt();
        let told = mean(runs.iter().map(|run| mbar(run).relative_error.powi(2))).sqrt();
        assert!(
            missed as u64 <= most,
            "{choices:?}: {missed} of {RUNS} off (at most {most}); sd {spread}, told {told}"
        );
    }
}

/// What the ladder adds to the knowledge of c where light has a heavy tail: over 48 runs each, errors of all rungs
/// together are less than half of the uniform rung's alone (F-test of two variances, of which the ratio is some 6: a
/// probability of error below 10⁻³).
#[test]
fn the_ladder_knows_more_of_a_heavy_tail_than_its_uniform_rung() {
    let toy = toys::heavy().deep();
    let runs = runs(&toy, &replicas(4, Combine::Balance), 16, 1 << 16, 48);
    let square = |ln_value: f64| (ln_value - toy.c().ln()).powi(2);
    let all = mean(runs.iter().map(|run| square(run.learnt.normalisers.target.ln_value)));
    let uniform = mean(runs.iter().map(|run| square(run.learnt.uniform.ln_value)));
    assert!(all < 0.5 * uniform, "mean square errors {all} and {uniform}");
}
