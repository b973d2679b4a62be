//! Sizes of small steps: a bank of scales, and how often each rung takes which.

use serde::{Deserialize, Serialize};

use crate::sample::StepLaw;

/// Number of scales in the bank.
pub const SCALES: usize = 6;

/// The scales, smallest first: log-uniform step sizes over a factor of four each, together 2⁻¹³ to 1/2. One scale
/// fails where a target has features of many sizes, and which is best differs from rung to rung.
pub fn bank() -> [StepLaw; SCALES] {
    std::array::from_fn(|i| {
        let [smallest, largest] = bounds(i);
        StepLaw::new(smallest, largest)
    })
}

/// Smallest and largest step of a scale, as fractions of the unit interval.
fn bounds(scale: usize) -> [f32; 2] {
    let largest = 2f32.powi(2 * (scale as i32 + 1) - 13);
    [largest / 4.0, largest]
}

/// Geometric centre of a scale's step sizes, as a fraction of the unit interval.
pub fn size(scale: usize) -> f64 {
    let [smallest, largest] = bounds(scale).map(f64::from);
    (smallest * largest).sqrt()
}

/// Steps of one scale on one rung, mergeable by addition in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepCount {
    /// Σ of acceptance probabilities in units of 2⁻²⁰, each rounded.
    accepted: u64,
    /// Steps proposed.
    pub proposed: u64,
}

impl StepCount {
    /// Counts a step that was accepted with probability `alpha`.
    #[inline(always)]
    pub fn add(&mut self, alpha: f64) {
        self.accepted += fixed(alpha);
        self.proposed += 1;
    }

    /// Mean acceptance probability; NaN without steps.
    pub fn acceptance(&self) -> f64 {
        from_fixed(self.accepted) / self.proposed as f64
    }
}

impl std::ops::AddAssign for StepCount {
    fn add_assign(&mut self, other: StepCount) {
        self.accepted += other.accepted;
        self.proposed += other.proposed;
    }
}

/// A probability in units of 2⁻²⁰: sums of integers do not depend on their order, and 2⁴⁴ of them fit.
#[inline(always)]
pub(super) fn fixed(probability: f64) -> u64 {
    (probability * 1_048_576.0 + 0.5) as u64
}

/// The inverse of [`fixed`], for sums.
pub(super) fn from_fixed(sum: u64) -> f64 {
    sum as f64 / 1_048_576.0
}

/// Probabilities of the scales on one rung: a bell of scales about a centre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepMix {
    weights: [f64; SCALES],
}

/// The centre of Kelemen's sizes, 1/1024 to 1/64, in scales.
pub const KELEMEN: f64 = 2.0;
/// Standard deviation of the bell, in scales: about a centre of 2, some three quarters of the steps have Kelemen's sizes.
const WIDTH: f64 = 0.75;
/// Least weight of a scale, before all are scaled to sum to one: so all stay known.
const TRIAL: f64 = 0.01;
/// Steps from which an acceptance counts as known.
const FEWEST: u64 = 256;

impl StepMix {
    /// Weights ∝ exp(−(i − centre)²/(2 · 0.75²)) for scale i, none below 1 %; 0 ≤ centre ≤ 5 (others count as the nearest).
    pub fn about(centre: f64) -> StepMix {
        let centre = centre.clamp(0.0, (SCALES - 1) as f64);
        let bell = |i: usize| libm::exp(-0.5 * ((i as f64 - centre) / WIDTH).powi(2));
        let sum: f64 = (0..SCALES).map(bell).sum();
        StepMix { weights: std::array::from_fn(|i| (bell(i) / sum).max(TRIAL)) }.normalised()
    }

    /// Centre on a rung with acceptances `here` that has the acceptance which `centre` has on the target, whose acceptances
    /// are `target`: hotter rungs take longer steps. `centre` itself where too little is known.
    pub fn centre_of_equal_acceptance(centre: f64, target: &[StepCount; SCALES], here: &[StepCount; SCALES]) -> f64 {
        let known = |counts: &[StepCount; SCALES]| counts.iter().all(|count| count.proposed >= FEWEST);
        if !known(target) || !known(here) {
            return centre;
        }
        let below = (centre.clamp(0.0, (SCALES - 1) as f64) as usize).min(SCALES - 2);
        let [a, b] = [below, below + 1].map(|i| target[i].acceptance());
        let wanted = a + (b - a) * (centre - below as f64);
        // acceptance falls with the scale, but for noise: the first crossing from the centre on
        for i in below..SCALES - 1 {
            let [a, b] = [i, i + 1].map(|i| here[i].acceptance());
            if b < wanted {
                let place = i as f64 + if a > wanted { (a - wanted) / (a - b) } else { 0.0 };
                return place.max(centre);
            }
        }
        (SCALES - 1) as f64
    }

    fn normalised(self) -> StepMix {
        let sum: f64 = self.weights.iter().sum();
        StepMix { weights: self.weights.map(|w| w / sum) }
    }

    /// Probability of each scale.
    pub fn weights(&self) -> &[f64; SCALES] {
        &self.weights
    }

    /// The scale for a uniform number in (0, 1).
    #[inline(always)]
    pub fn pick(&self, u: f64) -> usize {
        let mut cumulative = 0.0;
        for (scale, weight) in self.weights[..SCALES - 1].iter().enumerate() {
            cumulative += weight;
            if u < cumulative {
                return scale;
            }
        }
        SCALES - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(acceptances: [f64; SCALES]) -> [StepCount; SCALES] {
        acceptances.map(|a| {
            let mut count = StepCount::default();
            (0..1000).for_each(|_| count.add(a));
            count
        })
    }

    #[test]
    fn the_bell_has_kelemens_sizes_in_its_middle_and_forgets_no_scale() {
        let w = *StepMix::about(KELEMEN).weights();
        assert!(w[2] > 0.4 && (w[1] - w[3]).abs() < 1e-12 && w.iter().all(|w| *w > 0.5 * TRIAL), "{w:?}");
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn hotter_rungs_take_steps_of_the_same_acceptance() {
        let target = counts([0.9, 0.8, 0.6, 0.4, 0.2, 0.1]);
        let hotter = counts([0.98, 0.95, 0.9, 0.7, 0.5, 0.3]);
        assert_eq!(StepMix::centre_of_equal_acceptance(2.0, &target, &target), 2.0);
        let centre = StepMix::centre_of_equal_acceptance(2.0, &target, &hotter);
        assert!((centre - 3.5).abs() < 1e-5, "{centre}");
        let all = counts([1.0; SCALES]);
        assert_eq!(StepMix::centre_of_equal_acceptance(2.0, &target, &all), (SCALES - 1) as f64);
        assert_eq!(StepMix::centre_of_equal_acceptance(2.0, &target, &[StepCount::default(); SCALES]), 2.0);
    }

    #[test]
    fn scales_are_picked_as_often_as_their_weights_say() {
        let mix = StepMix::about(KELEMEN);
        let mut picked = [0.0; SCALES];
        for i in 0..100_000 {
            picked[mix.pick((f64::from(i) + 0.5) / 1e5)] += 1e-5;
        }
        for (p, w) in picked.iter().zip(mix.weights()) {
            assert!((p - w).abs() < 1e-4, "{picked:?}");
        }
    }

    #[test]
    fn the_bank_spans_all_sizes_without_gaps() {
        for i in 1..SCALES {
            assert_eq!(bounds(i)[0], bounds(i - 1)[1]);
        }
        assert_eq!(bounds(SCALES - 1)[1], 0.5);
        assert!((size(2) - 2f64.powi(-8)).abs() < 1e-12);
        assert_eq!(bank().len(), SCALES);
    }
}
