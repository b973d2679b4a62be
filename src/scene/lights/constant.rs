//! The same radiance from every direction.

use std::f32::consts::PI;

use glam::Vec3;

use super::{Emit, LightSample, origin_towards};
use crate::{
    math::warp,
    scene::{Rgb, parameters::Parameters},
};

/// Constant radiance from infinitely far away. Parameter: `radiance`, W/(m² sr), default 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Radiance, W/(m² sr) per channel.
    pub radiance: Rgb,
}

/// Uniform over all directions.
const PDF: f32 = 0.25 * warp::INV_PI;

impl Constant {
    pub(super) fn read(p: &mut dyn Parameters) -> Constant {
        Constant { radiance: p.radiance("radiance", 1.0) }
    }
}

impl Emit for Constant {
    /// What enters the sphere around the scene: L · π · 4πr².
    fn power(&self, scene_radius: f32) -> Rgb {
        self.radiance * (4.0 * PI * PI * scene_radius * scene_radius)
    }

    fn largest(&self) -> f32 {
        self.radiance.max_element()
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let wi = warp::sphere(u);
        let origin = origin_towards(p, ng, wi);
        Some(LightSample { origin, wi, tfar: f32::MAX, weight: self.radiance / PDF, pdf: PDF })
    }

    #[inline(always)]
    fn pdf(&self, _origin: Vec3, _q: Vec3, _n: Vec3) -> f32 {
        PDF
    }
}
