//! The density of states, and what follows from it for any inverse temperature before a rung is there.

use super::{Histogram, Ladder, Normalisers, normalisers};

/// Mass ω_b of {x : ln g(x) in bin b} for bins of 1/64 nat, from which everything that depends on ln g alone follows at
/// any β: the rung at β holds bin b with probability π_b = ω_b e^{β v_b}/Z(β).
///
/// All is conditional on g > 0, at β = 0 too: dark points swap with nobody and need no rung. Their share is
/// 1 − [`lit_share`](Self::lit_share).
///
/// Within bins, ln g is taken as its mean: Z errs by less than 3.1·10⁻⁵ of itself, local barriers by less than 1/128.
/// Source: Ferrenberg & Swendsen 1989; Syed, Bouchard-Côté, Deligiannidis & Doucet 2021.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityOfStates {
    /// Mean ln g of each bin, rising.
    values: Vec<f64>,
    /// ln ω.
    ln_masses: Vec<f64>,
}

impl DensityOfStates {
    /// The density that the states of all rungs together show, given the ladder's normalisers. Empty as long as no
    /// uniform point met light.
    pub fn new(ladder: &Ladder, groups: &[&[Histogram]], normalisers: &Normalisers) -> DensityOfStates {
        DensityOfStates::from_masses(normalisers::ln_masses(ladder, groups, normalisers))
    }

    /// From values of ln g in rising order, each with the logarithm of its mass.
    pub(super) fn from_masses(masses: impl IntoIterator<Item = (f64, f64)>) -> DensityOfStates {
        let (values, ln_masses) = masses.into_iter().unzip();
        DensityOfStates { values, ln_masses }
    }

    /// Whether nothing is known: no light yet.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// ln Z(β), Z = ∫_{g>0} g^β, for any β; at 0 that is ln p_s. −∞ when empty.
    pub fn ln_z(&self, beta: f64) -> f64 {
        self.powers(beta).ln_sum
    }

    /// p_s, the share of uniform points that are lit.
    pub fn lit_share(&self) -> f64 {
        libm::exp(self.ln_z(0.0))
    }

    /// Mean and standard deviation of ln g on the rung at β; NaN when empty.
    pub fn mean_and_sd(&self, beta: f64) -> (f64, f64) {
        let rung = self.rung(beta);
        let mean = self.mean(&rung);
        let squares = self.values.iter().zip(&rung).map(|(v, p)| p * (v - mean).powi(2));
        if self.is_empty() { (f64::NAN, f64::NAN) } else { (mean, squares.sum::<f64>().sqrt()) }
    }

    /// Probability that independent states of the rungs at `a` and `b` do *not* swap, a ≤ b:
    /// r = 1 − E min(1, e^{(b−a)(ℓ_a − ℓ_b)}), ∈ [0, 1); 0 when empty.
    pub fn rejection(&self, a: f64, b: f64) -> f64 {
        swaps(&self.rung(a), &self.rung(b)).0
    }

    /// The local barrier λ(β) = ½ E|ℓ − ℓ′| for independent states of the rung at β, ≥ 0: the rejection of a swap with
    /// a rung at β + dβ is λ dβ.
    pub fn local_barrier(&self, beta: f64) -> f64 {
        self.local_barrier_of(&self.rung(beta))
    }

    /// The global barrier Λ = ∫₀¹ λ dβ, the sum of rejections along a ladder of infinitely many rungs.
    pub fn barrier(&self) -> f64 {
        self.barrier_curve().last().map_or(0.0, |point| point.1)
    }

    /// β and Λ(β) = ∫₀^β λ from (0, 0) to (1, Λ), both rising, in steps of at most some 1/16 in Λ(β).
    ///
    /// Intervals are halved until the states of their ends nearly always swap. (The mean of ln g rises with β: where the
    /// ends of an interval agree, all between does, so that no jump is overlooked.)
    pub fn barrier_curve(&self) -> Vec<(f64, f64)> {
        /// Rejection between the ends of an interval.
        const FINE: f64 = 1.0 / 16.0;
        /// Difference of the trapezoid's area, far larger than Simpson's error.
        const STRAIGHT: f64 = 1e-3;
        let end = |beta: f64| {
            let rung = self.rung(beta);
            let local = self.local_barrier_of(&rung);
            (beta, rung, local)
        };
        let mut curve = vec![(0.0, 0.0)];
        let mut left = end(0.0);
        let mut to_do = vec![end(1.0)];
        while let Some(right) = to_do.pop() {
            let width = right.0 - left.0;
            let middle = end(left.0 + 0.5 * width);
            // Simpson's rule
            let area = width * (left.2 + 4.0 * middle.2 + right.2) / 6.0;
            let is_bent = (area - 0.5 * width * (left.2 + right.2)).abs() > STRAIGHT;
            if (is_bent || swaps(&left.1, &right.1).0 > FINE) && width > 4.0 * Ladder::CLOSEST {
                to_do.extend([right, middle]);
                continue;
            }
            curve.push((right.0, curve[curve.len() - 1].1 + area));
            left = right;
        }
        curve
    }

    /// Predicted acceptance of swaps between neighbours, hottest pair first, 1 − r, for states that are lit: of uniform
    /// points only [`lit_share`](Self::lit_share) are.
    pub fn acceptances(&self, betas: &[f64]) -> Vec<f64> {
        let rungs: Vec<Vec<f64>> = betas.iter().map(|beta| self.rung(*beta)).collect();
        rungs.windows(2).map(|pair| swaps(&pair[0], &pair[1]).1).collect()
    }

    /// Predicted round trips per sweep of each replica's position on the ladder, 1/(2 + 2 Σ r/(1 − r)), when neighbours
    /// swap by even–odd parity and every sweep forgets the state before (Syed et al. 2021); an upper bound
    /// in practice. Light is taken for granted as everywhere here; 0 where a pair never swaps.
    pub fn round_trip_rate(&self, betas: &[f64]) -> f64 {
        let odds: f64 = self.acceptances(betas).iter().map(|accepted| 1.0 / accepted - 1.0).sum();
        1.0 / (2.0 + 2.0 * odds)
    }

    /// π_b of the rung at β, Σ = 1.
    pub(super) fn rung(&self, beta: f64) -> Vec<f64> {
        let Powers { mut relative, sum, .. } = self.powers(beta);
        relative.iter_mut().for_each(|p| *p /= sum);
        relative
    }

    fn powers(&self, beta: f64) -> Powers {
        let mut relative: Vec<f64> = self.values.iter().zip(&self.ln_masses).map(|(v, m)| beta * v + m).collect();
        let largest = relative.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        relative.iter_mut().for_each(|p| *p = libm::exp(*p - largest));
        let sum: f64 = relative.iter().sum();
        Powers { relative, sum, ln_sum: if sum > 0.0 { largest + libm::log(sum) } else { f64::NEG_INFINITY } }
    }

    fn mean(&self, rung: &[f64]) -> f64 {
        self.values.iter().zip(rung).map(|(v, p)| v * p).sum()
    }

    /// Σ_{i>j} π_i π_j (v_i − v_j), which is ½ E|ℓ − ℓ′|.
    fn local_barrier_of(&self, rung: &[f64]) -> f64 {
        // from the mean, so that nothing large cancels
        let mean = self.mean(rung);
        let (mut below, mut moment_below, mut sum) = (0.0, 0.0, 0.0);
        for (v, p) in self.values.iter().zip(rung) {
            let v = v - mean;
            sum += p * (v * below - moment_below);
            below += p;
            moment_below += p * v;
        }
        sum.max(0.0)
    }
}

/// ω_b e^{β v_b}, relative to the largest, their sum, and the logarithm of the absolute sum.
struct Powers {
    relative: Vec<f64>,
    sum: f64,
    ln_sum: f64,
}

/// Rejection and acceptance of swaps between independent states of a hotter and a colder rung.
///
/// With i and j the bins of the hotter and the colder state: i ≥ j always swaps, and for i < j
/// π_h(i) π_c(j) e^{Δβ(v_i − v_j)} = π_h(j) π_c(i). So acceptance is Σ_i π_h(i) (π_c(i) + 2 Σ_{j<i} π_c(j)) and
/// rejection Σ_{i<j} (π_h(i) π_c(j) − π_h(j) π_c(i)); each sum keeps its precision where it is small.
pub(super) fn swaps(hotter: &[f64], colder: &[f64]) -> (f64, f64) {
    let (mut hotter_below, mut colder_below, mut accepted, mut rejected) = (0.0, 0.0, 0.0, 0.0);
    for (h, c) in hotter.iter().zip(colder) {
        accepted += h * (c + 2.0 * colder_below);
        rejected += c * hotter_below - h * colder_below;
        hotter_below += h;
        colder_below += c;
    }
    (rejected.clamp(0.0, 1.0), accepted.min(1.0))
}

#[cfg(test)]
mod tests {
    use super::{super::test_targets::*, *};

    /// g = e^{s x}, x uniform on [0, 1].
    fn exponential(s: f64) -> DensityOfStates {
        let n = 20_000;
        DensityOfStates::from_masses((0..n).map(|i| (s * (f64::from(i) + 0.5) / f64::from(n), -f64::from(n).ln())))
    }

    /// ln g = −κ|x|²/2 under a standard normal x in d = 2a dimensions: −ln g ~ Gamma(a) · κ/(1 + βκ) on the rung at β.
    fn gaussian(a: f64, kappa: f64) -> DensityOfStates {
        // t = −ln g/κ in cells that are even in √t, which tames the density's pole at 0
        let n = 100_000;
        let cell = (a + 12.0 * a.sqrt() + 40.0).sqrt() / f64::from(n);
        DensityOfStates::from_masses((0..n).rev().map(|i| {
            let root = (f64::from(i) + 0.5) * cell;
            let t = root * root;
            (-kappa * t, (a - 1.0) * t.ln() - t - libm::lgamma(a) + (2.0 * root * cell).ln())
        }))
    }

    #[test]
    fn an_exponential_has_its_normalisers_barriers_and_rejections() {
        let s = 12.0;
        let target = Exponential { s, offset: 0.0 };
        let d = exponential(s);
        assert!((d.lit_share() - 1.0).abs() < 1e-9);
        for beta in [0.1, 0.5, 1.0] {
            assert!((d.ln_z(beta) - target.ln_z(beta)).abs() < 1e-6, "β = {beta}");
            // ½ E|ℓ − ℓ′| = ∫ F (1 − F) dℓ with F = (e^{βℓ} − 1)/(e^{βs} − 1)
            let t = beta * s;
            let quadrature: f64 = (0..100_000)
                .map(|i| {
                    let f = ((f64::from(i) + 0.5) / 100_000.0 * t).exp_m1() / t.exp_m1();
                    f * (1.0 - f) * s / 100_000.0
                })
                .sum();
            assert!((d.local_barrier(beta) - quadrature).abs() < 1e-6, "β = {beta}: {}", d.local_barrier(beta));
        }
        // uniform on [0, s]: ½ E|ℓ − ℓ′| = s/6, mean s/2, sd s/√12
        assert!((d.local_barrier(0.0) - s / 6.0).abs() < 1e-6);
        let (mean, sd) = d.mean_and_sd(0.0);
        assert!((mean - s / 2.0).abs() < 1e-9 && (sd - s / 12f64.sqrt()).abs() < 1e-6);
        for (a, b) in [(0.0, 0.2), (0.3, 0.5), (0.0, 1.0)] {
            let n = 2000;
            let cell = |i: usize| s * (i as f64 + 0.5) / n as f64;
            let density = |beta: f64, l: f64| (beta * l - target.ln_z(beta)).exp() / n as f64;
            let mut accepted = 0.0;
            for i in 0..n {
                for j in 0..n {
                    let (hot, cold) = (cell(i), cell(j));
                    accepted += density(a, hot) * density(b, cold) * ((b - a) * (hot - cold)).min(0.0).exp();
                }
            }
            assert!((d.rejection(a, b) - (1.0 - accepted)).abs() < 1e-5, "{a} to {b}: {}", d.rejection(a, b));
            assert!((d.rejection(a, b) + d.acceptances(&[a, b])[0] - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_gaussian_has_the_barrier_of_gamma_variates() {
        for (a, kappa) in [(0.5, 30.0), (3.0, 30.0), (50.0, 4.0)] {
            let d = gaussian(a, kappa);
            // Gini's mean difference of Gamma(a) is 2 Γ(a + ½)/(√π Γ(a)); λ = κ/(1 + βκ) half of that
            let gini = 2.0 * (libm::lgamma(a + 0.5) - libm::lgamma(a)).exp() / std::f64::consts::PI.sqrt();
            for beta in [0.0, 0.3, 1.0] {
                let scale: f64 = kappa / (1.0 + beta * kappa);
                let exact = 0.5 * gini * scale;
                assert!((d.local_barrier(beta) / exact - 1.0).abs() < 2e-3, "a = {a}, β = {beta}");
                let ln_z = -a * (beta * kappa).ln_1p();
                assert!((d.ln_z(beta) - ln_z).abs() < 5e-3, "a = {a}, β = {beta}: {} for {ln_z}", d.ln_z(beta));
                let (mean, sd) = d.mean_and_sd(beta);
                assert!((mean / (-a * scale) - 1.0).abs() < 5e-3 && (sd / (a.sqrt() * scale) - 1.0).abs() < 5e-3);
            }
            let exact = 0.5 * gini * kappa.ln_1p();
            assert!((d.barrier() / exact - 1.0).abs() < 2e-3, "a = {a}: {} for {exact}", d.barrier());
        }
    }

    #[test]
    fn rejections_of_a_fine_ladder_sum_up_to_the_barrier() {
        let d = exponential(30.0);
        let curve = d.barrier_curve();
        assert_eq!((curve[0], curve[curve.len() - 1].0), ((0.0, 0.0), 1.0));
        assert!(curve.windows(2).all(|p| p[0].0 < p[1].0 && p[0].1 <= p[1].1));
        let betas: Vec<f64> = (0..=4000).map(|i| f64::from(i) / 4000.0).collect();
        let sum: f64 = betas.windows(2).map(|p| d.rejection(p[0], p[1])).sum();
        assert!((d.barrier() - sum).abs() < 1e-4, "{} for {sum}", d.barrier());
    }

    #[test]
    fn a_jump_between_two_islands_is_not_overlooked() {
        // a dim island of nearly all mass and a bright one of e^−350: the rung moves over at β = 350/1400
        let d = DensityOfStates::from_masses([(-700.0, 0.0), (700.0, -350.0)]);
        // the two-point distribution passes p from 0 to 1: λ dβ = p (1 − p) 1400 dβ = dp
        assert!((d.barrier() - 1.0).abs() < 1e-3, "{}", d.barrier());
        assert!((d.ln_z(1.0) - 350.0).abs() < 1e-9);
    }

    #[test]
    fn a_constant_target_has_no_barrier() {
        let d = DensityOfStates::from_masses([(1.5, 0.25f64.ln())]);
        assert_eq!((d.barrier(), d.rejection(0.0, 1.0), d.local_barrier(0.5)), (0.0, 0.0, 0.0));
        assert!((d.lit_share() - 0.25).abs() < 1e-12);
        assert!((d.ln_z(1.0) - (1.5 + 0.25f64.ln())).abs() < 1e-12);
        assert_eq!(d.round_trip_rate(&[0.0, 0.5, 1.0]), 0.5);
    }

    #[test]
    fn nothing_seen_says_nothing() {
        let d = DensityOfStates::from_masses([]);
        assert!(d.is_empty());
        assert_eq!((d.ln_z(1.0), d.lit_share(), d.barrier()), (f64::NEG_INFINITY, 0.0, 0.0));
        assert!(d.mean_and_sd(1.0).0.is_nan());
    }

    #[test]
    fn round_trips_follow_the_odds_of_rejection() {
        let d = exponential(12.0);
        let betas = [0.0, 0.1, 0.4, 1.0];
        let odds: f64 = betas.windows(2).map(|p| d.rejection(p[0], p[1])).map(|r| r / (1.0 - r)).sum();
        assert!((d.round_trip_rate(&betas) - 1.0 / (2.0 + 2.0 * odds)).abs() < 1e-12);
    }

    #[test]
    fn states_of_a_ladder_show_the_density_of_their_target() {
        let target = Exponential { s: 9.0, offset: -4.0 };
        let ladder = Ladder::new(vec![0.0, 0.15, 0.5, 1.0]);
        let groups = target.groups(ladder.betas(), 16, 2000, 1, 1);
        let normalisers = Normalisers::solve(&ladder, &slices(&groups));
        let d = DensityOfStates::new(&ladder, &slices(&groups), &normalisers);
        assert!((d.lit_share() - 1.0).abs() < 1e-6);
        for (beta, ln_z) in ladder.betas().iter().zip(&normalisers.ln_z) {
            assert!((d.ln_z(*beta) - ln_z).abs() < 1e-9, "β = {beta}");
        }
        let exact = exponential(9.0);
        // 128,000 states: a per cent is some five standard errors
        assert!((d.barrier() / exact.barrier() - 1.0).abs() < 0.01, "{} for {}", d.barrier(), exact.barrier());
        assert!((d.rejection(0.2, 0.6) - exact.rejection(0.2, 0.6)).abs() < 0.01);
        assert!((d.ln_z(0.7) - target.ln_z(0.7)).abs() < 0.05);
    }
}
