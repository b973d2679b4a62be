//! Histograms of ln g.

use serde::{Deserialize, Serialize};

/// Weights of states by ln g: all that the normalisers need to know of a rung's states, since every rung's density
/// depends on ln g only.
///
/// Bins are 1/64 nat wide and carry the mean of ln g within; taking all of a bin's weight at that mean makes Σ w g^β
/// too small by a factor of at least 1 − β² · (1/64)²/8 = 1 − 3.1·10⁻⁵ (a third of that where ln g is even within the
/// bin). Darkness, ln g = −∞, has a bin of its own.
///
/// Sums are integers, so that merging gives the same bits in any order and for any split into batches: weights in steps
/// of 2⁻²⁴, moments in steps of 2⁻³⁰ nat. Each addition is rounded to the nearest step, an error of at most 3·10⁻⁸ in
/// the weight (a state counts for about 1) and of 5·10⁻¹⁰/weight nat in the mean. Sums have 128 bits: with 64, bins were
/// full at 5.5·10¹¹, which a long run reaches where g is the same nearly everywhere, and Z fell from then on.
///
/// Bins are kept in pages of one nat, made when a state comes. ±700 nats, filled, are 2.9 MB; a single absurd value is
/// one page; beyond ±16,384 nats ln g is taken as that, so the directory of pages never exceeds 256 kB.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(into = "SavedHistogram", try_from = "SavedHistogram")]
pub struct Histogram {
    /// Number of the page that `pages[0]` is; page p holds ln g ∈ [p, p + 1).
    first: i64,
    pages: Vec<Option<Box<Page>>>,
    /// Weight of lit states, in steps; kept so that asking for it costs nothing.
    lit: i128,
    /// Weight of dark states, in steps.
    dark: i128,
}

type Page = [Bin; BINS_PER_NAT as usize];

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Bin {
    /// Σ weight, in steps.
    weight: i128,
    /// Σ weight · (ln g − centre of the bin), in steps.
    moment: i128,
}

/// A page without states.
const EMPTY: Page = [Bin { weight: 0, moment: 0 }; BINS_PER_NAT as usize];
/// Bins of a nat.
pub(super) const BINS_PER_NAT: i64 = 64;
/// Steps of a weight of 1.
const WEIGHT_STEPS: f64 = (1u64 << 24) as f64;
/// Steps of a moment of 1 nat.
const MOMENT_STEPS: f64 = (1u64 << 30) as f64;
/// Magnitude of ln g beyond which it is not told apart, in nats.
const FARTHEST: f64 = 16_384.0;

/// An occupied bin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Occupied {
    /// The bin holds ln g ∈ [number/64, (number + 1)/64).
    pub number: i64,
    /// Mean of ln g.
    pub mean: f64,
    /// Weight, > 0.
    pub weight: f64,
}

impl Histogram {
    /// Adds a state's weight ≥ 0.
    #[inline(always)]
    pub fn add(&mut self, ln_g: f64, weight: f64) {
        debug_assert!(!ln_g.is_nan() && weight >= 0.0, "ln g = {ln_g}, weight {weight}");
        if ln_g == f64::NEG_INFINITY {
            self.add_dark(weight);
            return;
        }
        let steps = (weight * WEIGHT_STEPS + 0.5) as i64;
        let in_bins = ln_g.clamp(-FARTHEST, FARTHEST) * BINS_PER_NAT as f64;
        let number = floor(in_bins);
        let offset = in_bins - (number as f64 + 0.5);
        let moment = weight * offset * (MOMENT_STEPS / BINS_PER_NAT as f64);
        let page = number.div_euclid(BINS_PER_NAT);
        self.lit += i128::from(steps);
        let bin = &mut self.page(page)[number.rem_euclid(BINS_PER_NAT) as usize];
        bin.weight += i128::from(steps);
        bin.moment += i128::from((moment + 0.5f64.copysign(moment)) as i64);
    }

    /// Adds the weight of dark states, which may be taken away again: states of weights that sum to 1 only on average are
    /// lit in part, and what is left of 1 is dark, be it less than nothing.
    #[inline(always)]
    pub fn add_dark(&mut self, weight: f64) {
        self.dark += i128::from((weight * WEIGHT_STEPS + 0.5f64.copysign(weight)) as i64);
    }

    /// The page of that number, made if need be.
    #[inline(always)]
    fn page(&mut self, number: i64) -> &mut Page {
        let index = number.wrapping_sub(self.first) as usize;
        if !matches!(self.pages.get(index), Some(Some(_))) {
            self.make(number);
        }
        self.pages[(number - self.first) as usize].as_mut().expect("it was made")
    }

    #[cold]
    fn make(&mut self, number: i64) {
        if self.pages.is_empty() {
            self.first = number;
        }
        let missing = self.first - number;
        if missing > 0 {
            self.pages.splice(0..0, std::iter::repeat_n(None, missing as usize));
            self.first = number;
        }
        let index = (number - self.first) as usize;
        if index >= self.pages.len() {
            self.pages.resize(index + 1, None);
        }
        self.pages[index].get_or_insert_with(|| Box::new(EMPTY));
    }

    /// Adds all of another histogram's weights.
    pub fn merge(&mut self, other: &Histogram) {
        self.lit += other.lit;
        self.dark += other.dark;
        for (i, theirs) in other.pages.iter().enumerate() {
            let Some(theirs) = theirs.as_ref().filter(|page| ***page != EMPTY) else { continue };
            for (bin, more) in self.page(other.first + i as i64).iter_mut().zip(theirs.iter()) {
                bin.weight += more.weight;
                bin.moment += more.moment;
            }
        }
    }

    /// Adds all of another histogram's weights, which forgets them and keeps its pages for what is to come.
    pub fn take(&mut self, other: &mut Histogram) {
        self.merge(other);
        (other.lit, other.dark) = (0, 0);
        other.pages.iter_mut().flatten().for_each(|page| **page = EMPTY);
    }

    /// Numbers and sums of the occupied bins, from darkest to brightest.
    fn sums(&self) -> impl Iterator<Item = (i64, Bin)> {
        let pages = self.pages.iter().enumerate().filter_map(|(i, page)| Some((self.first + i as i64, page.as_ref()?)));
        let bins =
            pages.flat_map(|(p, page)| page.iter().enumerate().map(move |(i, b)| (p * BINS_PER_NAT + i as i64, *b)));
        bins.filter(|(_, bin)| bin.weight > 0)
    }

    /// The occupied bins, from darkest to brightest.
    pub(super) fn occupied(&self) -> impl Iterator<Item = Occupied> {
        self.sums().map(|(number, bin)| {
            let weight = bin.weight as f64 / WEIGHT_STEPS;
            // rounded moments of tiny weights could leave the bin, and with it the order of the means
            let offset = (bin.moment as f64 / MOMENT_STEPS / weight).clamp(-0.5 / 64.0, 0.5 / 64.0);
            Occupied { number, mean: (number as f64 + 0.5) / BINS_PER_NAT as f64 + offset, weight }
        })
    }

    /// The occupied bins, from darkest to brightest: mean of ln g and weight.
    pub fn lit(&self) -> impl Iterator<Item = (f64, f64)> {
        self.occupied().map(|bin| (bin.mean, bin.weight))
    }

    /// Weight of dark states.
    pub fn dark(&self) -> f64 {
        self.dark as f64 / WEIGHT_STEPS
    }

    /// Weight of all states.
    pub fn total(&self) -> f64 {
        (self.lit + self.dark) as f64 / WEIGHT_STEPS
    }

    /// Mean and standard deviation of ln g over lit states (without the spread within bins, at most 1/128 nat);
    /// `None` without any.
    pub fn mean_and_sd(&self) -> Option<(f64, f64)> {
        let weight: f64 = self.lit().map(|(_, w)| w).sum();
        let mean = self.lit().map(|(v, w)| w * v).sum::<f64>() / weight;
        let variance = self.lit().map(|(v, w)| w * (v - mean).powi(2)).sum::<f64>() / weight;
        (weight > 0.0).then_some((mean, variance.sqrt()))
    }

    /// ln Σ w g^β over lit states, for any β; −∞ without any.
    pub fn ln_sum_of_powers(&self, beta: f64) -> f64 {
        let largest = self.lit().map(|(v, _)| beta * v).fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = self.lit().map(|(v, w)| w * libm::exp(beta * v - largest)).sum();
        if sum > 0.0 { largest + libm::log(sum) } else { f64::NEG_INFINITY }
    }
}

/// A histogram as it is saved: the bins that are not empty.
#[derive(Serialize, Deserialize)]
struct SavedHistogram {
    lit: i128,
    dark: i128,
    /// Number, weight and moment.
    bins: Vec<(i64, i128, i128)>,
}

impl From<Histogram> for SavedHistogram {
    fn from(histogram: Histogram) -> SavedHistogram {
        let bins = histogram.sums().map(|(number, bin)| (number, bin.weight, bin.moment)).collect();
        SavedHistogram { lit: histogram.lit, dark: histogram.dark, bins }
    }
}

impl TryFrom<SavedHistogram> for Histogram {
    type Error = &'static str;

    fn try_from(saved: SavedHistogram) -> Result<Histogram, &'static str> {
        let mut histogram = Histogram { lit: saved.lit, dark: saved.dark, ..Histogram::default() };
        let farthest = FARTHEST as i64 * BINS_PER_NAT;
        for (number, weight, moment) in saved.bins {
            if !(-farthest..=farthest).contains(&number) || weight <= 0 {
                return Err("a bin of a histogram cannot be");
            }
            let page = histogram.page(number.div_euclid(BINS_PER_NAT));
            page[number.rem_euclid(BINS_PER_NAT) as usize] = Bin { weight, moment };
        }
        Ok(histogram)
    }
}

/// The same states in the same bins; how the pages came to be does not matter.
impl PartialEq for Histogram {
    fn eq(&self, other: &Histogram) -> bool {
        self.dark == other.dark && self.sums().eq(other.sums())
    }
}

/// ⌊x⌋ without the call that `f64::floor` is on processors without SSE 4.1.
#[inline(always)]
fn floor(x: f64) -> i64 {
    let towards_zero = x as i64;
    towards_zero - i64::from(towards_zero as f64 > x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// States with all kinds of ln g and weight.
    fn states() -> Vec<(f64, f64)> {
        (0..3000).map(|i| (f64::from(i).sin() * 700.0, f64::from(i % 97) / 96.0)).collect()
    }

    #[test]
    fn sums_of_powers_come_out_within_the_stated_error() {
        let values: Vec<f64> = (0..10_000).map(|i| -700.0 + f64::from(i) * 0.1377).collect();
        let mut h = Histogram::default();
        values.iter().for_each(|&v| h.add(v, 0.5));
        for beta in [0.1, 1.0] {
            let exact: f64 = values.iter().map(|v| 0.5 * (beta * (v - 677.0)).exp()).sum();
            let got = (h.ln_sum_of_powers(beta) - beta * 677.0).exp();
            assert!((got / exact - 1.0).abs() < 3.1e-5, "{got} for {exact}");
        }
    }

    #[test]
    fn merging_gives_the_same_bits_in_any_order_and_any_split() {
        let states = states();
        let mut all = Histogram::default();
        states.iter().for_each(|&(v, w)| all.add(v, w));
        all.add(f64::NEG_INFINITY, 0.3);
        for batches in [2, 7, 50] {
            let mut parts = vec![Histogram::default(); batches];
            states.iter().enumerate().for_each(|(i, &(v, w))| parts[i * i % batches].add(v, w));
            parts[batches / 2].add(f64::NEG_INFINITY, 0.3);
            let (mut forwards, mut backwards) = (Histogram::default(), Histogram::default());
            parts.iter().for_each(|p| forwards.merge(p));
            parts.iter().rev().for_each(|p| backwards.merge(p));
            assert_eq!(forwards, all);
            assert_eq!(backwards, all);
            assert!(forwards.lit().eq(all.lit()));
        }
    }

    #[test]
    fn a_saved_histogram_goes_on_as_the_one_that_was() {
        let mut h = Histogram::default();
        states().iter().for_each(|&(v, w)| h.add(v, w));
        h.add(f64::NEG_INFINITY, 0.3);
        let mut back: Histogram = postcard::from_bytes(&postcard::to_stdvec(&h).unwrap()).unwrap();
        states().iter().for_each(|&(v, w)| [&mut h, &mut back].into_iter().for_each(|h| h.add(v + 0.3, w)));
        assert_eq!(h, back);
        assert_eq!((h.lit, h.total()), (back.lit, back.total()));
        assert!(h.lit().eq(back.lit()));
    }

    #[test]
    fn weights_and_means_are_kept_to_the_stated_precision() {
        let states = states();
        let mut h = Histogram::default();
        states.iter().for_each(|&(v, w)| h.add(v, w));
        h.add(f64::NEG_INFINITY, 0.75);
        let exact: f64 = states.iter().map(|s| s.1).sum();
        assert!((h.total() - 0.75 - exact).abs() < 3000.0 * 3e-8);
        assert_eq!(h.dark(), 0.75);
        let mean: f64 = states.iter().map(|(v, w)| v * w).sum::<f64>() / exact;
        let sd = (states.iter().map(|(v, w)| w * (v - mean).powi(2)).sum::<f64>() / exact).sqrt();
        let (m, s) = h.mean_and_sd().expect("it is lit");
        assert!((m - mean).abs() < 1e-4 && (s - sd).abs() < 1e-4, "{m} ± {s} for {mean} ± {sd}");
        assert_eq!(Histogram::default().mean_and_sd(), None);
    }

    #[test]
    fn bins_are_ordered_and_hold_what_lies_between_their_edges() {
        let mut h = Histogram::default();
        for v in [-1.0 / 64.0, -1e-9, 0.0, 0.015, 1.0 / 64.0, -700.0, 900.25] {
            h.add(v, 1.0);
        }
        let bins: Vec<(i64, f64)> = h.occupied().map(|b| (b.number, b.weight)).collect();
        assert_eq!(bins, [(-44_800, 1.0), (-1, 2.0), (0, 2.0), (1, 1.0), (57_616, 1.0)]);
        for b in h.occupied() {
            assert!((b.number as f64..=b.number as f64 + 1.0).contains(&(b.mean * 64.0)), "{b:?}");
        }
    }

    #[test]
    fn absurd_values_need_little_memory() {
        let mut h = Histogram::default();
        for v in [1e4, -1e4, 1e300, -1e300, f64::INFINITY] {
            h.add(v, 1.0);
        }
        assert_eq!(h.total(), 5.0);
        assert_eq!(h.pages.iter().flatten().count(), 4);
        assert!(h.pages.len() <= 32_769);
    }

    #[test]
    fn bins_hold_what_no_run_will_add() {
        let mut h = Histogram::default();
        (0..64).for_each(|_| h.add(0.001, 2f64.powi(38)));
        (0..64).for_each(|_| h.add(f64::NEG_INFINITY, 2f64.powi(38)));
        for _ in 0..20 {
            let twice = h.clone();
            h.merge(&twice);
        }
        let (mean, weight) = h.lit().next().expect("it is lit");
        assert_eq!([weight, h.dark(), h.total() / 2.0], [2f64.powi(64); 3]);
        assert!((mean - 0.001).abs() < 1e-8, "{mean}");
    }
}
