//! A disk that emits.

use std::f32::consts::PI;

use glam::{Mat3, Vec3};

use super::{
    Ball, Emission, EmissionInverse, Emit, EmitterKind, LightSample, from_surface, invert_surface, per_solid_angle,
    surface_pdf, towards,
};
use crate::{
    math::{Frame, warp},
    scene::{Rgb, parametrisation::disk_uv, textures::Varying},
};

/// The front of a disk, uniform over its area.
#[derive(Clone, Debug, PartialEq)]
pub struct Disk {
    center: Vec3,
    frame: Frame,
    radius: f32,
    axes: Mat3,
    radiance: Varying,
}

impl Disk {
    /// The disk around `center` with those orthonormal axes; its front is where the third one points.
    pub fn new(center: Vec3, radius: f32, axes: Mat3, radiance: Varying) -> Disk {
        Disk { center, frame: Frame::new(axes.z_axis), radius, axes, radiance }
    }

    fn pdf_area(&self) -> f32 {
        warp::INV_PI / (self.radius * self.radius)
    }

    /// A place, uniform over the area, with the geometric and the shading normal of the front there and the radiance.
    #[inline(always)]
    fn place(&self, u: [f32; 2]) -> (Vec3, [Vec3; 2], Rgb) {
        let d = warp::disk(u) * self.radius;
        let from_centre = self.frame.s * d.x + self.frame.t * d.y;
        let radiance = self.radiance.at(|| disk_uv(&self.axes, self.radius, from_centre));
        (self.center + from_centre, [self.frame.n; 2], radiance)
    }

    /// The inverse of [`place`](Self::place).
    fn invert_place(&self, q: Vec3) -> Option<[f32; 2]> {
        let d = self.frame.to_local(q - self.center) / self.radius;
        Some(warp::from_disk(d.truncate()))
    }
}

impl Emit for Disk {
    fn kind(&self) -> EmitterKind {
        EmitterKind::Surface
    }

    fn power(&self, _scene_radius: f32) -> Rgb {
        self.radiance.mean() * (PI * PI * self.radius * self.radius)
    }

    #[inline(always)]
    fn surface(&self) -> Option<&Varying> {
        Some(&self.radiance)
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (q, normals, radiance) = self.place(u);
        towards(p, ng, q, normals, radiance, self.pdf_area())
    }

    #[inline(always)]
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        per_solid_angle(self.pdf_area(), origin, q, n)
    }

    #[inline(always)]
    fn emit(&self, place: [f32; 2], direction: [f32; 2], _scene: Ball) -> Option<Emission> {
        let (q, normals, radiance) = self.place(place);
        Some(from_surface(q, normals, radiance, self.pdf_area(), direction))
    }

    #[inline(always)]
    fn emission_pdf(&self, normals: [Vec3; 2], direction: Vec3, _scene: Ball) -> [f32; 2] {
        surface_pdf(self.pdf_area(), normals, direction)
    }

    fn invert_emission(&self, q: Vec3, _triangle: u32, normals: [Vec3; 2], direction: Vec3) -> Option<EmissionInverse> {
        invert_surface(self.invert_place(q)?, normals, direction)
    }

    fn invert_sample(&self, _p: Vec3, _ng: Vec3, q: Vec3, _triangle: u32) -> Option<Option<[f32; 2]>> {
        self.invert_place(q).map(Some)
    }
}
