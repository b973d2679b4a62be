//! A point.

use std::f32::consts::PI;

use glam::Vec3;

use super::{
    Ball, Emission, EmissionInverse, Emit, EmitterKind, LightSample, SHORT_OF_LIGHT, from_point, origin_towards,
};
use crate::{
    math::warp,
    scene::{Rgb, parameters::Parameters},
};

/// A point that shines equally in all directions. Parameters: `position` (default: the origin of `to_world`),
/// `intensity`, W/sr, default 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where it is, in world space.
    pub position: Vec3,
    /// Radiant intensity, W/sr per channel.
    pub intensity: Rgb,
}

/// Uniform over all directions.
const PDF: f32 = 0.25 * warp::INV_PI;

impl Point {
    pub(super) fn read(p: &mut dyn Parameters) -> Point {
        let position = p.point("position");
        let origin = p.to_world().transform_point3(Vec3::ZERO);
        Point { position: position.unwrap_or(origin), intensity: p.radiance("intensity", 1.0) }
    }
}

impl Emit for Point {
    fn kind(&self) -> EmitterKind {
        EmitterKind::Point
    }

    fn power(&self, _scene_radius: f32) -> Rgb {
        self.intensity * (4.0 * PI)
    }

    fn largest(&self) -> f32 {
        self.intensity.max_element()
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        let origin = origin_towards(p, ng, self.position - p);
        let to = self.position - origin;
        let d2 = to.length_squared();
        let distance = d2.sqrt();
        (distance > 0.0).then(|| LightSample {
            origin,
            wi: to / distance,
            tfar: distance * SHORT_OF_LIGHT,
            weight: self.intensity / d2,
            pdf: f32::INFINITY,
            normals: [Vec3::ZERO; 2],
            light: 0,
        })
    }

    #[inline(always)]
    fn pdf(&self, _origin: Vec3, _q: Vec3, _n: Vec3) -> f32 {
        0.0
    }

    #[inline(always)]
    fn emit(&self, _place: [f32; 2], direction: [f32; 2], _scene: Ball) -> Option<Emission> {
        Some(from_point(self.position, warp::sphere(direction), self.intensity, PDF))
    }

    #[inline(always)]
    fn emission_pdf(&self, _normals: [Vec3; 2], _direction: Vec3, _scene: Ball) -> [f32; 2] {
        [1.0, PDF]
    }

    fn invert_emission(
        &self,
        _q: Vec3,
        _triangle: u32,
        _normals: [Vec3; 2],
        direction: Vec3,
    ) -> Option<EmissionInverse> {
        Some(EmissionInverse { place: None, direction: warp::from_sphere(direction) })
    }

    fn invert_sample(&self, _p: Vec3, _ng: Vec3, _q: Vec3, _triangle: u32) -> Option<Option<[f32; 2]>> {
        Some(None)
    }
}
