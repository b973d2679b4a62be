//! A rough conductor: brushed or sand-blasted metal.

use glam::Vec3;

use super::conductor::{Metal, gold};
use super::microfacets::{FacetShape, LEAST_ALPHA, Microfacets};
use super::{Evaluation, Inverse, Lobes, Scatter, ScatterSample, VaryingParameter};
use crate::scene::{Rgb, parameters::Parameters};

/// Tiny mirrors of metal: f = F D G/(4 cos θₒ cos θᵢ), without the light that goes on between them.
///
/// Parameters: those of [`Conductor`](super::Conductor); `distribution`, `beckmann` (default) or `ggx`; and
/// `alpha`, the roughness (the root mean square slope of Beckmann's facets), default 0.1, at least 1e-4 (below, it is
/// taken as that). `alpha_u` and `alpha_v` in its place are the roughnesses along ∂p/∂u (as far as it lies in the
/// tangent plane) and across it, both or none: brushed along v, a metal is rough along u. `sample_visible` is read and
/// of no account: it is about noise in other renderers, here visible normals are always what is sampled.
/// Source: Cook & Torrance 1982; Walter et al. 2007.
#[derive(Clone, Copy, Debug)]
pub struct RoughConductor {
    metal: Metal,
    facets: Microfacets,
}

impl Scatter for RoughConductor {
    const VARYING: &'static [VaryingParameter] = &[
        Metal::VARYING,
        VaryingParameter::roughness(Microfacets::ROUGHNESSES[0]),
        VaryingParameter::roughness(Microfacets::ROUGHNESSES[1]),
        VaryingParameter::roughness(Microfacets::ROUGHNESSES[2]),
    ];

    #[inline]
    fn put(&mut self, i: usize, value: Rgb) {
        match i {
            0 => self.metal.specular_reflectance = value,
            _ => self.facets.put(i - 1, value),
        }
    }

    fn lobes(&self) -> Lobes {
        Lobes { smooth: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 2], _choice: f32) -> Option<ScatterSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let m = self.facets.sample_visible(wo, u);
        let cos = wo.dot(m);
        let wi = 2.0 * cos * m - wo;
        if wi.z <= 0.0 || cos <= 0.0 {
            return None;
        }
        let pdf = self.facets.visible_density(wo, m) / (4.0 * cos);
        let weight = self.metal.reflectance(cos) * self.facets.masking(wi, m);
        (pdf > 0.0).then_some(ScatterSample { wi, weight, pdf, eta: 1.0 })
    }

    fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return None;
        }
        let m = (wo + wi).normalize();
        (wo.dot(m) > 0.0).then(|| Inverse::of_one_lobe(self.facets.invert_visible(wo, m)))
    }

    #[inline(always)]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Evaluation::ZERO;
        }
        let m = (wo + wi).normalize();
        let pdf = self.facets.masking(wo, m) * self.facets.density(m) / (4.0 * wo.z);
        Evaluation { value: self.metal.reflectance(wo.dot(m)) * (self.facets.masking(wi, m) * pdf), pdf }
    }

    fn needs_tangents(&self) -> bool {
        self.facets.is_anisotropic()
    }

    fn read(p: &mut dyn Parameters) -> Self {
        RoughConductor { metal: Metal::read(p), facets: Microfacets::read(p) }
    }

    fn examples() -> Vec<Self> {
        use FacetShape::{Beckmann, Ggx};
        [
            (Beckmann, 0.15, 0.15),
            (Ggx, 0.3, 0.3),
            (Beckmann, 0.9, 0.9),
            (Ggx, 1.0, 1.0),
            (Beckmann, LEAST_ALPHA, LEAST_ALPHA),
            (Ggx, LEAST_ALPHA, LEAST_ALPHA),
            (Beckmann, 0.05, 0.3),
            (Ggx, 0.7, 0.1),
            (Beckmann, 1.0, 0.01),
        ]
        .map(|(shape, alpha_u, alpha_v)| RoughConductor {
            metal: gold(),
            facets: Microfacets { shape, alpha_u, alpha_v },
        })
        .to_vec()
    }
}
