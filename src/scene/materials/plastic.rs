//! Smooth plastic: a diffuse base under a clear coat.

use glam::Vec3;

use super::dielectric::relative_index;
use super::{Evaluation, Lobes, Scatter, ScatterSample, VaryingParameter, fresnel};
use crate::math::warp::{INV_PI, cosine_hemisphere, cosine_hemisphere_pdf};
use crate::scene::{Rgb, parameters::Parameters};

/// Reflects perfectly at a smooth interface, and what gets through it is scattered by a diffuse base and tries to leave
/// again, as often as it takes:
/// f = (1 − F(θₒ)) (1 − F(θᵢ)) r/(1 − r R)/(π η²) beside the mirror, F the Fresnel reflectance, r the base's, R the
/// interface's from inside for diffuse light. Without `nonlinear`, 1/(1 − R) in place of 1/(1 − r R): colours are not
/// deepened by what goes around inside.
///
/// Parameters: `diffuse_reflectance`, 0…1, default 0.5; `nonlinear`, default false; `specular_reflectance`, 0…1, default
/// 1; `int_ior` (default `polypropylene`) and `ext_ior` as of [`Dielectric`](super::Dielectric).
/// Source: the model that Mitsuba's documentation of its `plastic` states; R here by integration, there by a fit that is
/// off by 0.1 %.
#[derive(Clone, Copy, Debug)]
pub struct Plastic {
    layers: Layers,
}

/// What plastics are made of, smooth or rough; made so that other reflectances, as textures give them at every hit, cost
/// a few divisions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    /// Index of the coat over that of what is around.
    pub eta: f32,
    pub specular_reflectance: Rgb,
    /// R, of the interface from inside for diffuse light.
    inside: f32,
    nonlinear: bool,
    /// r.
    diffuse_reflectance: Rgb,
    /// r/(1 − r R)/η², or r/(1 − R)/η².
    pub base: Rgb,
    /// Part of samples that go to the interface where it reflects half of the light.
    share: f32,
}

impl Layers {
    /// Reads all parameters; `inside` makes R of η.
    pub fn read(p: &mut dyn Parameters, inside: impl Fn(f32) -> f32) -> Layers {
        let nonlinear = p.boolean("nonlinear").unwrap_or(false);
        let (diffuse, specular) =
            (p.reflectance("diffuse_reflectance", 0.5), p.reflectance("specular_reflectance", 1.0));
        let eta = relative_index(p, "polypropylene");
        Layers::new(eta, inside(eta), diffuse, specular, nonlinear)
    }

    pub fn new(eta: f32, inside: f32, diffuse: Rgb, specular_reflectance: Rgb, nonlinear: bool) -> Layers {
        let kept = if nonlinear { diffuse * inside } else { Rgb::splat(inside) };
        let (specular_part, diffuse_part) = (specular_reflectance.element_sum(), diffuse.element_sum());
        let both = specular_part + diffuse_part;
        Layers {
            eta,
            specular_reflectance,
            inside,
            nonlinear,
            diffuse_reflectance: diffuse,
            base: diffuse / ((1.0 - kept) * (eta * eta)),
            share: if both > 0.0 { specular_part / both } else { 0.5 },
        }
    }

    /// As numbered by [`put`](Layers::put).
    pub const VARYING: &'static [VaryingParameter] =
        &[VaryingParameter::reflectance("diffuse_reflectance"), VaryingParameter::reflectance("specular_reflectance")];

    /// Gives a parameter another value.
    #[inline]
    pub fn put(&mut self, i: usize, value: Rgb) {
        let (diffuse, specular) =
            if i == 0 { (value, self.specular_reflectance) } else { (self.diffuse_reflectance, value) };
        *self = Layers::new(self.eta, self.inside, diffuse, specular, self.nonlinear);
    }

    /// The probability of sampling the interface where it reflects that part of the light.
    #[inline(always)]
    pub fn share_of_interface(&self, reflectance: f32) -> f32 {
        let (interface, base) = (reflectance * self.share, (1.0 - reflectance) * (1.0 - self.share));
        if interface + base > 0.0 { interface / (interface + base) } else { 1.0 }
    }
}

impl Plastic {
    fn new(eta: f32, diffuse: Rgb, specular_reflectance: Rgb, nonlinear: bool) -> Plastic {
        let inside = diffuse_reflectance(1.0 / eta);
        Plastic { layers: Layers::new(eta, inside, diffuse, specular_reflectance, nonlinear) }
    }

    /// The interface's reflectance, and the probability of sampling it.
    #[inline(always)]
    fn mirror(&self, cos: f32) -> (f32, f32) {
        let reflectance = fresnel::dielectric(cos, self.layers.eta).0;
        (reflectance, self.layers.share_of_interface(reflectance))
    }

    /// f · cos θᵢ of the base.
    #[inline(always)]
    fn of_base(&self, reflectance: f32, cos_i: f32) -> Rgb {
        let leaves = 1.0 - fresnel::dielectric(cos_i, self.layers.eta).0;
        self.layers.base * ((1.0 - reflectance) * leaves * cos_i * INV_PI)
    }
}

/// ∫ 2 cos θ F(θ) d cos θ: reflectance of an interface for light from all sides, `eta` = n₂/n₁. By midpoints in cos² θ,
/// where the integrand is smooth but for the critical angle; error below 10⁻⁵.
fn diffuse_reflectance(eta: f32) -> f32 {
    const STEPS: u32 = 1 << 14;
    let at = |i: u32| fresnel::dielectric(((i as f32 + 0.5) / STEPS as f32).sqrt(), eta).0;
    ((0..STEPS).map(|i| f64::from(at(i))).sum::<f64>() / f64::from(STEPS)) as f32
}

impl Scatter for Plastic {
    const VARYING: &'static [VaryingParameter] = Layers::VARYING;

    #[inline]
    fn put(&mut self, i: usize, value: Rgb) {
        self.layers.put(i, value);
    }

    fn lobes(&self) -> Lobes {
        Lobes { smooth: true, delta_reflection: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let (reflectance, share) = self.mirror(wo.z);
        if choice < share {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let weight = self.layers.specular_reflectance * (reflectance / share);
            return Some(ScatterSample { wi, weight, pdf: f32::INFINITY, eta: 1.0 });
        }
        let wi = cosine_hemisphere(u);
        let pdf = (1.0 - share) * cosine_hemisphere_pdf(wi.z);
        (pdf > 0.0).then(|| ScatterSample { wi, weight: self.of_base(reflectance, wi.z) / pdf, pdf, eta: 1.0 })
    }

    #[inline(always)]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Evaluation::ZERO;
        }
        let (reflectance, share) = self.mirror(wo.z);
        Evaluation { value: self.of_base(reflectance, wi.z), pdf: (1.0 - share) * cosine_hemisphere_pdf(wi.z) }
    }

    fn read(p: &mut dyn Parameters) -> Self {
        Plastic { layers: Layers::read(p, |eta| diffuse_reflectance(1.0 / eta)) }
    }

    fn examples() -> Vec<Self> {
        let colour = Rgb::new(0.8, 0.3, 0.1);
        vec![
            Plastic::new(1.49, colour, Rgb::ONE, false),
            Plastic::new(1.9, colour, Rgb::splat(0.5), true),
            Plastic::new(1.5, Rgb::ONE, Rgb::ONE, true),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outside 0.0918 for η = 1.5 (Judd 1942); what comes from inside obeys (1 − R(1/η)) η² = 1 − R(η), by reciprocity.
    #[test]
    fn reflectances_of_diffuse_light_are_those_of_tables() {
        assert!((diffuse_reflectance(1.5) - 0.0918).abs() < 1e-4, "{}", diffuse_reflectance(1.5));
        for eta in [1.1f32, 1.33, 1.5, 2.4] {
            let inside = (1.0 - diffuse_reflectance(1.0 / eta)) * eta * eta;
            assert!((inside / (1.0 - diffuse_reflectance(eta)) - 1.0).abs() < 1e-4, "{eta}");
        }
    }
}
