//! The lobes that Burley's materials are made of, with the constants that Mitsuba gives them.
//!
//! Sources: Burley 2012, "Physically based shading at Disney" (base, sheen, coat); Burley 2015, "Extending the Disney
//! BRDF to a BSDF with integrated subsurface scattering" (flatness). Where the two and Mitsuba 3.9 differ, this is as
//! Mitsuba: the coat's value lacks the 1/(4 cos θₒ cos θᵢ) of a microfacet lobe, and the sheen the 1/π.

use glam::Vec3;

use super::fresnel;
use super::microfacets::{FacetShape, Microfacets};
use crate::math::{sin_cos_turn, warp::INV_PI};
use crate::scene::{Rgb, textures::scalar};

/// (1 − cos θ)⁵: how far Schlick's reflectance has gone from that of normal incidence (0) to that of grazing (1).
#[inline(always)]
pub(super) fn grazing(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    (m * m) * (m * m) * m
}

/// The same for a surface of relative index `eta`: from the denser side by the angle of refraction, 1 from the critical
/// angle on. Source: Schlick 1994; Burley 2015, section on refraction.
#[inline(always)]
pub(super) fn schlick_weight(cos: f32, eta: f32) -> f32 {
    grazing(if eta > 1.0 { cos } else { fresnel::dielectric(cos.clamp(0.0, 1.0), eta).1 })
}

/// Reflectance of a dielectric at normal incidence: ((η − 1)/(η + 1))².
#[inline(always)]
pub(super) fn normal_reflectance(eta: f32) -> f32 {
    let amplitude = (eta - 1.0) / (eta + 1.0);
    amplitude * amplitude
}

/// The colour at luminance 1; white where it is black.
#[inline(always)]
pub(super) fn hue(colour: Rgb) -> Rgb {
    let luminance = scalar(colour);
    if luminance > 0.0 { colour / luminance } else { Rgb::ONE }
}

/// π f of the base over its colour, which is
///
/// - rough: (1 − wₒ/2)(1 − wᵢ/2) + R (wₒ + wᵢ + wₒ wᵢ (R − 1)), dark at grazing angles where the surface is smooth and
///   bright towards the light where it is rough;
/// - flat: 5/4 (S (1/(cos θₒ + cos θᵢ) − 1/2) + 1/2), S = (1 + (R/2 − 1) wₒ)(1 + (R/2 − 1) wᵢ), an imitation of
///   scattering below the surface after Hanrahan & Krueger 1993;
///
/// or `flatness` of the way from the first to the second; w = [`grazing`] of either direction and
/// R = 2 `roughness` cos² θ_d, θ_d half the angle between them.
#[inline(always)]
pub(super) fn base(roughness: f32, flatness: f32, cos_o: f32, cos_i: f32, cos_d: f32) -> f32 {
    let (wo, wi) = (grazing(cos_o), grazing(cos_i));
    let retro = 2.0 * roughness * cos_d * cos_d;
    let rough = (1.0 - 0.5 * wo) * (1.0 - 0.5 * wi) + retro * (wo + wi + wo * wi * (retro - 1.0));
    if flatness == 0.0 {
        return rough;
    }
    let change = 0.5 * retro - 1.0;
    let below = (1.0 + change * wo) * (1.0 + change * wi);
    let flat = 1.25 * (below * (1.0 / (cos_o + cos_i) - 0.5) + 0.5);
    rough + flatness * (flat - rough)
}

/// f of cloth's fibres: [`grazing`] of half the angle between the directions, `tint` of the way from white to the hue of
/// the base.
#[inline(always)]
pub(super) fn sheen(base_color: Rgb, tint: f32, cos_d: f32) -> Rgb {
    let colour = if tint > 0.0 { Rgb::ONE + tint * (hue(base_color) - Rgb::ONE) } else { Rgb::ONE };
    colour * grazing(cos_d)
}

/// A coat of lacquer: facets with tails longer than those of GGX, D(m) = (1 − α²)/(−π ln α² (sin² θ + α² cos² θ)) (GTR
/// with exponent 1), α from 0.1 without gloss to 0.001; masked like GGX of roughness 1/4; reflecting 4 % at normal
/// incidence.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    alpha2: f32,
}

impl Coat {
    pub fn new(gloss: f32) -> Coat {
        let alpha = 0.1 + gloss * (0.001 - 0.1);
        Coat { alpha2: alpha * alpha }
    }

    /// D(m) for m.z > 0; ∫ D(m) cos θ dm = 1.
    #[inline(always)]
    pub fn density(&self, m: Vec3) -> f32 {
        let sin2 = m.x * m.x + m.y * m.y; // 1 − cos² would lose the peak's digits
        (1.0 - self.alpha2) * INV_PI / (-libm::logf(self.alpha2) * (sin2 + self.alpha2 * m.z * m.z))
    }

    /// A normal with density D(m) cos θ, by inversion: cos² θ = (1 − α²⁽¹⁻ᵘ⁾)/(1 − α²).
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        let power = libm::expf((1.0 - u[1]) * libm::logf(self.alpha2));
        let all = 1.0 - self.alpha2;
        let cos = ((1.0 - power) / all).max(0.0).sqrt();
        let sin = ((power - self.alpha2) / all).max(0.0).sqrt();
        let (s, c) = sin_cos_turn(u[0]);
        Vec3::new(c * sin, s * sin, cos)
    }

    /// f between two directions above the surface, with their half vector `m`, as Mitsuba has it (see above).
    #[inline(always)]
    pub fn value(&self, wo: Vec3, wi: Vec3, m: Vec3, eta: f32) -> f32 {
        const NORMAL_REFLECTANCE: f32 = 0.04;
        const MASKS: Microfacets = Microfacets { shape: FacetShape::Ggx, alpha_u: 0.25, alpha_v: 0.25 };
        let reflectance = NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * schlick_weight(wo.dot(m), eta);
        reflectance * self.density(m) * MASKS.masking(wo, m) * MASKS.masking(wi, m)
    }
}

/// GGX of a roughness and an anisotropy in 0…1: α = roughness², stretched along x and narrowed along y by
/// 1/√(1 − 0.9 anisotropic). Source: Burley 2012, section 5.4.
#[inline(always)]
pub(super) fn facets(roughness: f32, anisotropic: f32) -> Microfacets {
    const LEAST: f32 = 1e-3;
    let (alpha, aspect) = (roughness * roughness, (1.0 - 0.9 * anisotropic).sqrt());
    let [alpha_u, alpha_v] = [alpha / aspect, alpha * aspect].map(|alpha| alpha.max(LEAST));
    Microfacets { shape: FacetShape::Ggx, alpha_u, alpha_v }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// f = c/π (1 + (F₉₀ − 1) wₒ)(1 + (F₉₀ − 1) wᵢ), F₉₀ = 1/2 + 2 roughness cos² θ_d: Burley 2012, section 5.3, of which
    /// the form of 2015 is an expansion.
    #[test]
    fn the_base_has_the_reflectance_at_grazing_angles_of_2012() {
        for roughness in [0.0, 0.3, 1.0] {
            for (cos_o, cos_i, cos_d) in [(1.0, 1.0, 1.0), (0.2, 0.2, 1.0), (0.1, 0.4, 0.3), (0.05, 0.05, 0.05)] {
                let change = 2.0 * roughness * cos_d * cos_d - 0.5;
                let expected = (1.0 + change * grazing(cos_o)) * (1.0 + change * grazing(cos_i));
                let got = base(roughness, 0.0, cos_o, cos_i, cos_d);
                assert!((got - expected).abs() < 1e-6, "{got} for {expected}");
            }
        }
    }

    #[test]
    fn flatness_goes_from_the_one_lobe_to_the_other() {
        let of = |flatness| base(0.7, flatness, 0.4, 0.8, 0.6);
        assert!((of(0.25) - (0.75 * of(0.0) + 0.25 * of(1.0))).abs() < 1e-6);
        // head-on both directions are free of grazing: 5/4 (1/2 − 1/2 + 1/2)
        assert!((base(0.7, 1.0, 1.0, 1.0, 1.0) - 0.625).abs() < 1e-6);
    }

    #[test]
    fn a_hue_has_luminance_one_and_black_has_none() {
        assert_eq!(hue(Rgb::ZERO), Rgb::ONE);
        assert!((hue(Rgb::splat(0.3)) - Rgb::ONE).length() < 1e-6);
        let (pale, deep) = (hue(Rgb::new(0.2, 0.4, 0.6)), hue(Rgb::new(0.1, 0.2, 0.3)));
        assert!((pale - deep).length() < 1e-6);
    }

    /// Midpoints in (ln tan θ), which resolves peaks of any width.
    #[test]
    fn facets_of_the_coat_cover_the_surface_once() {
        for gloss in [0.0, 0.5, 1.0] {
            let (coat, steps, low, high) = (Coat::new(gloss), 20_000, 1e-6f64.ln(), 1e5f64.ln());
            let step = (high - low) / f64::from(steps);
            let mut sum = 0.0;
            for i in 0..steps {
                let tan = (low + (f64::from(i) + 0.5) * step).exp();
                let (cos, sin) = (1.0 / (1.0 + tan * tan).sqrt(), tan / (1.0 + tan * tan).sqrt());
                let density = f64::from(coat.density(Vec3::new(sin as f32, 0.0, cos as f32)));
                // dm = 2π sin θ dθ, dθ = cos²θ tan θ d ln tan θ
                sum += density * cos * sin * cos * cos * tan * step * std::f64::consts::TAU;
            }
            assert!((sum - 1.0).abs() < 1e-3, "{sum} for gloss {gloss}");
        }
    }

    /// The share of facets (by their shadow on the surface) steeper than θ is ln(sin² θ + α² cos² θ)/ln α².
    #[test]
    fn the_coat_is_sampled_in_proportion() {
        for gloss in [0.0, 1.0] {
            let coat = Coat::new(gloss);
            for u in [0.05f32, 0.3, 0.8, 0.99] {
                let m = coat.sample([0.3, u]);
                let reached = (m.x * m.x + m.y * m.y + coat.alpha2 * m.z * m.z).ln() / coat.alpha2.ln();
                assert!((m.length() - 1.0).abs() < 1e-5);
                assert!((1.0 - reached - u).abs() < 1e-4, "{reached} for {u} at gloss {gloss}");
            }
        }
    }
}
