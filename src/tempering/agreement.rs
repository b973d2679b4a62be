//! Whether parts of a run that went on side by side agree.

/// Split R̂ of a quantity: √(1 + B/W), B the variance between the means of halves of parts, W the square of `sd`, the
/// quantity's standard deviation within them. 1 where parts agree; NaN where fewer than three means are known or nothing
/// varies.
///
/// Source: Gelman et al. 2013, section 11.4, with as many parts as there are in the place of long chains: B is not reduced by
/// what the variance within would explain were states independent.
pub fn split_r_hat(means: &[f64], sd: f64) -> f64 {
    if !(sd > 0.0 && means.len() > 2) {
        return f64::NAN;
    }
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let between = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (1.0 + between / (sd * sd)).sqrt()
}

/// Independent states that all parts together are worth: a half with N of them has a mean of variance B = W/N, so n halves
/// have n W/B = n/(R̂² − 1). NaN where R̂ is, ∞ where all means are the same.
pub fn effective_samples(split_r_hat: f64, halves: usize) -> f64 {
    halves as f64 / (split_r_hat * split_r_hat - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Counter, Purpose, Rng, open_unit_f64};

    /// 64 halves of 50 independent uniform numbers each are worth 3200 of them; the variance of 64 means is known to
    /// √(2/63), some 18 % (three times that is let pass). States that are all seen four times are worth a quarter.
    #[test]
    fn effective_samples_are_counted_once_however_often_they_are_seen() {
        let (rng, sd) = (Rng::new(5), (1.0f64 / 12.0).sqrt());
        for repeats in [1u32, 4] {
            let mean = |half: u32| {
                let number = |i: u32| {
                    let step = u64::from(half * 50 + i / repeats);
                    open_unit_f64(
                        rng.words(Counter { ladder: repeats, replica: 0, step, purpose: Purpose::Primary }, 0)[0],
                    )
                };
                (0..50).map(number).sum::<f64>() / 50.0
            };
            let means: Vec<f64> = (0..64).map(mean).collect();
            let worth = effective_samples(split_r_hat(&means, sd), 64) * f64::from(repeats) / 3200.0;
            assert!((worth - 1.0).abs() < 0.54, "{worth} times what they are worth, repeated {repeats} times");
        }
    }

    #[test]
    fn nothing_is_said_where_nothing_is_known() {
        assert!(split_r_hat(&[1.0, 2.0], 1.0).is_nan() && split_r_hat(&[1.0; 8], 0.0).is_nan());
        assert_eq!(split_r_hat(&[1.0; 8], 1.0), 1.0);
        assert_eq!(effective_samples(1.0, 8), f64::INFINITY);
        assert!(effective_samples(f64::NAN, 8).is_nan());
    }
}
