//! Ladders of all lengths, and targets of all shapes, with integrals in closed form.

use super::{
    Case, Check,
    targets::{Analytic, Run, betas, combined, ln_of, replicas, runs},
};
use crate::chain::Target;
use crate::tempering::{Choices, Combine};

/// Rounding of sums of f32 values; bins of ln g, which make Z too small by 3·10⁻⁵ at most.
const ROUNDING: f64 = 1e-4;
/// Independent runs of each case.
const RUNS: u64 = 16;

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for k in [1, 2, 4, 16, 64, 256] {
        cases.push(
            Case::new(
                format!("ladder/replicas-{k}"),
                format!("{k} replicas find c and the image of g = e^(12 y): (e¹² − 1)/12"),
                move |_| exponential(&replicas(k), 1 << if k > 16 { 20 } else { 17 }),
            )
            .quick_if([1, 4].contains(&k)),
        );
    }
    let close = [0.0, 1e-9, 2e-9, 0.5, 0.5 + 1e-9, 1.0 - 1e-9, 1.0];
    for (name, list, what) in [
        ("spacing-1e-9", &close[..], "neighbours that differ by 10⁻⁹"),
        ("first-step-0.9", &[0.0, 0.9, 1.0][..], "a first step to 0.9"),
    ] {
        let list = list.to_vec();
        cases.push(
            Case::new(
                format!("ladder/{name}"),
                format!("a ladder with {what} finds c and the image of g = e^(12 y)"),
                move |_| exponential(&betas(&list), 1 << 17),
            )
            .quick(),
        );
    }
    for s in [1400.0, -1400.0] {
        cases.push(Case::new(
            format!("ladder/span-{s}"),
            format!("ln g from −700 to 700 (slope {s}): ln c and an image of 1 are found"),
            move |_| span(s),
        ));
    }
    cases.extend([
        Case::new("ladder/one-in-a-million", "g is 10⁶ on 10⁻⁶ of the cube and 0 elsewhere: c = 1", |_| rare()),
        Case::new(
            "ladder/no-variance",
            "g = u^(−0.6), which has a mean (2.5) and no variance: the mean is met, and path tracing says that its errors \
             are not to be trusted",
            |_| heavy(),
        ),
        Case::new("ladder/variance", "g = u^(−0.3), which has a variance: nothing is said, and c = 1/0.7", |_| light()),
        Case::new("ladder/constant", "g = 1: c = 1, the image is 1 by all combinations, all swaps are accepted", |_| {
            constant()
        })
        .quick(),
        Case::new("ladder/few-mutations", "runs of 1 to 100 mutations, on ladders of up to 256 rungs, end with numbers", |_| {
            few_mutations()
        })
        .quick(),
    ]);
    cases
}

/// c and mean of the image.
fn found(name: &str, runs: &[Run], c: f64, precision: f64) -> Vec<Check> {
    let of = |value: &dyn Fn(&Run) -> f64| runs.iter().map(value).collect::<Vec<f64>>();
    vec![
        Check::mean(format!("{name}c"), &of(&|run| run.learnt.normalisers.target.value), c, ROUNDING, precision),
        Check::mean(format!("{name}mean of the image"), &of(&|run| run.mean), c, ROUNDING, precision),
        Check::none(format!("{name}values that are no numbers"), runs.iter().map(|run| run.wrong).sum()),
    ]
}

fn exponential(choices: &Choices, evaluations: u64) -> Vec<Check> {
    const SLOPE: f64 = 12.0;
    let target = Analytic(|_, [y, ..]: [f64; 3]| {
        let f = libm::exp(SLOPE * y);
        (f as f32, ln_of(f))
    });
    found("", &runs(&target, choices, evaluations, RUNS), SLOPE.exp_m1() / SLOPE, 0.3)
}

/// f is 1 and chains follow another g, as they do where an importance weighs the luminance: the image does not depend on
/// it. ln ∫ e^(−s/2 + s y) dy is |s|/2 − ln |s| but for e^−1400.
fn span(slope: f64) -> Vec<Check> {
    let target = Analytic(move |_, [y, ..]: [f64; 3]| (1.0, slope * (y - 0.5)));
    // with a quarter of that the image is known to 11 % and 13 % for either slope
    let runs = runs(&target, &replicas(12), 1 << 18, RUNS);
    let ln_c: Vec<f64> = runs.iter().map(|run| run.learnt.normalisers.target.ln_value).collect();
    let means: Vec<f64> = runs.iter().map(|run| run.mean).collect();
    vec![
        Check::mean("ln c", &ln_c, 0.5 * slope.abs() - slope.abs().ln(), ROUNDING / 700.0, 1e-3),
        Check::mean("mean of the image", &means, 1.0, ROUNDING, 0.1),
        Check::none("values that are no numbers", runs.iter().map(|run| run.wrong).sum()),
    ]
}

/// A corner of 10⁻³ by 10⁻³ of the square. Every run of 2²³ evaluations meets it some times.
fn rare() -> Vec<Check> {
    const SIDE: f64 = 1e-3;
    let target = Analytic(|_, [y, z, _]: [f64; 3]| {
        let f = if y < SIDE && z < SIDE { 1.0 / (SIDE * SIDE) } else { 0.0 };
        (f as f32, ln_of(f))
    });
    [1, 3]
        .into_iter()
        .flat_map(|k| found(&format!("K = {k}: "), &runs(&target, &replicas(k), 1 << 23, RUNS), 1.0, 2.0))
        .collect()
}

/// u^−a, with a mean of 1/(1 − a); numbers of 32 bits leave out the part 2^(−32 (1 − a)) of it.
fn power(a: f64) -> impl Target<Workspace = Vec<u32>> {
    Analytic(move |_, [y, ..]: [f64; 3]| {
        let f = libm::pow(y, -a);
        (f as f32, ln_of(f))
    })
}

/// Runs of which the report says that errors are not to be trusted.
fn distrusted(runs: &[Run]) -> usize {
    runs.iter().filter(|run| run.learnt.warnings().iter().any(|warning| warning.contains("no variance"))).count()
}

fn heavy() -> Vec<Check> {
    let target = power(0.6);
    let path = runs(&target, &replicas(1), 1 << 20, RUNS);
    let mut checks = vec![
        Check::at_least("runs of path tracing that say so, of 16", RUNS as f64 - 1.0, distrusted(&path) as f64),
        // the index is known to 2 % from 3072 values
        Check::about(
            "tail index",
            0.6,
            path[0].learnt.tail.map_or(f64::NAN, |tail| tail.index),
            5.0 * 0.6 / 3072f64.sqrt(),
        ),
    ];
    // what chains add is bounded, so that the mean of runs has a variance
    checks.extend(found("K = 4: ", &runs(&target, &replicas(4), 1 << 18, RUNS), 2.5, 0.3));
    checks
}

fn light() -> Vec<Check> {
    let target = power(0.3);
    let path = runs(&target, &replicas(1), 1 << 20, RUNS);
    let mut checks = found("", &path, 1.0 / 0.7, 0.1);
    checks.push(Check::none("runs that distrust their errors, of 16", distrusted(&path)));
    checks
}

fn constant() -> Vec<Check> {
    let target = Analytic(|_, _: [f64; 3]| (1.0, ln_of(1.0)));
    let mut checks = Vec::new();
    for combine in Combine::ALL {
        let runs = runs(&target, &combined(&replicas(4), combine), 1 << 16, 4);
        let off = |value: f64| (value - 1.0).abs();
        let most = |value: &dyn Fn(&Run) -> f64| runs.iter().map(|run| off(value(run))).fold(0.0, f64::max);
        checks.push(Check::at_most(
            format!("error of c, {}", combine.name()),
            ROUNDING,
            most(&|run| run.learnt.normalisers.target.value),
        ));
        // pixels of chains' own images vary with how often chains were there; their mean does not
        checks.push(Check::at_most(
            format!("error of the mean, {}", combine.name()),
            bound(combine),
            most(&|run| run.mean),
        ));
        let rejections = runs.iter().flat_map(|run| &run.reports).flat_map(|report| &report.rejection);
        checks.push(Check::at_most(
            format!("rejection of swaps, {}", combine.name()),
            1e-5,
            rejections.copied().fold(0.0, |most: f64, r| if r.is_nan() { most } else { most.max(r) }),
        ));
    }
    checks
}

/// By how much the mean of an image of a constant may be off. The paper's combinations of two noisy images are biased by
/// about the noise of a pixel, some thousands of states of correlated chains: 5 %.
fn bound(combine: Combine) -> f64 {
    match combine {
        Combine::Balance | Combine::Target | Combine::Uniform => ROUNDING,
        Combine::Max | Combine::Power | Combine::Median | Combine::MedianPrinted => 0.05,
    }
}

fn few_mutations() -> Vec<Check> {
    let target = Analytic(|x: f32, [y, ..]: [f64; 3]| {
        let f = if x < 0.5 { libm::exp(12.0 * y) } else { 0.0 };
        (f as f32, ln_of(f))
    });
    let mut checks = Vec::new();
    for k in [1, 2, 16, 256] {
        for evaluations in [1, 4, 100] {
            let runs = runs(&target, &replicas(k), evaluations, 2);
            let wrong = runs.iter().map(|run| run.wrong + usize::from(!run.learnt.luminance.value.is_finite())).sum();
            checks.push(Check::none(format!("values that are no numbers, K = {k}, {evaluations} mutations"), wrong));
        }
    }
    checks
}
