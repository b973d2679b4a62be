//! Whether uniform points are so unevenly bright that the spread of what was seen says nothing of what was not.

use super::{Histogram, histogram::BINS_PER_NAT};

/// The tail of the distribution of g over uniform points: P(g > t) falls about as t^(−1/k) for the largest t.
///
/// Where k ≥ ½, E(g²) does not exist: means of g still converge, if k < 1, but slower than 1/√N and with errors that the
/// spread of any finite number of points understates.
///
/// k̂ is the mean of ln g above the m-th largest value (Hill 1975), m = min(N/5, 3 √N) as Vehtari et al. (2024) choose it,
/// with the relative standard error 1/√m. A tail counts as heavy only if it looks so near its end as well, among the m/4
/// and m/16 largest: a few points of the same great brightness among many dim ones have a large k̂ and a variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tail {
    /// k̂.
    pub index: f64,
    /// Whether k is above ½: by three standard errors among the m and the m/4 largest values, by its estimate among the
    /// m/16 largest.
    pub is_heavy: bool,
}

/// k from which on there is no variance.
const NO_VARIANCE: f64 = 0.5;
/// Values from which an index is estimated, at least.
const FEWEST: f64 = 10.0;

impl Tail {
    /// Of uniform points; `None` where too few of them are lit to tell.
    pub fn of(points: &Histogram) -> Option<Tail> {
        let total = points.total();
        let most = (total / 5.0).min(3.0 * total.sqrt());
        let bins: Vec<(f64, f64)> = points.lit().collect();
        let [all, quarter, sixteenth] = [1.0, 4.0, 16.0].map(|part| index_of_largest(&bins, most / part));
        let (index, count) = all?;
        let surely = |found: Option<(f64, f64)>| {
            found.is_some_and(|(index, count)| index * (1.0 - 3.0 / count.sqrt()) > NO_VARIANCE)
        };
        let likely = sixteenth.is_some_and(|(index, _)| index > NO_VARIANCE);
        Some(Tail { index, is_heavy: surely(Some((index, count))) && surely(quarter) && likely })
    }
}

/// k̂ of the largest values, given as bins of ln g from darkest to brightest, and of how many: those in the brightest bins
/// that hold `wanted` together.
fn index_of_largest(bins: &[(f64, f64)], wanted: f64) -> Option<(f64, f64)> {
    let mut above = 0.0;
    let mut sum = 0.0;
    for (ln_g, weight) in bins.iter().rev() {
        above += weight;
        sum += weight * ln_g;
        if above >= wanted {
            // the values begin at the lower edge of their darkest bin, not at its mean
            return (above >= FEWEST).then(|| (sum / above - ln_g + 0.5 / BINS_PER_NAT as f64, above));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of g(u), u uniform.
    fn tail(n: u32, ln_g: impl Fn(f64) -> f64) -> Option<Tail> {
        let mut histogram = Histogram::default();
        (0..n).for_each(|i| histogram.add(ln_g((f64::from(i) + 0.5) / f64::from(n)), 1.0));
        Tail::of(&histogram)
    }

    #[test]
    fn powers_have_their_exponent_as_index() {
        for k in [0.3, 0.45, 0.6, 0.8, 1.2] {
            let tail = tail(1 << 20, |u| -k * u.ln()).unwrap();
            assert!((tail.index / k - 1.0).abs() < 0.02, "{tail:?} of {k}");
            assert_eq!(tail.is_heavy, k > 0.5, "{tail:?} of {k}");
        }
    }

    #[test]
    fn what_has_a_variance_is_not_heavy() {
        let needles = |u: f64| if u < 2e-4 { 9.0 } else { 0.0 };
        let room = |u: f64| 4.0 * u;
        let dark = |u: f64| if u < 0.01 { 1.0 } else { f64::NEG_INFINITY };
        for ln_g in [needles as fn(f64) -> f64, room, dark, |_| 3.0] {
            let tail = tail(1 << 20, ln_g).unwrap();
            assert!(!tail.is_heavy, "{tail:?}");
        }
    }

    #[test]
    fn few_points_tell_nothing() {
        assert_eq!(tail(20, |u| -u.ln()), None);
        assert_eq!(tail(1 << 16, |_| f64::NEG_INFINITY), None);
        assert!(!tail(1000, |u| -0.6 * u.ln()).is_some_and(|tail| tail.is_heavy), "0.6 ± 0.06 may be 0.5");
    }
}
