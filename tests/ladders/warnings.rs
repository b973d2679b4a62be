//! A run that misses light says so, or knows how little it knows.

use statrs::distribution::{Binomial, DiscreteCDF};

use crate::{
    statistics::mean,
    support::{Run, replicas, runs},
    toys::{Shape, Toy},
};
use relt::tempering::{Choices, Combine};

/// Eight needles with six tenths of the light on a plain that does not lead to them.
fn golf() -> Toy {
    let plain = Toy::new("golf", 2, 1.0, Shape::Gaussian);
    let centre = |i: usize| [(i as f32 + 0.5) / 8.0, ((5 * i + 2) % 8) as f32 / 8.0 + 0.05];
    (0..8).fold(plain, |toy, i| toy.with(5500.0, &centre(i), &[0.0024; 2])).deep()
}

/// Runs of which c, or the brightness of the image, is off by more than three of the errors that they report, and those
/// of them that say nothing.
fn off(toy: &Toy, runs: &[Run], value: impl Fn(&Run) -> f64) -> (usize, usize) {
    let is_off = |run: &&Run| (value(run) - toy.c()).abs() > 3.0 * run.learnt.normalisers.target.standard_error;
    let off: Vec<&Run> = runs.iter().filter(is_off).collect();
    (off.len(), off.iter().filter(|run| run.learnt.warnings().is_empty()).count())
}

/// Needles that chains hardly find, met by some 20 uniform points a run: of 48 runs of each ladder, those that are off by
/// more than three errors without a warning are no more than chance admits (level 10⁻³ a ladder) if each is so with
/// probability 0.03, which few groups and skewed hits explain.
#[test]
fn no_ladder_misses_needles_in_silence() {
    const RUNS: u64 = 48;
    let toy = golf();
    let most = Binomial::new(0.03, RUNS).expect("a probability").inverse_cdf(1.0 - 1e-3);
    for choices in [2, 4].map(|k| replicas(k, Combine::Balance)).into_iter().chain([Choices::default()]) {
        let runs = runs(&toy, &choices, 16, 1 << 17, RUNS);
        let c = |run: &Run| run.learnt.normalisers.target.value;
        let image = |run: &Run| mean(run.image.iter().copied());
        for (what, (off, silent)) in [("c", off(&toy, &runs, c)), ("brightness", off(&toy, &runs, image))] {
            let values: Vec<[f64; 3]> = runs
                .iter()
                .map(|run| [c(run), image(run), run.learnt.normalisers.target.standard_error].map(|v| v / toy.c()))
                .collect();
            assert!(
                silent as u64 <= most,
                "{choices:?}: {what} is off in {off} runs, {silent} in silence (at most {most})\n\
                 c, brightness, error {values:.3?}"
            );
        }
    }
}
