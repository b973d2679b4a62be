//! Maps from the unit square to the domains of rendering, with density and inverse.
//!
//! Every map is measure-preserving up to its density and continuous almost everywhere, so a small step in the
//! square stays a small step on the domain.

use glam::{Vec2, Vec3};

use super::sin_cos_turn;

/// 1/π.
pub const INV_PI: f32 = std::f32::consts::FRAC_1_PI;

/// The unit disk, concentric squares to concentric circles; density 1/π.
/// Source: Shirley & Chiu 1997, "A low distortion map between disk and square".
#[inline(always)]
pub fn disk(u: [f32; 2]) -> Vec2 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    // an eighth of a turn for |minor| = |major|; negative radii reach the other half, so turns lie in [−1/8, 3/8]
    let across = a.abs() > b.abs();
    let (major, minor) = if across { (a, b) } else { (b, a) };
    let part = 0.125 * (minor / major); // NaN in the middle
    let (s, c) = sin_cos_turn(if across { part } else { 0.25 - part });
    if major == 0.0 { Vec2::ZERO } else { Vec2::new(major * c, major * s) }
}

/// The inverse of [`disk`].
pub fn from_disk(d: Vec2) -> [f32; 2] {
    let [x, y] = [d.x, d.y].map(f64::from);
    let (r, eighths) = (x.hypot(y), 8.0 / std::f64::consts::TAU);
    if r == 0.0 {
        return [0.5; 2];
    }
    let (a, b) = if x.abs() > y.abs() {
        let a = r.copysign(x);
        (a, a * eighths * libm::atan(y / x))
    } else {
        let b = r.copysign(y);
        (b * eighths * libm::atan(x / y), b)
    };
    [a, b].map(|side| (0.5 * (side + 1.0)) as f32)
}

/// The upper hemisphere with density cos θ/π (Malley's method over [`disk`]).
#[inline(always)]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let d = disk(u);
    Vec3::new(d.x, d.y, (1.0 - d.length_squared()).max(0.0).sqrt())
}

/// The inverse of [`cosine_hemisphere`].
pub fn from_cosine_hemisphere(w: Vec3) -> [f32; 2] {
    from_disk(w.truncate())
}

/// Density of [`cosine_hemisphere`] with respect to solid angle.
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * INV_PI
}

/// The unit sphere; density 1/4π.
#[inline(always)]
pub fn sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[1];
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (s, c) = sin_cos_turn(u[0]);
    Vec3::new(r * c, r * s, z)
}

/// The inverse of [`sphere`].
pub fn from_sphere(w: Vec3) -> [f32; 2] {
    [turn_of(w.x, w.y), 0.5 - 0.5 * w.z]
}

/// The angle of a point about the origin, in turns within [0, 1].
pub fn turn_of(x: f32, y: f32) -> f32 {
    let turn = libm::atan2(f64::from(y), f64::from(x)) / std::f64::consts::TAU;
    (if turn < 0.0 { turn + 1.0 } else { turn }) as f32
}

/// Directions within the angle of a cone about +z; density 1/(2π(1 − cos θ_max)). Given 1 − cos θ_max rather than
/// the cosine, which loses all digits for small cones.
#[inline(always)]
pub fn cone(u: [f32; 2], one_minus_cos_max: f32) -> Vec3 {
    let d = u[1] * one_minus_cos_max; // 1 − cos θ
    let r = (d * (2.0 - d)).max(0.0).sqrt();
    let (s, c) = sin_cos_turn(u[0]);
    Vec3::new(r * c, r * s, 1.0 - d)
}

/// The inverse of [`cone`].
pub fn from_cone(w: Vec3, one_minus_cos_max: f32) -> [f32; 2] {
    let one_minus_cos = (w.x * w.x + w.y * w.y) / (1.0 + w.z); // 1 − z would have no digits in small cones
    [turn_of(w.x, w.y), one_minus_cos / one_minus_cos_max]
}

/// Barycentric coordinates (of the second and third corner) uniform over a triangle; density 1/area.
#[inline(always)]
pub fn triangle(u: [f32; 2]) -> [f32; 2] {
    let r = (1.0 - u[0]).max(0.0).sqrt();
    [1.0 - r, u[1] * r]
}

/// The inverse of [`triangle`].
pub fn from_triangle([b, c]: [f32; 2]) -> [f32; 2] {
    let r = 1.0 - b;
    [1.0 - r * r, if r > 0.0 { c / r } else { 0.5 }]
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 1 << 20;
    const BINS: usize = 16;

    /// χ² of a 16 × 16 histogram of equal masses; 255 degrees of freedom, level 10⁻⁶ each.
    fn assert_uniform(name: &str, cells: impl Iterator<Item = [f32; 2]>) {
        let mut counts = vec![0u32; BINS * BINS];
        let mut n = 0.0;
        for [a, b] in cells {
            let i = ((a * BINS as f32) as usize).min(BINS - 1);
            let j = ((b * BINS as f32) as usize).min(BINS - 1);
            counts[i * BINS + j] += 1;
            n += 1.0;
        }
        let expected = n / (BINS * BINS) as f64;
        let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
        assert!(chi2 < 378.0, "{name}: χ² = {chi2} over 255 degrees of freedom");
    }

    fn squares() -> impl Iterator<Item = [f32; 2]> {
        let rng = crate::rng::Rng::new(11);
        (0..N as u64).map(move |i| {
            let c = crate::rng::Counter { ladder: 0, replica: 0, step: i, purpose: crate::rng::Purpose::Primary };
            let w = rng.words(c, 0);
            [crate::rng::unit_f32(w[0]), crate::rng::unit_f32(w[1])]
        })
    }

    #[test]
    fn warps_have_the_densities_they_state() {
        // each domain is mapped back to a square by the integral of its density: uniform if that is the density
        assert_uniform("disk", squares().map(disk).map(|d| [turn_of(d.x, d.y), d.length_squared()]));
        assert_uniform(
            "cosine_hemisphere",
            squares().map(cosine_hemisphere).map(|w| [turn_of(w.x, w.y), 1.0 - w.z * w.z]),
        );
        assert_uniform("sphere", squares().map(sphere).map(|w| [turn_of(w.x, w.y), 0.5 - 0.5 * w.z]));
        assert_uniform("cone", squares().map(|u| cone(u, 0.3)).map(|w| [turn_of(w.x, w.y), (1.0 - w.z) / 0.3]));
        assert_uniform(
            "triangle",
            squares().map(triangle).map(|[b, c]| [1.0 - (1.0 - b) * (1.0 - b), c / (1.0 - b).max(1e-9)]),
        );
    }

    #[test]
    fn directions_have_unit_length() {
        for u in squares().take(4096) {
            for w in [cosine_hemisphere(u), sphere(u), cone(u, 1e-4)] {
                assert!((w.length() - 1.0).abs() < 1e-5, "{w} from {u:?}");
            }
        }
    }

    /// Up to what f32 keeps: where a map crushes the square, only what it makes of the numbers is compared.
    #[test]
    fn inverses_give_back_what_was_mapped() {
        for u in squares().take(65536) {
            let near = |name: &str, back: [f32; 2], bound: f32| {
                let apart = |i: usize| (back[i] - u[i]).abs().min(1.0 - (back[i] - u[i]).abs());
                assert!(apart(0).max(apart(1)) < bound, "{name}: {back:?} for {u:?}");
            };
            let far = |v: Vec2| v.length() > 0.05;
            near("disk", from_disk(disk(u)), 1e-6);
            near("cosine_hemisphere", from_cosine_hemisphere(cosine_hemisphere(u)), 1e-6);
            let (w, v, b) = (sphere(u), cone(u, 1e-4), triangle(u));
            if far(w.truncate()) {
                near("sphere", from_sphere(w), 1e-5);
            }
            if u[1] > 1e-3 {
                near("cone", from_cone(v, 1e-4), 2e-5);
            }
            if b[0] < 0.95 {
                near("triangle", from_triangle(b), 1e-5);
            }
            assert!((sphere(from_sphere(w)) - w).length() < 2e-6, "{u:?}");
            let [b2, c2] = triangle(from_triangle(b));
            assert!((b2 - b[0]).abs() + (c2 - b[1]).abs() < 1e-6, "{u:?}");
        }
    }

    #[test]
    fn the_disk_map_is_continuous() {
        for u in squares().take(65536) {
            let (v, h) = ([(u[0] + 1e-4).min(0.9999), u[1]], 1e-4);
            assert!((disk(u) - disk(v)).length() < 10.0 * h, "{u:?}");
        }
    }
}
