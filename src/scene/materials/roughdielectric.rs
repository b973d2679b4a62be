//! A rough interface between two dielectrics: ground glass.

use glam::Vec3;

use super::dielectric::Interface;
use super::microfacets::{FacetShape, LEAST_ALPHA, Microfacets};
use super::{Evaluation, Lobes, Scatter, ScatterSample, VaryingParameter, fresnel};
use crate::scene::{Rgb, parameters::Parameters};

/// Tiny smooth interfaces, of which those that are seen reflect or refract by their own Fresnel reflectance F:
///
/// - reflected: f = F D G/(4 |cos θₒ cos θᵢ|);
/// - refracted: f = (1 − F) D G |o·m i·m|/(|cos θₒ cos θᵢ| (o·m + η i·m)²), with η = nᵢ/nₒ and radiance in its medium.
///
/// Parameters: those of [`Dielectric`](super::Dielectric), and of facets those of
/// [`RoughConductor`](super::RoughConductor).
/// Source: Walter et al. 2007, equations 20 and 21 (there for importance, which is η² times as much).
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric {
    interface: Interface,
    facets: Microfacets,
}

impl Scatter for RoughDielectric {
    const VARYING: &'static [VaryingParameter] = &[
        Interface::VARYING[0],
        Interface::VARYING[1],
        VaryingParameter::roughness(Microfacets::ROUGHNESSES[0]),
        VaryingParameter::roughness(Microfacets::ROUGHNESSES[1]),
        VaryingParameter::roughness(Microfacets::ROUGHNESSES[2]),
    ];

    #[inline]
    fn put(&mut self, i: usize, value: Rgb) {
        match i {
            0 | 1 => self.interface.put(i, value),
            _ => self.facets.put(i - 2, value),
        }
    }

    fn lobes(&self) -> Lobes {
        Lobes { smooth: true, smooth_transmission: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        if wo.z == 0.0 {
            return None;
        }
        let (side, eta) = self.seen_from(wo);
        let m = side * self.facets.sample_visible(side * wo, u); // towards wo, on the side that wo is on
        let cos = wo.dot(m);
        let (reflectance, cos_t) = fresnel::dielectric(cos.clamp(0.0, 1.0), eta);
        let visible = self.facets.visible_density(side * wo, side * m);
        if visible <= 0.0 {
            return None;
        }
        if choice < reflectance {
            let wi = 2.0 * cos * m - wo;
            let weight = self.interface.specular_reflectance * self.facets.masking(side * wi, side * m);
            let pdf = reflectance * visible / (4.0 * cos);
            return (wi.z * side > 0.0).then_some(ScatterSample { wi, weight, pdf, eta: 1.0 });
        }
        let wi = (cos / eta - cos_t) * m - wo / eta;
        let narrowing = (cos - eta * cos_t) / eta;
        let weight = self.interface.specular_transmittance * (self.facets.masking(side * wi, side * m) / (eta * eta));
        let pdf = (1.0 - reflectance) * visible * cos_t / (narrowing * narrowing);
        (wi.z * side < 0.0).then_some(ScatterSample { wi, weight, pdf, eta })
    }

    #[inline(always)]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        if wo.z == 0.0 || wi.z == 0.0 {
            return Evaluation::ZERO;
        }
        let (side, eta) = self.seen_from(wo);
        let reflects = (wo.z > 0.0) == (wi.z > 0.0); // no product, which may underflow
        let sum = if reflects { wo + wi } else { wo + eta * wi };
        let Some(m) = sum.try_normalize() else { return Evaluation::ZERO };
        let m = m * (side * m.z).signum();
        let (cos, cos_i) = (wo.dot(m), wi.dot(m));
        if cos <= 0.0 || reflects != (cos_i > 0.0) {
            return Evaluation::ZERO;
        }
        let reflectance = fresnel::dielectric(cos.min(1.0), eta).0;
        let visible = self.facets.visible_density(side * wo, side * m);
        let (pdf, tint) = if reflects {
            (reflectance * visible / (4.0 * cos), self.interface.specular_reflectance)
        } else {
            let narrowing = (cos + eta * cos_i) / eta;
            let pdf = (1.0 - reflectance) * visible * -cos_i / (narrowing * narrowing);
            (pdf, self.interface.specular_transmittance / (eta * eta))
        };
        if !pdf.is_finite() {
            return Evaluation::ZERO; // indices so alike that light goes straight on, as through a delta lobe
        }
        Evaluation { value: tint * (self.facets.masking(side * wi, side * m) * pdf), pdf }
    }

    fn needs_tangents(&self) -> bool {
        self.facets.is_anisotropic()
    }

    fn read(p: &mut dyn Parameters) -> Self {
        RoughDielectric { interface: Interface::read(p), facets: Microfacets::read(p) }
    }

    fn examples() -> Vec<Self> {
        use FacetShape::{Beckmann, Ggx};
        [
            (Beckmann, 0.2, 0.2, 1.5),
            (Ggx, 0.4, 0.4, 1.5),
            (Beckmann, 0.5, 0.5, 1.0 / 1.33),
            (Ggx, 1.0, 1.0, 2.4),
            (Beckmann, LEAST_ALPHA, LEAST_ALPHA, 1.5),
            (Ggx, LEAST_ALPHA, LEAST_ALPHA, 1.0 / 1.33),
            (Beckmann, 0.4, 0.1, 1.0 / 1.5),
            (Ggx, 0.05, 0.5, 1.5),
        ]
        .map(|(shape, alpha_u, alpha_v, eta)| RoughDielectric {
            interface: Interface::clear(eta),
            facets: Microfacets { shape, alpha_u, alpha_v },
        })
        .to_vec()
    }
}

impl RoughDielectric {
    /// The sign of the side that `wo` is on, and the index behind the surface over that before it, from there.
    #[inline(always)]
    fn seen_from(&self, wo: Vec3) -> (f32, f32) {
        if wo.z >= 0.0 { (1.0, self.interface.eta) } else { (-1.0, 1.0 / self.interface.eta) }
    }
}
