//! A cylinder that emits.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec3};

use super::{
    Ball, Emission, EmissionInverse, Emit, EmitterKind, LightSample, from_surface, invert_surface, per_solid_angle,
    surface_pdf, towards,
};
use crate::{
    math::{sin_cos_turn, warp},
    scene::{Rgb, parametrisation::cylinder_uv, textures::Varying},
};

/// A cylinder without caps that emits from its outside (from its inside, if flipped), uniform over its area.
#[derive(Clone, Debug, PartialEq)]
pub struct Cylinder {
    /// Where its axis begins.
    pub start: Vec3,
    /// Its length, > 0.
    pub length: f32,
    /// Radius, > 0.
    pub radius: f32,
    /// Its own axes, orthonormal, of which the third is that of the cylinder.
    pub axes: Mat3,
    /// The front is the inside.
    pub flipped: bool,
    /// Radiance, W/(m² sr) per channel.
    pub radiance: Varying,
}

impl Cylinder {
    fn area(&self) -> f32 {
        TAU * self.radius * self.length
    }

    /// A place, uniform over the area, with the geometric and the shading normal of the front there and the radiance.
    #[inline(always)]
    fn place(&self, u: [f32; 2]) -> (Vec3, [Vec3; 2], Rgb) {
        let (sin, cos) = sin_cos_turn(u[0]);
        let outside = self.axes.x_axis * cos + self.axes.y_axis * sin;
        let from_start = self.axes.z_axis * (u[1] * self.length) + outside * self.radius;
        let front = if self.flipped { -outside } else { outside };
        let radiance = self.radiance.at(|| cylinder_uv(&self.axes, self.length, from_start));
        (self.start + from_start, [front; 2], radiance)
    }

    /// The inverse of [`place`](Self::place).
    fn invert_place(&self, q: Vec3) -> Option<[f32; 2]> {
        let local = self.axes.transpose() * (q - self.start);
        Some([warp::turn_of(local.x, local.y), local.z / self.length])
    }
}

impl Emit for Cylinder {
    fn kind(&self) -> EmitterKind {
        EmitterKind::Surface
    }

    fn power(&self, _scene_radius: f32) -> Rgb {
        self.radiance.mean() * (PI * self.area())
    }

    #[inline(always)]
    fn surface(&self) -> Option<&Varying> {
        Some(&self.radiance)
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (q, normals, radiance) = self.place(u);
        towards(p, ng, q, normals, radiance, 1.0 / self.area())
    }

    #[inline(always)]
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        per_solid_angle(1.0 / self.area(), origin, q, n)
    }

    #[inline(always)]
    fn emit(&self, place: [f32; 2], direction: [f32; 2], _scene: Ball) -> Option<Emission> {
        let (q, normals, radiance) = self.place(place);
        Some(from_surface(q, normals, radiance, 1.0 / self.area(), direction))
    }

    #[inline(always)]
    fn emission_pdf(&self, normals: [Vec3; 2], direction: Vec3, _scene: Ball) -> [f32; 2] {
        surface_pdf(1.0 / self.area(), normals, direction)
    }

    fn invert_emission(&self, q: Vec3, _triangle: u32, normals: [Vec3; 2], direction: Vec3) -> Option<EmissionInverse> {
        invert_surface(self.invert_place(q)?, normals, direction)
    }

    fn invert_sample(&self, _p: Vec3, _ng: Vec3, q: Vec3, _triangle: u32) -> Option<Option<[f32; 2]>> {
        self.invert_place(q).map(Some)
    }
}
