//! Spreads, intervals and resampling of small sets of independent numbers.

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::rng::{Counter, Purpose, Rng};

/// Confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// Median of a set with what lies around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Median; the mean of the two in the middle for an even number.
    pub median: f64,
    /// Least of fewer than [`Spread::QUARTILES_FROM`], first quartile of more.
    pub low: f64,
    /// Greatest or third quartile, likewise.
    pub high: f64,
    /// Greatest.
    pub largest: f64,
    /// How many.
    pub count: usize,
}

impl Spread {
    /// From so many on the ends are quartiles: of fewer all may as well be shown.
    pub const QUARTILES_FROM: usize = 8;

    /// Of finite values; none of none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Spread> {
        let sorted = sorted(values);
        let ends = if sorted.len() < Spread::QUARTILES_FROM { [0.0, 1.0] } else { [0.25, 0.75] };
        Some(Spread {
            median: quantile(&sorted, 0.5)?,
            low: quantile(&sorted, ends[0])?,
            high: quantile(&sorted, ends[1])?,
            largest: *sorted.last()?,
            count: sorted.len(),
        })
    }

    /// Of positive values through their logarithms: the two in the middle give their geometric mean.
    pub fn of_logarithms(values: impl IntoIterator<Item = f64>) -> Option<Spread> {
        let spread = Spread::of(values.into_iter().map(f64::ln))?;
        Some(Spread {
            median: spread.median.exp(),
            low: spread.low.exp(),
            high: spread.high.exp(),
            largest: spread.largest.exp(),
            count: spread.count,
        })
    }

    /// What [`low`](Spread::low) and [`high`](Spread::high) are, in words.
    pub fn ends(count: usize) -> &'static str {
        if count < Spread::QUARTILES_FROM { "least to greatest" } else { "quartiles" }
    }
}

/// Finite values in ascending order.
fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Quantile of ascending values, linear between neighbours (Hyndman & Fan 1996, type 7).
fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let place = share * sorted.len().checked_sub(1)? as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(low + (high - low) * place.fract())
}

/// Median of finite values.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    quantile(&sorted(values), 0.5)
}

/// A mean that is known to an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// Half the length of the interval around it; infinite where one value alone tells nothing of its spread.
    pub half: f64,
}

impl Interval {
    /// Mean of independent values with the interval that holds the true mean with probability [`CONFIDENCE`] if they
    /// are about normal: t · s/√n with Student's t of n − 1 degrees of freedom (Student 1908). None of no value.
    pub fn of_mean(values: &[f64]) -> Option<Interval> {
        let n = values.len() as f64;
        if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let half = match standard_deviation(values) {
            Some(deviation) => student_t(values.len() - 1) * deviation / n.sqrt(),
            None => f64::INFINITY,
        };
        Some(Interval { mean: values.iter().sum::<f64>() / n, half })
    }

    /// Lower end.
    pub fn low(&self) -> f64 {
        self.mean - self.half
    }

    /// Upper end.
    pub fn high(&self) -> f64 {
        self.mean + self.half
    }

    /// Whether none of [low, high] is in it.
    pub fn misses(&self, low: f64, high: f64) -> bool {
        self.high() < low || self.low() > high
    }
}

/// √(Σ (x − x̄)²/(n − 1)); none of fewer than two.
pub fn standard_deviation(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() >= 2).then(|| (squares / (n - 1.0)).sqrt())
}

/// |t| below which Student's t of so many degrees of freedom stays with probability [`CONFIDENCE`].
fn student_t(degrees: usize) -> f64 {
    let distribution = StudentsT::new(0.0, 1.0, degrees as f64).expect("one degree of freedom at least");
    distribution.inverse_cdf(0.5 + 0.5 * CONFIDENCE)
}

/// The same of the normal distribution.
pub const NORMAL: f64 = 1.959_964;

/// Number of resamples: the ends of a 95 % interval are then its 25th of 1000, known to about a fifth of the tail.
pub const RESAMPLES: usize = 1000;

/// Draws from sets with replacement, as many as each has, and gives what `statistic` makes of them, [`RESAMPLES`] times
/// (Efron 1979). Always the same draws.
pub fn resampled<T: Clone, S>(sets: [&[T]; 2], statistic: impl Fn([&[T]; 2]) -> S) -> Vec<S> {
    let rng = Rng::new(0);
    let draw = |resample: usize, set: usize| -> Vec<T> {
        let from = sets[set];
        let word = |i: usize| {
            let counter =
                Counter { ladder: i as u32, replica: set as u16, step: resample as u64, purpose: Purpose::Bootstrap };
            rng.words(counter, 0)[0]
        };
        let place = |i: usize| ((u64::from(word(i)) * from.len() as u64) >> 32) as usize; // Lemire 2019, bias < n/2³²
        (0..from.len()).map(|i| from[place(i)].clone()).collect()
    };
    (0..RESAMPLES).map(|resample| statistic([&draw(resample, 0), &draw(resample, 1)])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_are_shown_whole_and_many_by_quartiles() {
        let few = Spread::of([3.0, 1.0, 2.0, f64::NAN]).unwrap();
        assert_eq!((few.low, few.median, few.high, few.count), (1.0, 2.0, 3.0, 3));
        let many = Spread::of((0..=8).map(f64::from)).unwrap();
        assert_eq!((many.low, many.median, many.high, many.largest), (2.0, 4.0, 6.0, 8.0));
        assert_eq!(Spread::of([]), None);
        let logarithms = Spread::of_logarithms([1.0, 4.0]).unwrap();
        assert!((logarithms.median - 2.0).abs() < 1e-12);
    }

    #[test]
    fn intervals_of_means_use_students_t() {
        // n = 5, s = √2.5: t of 4 degrees of freedom at 97.5 % is 2.776445
        let interval = Interval::of_mean(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!(interval.mean, 3.0);
        assert!((interval.half - 2.776_445 * (2.5f64 / 5.0).sqrt()).abs() < 1e-5, "{interval:?}");
        assert_eq!(Interval::of_mean(&[1.0]).unwrap().half, f64::INFINITY);
        assert!(!Interval::of_mean(&[1.0]).unwrap().misses(7.0, 8.0), "one value excludes nothing");
        assert_eq!(Interval::of_mean(&[]), None);
    }

    #[test]
    fn resamples_of_means_scatter_like_means() {
        // The standard deviation of a bootstrap mean is s·√((n − 1)/n)/√n; of 1000 resamples known to 2.2 %. Draws are
        // fixed, so the tolerance of 10 % (4.5 σ) is met always or never.
        let values: Vec<f64> = (0..50).map(f64::from).collect();
        let means = resampled([&values, &[]], |[drawn, none]| {
            assert_eq!((drawn.len(), none.len()), (50, 0));
            drawn.iter().sum::<f64>() / 50.0
        });
        let expected = standard_deviation(&values).unwrap() * (49.0f64 / 50.0).sqrt() / 50f64.sqrt();
        let found = standard_deviation(&means).unwrap();
        assert!((found / expected - 1.0).abs() < 0.1, "{found} instead of {expected}");
    }
}
