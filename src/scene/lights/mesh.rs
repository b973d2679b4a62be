//! A triangle mesh that emits.

use std::{f32::consts::PI, sync::Arc};

use glam::Vec3;

use super::{
    Ball, Emission, EmissionInverse, Emit, EmitterKind, LightSample, from_surface, invert_surface, per_solid_angle,
    surface_pdf, towards,
};
use crate::{
    math::{Cumulative, place_within, warp},
    scene::{Mesh, Rgb, textures::Varying},
};

/// The front of a mesh, uniform over its area.
#[derive(Clone, Debug)]
pub struct MeshLight {
    mesh: Arc<Mesh>,
    /// In proportion to area.
    triangles: Cumulative,
    /// Where they lie, triangle by triangle.
    faces: Vec<Face>,
    inverse_area: f32,
    radiance: Varying,
}

/// A triangle as [`MeshLight::place`] needs it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Face {
    /// The first corner, and what leads from there to the second and the third.
    pub corner_and_edges: [Vec3; 3],
    /// Unit normal of the front.
    pub normal: Vec3,
    /// The numbers that choose it, from the first to before the second.
    pub range: [f32; 2],
}

impl Face {
    fn new([a, b, c]: [Vec3; 3], range: [f32; 2]) -> Face {
        let (e1, e2) = (b - a, c - a);
        Face { corner_and_edges: [a, e1, e2], normal: e1.cross(e2).normalize(), range }
    }
}

/// The point of a triangle, given by a corner and two edges, with barycentric coordinates (1 − b − c, b, c).
#[inline(always)]
pub(crate) fn on_face([corner, e1, e2]: [Vec3; 3], [b, c]: [f32; 2]) -> Vec3 {
    corner + e1 * b + e2 * c
}

impl PartialEq for MeshLight {
    fn eq(&self, other: &MeshLight) -> bool {
        Arc::ptr_eq(&self.mesh, &other.mesh) && self.radiance == other.radiance
    }
}

impl MeshLight {
    /// The mesh as a light; it has some area.
    pub fn new(mesh: Arc<Mesh>, radiance: Varying) -> MeshLight {
        let areas: Vec<f64> = (0..mesh.triangles.len() as u32).map(|t| mesh.area(t)).collect();
        let total: f64 = areas.iter().sum();
        let triangles = Cumulative::new(areas.into_iter());
        let face = |t: usize| Face::new(mesh.corners(t as u32), triangles.range(t));
        MeshLight {
            faces: (0..mesh.triangles.len()).map(face).collect(),
            triangles,
            inverse_area: (1.0 / total) as f32,
            mesh,
            radiance,
        }
    }

    /// A place, uniform over the area, with the geometric and the shading normal of the front there and the radiance. The
    /// first number also chooses the triangle, so that near numbers give near points of one triangle.
    #[inline(always)]
    fn place(&self, u: [f32; 2]) -> (Vec3, [Vec3; 2], Rgb) {
        let triangle = self.triangles.index(u[0]);
        let face = &self.faces[triangle];
        let [b, c] = warp::triangle([place_within(u[0], face.range), u[1]]);
        let normals = [face.normal, self.mesh.shading_normal(triangle as u32, b, c, face.normal)];
        (on_face(face.corner_and_edges, [b, c]), normals, self.radiance.at(|| self.mesh.uv(triangle as u32, b, c)))
    }

    /// The triangle that a number chooses.
    #[inline(always)]
    pub(crate) fn face(&self, u: f32) -> &Face {
        &self.faces[self.triangles.index(u)]
    }

    /// Its radiance, which is the same everywhere.
    ///
    /// # Panics
    /// If it is textured.
    #[inline(always)]
    pub(crate) fn constant_radiance(&self) -> Rgb {
        self.radiance.at(|| unreachable!("a profile without textures"))
    }

    /// 1 / area.
    #[inline(always)]
    pub(crate) fn inverse_area(&self) -> f32 {
        self.inverse_area
    }

    /// The inverse of [`place`](Self::place).
    fn invert_place(&self, q: Vec3, triangle: u32) -> Option<[f32; 2]> {
        let [p0, p1, p2] = self.mesh.corners(triangle).map(|p| p.as_dvec3());
        let (e1, e2, to) = (p1 - p0, p2 - p0, q.as_dvec3() - p0);
        let n = e1.cross(e2);
        let coordinate = |across: glam::DVec3| (across.dot(n) / n.length_squared()).clamp(0.0, 1.0) as f32;
        let [within, v] = warp::from_triangle([coordinate(to.cross(e2)), coordinate(e1.cross(to))]);
        let [start, end] = self.triangles.range(triangle as usize);
        (start < end).then_some([start + within * (end - start), v])
    }
}

impl Emit for MeshLight {
    fn kind(&self) -> EmitterKind {
        EmitterKind::Surface
    }

    fn power(&self, _scene_radius: f32) -> Rgb {
        self.radiance.mean() * (PI / self.inverse_area)
    }

    #[inline(always)]
    fn surface(&self) -> Option<&Varying> {
        Some(&self.radiance)
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (q, normals, radiance) = self.place(u);
        towards(p, ng, q, normals, radiance, self.inverse_area)
    }

    #[inline(always)]
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        per_solid_angle(self.inverse_area, origin, q, n)
    }

    #[inline(always)]
    fn emit(&self, place: [f32; 2], direction: [f32; 2], _scene: Ball) -> Option<Emission> {
        let (q, normals, radiance) = self.place(place);
        Some(from_surface(q, normals, radiance, self.inverse_area, direction))
    }

    #[inline(always)]
    fn emission_pdf(&self, normals: [Vec3; 2], direction: Vec3, _scene: Ball) -> [f32; 2] {
        surface_pdf(self.inverse_area, normals, direction)
    }

    fn triangle(&self, place: [f32; 2]) -> u32 {
        self.triangles.index(place[0]) as u32
    }

    fn invert_emission(&self, q: Vec3, triangle: u32, normals: [Vec3; 2], direction: Vec3) -> Option<EmissionInverse> {
        invert_surface(self.invert_place(q, triangle)?, normals, direction)
    }

    fn invert_sample(&self, _p: Vec3, _ng: Vec3, q: Vec3, triangle: u32) -> Option<Option<[f32; 2]>> {
        self.invert_place(q, triangle).map(Some)
    }
}
