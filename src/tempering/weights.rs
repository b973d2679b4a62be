//! The factors by which samples of all rungs enter one image: the balance heuristic.

use serde::{Deserialize, Serialize};

use super::Ladder;

/// Weights of the balance heuristic, fixed for one round.
///
/// With ζ_k > 0 any guesses of the normalisers and ρ ≥ 0 what a state of a chain counts for beside a uniform point,
/// the mixture of all rungs has, relative to the uniform rung alone, the density
///
/// 1 + ρ S(g),   S(g) = Σ_{k ≥ 2} g^{β_k}/ζ_k.
///
/// A uniform point adds f · w₁, w₁ = 1/(1 + ρ S), a state on rung k adds f · ρ/ζ_k / (1 + ρ S) · Ẑ_k: in expectation
/// the shares w₁ and ρ g^{β_k}/ζ_k / (1 + ρ S) of f, which sum to one for *any* ζ and ρ. So the image is unbiased given
/// the normalisers Ẑ and stationary chains, and f is bounded by g/N₁ on the uniform rung and by Ẑ_k/(ρ ζ_k) on the
/// others up to constants. ρ = 0 is path tracing. For K = 2 these are Kelemen's weights. (ALGORITHM section 5; Veach &
/// Guibas 1995 for the balance heuristic.)
///
/// Tempered states are kept on the film in units of `unit`, a magnitude of c: a state on rung k adds
/// f · unit · ρ/ζ_K / (1 + ρ S), to be multiplied by Ẑ_K/unit. So the ratios of normalisers among tempered rungs are
/// those known before the round and the one that matters most, to the uniform rung, is the final one; memory does not
/// grow with K.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    betas: Vec<f64>,
    /// ln ζ_k, from the second rung on.
    ln_zeta: Vec<f64>,
    ratio: f64,
    ln_unit: f64,
    /// unit/ζ_K.
    scale: f64,
}

/// ln S is cut off here: e^690 is close to the end of `f64`, and beside it a uniform point has no share anyway.
const LARGEST_EXPONENT: f64 = 690.0;

impl Weights {
    /// Weights from guesses `ln_zeta` of ln Z by rung, all finite, and ρ = `ratio`; `ln_unit` is the logarithm of a
    /// magnitude of c, the same for a whole run.
    pub fn new(ladder: &Ladder, ln_zeta: &[f64], ratio: f64, ln_unit: f64) -> Weights {
        assert_eq!(ladder.rungs(), ln_zeta.len());
        assert!(ln_zeta.iter().all(|z| z.is_finite()) && ratio >= 0.0, "ln ζ = {ln_zeta:?}, ρ = {ratio}");
        let scale = ln_zeta[1..].last().map_or(0.0, |target| libm::exp(ln_unit - target));
        Weights { betas: ladder.betas()[1..].to_vec(), ln_zeta: ln_zeta[1..].to_vec(), ratio, ln_unit, scale }
    }

    /// The uniform rung alone: every uniform point counts in full.
    pub fn uniform_alone() -> Weights {
        Weights::new(&Ladder::uniform(), &[0.0], 0.0, 0.0)
    }

    /// ρ.
    pub fn ratio(&self) -> f64 {
        self.ratio
    }

    /// S(g).
    #[inline(always)]
    pub fn mixture(&self, ln_g: f64) -> f64 {
        self.betas.iter().zip(&self.ln_zeta).map(|(b, z)| libm::exp((b * ln_g - z).min(LARGEST_EXPONENT))).sum()
    }

    /// What a uniform point adds of its f, given S at its g.
    #[inline(always)]
    pub fn uniform(&self, mixture: f64) -> f64 {
        self.uniform_with(self.ratio, mixture)
    }

    /// What a state of a chain adds of its f, in units of the film, given S at its g; the same on every rung.
    #[inline(always)]
    pub fn tempered(&self, mixture: f64) -> f64 {
        self.tempered_with(self.ratio, mixture)
    }

    /// [`uniform`](Self::uniform) if ρ were `ratio`.
    #[inline(always)]
    pub fn uniform_with(&self, ratio: f64, mixture: f64) -> f64 {
        1.0 / (1.0 + ratio * mixture)
    }

    /// [`tempered`](Self::tempered) if ρ were `ratio`.
    #[inline(always)]
    pub fn tempered_with(&self, ratio: f64, mixture: f64) -> f64 {
        self.scale * ratio / (1.0 + ratio * mixture)
    }

    /// What a state on the target adds of its f to the target's own image, in units of the film: unit/g.
    #[inline(always)]
    pub fn target(&self, ln_g: f64) -> f64 {
        libm::exp(self.ln_unit - ln_g)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_all_rungs_sum_to_one_for_any_normalisers() {
        let ladder = Ladder::new(vec![0.0, 0.2, 0.7, 1.0]);
        let ln_zeta = [0.0, -3.0, 12.0, 5.0];
        for ratio in [0.0, 0.01, 1.0, 8.0] {
            let w = Weights::new(&ladder, &ln_zeta, ratio, 2.5f64.ln());
            for ln_g in [-700.0, -3.0, 0.0, 4.0, 650.0] {
                let s = w.mixture(ln_g);
                // the film's unit is taken off, and the normaliser of the rung itself put in
                let shares: f64 = (1..4)
                    .map(|k| w.tempered(s) / 2.5 * (ln_zeta[3] - ln_zeta[k] + ladder.betas()[k] * ln_g).exp())
                    .sum();
                assert!((w.uniform(s) + shares - 1.0).abs() < 1e-9, "ρ = {ratio}, ln g = {ln_g}");
            }
        }
    }

    #[test]
    fn what_a_state_adds_is_bounded_in_the_bright_and_in_the_dark() {
        let ladder = Ladder::new(vec![0.0, 0.5, 1.0]);
        let w = Weights::new(&ladder, &[0.0, -1.0, -2.0], 0.25, 0.0);
        for ln_g in [-2000.0, -700.0, 0.0, 680.0] {
            let s = w.mixture(ln_g);
            // luminance of what is added: g · w
            let bright = w.uniform(s) * f64::exp(ln_g);
            assert!(bright.is_finite() && bright <= (-2f64).exp() / 0.25 * (1.0 + 1e-12), "{ln_g}: {bright}");
            assert!(w.tempered(s).is_finite() && w.tempered(s) <= 0.25 * 2f64.exp());
        }
    }

    #[test]
    fn without_chains_uniform_points_count_in_full() {
        let w = Weights::uniform_alone();
        assert_eq!((w.mixture(3.0), w.uniform(w.mixture(3.0)), w.tempered(0.0)), (0.0, 1.0, 0.0));
    }

    #[test]
    fn the_target_alone_divides_by_g() {
        let w = Weights::new(&Ladder::even(2), &[0.0, 2.0], 1.0, 4f64.ln());
        assert!((w.target(0.3) - 4.0 * (-0.3f64).exp()).abs() < 1e-12);
    }
}
