//! A pane of glass so thin that what goes through is not displaced.

use glam::Vec3;

use super::dielectric::{Interface, perfect_inverse};
use super::{Evaluation, Inverse, Lobes, Scatter, ScatterSample, VaryingParameter, fresnel};
use crate::scene::{Rgb, parameters::Parameters};

/// Reflects and lets through as two parallel smooth interfaces do together: with all reflections between them,
/// R + T²R + T²R³ + … = 2R/(1 + R) is reflected, R = 1 − T the reflectance of one; the rest goes straight on.
///
/// Parameters: those of [`Dielectric`](super::Dielectric).
/// Source: Born & Wolf, Principles of Optics, section 7.6, without interference.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Of the pane (inside) and what is around it.
    interface: Interface,
}

impl Scatter for ThinDielectric {
    const VARYING: &'static [VaryingParameter] = Interface::VARYING;

    #[inline]
    fn put(&mut self, i: usize, value: Rgb) {
        self.interface.put(i, value);
    }

    fn lobes(&self) -> Lobes {
        Lobes { delta_reflection: true, delta_transmission: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, _u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        let one = fresnel::dielectric(wo.z.abs(), self.interface.eta).0;
        let both = 2.0 * one / (1.0 + one);
        let (wi, weight) = if choice < both {
            (Vec3::new(-wo.x, -wo.y, wo.z), self.interface.specular_reflectance)
        } else {
            (-wo, self.interface.specular_transmittance)
        };
        Some(ScatterSample { wi, weight, pdf: f32::INFINITY, eta: 1.0 })
    }

    fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
        let one = fresnel::dielectric(wo.z.abs(), self.interface.eta).0;
        perfect_inverse(2.0 * one / (1.0 + one), wo, wi)
    }

    #[inline(always)]
    fn evaluate(&self, _wo: Vec3, _wi: Vec3) -> Evaluation {
        Evaluation::ZERO
    }

    fn read(p: &mut dyn Parameters) -> Self {
        ThinDielectric { interface: Interface::read(p) }
    }

    fn examples() -> Vec<Self> {
        [1.5, 1.0 / 1.33].map(|eta| ThinDielectric { interface: Interface::clear(eta) }).to_vec()
    }
}
