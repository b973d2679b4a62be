//! Stepping stones: the normaliser of the target as a product of ratios of neighbouring rungs.

use super::{Estimate, Histogram, estimate::jackknife};

/// c = Π_k Z(β_{k+1})/Z(β_k), the paper's product over the function sequence, each ratio from the states of its two
/// rungs alone; `groups` have one histogram per rung, entry 0 that of uniform points.
///
/// The paper takes E_k[g^{β_{k+1} − β_k}] from the hotter rung. Where rungs are far apart that depends on few states,
/// and the reverse, 1/E_{k+1}[g^{−(β_{k+1} − β_k)}], on the darkest few, often without a variance. We take
/// Bennett's acceptance ratio (1976), which uses both rungs and of all such estimates has the least variance for
/// independent states; where rungs are close it is the mean of the two in logarithms. (Root mean square error of ln c,
/// g = e^{8x}, 1,600 independent states a rung, 400 runs, as hotter / reverse / mean of both / Bennett: K = 2 0.045,
/// 0.166, 0.084, 0.033; K = 5 0.0204, 0.0250, 0.0202, 0.0197.) Consistent; bias O(1/N).
///
/// The standard error is a jackknife over the groups, to first order. Rungs without states are stepped over; without a
/// state on the target rung there is no estimate, nor without a lit uniform point: [`Estimate::ZERO`].
///
/// # Panics
/// If `betas` are not as many as the histograms of each group.
pub fn stepping_stones(betas: &[f64], groups: &[&[Histogram]]) -> Estimate {
    assert!(groups.iter().all(|g| g.len() == betas.len()), "one histogram per rung and group");
    let pooled = pool(betas.len(), groups);
    let used: Vec<usize> = (0..betas.len()).filter(|&k| pooled[k].lit().next().is_some()).collect();
    if used.first() != Some(&0) || used.last() != Some(&(betas.len() - 1)) {
        return Estimate::ZERO;
    }
    let mut ln_c = 0.0;
    let mut influences = vec![0.0; groups.len()];
    for pair in used.windows(2) {
        let [hotter, colder] = [pair[0], pair[1]];
        let stone = Stone::new(betas[colder] - betas[hotter], &pooled[hotter], &pooled[colder]);
        ln_c += stone.ln_ratio;
        for (influence, group) in influences.iter_mut().zip(groups) {
            *influence += stone.influence(&group[hotter], &group[colder]);
        }
    }
    if betas.len() == 1 {
        return super::uniform_mean(groups);
    }
    Estimate::from_ln(ln_c, jackknife(&influences))
}

/// One histogram per rung from those of all groups.
pub(super) fn pool(rungs: usize, groups: &[&[Histogram]]) -> Vec<Histogram> {
    let mut pooled = vec![Histogram::default(); rungs];
    for group in groups {
        pooled.iter_mut().zip(group.iter()).for_each(|(all, one)| all.merge(one));
    }
    pooled
}

/// Bennett's estimate of the ratio of two neighbours' normalisers.
///
/// p(ℓ) = 1/(1 + (N_h/N_c) e^{x − Δβ ℓ}) is the probability that a state with ln g = ℓ is of the colder rung, when
/// x = ln Z_c/Z_h; over the states of both rungs it must sum to N_c.
pub(super) struct Stone {
    /// x.
    pub ln_ratio: f64,
    delta: f64,
    /// Weights of the hotter and the colder rung.
    counts: [f64; 2],
    /// −dΣp/dx = Σ p (1 − p).
    slope: f64,
}

impl Stone {
    /// Solves for the ratio; both rungs must have lit states.
    pub fn new(delta: f64, hotter: &Histogram, colder: &Histogram) -> Stone {
        let counts = [hotter.total(), colder.total()];
        let mut stone = Stone { ln_ratio: 0.0, delta, counts, slope: 0.0 };
        let bins: Vec<(f64, f64)> = hotter.lit().chain(colder.lit()).collect();
        // whatever the states, Σp is nearly N_c or the number of all lit states far below the darkest, 0 far above the
        // brightest; 750 nats are beyond any ratio of weights
        let [darkest, brightest] =
            bins.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], (v, _)| [a.min(*v), b.max(*v)]);
        let [mut low, mut high] = [delta * darkest - 750.0, delta * brightest + 750.0];
        let forward = hotter.ln_sum_of_powers(delta) - libm::log(counts[0]);
        let backward = lit_share_ln(hotter) - colder.ln_sum_of_powers(-delta) + libm::log(counts[1]);
        stone.ln_ratio = 0.5 * (forward + backward);
        for _ in 0..200 {
            let (excess, slope) = stone.excess(bins.iter().copied());
            stone.slope = slope;
            *(if excess > 0.0 { &mut low } else { &mut high }) = stone.ln_ratio;
            let newton = stone.ln_ratio + excess / slope;
            let is_inside = low <= newton && newton <= high;
            let before = stone.ln_ratio;
            stone.ln_ratio = if is_inside { newton } else { 0.5 * (low + high) };
            // steps square: the next would be of 10⁻¹², and below rounding where the ratio is large
            if (stone.ln_ratio - before).abs() < 1e-6 {
                break;
            }
        }
        stone
    }

    /// Σ p − N_c over the states of both rungs, and the slope.
    fn excess(&self, bins: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
        let shift = libm::log(self.counts[0]) - libm::log(self.counts[1]) + self.ln_ratio;
        bins.fold((-self.counts[1], 0.0), |(sum, slope), (v, w)| {
            let p = 1.0 / (1.0 + libm::exp(shift - self.delta * v));
            (sum + w * p, slope + w * p * (1.0 - p))
        })
    }

    /// By how much a group moves ln Z_c/Z_h, to first order: what its states do to Σp, and its share of the weights.
    fn influence(&self, hotter: &Histogram, colder: &Histogram) -> f64 {
        let (sum, _) = self.excess(hotter.lit().chain(colder.lit()));
        let [n_h, n_c] = [hotter.total(), colder.total()];
        (sum + self.counts[1] - n_c) / self.slope + n_c / self.counts[1] - n_h / self.counts[0]
    }
}

/// ln of the share of states that are lit.
fn lit_share_ln(h: &Histogram) -> f64 {
    libm::log1p(-h.dark() / h.total())
}

#[cfg(test)]
mod tests {
    use super::{super::test_targets::*, *};

    #[test]
    fn two_rungs_of_a_constant_have_the_ratio_of_their_constant_and_light() {
        let (mut uniform, mut target) = (Histogram::default(), Histogram::default());
        uniform.add(f64::NEG_INFINITY, 30.0);
        uniform.add(2.0, 10.0);
        target.add(2.0, 25.0);
        let group = [uniform, target];
        let e = stepping_stones(&[0.0, 1.0], &[&group, &group]);
        assert!((e.ln_value - (2.0 - 4.0f64.ln())).abs() < 1e-9, "{e:?}");
        assert!(e.relative_error < 1e-9);
    }

    #[test]
    fn light_that_only_chains_have_met_has_no_normaliser_yet() {
        let (mut uniform, mut target) = (Histogram::default(), Histogram::default());
        uniform.add(f64::NEG_INFINITY, 30.0);
        target.add(2.0, 25.0);
        assert_eq!(stepping_stones(&[0.0, 1.0], &[&[uniform.clone(), target]]), Estimate::ZERO);
        assert_eq!(stepping_stones(&[0.0], &[&[uniform]]), Estimate::ZERO);
    }

    #[test]
    fn rungs_without_states_are_stepped_over() {
        let target = Exponential { s: 3.0, offset: 0.0 };
        let mut groups = target.groups(&[0.0, 0.5, 1.0], 4, 400, 1, 1);
        let with = stepping_stones(&[0.0, 0.5, 1.0], &slices(&groups));
        groups.iter_mut().for_each(|g| g[1] = Histogram::default());
        let without = stepping_stones(&[0.0, 0.5, 1.0], &slices(&groups));
        groups.iter_mut().for_each(|g| drop(g.remove(1)));
        assert_eq!(without, stepping_stones(&[0.0, 1.0], &slices(&groups)));
        assert_ne!(with, without);
    }

    #[test]
    fn products_reach_any_magnitude() {
        for offset in [-900.0, 0.0, 900.0] {
            let target = Exponential { s: 300.0, offset };
            let betas = [0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0];
            let e = stepping_stones(&betas, &slices(&target.groups(&betas, 16, 500, 1, 1)));
            let off = e.ln_value - target.ln_z(1.0);
            // level 6·10⁻⁵ for each offset
            assert!(off.abs() < 4.0 * e.relative_error && e.relative_error < 0.1, "off by {off}: {e:?}");
        }
    }
}
