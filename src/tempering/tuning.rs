//! Which weights serve the image best, and how evaluations are shared out: by measured error and cost.
//!
//! Let a round have drawn N_u uniform points and N_t states of chains, and let the image be made with what a state
//! counts for, ρ, in the balance heuristic. Its error is U/N_u + T/N_t, with U the variance of what one uniform point
//! adds and T that of one state times the correlation of the chain, both summed over pixels in the measure of the
//! error. With c_u and c_t the costs of an evaluation of each kind, the error at unit cost is
//!
//! E(f) = (U/f + T/(1 − f)) (f c_u + (1 − f) c_t),
//!
//! f the share of uniform points; its least value (√(U c_u) + √(T c_t))² lies where f/(1 − f) = √(U c_t / (T c_u))
//! (Neyman's allocation). U and T are measured for each of several ρ at once, from the difference of the two halves of
//! the [`Probes`](super::Probes); ρ = 0 is path tracing, E = U c_u. Costs are counted in rays, not in seconds, so that
//! the same job makes the same choices everywhere.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::probes::{EVEN, RATIOS};
use crate::chain::Measure;

/// What a round has measured.
pub struct Measured {
    /// By ratio and probe: the two halves' Σ over uniform points, Σ over states, number of uniform points, and Σ of squares
    /// over states.
    pub probes: Vec<Vec<[[f64; 4]; 2]>>,
    /// By ratio and probe: the squares of [`Probes::sums`](super::Probes::sums).
    pub squares: Vec<Vec<[f64; 3]>>,
    /// Number of pixels of the film.
    pub pixels: f64,
    /// States of chains in the round, all tempered rungs.
    pub states: f64,
    /// What a half's Σ over states is multiplied by to be an image: pixels · Ẑ_K/unit over its samples a rung.
    pub tempered_scale: f64,
    /// (standard error/value)² of Ẑ_K.
    pub normaliser_variance: f64,
    /// The error to make small.
    pub measure: Measure,
    /// Mean luminance of the image.
    pub mean: f64,
    /// Cost of an evaluation on the uniform rung and on the others.
    pub cost: [f64; 2],
}

/// What serves best.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// ρ; 0 for path tracing.
    pub ratio: f64,
    /// Share of evaluations that are uniform points.
    pub share: f64,
    /// Error at unit cost over that of path tracing.
    pub relative_error: f64,
}

/// U and T by ratio, as one round or several have measured them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Variances([[f64; 2]; RATIOS.len()]);

impl Variances {
    /// Geometric means over rounds, each with the weight beside it; of values that a round has not measured (0) those of the others.
    ///
    /// Both are sums of squares that a few bright paths decide, and a chain that is stuck for a part of one round is a hundred
    /// times as much as all others: means would be those of the worst round.
    pub fn pooled(rounds: &[(f64, Variances)]) -> Variances {
        let mean = |ratio: usize, of: usize| {
            let known = rounds.iter().map(|(weight, round)| (weight, round.0[ratio][of])).filter(|(_, v)| *v > 0.0);
            let (sum, all) =
                known.fold((0.0, 0.0), |(sum, all), (weight, v)| (sum + weight * libm::log(v), all + weight));
            if all == 0.0 { 0.0 } else { libm::exp(sum / all) }
        };
        Variances(std::array::from_fn(|ratio| [0, 1].map(|of| mean(ratio, of))))
    }

    /// The best choice within the shares that are free, where an evaluation on the uniform rung and on the others costs
    /// `cost`; path tracing where chains do not promise to be better by far. Where nothing was measured uniform points get the
    /// share `unmeasured`.
    pub fn choose(&self, [cost_u, cost_t]: [f64; 2], shares: &RangeInclusive<f64>, unmeasured: f64) -> Choice {
        let path = self.0[0][0] * cost_u;
        let most = *shares.end();
        if path == 0.0 {
            // no noise at all, as of a constant, or too few points to see any: nothing to choose by
            return Choice { ratio: RATIOS[RATIOS.len() - 2], share: most.min(unmeasured), relative_error: 1.0 };
        }
        let error = if most >= 1.0 { PROMISE } else { f64::INFINITY };
        let mut best = Choice { ratio: 0.0, share: 1.0, relative_error: error };
        for (ratio, [u, t]) in RATIOS.into_iter().zip(self.0).skip(1) {
            let odds = ((u * cost_t) / (t * cost_u)).sqrt();
            // all the variance on one side gives no odds
            let share = if odds.is_finite() { odds / (1.0 + odds) } else { most };
            let share = share.min(most.min(MOST_WITH_CHAINS)).max(*shares.start());
            let error = (u / share + t / (1.0 - share)) * (share * cost_u + (1.0 - share) * cost_t) / path;
            if error < best.relative_error {
                best = Choice { ratio, share, relative_error: error };
            }
        }
        best
    }
}

impl Measured {
    /// U and T for every ratio.
    pub fn variances(&self) -> Variances {
        let importances = self.importances();
        Variances(std::array::from_fn(|ratio| self.variances_with(ratio, &importances)))
    }

    /// The noise of one trial's states, weighed most evenly, up to a factor that is the same for all trials: Σ over
    /// probes of the difference of the halves. (Not of its square, which a few bright probes decide: trials of the same
    /// steps differed by a factor of two.)
    pub fn noise(&self, probes: &[[f64; 2]]) -> f64 {
        let importances = self.importances();
        probes.iter().zip(&importances).map(|([a, b], importance)| importance.sqrt() * (a - b).abs()).sum()
    }

    /// Variance of what a uniform point adds to its pixel as path tracing has it, in the measure of the error, where pixels
    /// have enough points to tell.
    pub fn noise_of_points(&self) -> Option<f64> {
        let (mut sum, mut seen) = (0.0, 0.0);
        for ((halves, squares), importance) in self.probes[0].iter().zip(&self.squares[0]).zip(self.importances()) {
            let points = halves[0][2] + halves[1][2];
            if points >= 2.0 {
                let mean = (halves[0][0] + halves[1][0]) / points;
                sum += importance * (squares[0] - points * mean * mean).max(0.0) / (points - 1.0);
                seen += 1.0;
            }
        }
        (seen > 0.0).then(|| sum / seen)
    }

    /// How many states of chains are worth one independent one, for the image: the variance of what they add by that of
    /// as many independent ones, Σ (A − B)²/Σ w x² over probes, with x what a state of expected weight w adds.
    pub fn correlation(&self) -> Option<f64> {
        let (mut between, mut independent) = (0.0, 0.0);
        for (halves, importance) in self.probes[EVEN].iter().zip(self.importances()) {
            between += importance * (halves[0][1] - halves[1][1]).powi(2);
            independent += importance * (halves[0][3] + halves[1][3]);
        }
        (independent > 0.0).then(|| between / independent)
    }

    /// How much the variance of each probe counts.
    ///
    /// The luminance is that of the most evenly weighed image, whose samples are all bounded, and its median over
    /// neighbours: were a probe's own value to count, a sample that is much too bright would excuse itself.
    fn importances(&self) -> Vec<f64> {
        // not known, NaN, where no uniform point fell
        let luminance =
            |[a, b]: &[[f64; 4]; 2]| (a[0] + b[0]) / (a[2] + b[2]) + 0.5 * (a[1] + b[1]) * self.tempered_scale;
        let luminances: Vec<f64> = self.probes[EVEN].iter().map(luminance).collect();
        let reach = NEIGHBOURS / 2;
        (0..luminances.len())
            .map(|i| {
                let near = &luminances[i.saturating_sub(reach)..(i + reach + 1).min(luminances.len())];
                let mut near: Vec<f64> = near.iter().copied().filter(|l| !l.is_nan()).collect();
                near.sort_by(f64::total_cmp);
                let median = near.get(near.len() / 2).copied().unwrap_or(self.mean);
                self.measure.weight(median, self.mean)
            })
            .collect()
    }

    /// Images of the two halves of a probe: from uniform points, and from states.
    fn parts(&self, halves: &[[f64; 4]; 2]) -> [[f64; 2]; 2] {
        [
            halves.map(|[uniform, _, points, _]| uniform / points),
            halves.map(|[_, states, ..]| states * self.tempered_scale),
        ]
    }

    /// How much larger the mean square of what a uniform point adds is than uniform points alone have shown: chains find
    /// the rare bright points that decide it. 1 where they show nothing new.
    fn unseen(&self, i: usize, importances: &[f64]) -> f64 {
        let (mut alone, mut together) = (0.0, 0.0);
        for ((squares, halves), importance) in self.squares[i].iter().zip(&self.probes[i]).zip(importances) {
            let points = halves[0][2] + halves[1][2];
            if points > 0.0 {
                let [uniform, hot, tempered] = squares;
                alone += importance * uniform / points;
                together += importance * (hot / points + 0.5 * tempered * self.tempered_scale);
            }
        }
        if alone > 0.0 { (together / alone).max(1.0) } else { 1.0 }
    }

    /// U and T with the ratio number `i`.
    fn variances_with(&self, i: usize, importances: &[f64]) -> [f64; 2] {
        let [mut u, mut t, mut seen] = [0.0; 3];
        for (halves, importance) in self.probes[i].iter().zip(importances) {
            let counts = halves.map(|half| half[2]);
            if counts.contains(&0.0) {
                continue;
            }
            seen += 1.0;
            let [hot, tempered] = self.parts(halves);
            // per point: a half of n points has n times less variance
            u += importance * (hot[0] - hot[1]).powi(2) / (1.0 / counts[0] + 1.0 / counts[1]);
            let spread = (tempered[0] - tempered[1]).powi(2) / 4.0;
            let mean = 0.5 * (tempered[0] + tempered[1]);
            t += importance * (spread + self.normaliser_variance * mean * mean) * self.states;
        }
        if seen == 0.0 { [0.0; 2] } else { [u * self.pixels / seen * self.unseen(i, importances), t / seen] }
    }
}

/// The error, by that of path tracing, that chains must promise to be taken at all.
///
/// Rounds are short: the evenness of stratified points, which grows with their number, shows only in part, and
/// correlations of chains that are longer than a round do not show. On `cornell-box`, 1 was measured in a round of
/// 4 M evaluations where the truth at 8 M was 1.75.
const PROMISE: f64 = 0.5;
/// Chains that are to have any say get this share at least.
const MOST_WITH_CHAINS: f64 = 31.0 / 32.0;
/// Probes whose median stands for the luminance of the one in their middle.
const NEIGHBOURS: usize = 9;

#[cfg(test)]
mod tests {
    use super::*;

    /// U and T that are the same for every ρ.
    fn round(u: f64, t: f64) -> Variances {
        Variances([[u, t]; RATIOS.len()])
    }

    #[test]
    fn a_round_in_which_a_chain_was_stuck_does_not_end_the_chains() {
        // uniform points have little noise left beside chains
        let [good, stuck] = [0.004, 0.4].map(|t| {
            let mut round = round(0.01, t);
            round.0[0][0] = 1.0;
            round
        });
        let choice = |rounds: &[(f64, Variances)]| Variances::pooled(rounds).choose([1.0; 2], &(0.0..=1.0), 0.5).ratio;
        assert_eq!(choice(&[(4.0, stuck.clone())]), 0.0, "alone it would");
        assert!(choice(&[(1.0, good.clone()), (2.0, good), (4.0, stuck)]) > 0.0);
    }

    /// A round that has to see every pixel may need more uniform points than chains with any say leave.
    #[test]
    fn the_least_share_goes_before_the_most() {
        let mut round = round(0.01, 1e-6);
        round.0[0][0] = 1.0;
        for shares in [0.99..=1.0, 0.99..=0.99, 0.0..=0.5] {
            let choice = round.choose([1.0; 2], &shares, 0.5);
            assert!(choice.ratio > 0.0 && shares.contains(&choice.share), "{choice:?} of {shares:?}");
        }
    }

    #[test]
    fn rounds_that_saw_nothing_are_left_out() {
        let [u, t] = Variances::pooled(&[(1.0, round(8.0, 0.0)), (1.0, round(0.0, 9.0)), (2.0, round(1.0, 1.0))]).0[3];
        assert!((u - 2.0).abs() < 1e-12 && (t - 9f64.cbrt()).abs() < 1e-12, "{u} {t}");
        assert_eq!(Variances::pooled(&[(1.0, round(0.0, 0.0))]), round(0.0, 0.0));
    }
}
