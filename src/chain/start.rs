//! States for chains to start from, resampled from independent samples.

use serde::{Deserialize, Serialize};

use super::{Evaluator, Target, Walkers};
use crate::{
    rng::{Counter, Purpose, Rng, open_unit_f64},
    sample::Move,
};

/// Where a chain starts: the counter of an independent sample to replay and the ln g that it must give again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Counter of the sample.
    pub counter: Counter,
    /// Its ln g.
    pub ln_g: f64,
}

/// `chains` of the samples, in their order, in proportion to g^β; none where all samples are dark.
///
/// Systematic resampling: sample i is taken ⌊n w_i⌋ or ⌈n w_i⌉ times, n w_i in expectation, with one random number
/// (named by `stream`). So chains start from the target distribution as well as the samples know it.
/// Source: Veach & Guibas 1997, section 5.1 (start-up bias); Douc & Cappé 2005 (systematic resampling).
pub fn resample(samples: &[Start], beta: f64, chains: usize, rng: Rng, stream: u32) -> Vec<Start> {
    let largest = samples.iter().map(|s| s.ln_g).fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return Vec::new();
    }
    let weight = |s: &Start| if s.ln_g == f64::NEG_INFINITY { 0.0 } else { libm::exp(beta * (s.ln_g - largest)) };
    let total: f64 = samples.iter().map(weight).sum();
    let counter = Counter { ladder: stream, replica: 0, step: 0, purpose: Purpose::Start };
    let offset = open_unit_f64(rng.words(counter, 0)[0]);
    let mut starts = Vec::with_capacity(chains);
    let mut cumulative = 0.0;
    for sample in samples {
        cumulative += weight(sample);
        while starts.len() < chains && (starts.len() as f64 + offset) / chains as f64 * total < cumulative {
            starts.push(*sample);
        }
    }
    // rounding may leave the last threshold above the last sum
    let last = samples.iter().rfind(|s| s.ln_g > f64::NEG_INFINITY).expect("some sample is lit");
    starts.resize(chains, *last);
    starts
}

/// Puts chains into those states by replaying the samples, stratified ones for `evaluator.film`; lanes beyond `starts`
/// are not touched.
///
/// # Panics
/// If a replayed sample does not give the same luminance: the target is not a function of its point.
pub fn replay<T: Target>(target: &T, starts: &[Start], walkers: &mut Walkers, evaluator: &mut Evaluator<T::Workspace>) {
    let counters = evaluator.counters.clone();
    evaluator.moves.fill(Move::Rest);
    for (lane, start) in starts.iter().enumerate() {
        evaluator.moves[lane] = match start.counter.purpose {
            Purpose::Stratified => Move::Stratified,
            _ => Move::Fresh,
        };
        evaluator.counters[lane] = start.counter;
    }
    evaluator.evaluate(target, &walkers.points);
    for (lane, start) in starts.iter().enumerate() {
        let replayed = evaluator.out.lanes[lane].ln_g;
        assert_eq!(replayed, start.ln_g, "replaying {:?} gave another luminance", start.counter);
        walkers.replace(lane, (&evaluator.points, lane), &evaluator.out, &mut |_, _| {});
    }
    evaluator.counters = counters;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_taken_in_proportion_to_their_tempered_luminance() {
        let sample = |step: u64, g: f64| Start {
            counter: Counter { ladder: 0, replica: 0, step, purpose: Purpose::Bootstrap },
            ln_g: g.ln(),
        };
        let samples = [sample(0, 1.0), sample(1, 0.0), sample(2, 9.0), sample(3, 4.0)];
        for (beta, shares) in
            [(1.0, [1.0 / 14.0, 0.0, 9.0 / 14.0, 4.0 / 14.0]), (0.5, [1.0 / 6.0, 0.0, 0.5, 1.0 / 3.0])]
        {
            let starts = resample(&samples, beta, 1000, Rng::new(1), 0);
            assert_eq!(starts.len(), 1000);
            for (i, share) in shares.iter().enumerate() {
                let taken = starts.iter().filter(|s| s.counter.step == i as u64).count() as f64;
                assert!((taken - 1000.0 * share).abs() <= 1.0, "sample {i} taken {taken} times at β = {beta}");
            }
        }
        assert!(resample(&[sample(0, 0.0)], 1.0, 10, Rng::new(1), 0).is_empty());
    }
}
