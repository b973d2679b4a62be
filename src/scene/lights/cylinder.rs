//! A cylinder that emits.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::{Emit, LightSample, per_solid_angle, towards};
use crate::{
    math::{Frame, sin_cos_turn},
    scene::Rgb,
};

/// A cylinder without caps that emits from its outside (from its inside, if flipped), uniform over its area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    start: Vec3,
    /// Its normal is the axis.
    frame: Frame,
    length: f32,
    radius: f32,
    flipped: bool,
    radiance: Rgb,
}

impl Cylinder {
    /// The cylinder around the line from `start` to `end`, which are not the same.
    pub fn new(start: Vec3, end: Vec3, radius: f32, flipped: bool, radiance: Rgb) -> Cylinder {
        let (axis, length) = (end - start).normalize_and_length();
        Cylinder { start, frame: Frame::new(axis), length, radius, flipped, radiance }
    }

    fn area(&self) -> f32 {
        TAU * self.radius * self.length
    }
}

impl Emit for Cylinder {
    fn power(&self, _scene_radius: f32) -> Rgb {
        self.radiance * (PI * self.area())
    }

    fn value(&self) -> Rgb {
        self.radiance
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (sin, cos) = sin_cos_turn(u[0]);
        let outside = self.frame.s * cos + self.frame.t * sin;
        let q = self.start + self.frame.n * (u[1] * self.length) + outside * self.radius;
        let front = if self.flipped { -outside } else { outside };
        towards(p, ng, q, [front; 2], self.radiance, 1.0 / self.area())
    }

    #[inline(always)]
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        per_solid_angle(1.0 / self.area(), origin, q, n)
    }
}
