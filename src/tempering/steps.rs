//! Sizes of small steps: a bank of scales, and how often each rung takes which.

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

/// Probabilities of the scales on one rung.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepMix {
    weights: [f64; SCALES],
}

impl StepMix {
    /// Before anything is known: Kelemen's sizes, 1/1024 to 1/64, in equal shares (Kelemen et al. 2002).
    pub fn kelemen() -> StepMix {
        StepMix { weights: [0.0, 0.25, 0.5, 0.25, 0.0, 0.0].map(|w: f64| w.max(TRIAL)) }.normalised()
    }

    /// The mix for acceptances that were measured on a rung, from the mix that they were measured with.
    ///
    /// Scales are weighed by how close their acceptance a is to the aim of 0.45: w ∝ exp(−(logit a − logit 0.45)²/2),
    /// none below [`TRIAL`], so that all stay known. 0.45 and not the 0.234 of many independent dimensions: paths
    /// have few dimensions that matter (ALGORITHM section 2; aiming at 0.234 cost up to twice the error on toys).
    /// Scales with fewer than [`FEWEST`] steps keep their weight.
    pub fn tuned(&self, counts: &[StepCount; SCALES]) -> StepMix {
        if counts.iter().all(|count| count.proposed < FEWEST) {
            return *self;
        }
        let logit = |p: f64| libm::log(p / (1.0 - p));
        let weights = std::array::from_fn(|i| {
            if counts[i].proposed < FEWEST {
                return self.weights[i];
            }
            let a = counts[i].acceptance().clamp(1e-4, 1.0 - 1e-4);
            libm::exp(-0.5 * ((logit(a) - logit(std::env::var("AIM").map_or(AIM, |v| v.parse().unwrap()))) / std::env::var("SIG").map_or(1.0, |v| v.parse::<f64>().unwrap())).powi(2))
        });
        let sum: f64 = weights.iter().sum();
        StepMix { weights: weights.map(|w| (w / sum).max(TRIAL)) }.normalised()
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

/// Acceptance that scales aim at.
const AIM: f64 = 0.45;
/// Least weight of a scale, before all are scaled to sum to one.
const TRIAL: f64 = 0.01;
/// Steps from which an acceptance counts as known.
const FEWEST: u64 = 64;

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
    fn scales_near_the_aim_are_taken_most_and_none_is_forgotten() {
        let mix = StepMix::kelemen().tuned(&counts([0.99, 0.95, 0.8, 0.45, 0.1, 0.001]));
        let w = mix.weights();
        assert!(w[3] > 0.4 && w.iter().all(|w| *w <= mix.weights()[3] && *w >= 0.5 * TRIAL), "{w:?}");
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_mix_is_kept_where_nothing_was_measured() {
        assert_eq!(StepMix::kelemen().tuned(&[StepCount::default(); SCALES]), StepMix::kelemen());
    }

    #[test]
    fn scales_are_picked_as_often_as_their_weights_say() {
        let mix = StepMix::kelemen();
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
