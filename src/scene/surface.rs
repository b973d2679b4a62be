//! What a ray meets.

use std::sync::Arc;

use glam::Vec3;

use super::{Profile, Scene, materials::Material};
use crate::{
    embree::Hit,
    math::Frame,
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
    Disk { normal: Vec3 },
}

impl Kind {
    pub(super) fn new(geometry: &ShapeGeometry) -> Kind {
        match geometry {
            ShapeGeometry::Mesh(mesh) if mesh.normals.is_empty() => Kind::Flat(mesh.clone()),
            ShapeGeometry::Mesh(mesh) => Kind::Smooth(mesh.clone()),
            &ShapeGeometry::Sphere { center, radius, flipped } => Kind::Sphere { center, radius, flipped },
            &ShapeGeometry::Disk { normal, .. } => Kind::Disk { normal },
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
        let shape = &self.shapes[hit.geometry as usize];
        let (p, ng, ns) = match &shape.kind {
            Kind::Flat(mesh) => {
                let (p, ng) = flat(mesh, hit);
                (p, ng, ng)
            }
            _ if P::FLAT_MESHES => unreachable!("a profile with flat meshes only"),
            Kind::Smooth(mesh) => {
                let (p, ng) = flat(mesh, hit);
                (p, ng, mesh.shading_normal(hit.primitive, hit.u, hit.v, ng))
            }
            &Kind::Sphere { center, radius, flipped } => {
                let outside = (origin + direction * hit.t - center).normalize();
                let n = if flipped { -outside } else { outside };
                (center + outside * radius, n, n)
            }
            &Kind::Disk { normal } => (origin + direction * hit.t, normal, normal),
        };
        // as in Mitsuba the shading normal decides the side, of scattering as of emission
        let back = ns.dot(direction) >= 0.0;
        let frame = Frame::new(if back && shape.two_sided { -ns } else { ns });
        Surface {
            p,
            ng,
            frame,
            wo: frame.to_local(-direction),
            material: &self.materials[shape.materials[usize::from(back)] as usize],
            light: if back { NO_LIGHT } else { shape.light },
        }
    }
}

/// Position (from barycentric coordinates, which is more exact than along the ray) and unit normal.
#[inline(always)]
fn flat(mesh: &Mesh, hit: Hit) -> (Vec3, Vec3) {
    let [a, b, c] = mesh.corners(hit.primitive);
    let (e1, e2) = (b - a, c - a);
    (a + e1 * hit.u + e2 * hit.v, e1.cross(e2).normalize())
}
