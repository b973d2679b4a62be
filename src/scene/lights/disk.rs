//! A disk that emits.

use std::f32::consts::PI;

use glam::Vec3;

use super::{Emit, LightSample, per_solid_angle, towards};
use crate::{
    math::{Frame, warp},
    scene::Rgb,
};

/// The front of a disk, uniform over its area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    center: Vec3,
    frame: Frame,
    radius: f32,
    radiance: Rgb,
}

impl Disk {
    /// The disk around `center` whose front is where the unit vector `normal` points.
    pub fn new(center: Vec3, normal: Vec3, radius: f32, radiance: Rgb) -> Disk {
        Disk { center, frame: Frame::new(normal), radius, radiance }
    }

    fn pdf_area(&self) -> f32 {
        warp::INV_PI / (self.radius * self.radius)
    }
}

impl Emit for Disk {
    fn power(&self, _scene_radius: f32) -> Rgb {
        self.radiance * (PI * PI * self.radius * self.radius)
    }

    fn value(&self) -> Rgb {
        self.radiance
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let d = warp::disk(u) * self.radius;
        let q = self.center + self.frame.s * d.x + self.frame.t * d.y;
        towards(p, ng, q, [self.frame.n; 2], self.radiance, self.pdf_area())
    }

    #[inline(always)]
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        per_solid_angle(self.pdf_area(), origin, q, n)
    }
}
