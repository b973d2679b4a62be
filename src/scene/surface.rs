//! What a ray meets.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::{
    Profile, Scene,
    appearance::Scattering,
    parametrisation::{self, Place},
};
use crate::{
    embree::{Hit, MISS},
    math::{Frame, lift},
    scene::{Mesh, description::ShapeGeometry, materials::Material},
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

/// What a shape is, seen from one side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    /// Normals are turned round.
    pub flip: bool,
    /// Number of the appearance.
    pub appearance: u32,
    /// As in [`Surface`].
    pub light: u32,
}

impl Shape {
    /// Seen from the back or from the front.
    #[inline(always)]
    fn side(&self, back: bool) -> Side {
        Side {
            flip: back && self.two_sided,
            appearance: self.appearances[usize::from(back)],
            light: if back { NO_LIGHT } else { self.light },
        }
    }
}

#[derive(Clone, Debug)]
pub(super) enum Kind {
    Flat(Arc<Mesh>),
    Smooth(Arc<Mesh>),
    Sphere { center: Vec3, radius: f32, axes: Mat3, flipped: bool },
    Disk { center: Vec3, radius: f32, axes: Mat3 },
    Cylinder { start: Vec3, length: f32, radius: f32, axes: Mat3, flipped: bool },
}

/// A hit, before it is known from which side.
struct Point {
    p: Vec3,
    /// Unit geometric normal of the front.
    ng: Vec3,
    /// Unit shading normal.
    ns: Vec3,
    /// As in [`Surface`].
    lift: Vec3,
    /// `p` and `ng` in the shape's own coordinates, which are those of its group.
    own: [Vec3; 2],
}

impl Point {
    /// Of a shape in the world.
    #[inline(always)]
    fn new(p: Vec3, ng: Vec3, ns: Vec3) -> Point {
        Point { p, ng, ns, lift: ng, own: [p, ng] }
    }
}

impl Kind {
    pub(super) fn new(geometry: &ShapeGeometry) -> Kind {
        match geometry {
            ShapeGeometry::Mesh(mesh) if mesh.normals.is_empty() => Kind::Flat(mesh.clone()),
            ShapeGeometry::Mesh(mesh) => Kind::Smooth(mesh.clone()),
            &ShapeGeometry::Sphere { center, radius, axes, flipped } => Kind::Sphere { center, radius, axes, flipped },
            &ShapeGeometry::Disk { center, radius, axes } => Kind::Disk { center, radius, axes },
            &ShapeGeometry::Cylinder { start, length, radius, axes, flipped } => {
                Kind::Cylinder { start, length, radius, axes, flipped }
            }
        }
    }

    /// Where a ray in the shape's own coordinates hit it.
    #[inline(always)]
    fn point<P: Profile>(&self, hit: Hit, origin: Vec3, direction: Vec3) -> Point {
        match self {
            Kind::Flat(mesh) => {
                let (p, ng) = flat(mesh, hit);
                Point::new(p, ng, ng)
            }
            _ if P::FLAT_MESHES => unreachable!("a profile with flat meshes only"),
            Kind::Smooth(mesh) => {
                let (p, ng) = flat(mesh, hit);
                Point::new(p, ng, mesh.shading_normal(hit.primitive, hit.u, hit.v, ng))
            }
            &Kind::Sphere { center, radius, flipped, .. } => {
                let outside = (origin + direction * hit.t - center).normalize();
                let n = if flipped { -outside } else { outside };
                Point::new(center + outside * radius, n, n)
            }
            Kind::Disk { center, axes, .. } => {
                let (p, n) = (origin + direction * hit.t, axes.z_axis);
                Point::new(p - n * (p - center).dot(n), n, n) // t is the less exact the further it is
            }
            &Kind::Cylinder { start, radius, axes, flipped, .. } => {
                let from_start = origin + direction * hit.t - start;
                let along = axes.z_axis * from_start.dot(axes.z_axis);
                let outside = (from_start - along).normalize();
                let n = if flipped { -outside } else { outside };
                Point::new(start + along + outside * radius, n, n)
            }
        }
    }

    /// Where on the surface a ray hit it at `p`, in its own coordinates.
    fn place(&self, hit: Hit, [p, ng]: [Vec3; 2]) -> Place {
        match self {
            Kind::Flat(mesh) | Kind::Smooth(mesh) => parametrisation::of_mesh(mesh, hit.primitive, hit.u, hit.v, ng),
            Kind::Sphere { center, radius, axes, .. } => {
                parametrisation::of_sphere(axes, *radius, (p - *center).normalize())
            }
            Kind::Disk { center, radius, axes } => parametrisation::of_disk(axes, *radius, p - *center),
            Kind::Cylinder { start, length, axes, .. } => parametrisation::of_cylinder(axes, *length, p - *start),
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
#[derive(Clone, Debug)]
pub struct Surface<'s> {
    /// Position.
    pub p: Vec3,
    /// Unit geometric normal, of the front.
    pub ng: Vec3,
    /// The geometric normal with the length that [`offset_origin`](crate::math::offset_origin) needs to get off the
    /// surface: 1, and more where the position is less exact, as in instances.
    pub lift: Vec3,
    /// Shading frame; its normal points to the side of `wo` where both sides are seen as fronts.
    pub frame: Frame,
    /// Direction to where the ray came from, in `frame`.
    pub wo: Vec3,
    /// Surface coordinates where they matter, else 0.
    pub uv: Vec2,
    /// The scattering function on the side of `wo`.
    pub scattering: Scattering<'s>,
    /// Number of the appearance on that side.
    pub appearance: u32,
    /// The light that this surface is, seen from its front; [`NO_LIGHT`] otherwise.
    pub light: u32,
}

impl Scene {
    /// The surface that a ray hit.
    #[inline(always)]
    pub fn surface<P: Profile>(&self, hit: Hit, origin: Vec3, direction: Vec3) -> Surface<'_> {
        let (shape, point) = if !P::FLAT_MESHES && hit.instance != MISS {
            self.instanced::<P>(hit, origin, direction)
        } else {
            let shape = &self.shapes[hit.geometry as usize];
            (shape, shape.kind.point::<P>(hit, origin, direction))
        };
        // as in Mitsuba the shading normal decides the side, of scattering as of emission
        let ns = point.ns;
        let back = ns.dot(direction) >= 0.0;
        let Side { flip, appearance, light } = shape.side(back);
        let index = appearance as usize;
        if P::VARYING && shape.varies {
            return self.varying_surface(shape, hit, direction, &point, flip, index, light);
        }
        let frame = Frame::new(if flip { -ns } else { ns });
        Surface {
            p: point.p,
            ng: point.ng,
            lift: point.lift,
            frame,
            wo: frame.to_local(-direction),
            uv: Vec2::ZERO,
            scattering: Scattering::Plain(&self.materials[index]),
            appearance: index as u32,
            light,
        }
    }

    /// A surface that depends on the place on it.
    /// The corners of a triangle, in a scene of flat meshes.
    ///
    /// # Panics
    /// If the shape is another.
    #[inline(always)]
    pub(crate) fn flat_corners(&self, geometry: u32, triangle: u32) -> [Vec3; 3] {
        match &self.shapes[geometry as usize].kind {
            Kind::Flat(mesh) => mesh.corners(triangle),
            _ => unreachable!("a profile with flat meshes only"),
        }
    }

    /// One side of a shape and its material, in a scene without instances whose surfaces do not vary.
    #[inline(always)]
    pub(crate) fn side(&self, geometry: u32, back: bool) -> (Side, &Material) {
        let side = self.shapes[geometry as usize].side(back);
        (side, &self.materials[side.appearance as usize])
    }

    #[expect(clippy::too_many_arguments, reason = "the rest of one function, kept apart because few scenes need it")]
    fn varying_surface(
        &self,
        shape: &Shape,
        hit: Hit,
        direction: Vec3,
        point: &Point,
        flip: bool,
        index: usize,
        light: u32,
    ) -> Surface<'_> {
        let &Point { p, ng, ns, lift, own } = point;
        let mut place = shape.kind.place(hit, own);
        if hit.instance != MISS {
            place = self.instances.get(hit.instance).place_to_world(&place);
        }
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
            None => Scattering::Mixed(appearance.at(&place, &unturned, ng)),
        };
        Surface { p, ng, lift, frame, wo, uv: place.uv, scattering, appearance: index as u32, light }
    }
}

impl Scene {
    /// A hit in an instance.
    #[inline(never)] // few scenes have instances, and the others shall not carry this through their registers
    fn instanced<P: Profile>(&self, hit: Hit, origin: Vec3, direction: Vec3) -> (&Shape, Point) {
        let instance = self.instances.get(hit.instance);
        let shape = &self.shapes[(instance.first_shape + hit.geometry) as usize];
        let (origin, direction) = instance.ray_to_group(origin, direction);
        let Point { p: q, ng, ns, own, .. } = shape.kind.point::<P>(hit, origin, direction);
        let (p, ng, ns) = (instance.point_to_world(q), instance.normal_to_world(ng), instance.normal_to_world(ns));
        let error = instance.error(p, shape.kind.extent(hit));
        (shape, Point { p, ng, ns, lift: lift(p, ng, error), own })
    }
}

/// Position (from barycentric coordinates, which is more exact than along the ray) and unit normal.
#[inline(always)]
fn flat(mesh: &Mesh, hit: Hit) -> (Vec3, Vec3) {
    on_triangle(mesh.corners(hit.primitive), hit.u, hit.v)
}

/// A point of a triangle with those corners by its barycentric coordinates (1 − u − v, u, v), and the unit normal.
#[inline(always)]
pub(crate) fn on_triangle([a, b, c]: [Vec3; 3], u: f32, v: f32) -> (Vec3, Vec3) {
    let (e1, e2) = (b - a, c - a);
    (a + e1 * u + e2 * v, e1.cross(e2).normalize())
}
