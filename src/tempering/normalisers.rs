//! Estimates of the ln-normalisers ln Z(β_k), Z(β) = ∫ g^β.

use super::{Estimate, Histogram, Ladder, estimate::jackknife, likelihood::Likelihood, stepping::pool, uniform_mean};

/// ln Z of every rung by MBAR (Shirts & Chodera 2008) on pooled histograms of ln g.
///
/// The Ẑ_l solve  Ẑ_l = Σ_b H_b e^{β_l v_b} / Σ_m N_m e^{β_m v_b}/Ẑ_m  with Ẑ₁ = 1; they maximise a concave
/// likelihood, whose maximum is found to 10⁻¹⁰ in ln Z. The standard error is a jackknife over independent groups, to
/// first order. Consistent; bias O(1/N), and the bins' of [`Histogram`].
///
/// States of chains are correlated, uniform points are not, so the states of tempered rungs count for a fraction of
/// their number: the one of `DISCOUNTS` that makes the standard error least. Without that, four strongly correlated
/// rungs made the estimate worse than the mean of the uniform rung alone; in the limit of a small fraction it is that
/// mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalisers {
    /// ln Ẑ_k, k from the uniform rung (0) to the target. Rungs without states have theirs from the other rungs; −∞ as
    /// long as no uniform point met light, except for the uniform rung.
    pub ln_z: Vec<f64>,
    /// Ẑ of the target, c; [`Estimate::ZERO`] as long as no uniform point met light. While there is no state on the
    /// target rung, or no such rung, it is the uniform mean.
    pub target: Estimate,
    /// What a state of a tempered rung counted for, beside a uniform point.
    pub discount: f64,
    /// How far the uniform mean and `target` are apart, in standard errors of their difference; 0 where they are the same
    /// estimate. Both share the uniform points, so that their difference is known better than either: what chains miss
    /// shows here first.
    pub disagreement: f64,
}

/// What a state of a chain may count for, beside a uniform point.
const DISCOUNTS: [f64; 5] = [1.0, 1.0 / 4.0, 1.0 / 16.0, 1.0 / 64.0, 1.0 / 256.0];
/// What it counts for where there are too few groups for an error.
const TYPICAL_DISCOUNT: f64 = DISCOUNTS[2];

impl Normalisers {
    /// Solves for the normalisers of `ladder` from what independent groups of ladders have seen: one histogram per
    /// rung, entry 0 that of uniform points, dark ones included.
    ///
    /// # Panics
    /// If a group has not one histogram per rung.
    pub fn solve(ladder: &Ladder, groups: &[&[Histogram]]) -> Normalisers {
        let rungs = ladder.rungs();
        assert!(groups.iter().all(|g| g.len() == rungs), "one histogram per rung and group");
        let (pooled, tempered) = pool_both(rungs, groups);
        let mut ln_z = vec![f64::NEG_INFINITY; rungs];
        ln_z[0] = 0.0;
        // chains may have met light where no uniform point has: then the likelihood grows for ever as Z falls
        let active = used(&pooled);
        let target = uniform_mean(groups);
        if active.is_empty() || rungs == 1 {
            return Normalisers { ln_z, target, discount: 1.0, disagreement: 0.0 };
        }
        let (x, discount, target, disagreement) = match active.len() {
            1 => (vec![0.0], 1.0, target, 0.0),
            _ => maximise(ladder, groups, &tempered, &pooled, &active, target),
        };
        active.iter().zip(&x).for_each(|(&k, x)| ln_z[k] = *x);
        if active.len() < rungs {
            let mixture = Mixture::new(ladder.betas(), &pooled, &active, &x, discount);
            let inactive = (0..rungs).filter(|k| !active.contains(k));
            inactive.for_each(|k| ln_z[k] = mixture.ln_z(ladder.betas()[k]));
        }
        Normalisers { ln_z, target, discount, disagreement }
    }
}

/// The rungs with lit states; none if the uniform rung is dark.
fn used(pooled: &[Histogram]) -> Vec<usize> {
    let is_lit = |k: &usize| pooled[*k].lit().next().is_some();
    if is_lit(&0) { (0..pooled.len()).filter(is_lit).collect() } else { Vec::new() }
}

/// One histogram per rung from those of all groups, and one of all tempered states per group; in one go, since with a
/// thousand rungs the histograms are more than caches hold.
fn pool_both(rungs: usize, groups: &[&[Histogram]]) -> (Vec<Histogram>, Vec<Histogram>) {
    let (mut by_rung, mut by_group) = (vec![Histogram::default(); rungs], vec![Histogram::default(); groups.len()]);
    for (group, tempered) in groups.iter().zip(&mut by_group) {
        for (k, histogram) in group.iter().enumerate() {
            by_rung[k].merge(histogram);
            if k > 0 {
                tempered.merge(histogram);
            }
        }
    }
    (by_rung, by_group)
}

/// ln Z of the active rungs, the discount, and c: those with the least error of c.
fn maximise(
    ladder: &Ladder,
    groups: &[&[Histogram]],
    tempered: &[Histogram],
    pooled: &[Histogram],
    active: &[usize],
    uniform: Estimate,
) -> (Vec<f64>, f64, Estimate, f64) {
    let rungs: Vec<&Histogram> = active.iter().map(|&k| &pooled[k]).collect();
    let mut likelihood = Likelihood::new(active.iter().map(|&k| ladder.betas()[k]).collect(), &rungs);
    let weights: Vec<Vec<f64>> =
        groups.iter().map(|group| active.iter().map(|&k| group[k].total()).collect()).collect();
    let reaches_target = active.last() == Some(&(ladder.rungs() - 1));
    let discounts = if groups.len() < 2 { &[TYPICAL_DISCOUNT][..] } else { &DISCOUNTS };
    let mut x = likelihood.stepping_stones(&rungs);
    let mut best: Option<(Vec<f64>, f64, f64, Vec<f64>)> = None;
    for &discount in discounts {
        let maximum = likelihood.maximise(x, discount);
        let seen = groups.iter().zip(tempered).zip(&weights).map(|((g, t), w)| (&g[0], t, w.as_slice()));
        let influences = likelihood.influences(&maximum, seen);
        let error = jackknife(&influences);
        x = maximum.x;
        if best.as_ref().is_none_or(|(_, _, least, _)| error < *least || least.is_nan()) {
            best = Some((x.clone(), discount, error, influences));
        }
    }
    let (x, discount, error, influences) = best.expect("there are discounts");
    if !reaches_target {
        return (x, discount, uniform, 0.0);
    }
    let target = Estimate::from_ln(x[x.len() - 1], error);
    (x, discount, target, disagreement(groups, &uniform, &target, &influences))
}

/// |ln ĉ − ln c̄| by its standard error, from what each group changes about the two: `influences` of ln ĉ, and
/// (S_j − c̄ N_j)/Σ S for the mean c̄ = Σ S/Σ N over uniform points.
fn disagreement(groups: &[&[Histogram]], uniform: &Estimate, target: &Estimate, influences: &[f64]) -> f64 {
    /// The bins' means make the uniform mean err by less.
    const NEGLIGIBLE: f64 = 1e-4;
    let points: f64 = groups.iter().map(|group| group[0].total()).sum();
    let differences: Vec<f64> = groups
        .iter()
        .zip(influences)
        .map(|(group, influence)| {
            let share = libm::exp(group[0].ln_sum_of_powers(1.0) - uniform.ln_value) / points;
            share - group[0].total() / points - influence
        })
        .collect();
    (target.ln_value - uniform.ln_value).abs() / jackknife(&differences).max(NEGLIGIBLE)
}

/// The mixture Σ_m N_m g^{β_m}/Ẑ_m that all states together are drawn from.
struct Mixture {
    /// Mean ln g and ln of the mass ω of {x : ln g in the bin}, H_b / Σ_m N_m e^{β_m v_b}/Ẑ_m, by ln g.
    ln_masses: Vec<(f64, f64)>,
}

impl Mixture {
    /// The mixture of the `active` rungs, whose ln Z are `x`.
    fn new(betas: &[f64], pooled: &[Histogram], active: &[usize], x: &[f64], discount: f64) -> Mixture {
        let heights: Vec<(f64, f64)> = active
            .iter()
            .zip(x)
            .map(|(&k, x)| (betas[k], libm::log(pooled[k].total() * if k == 0 { 1.0 } else { discount }) - x))
            .collect();
        let ln_density = |v: f64| {
            let exponents = || heights.iter().map(|(beta, height)| height + beta * v);
            let largest = exponents().fold(f64::NEG_INFINITY, f64::max);
            largest + libm::log(exponents().filter(|e| *e > largest - 45.0).map(|e| libm::exp(e - largest)).sum())
        };
        let mut tempered = Histogram::default();
        active[1..].iter().for_each(|&k| tempered.merge(&pooled[k]));
        let uniform = pooled[0].lit().map(|(v, w)| (v, libm::log(w) - ln_density(v)));
        let tempered = tempered.lit().map(|(v, w)| (v, libm::log(discount * w) - ln_density(v)));
        let mut ln_masses: Vec<(f64, f64)> = uniform.chain(tempered).collect();
        ln_masses.sort_by(|a, b| a.0.total_cmp(&b.0));
        Mixture { ln_masses }
    }

    /// ln Z at any β > 0.
    fn ln_z(&self, beta: f64) -> f64 {
        let largest = self.ln_masses.iter().map(|(v, m)| beta * v + m).fold(f64::NEG_INFINITY, f64::max);
        largest + libm::log(self.ln_masses.iter().map(|(v, m)| libm::exp(beta * v + m - largest)).sum())
    }
}

/// Masses of {x : ln g in a bin} by ln g: mean of ln g and ln of the mass. Empty as long as no uniform point met light.
pub(super) fn ln_masses(ladder: &Ladder, groups: &[&[Histogram]], normalisers: &Normalisers) -> Vec<(f64, f64)> {
    let pooled = pool(ladder.rungs(), groups);
    let active = used(&pooled);
    if active.is_empty() {
        return Vec::new();
    }
    let x: Vec<f64> = active.iter().map(|&k| normalisers.ln_z[k]).collect();
    Mixture::new(ladder.betas(), &pooled, &active, &x, normalisers.discount).ln_masses
}

#[cfg(test)]
mod tests {
    use super::{
        super::{stepping_stones, test_targets::*},
        *,
    };

    #[test]
    fn normalisers_of_an_exponential_agree_with_their_closed_form() {
        for s in [3.0, -40.0, 300.0] {
            let target = Exponential { s, offset: 0.0 };
            let ladder = Ladder::new(vec![0.0, 0.02, 0.1, 0.4, 1.0]);
            let n = Normalisers::solve(&ladder, &slices(&target.groups(ladder.betas(), 20, 500, 1, 0)));
            for (beta, ln_z) in ladder.betas().iter().zip(&n.ln_z) {
                assert!((ln_z - target.ln_z(*beta)).abs() < 0.08, "s = {s}, β = {beta}: {ln_z}");
            }
            let deviation = n.target.ln_value - target.ln_z(1.0);
            assert!(deviation.abs() < 4.0 * n.target.relative_error, "s = {s}: off by {deviation}, {:?}", n.target);
        }
    }

    /// 200 runs of exact draws, of which 0.27 % are to be beyond three standard errors: more than 6 have a probability
    /// below 10⁻⁵; and one in which tempered states come from a target that lacks the brighter part.
    #[test]
    fn light_that_chains_do_not_find_shows_as_disagreement() {
        let (whole, part) = (Exponential { s: 5.0, offset: 0.0 }, Exponential { s: 3.0, offset: 0.0 });
        let ladder = Ladder::even(3);
        let alarms = (0..200)
            .filter(|&run| {
                let groups = whole.groups(ladder.betas(), 16, 200, 1, run);
                Normalisers::solve(&ladder, &slices(&groups)).disagreement > 3.0
            })
            .count();
        assert!(alarms <= 6, "{alarms} false alarms");
        let mut groups = whole.groups(ladder.betas(), 16, 200, 1, 7);
        for (group, part) in groups.iter_mut().zip(part.groups(ladder.betas(), 16, 200, 1, 8)) {
            group[1..].clone_from_slice(&part[1..]);
        }
        let n = Normalisers::solve(&ladder, &slices(&groups));
        assert!(n.disagreement > 3.0, "{n:?}");
    }

    #[test]
    fn normalisers_reach_any_magnitude() {
        for offset in [-5000.0, -300.0, 300.0, 5000.0] {
            let target = Exponential { s: 20.0, offset };
            let ladder = Ladder::new(vec![0.0, 0.05, 0.25, 1.0]);
            let n = Normalisers::solve(&ladder, &slices(&target.groups(ladder.betas(), 16, 500, 1, 3)));
            let deviation = n.target.ln_value - target.ln_z(1.0);
            // level 6·10⁻⁵ for each offset
            assert!(deviation.abs() < 4.0 * n.target.relative_error, "{offset}: off by {deviation}, {:?}", n.target);
            assert!(n.target.relative_error < 0.1, "{:?}", n.target);
        }
    }

    /// Share of 400 runs in which the 95 % interval of ln c holds the truth, for the uniform mean, stepping stones and
    /// MBAR.
    fn coverage(target: &Exponential, ladder: &Ladder, groups: u32, n: u64, repeats: u64) -> [usize; 3] {
        let mut covered = [0; 3];
        for run in 0..400 {
            let groups = target.groups(ladder.betas(), groups, n, repeats, run);
            let groups = slices(&groups);
            let estimates = [
                uniform_mean(&groups),
                stepping_stones(ladder.betas(), &groups),
                Normalisers::solve(ladder, &groups).target,
            ];
            for (covered, e) in covered.iter_mut().zip(estimates) {
                *covered += usize::from((e.ln_value - target.ln_z(1.0)).abs() < 1.96 * e.relative_error);
            }
        }
        covered
    }

    /// The share lies within 90 to 98 % of 400 runs (for a true 95 %, both tails are beyond 2.7 standard deviations of the
    /// binomial: level 0.01 for each of the estimates).
    #[test]
    fn standard_errors_cover_the_truth_for_independent_states() {
        let covered = coverage(&Exponential { s: 4.0, offset: 300.0 }, &Ladder::even(3), 16, 50, 1);
        assert!(covered.iter().all(|c| (360..=392).contains(c)), "{covered:?} of 400 intervals hold the truth");
    }

    /// As above, for tempered states that a chain repeats twenty times on average.
    #[test]
    fn standard_errors_cover_the_truth_for_states_of_chains() {
        let covered = coverage(&Exponential { s: 4.0, offset: -300.0 }, &Ladder::even(4), 24, 400, 20);
        assert!(covered.iter().all(|c| (360..=392).contains(c)), "{covered:?} of 400 intervals hold the truth");
    }

    /// Newton's method on the full Hessian from the flat start, one step at a time: slow, and plain to see.
    fn dense(betas: &[f64], counts: &[f64], bins: &[(f64, f64)]) -> Vec<f64> {
        let n = betas.len();
        let mut x: Vec<f64> = betas.iter().map(|b| b * bins[bins.len() / 2].0).collect();
        for iteration in 0..2000 {
            let mut gradient: Vec<f64> = counts.iter().map(|c| -c).collect();
            let mut system = vec![vec![0.0; n]; n];
            for &(v, h) in bins {
                let e: Vec<f64> = (0..n).map(|l| counts[l].ln() + betas[l] * v - x[l]).collect();
                let largest = e.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let p: Vec<f64> = e.iter().map(|e| (e - largest).exp()).collect();
                let sum: f64 = p.iter().sum();
                for l in 0..n {
                    gradient[l] += h * p[l] / sum;
                    system[l][l] += h * p[l] / sum;
                    (0..n).for_each(|m| system[l][m] -= h * p[l] * p[m] / (sum * sum));
                }
            }
            if iteration < 1000 {
                // self-consistent iterations come close
                (1..n).for_each(|l| x[l] += (gradient[l] / counts[l]).ln_1p());
                continue;
            }
            // Gauss elimination over the unknowns 1 …
            for i in 1..n {
                for j in i + 1..n {
                    let ratio = system[j][i] / system[i][i];
                    (i..n).for_each(|m| system[j][m] -= ratio * system[i][m]);
                    gradient[j] -= ratio * gradient[i];
                }
            }
            let mut step = vec![0.0; n];
            for i in (1..n).rev() {
                let known: f64 = (i + 1..n).map(|m| system[i][m] * step[m]).sum();
                step[i] = (gradient[i] - known) / system[i][i];
            }
            x.iter_mut().zip(&step).for_each(|(x, s)| *x += s);
            if step.iter().all(|s| s.abs() < 1e-13) {
                break;
            }
        }
        x
    }

    #[test]
    fn the_solution_is_the_maximum_that_plain_newton_finds() {
        let spread: Vec<f64> = (0..40).map(|k| (f64::from(k) / 39.0).powi(3)).collect();
        for (s, betas) in [
            (6.0, vec![0.0, 0.5, 1.0]),
            (60.0, vec![0.0, 0.02, 0.1, 0.4, 1.0]),
            (200.0, spread.clone()),
            (3.0, spread),
            (-700.0, vec![0.0, 0.001, 0.004, 0.02, 0.1, 0.4, 1.0]),
        ] {
            let groups = Exponential { s, offset: 0.0 }.groups(&betas, 4, 300, 3, 1);
            assert_is_maximum(betas, &groups);
        }
    }

    #[test]
    fn the_solution_is_the_maximum_for_islands_with_nothing_between() {
        // a thousandth of the cube is e^12 as bright; what each rung sees of either island is exact in one group
        let betas: Vec<f64> = (0..9).map(|k| f64::from(k) / 8.0).collect();
        let group = |excess: f64| {
            let rung = |beta: &f64| {
                let odds = 0.001 * (12.0 * beta).exp() * excess;
                let mut h = Histogram::default();
                h.add(-9.0, 100.0 / (1.0 + odds));
                h.add(3.0, 100.0 * odds / (1.0 + odds));
                h
            };
            betas.iter().map(rung).collect()
        };
        assert_is_maximum(betas.clone(), &[group(1.0), group(1.1)]);
    }

    fn assert_is_maximum(betas: Vec<f64>, groups: &[Vec<Histogram>]) {
        let n = Normalisers::solve(&Ladder::new(betas.clone()), &slices(groups));
        let pooled = pool(betas.len(), &slices(groups));
        let mut tempered = Histogram::default();
        pooled[1..].iter().for_each(|rung| tempered.merge(rung));
        let bins: Vec<(f64, f64)> = pooled[0].lit().chain(tempered.lit().map(|(v, w)| (v, w * n.discount))).collect();
        let counts: Vec<f64> =
            (0..betas.len()).map(|k| pooled[k].total() * if k == 0 { 1.0 } else { n.discount }).collect();
        for (k, (got, exact)) in n.ln_z.iter().zip(dense(&betas, &counts, &bins)).enumerate() {
            assert!((got - exact).abs() < 1e-10 * exact.abs().max(1.0), "rung {k} of {betas:?}: {got} for {exact}");
        }
    }

    #[test]
    fn states_that_hardly_meet_still_have_a_maximum() {
        // neighbours of a constant at different levels do not overlap in any bin of the sample
        let mut groups = Vec::new();
        for shift in [0.0, 0.5] {
            let at = |v: f64| {
                let mut h = Histogram::default();
                (0..50).for_each(|i| h.add(v + shift + f64::from(i) * 0.01, 1.0));
                h
            };
            groups.push([at(-60.0), at(-30.0), at(0.0)]);
        }
        let n = Normalisers::solve(&Ladder::even(3), &[&groups[0], &groups[1]]);
        assert!(n.ln_z.windows(2).all(|z| z[0].is_finite() && z[0] > z[1]) && n.target.ln_value.is_finite(), "{n:?}");
    }

    #[test]
    fn a_thousand_rungs_agree_with_a_closed_form() {
        for (s, offset) in [(25.0, -20.0), (700.0, -350.0)] {
            let target = Exponential { s, offset };
            let betas: Vec<f64> = (0..1024).map(|k| (f64::from(k) / 1023.0).powi(2)).collect();
            let groups = target.groups(&betas, 8, 20, 1, 1);
            let n = Normalisers::solve(&Ladder::new(betas.clone()), &slices(&groups));
            assert!(n.target.relative_error < 0.2, "{:?}", n.target);
            for (beta, ln_z) in betas.iter().zip(&n.ln_z) {
                assert!((ln_z - target.ln_z(*beta)).abs() < 0.5, "s = {s}, β = {beta}: {ln_z}");
            }
        }
    }

    #[test]
    fn the_uniform_rung_alone_answers_with_its_mean() {
        let target = Exponential { s: 2.0, offset: 0.0 };
        let groups = target.groups(&[0.0], 8, 100, 1, 1);
        let n = Normalisers::solve(&Ladder::even(1), &slices(&groups));
        assert_eq!((n.ln_z, n.target), (vec![0.0], uniform_mean(&slices(&groups))));
    }

    #[test]
    fn before_chains_start_the_uniform_points_answer_for_all_rungs() {
        let target = Exponential { s: 2.0, offset: 0.0 };
        let mut groups = target.groups(&[0.0, 0.5, 1.0], 8, 1000, 1, 1);
        groups.iter_mut().for_each(|g| g[1..].fill(Histogram::default()));
        let n = Normalisers::solve(&Ladder::even(3), &slices(&groups));
        assert_eq!(n.target, uniform_mean(&slices(&groups)));
        // but for the bins' means, of each group there and of all groups here
        assert!((n.ln_z[2] - n.target.ln_value).abs() < 3.1e-5);
        assert!((n.ln_z[1] - target.ln_z(0.5)).abs() < 0.05);
    }

    #[test]
    fn rungs_without_states_have_their_normaliser_from_the_others() {
        let target = Exponential { s: 3.0, offset: 0.0 };
        let mut groups = target.groups(&[0.0, 0.5, 1.0], 8, 1000, 1, 1);
        groups.iter_mut().for_each(|g| g[1] = Histogram::default());
        let n = Normalisers::solve(&Ladder::even(3), &slices(&groups));
        assert!((n.ln_z[1] - target.ln_z(0.5)).abs() < 0.05 && (n.ln_z[2] - target.ln_z(1.0)).abs() < 0.05, "{n:?}");
    }

    #[test]
    fn a_dark_target_has_normaliser_zero() {
        let mut dark = Histogram::default();
        dark.add(f64::NEG_INFINITY, 100.0);
        let group = [dark, Histogram::default()];
        let n = Normalisers::solve(&Ladder::even(2), &[&group]);
        assert_eq!((n.target, n.ln_z), (Estimate::ZERO, vec![0.0, f64::NEG_INFINITY]));
    }

    #[test]
    fn light_that_only_chains_have_met_has_no_normaliser_yet() {
        let mut group = [Histogram::default(), Histogram::default()];
        group[0].add(f64::NEG_INFINITY, 100.0);
        group[1].add(2.0, 7.0);
        group[1].add(3.0, 5.0);
        let n = Normalisers::solve(&Ladder::even(2), &[&group, &group]);
        assert_eq!(n.target, Estimate::ZERO);
    }
}
