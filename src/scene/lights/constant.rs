//! The same radiance from every direction.

use std::f32::consts::PI;

use glam::Vec3;

use super::{Ball, Emission, Emit, EmitterKind, LightSample, from_infinity, origin_towards};
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
    fn kind(&self) -> EmitterKind {
        EmitterKind::Surrounding
    }

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
        Some(LightSample::from_infinity(origin, wi, self.radiance / PDF, PDF))
    }

    #[inline(always)]
    fn pdf(&self, _origin: Vec3, _q: Vec3, _n: Vec3) -> f32 {
        PDF
    }

    #[inline(always)]
    fn emit(&self, place: [f32; 2], direction: [f32; 2], scene: Ball) -> Option<Emission> {
        Some(from_infinity(scene, -warp::sphere(place), self.radiance, PDF, self.kind(), direction))
    }

    #[inline(always)]
    fn emission_pdf(&self, _normals: [Vec3; 2], _direction: Vec3, scene: Ball) -> [f32; 2] {
        [PDF, scene.pdf()]
    }
}
