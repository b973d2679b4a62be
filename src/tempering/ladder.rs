//! The ladder and the acceptance of swaps on it.

use serde::{Deserialize, Serialize};

/// Inverse temperatures 0 = β₁ < β₂ < … < β_K = 1; for K = 1 the uniform distribution alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SavedLadder")]
pub struct Ladder {
    betas: Vec<f64>,
}

/// A ladder as it was saved, not checked yet.
#[derive(Deserialize)]
struct SavedLadder {
    betas: Vec<f64>,
}

impl TryFrom<SavedLadder> for Ladder {
    type Error = &'static str;

    fn try_from(SavedLadder { betas }: SavedLadder) -> Result<Ladder, &'static str> {
        if Ladder::allows(&betas) { Ok(Ladder { betas }) } else { Err("a ladder cannot be") }
    }
}

impl Ladder {
    /// Most rungs of a ladder.
    pub const LONGEST: usize = 1024;
    /// Least distance of rungs that [`DensityOfStates::place`](super::DensityOfStates::place) puts side by side.
    pub const CLOSEST: f64 = 1e-12;

    /// A ladder of given inverse temperatures.
    ///
    /// # Panics
    /// If they do not rise strictly from 0 to 1, or are more than [`LONGEST`](Self::LONGEST), or are a single one other
    /// than 0; what people give is
    /// checked, with better words, by [`Settings`](crate::render::Settings).
    pub fn new(betas: Vec<f64>) -> Ladder {
        assert!(Ladder::allows(&betas), "inverse temperatures must rise from 0 to 1: {betas:?}");
        Ladder { betas }
    }

    /// Whether [`new`](Self::new) takes these inverse temperatures.
    fn allows(betas: &[f64]) -> bool {
        let ends = (betas.first(), betas.last());
        (1..=Ladder::LONGEST).contains(&betas.len())
            && ends.0 == Some(&0.0)
            && (betas.len() == 1 || ends.1 == Some(&1.0))
            && betas.windows(2).all(|pair| pair[0] < pair[1])
    }

    /// `rungs` equal steps from 0 to 1; 1 ≤ `rungs` ≤ [`LONGEST`](Self::LONGEST).
    pub fn even(rungs: usize) -> Ladder {
        Ladder::new((0..rungs).map(|k| k as f64 / (rungs - 1).max(1) as f64).collect())
    }

    /// The uniform distribution alone: no chains.
    pub fn uniform() -> Ladder {
        Ladder::even(1)
    }

    /// The inverse temperatures.
    pub fn betas(&self) -> &[f64] {
        &self.betas
    }

    /// Number of rungs K, the uniform one included.
    pub fn rungs(&self) -> usize {
        self.betas.len()
    }

    /// Number of rungs that have chains, K − 1.
    pub fn chains(&self) -> usize {
        self.betas.len() - 1
    }
}

/// Probability of swapping the states of two rungs, `hotter` with the smaller inverse temperature, given ln g of the
/// state on each.
///
/// α = min(1, exp((β_c − β_h)(ln g_h − ln g_c))). In this order −∞ + ∞ never occurs: a colder rung without a state
/// takes any; a hotter state that is dark cannot climb. Source: Geyer 1991; design, ALGORITHM section 4.
#[inline(always)]
pub fn swap_acceptance(beta_hotter: f64, ln_g_hotter: f64, beta_colder: f64, ln_g_colder: f64) -> f64 {
    debug_assert!(beta_hotter < beta_colder);
    if ln_g_colder == f64::NEG_INFINITY {
        return if ln_g_hotter == f64::NEG_INFINITY { 0.0 } else { 1.0 };
    }
    if ln_g_hotter == f64::NEG_INFINITY {
        return 0.0;
    }
    let ln_alpha = (beta_colder - beta_hotter) * (ln_g_hotter - ln_g_colder);
    if ln_alpha < 0.0 { libm::exp(ln_alpha) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_ladder_rises_from_the_uniform_distribution_to_the_target() {
        assert_eq!(Ladder::uniform().betas(), [0.0]);
        assert_eq!(Ladder::even(2).betas(), [0.0, 1.0]);
        assert_eq!(Ladder::even(3).betas(), [0.0, 0.5, 1.0]);
    }

    #[test]
    fn a_swap_is_accepted_by_the_ratio_of_the_joint_densities() {
        // (g_h/g_c)^(β_c − β_h)
        assert!((swap_acceptance(0.25, 1.0, 0.75, 3.0) - (-1.0f64).exp()).abs() < 1e-15);
        assert_eq!(swap_acceptance(0.25, 3.0, 0.75, 1.0), 1.0);
    }

    #[test]
    fn a_dark_state_cannot_climb_the_ladder() {
        let dark = f64::NEG_INFINITY;
        assert_eq!(swap_acceptance(0.0, dark, 1.0, -500.0), 0.0);
        assert_eq!(swap_acceptance(0.0, dark, 1.0, dark), 0.0);
        assert_eq!(swap_acceptance(0.0, -500.0, 1.0, dark), 1.0);
    }
}
