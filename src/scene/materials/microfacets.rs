//! Rough surfaces as heights of tiny mirrors: how their normals are distributed, masked and sampled.

use glam::Vec3;

use crate::math::{
    sin_cos_turn,
    warp::{self, INV_PI},
};
use crate::scene::{Rgb, parameters::Parameters, textures::scalar};

/// A distribution of microfacet normals m over the upper hemisphere, with separable masking by Smith. Two roughnesses
/// along x and y are a surface of roughness 1 that was stretched by as much: with the slopes s = m.x/(m.z α_u) and
/// t = m.y/(m.z α_v) in place of tan θ/α everything is as where both are alike.
///
/// Parameters as of [`RoughConductor`](super::RoughConductor).
/// Source: Walter et al. 2007, "Microfacet models for refraction through rough surfaces"; visible normals: Heitz &
/// d'Eon 2014; stretching: Heitz 2014, "Understanding the masking-shadowing function", section 5.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Microfacets {
    pub shape: FacetShape,
    /// Roughness along x.
    pub alpha_u: f32,
    /// Roughness along y.
    pub alpha_v: f32,
}

/// Distribution of slopes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FacetShape {
    /// Normal: D(m) = exp(−s² − t²)/(π α_u α_v cos⁴θ).
    Beckmann,
    /// Student-like, with long tails: D(m) = 1/(π α_u α_v cos⁴θ (1 + s² + t²)²) (Trowbridge & Reitz 1975).
    Ggx,
}

/// Below this a facet's direction is lost in rounding; Mitsuba has the same limit.
pub(super) const LEAST_ALPHA: f32 = 1e-4;

impl Microfacets {
    pub fn read(p: &mut dyn Parameters) -> Microfacets {
        p.boolean("sample_visible");
        let shape = match p.word("distribution", &["beckmann", "ggx"]) {
            None | Some(0) => FacetShape::Beckmann,
            Some(_) => FacetShape::Ggx,
        };
        let mut roughness = |name: &str| {
            let value = p.float(name)?;
            if !value.is_finite() || value < 0.0 {
                p.fault(name, format!("{name} is {value}; a roughness is finite and not negative"));
                return None;
            }
            Some(value)
        };
        let [alpha, u, v] = Self::ROUGHNESSES.map(&mut roughness);
        let given = [("alpha", alpha), ("alpha_u", u), ("alpha_v", v)].map(|(name, a)| a.is_some() || p.varies(name));
        match given {
            [_, false, false] | [false, true, true] => {}
            [true, ..] => p.fault("alpha", "give either alpha or alpha_u and alpha_v, not both".into()),
            [_, true, false] => p.fault("alpha_u", "alpha_u and alpha_v are given together".into()),
            [_, false, true] => p.fault("alpha_v", "alpha_u and alpha_v are given together".into()),
        }
        let [alpha_u, alpha_v] = [u, v].map(|own| alpha.or(own).unwrap_or(0.1).max(LEAST_ALPHA));
        Microfacets { shape, alpha_u, alpha_v }
    }

    /// The names of the roughness, both ways and either way, as numbered by [`put`](Microfacets::put).
    pub const ROUGHNESSES: [&'static str; 3] = ["alpha", "alpha_u", "alpha_v"];

    /// Gives a roughness the value of a texture.
    #[inline]
    pub fn put(&mut self, i: usize, value: Rgb) {
        let alpha = scalar(value).max(LEAST_ALPHA);
        if i != 2 {
            self.alpha_u = alpha;
        }
        if i != 1 {
            self.alpha_v = alpha;
        }
    }

    /// The same roughness both ways.
    pub fn isotropic(shape: FacetShape, alpha: f32) -> Microfacets {
        Microfacets { shape, alpha_u: alpha, alpha_v: alpha }
    }

    /// Whether turning the surface about its normal changes it.
    pub fn is_anisotropic(&self) -> bool {
        self.alpha_u != self.alpha_v
    }

    /// D(m): area of facets with normal `m` by unit area of the surface and unit solid angle; ∫ D(m) cos θ dm = 1.
    #[inline(always)]
    pub fn density(&self, m: Vec3) -> f32 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let (alpha2, cos2) = (self.alpha_u * self.alpha_v, m.z * m.z);
        // over a common denominator, as a division takes longer than the rest
        let (x, y) = (self.alpha_v * m.x, self.alpha_u * m.y);
        let across = (x * x + y * y) / (alpha2 * alpha2);
        match self.shape {
            // so steep that the density underflows, as do the powers of the cosine
            FacetShape::Beckmann if across > NO_FACETS * cos2 => 0.0,
            FacetShape::Beckmann => libm::expf(-across / cos2) * INV_PI / (alpha2 * cos2 * cos2),
            FacetShape::Ggx => INV_PI / (alpha2 * (across + cos2) * (across + cos2)),
        }
    }

    /// G₁(v): the part of the facets with normal `m` that is seen from `v`, on either side; 0 where `v` is on one side of
    /// the surface and on the other of the facet. For Beckmann exact, not the usual rational approximation.
    #[inline(always)]
    pub fn masking(&self, v: Vec3, m: Vec3) -> f32 {
        if v.dot(m) * v.z * m.z <= 0.0 {
            return 0.0;
        }
        let (x, y) = (self.alpha_u * v.x, self.alpha_v * v.y);
        let slope2 = (x * x + y * y) / (v.z * v.z);
        match self.shape {
            FacetShape::Ggx => 2.0 / (1.0 + (1.0 + slope2).sqrt()),
            FacetShape::Beckmann => {
                let a = 1.0 / slope2.sqrt();
                if a >= NOTHING_IS_MASKED {
                    return 1.0;
                }
                // Λ = (exp(−a²)/(a √π) − erfc(a))/2
                let lambda = 0.5 * (libm::expf(-a * a) * FRAC_1_SQRT_PI as f32 / a - libm::erfcf(a));
                1.0 / (1.0 + lambda)
            }
        }
    }

    /// A normal of the facets that `v` (v.z > 0) sees, with [`visible_density`](Microfacets::visible_density).
    #[inline(always)]
    pub fn sample_visible(&self, v: Vec3, u: [f32; 2]) -> Vec3 {
        let stretched = self.stretched(v);
        let m = match self.shape {
            FacetShape::Ggx => visible_hemisphere_normal(stretched, u),
            FacetShape::Beckmann => {
                let [x, y] = visible_gaussian_slope(stretched, u);
                Vec3::new(-x, -y, 1.0)
            }
        };
        self.facet(m)
    }

    /// The inverse of [`sample_visible`](Microfacets::sample_visible).
    pub fn invert_visible(&self, v: Vec3, m: Vec3) -> [f32; 2] {
        let stretched = self.stretched(v);
        // (x, y, 1) are proportional to a normal of the surface of roughness 1
        let [x, y] = [m.x / (m.z * self.alpha_u), m.y / (m.z * self.alpha_v)];
        match self.shape {
            FacetShape::Ggx => {
                let n = Vec3::new(x, y, 1.0).normalize();
                let reflected = 2.0 * stretched.dot(n) * n - stretched;
                let u = (reflected.z + stretched.z) / (1.0 + stretched.z);
                [warp::turn_of(reflected.x, reflected.y), 1.0 - u]
            }
            FacetShape::Beckmann => part_of_visible_gaussian_slopes(stretched, [-x, -y]),
        }
    }

    /// Where a surface of roughness 1 looks from as this one does from `v`.
    #[inline(always)]
    pub fn stretched(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.alpha_u * v.x, self.alpha_v * v.y, v.z).normalize()
    }

    /// The facet that the one with the normal along `m` of a surface of roughness 1 becomes.
    #[inline(always)]
    pub fn facet(&self, m: Vec3) -> Vec3 {
        Vec3::new(self.alpha_u * m.x, self.alpha_v * m.y, m.z.max(0.0)).normalize()
    }

    /// Density of visible normals with respect to solid angle: G₁(v) D(m) |v · m|/|cos θ_v|.
    #[inline(always)]
    pub fn visible_density(&self, v: Vec3, m: Vec3) -> f32 {
        self.masking(v, m) * self.density(m) * (v.dot(m) / v.z).abs()
    }
}

/// 1/√π.
const FRAC_1_SQRT_PI: f64 = 0.564_189_583_547_756_3;
/// Squared slope over α² from which on Beckmann's density is as good as 0: e⁻⁸⁰.
const NO_FACETS: f32 = 80.0;
/// Slopes of a surface of roughness 1 beyond are less probable than 10⁻¹⁶.
const STEEPEST: f64 = 6.0;
/// Beckmann's Λ(a) is below 10⁻⁹ from here on.
const NOTHING_IS_MASKED: f32 = 4.0;

/// Normals of a hemisphere that are seen from `v`: half way between `v` and a point of the cap of the sphere that a beam
/// along `v` is reflected to, which is uniform there.
/// Source: Dupuy & Benyoub 2023, "Sampling visible GGX normals with spherical caps".
#[inline(always)]
pub(super) fn visible_hemisphere_normal(v: Vec3, u: [f32; 2]) -> Vec3 {
    let z = (1.0 - u[1]) * (1.0 + v.z) - v.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (s, c) = sin_cos_turn(u[0]);
    v + Vec3::new(r * c, r * s, z)
}

/// Slopes of a surface of roughness 1 with normally distributed slopes, as seen from `v`.
#[inline(always)]
fn visible_gaussian_slope(v: Vec3, u: [f32; 2]) -> [f32; 2] {
    let sin = (v.x * v.x + v.y * v.y).sqrt();
    let tan = f64::from(sin) / f64::from(v.z.max(f32::MIN_POSITIVE));
    let (along, across) = (slope_along(u[0], tan), slope_along(u[1], 0.0));
    let (cos_phi, sin_phi) = if sin > 0.0 { (v.x / sin, v.y / sin) } else { (1.0, 0.0) };
    [cos_phi * along - sin_phi * across, sin_phi * along + cos_phi * across]
}

/// The inverse of [`visible_gaussian_slope`].
fn part_of_visible_gaussian_slopes(v: Vec3, [x, y]: [f32; 2]) -> [f32; 2] {
    let sin = (v.x * v.x + v.y * v.y).sqrt();
    let tan = f64::from(sin) / f64::from(v.z.max(f32::MIN_POSITIVE));
    let (cos_phi, sin_phi) = if sin > 0.0 { (v.x / sin, v.y / sin) } else { (1.0, 0.0) };
    let (along, across) = (cos_phi * x + sin_phi * y, cos_phi * y - sin_phi * x);
    [part_below(along, tan), part_below(across, 0.0)]
}

/// The inverse of [`slope_along`].
fn part_below(slope: f32, tan: f64) -> f32 {
    let below = |s: f64| libm::erfc(-s) + tan * FRAC_1_SQRT_PI * libm::exp(-s * s);
    let end = if tan * STEEPEST > 1.0 { 1.0 / tan } else { STEEPEST };
    (below(f64::from(slope).min(end)) / below(end)) as f32
}

/// The slope s below which the part `u` of what is seen lies, seen at an angle with that tangent: the solution of
/// F(s) = u F(1/tan) with F(s) = 1 + erf(s) + tan/√π exp(−s²), the integral of visible slopes
/// (1 − s tan) exp(−s²), which end at 1/tan.
///
/// Newton's steps within a bracket that shrinks to either side, halved where a step would leave it. F(s) is computed
/// with erfc, so that slopes far in the lower tail keep their digits.
#[inline(always)]
fn slope_along(u: f32, tan: f64) -> f32 {
    const PRECISION: f64 = 1e-8;
    let weight = tan * FRAC_1_SQRT_PI;
    let below = |s: f64| libm::erfc(-s) + weight * libm::exp(-s * s);
    let end = if tan * STEEPEST > 1.0 { 1.0 / tan } else { STEEPEST };
    // never 0 or 1, whose slopes are infinite or of no density
    let u = f64::from(u).clamp(1e-9, 1.0 - 1e-9);
    let wanted = u * below(end);
    let (mut low, mut high) = (-STEEPEST, end);
    let mut s = (end - 1.0).min(0.0).max(low);
    for _ in 0..40 {
        let error = below(s) - wanted;
        if error > 0.0 {
            high = s
        } else {
            low = s
        }
        let slope = 2.0 * FRAC_1_SQRT_PI * libm::exp(-s * s) * (1.0 - s * tan);
        let step = s - error / slope;
        let next = if step > low && step < high { step } else { 0.5 * (low + high) };
        if (next - s).abs() < PRECISION {
            return next as f32;
        }
        s = next;
    }
    s as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Counter, Purpose, Rng, unit_f32};

    fn all() -> Vec<Microfacets> {
        let shapes = [FacetShape::Beckmann, FacetShape::Ggx];
        let roughnesses = [(0.05, 0.05), (0.3, 0.3), (1.0, 1.0), (0.05, 0.3), (0.6, 0.2), (0.1, 1.0)];
        let both = |shape| roughnesses.map(|(alpha_u, alpha_v)| Microfacets { shape, alpha_u, alpha_v });
        shapes.into_iter().flat_map(both).collect()
    }

    fn towards(cos: f32) -> Vec3 {
        let sin = (1.0 - cos * cos).sqrt();
        Vec3::new(0.6 * sin, -0.8 * sin, cos)
    }

    /// ∫ f over the upper hemisphere by midpoints in (log tan θ, φ), which resolves peaks of any width.
    fn integral(f: impl Fn(Vec3) -> f64) -> f64 {
        let (steps, turns) = (1000, 128);
        let (low, high) = (1e-6f64.ln(), 1e4f64.ln());
        let mut sum = 0.0;
        for i in 0..steps {
            let step = (high - low) / f64::from(steps);
            let tan = (low + (f64::from(i) + 0.5) * step).exp();
            let (cos, sin) = (1.0 / (1.0 + tan * tan).sqrt(), tan / (1.0 + tan * tan).sqrt());
            for j in 0..turns {
                let phi = std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(turns);
                let m = Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, cos as f32);
                // dm = sin θ dθ dφ, dθ = cos²θ d tan θ, d tan θ = tan θ d ln tan θ
                sum += f(m) * sin * cos * cos * tan * step * std::f64::consts::TAU / f64::from(turns);
            }
        }
        sum
    }

    #[test]
    fn facets_cover_the_surface_once() {
        for facets in all() {
            let area = integral(|m| f64::from(facets.density(m) * m.z));
            assert!((area - 1.0).abs() < 2e-3, "{facets:?}: {area}");
        }
    }

    /// What is seen of the facets is the projected surface: ∫ G₁ D max(0, v · m) dm = cos θ_v, which makes the density of
    /// visible normals integrate to one.
    #[test]
    fn visible_facets_cover_what_is_seen() {
        for facets in all() {
            for cos in [1.0, 0.7, 0.2, 0.05] {
                let v = towards(cos);
                let total = integral(|m| f64::from(facets.visible_density(v, m)));
                assert!((total - 1.0).abs() < 5e-3, "{facets:?} from cos θ = {cos}: {total}");
            }
        }
    }

    /// Means of x, y, x² of sampled normals against integrals: 2¹⁶ samples, five standard errors.
    #[test]
    fn visible_normals_are_sampled_with_their_density() {
        let rng = Rng::new(5);
        for facets in all() {
            for cos in [1.0, 0.7, 0.2, 0.05] {
                let v = towards(cos);
                let n = 1u64 << 16;
                let functions: [fn(Vec3) -> f64; 4] =
                    [|m| f64::from(m.x), |m| f64::from(m.y), |m| f64::from(m.x * m.x), |m| f64::from(m.z)];
                let mut sums = [[0.0f64; 2]; 4];
                for step in 0..n {
                    let counter = Counter { ladder: 0, replica: 0, step, purpose: Purpose::Primary };
                    let words = rng.words(counter, 0);
                    let m = facets.sample_visible(v, [unit_f32(words[0]), unit_f32(words[1])]);
                    assert!((m.length() - 1.0).abs() < 1e-5 && m.z >= 0.0, "{m}");
                    for (sum, f) in sums.iter_mut().zip(functions) {
                        let value = f(m);
                        *sum = [sum[0] + value, sum[1] + value * value];
                    }
                }
                for (i, (sum, f)) in sums.iter().zip(functions).enumerate() {
                    let mean = sum[0] / n as f64;
                    let error = ((sum[1] / n as f64 - mean * mean).max(0.0) / n as f64).sqrt();
                    let exact = integral(|m| f(m) * f64::from(facets.visible_density(v, m)));
                    let allowed = 5.0 * error + 3e-3 * exact.abs() + 1e-4;
                    assert!((mean - exact).abs() < allowed, "{facets:?} from {v}: moment {i} is {mean}, not {exact}");
                }
            }
        }
    }

    #[test]
    fn slopes_solve_their_equation_wherever_they_are() {
        for tan in [0.0, 1e-6, 0.3, 1.0, 5.0, 100.0, 1e5] {
            let end = if tan > 1.0 / 6.0 { 1.0 / tan } else { 6.0 };
            let below = |s: f64| libm::erfc(-s) + tan * FRAC_1_SQRT_PI * libm::exp(-s * s);
            let mut last = f32::NEG_INFINITY;
            for i in 0..=1000 {
                let u = i as f32 / 1000.0;
                let s = slope_along(u, tan);
                assert!(s >= last && f64::from(s) <= end + 1e-6, "tan {tan}: {s} at {u} after {last}");
                last = s;
                let reached = below(f64::from(s)) / below(end);
                assert!((reached - f64::from(u)).abs() < 1e-5, "tan {tan}: {reached} for {u}");
            }
        }
    }

    #[test]
    fn smooth_limits_hold() {
        for shape in [FacetShape::Beckmann, FacetShape::Ggx] {
            let facets = Microfacets::isotropic(shape, LEAST_ALPHA);
            for (i, cos) in [1.0, 0.5, 0.1].into_iter().enumerate() {
                let v = towards(cos);
                for j in 1..20 {
                    let m = facets.sample_visible(v, [j as f32 / 20.0, 0.37]);
                    assert!(m.z > 1.0 - 1e-6, "{facets:?} {i}: {m}");
                    assert!((facets.masking(v, m) - 1.0).abs() < 1e-4);
                }
            }
        }
    }
}
