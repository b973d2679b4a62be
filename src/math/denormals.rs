//! Denormal numbers: those between 0 and 2⁻¹²⁶ = 1.2·10⁻³⁸, which processors can be told to take for 0.
//!
//! relt leaves that alone. Threads have the mode that the system starts them with (on x86-64 MXCSR = 0x1F80: nothing is
//! flushed, halves are rounded to even), which Rust takes for granted and Embree does not change. Faint light so keeps its
//! digits down to 10⁻⁴⁵, and costs time only where there is such light: ordinary scenes have no denormal numbers.

use std::hint::black_box;

/// Whether this thread keeps them. It does not where a library that was loaded into the process has switched them off, as
/// what is compiled with `-ffast-math` may do (bits FTZ and DAZ of MXCSR), and threads inherit that.
pub fn are_kept() -> bool {
    let smallest = black_box(f32::MIN_POSITIVE);
    let half = black_box(0.5 * smallest); // 0 by FTZ
    half > 0.0 && half < smallest // equal to 0 by DAZ
}

#[cfg(test)]
mod tests {
    #[test]
    fn threads_keep_them() {
        assert!(super::are_kept());
        assert!(rayon::broadcast(|_| super::are_kept()).into_iter().all(|kept| kept));
    }
}
