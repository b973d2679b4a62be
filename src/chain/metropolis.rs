//! The acceptance probability.

/// Probability of moving from a state with ln g = `ln_g` to a proposal with `ln_proposed` at inverse temperature
/// `beta`: α = min(1, (g′/g)^β), for symmetric proposals.
///
/// A chain without a state (ln g = −∞) takes the first lit proposal; a dark proposal is never taken, whatever β > 0
/// is. Source: Metropolis et al. 1953; the null state: design, ALGORITHM section 2.
#[inline(always)]
pub fn acceptance(beta: f64, ln_g: f64, ln_proposed: f64) -> f64 {
    debug_assert!(!ln_g.is_nan() && !ln_proposed.is_nan(), "contributions are settled before they get here");
    debug_assert!(beta > 0.0, "the uniform distribution has no chain");
    if ln_proposed == f64::NEG_INFINITY {
        return 0.0;
    }
    let ln_ratio = beta * (ln_proposed - ln_g);
    if ln_ratio >= 0.0 { 1.0 } else { libm::exp(ln_ratio) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn acceptance_is_the_tempered_ratio() {
        assert_eq!(acceptance(1.0, 0.0, 1.0), 1.0);
        assert!((acceptance(1.0, 1.0, 0.0) - (-1.0f64).exp()).abs() < 1e-15);
        assert!((acceptance(0.25, 4.0, 0.0) - (-1.0f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn darkness_is_never_accepted_and_always_left() {
        let dark = f64::NEG_INFINITY;
        assert_eq!(acceptance(1.0, dark, dark), 0.0);
        assert_eq!(acceptance(0.5, 3.0, dark), 0.0);
        assert_eq!(acceptance(1e-9, dark, -700.0), 1.0);
    }
}
