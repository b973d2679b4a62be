//! Light from one direction, such as the sun's.

use std::f32::consts::PI;

use glam::Vec3;

use super::{Emit, LightSample, origin_towards};
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
        Some(LightSample { origin, wi, tfar: f32::MAX, weight: self.irradiance, pdf: f32::INFINITY })
    }

    #[inline(always)]
    fn pdf(&self, _origin: Vec3, _q: Vec3, _n: Vec3) -> f32 {
        0.0
    }
}
