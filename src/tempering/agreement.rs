//! Whether parts of a run that went on side by side agree.

use crate::chain::Whereabouts;

/// Split R̂ of a quantity: √(1 + B/W), B the variance between the means of halves of parts, W = `within`, the quantity's
/// variance within them; of a quantity with several components both are sums over these. 1 where parts agree; NaN where
/// fewer than three means are known or nothing varies.
///
/// Source: Gelman et al. 2013, section 11.4, with as many parts as there are in the place of long chains: B is not reduced by
/// what the variance within would explain were states independent.
fn split_r_hat<const N: usize>(means: &[[f64; N]], within: f64) -> f64 {
    if !(within > 0.0 && means.len() > 2) {
        return f64::NAN;
    }
    let n = means.len() as f64;
    let between = |i: usize| {
        let mean = means.iter().map(|mean| mean[i]).sum::<f64>() / n;
        means.iter().map(|m| (m[i] - mean).powi(2)).sum::<f64>() / (n - 1.0)
    };
    (1.0 + (0..N).map(between).sum::<f64>() / within).sqrt()
}

/// How far halves of parts agree on the states that they have on the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixing {
    /// Split R̂ of ln g.
    pub r_hat_ln_g: f64,
    /// Split R̂ of where on the film states lie, in image blocks.
    pub r_hat_film: f64,
    /// Halves that were compared.
    pub halves: usize,
}

/// Nothing is known.
impl Default for Mixing {
    fn default() -> Mixing {
        Mixing { r_hat_ln_g: f64::NAN, r_hat_film: f64::NAN, halves: 0 }
    }
}

impl Mixing {
    /// Of halves with these means of ln g, a variance of ln g within them, and states that lay there.
    pub fn of(means: &[[f64; 1]], variance: f64, whereabouts: &[Whereabouts]) -> Mixing {
        let mut all = Whereabouts::default();
        whereabouts.iter().for_each(|half| all.merge(half));
        let shares: Vec<_> = whereabouts.iter().filter_map(Whereabouts::means).collect();
        Mixing {
            r_hat_ln_g: split_r_hat(means, variance),
            r_hat_film: split_r_hat(&shares, all.variance()),
            halves: means.len(),
        }
    }
}

/// Independent states that all parts together are worth: a half with N of them has a mean of variance B = W/N, so n halves
/// have n W/B = n/(R̂² − 1). NaN where R̂ is, ∞ where all means are the same.
pub fn effective_samples(split_r_hat: f64, halves: usize) -> f64 {
    halves as f64 / (split_r_hat * split_r_hat - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{Contribution, Whole};
    use crate::rng::{Counter, Purpose, Rng, open_unit_f64};
    use crate::scene::Rgb;

    /// 64 halves of 50 independent uniform numbers each are worth 3200 of them; the variance of 64 means is known to
    /// √(2/63), some 18 % (three times that is let pass). States that are all seen four times are worth a quarter.
    #[test]
    fn effective_samples_are_counted_once_however_often_they_are_seen() {
        let (rng, variance) = (Rng::new(5), 1.0 / 12.0);
        for repeats in [1u32, 4] {
            let mean = |half: u32| {
                let number = |i: u32| {
                    let step = u64::from(half * 50 + i / repeats);
                    open_unit_f64(
                        rng.words(Counter { ladder: repeats, replica: 0, step, purpose: Purpose::Primary }, 0)[0],
                    )
                };
                [(0..50).map(number).sum::<f64>() / 50.0]
            };
            let means: Vec<[f64; 1]> = (0..64).map(mean).collect();
            let worth = effective_samples(split_r_hat(&means, variance), 64) * f64::from(repeats) / 3200.0;
            assert!((worth - 1.0).abs() < 0.54, "{worth} times what they are worth, repeated {repeats} times");
        }
    }

    /// Two spots as bright as each other, at opposite corners of the film, and 64 halves that know one of them each: ln g tells
    /// nothing, image blocks that all of them are worth 64 states. (Shares of the spots vary by 1/4 each within and
    /// 64/63 of that between.)
    #[test]
    fn chains_that_never_leave_their_own_of_two_like_spots_are_told_by_where_they_are() {
        let halves: Vec<Whereabouts> = (0..64)
            .map(|half| {
                let film = if half < 32 { [0.1, 0.1] } else { [0.9, 0.9] };
                let (main, _) = Contribution::settle(film, Rgb::splat(1.0));
                let mut whereabouts = Whereabouts::default();
                (0..100).for_each(|_| whereabouts.add(Whole { main: &main, elsewhere: &[] }, 1.0));
                whereabouts
            })
            .collect();
        let mixing = Mixing::of(&[[0.0]; 64], 0.0, &halves);
        assert!(mixing.r_hat_ln_g.is_nan(), "{mixing:?}");
        let worth = effective_samples(mixing.r_hat_film, mixing.halves);
        assert!((worth - 63.0).abs() < 1e-6, "{worth}");
    }

    #[test]
    fn nothing_is_said_where_nothing_is_known() {
        assert!(split_r_hat(&[[1.0], [2.0]], 1.0).is_nan() && split_r_hat(&[[1.0]; 8], 0.0).is_nan());
        assert_eq!(split_r_hat(&[[1.0]; 8], 1.0), 1.0);
        assert_eq!(effective_samples(1.0, 8), f64::INFINITY);
        assert!(effective_samples(f64::NAN, 8).is_nan());
    }
}
