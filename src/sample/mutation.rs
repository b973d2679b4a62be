//! Small steps on the torus.

use super::Block;
use crate::math::ln2_scaled_exp;

/// Log-uniform step sizes with random sign: |δ| = s₂ · (s₁/s₂)^ξ, ξ uniform in [0, 1).
///
/// Symmetric, so its Hastings ratio is one. Source: Kelemen et al. 2002, section 3.3.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepLaw {
    largest_log2: f32,
    span_log2: f32,
}

impl StepLaw {
    /// Kelemen's sizes: 1/1024 … 1/64 of the unit interval.
    pub const KELEMEN: StepLaw = StepLaw { largest_log2: 6.0, span_log2: 4.0 };

    /// Steps between `smallest` and `largest`, fractions of the unit interval, 2⁻³⁰ ≤ smallest ≤ largest ≤ 1/2.
    pub fn new(smallest: f32, largest: f32) -> StepLaw {
        assert!(2f32.powi(-30) <= smallest && smallest <= largest && largest <= 0.5);
        StepLaw { largest_log2: -libm::log2f(largest), span_log2: libm::log2f(largest / smallest) }
    }

    /// Moves each dimension of `from` by a step of its own, each made from one random word.
    #[inline(always)]
    pub fn step(&self, from: Block, random: [u32; 4]) -> Block {
        let mut to = from; // by a loop that becomes vector instructions
        for (to, random) in to.iter_mut().zip(random) {
            *to = to.wrapping_add(self.displacement(random));
        }
        to
    }

    /// One signed displacement as an element of the torus: the lowest bit is the sign, the rest the size.
    #[inline(always)]
    fn displacement(&self, random: u32) -> u32 {
        let xi = (random >> 8) as f32 * (1.0 / 16_777_216.0);
        let size = ln2_scaled_exp(self.largest_log2 + self.span_log2 * xi);
        let negative = 0u32.wrapping_sub(random & 1);
        (size ^ negative).wrapping_sub(negative)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_symmetric_and_within_their_sizes() {
        let law = StepLaw::KELEMEN;
        for i in 0..100_000u32 {
            let r = i.wrapping_mul(0x9E37_79B9) & !1;
            let (forwards, backwards) = (law.displacement(r), law.displacement(r | 1));
            assert_eq!(forwards.wrapping_add(backwards), 0, "the sign bit mirrors the step");
            let size = f64::from(forwards) / 4_294_967_296.0;
            assert!((0.999 / 1024.0..1.001 / 64.0).contains(&size), "size {size}");
        }
    }

    #[test]
    fn step_sizes_are_log_uniform() {
        let law = StepLaw::new(1.0 / 1024.0, 1.0 / 64.0);
        let mut bins = [0u32; 4];
        let n = 1 << 18;
        for i in 0..n {
            let size = f64::from(law.displacement((i << 14) & !1)) / 4_294_967_296.0;
            bins[((-size.log2() - 6.0) as usize).min(3)] += 1;
        }
        for b in bins {
            assert!((f64::from(b) / f64::from(n) - 0.25).abs() < 0.01, "{bins:?}");
        }
    }
}
