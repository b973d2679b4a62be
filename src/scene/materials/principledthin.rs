//! Thin sheets that scatter light on both of their sides: paper, leaves, cloth.

use glam::Vec3;

use super::{Evaluation, Lobes, Scatter, ScatterSample, VaryingParameter, burley};
use crate::math::warp;
use crate::scene::{Rgb, parameters::Parameters};

/// The diffuse half of Mitsuba's `principledthin`, alike from both sides. With t = `diff_trans`/2 and c = `base_color`,
///
/// - to the side that light comes from: f = (1 − t) c/π times Burley's diffuse lobe, as of
///   [`Principled`](super::Principled);
/// - to the other side: f = t c/π.
///
/// Parameters: `base_color`, 0…1, default 0.5; `diff_trans`, 0…2, default 0: 2 is a sheet that only transmits;
/// `roughness`, 0…1, default 0.5. Specular parts, sheen and flatness are not there: they are faults.
/// Source: Burley 2015, "Extending the Disney BRDF to a BSDF with integrated subsurface scattering", section on thin
/// surfaces; constants as in Mitsuba 3.9.
#[derive(Clone, Copy, Debug)]
pub struct PrincipledThin {
    base_color: Rgb,
    roughness: f32,
    /// t.
    transmitted: f32,
}

impl Scatter for PrincipledThin {
    const VARYING: &'static [VaryingParameter] =
        &[VaryingParameter::reflectance("base_color"), VaryingParameter::fraction("roughness")];

    #[inline]
    fn put(&mut self, parameter: usize, value: Rgb) {
        match parameter {
            0 => self.base_color = value,
            _ => self.roughness = crate::scene::textures::scalar(value),
        }
    }

    fn lobes(&self) -> Lobes {
        Lobes { smooth: true, smooth_transmission: self.transmitted > 0.0, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        let w = warp::cosine_hemisphere(u);
        let same_side = if choice < self.transmitted { -1.0 } else { 1.0 };
        let wi = Vec3::new(w.x, w.y, w.z * same_side * wo.z.signum());
        let Evaluation { value, pdf } = self.evaluate(wo, wi);
        (pdf > 0.0).then(|| ScatterSample { wi, weight: value / pdf, pdf, eta: 1.0 })
    }

    #[inline(always)]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
        if cos_o == 0.0 || cos_i == 0.0 {
            return Evaluation::ZERO;
        }
        let cosine = warp::cosine_hemisphere_pdf(cos_i);
        if wo.z * wi.z < 0.0 {
            let pdf = self.transmitted * cosine;
            return Evaluation { value: self.base_color * pdf, pdf };
        }
        let pdf = (1.0 - self.transmitted) * cosine;
        let cos_d = (0.5 * (1.0 + wo.dot(wi)).max(0.0)).sqrt();
        Evaluation { value: self.base_color * (burley::base(self.roughness, 0.0, cos_o, cos_i, cos_d) * pdf), pdf }
    }

    fn read(p: &mut dyn Parameters) -> Self {
        let base_color = p.reflectance("base_color", 0.5);
        let mut number = |name: &str, default: f32, most: f32| match p.float(name) {
            None => default,
            Some(value) if (0.0..=most).contains(&value) => value,
            Some(value) => {
                p.fault(name, format!("{name} is {value}; it must lie between 0 and {most}"));
                default
            }
        };
        let (transmitted, roughness) = (number("diff_trans", 0.0, 2.0) / 2.0, number("roughness", 0.5, 1.0));
        PrincipledThin { base_color, roughness, transmitted }
    }

    fn examples() -> Vec<Self> {
        let thin =
            |roughness, transmitted| PrincipledThin { base_color: Rgb::new(0.8, 0.5, 0.0), roughness, transmitted };
        vec![thin(0.5, 0.0), thin(0.0, 0.3), thin(0.5, 1.0)]
    }
}
