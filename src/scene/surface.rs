//! What a ray meets.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::{
    Profile, Scene,
    appearance::Scattering,
    parametrisation::{self, Place},
};
use crate::{
    embree::Hit,
    math::Frame,
    scene::{Mesh, description::ShapeGeometry},
};

/// One surface of the scene, ready for look-up by the number of its Embree geometry.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    pub(super) kind: Kind,
    /// Appearance from the front and from the back.
    pub(super) appearances: [u32; 2],
    /// Both sides are seen as fronts.
    pub(super) two_sided: bool,
    /// Index into the scene's emitters, or [`NO_LIGHT`].
    pub(super) light: u32,
    /// Something depends on the place on the surface.
    pub(super) varies: bool,
}

/// Marks a surface that does not emit.
pub const NO_LIGHT: u32 = u32::MAX;

#[derive(Clone, Debug)]
pub(super) enum Kind {
    Flat(Arc<Mesh>),
    Smooth(Arc<Mesh>),
    Sphere { center: Vec3, radius: f32, axes: Mat3, flipped: bool },
    Disk { center: Vec3, radius: f32, axes: Mat3 },
}

impl Kind {
    pub(super) fn new(geometry: &ShapeGeometry) -> Kind {
        match geometry {
            ShapeGeometry::Mesh(mesh) if mesh.normals.is_empty() => Kind::Flat(mesh.clone()),
            ShapeGeometry::Mesh(mesh) => Kind::Smooth(mesh.clone()),
            &ShapeGeometry::Sphere { center, radius, axes, flipped } => Kind::Sphere { center, radius, axes, flipped },
            &ShapeGeometry::Disk { center, radius, axes } => Kind::Disk { center, radius, axes },
        }
    }

    /// Where on the surface a ray hit it at `p`.
    fn place(&self, hit: Hit, p: Vec3, ng: Vec3) -> Place {
        match self {
            Kind::Flat(mesh) | Kind::Smooth(mesh) => parametrisation::of_mesh(mesh, hit.primitive, hit.u, hit.v, ng),
            Kind::Sphere { center, radius, axes, .. } => {
                parametrisation::of_sphere(axes, *radius, (p - *center).normalize())
            }
            Kind::Disk { center, radius, axes } => parametrisation::of_disk(axes, *radius, p - *center),
        }
    }
}

/// A point on a surface with all that scattering there needs.
#[derive(Clone, Debug)]
pub struct Surface<'s> {
    /// Position.
    pub p: Vec3,
    /// Unit geometric normal, of the front.
    pub ng: Vec3,
    /// Shading frame; its normal points to the side of `wo` where both sides are seen as fronts.
    pub frame: Frame,
    /// Direction to where the ray came from, in `frame`.
    pub wo: Vec3,
    /// Surface coordinates where they matter, else 0.
    pub uv: Vec2,
    /// The scattering function on the side of `wo`.
    pub scattering: Scattering<'s>,
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
            &Kind::Sphere { center, radius, flipped, .. } => {
                let outside = (origin + direction * hit.t - center).normalize();
                let n = if flipped { -outside } else { outside };
                (center + outside * radius, n, n)
            }
            Kind::Disk { axes, .. } => (origin + direction * hit.t, axes.z_axis, axes.z_axis),
        };
        // as in Mitsuba the shading normal decides the side, of scattering as of emission
        let back = ns.dot(direction) >= 0.0;
        let flip = back && shape.two_sided;
        let index = shape.appearances[usize::from(back)] as usize;
        let frame = Frame::new(if flip { -ns } else { ns });
        let light = if back { NO_LIGHT } else { shape.light };
        if P::VARYING && shape.varies {
            return self.varying_surface(shape, hit, direction, [p, ng, ns], flip, index, light);
        }
        Surface {
            p,
            ng,
            frame,
            wo: frame.to_local(-direction),
            uv: Vec2::ZERO,
            scattering: Scattering::Plain(&self.materials[index]),
            light,
        }
    }

    /// A surface that depends on the place on it.
    #[expect(clippy::too_many_arguments, reason = "the rest of one function, kept apart because few scenes need it")]
    fn varying_surface(
        &self,
        shape: &Shape,
        hit: Hit,
        direction: Vec3,
        [p, ng, ns]: [Vec3; 3],
        flip: bool,
        index: usize,
        light: u32,
    ) -> Surface<'_> {
        let place = shape.kind.place(hit, p, ng);
        // The x axis lies along ∂p/∂u. Seen from behind only the normal turns round: a mirror image, as in Mitsuba.
        let s = place.du - ns * ns.dot(place.du);
        let mut frame = match s.try_normalize() {
            Some(s) => Frame { s, t: ns.cross(s), n: ns },
            None => Frame::new(ns),
        };
        let unturned = frame;
        if flip {
            frame.n = -ns;
        }
        let wo = frame.to_local(-direction);
        let appearance = &self.appearances[index];
        let scattering = match appearance.plain() {
            Some(_) => Scattering::Plain(&self.materials[index]),
            None => Scattering::Mixed(appearance.at(&place, &unturned, ng, wo)),
        };
        Surface { p, ng, frame, wo, uv: place.uv, scattering, light }
    }
}

/// Position (from barycentric coordinates, which is more exact than along the ray) and unit normal.
#[inline(always)]
fn flat(mesh: &Mesh, hit: Hit) -> (Vec3, Vec3) {
    let [a, b, c] = mesh.corners(hit.primitive);
    let (e1, e2) = (b - a, c - a);
    (a + e1 * hit.u + e2 * hit.v, e1.cross(e2).normalize())
}
