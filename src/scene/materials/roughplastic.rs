//! Rough plastic: a diffuse base under a clear coat that is not polished.

use glam::Vec3;

use super::coat::Coat;
use super::microfacets::{FacetShape, LEAST_ALPHA, Microfacets};
use super::plastic::Layers;
use super::{Evaluation, Lobes, Scatter, ScatterSample, VaryingParameter, fresnel};
use crate::math::warp::{INV_PI, cosine_hemisphere, cosine_hemisphere_pdf};
use crate::scene::{Rgb, parameters::Parameters};

/// [`Plastic`](super::Plastic) whose coat is made of facets: they reflect as those of
/// [`RoughDielectric`](super::RoughDielectric) do, and the base shines with
/// f = T(θₒ) T(θᵢ) r/(1 − r R)/(π η²), T(θ) what they let through of light from θ, R what they reflect of diffuse light
/// from inside. Without `nonlinear`, 1/(1 − R) in place of 1/(1 − r R).
///
/// Parameters: those of [`Plastic`](super::Plastic), and of facets those of
/// [`RoughConductor`](super::RoughConductor), of one roughness.
///
/// T and R are Mitsuba's (3.9) also where they are not exact, as pictures are compared: T is taken at 64 cosines and
/// linear between; R is a mean over the same cosines with both ends counted in full, which for polypropylene in air and a
/// vanishing roughness gives 0.5790 where the integral is 0.5900, and so colours up to 2.6 % darker than
/// [`Plastic`](super::Plastic)'s.
/// Source: the model that Mitsuba's documentation of its `roughplastic` states; Walter et al. 2007.
#[derive(Clone, Copy, Debug)]
pub struct RoughPlastic {
    layers: Layers,
    facets: Microfacets,
    coat: &'static Coat,
}

impl RoughPlastic {
    fn new(facets: Microfacets, eta: f32, diffuse: Rgb, specular_reflectance: Rgb, nonlinear: bool) -> RoughPlastic {
        let coat = Coat::of(facets, eta);
        let layers = Layers::new(eta, coat.inside(), diffuse, specular_reflectance, nonlinear);
        RoughPlastic { layers, facets, coat }
    }

    /// What the facets let through of light from θₒ, and the probability of sampling them.
    #[inline(always)]
    fn interface(&self, cos: f32) -> (f32, f32) {
        let through = self.coat.transmittance(cos);
        (through, self.layers.share_of_interface(1.0 - through))
    }
}

impl Scatter for RoughPlastic {
    const VARYING: &'static [VaryingParameter] = Layers::VARYING;

    #[inline]
    fn put(&mut self, i: usize, value: Rgb) {
        self.layers.put(i, value);
    }

    fn lobes(&self) -> Lobes {
        Lobes { smooth: true, smooth_base: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let wi = if choice < self.interface(wo.z).1 {
            let m = self.facets.sample_visible(wo, u);
            2.0 * wo.dot(m) * m - wo
        } else {
            cosine_hemisphere(u)
        };
        let Evaluation { value, pdf } = self.evaluate(wo, wi);
        (pdf > 0.0).then(|| ScatterSample { wi, weight: value / pdf, pdf, eta: 1.0 })
    }

    #[inline(always)]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Evaluation::ZERO;
        }
        let m = (wo + wi).normalize();
        let reflected = self.facets.masking(wo, m) * self.facets.density(m) / (4.0 * wo.z);
        let reflectance = fresnel::dielectric(wo.dot(m).clamp(0.0, 1.0), self.layers.eta).0;
        let mirrored = self.layers.specular_reflectance * (reflectance * self.facets.masking(wi, m) * reflected);
        let (through, share) = self.interface(wo.z);
        let base = self.layers.base * (through * self.coat.transmittance(wi.z) * wi.z * INV_PI);
        Evaluation { value: mirrored + base, pdf: share * reflected + (1.0 - share) * cosine_hemisphere_pdf(wi.z) }
    }

    fn read(p: &mut dyn Parameters) -> Self {
        let facets = Microfacets::read(p);
        if facets.is_anisotropic() {
            p.fault("alpha_v", "alpha_u and alpha_v differ; a roughplastic has one roughness".into());
        }
        let facets = Microfacets { alpha_v: facets.alpha_u, ..facets };
        let layers = Layers::read(p, |eta| Coat::of(facets, eta).inside());
        RoughPlastic { layers, facets, coat: Coat::of(facets, layers.eta) }
    }

    fn examples() -> Vec<Self> {
        use FacetShape::{Beckmann, Ggx};
        let of = |shape, alpha, eta, specular, nonlinear| {
            let colour = Rgb::new(0.8, 0.3, 0.1);
            RoughPlastic::new(Microfacets::isotropic(shape, alpha), eta, colour, Rgb::splat(specular), nonlinear)
        };
        let white = RoughPlastic::new(Microfacets::isotropic(Ggx, 0.1), 1.5, Rgb::ONE, Rgb::ONE, true);
        vec![
            of(Beckmann, 0.1, 1.49, 1.0, false),
            of(Ggx, 0.3, 1.9, 0.5, true),
            of(Beckmann, 1.0, 1.3, 1.0, true),
            of(Ggx, 0.2, 1.0 / 1.33, 1.0, false),
            of(Beckmann, LEAST_ALPHA, 1.49, 1.0, false),
            of(Ggx, LEAST_ALPHA, 1.49, 1.0, true),
            white,
        ]
    }
}
