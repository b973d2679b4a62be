//! Light from one direction, such as the sun's.

use std::f32::consts::PI;

use glam::Vec3;

use super::{Ball, Emission, Emit, EmitterKind, LightSample, from_infinity, origin_towards};
use crate::scene::{Rgb, parameters::Parameters};

/// Parallel light from infinitely far away. Parameters: `direction` in which it travels, or the z axis of `to_world`;
/// `irradiance` on a surface that it meets at right angles, W/m², default 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directional {
    /// Unit vector from the light.
    pub direction: Vec3,
    /// W/m² per channel.
    pub irradiance: Rgb,
}

impl Directional {
    pub(super) fn read(p: &mut dyn Parameters) -> Directional {
        let (given, to_world) = (p.vector("direction"), p.to_world());
        let along = to_world.transform_vector3(Vec3::Z);
        if given.is_some() && along != Vec3::Z {
            p.fault("direction", "give either direction or to_world, not both".into());
        }
        let direction = given.unwrap_or(along).try_normalize().unwrap_or_else(|| {
            p.fault("direction", "the light has no direction: its vector is 0 or not finite".into());
            Vec3::Z
        });
        Directional { direction, irradiance: p.radiance("irradiance", 1.0) }
    }
}

impl Emit for Directional {
    fn kind(&self) -> EmitterKind {
        EmitterKind::SingleDirection
    }

    /// What enters the sphere around the scene: E π r².
    fn power(&self, scene_radius: f32) -> Rgb {
        self.irradiance * (PI * scene_radius * scene_radius)
    }

    fn largest(&self) -> f32 {
        self.irradiance.max_element()
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        let wi = -self.direction;
        let origin = origin_towards(p, ng, wi);
        Some(LightSample::from_infinity(origin, wi, self.irradiance, f32::INFINITY))
    }

    #[inline(always)]
    fn pdf(&self, _origin: Vec3, _q: Vec3, _n: Vec3) -> f32 {
        0.0
    }

    #[inline(always)]
    fn emit(&self, _place: [f32; 2], direction: [f32; 2], scene: Ball) -> Option<Emission> {
        Some(from_infinity(scene, self.direction, self.irradiance, 1.0, self.kind(), direction))
    }

    #[inline(always)]
    fn emission_pdf(&self, _normals: [Vec3; 2], _direction: Vec3, scene: Ball) -> [f32; 2] {
        [1.0, scene.pdf()]
    }
}
