//! What a ray meets.

use std::sync::Arc;

use glam::Vec3;

use super::{Profile, Scene, materials::Material};
use crate::{
    embree::{Hit, MISS},
    math::{Frame, lift},
    scene::{Mesh, description::ShapeGeometry},
};

/// One surface of the scene, ready for look-up by the number of its Embree geometry.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    pub(super) kind: Kind,
    /// Material seen from the front and from the back.
    pub(super) materials: [u32; 2],
    /// Both sides are seen as fronts.
    pub(super) two_sided: bool,
    /// Index into the scene's emitters, or [`NO_LIGHT`].
    pub(super) light: u32,
}

/// Marks a surface that does not emit.
pub const NO_LIGHT: u32 = u32::MAX;

#[derive(Clone, Debug)]
pub(super) enum Kind {
    Flat(Arc<Mesh>),
    Smooth(Arc<Mesh>),
    Sphere { center: Vec3, radius: f32, flipped: bool },
    Disk { normal: Vec3, center: Vec3, radius: f32 },
    Cylinder { start: Vec3, axis: Vec3, length: f32, radius: f32, flipped: bool },
}

impl Kind {
    pub(super) fn new(geometry: &ShapeGeometry) -> Kind {
        match geometry {
            ShapeGeometry::Mesh(mesh) if mesh.normals.is_empty() => Kind::Flat(mesh.clone()),
            ShapeGeometry::Mesh(mesh) => Kind::Smooth(mesh.clone()),
            &ShapeGeometry::Sphere { center, radius, flipped } => Kind::Sphere { center, radius, flipped },
            &ShapeGeometry::Disk { normal, center, radius } => Kind::Disk { normal, center, radius },
            &ShapeGeometry::Cylinder { start, end, radius, flipped } => {
                let (axis, length) = (end - start).normalize_and_length();
                Kind::Cylinder { start, axis, length, radius, flipped }
            }
        }
    }

    /// Position, unit geometric normal of the front and unit shading normal of a hit.
    #[inline(always)]
    fn point<P: Profile>(&self, hit: Hit, origin: Vec3, direction: Vec3) -> [Vec3; 3] {
        match self {
            Kind::Flat(mesh) => {
                let (p, ng) = flat(mesh, hit);
                [p, ng, ng]
            }
            _ if P::FLAT_MESHES => unreachable!("a profile with flat meshes only"),
            Kind::Smooth(mesh) => {
                let (p, ng) = flat(mesh, hit);
                [p, ng, mesh.shading_normal(hit.primitive, hit.u, hit.v, ng)]
            }
            &Kind::Sphere { center, radius, flipped } => {
                let outside = (origin + direction * hit.t - center).normalize();
                let n = if flipped { -outside } else { outside };
                [center + outside * radius, n, n]
            }
            &Kind::Disk { normal, center, .. } => {
                let p = origin + direction * hit.t;
                [p - normal * (p - center).dot(normal), normal, normal] // t is less exact the further it is
            }
            &Kind::Cylinder { start, axis, radius, flipped, .. } => {
                let from_start = origin + direction * hit.t - start;
                let along = axis * from_start.dot(axis);
                let outside = (from_start - along).normalize();
                let n = if flipped { -outside } else { outside };
                [start + along + outside * radius, n, n]
            }
        }
    }

    /// Coordinates that bound those of the shape near a hit, for estimates of rounding errors.
    #[inline(always)]
    fn extent(&self, hit: Hit) -> Vec3 {
        match self {
            Kind::Flat(mesh) | Kind::Smooth(mesh) => {
                mesh.corners(hit.primitive).into_iter().fold(Vec3::ZERO, |most, corner| most.max(corner.abs()))
            }
            Kind::Sphere { center: middle, radius: size, .. } | Kind::Disk { center: middle, radius: size, .. } => {
                middle.abs() + *size
            }
            Kind::Cylinder { start, length, radius, .. } => start.abs() + (length + radius),
        }
    }
}

/// A point on a surface with all that scattering there needs.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'s> {
    /// Position.
    pub p: Vec3,
    /// Unit geometric normal, of the front.
    pub ng: Vec3,
    /// The geometric normal with the length that [`offset_origin`](crate::math::offset_origin) needs to get off the
    /// surface: 1, and more where the position is less exact, as in instances.
    pub lift: Vec3,
    /// Shading frame; its normal points to the side of `wo` where the material sees both sides as fronts.
    pub frame: Frame,
    /// Direction to where the ray came from, in `frame`.
    pub wo: Vec3,
    /// The material on the side of `wo`.
    pub material: &'s Material,
    /// The light that this surface is, seen from its front; [`NO_LIGHT`] otherwise.
    pub light: u32,
}

impl Scene {
    /// The surface that a ray hit.
    #[inline(always)]
    pub fn surface<P: Profile>(&self, hit: Hit, origin: Vec3, direction: Vec3) -> Surface<'_> {
        let (shape, [p, ng, ns], lifted) = if !P::FLAT_MESHES && hit.instance != MISS {
            self.instanced::<P>(hit, origin, direction)
        } else {
            let shape = &self.shapes[hit.geometry as usize];
            let [p, ng, ns] = shape.kind.point::<P>(hit, origin, direction);
            (shape, [p, ng, ns], ng)
        };
        // as in Mitsuba the shading normal decides the side, of scattering as of emission
        let back = ns.dot(direction) >= 0.0;
        let frame = Frame::new(if back && shape.two_sided { -ns } else { ns });
        Surface {
            p,
            ng,
            lift: lifted,
            frame,
            wo: frame.to_local(-direction),
            material: &self.materials[shape.materials[usize::from(back)] as usize],
            light: if back { NO_LIGHT } else { shape.light },
        }
    }
}

impl Scene {
    /// As in [`surface`](Self::surface), of a hit in an instance: its shape, the point in the world, and `lift`.
    #[inline(never)] // few scenes have instances, and the others shall not carry this through their registers
    fn instanced<P: Profile>(&self, hit: Hit, origin: Vec3, direction: Vec3) -> (&Shape, [Vec3; 3], Vec3) {
        let instance = self.instances.get(hit.instance);
        let shape = &self.shapes[(instance.first_shape + hit.geometry) as usize];
        let (origin, direction) = instance.ray_to_group(origin, direction);
        let [p, ng, ns] = shape.kind.point::<P>(hit, origin, direction);
        let point = [instance.point_to_world(p), instance.normal_to_world(ng), instance.normal_to_world(ns)];
        let error = instance.error(point[0], shape.kind.extent(hit));
        (shape, point, lift(point[0], point[1], error))
    }
}

/// Position (from barycentric coordinates, which is more exact than along the ray) and unit normal.
#[inline(always)]
fn flat(mesh: &Mesh, hit: Hit) -> (Vec3, Vec3) {
    let [a, b, c] = mesh.corners(hit.primitive);
    let (e1, e2) = (b - a, c - a);
    (a + e1 * hit.u + e2 * hit.v, e1.cross(e2).normalize())
}
