//! Images of whole runs against exact integrals.

use relt::{
    chain::Measure,
    tempering::{Choices, Combine, LadderChoice},
};

use crate::{
    statistics::{f_test, mean, t_test},
    support::{Run, Square, automatic, betas, replicas, run, runs, two_peaks},
    toys::{self, Toy},
};

const COLUMNS: u32 = 16;

/// Fails if the mean of the runs' images differs from the integrals: shape by F, brightness by t, at level 2 · 10⁻⁴
/// each, beside a `tolerance` for biases O(1/N).
fn agrees(toy: &Toy, runs: &[Run], tolerance: f64, case: &str) {
    let (truth, c) = (toy.columns(COLUMNS), toy.c());
    let images: Vec<Vec<f64>> = runs.iter().map(|run| run.image.clone()).collect();
    // where the truth is 0 the image must be as well; elsewhere a share of the mean is let pass
    let room: Vec<f64> =
        truth.iter().map(|v| if *v == 0.0 { 0.0 } else { (tolerance * v.max(0.1 * c)).powi(2) }).collect();
    let (f, p_f) = f_test(&images, &truth, &room);
    let brightness: Vec<f64> = images.iter().map(|image| mean(image.iter().copied()) / c).collect();
    let (t, p_t) = t_test(&brightness, 1.0, tolerance * tolerance);
    assert!(
        p_f > 2e-4 && p_t > 2e-4,
        "{} by {case}: F = {f}, p = {p_f}; t = {t}, p = {p_t}\nimages/c {:?}\nexact {:?}\nbrightness {brightness:?}",
        toy.name,
        images.iter().map(|image| image.iter().map(|v| v / c).collect::<Vec<_>>()).collect::<Vec<_>>(),
        truth.iter().map(|v| v / c).collect::<Vec<_>>()
    );
}

/// 16 runs a case; twelve cases, level 0.005 together. Two of them follow what is wanted for a small relative error.
#[test]
fn images_of_every_ladder_agree_with_the_integrals() {
    let toy = two_peaks();
    for k in [1, 2, 3, 8] {
        agrees(&toy, &runs(&toy, &replicas(k, Combine::Balance), COLUMNS, 1 << 16, 16), 0.003, &format!("K = {k}"));
    }
    for given in [&[0.0, 1.0][..], &[0.0, 0.5, 1.0], &[0.0, 0.2, 0.4, 0.7, 1.0], &[0.0, 0.01, 1.0]] {
        agrees(&toy, &runs(&toy, &betas(given), COLUMNS, 1 << 16, 16), 0.003, &format!("{given:?}"));
    }
    for share in [0.1, 0.9] {
        let choices = Choices { uniform_share: Some(share), ..replicas(4, Combine::Balance) };
        agrees(&toy, &runs(&toy, &choices, COLUMNS, 1 << 16, 16), 0.003, &format!("a share of {share}"));
    }
    let relative = Choices { measure: Measure::Relative, ..replicas(4, Combine::Balance) };
    agrees(&toy, &runs(&toy, &relative, COLUMNS, 1 << 16, 16), 0.003, "relative error");
    agrees(&toy, &runs(&toy, &Choices::default(), COLUMNS, 1 << 16, 16), 0.003, "auto");
}

/// Long ladders, of which there are few: level 10⁻³ together. States start from 1/16 of the evaluations, resampled, and
/// have few sweeps to forget it, hence the larger tolerance.
#[test]
fn ladders_as_long_as_are_allowed_agree_with_the_integrals() {
    let toy = two_peaks();
    for (k, evaluations, n) in [(64, 1 << 17, 8), (1024, 1 << 16, 4)] {
        let runs = runs(&toy, &replicas(k, Combine::Balance), COLUMNS, evaluations, n);
        assert!(runs.iter().all(|run| run.ladder.rungs() == k as usize));
        agrees(&toy, &runs, 0.01, &format!("K = {k}"));
    }
}

/// 16 runs each, level 10⁻³ together.
#[test]
fn combinations_without_bias_agree_with_the_integrals() {
    let toy = two_peaks();
    for combine in [Combine::Target, Combine::Uniform] {
        agrees(&toy, &runs(&toy, &replicas(3, combine), COLUMNS, 1 << 16, 16), 0.003, combine.name());
    }
}

/// Light of other kinds, 16 runs of three methods each: level 0.005 together.
#[test]
fn images_of_islands_and_heavy_tails_agree_with_the_integrals() {
    for toy in [toys::smooth(), toys::dark(), toys::islands().deep(), toys::heavy()] {
        for k in [2, 6] {
            let choices = replicas(k, Combine::Balance);
            agrees(&toy, &runs(&toy, &choices, COLUMNS, 1 << 16, 16), 0.01, &format!("K = {k}"));
        }
        agrees(&toy, &runs(&toy, &Choices::default(), COLUMNS, 1 << 16, 16), 0.01, "auto");
    }
}

/// Sixteen times the evaluations are to bring a quarter of the error; less than half of it is asked for (16 runs each:
/// a true quarter fails with a probability far below 10⁻³).
#[test]
fn every_combination_is_consistent() {
    let toy = two_peaks();
    let truth = toy.columns(COLUMNS);
    for combine in Combine::ALL {
        let [few, many] = [1 << 13, 1 << 17].map(|evaluations| {
            let runs = runs(&toy, &replicas(3, combine), COLUMNS, evaluations, 16);
            let square = |run: &Run| run.image.iter().zip(&truth).map(|(x, exact)| (x - exact).powi(2)).sum::<f64>();
            mean(runs.iter().map(square)).sqrt()
        });
        assert!(many < 0.5 * few, "{}: error {few} falls to {many} only", combine.name());
    }
}

/// The larger of two estimates is too bright (64 runs, level 10⁻³), less so with more evaluations.
#[test]
fn the_bias_of_the_maximum_is_there_and_shrinks() {
    let toy = two_peaks();
    let brightness = |evaluations| -> Vec<f64> {
        let runs = runs(&toy, &replicas(2, Combine::Max), COLUMNS, evaluations, 64);
        runs.iter().map(|run| mean(run.image.iter().copied()) / toy.c()).collect()
    };
    let [few, many] = [1 << 13, 1 << 16].map(brightness);
    let (t, p) = t_test(&few, 1.0, 0.0);
    let bias = |values: &[f64]| mean(values.iter().copied()) - 1.0;
    assert!(t > 0.0 && p < 1e-3, "t = {t}, p = {p}: {few:?}");
    assert!(bias(&many) < 0.5 * bias(&few), "{} and {}", bias(&few), bias(&many));
}

#[test]
fn parts_of_all_rungs_sum_to_the_image() {
    for choices in [replicas(2, Combine::Balance), replicas(5, Combine::Balance), betas(&[0.0, 0.3, 1.0])] {
        let toy = two_peaks();
        let run = run(&toy, Choices { layers: true, ..choices }, COLUMNS, 1 << 14, 3);
        let parts: Vec<&Vec<f64>> = run.layers.iter().filter(|l| l.0.starts_with("rung")).map(|l| &l.1).collect();
        assert_eq!(parts.len(), run.ladder.rungs());
        for (i, value) in run.image.iter().enumerate() {
            let sum: f64 = parts.iter().map(|part| part[i]).sum();
            assert!((sum / value - 1.0).abs() < 1e-5, "column {i}: {sum} for {value}");
        }
    }
}

/// The layers `uniform` and `target` are the images of those combinations, but for the tuning that only the balanced
/// image has; both agree with the integrals (16 runs, level 10⁻³ together).
#[test]
fn layers_of_the_uniform_rung_and_of_the_target_agree_with_the_integrals() {
    let toy = two_peaks();
    let choices = Choices { layers: true, ..replicas(3, Combine::Balance) };
    for name in ["uniform", "target"] {
        let mut runs = runs(&toy, &choices, COLUMNS, 1 << 16, 16);
        for run in &mut runs {
            run.image = run.layers.iter().find(|layer| layer.0 == name).expect("a layer of that name").1.clone();
        }
        agrees(&toy, &runs, 0.003, name);
    }
}

#[test]
fn a_dark_target_gives_a_dark_image_and_nothing_else() {
    for ladder in [LadderChoice::Auto, LadderChoice::Replicas(3), LadderChoice::Betas(vec![0.0, 0.5, 1.0])] {
        for combine in Combine::ALL {
            let choices = Choices { ladder: ladder.clone(), combine, layers: true, ..Choices::default() };
            let run = run(&Square(|_, _| 0.0), choices, COLUMNS, 1 << 13, 1);
            assert!(run.image.iter().all(|v| *v == 0.0), "{}: {:?}", combine.name(), run.image);
            assert_eq!(run.learnt.normalisers.target.value, 0.0);
            assert!(run.learnt.warnings().is_empty());
        }
    }
}

/// Chains walk a constant at random, so that only the number of states in a column varies (ten relative standard
/// errors of 2¹⁷/16 independent points are let pass; chains are correlated).
#[test]
fn a_constant_target_has_its_constant_everywhere() {
    for ladder in [LadderChoice::Auto, LadderChoice::Replicas(2), LadderChoice::Replicas(5)] {
        let choices = Choices { ladder, ..automatic() };
        let run = run(&Square(|_, _| 3.0), choices, COLUMNS, 1 << 17, 1);
        assert!((run.learnt.normalisers.target.value - 3.0).abs() < 1e-4, "{:?}", run.learnt.normalisers);
        for v in run.image {
            assert!((v - 3.0).abs() < 3.0 * 10.0 / (f64::from(1 << 13)).sqrt(), "{v}");
        }
    }
}
