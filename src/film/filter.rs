//! Reconstruction filters.

/// How a sample on the film spreads over pixels; all separable, lengths in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// Constant over the pixel that the sample falls into.
    Box,
    /// 1 − |x|/radius.
    Tent {
        /// Half width.
        radius: f32,
    },
    /// exp(−x²/2σ²) − exp(−r²/2σ²) with r = 4σ.
    Gaussian {
        /// Standard deviation σ.
        stddev: f32,
    },
}
