//! Elementary functions whose bits do not depend on the machine's mathematical library, and robust ray origins.

use glam::Vec3;

/// `x` rounded down, for 0 ≤ `x` < 2²³. `as` gives the same, but it saturates, for which there are no vector instructions before
/// AVX-512; in loops over lanes this becomes such.
#[inline(always)]
fn rounded_down(x: f32) -> i32 {
    /// From here on all numbers are whole, up to twice as much bit by bit.
    const WHOLE: f32 = 8_388_608.0; // 2²³
    let nearest = x + WHOLE;
    let too_much = nearest - WHOLE > x;
    (nearest.to_bits().wrapping_sub(WHOLE.to_bits()) as i32).wrapping_sub(i32::from(too_much))
}

/// The same for 0 ≤ `x` < 2³².
#[inline(always)]
fn rounded_down_large(x: f32) -> u32 {
    const PART: f32 = 65_536.0;
    let high = rounded_down(x * (1.0 / PART));
    let low = rounded_down(x - high as f32 * PART);
    ((high as u32) << 16).wrapping_add(low as u32)
}

/// `x` without its fraction; within ±2³¹ less a step of `f32`, if it is beyond that.
#[inline(always)]
fn truncated(x: f32) -> i32 {
    const LARGEST: f32 = 2_147_483_520.0;
    let whole = rounded_down_large(x.abs().min(LARGEST)) as i32;
    if x < 0.0 { whole.wrapping_neg() } else { whole }
}

/// Sine and cosine of 2π·`turn` for `turn` in [−1/8, 1].
///
/// Octant reduction and Taylor polynomials on |θ| ≤ π/4; absolute error below 3·10⁻⁷. Own code because the C
/// library's results differ between its versions and processors, and images must not.
#[inline(always)]
pub fn sin_cos_turn(turn: f32) -> (f32, f32) {
    let q = rounded_down(4.0 * turn + 0.5);
    let x = (4.0 * turn - q as f32) * std::f32::consts::FRAC_PI_2; // within ±π/4
    let x2 = x * x;
    let sin = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0))));
    let cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40320.0))));
    let (s, c) = if q & 1 == 0 { (sin, cos) } else { (cos, sin) };
    (if q & 2 == 0 { s } else { -s }, if q.wrapping_add(1) & 2 == 0 { c } else { -c })
}

/// exp(−ln 2 · `x`) · 2³² as an integer, for `x` in [1, 32): the magnitude of a step on the torus of u32.
///
/// The fraction by a Taylor polynomial of degree 6 with relative error below 4·10⁻⁵ (a step size needs no more, and the
/// same step forwards and backwards is what detailed balance needs).
#[inline(always)]
pub fn ln2_scaled_exp(x: f32) -> u32 {
    let whole = rounded_down(x);
    let f = whole as f32 - x; // in (−1, 0]
    let p = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5 + f * (0.055_504_1 + f * (0.009_618_1 + f * (0.001_333_4 + f * 0.000_154)))));
    let scale = f32::from_bits(((127 + 32 - whole) as u32) << 23);
    rounded_down_large(p * scale)
}

/// Where a coordinate counts as near zero in [`offset_origin`].
const NEAR_ZERO: f32 = 1.0 / 32.0;
/// How far that moves a coordinate near zero along a unit normal; other coordinates, by that part of them at least.
const FLOAT_SCALE: f32 = 1.0 / 65536.0;

/// A ray origin just off the surface at `p`, on the side that the vector `normal` points to.
///
/// Moves by 256 units in the last place of each coordinate along the normal, or by a 65,536th near the
/// coordinate's zero, so that the ray does not meet its own surface again. A longer normal moves further: see [`lift`].
/// Source: Wächter & Binder 2019, "A fast and robust method for avoiding self-intersection".
#[inline(always)]
pub fn offset_origin(p: Vec3, normal: Vec3) -> Vec3 {
    const ULPS: f32 = 256.0;
    #[inline(always)]
    fn shift(p: f32, n: f32) -> f32 {
        // both ways, and one of them taken: no branch, for loops over lanes
        let ulps = truncated(ULPS * n);
        let far = f32::from_bits((p.to_bits() as i32).wrapping_add(if p < 0.0 { -ulps } else { ulps }) as u32);
        if p.abs() < NEAR_ZERO { p + FLOAT_SCALE * n } else { far }
    }
    Vec3::new(shift(p.x, normal.x), shift(p.y, normal.y), shift(p.z, normal.z))
}

/// The unit `normal` made as long as it takes, and no shorter, for [`offset_origin`] to get off a surface whose points
/// near `p` are known up to `error` in each coordinate.
///
/// Along the normal the surface is uncertain by Σ |nᵢ| δᵢ at most, and a unit normal moves by 2⁻¹⁶ Σ nᵢ² sᵢ at least,
/// where sᵢ is |pᵢ|, or 1 near zero.
#[inline(always)]
pub fn lift(p: Vec3, normal: Vec3, error: Vec3) -> Vec3 {
    let moves = |p: f32| if p.abs() < NEAR_ZERO { FLOAT_SCALE } else { FLOAT_SCALE * p.abs() };
    let moved = (normal * normal).dot(Vec3::new(moves(p.x), moves(p.y), moves(p.z)));
    normal * (normal.abs().dot(error) / moved).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_agree_with_f64() {
        for i in -12_500..=100_000 {
            let turn = i as f32 / 100_000.0;
            let (s, c) = sin_cos_turn(turn);
            let angle = f64::from(turn) * std::f64::consts::TAU;
            assert!((f64::from(s) - angle.sin()).abs() < 5e-7, "sin 2π·{turn} = {s}");
            assert!((f64::from(c) - angle.cos()).abs() < 5e-7, "cos 2π·{turn} = {c}");
        }
    }

    /// Everywhere between whole numbers and right at them, at all magnitudes.
    #[test]
    fn numbers_are_rounded_as_the_language_rounds_them() {
        for exponent in -3..32 {
            for i in 0..5000 {
                let x = 2f32.powi(exponent) * (1.0 + i as f32 / 5000.0);
                for x in [x, x.floor(), x.floor().next_down(), x.floor().next_up()] {
                    if (0.0..8_388_608.0).contains(&x) {
                        assert_eq!(rounded_down(x), x as i32, "{x}");
                    }
                    if (0.0..4_294_967_296.0).contains(&x) {
                        assert_eq!(rounded_down_large(x), x as u32, "{x}");
                    }
                    for x in [x, -x] {
                        assert_eq!(truncated(x), x.clamp(-2_147_483_520.0, 2_147_483_520.0) as i32, "{x}");
                    }
                }
            }
        }
        assert_eq!([0.0, -0.0].map(rounded_down), [0; 2]);
    }

    #[test]
    fn powers_of_two_agree_with_f64() {
        for i in 0..31_000 {
            let x = 1.0 + i as f32 / 1000.0;
            let exact = (-f64::from(x)).exp2() * 4_294_967_296.0;
            let got = f64::from(ln2_scaled_exp(x));
            assert!((got - exact).abs() <= 1.0 + 4e-5 * exact, "2^32·2^-{x}: {got} for {exact}");
        }
    }

    #[test]
    fn offset_origins_move_to_the_side_of_the_normal() {
        for p in [Vec3::ZERO, Vec3::splat(1e-3), Vec3::new(1.0, -2.0, 300.0), Vec3::splat(-1e6)] {
            for n in [Vec3::X, -Vec3::Y, Vec3::new(0.6, 0.0, -0.8)] {
                let moved = offset_origin(p, n) - p;
                assert!(moved.dot(n) > 0.0, "{p} along {n} moved by {moved}");
                assert!(moved.length() <= 1e-4 * (1.0 + p.length()), "{p} moved by {moved}");
            }
        }
    }
}
