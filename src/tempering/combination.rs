//! How the rungs' estimates become one image.

use super::Ladder;

/// Which samples the image is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Combination {
    /// The coldest rung's alone: Î = ĉ · mean of f/g.
    Target,
    /// Every rung's, by the balance heuristic: Î = Σ_k Ẑ_k · mean over rung k of (n_k/ζ_k) f / Σ_l n_l g^{β_l}/ζ_l.
    Balance,
}

/// The factors by which f enters the image, for a state on each rung, fixed for one round.
///
/// A state on rung k adds w_k(g) f with
///
/// - `Balance`: w_k = (n_k/ζ_k) / Σ_l (n_l/ζ_l) g^{β_l}, so that the rungs' shares (n_k g^{β_k}/ζ_k)/Σ… sum to one
///   for *any* ζ: unbiased given the normalisers, and f is bounded by C · min(g/N₁, Ẑ/N) (ALGORITHM section 5);
/// - `Target`: w_K = 1/g, all others 0.
///
/// Estimates of tempered rungs are kept together in one layer, in units of `unit`: the layer holds
/// Σ w_k f · unit · ζ_k/ζ_K, to be multiplied by Ẑ_K/unit. So the ratios of normalisers among tempered rungs are those
/// known before the round and the one that matters most, to the uniform rung, is the final one; memory does not grow
/// with K.
#[derive(Clone, Debug)]
pub struct Weights {
    combination: Combination,
    betas: Vec<f64>,
    /// ln(n_k/ζ_k).
    ln_share: Vec<f64>,
    /// Factor of the tempered layer for each rung: unit · n_k/ζ_K.
    scale: Vec<f64>,
    unit: f64,
}

impl Weights {
    /// Weights from the normalisers `ln_zeta` and the numbers of samples `counts` that each rung contributes a sweep
    /// (in ratio); `unit` is a magnitude of c, the same for the whole run.
    ///
    /// Rungs whose normaliser is not known (−∞) get no share; where that is the target, `Balance` uses the uniform
    /// rung alone.
    pub fn new(combination: Combination, ladder: &Ladder, ln_zeta: &[f64], counts: &[f64], unit: f64) -> Weights {
        let known = ln_zeta.last().is_some_and(|z| z.is_finite());
        let ln_target = if known { ln_zeta[ln_zeta.len() - 1] } else { 0.0 };
        let ln_share: Vec<f64> = (0..ladder.rungs())
            .map(|k| {
                if k == 0 {
                    libm::log(counts[0])
                } else if known && ln_zeta[k].is_finite() {
                    libm::log(counts[k]) - ln_zeta[k]
                } else {
                    f64::NEG_INFINITY
                }
            })
            .collect();
        let scale = (0..ladder.rungs())
            .map(|k| if ln_share[k].is_finite() { unit * counts[k] * libm::exp(-ln_target) } else { 0.0 })
            .collect();
        Weights { combination, betas: ladder.betas().to_vec(), ln_share, scale, unit }
    }

    /// Whether uniform points add anything.
    pub fn use_uniform(&self) -> bool {
        self.combination == Combination::Balance
    }

    /// What a uniform point adds of its f, where it is lit: the share of the uniform rung.
    #[inline(always)]
    pub fn uniform(&self, ln_g: f64) -> f64 {
        match self.combination {
            Combination::Target => 0.0,
            Combination::Balance => self.over_mixture(self.ln_share[0], ln_g),
        }
    }

    /// What a state on tempered rung `k` (counted from 0, the uniform one) adds of its f to the tempered layer, in
    /// the layer's unit, for one sample a sweep.
    #[inline(always)]
    pub fn tempered(&self, k: usize, ln_g: f64) -> f64 {
        match self.combination {
            Combination::Target if k + 1 == self.betas.len() => self.unit * libm::exp(-ln_g),
            Combination::Target => 0.0,
            Combination::Balance => self.scale[k] * self.over_mixture(0.0, ln_g),
        }
    }

    /// e^`ln_numerator` / Σ_l (n_l/ζ_l) g^{β_l}.
    #[inline(always)]
    fn over_mixture(&self, ln_numerator: f64, ln_g: f64) -> f64 {
        // shifting by the largest exponent keeps the sum within range for any g and ζ
        let exponent = |l: usize| self.ln_share[l] + self.betas[l] * ln_g;
        let largest = (0..self.betas.len()).map(exponent).fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = (0..self.betas.len()).map(|l| libm::exp(exponent(l) - largest)).sum();
        libm::exp(ln_numerator - largest) / sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_all_rungs_sum_to_one_for_any_normalisers() {
        let ladder = Ladder::new(vec![0.0, 0.2, 0.7, 1.0]);
        let ln_zeta = [0.0, -3.0, 12.0, 5.0];
        let counts = [3.0, 1.0, 0.5, 1.0];
        let w = Weights::new(Combination::Balance, &ladder, &ln_zeta, &counts, 2.5);
        for ln_g in [-700.0, -3.0, 0.0, 4.0, 650.0] {
            // shares: uniform() is one itself; tempered() is w_k · unit · ζ_k/ζ_K, and the share is w_k g^β_k
            let tempered: f64 = (1..4)
                .map(|k| {
                    let w_k = (w.tempered(k, ln_g) / 2.5).ln() + ln_zeta[3] - ln_zeta[k];
                    (w_k + ladder.betas()[k] * ln_g).exp()
                })
                .sum();
            assert!((w.uniform(ln_g) + tempered - 1.0).abs() < 1e-9, "ln g = {ln_g}");
        }
    }

    #[test]
    fn without_normalisers_the_uniform_rung_has_all_the_weight() {
        let ladder = Ladder::even(2);
        let w = Weights::new(Combination::Balance, &ladder, &[0.0, f64::NEG_INFINITY], &[1.0, 1.0], 1.0);
        assert_eq!((w.uniform(3.0), w.tempered(1, 3.0)), (1.0, 0.0));
    }

    #[test]
    fn the_target_alone_divides_by_g() {
        let ladder = Ladder::even(3);
        let w = Weights::new(Combination::Target, &ladder, &[0.0, 1.0, 2.0], &[1.0; 3], 4.0);
        assert_eq!((w.uniform(0.3), w.tempered(1, 0.3)), (0.0, 0.0));
        assert!((w.tempered(2, 0.3) - 4.0 * (-0.3f64).exp()).abs() < 1e-12);
    }
}
