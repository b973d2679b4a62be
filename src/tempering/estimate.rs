//! Estimates with standard errors, from independent groups of ladders.

use serde::{Deserialize, Serialize};

use super::Histogram;

/// A number ≥ 0 and the standard error of its estimate. The logarithm and the relative error are the primary ones: they
/// hold where the number itself leaves the range of f64.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The number, e^`ln_value`; ∞ or 0 beyond the range of f64.
    pub value: f64,
    /// Its standard error, `value` · `relative_error`; NaN with fewer than two groups.
    pub standard_error: f64,
    /// Its logarithm; −∞ for zero.
    pub ln_value: f64,
    /// Standard error of `value` by `value`, and of `ln_value` to first order; ∞ for zero, NaN with fewer than two groups.
    pub relative_error: f64,
}

impl Estimate {
    /// 0 ± 0: what is said as long as nothing lit has been seen.
    pub const ZERO: Estimate =
        Estimate { value: 0.0, standard_error: 0.0, ln_value: f64::NEG_INFINITY, relative_error: f64::INFINITY };

    /// The estimate e^`ln_value` · (1 ± `relative_error`).
    pub fn from_ln(ln_value: f64, relative_error: f64) -> Estimate {
        if ln_value == f64::NEG_INFINITY {
            return Estimate::ZERO;
        }
        let value = libm::exp(ln_value);
        Estimate { value, standard_error: value * relative_error, ln_value, relative_error }
    }

    /// Σ_j S_j / Σ_j N_j from the sum S ≥ 0 and the number N of samples of each independent group, with the standard
    /// error of a ratio: √(m/(m − 1) Σ_j (S_j − R N_j)²) / Σ N.
    pub fn from_sums(groups: &[(f64, f64)]) -> Estimate {
        let (sum, n) = groups.iter().fold((0.0, 0.0), |(s, n), g| (s + g.0, n + g.1));
        if sum <= 0.0 || n <= 0.0 {
            return Estimate::ZERO;
        }
        let value = sum / n;
        let m = groups.len() as f64;
        let deviations: f64 = groups.iter().map(|g| (g.0 - value * g.1).powi(2)).sum();
        let standard_error = (deviations * m / (m - 1.0)).sqrt() / n;
        Estimate { value, standard_error, ln_value: libm::log(value), relative_error: standard_error / value }
    }
}

/// c as the mean of g over the points of the uniform rung, entry 0 of each group; dark points count.
///
/// Unbiased but for the bins' means, which make it too small by at most 3.1·10⁻⁵ of itself (see [`Histogram`]). Its
/// relative variance is at least (1 − p_s)/(p_s N), where the share p_s of N points is lit.
pub fn uniform_mean(groups: &[&[Histogram]]) -> Estimate {
    let ln_sums: Vec<f64> = groups.iter().map(|group| group[0].ln_sum_of_powers(1.0)).collect();
    let largest = ln_sums.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return Estimate::ZERO;
    }
    let sums: Vec<(f64, f64)> =
        ln_sums.iter().zip(groups).map(|(ln_sum, group)| (libm::exp(ln_sum - largest), group[0].total())).collect();
    let scaled = Estimate::from_sums(&sums);
    Estimate::from_ln(largest + scaled.ln_value, scaled.relative_error)
}

/// Standard error of a sum over independent groups from each one's influence on it: √(m/(m − 1) Σ (i_j − ī)²), the
/// jackknife to first order. NaN with fewer than two groups.
pub(super) fn jackknife(influences: &[f64]) -> f64 {
    let m = influences.len() as f64;
    let mean = influences.iter().sum::<f64>() / m;
    (influences.iter().map(|i| (i - mean).powi(2)).sum::<f64>() * m / (m - 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_and_its_error_are_those_of_the_groups() {
        let e = Estimate::from_sums(&[(1.0, 2.0), (3.0, 2.0)]);
        assert_eq!(e.value, 1.0);
        // deviations ∓1, m/(m−1) = 2: √4 / 4
        assert_eq!((e.standard_error, e.relative_error), (0.5, 0.5));
        assert!(Estimate::from_sums(&[(1.0, 2.0)]).standard_error.is_nan());
    }

    #[test]
    fn the_uniform_mean_is_that_of_all_points_whatever_the_scale() {
        for scale in [0.0, 900.0, -900.0] {
            let (mut a, mut b) = (Histogram::default(), Histogram::default());
            a.add(f64::NEG_INFINITY, 1.0);
            a.add(scale + 1.0f64.ln(), 1.0);
            b.add(scale + 3.0f64.ln(), 1.0);
            b.add(f64::NEG_INFINITY, 1.0);
            let e = uniform_mean(&[&[a], &[b]]);
            assert!((e.ln_value - scale).abs() < 1e-9 && (e.relative_error - 0.5).abs() < 1e-9, "{e:?}");
        }
    }

    #[test]
    fn darkness_is_zero() {
        let mut dark = Histogram::default();
        dark.add(f64::NEG_INFINITY, 5.0);
        assert_eq!(uniform_mean(&[&[dark]]), Estimate::ZERO);
        assert_eq!(Estimate::from_sums(&[]), Estimate::ZERO);
    }
}
