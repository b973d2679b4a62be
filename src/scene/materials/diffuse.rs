//! Lambertian reflection.

use glam::Vec3;

use super::{Evaluation, Inverse, Lobes, Scatter, ScatterSample, VaryingParameter};
use crate::{
    math::warp,
    scene::{Rgb, parameters::Parameters},
};

/// f(wo, wi) = ρ/π above the surface, nothing below. Parameter: `reflectance` ρ, 0…1, default 0.5.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Albedo ρ.
    pub reflectance: Rgb,
}

impl Diffuse {
    /// What [`sample`](Scatter::sample) gives, and whether it gives it: without a branch, for loops over lanes.
    #[inline(always)]
    pub(crate) fn sample_anyhow(&self, wo: Vec3, u: [f32; 2]) -> (ScatterSample, bool) {
        let wi = warp::cosine_hemisphere(u);
        let sample = ScatterSample { wi, weight: self.reflectance, pdf: warp::cosine_hemisphere_pdf(wi.z), eta: 1.0 };
        (sample, (wo.z > 0.0) & (wi.z > 0.0))
    }
}

impl Scatter for Diffuse {
    const VARYING: &'static [VaryingParameter] = &[VaryingParameter::reflectance("reflectance")];

    #[inline]
    fn put(&mut self, _reflectance: usize, value: Rgb) {
        self.reflectance = value;
    }

    fn lobes(&self) -> Lobes {
        Lobes { smooth: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 2], _choice: f32) -> Option<ScatterSample> {
        let (sample, above) = self.sample_anyhow(wo, u);
        above.then_some(sample)
    }

    fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
        (wo.z > 0.0 && wi.z > 0.0).then(|| Inverse::of_one_lobe(warp::from_cosine_hemisphere(wi)))
    }

    #[inline(always)]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return Evaluation::ZERO;
        }
        let pdf = warp::cosine_hemisphere_pdf(wi.z);
        Evaluation { value: self.reflectance * pdf, pdf }
    }

    fn read(p: &mut dyn Parameters) -> Self {
        Diffuse { reflectance: p.reflectance("reflectance", 0.5) }
    }

    fn examples() -> Vec<Self> {
        vec![Diffuse { reflectance: Rgb::new(0.9, 0.5, 0.0) }, Diffuse { reflectance: Rgb::ONE }]
    }
}
