//! The ladder and the acceptance of swaps on it.

/// Inverse temperatures 0 = β₁ < β₂ < … < β_K = 1, K ≥ 2.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    betas: Vec<f64>,
}

/// Why a list of inverse temperatures is no ladder.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LadderError {
    /// Fewer than two rungs.
    #[error("a ladder has at least the two rungs β = 0 and β = 1")]
    TooShort,
    /// More rungs than counters can name.
    #[error("a ladder has at most {} rungs", Ladder::LONGEST)]
    TooLong,
    /// The first rung is not the uniform distribution.
    #[error("the first inverse temperature is {0}; it must be 0, the uniform distribution")]
    NotUniform(f64),
    /// The last rung is not the target.
    #[error("the last inverse temperature is {0}; it must be 1, the target itself")]
    NotTarget(f64),
    /// Two neighbours do not rise.
    #[error("inverse temperatures must rise, but {1} follows {0}")]
    NotRising(f64, f64),
}

impl Ladder {
    /// Most rungs of a ladder.
    pub const LONGEST: usize = 1024;

    /// A ladder of given inverse temperatures.
    pub fn new(betas: Vec<f64>) -> Result<Ladder, LadderError> {
        let (&[first, .., last], 2..) = (&betas[..], betas.len()) else { return Err(LadderError::TooShort) };
        if betas.len() > Ladder::LONGEST {
            return Err(LadderError::TooLong);
        }
        if first != 0.0 {
            return Err(LadderError::NotUniform(first));
        }
        if let Some(pair) = betas.windows(2).find(|p| p[0].partial_cmp(&p[1]) != Some(std::cmp::Ordering::Less)) {
            return Err(LadderError::NotRising(pair[0], pair[1]));
        }
        if last != 1.0 {
            return Err(LadderError::NotTarget(last));
        }
        Ok(Ladder { betas })
    }

    /// `rungs` equal steps from 0 to 1; 2 ≤ `rungs` ≤ [`Self::LONGEST`].
    pub fn even(rungs: usize) -> Result<Ladder, LadderError> {
        if rungs < 2 {
            return Err(LadderError::TooShort);
        }
        Ladder::new((0..rungs).map(|k| k as f64 / (rungs - 1) as f64).collect())
    }

    /// The inverse temperatures.
    pub fn betas(&self) -> &[f64] {
        &self.betas
    }

    /// Number of rungs K, the uniform one included.
    pub fn rungs(&self) -> usize {
        self.betas.len()
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
    libm::exp(((beta_colder - beta_hotter) * (ln_g_hotter - ln_g_colder)).min(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ladders_rise_from_the_uniform_distribution_to_the_target() {
        assert_eq!(Ladder::even(3).unwrap().betas(), [0.0, 0.5, 1.0]);
        assert_eq!(Ladder::new(vec![0.0]), Err(LadderError::TooShort));
        assert_eq!(Ladder::new(vec![]), Err(LadderError::TooShort));
        assert_eq!(Ladder::new(vec![0.1, 1.0]), Err(LadderError::NotUniform(0.1)));
        assert_eq!(Ladder::new(vec![0.0, 0.9]), Err(LadderError::NotTarget(0.9)));
        assert_eq!(Ladder::new(vec![0.0, 0.5, 0.5, 1.0]), Err(LadderError::NotRising(0.5, 0.5)));
        assert!(matches!(Ladder::new(vec![0.0, f64::NAN, 1.0]), Err(LadderError::NotRising(..))));
        assert_eq!(Ladder::even(1025), Err(LadderError::TooLong));
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
