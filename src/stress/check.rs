//! One number against what it should be.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::render::progress::significant;
use crate::study::statistics::numbers::standard_deviation;

/// Probability that chance alone fails a statistical check: so small that a suite of a thousand of them fails by chance
/// once in a thousand times.
pub const LEVEL: f64 = 1e-6;
/// Rounding that any image is allowed, by its values: some hundred operations in `f32` along a path, each with a relative
/// error of 2⁻²⁴ at most, and rays that start off their surfaces by 2⁻¹⁵ of the scene, by which solid angles differ twice.
pub const ROUNDING: f64 = 128.0 / (1 << 24) as f64 + 2.0 / (1 << 15) as f64;

/// How a number is to compare with the expected one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Relation {
    /// Within the tolerance.
    About,
    /// At most as large.
    AtMost,
    /// At least as large.
    AtLeast,
}

/// What is to be thought of a check; the worse, the greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// As it should be.
    Pass,
    /// Within a tolerance that is too wide to tell.
    TooNoisy,
    /// Not as it should be.
    Fail,
}

impl Verdict {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Pass => "pass",
            Verdict::TooNoisy => "too noisy",
            Verdict::Fail => "FAIL",
        }
    }
}

/// One number against what it should be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// What the number is.
    pub quantity: String,
    /// How it is to compare with the expected one.
    pub relation: Relation,
    /// What it should be.
    pub expected: f64,
    /// What it is.
    pub got: f64,
    /// How far it may be from what it should be.
    pub tolerance: f64,
    /// What is to be thought of it.
    pub verdict: Verdict,
}

impl Check {
    /// A number that should be `expected` within `tolerance`.
    pub fn about(quantity: impl Into<String>, expected: f64, got: f64, tolerance: f64) -> Check {
        // a NaN anywhere is a failure
        let verdict =
            if (got - expected).abs() <= tolerance || got == expected { Verdict::Pass } else { Verdict::Fail };
        Check { quantity: quantity.into(), relation: Relation::About, expected, got, tolerance, verdict }
    }

    /// A number that should be exactly `expected`.
    pub fn exactly(quantity: impl Into<String>, expected: f64, got: f64) -> Check {
        Check::about(quantity, expected, got, 0.0)
    }

    /// A number of things that are wrong, which should be none.
    pub fn none(quantity: impl Into<String>, got: usize) -> Check {
        Check::exactly(quantity, 0.0, got as f64)
    }

    /// Something that should hold: 1 where it does.
    pub fn holds(quantity: impl Into<String>, holds: bool) -> Check {
        Check::exactly(quantity, 1.0, f64::from(u8::from(holds)))
    }

    /// A number that should be `limit` at most.
    pub fn at_most(quantity: impl Into<String>, limit: f64, got: f64) -> Check {
        let verdict = if got <= limit { Verdict::Pass } else { Verdict::Fail };
        Check { quantity: quantity.into(), relation: Relation::AtMost, expected: limit, got, tolerance: 0.0, verdict }
    }

    /// A number that should be `limit` at least.
    pub fn at_least(quantity: impl Into<String>, limit: f64, got: f64) -> Check {
        let verdict = if got >= limit { Verdict::Pass } else { Verdict::Fail };
        Check { quantity: quantity.into(), relation: Relation::AtLeast, expected: limit, got, tolerance: 0.0, verdict }
    }

    /// The mean of independent values, which should be `expected`: within Student's t for [`LEVEL`] (two-sided) times the
    /// standard error, plus `rounding` times what is expected. A tolerance of more than `precision` times that tells
    /// nothing.
    pub fn mean(quantity: impl Into<String>, values: &[f64], expected: f64, rounding: f64, precision: f64) -> Check {
        let mean = mean(values);
        let noise = quantile(values.len() as f64 - 1.0) * standard_error(values);
        Check::about(quantity, expected, mean, noise + rounding * expected.abs()).unless_wider(precision)
    }

    /// The means of two sets of independent values, which should be the same: within Student's t for [`LEVEL`] times the
    /// standard error of their difference, with degrees of freedom by Welch (1947).
    pub fn same(quantity: impl Into<String>, values: &[f64], others: &[f64], rounding: f64, precision: f64) -> Check {
        let (a, b) = (standard_error(values).powi(2), standard_error(others).powi(2));
        let own_freedom = |v: f64, n: usize| v * v / (n as f64 - 1.0);
        let freedom = (a + b).powi(2) / (own_freedom(a, values.len()) + own_freedom(b, others.len()));
        let noise = if a + b > 0.0 { quantile(freedom) * (a + b).sqrt() } else { 0.0 };
        let expected = mean(others);
        Check::about(quantity, expected, mean(values), noise + rounding * expected.abs()).unless_wider(precision)
    }

    /// The same of one of several scenes.
    pub fn of(self, scene: &str) -> Check {
        Check { quantity: format!("{scene}: {}", self.quantity), ..self }
    }

    /// The same, but too noisy where the tolerance is wider than `precision` times what is expected.
    fn unless_wider(mut self, precision: f64) -> Check {
        if self.verdict == Verdict::Pass && self.tolerance > precision * self.expected.abs() {
            self.verdict = Verdict::TooNoisy;
        }
        self
    }

    /// How much of its tolerance the check takes; above 1 where it fails, infinite where there is no tolerance.
    pub fn strain(&self) -> f64 {
        let off = match self.relation {
            Relation::About => (self.got - self.expected).abs(),
            Relation::AtMost => return if self.got <= self.expected { 0.0 } else { f64::INFINITY },
            Relation::AtLeast => return if self.got >= self.expected { 0.0 } else { f64::INFINITY },
        };
        match off / self.tolerance {
            _ if off == 0.0 => 0.0,
            strain if strain.is_nan() => f64::INFINITY,
            strain => strain,
        }
    }

    /// What it should be, such as `≤ 3`.
    pub fn expected_in_words(&self) -> String {
        let sign = match self.relation {
            Relation::About => "",
            Relation::AtMost => "≤ ",
            Relation::AtLeast => "≥ ",
        };
        format!("{sign}{}", number(self.expected))
    }
}

/// A number with as many digits as a table needs.
pub fn number(value: f64) -> String {
    if value == value.trunc() && value.abs() < 1e6 { format!("{value}") } else { significant(value, 6) }
}

/// Mean of some numbers.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard error of their mean if they are independent.
fn standard_error(values: &[f64]) -> f64 {
    standard_deviation(values).unwrap_or(f64::INFINITY) / (values.len() as f64).sqrt()
}

/// |t| that Student's t exceeds with probability [`LEVEL`].
fn quantile(freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |student| student.inverse_cdf(1.0 - 0.5 * LEVEL))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_passes_by_being_none() {
        assert_eq!(Check::about("x", 1.0, f64::NAN, 1.0).verdict, Verdict::Fail);
        assert_eq!(Check::about("x", 1.0, 1.0, f64::NAN).verdict, Verdict::Pass, "equal numbers need no tolerance");
        assert_eq!(Check::at_most("x", 1.0, f64::NAN).verdict, Verdict::Fail);
        assert_eq!(Check::at_least("x", 1.0, f64::NAN).verdict, Verdict::Fail);
        assert_eq!(Check::mean("x", &[1.0, f64::NAN, 1.0], 1.0, 0.0, 1.0).verdict, Verdict::Fail);
        assert_eq!(Check::mean("x", &[1.0], 1.0, 0.0, 1.0).verdict, Verdict::TooNoisy, "one value has no error");
    }

    #[test]
    fn tolerances_are_those_of_the_level() {
        // P(|t| > x) of 3 degrees of freedom falls as 4 √3/(π x³): 10⁻⁶ at 130.2
        let values = [0.0, 0.0, 2.0, 2.0];
        let check = Check::mean("x", &values, 1.0, 0.0, 1e3);
        let error = (4.0f64 / 3.0).sqrt() / 2.0;
        assert!((check.tolerance / error - 130.2).abs() < 0.1, "{check:?}");
        let freedom = 6.0; // by Welch, of two sets of four with the same variance
        let both = Check::same("x", &values, &values, 0.0, 1e3);
        assert!((both.tolerance / (2f64.sqrt() * error) / quantile(freedom) - 1.0).abs() < 1e-9, "{both:?}");
        assert_eq!(Check::mean("x", &values, 1.0, 0.0, 1.0).verdict, Verdict::TooNoisy);
        assert_eq!(Check::mean("x", &[2.0, 2.0], 2.0 + 1e-3, 1e-3, 1.0).verdict, Verdict::Pass);
        assert_eq!(Check::mean("x", &[2.0, 2.0], 2.0 + 3e-3, 1e-3, 1.0).verdict, Verdict::Fail);
    }
}
