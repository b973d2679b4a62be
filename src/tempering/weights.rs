//! The factors by which samples of all rungs enter one image: the balance heuristic.

use std::sync::Arc;

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
#[serde(from = "Formula", into = "Formula")]
pub struct Weights {
    formula: Formula,
    /// S, where it has more than one term.
    table: Option<Arc<Table>>,
}

/// What weights are made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Formula {
    betas: Vec<f64>,
    /// ln ζ_k, from the second rung on.
    ln_zeta: Vec<f64>,
    ratio: f64,
    ln_unit: f64,
    /// unit/ζ_K.
    scale: f64,
}

/// S at multiples of 1/64 of ln g, and how it changes from one to the next, for |ln g| ≤ 32; in between it is cubic.
///
/// Every recorded state asks for S, whose K − 1 exponentials took 7 % of the time with 32 rungs. Between knots a distance
/// h apart the relative error is h⁴/384 · S⁗/S · eʰ at most, and S⁗ ≤ S as no β exceeds 1: less than 2 · 10⁻¹⁰. That much the
/// shares of all rungs differ from one together, and so does the image from an unbiased one.
#[derive(Debug, PartialEq)]
struct Table(Vec<[f64; 2]>);

/// Knots of [`Table`] for each factor e of g, and how many of these it reaches up and down.
const KNOTS: usize = 64;
const REACH: usize = 32;

/// ln S is cut off here: e^690 is close to the end of `f64`, and beside it a uniform point has no share anyway.
const LARGEST_EXPONENT: f64 = 690.0;

impl Weights {
    /// Weights from guesses `ln_zeta` of ln Z by rung, all finite, and ρ = `ratio`; `ln_unit` is the logarithm of a
    /// magnitude of c, the same for a whole run.
    pub fn new(ladder: &Ladder, ln_zeta: &[f64], ratio: f64, ln_unit: f64) -> Weights {
        assert_eq!(ladder.rungs(), ln_zeta.len());
        assert!(ln_zeta.iter().all(|z| z.is_finite()) && ratio >= 0.0, "ln ζ = {ln_zeta:?}, ρ = {ratio}");
        let scale = ln_zeta[1..].last().map_or(0.0, |target| libm::exp(ln_unit - target));
        Formula { betas: ladder.betas()[1..].to_vec(), ln_zeta: ln_zeta[1..].to_vec(), ratio, ln_unit, scale }.into()
    }

    /// The uniform rung alone: every uniform point counts in full.
    pub fn uniform_alone() -> Weights {
        Weights::new(&Ladder::uniform(), &[0.0], 0.0, 0.0)
    }

    /// ρ.
    pub fn ratio(&self) -> f64 {
        self.formula.ratio
    }

    /// S(g).
    #[inline(always)]
    pub fn mixture(&self, ln_g: f64) -> f64 {
        let told = self.table.as_ref().and_then(|table| table.at(ln_g));
        told.unwrap_or_else(|| self.formula.mixture(ln_g))
    }

    /// What a uniform point adds of its f, given S at its g.
    #[inline(always)]
    pub fn uniform(&self, mixture: f64) -> f64 {
        self.uniform_with(self.formula.ratio, mixture)
    }

    /// What a state of a chain adds of its f, in units of the film, given S at its g; the same on every rung.
    #[inline(always)]
    pub fn tempered(&self, mixture: f64) -> f64 {
        self.tempered_with(self.formula.ratio, mixture)
    }

    /// [`uniform`](Self::uniform) if ρ were `ratio`.
    #[inline(always)]
    pub fn uniform_with(&self, ratio: f64, mixture: f64) -> f64 {
        1.0 / (1.0 + ratio * mixture)
    }

    /// [`tempered`](Self::tempered) if ρ were `ratio`.
    #[inline(always)]
    pub fn tempered_with(&self, ratio: f64, mixture: f64) -> f64 {
        self.formula.scale * ratio / (1.0 + ratio * mixture)
    }

    /// What a state on the target adds of its f to the target's own image, in units of the film: unit/g.
    #[inline(always)]
    pub fn target(&self, ln_g: f64) -> f64 {
        libm::exp(self.formula.ln_unit - ln_g)
    }
}

impl Formula {
    /// S(g).
    fn mixture(&self, ln_g: f64) -> f64 {
        self.exponents(ln_g).map(libm::exp).sum()
    }

    fn exponents(&self, ln_g: f64) -> impl Iterator<Item = f64> {
        self.betas.iter().zip(&self.ln_zeta).map(move |(b, z)| (b * ln_g - z).min(LARGEST_EXPONENT))
    }
}

impl From<Formula> for Weights {
    fn from(formula: Formula) -> Weights {
        let smooth = formula.exponents(REACH as f64).all(|exponent| exponent < LARGEST_EXPONENT);
        let table = (formula.betas.len() > 1 && smooth).then(|| Arc::new(Table::of(&formula)));
        Weights { formula, table }
    }
}

impl From<Weights> for Formula {
    fn from(weights: Weights) -> Formula {
        weights.formula
    }
}

impl Table {
    fn of(formula: &Formula) -> Table {
        let knot = |i: usize| {
            let ln_g = i as f64 / KNOTS as f64 - REACH as f64;
            let terms = formula.betas.iter().zip(formula.exponents(ln_g)).map(|(beta, ln)| (beta, libm::exp(ln)));
            terms.fold([0.0; 2], |[sum, slope], (beta, term)| [sum + term, slope + beta * term / KNOTS as f64])
        };
        Table((0..=2 * REACH * KNOTS).map(knot).collect())
    }

    /// S(g), unless that is beyond the table.
    #[inline(always)]
    fn at(&self, ln_g: f64) -> Option<f64> {
        let place = (ln_g + REACH as f64) * KNOTS as f64;
        if !(place >= 0.0 && place < (2 * REACH * KNOTS) as f64) {
            return None;
        }
        let i = place as usize;
        let ([a, slope_a], [b, slope_b], x) = (self.0[i], self.0[i + 1], place - i as f64);
        let rise = b - a;
        Some(a + x * (slope_a + x * (3.0 * rise - 2.0 * slope_a - slope_b + x * (slope_a + slope_b - 2.0 * rise))))
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
    fn the_table_is_as_good_as_the_sum() {
        for rungs in [3, 4, 32] {
            let ladder = Ladder::even(rungs);
            let ln_zeta: Vec<f64> = (0..rungs).map(|k| (k as f64 - 4.0).sin() * 5.0).collect();
            let w = Weights::new(&ladder, &ln_zeta, 0.25, 0.0);
            for i in 0..100_000 {
                let ln_g = -40.0 + i as f64 * 80.0 / 100_000.0;
                let (told, sum) = (w.mixture(ln_g), w.formula.mixture(ln_g));
                assert!((told / sum - 1.0).abs() < 2e-10, "{rungs} rungs, ln g = {ln_g}: {told} and not {sum}");
            }
        }
    }

    #[test]
    fn a_table_of_what_is_beyond_all_numbers_is_not_made() {
        let w = Weights::new(&Ladder::even(3), &[0.0, -1.0, -680.0], 0.25, 0.0);
        assert!(w.table.is_none());
        assert_eq!(w.mixture(32.0), libm::exp(17.0) + libm::exp(690.0));
    }

    #[test]
    fn saved_weights_come_back_with_their_table() {
        let w = Weights::new(&Ladder::even(5), &[0.0, 1.0, 2.0, 3.0, 4.0], 0.25, 0.5);
        let back: Weights = postcard::from_bytes(&postcard::to_stdvec(&w).unwrap()).unwrap();
        assert!(back == w && back.table.is_some());
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
