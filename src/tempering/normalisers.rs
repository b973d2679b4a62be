//! Estimates of the ln-normalisers ln Z(β_k), Z(β) = ∫ g^β.

use super::{Histogram, Ladder};

/// A number and the standard error of its estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard error, from independent groups of ladders; NaN with fewer than two groups.
    pub standard_error: f64,
}

/// Mean of g over uniform points, from Σ g and number of points of each independent group.
/// Unbiased; the standard error is that of a ratio estimator over the groups.
pub fn uniform_mean(groups: &[(f64, f64)]) -> Estimate {
    let (sum, n) = groups.iter().fold((0.0, 0.0), |(s, n), g| (s + g.0, n + g.1));
    let value = if n > 0.0 { sum / n } else { 0.0 };
    let m = groups.len() as f64;
    let deviations: f64 = groups.iter().map(|g| (g.0 - value * g.1).powi(2)).sum();
    Estimate { value, standard_error: (deviations * m / (m - 1.0)).sqrt() / n }
}

/// ln Z of every rung by MBAR (Shirts & Chodera 2008) on pooled histograms of ln g.
///
/// The Ẑ_l solve  Ẑ_l = Σ_b H_b e^{β_l v_b} / Σ_m N_m e^{β_m v_b}/Ẑ_m  with Ẑ₁ = 1; they maximise a concave
/// likelihood, which Newton's method finds. The standard errors are those of an M-estimator over independent groups
/// (sandwich with the groups' gradients). Consistent; bias O(1/N).
///
/// States of chains are correlated, uniform points are not, so the states of tempered rungs count for a fraction of
/// their number: the one of `DISCOUNTS` that makes the standard error least. Without that, four strongly correlated
/// rungs made the estimate worse than the mean of the uniform rung alone; in the limit of a small fraction it is that
/// mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalisers {
    /// ln Ẑ_k, k from the uniform rung (0) to the target; −∞ for rungs that no state has reached.
    pub ln_z: Vec<f64>,
    /// Ẑ of the target, c, with its standard error; 0 ± 0 as long as no uniform point met light.
    pub target: Estimate,
}

/// What one independent group of ladders has seen.
pub struct Group<'a> {
    /// ln g of uniform points.
    pub uniform: &'a Histogram,
    /// ln g of the states of all tempered rungs together.
    pub tempered: &'a Histogram,
    /// Weight of states by rung; entry 0, the uniform rung, is ignored.
    pub weights: &'a [f64],
}

/// The occupied bins of the pooled histogram. (Dark states can only be uniform ones; they enter by N₁ alone.)
struct Bins {
    /// Mean ln g.
    values: Vec<f64>,
    /// Weight.
    weights: Vec<f64>,
}

/// What a state of a chain may count for, beside a uniform point.
pub const DISCOUNTS: [f64; 5] = [1.0, 1.0 / 4.0, 1.0 / 16.0, 1.0 / 64.0, 1.0 / 256.0];

/// Rungs from which on only the middle discount is tried: a solution costs bins · K² an iteration, and with so many
/// rungs a choice of discounts costs more than it gains (K = 64: 13 of 15 s of a short run).
const LONG: usize = 16;

impl Normalisers {
    /// Solves for the normalisers of `ladder` from what the groups have seen.
    pub fn solve(ladder: &Ladder, groups: &[Group]) -> Normalisers {
        let discounts = if ladder.rungs() > LONG { &DISCOUNTS[2..3] } else { &DISCOUNTS[..] };
        discounts
            .iter()
            .map(|&discount| Normalisers::discounted(ladder, groups, discount))
            .reduce(|best, other| {
                let [error, least] = [&other, &best].map(|n| n.target.standard_error);
                if error < least || least.is_nan() { other } else { best }
            })
            .expect("there are discounts")
    }

    /// The solution when a state of a chain counts for `discount` uniform points.
    fn discounted(ladder: &Ladder, groups: &[Group], discount: f64) -> Normalisers {
        let betas = ladder.betas();
        let mut pooled = Histogram::default();
        let mut counts = vec![0.0; betas.len()];
        for group in groups {
            pooled.merge(group.uniform, 1.0);
            pooled.merge(group.tempered, discount);
            counts[0] += group.uniform.total();
            counts.iter_mut().zip(group.weights).skip(1).for_each(|(n, w)| *n += discount * w);
        }
        let (values, weights) = pooled.lit().unzip();
        let bins = Bins { values, weights };
        // chains may have met light where no uniform point has: then the likelihood grows for ever as Z falls
        let is_lit = groups.iter().any(|group| group.uniform.lit().next().is_some());
        // rungs without weight have no equation; they are evaluated at the end from the others
        let active: Vec<usize> = (0..betas.len()).filter(|&k| k == 0 || counts[k] > 0.0).collect();
        if !is_lit {
            let mut ln_z = vec![f64::NEG_INFINITY; betas.len()];
            ln_z[0] = 0.0;
            return Normalisers { ln_z, target: Estimate { value: 0.0, standard_error: 0.0 } };
        }
        let problem = Problem {
            betas: active.iter().map(|&k| betas[k]).collect(),
            ln_counts: active.iter().map(|&k| libm::log(counts[k])).collect(),
            counts: active.iter().map(|&k| counts[k]).collect(),
        };
        let solution = problem.maximise(&bins);
        let ln_z: Vec<f64> = betas.iter().map(|&beta| problem.ln_z_at(beta, &bins, &solution)).collect();
        let relative_error = problem.relative_error(&bins, &solution, groups, &active, discount);
        let c = libm::exp(ln_z[betas.len() - 1]);
        Normalisers { ln_z, target: Estimate { value: c, standard_error: c * relative_error } }
    }
}

/// The likelihood of unknowns x_l = ln Z_l for l ≥ 1, x₀ = 0.
struct Problem {
    betas: Vec<f64>,
    counts: Vec<f64>,
    ln_counts: Vec<f64>,
}

impl Problem {
    /// Probabilities p_l that a state with ln g = v came from rung l, given that it is in the pooled sample.
    fn memberships(&self, v: f64, x: &[f64], p: &mut [f64]) -> f64 {
        let mut largest = f64::NEG_INFINITY;
        for (l, p) in p.iter_mut().enumerate() {
            *p = self.ln_counts[l] + self.betas[l] * v - x[l];
            largest = largest.max(*p);
        }
        let mut sum = 0.0;
        for p in p.iter_mut() {
            *p = libm::exp(*p - largest);
            sum += *p;
        }
        p.iter_mut().for_each(|p| *p /= sum);
        largest + libm::log(sum)
    }

    /// ln Z at any β from the solved mixture: Σ_b H_b e^{βv_b}/Σ_m N_m e^{β_m v_b}/Ẑ_m; 0 at β = 0 by definition.
    fn ln_z_at(&self, beta: f64, bins: &Bins, x: &[f64]) -> f64 {
        if beta == 0.0 {
            return 0.0;
        }
        let mut p = vec![0.0; x.len()];
        let terms: Vec<f64> = bins
            .values
            .iter()
            .zip(&bins.weights)
            .map(|(&v, &w)| libm::log(w) + beta * v - self.memberships(v, x, &mut p))
            .collect();
        let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        largest + libm::log(terms.iter().map(|t| libm::exp(t - largest)).sum())
    }

    /// Log-likelihood, up to a constant: −Σ_b H_b ln Σ_m N_m e^{β_m v_b − x_m} − Σ_l N_l x_l. Concave in x.
    fn likelihood(&self, bins: &Bins, x: &[f64]) -> f64 {
        let mut p = vec![0.0; x.len()];
        let mixture: f64 =
            bins.values.iter().zip(&bins.weights).map(|(&v, &w)| w * self.memberships(v, x, &mut p)).sum();
        -mixture - self.counts.iter().zip(x).map(|(n, x)| n * x).sum::<f64>()
    }

    /// Gradient Σ_b H_b p_l(b) − N_l and negated Hessian Σ_b H_b (p_l δ_lm − p_l p_m) over the unknowns l ≥ 1.
    fn derivatives(&self, bins: &Bins, x: &[f64]) -> (Vec<f64>, Matrix) {
        let n = x.len() - 1;
        let mut gradient: Vec<f64> = self.counts[1..].iter().map(|c| -c).collect();
        let mut hessian = Matrix::zero(n);
        let mut p = vec![0.0; x.len()];
        for (&v, &w) in bins.values.iter().zip(&bins.weights) {
            self.memberships(v, x, &mut p);
            for l in 0..n {
                gradient[l] += w * p[l + 1];
                *hessian.at(l, l) += w * p[l + 1];
                for m in 0..=l {
                    *hessian.at(l, m) -= w * p[l + 1] * p[m + 1];
                }
            }
        }
        (gradient, hessian)
    }

    fn maximise(&self, bins: &Bins) -> Vec<f64> {
        let mut x = vec![0.0; self.betas.len()];
        if x.len() == 1 {
            return x;
        }
        // start: all unknowns from the uniform points' mixture alone, or a flat guess scaled by the typical ln g
        let typical =
            bins.values.iter().zip(&bins.weights).map(|(v, w)| v * w).sum::<f64>() / bins.weights.iter().sum::<f64>();
        x.iter_mut().zip(&self.betas).for_each(|(x, b)| *x = b * typical);
        // a few self-consistent iterations come close from anywhere, Newton's finish
        for _ in 0..8 {
            let next: Vec<f64> = self.betas.iter().map(|&b| self.ln_z_at(b, bins, &x)).collect();
            x = next;
            x[0] = 0.0;
        }
        let mut best = self.likelihood(bins, &x);
        for _ in 0..100 {
            let (gradient, hessian) = self.derivatives(bins, &x);
            let Some(factor) = hessian.cholesky() else { break };
            let step = factor.solve(&gradient);
            let mut scale = 1.0;
            let accepted = loop {
                let mut trial = x.clone();
                trial[1..].iter_mut().zip(&step).for_each(|(x, s)| *x += scale * s);
                let likelihood = self.likelihood(bins, &trial);
                if likelihood >= best {
                    (x, best) = (trial, likelihood);
                    break true;
                }
                scale *= 0.5;
                if scale < 1e-6 {
                    break false;
                }
            };
            if !accepted || step.iter().all(|s| s.abs() < 1e-12) {
                break;
            }
        }
        x
    }

    /// Standard error of ln Z of the target: sandwich over the groups' gradients.
    fn relative_error(&self, bins: &Bins, x: &[f64], groups: &[Group], active: &[usize], discount: f64) -> f64 {
        let n = x.len() - 1;
        if n == 0 || groups.len() < 2 {
            return f64::NAN;
        }
        let (_, hessian) = self.derivatives(bins, x);
        let Some(factor) = hessian.cholesky() else { return f64::NAN };
        let mut p = vec![0.0; x.len()];
        let mut squares = 0.0;
        for group in groups {
            let mut gradient: Vec<f64> = active[1..].iter().map(|&k| -discount * group.weights[k]).collect();
            let tempered = group.tempered.lit().map(|(v, w)| (v, w * discount));
            for (v, w) in group.uniform.lit().chain(tempered) {
                self.memberships(v, x, &mut p);
                gradient.iter_mut().zip(&p[1..]).for_each(|(g, p)| *g += w * p);
            }
            squares += factor.solve(&gradient)[n - 1].powi(2);
        }
        let m = groups.len() as f64;
        (squares * m / (m - 1.0)).sqrt()
    }
}

/// A symmetric matrix, lower triangle in rows.
struct Matrix {
    n: usize,
    values: Vec<f64>,
}

impl Matrix {
    fn zero(n: usize) -> Matrix {
        Matrix { n, values: vec![0.0; n * n] }
    }

    fn at(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.values[i * self.n + j]
    }

    /// L with L Lᵀ = self; `None` where the matrix is not positive definite.
    fn cholesky(mut self) -> Option<Matrix> {
        let n = self.n;
        for j in 0..n {
            for i in j..n {
                let dot: f64 = (0..j).map(|k| self.values[i * n + k] * self.values[j * n + k]).sum();
                let rest = self.values[i * n + j] - dot;
                self.values[i * n + j] = if i == j {
                    if rest.is_nan() || rest <= 0.0 {
                        return None;
                    }
                    rest.sqrt()
                } else {
                    rest / self.values[j * n + j]
                };
            }
        }
        Some(self)
    }

    /// Solves L Lᵀ x = b.
    fn solve(&self, b: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut x = b.to_vec();
        for i in 0..n {
            let dot: f64 = (0..i).map(|k| self.values[i * n + k] * x[k]).sum();
            x[i] = (x[i] - dot) / self.values[i * n + i];
        }
        for i in (0..n).rev() {
            let dot: f64 = (i + 1..n).map(|k| self.values[k * n + i] * x[k]).sum();
            x[i] = (x[i] - dot) / self.values[i * n + i];
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Counter, Purpose, Rng, open_unit_f64};

    /// Exact independent draws from g^β for g(x) = e^{s x} on [0, 1]: ln Z(β) = ln((e^{βs} − 1)/(βs)).
    fn draws(s: f64, beta: f64, n: u64, stream: u32) -> Histogram {
        let mut h = Histogram::default();
        for step in 0..n {
            let c = Counter { ladder: stream, replica: 0, step, purpose: Purpose::Primary };
            let u = open_unit_f64(Rng::new(5).words(c, 0)[0]);
            let x = if beta == 0.0 { u } else { (u * (beta * s).exp_m1()).ln_1p() / (beta * s) };
            h.add(s * x, 1.0);
        }
        h
    }

    fn exact(s: f64, beta: f64) -> f64 {
        if beta == 0.0 { 0.0 } else { ((beta * s).exp_m1() / (beta * s)).ln() }
    }

    fn solve(s: f64, ladder: &Ladder, groups: u32, n: u64) -> Normalisers {
        let seen: Vec<(Histogram, Histogram)> = (0..groups)
            .map(|g| {
                let mut tempered = Histogram::default();
                for (k, &beta) in ladder.betas().iter().enumerate().skip(1) {
                    tempered.merge(&draws(s, beta, n, 1000 * g + k as u32), 1.0);
                }
                (draws(s, 0.0, n, 1000 * g), tempered)
            })
            .collect();
        let weights = vec![n as f64; ladder.rungs()];
        let groups: Vec<Group> =
            seen.iter().map(|(u, t)| Group { uniform: u, tempered: t, weights: &weights }).collect();
        Normalisers::solve(ladder, &groups)
    }

    #[test]
    fn normalisers_of_an_exponential_agree_with_their_closed_form() {
        for s in [3.0, -40.0, 300.0] {
            let ladder = Ladder::new(vec![0.0, 0.02, 0.1, 0.4, 1.0]);
            let n = solve(s, &ladder, 20, 500);
            for (beta, ln_z) in ladder.betas().iter().zip(&n.ln_z) {
                assert!((ln_z - exact(s, *beta)).abs() < 0.08, "s = {s}, β = {beta}: {ln_z} for {}", exact(s, *beta));
            }
            let relative = n.target.standard_error / n.target.value;
            let deviation = n.target.value.ln() - exact(s, 1.0);
            assert!(deviation.abs() < 4.0 * relative, "s = {s}: off by {deviation}, standard error {relative}");
        }
    }

    /// 400 runs; the share of 95 % intervals that hold the truth lies within 90 to 98 % (for a true 95 %, both tails
    /// are beyond 2.7 standard deviations of the binomial, level 0.01).
    #[test]
    fn standard_errors_cover_the_truth() {
        let ladder = Ladder::even(3);
        let covered = (0..400u32)
            .filter(|run| {
                let groups: Vec<(Histogram, Histogram)> = (0..16)
                    .map(|g| {
                        let stream = run * 10_000 + g * 10;
                        let mut t = draws(4.0, 0.5, 50, stream + 1);
                        t.merge(&draws(4.0, 1.0, 50, stream + 2), 1.0);
                        (draws(4.0, 0.0, 50, stream), t)
                    })
                    .collect();
                let groups: Vec<Group> = groups
                    .iter()
                    .map(|(u, t)| Group { uniform: u, tempered: t, weights: &[0.0, 50.0, 50.0] })
                    .collect();
                let e = Normalisers::solve(&ladder, &groups).target;
                (e.value - exact(4.0, 1.0).exp()).abs() < 1.96 * e.standard_error
            })
            .count();
        assert!((360..=392).contains(&covered), "{covered} of 400 intervals hold the truth");
    }

    #[test]
    fn a_dark_target_has_normaliser_zero() {
        let mut dark = Histogram::default();
        dark.add(f64::NEG_INFINITY, 100.0);
        let empty = Histogram::default();
        let group = Group { uniform: &dark, tempered: &empty, weights: &[0.0, 0.0] };
        let n = Normalisers::solve(&Ladder::even(2), &[group]);
        assert_eq!(n.target, Estimate { value: 0.0, standard_error: 0.0 });
    }

    #[test]
    fn light_that_only_chains_have_met_has_no_normaliser_yet() {
        let (mut dark, mut met) = (Histogram::default(), Histogram::default());
        dark.add(f64::NEG_INFINITY, 100.0);
        met.add(2.0, 7.0);
        met.add(3.0, 5.0);
        let group = || Group { uniform: &dark, tempered: &met, weights: &[0.0, 12.0] };
        let n = Normalisers::solve(&Ladder::even(2), &[group(), group()]);
        assert_eq!(n.target, Estimate { value: 0.0, standard_error: 0.0 });
    }

    #[test]
    fn the_uniform_mean_and_its_error_are_those_of_the_groups() {
        let e = uniform_mean(&[(1.0, 2.0), (3.0, 2.0)]);
        assert_eq!(e.value, 1.0);
        // deviations ∓1, m/(m−1) = 2: √4 / 4
        assert_eq!(e.standard_error, 0.5);
    }
}
