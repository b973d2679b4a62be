//! What a point contributes to the image, and the scalar that chains follow.

use crate::scene::Rgb;

/// Luminance with the paper's weights (Rec. 601): 0.299 R + 0.587 G + 0.114 B. Non-negative colours have
/// f/g ≤ 1/0.114 < 8.8 in every channel.
#[inline(always)]
pub fn luminance(rgb: Rgb) -> f32 {
    0.299 * rgb.x + 0.587 * rgb.y + 0.114 * rgb.z
}

/// The contribution of one point of the cube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// Position on the film, as fractions of its width and height.
    pub film: [f32; 2],
    /// f: radiance over the density of the mapping, per channel; finite and not negative.
    pub rgb: Rgb,
    /// ln g, the natural logarithm of the scalar contribution that chains follow: the luminance of f, weighed by an
    /// [`Importance`](crate::chain::Importance) where there is one; −∞ where that is 0; never NaN or +∞.
    pub ln_g: f64,
}

impl Contribution {
    /// No contribution: where chains are before their first state.
    pub const NONE: Contribution = Contribution { film: [0.0; 2], rgb: Rgb::ZERO, ln_g: f64::NEG_INFINITY };

    /// The contribution of radiance `rgb` at a film position, and whether it had to be settled: a value that is
    /// not finite or negative contributes nothing. This is the one place where that is decided; a NaN that got
    /// as far as an acceptance probability would be accepted for ever.
    #[inline(always)]
    pub fn settle(film: [f32; 2], rgb: Rgb) -> (Contribution, bool) {
        let g = luminance(rgb);
        if g > 0.0 && g < f32::INFINITY && rgb.min_element() >= 0.0 {
            return (Contribution { film, rgb, ln_g: libm::log(f64::from(g)) }, false);
        }
        let settled = rgb != Rgb::ZERO;
        // a luminance that underflows is darkness, not a fault
        let fault = settled && !(g == 0.0 && rgb.is_finite() && rgb.min_element() >= 0.0);
        (Contribution { film, ..Contribution::NONE }, fault)
    }

    /// The luminance of f.
    pub fn luminance(&self) -> f64 {
        f64::from(luminance(self.rgb))
    }

    /// Whether nothing is contributed.
    #[inline(always)]
    pub fn is_dark(&self) -> bool {
        self.ln_g == f64::NEG_INFINITY
    }
}

/// Contributions of a batch, one a lane, and counts of what evaluating them took.
#[derive(Clone, Debug, Default)]
pub struct Contributions {
    /// One a lane; lanes that rested keep what they had.
    pub lanes: Vec<Contribution>,
    /// Rays traced since the counter was last taken.
    pub rays: u64,
    /// Contributions settled because they were not finite since the counter was last taken.
    pub non_finite: u64,
}

impl Contributions {
    /// For `lanes` lanes.
    pub fn new(lanes: usize) -> Contributions {
        Contributions { lanes: vec![Contribution::NONE; lanes], rays: 0, non_finite: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_contributes_nothing_and_is_counted() {
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            let (c, fault) = Contribution::settle([0.5; 2], Rgb::new(1.0, bad, 1.0));
            assert!(c.is_dark() && fault, "{bad}");
        }
        let (c, fault) = Contribution::settle([0.5; 2], Rgb::ZERO);
        assert!(c.is_dark() && !fault);
    }

    #[test]
    fn ln_g_is_the_logarithm_of_luminance() {
        let (c, fault) = Contribution::settle([0.1, 0.2], Rgb::new(1.0, 2.0, 3.0));
        assert!(!fault && (c.ln_g - f64::from(0.299 + 2.0 * 0.587 + 3.0 * 0.114f32).ln()).abs() < 1e-6);
    }
}
