//! Spheres, disks and cylinders, which Embree bounds and we intersect.
//!
//! Embree has the first two as native geometry, but there t depends on the packet width in its last bits: in a box with 40 of
//! them 2 to 7 hits in a hundred differed between single rays and packets, and of a million rays aimed at rims 3 to 9
//! hit another shape (4.4.0; SSE4.2 to AVX-512). Called back, we intersect lane by lane in f64, and nothing differs
//! between widths, nor t between instruction sets.

use super::ffi::{Bounds, BoundsArguments, CallbackArguments};
use glam::{DVec3, Vec3};

/// A shape, prepared for intersection.
#[derive(Clone, Debug)]
pub enum Quadric {
    Sphere {
        center: DVec3,
        radius: f64,
    },
    Disk {
        center: DVec3,
        /// Of unit length.
        normal: DVec3,
        radius: f64,
    },
    /// Without caps.
    Cylinder {
        /// Where the axis begins.
        start: DVec3,
        /// Of unit length.
        axis: DVec3,
        length: f64,
        radius: f64,
    },
}

/// Boxes are widened by this fraction of their size and distance, 16 units in the last place of f32: no rounding in
/// Embree's traversal may lose a ray that our intersection would have hit.
const BOX_MARGIN: f64 = 16.0 * f32::EPSILON as f64;

impl Quadric {
    pub fn sphere(center: Vec3, radius: f32) -> Quadric {
        Quadric::Sphere { center: center.as_dvec3(), radius: radius.into() }
    }

    pub fn disk(center: Vec3, normal: Vec3, radius: f32) -> Quadric {
        Quadric::Disk { center: center.as_dvec3(), normal: normal.as_dvec3().normalize(), radius: radius.into() }
    }

    pub fn cylinder(start: Vec3, end: Vec3, radius: f32) -> Quadric {
        let along = end.as_dvec3() - start.as_dvec3();
        let length = along.length();
        Quadric::Cylinder { start: start.as_dvec3(), axis: along / length, length, radius: radius.into() }
    }

    /// The nearest hit with 0 < t ≤ `tfar`.
    ///
    /// Of the two roots of a sphere the second counts where the first lies behind the origin: the ray starts inside. So
    /// does that of a cylinder where the ray comes in through an open end.
    /// A ray with a NaN hits nothing, as every comparison with it is false.
    #[inline]
    fn nearest(&self, origin: DVec3, direction: DVec3, tfar: f32) -> Option<f32> {
        let within = |t: f64| Some(t as f32).filter(|&t| t > 0.0 && t <= tfar);
        match *self {
            Quadric::Sphere { center, radius } => {
                let [near, far] = sphere_roots(origin - center, direction, radius)?;
                within(near).or_else(|| within(far))
            }
            Quadric::Disk { center, normal, radius } => {
                let t = (center - origin).dot(normal) / direction.dot(normal);
                let inside = (origin + t * direction - center).length_squared() <= radius * radius;
                within(t).filter(|_| inside)
            }
            Quadric::Cylinder { start, axis, length, radius } => {
                let from_start = origin - start;
                let (height, rise) = (from_start.dot(axis), direction.dot(axis));
                let across = direction - rise * axis;
                let [near, far] = sphere_roots(from_start - height * axis, across, radius)?;
                let between_ends = |t: &f64| (0.0..=length).contains(&(height + *t * rise));
                let at = |t: f64| Some(t).filter(between_ends).and_then(within);
                at(near).or_else(|| at(far))
            }
        }
    }

    /// What lies around the shape.
    fn bounds(&self) -> (Vec3, Vec3) {
        let around_circle =
            |normal: DVec3, radius: f64| radius * (1.0 - normal * normal).max(DVec3::ZERO).map(f64::sqrt);
        let (lower, upper) = match *self {
            Quadric::Sphere { center, radius } => (center - radius, center + radius),
            Quadric::Disk { center, normal, radius } => {
                let extent = around_circle(normal, radius);
                (center - extent, center + extent)
            }
            Quadric::Cylinder { start, axis, length, radius } => {
                let (end, extent) = (start + length * axis, around_circle(axis, radius));
                (start.min(end) - extent, start.max(end) + extent)
            }
        };
        let margin = DVec3::splat(BOX_MARGIN * lower.abs().max(upper.abs()).max_element());
        ((lower - margin).as_vec3(), (upper + margin).as_vec3())
    }
}

/// Both t at which a ray from `origin` meets a sphere around 0, in ascending order; of a cylinder around an axis through
/// 0 where both vectors are across it. A direction without length meets nothing.
///
/// The discriminant is taken from the distance of the centre to the ray and the smaller root from the larger one, so
/// that small spheres far away and origins on the surface keep their digits.
/// Source: Haines, Günther and Akenine-Möller, Precision Improvements for Ray/Sphere Intersection, 2019.
#[inline]
fn sphere_roots(origin: DVec3, direction: DVec3, radius: f64) -> Option<[f64; 2]> {
    let a = direction.length_squared();
    let b = -origin.dot(direction);
    let c = origin.length_squared() - radius * radius;
    let discriminant = radius * radius - (origin + b / a * direction).length_squared();
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let q = b + (a * discriminant).sqrt().copysign(b);
    let (one, other) = (c / q, q / a);
    Some([one.min(other), one.max(other)])
}

// What Embree calls back. The arguments are as `rtcSetGeometry…Function` documents them: `user` is the `Quadric`,
// and rays and hits are arrays of `lanes` floats or ints, one a field.

/// Fields of `RTCRayHitN`, in units of `lanes` words, and the first fields of `RTCRayN`.
mod field {
    pub const ORIGIN: usize = 0;
    pub const DIRECTION: usize = 4;
    pub const TFAR: usize = 8;
    pub const NORMAL: usize = 12;
    pub const U: usize = 15;
    pub const V: usize = 16;
    pub const PRIMITIVE: usize = 17;
    pub const GEOMETRY: usize = 18;
    pub const INSTANCE: usize = 19;
}

/// # Safety
/// To be called by Embree only, with a geometry whose user data points to a `Quadric`.
pub unsafe extern "C" fn bounds(arguments: *const BoundsArguments) {
    // SAFETY: the caller is Embree, see above.
    let (quadric, bounds): (&Quadric, &mut Bounds) = unsafe { (&*(*arguments).user.cast(), &mut *(*arguments).bounds) };
    let (lower, upper) = quadric.bounds();
    (bounds.lower, bounds.upper) = (lower.into(), upper.into());
}

/// # Safety
/// As for [`bounds`].
pub unsafe extern "C" fn intersect(arguments: *const CallbackArguments) {
    // SAFETY: the caller is Embree, see above: every lane below `lanes` and every field of ray and hit can be accessed.
    unsafe {
        let arguments = &*arguments;
        for (lane, t) in hits(arguments) {
            let words = arguments.rays.add(lane);
            let at = |field: usize| words.add(field * arguments.lanes as usize);
            *at(field::TFAR) = t;
            // Nobody reads the normal; the caller of `Scene::closest` computes it from the shape.
            *at(field::NORMAL) = 0.0;
            *at(field::U) = 0.0;
            *at(field::V) = 0.0;
            *at(field::PRIMITIVE).cast::<u32>() = arguments.primitive;
            *at(field::GEOMETRY).cast::<u32>() = arguments.geometry;
            *at(field::INSTANCE).cast::<u32>() = (*arguments.context).instance;
        }
    }
}

/// # Safety
/// As for [`bounds`].
pub unsafe extern "C" fn occluded(arguments: *const CallbackArguments) {
    // SAFETY: the caller is Embree, see above.
    unsafe {
        let arguments = &*arguments;
        for (lane, _) in hits(arguments) {
            *arguments.rays.add(field::TFAR * arguments.lanes as usize + lane) = f32::NEG_INFINITY;
        }
    }
}

/// The lanes whose ray hits the shape, and where.
///
/// # Safety
/// The arguments come from Embree.
#[inline(always)]
unsafe fn hits(arguments: &CallbackArguments) -> impl Iterator<Item = (usize, f32)> {
    let lanes = arguments.lanes as usize;
    // SAFETY: the user data of our geometries is a `Quadric` that outlives them.
    let quadric: &Quadric = unsafe { &*arguments.user.cast() };
    (0..lanes).filter_map(move |lane| {
        // SAFETY: `lane` is below `lanes`.
        unsafe {
            if *arguments.valid.add(lane) == 0 {
                return None;
            }
            let at = |field: usize| *arguments.rays.add(field * lanes + lane);
            let vector = |field| DVec3::new(at(field).into(), at(field + 1).into(), at(field + 2).into());
            let t = quadric.nearest(vector(field::ORIGIN), vector(field::DIRECTION), at(field::TFAR))?;
            Some((lane, t))
        }
    })
}
