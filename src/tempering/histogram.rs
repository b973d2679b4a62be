//! Histograms of ln g.

/// Weights of states by ln g: all that the normalisers need to know of them, since every rung's density depends on
/// ln g only.
///
/// Bins are 1/64 nat wide and carry the mean of ln g within; taking all of a bin's weight at that mean misjudges
/// Σ w g^β by a factor of at most 1 + β² · (1/64)²/8 = 1.00003. The range grows as states come; ±700 nats are 90,000 bins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Histogram {
    /// Number of the first bin; bin i holds ln g ∈ [i/64, (i+1)/64).
    first: i64,
    bins: Vec<Bin>,
    /// Weight of dark states, ln g = −∞.
    dark: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bin {
    weight: f64,
    /// Σ weight · ln g.
    moment: f64,
}

const BINS_PER_NAT: f64 = 64.0;

impl Histogram {
    /// Adds a state's weight.
    #[inline(always)]
    pub fn add(&mut self, ln_g: f64, weight: f64) {
        if ln_g == f64::NEG_INFINITY {
            self.dark += weight;
            return;
        }
        let number = (ln_g * BINS_PER_NAT).floor() as i64;
        let index = number - self.first;
        if index < 0 || index >= self.bins.len() as i64 {
            self.grow(number);
        }
        let bin = &mut self.bins[(number - self.first) as usize];
        bin.weight += weight;
        bin.moment += weight * ln_g;
    }

    /// Widens the range to hold bin `number`, with room on that side so that it seldom happens.
    #[cold]
    fn grow(&mut self, number: i64) {
        const ROOM: i64 = 256;
        let (low, high) = if self.bins.is_empty() {
            (number - ROOM, number + ROOM)
        } else {
            let (first, last) = (self.first, self.first + self.bins.len() as i64 - 1);
            (if number < first { number - ROOM } else { first }, if number > last { number + ROOM } else { last })
        };
        let mut bins = vec![Bin::default(); (high - low + 1) as usize];
        for (i, bin) in self.bins.iter().enumerate() {
            bins[(self.first - low) as usize + i] = *bin;
        }
        (self.first, self.bins) = (low, bins);
    }

    /// Adds `factor` times all of another histogram's weights.
    pub fn merge(&mut self, other: &Histogram, factor: f64) {
        self.dark += factor * other.dark;
        for (i, bin) in other.bins.iter().enumerate().filter(|(_, b)| b.weight > 0.0) {
            let number = other.first + i as i64;
            if number < self.first || number >= self.first + self.bins.len() as i64 {
                self.grow(number);
            }
            let mine = &mut self.bins[(number - self.first) as usize];
            mine.weight += factor * bin.weight;
            mine.moment += factor * bin.moment;
        }
    }

    /// The occupied bins: mean of ln g and weight.
    pub fn lit(&self) -> impl Iterator<Item = (f64, f64)> {
        self.bins.iter().filter(|b| b.weight > 0.0).map(|b| (b.moment / b.weight, b.weight))
    }

    /// Weight of dark states.
    pub fn dark(&self) -> f64 {
        self.dark
    }

    /// Weight of all states.
    pub fn total(&self) -> f64 {
        self.dark + self.bins.iter().map(|b| b.weight).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_powers_come_out_within_the_stated_error() {
        let values: Vec<f64> = (0..10_000).map(|i| -700.0 + f64::from(i) * 0.1377).collect();
        let mut h = Histogram::default();
        values.iter().for_each(|&v| h.add(v, 0.5));
        for beta in [0.1, 1.0] {
            let exact: f64 = values.iter().map(|v| 0.5 * (beta * (v - 677.0)).exp()).sum();
            let got: f64 = h.lit().map(|(v, w)| w * (beta * (v - 677.0)).exp()).sum();
            assert!((got / exact - 1.0).abs() < 3.1e-5, "{got} for {exact}");
        }
    }

    #[test]
    fn merging_equals_adding() {
        let (mut a, mut b, mut all) = (Histogram::default(), Histogram::default(), Histogram::default());
        for i in 0..1000 {
            let v = f64::from(i).sin() * 30.0;
            if i % 3 == 0 { &mut a } else { &mut b }.add(v, 1.0);
            all.add(v, 1.0);
        }
        a.add(f64::NEG_INFINITY, 2.0);
        all.add(f64::NEG_INFINITY, 2.0);
        b.merge(&a, 1.0);
        assert_eq!((b.total(), b.dark()), (all.total(), 2.0));
        for ((v, w), (v2, w2)) in b.lit().zip(all.lit()) {
            assert!((v - v2).abs() < 1e-12 && w == w2);
        }
    }
}
