//! Rays in, hits out, a packet at a time.
//!
//! Rays and hits are structures of arrays. A packet is filled from consecutive lanes, traced by one call of Embree
//! and copied out again; nothing is allocated or checked on the way.
//!
//! Hits do not depend on the width, bit for bit: over 10 million rays a scene of each kind — anywhere, after a diffuse
//! bounce, aimed at edges and corners — on three scenes with SSE4.2, AVX, AVX2 and AVX-512, no id, u, v, t or
//! occlusion differed (Embree 4.4.0; `tests/embree.rs`), nor in instances, over 65,536 rays of each kind. This needs rays
//! not to be marked as coherent, and spheres, disks and cylinders of our own (`quadric`). Between instruction sets the
//! last bits of triangle hits do differ.

use super::ffi::{self, Align16, Align32, Align64, Arguments, Ray, RayHit, Valid};
use super::scene::Scene;
use glam::Vec3;
use std::fmt;
use std::str::FromStr;

/// The `geometry` of a ray that hit nothing.
pub const MISS: u32 = ffi::INVALID_ID;

/// Rays that one call of Embree takes. The hits are the same for all of them; only the speed differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Width {
    /// Single rays.
    W1,
    /// Packets of 4, native with SSE and newer.
    W4,
    /// Packets of 8, native with AVX and newer.
    W8,
    /// Packets of 16, native with AVX-512.
    W16,
}

impl Width {
    /// All of them, narrowest first.
    pub const ALL: [Width; 4] = [Width::W1, Width::W4, Width::W8, Width::W16];

    /// Rays in a packet.
    pub const fn lanes(self) -> usize {
        match self {
            Width::W1 => 1,
            Width::W4 => 4,
            Width::W8 => 8,
            Width::W16 => 16,
        }
    }
}

impl fmt::Display for Width {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}", self.lanes())
    }
}

impl FromStr for Width {
    type Err = String;

    fn from_str(text: &str) -> Result<Width, String> {
        let known = Width::ALL.into_iter().find(|width| width.to_string() == text);
        known.ok_or_else(|| format!("unknown packet width {text:?}; known: 1, 4, 8, 16"))
    }
}

/// Rays from t = 0 to `tfar`, as a structure of arrays of equal length.
///
/// Embree does not look at the length of directions: t counts in units of it. A ray with a NaN hits nothing and
/// disturbs no other.
#[derive(Clone, Debug, Default)]
#[allow(missing_docs, reason = "coordinates of origins and directions, and where the rays end")]
pub struct Rays {
    pub ox: Vec<f32>,
    pub oy: Vec<f32>,
    pub oz: Vec<f32>,
    pub dx: Vec<f32>,
    pub dy: Vec<f32>,
    pub dz: Vec<f32>,
    pub tfar: Vec<f32>,
}

impl Rays {
    /// No rays, and room for `n`.
    pub fn with_capacity(n: usize) -> Rays {
        let room = || Vec::with_capacity(n);
        Rays { ox: room(), oy: room(), oz: room(), dx: room(), dy: room(), dz: room(), tfar: room() }
    }

    /// Removes all rays and keeps the memory.
    pub fn clear(&mut self) {
        self.truncate(0);
    }

    /// Keeps the first `n` rays.
    pub fn truncate(&mut self, n: usize) {
        self.arrays().into_iter().for_each(|array| array.truncate(n));
    }

    /// Adds a ray.
    #[inline]
    pub fn push(&mut self, origin: Vec3, direction: Vec3, tfar: f32) {
        self.ox.push(origin.x);
        self.oy.push(origin.y);
        self.oz.push(origin.z);
        self.dx.push(direction.x);
        self.dy.push(direction.y);
        self.dz.push(direction.z);
        self.tfar.push(tfar);
    }

    /// Replaces ray `i`.
    #[inline]
    pub fn set(&mut self, i: usize, origin: Vec3, direction: Vec3, tfar: f32) {
        self.ox[i] = origin.x;
        self.oy[i] = origin.y;
        self.oz[i] = origin.z;
        self.dx[i] = direction.x;
        self.dy[i] = direction.y;
        self.dz[i] = direction.z;
        self.tfar[i] = tfar;
    }

    /// Number of rays.
    #[inline]
    pub fn len(&self) -> usize {
        self.tfar.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.tfar.is_empty()
    }

    /// Origin of ray `i`.
    #[inline]
    pub fn origin(&self, i: usize) -> Vec3 {
        Vec3::new(self.ox[i], self.oy[i], self.oz[i])
    }

    /// Direction of ray `i`.
    #[inline]
    pub fn direction(&self, i: usize) -> Vec3 {
        Vec3::new(self.dx[i], self.dy[i], self.dz[i])
    }

    fn arrays(&mut self) -> [&mut Vec<f32>; 7] {
        [&mut self.ox, &mut self.oy, &mut self.oz, &mut self.dx, &mut self.dy, &mut self.dz, &mut self.tfar]
    }

    /// The arrays as packets of `N`, all of the same number, and what is left over.
    fn packets<const N: usize>(&self) -> ([&[[f32; N]]; 7], [&[f32]; 7]) {
        let n = self.len();
        let arrays = [&self.ox, &self.oy, &self.oz, &self.dx, &self.dy, &self.dz, &self.tfar];
        let split = arrays.map(|array| array[..n].as_chunks::<N>());
        (split.map(|(packets, _)| packets), split.map(|(_, rest)| rest))
    }
}

/// The closest hits of rays, as a structure of arrays of equal length.
///
/// Where `geometry` is [`MISS`], the primitive is [`MISS`] too, u and v are 0 and t is the ray's end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hits {
    /// Place of the shape in the scene's list, or in that of the instance's scene, or [`MISS`].
    pub geometry: Vec<u32>,
    /// Triangle within the mesh; 0 for spheres, disks and cylinders.
    pub primitive: Vec<u32>,
    /// First barycentric coordinate, the weight of the triangle's second corner; 0 where there is no triangle.
    pub u: Vec<f32>,
    /// Second barycentric coordinate, the weight of the triangle's third corner; 0 where there is no triangle.
    pub v: Vec<f32>,
    /// Distance in units of the direction's length.
    pub t: Vec<f32>,
    /// Place in the scene's list of the instance that was hit, or [`MISS`]; empty where a scene has no instances.
    pub instance: Vec<u32>,
}

/// One hit; see [`Hits`] for the fields.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "as in `Hits`")]
pub struct Hit {
    pub geometry: u32,
    pub primitive: u32,
    pub u: f32,
    pub v: f32,
    pub t: f32,
    pub instance: u32,
}

impl Hits {
    /// The hit of ray `i`, if it hit anything.
    #[inline]
    pub fn get(&self, i: usize) -> Option<Hit> {
        (self.geometry[i] != MISS).then(|| Hit {
            geometry: self.geometry[i],
            primitive: self.primitive[i],
            u: self.u[i],
            v: self.v[i],
            t: self.t[i],
            instance: self.instance.get(i).copied().unwrap_or(MISS),
        })
    }

    fn resize(&mut self, n: usize, with_instances: bool) {
        self.geometry.resize(n, MISS);
        self.primitive.resize(n, MISS);
        self.u.resize(n, 0.0);
        self.v.resize(n, 0.0);
        self.t.resize(n, 0.0);
        self.instance.resize(if with_instances { n } else { 0 }, MISS);
    }
}

impl Scene {
    /// The closest hits of all rays.
    pub fn closest(&self, width: Width, rays: &Rays, hits: &mut Hits) {
        if self.has_instances() {
            self.closest_of::<true>(width, rays, hits);
        } else {
            self.closest_of::<false>(width, rays, hits);
        }
    }

    /// The closest hits, with their instances or without.
    fn closest_of<const INSTANCES: bool>(&self, width: Width, rays: &Rays, hits: &mut Hits) {
        let (f, scene) = (&self.device().embree().tracing, self.handle());
        let args = &mut Arguments::new();
        // SAFETY, for all four: the scene is committed and alive; packet, mask and arguments have Embree's layout
        // and alignment (asserted in `ffi`) and live for the call.
        match width {
            Width::W1 => closest::<Align16, 1, INSTANCES>(rays, hits, |_, packet| {
                // SAFETY: above.
                unsafe { (f.intersect1)(scene, packet, args) }
            }),
            Width::W4 => closest::<Align16, 4, INSTANCES>(rays, hits, |valid, packet| {
                // SAFETY: above.
                unsafe { (f.intersect4)(valid.lanes.as_ptr(), scene, packet, args) }
            }),
            Width::W8 => closest::<Align32, 8, INSTANCES>(rays, hits, |valid, packet| {
                // SAFETY: above.
                unsafe { (f.intersect8)(valid.lanes.as_ptr(), scene, packet, args) }
            }),
            Width::W16 => closest::<Align64, 16, INSTANCES>(rays, hits, |valid, packet| {
                // SAFETY: above.
                unsafe { (f.intersect16)(valid.lanes.as_ptr(), scene, packet, args) }
            }),
        }
    }

    /// For each ray, whether anything lies between its origin and its end.
    pub fn occluded(&self, width: Width, rays: &Rays, occluded: &mut Vec<bool>) {
        let (f, scene) = (&self.device().embree().tracing, self.handle());
        let args = &mut Arguments::new();
        // SAFETY, for all four: as for the closest hits.
        match width {
            // SAFETY: above.
            Width::W1 => any::<Align16, 1>(rays, occluded, |_, packet| unsafe { (f.occluded1)(scene, packet, args) }),
            Width::W4 => any::<Align16, 4>(rays, occluded, |valid, packet| {
                // SAFETY: above.
                unsafe { (f.occluded4)(valid.lanes.as_ptr(), scene, packet, args) }
            }),
            Width::W8 => any::<Align32, 8>(rays, occluded, |valid, packet| {
                // SAFETY: above.
                unsafe { (f.occluded8)(valid.lanes.as_ptr(), scene, packet, args) }
            }),
            Width::W16 => any::<Align64, 16>(rays, occluded, |valid, packet| {
                // SAFETY: above.
                unsafe { (f.occluded16)(valid.lanes.as_ptr(), scene, packet, args) }
            }),
        }
    }

    /// The closest hit of one ray.
    pub fn closest_one(&self, origin: Vec3, direction: Vec3, tfar: f32) -> Option<Hit> {
        let mut packet = RayHit::<Align16, 1>::new();
        packet.ray.load([origin.x, origin.y, origin.z, direction.x, direction.y, direction.z, tfar].map(|x| [x]));
        // SAFETY: as for `closest`.
        unsafe { (self.device().embree().tracing.intersect1)(self.handle(), &mut packet, &mut Arguments::new()) };
        let (hit, [t]) = (packet.hit, packet.ray.tfar);
        let ([geometry], [primitive], [u], [v], [instance]) = (hit.geometry, hit.primitive, hit.u, hit.v, hit.instance);
        (geometry != MISS).then_some(Hit { geometry, primitive, u, v, t, instance })
    }

    /// Whether anything lies between the origin of one ray and its end.
    pub fn occluded_one(&self, origin: Vec3, direction: Vec3, tfar: f32) -> bool {
        let mut ray = Ray::<Align16, 1>::new();
        ray.load([origin.x, origin.y, origin.z, direction.x, direction.y, direction.z, tfar].map(|x| [x]));
        // SAFETY: as for `occluded`.
        unsafe { (self.device().embree().tracing.occluded1)(self.handle(), &mut ray, &mut Arguments::new()) };
        ray.tfar == [f32::NEG_INFINITY]
    }
}

#[inline]
fn closest<A: Copy, const N: usize, const INSTANCES: bool>(
    rays: &Rays,
    hits: &mut Hits,
    mut trace: impl FnMut(&Valid<A, N>, &mut RayHit<A, N>),
) {
    hits.resize(rays.len(), INSTANCES);
    let (packets, rest) = rays.packets::<N>();
    let count = packets[0].len();
    let (geometry, geometry_rest) = hits.geometry.as_chunks_mut::<N>();
    let (primitive, primitive_rest) = hits.primitive.as_chunks_mut::<N>();
    let (u, u_rest) = hits.u.as_chunks_mut::<N>();
    let (v, v_rest) = hits.v.as_chunks_mut::<N>();
    let (t, t_rest) = hits.t.as_chunks_mut::<N>();
    let (instance, instance_rest) = hits.instance.as_chunks_mut::<N>();

    let mut packet = RayHit::<A, N>::new();
    for i in 0..count {
        packet.ray.load(packets.map(|array| array[i]));
        packet.forget_hits::<INSTANCES>();
        trace(&Valid::first(N), &mut packet);
        geometry[i] = packet.hit.geometry;
        primitive[i] = packet.hit.primitive;
        u[i] = packet.hit.u;
        v[i] = packet.hit.v;
        t[i] = packet.ray.tfar;
        if INSTANCES {
            instance[i] = packet.hit.instance;
        }
    }
    let left = rest[0].len();
    if left > 0 {
        packet.ray.load_partial(rest);
        packet.forget_hits::<INSTANCES>();
        trace(&Valid::first(left), &mut packet);
        geometry_rest.copy_from_slice(&packet.hit.geometry[..left]);
        primitive_rest.copy_from_slice(&packet.hit.primitive[..left]);
        u_rest.copy_from_slice(&packet.hit.u[..left]);
        v_rest.copy_from_slice(&packet.hit.v[..left]);
        t_rest.copy_from_slice(&packet.ray.tfar[..left]);
        if INSTANCES {
            instance_rest.copy_from_slice(&packet.hit.instance[..left]);
        }
    }
}

#[inline]
fn any<A: Copy, const N: usize>(
    rays: &Rays,
    occluded: &mut Vec<bool>,
    mut trace: impl FnMut(&Valid<A, N>, &mut Ray<A, N>),
) {
    occluded.resize(rays.len(), false);
    let (packets, rest) = rays.packets::<N>();
    let (full, partial) = occluded.as_chunks_mut::<N>();

    let mut packet = Ray::<A, N>::new();
    for (i, occluded) in full.iter_mut().enumerate() {
        packet.load(packets.map(|array| array[i]));
        trace(&Valid::first(N), &mut packet);
        *occluded = packet.tfar.map(|t| t == f32::NEG_INFINITY); // how Embree says so
    }
    if !partial.is_empty() {
        packet.load_partial(rest);
        trace(&Valid::first(partial.len()), &mut packet);
        partial.iter_mut().zip(packet.tfar).for_each(|(occluded, t)| *occluded = t == f32::NEG_INFINITY);
    }
}

impl<A, const N: usize> Valid<A, N> {
    /// The first `n` lanes.
    #[inline(always)]
    fn first(n: usize) -> Valid<A, N> {
        Valid { align: [], lanes: std::array::from_fn(|lane| -i32::from(lane < n)) }
    }
}

impl<A: Copy, const N: usize> Ray<A, N> {
    /// Harmless rays without length.
    fn new() -> Ray<A, N> {
        Ray {
            align: [],
            origin: [[0.0; N]; 3],
            tnear: [0.0; N],
            direction: [[0.0; N], [0.0; N], [1.0; N]],
            time: [0.0; N],
            tfar: [0.0; N],
            mask: [u32::MAX; N],
            id: [0; N],
            flags: [0; N],
        }
    }

    #[inline(always)]
    fn load(&mut self, [ox, oy, oz, dx, dy, dz, tfar]: [[f32; N]; 7]) {
        self.origin = [ox, oy, oz];
        self.direction = [dx, dy, dz];
        self.tfar = tfar;
    }

    /// Fewer rays than lanes; the lanes without one get a harmless ray.
    fn load_partial(&mut self, rest: [&[f32]; 7]) {
        *self = Ray::new();
        let n = rest[0].len();
        let [ox, oy, oz] = &mut self.origin;
        let [dx, dy, dz] = &mut self.direction;
        for (lanes, array) in [ox, oy, oz, dx, dy, dz, &mut self.tfar].into_iter().zip(rest) {
            lanes[..n].copy_from_slice(array);
        }
    }
}

impl<A: Copy, const N: usize> RayHit<A, N> {
    fn new() -> RayHit<A, N> {
        let hit = ffi::Hit {
            align: [],
            normal: [[0.0; N]; 3],
            u: [0.0; N],
            v: [0.0; N],
            primitive: [MISS; N],
            geometry: [MISS; N],
            instance: [MISS; N],
            instance_primitive: [MISS; N],
        };
        RayHit { ray: Ray::new(), hit }
    }

    /// Embree writes only the lanes that hit something.
    #[inline(always)]
    fn forget_hits<const INSTANCES: bool>(&mut self) {
        self.hit.geometry = [MISS; N];
        self.hit.primitive = [MISS; N];
        self.hit.u = [0.0; N];
        self.hit.v = [0.0; N];
        if INSTANCES {
            self.hit.instance = [MISS; N];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embree::ffi::{CallbackArguments, QueryContext};
    use crate::embree::quadric::{self, Quadric};
    use std::ptr;

    /// What Embree asks about a packet whose address that is.
    fn question<A, P, const N: usize>(
        quadric: &Quadric,
        context: &QueryContext,
        valid: &Valid<A, N>,
        packet: &mut P,
    ) -> CallbackArguments {
        CallbackArguments {
            valid: valid.lanes.as_ptr(),
            user: ptr::from_ref(quadric).cast(),
            primitive: 0,
            context: ptr::from_ref(context),
            rays: ptr::from_mut(packet).cast(),
            lanes: N as u32,
            geometry: 5,
        }
    }

    /// Rays along z towards a sphere of radius 1, with what they meet by Pythagoras.
    fn rays_and_distances(n: usize) -> (Rays, Vec<Option<f32>>) {
        let mut rays = Rays::with_capacity(n);
        let distances = (0..n).map(|i| {
            let x = i as f32 / 8.0 - 1.53; // no tangents
            rays.push(Vec3::new(x, 0.0, -3.0), Vec3::Z, if i == 11 { 1.0 } else { f32::INFINITY });
            (x.abs() < 1.0 && i != 11).then(|| 3.0 - (1.0 - x * x).sqrt())
        });
        let distances = distances.collect();
        (rays, distances)
    }

    /// Packets of N with our own callbacks in the place of Embree. Miri can run this: see `tests/sanitize.sh`.
    fn packets_of<A: Copy, const N: usize>() {
        let sphere = Quadric::sphere(Vec3::ZERO, 1.0);
        let context = QueryContext { instance: 7 };
        for n in [0, 1, N, 2 * N + 1, 25] {
            let (rays, distances) = rays_and_distances(n);
            let mut hits = Hits::default();
            closest::<A, N, true>(&rays, &mut hits, |valid, packet| {
                let question = question(&sphere, &context, valid, packet);
                // SAFETY: the arguments describe the packet and the sphere, which live for the call.
                unsafe { quadric::intersect(&question) }
            });
            let mut shadows = Vec::new();
            any::<A, N>(&rays, &mut shadows, |valid, packet| {
                let question = question(&sphere, &context, valid, packet);
                // SAFETY: as above.
                unsafe { quadric::occluded(&question) }
            });
            assert_eq!((hits.t.len(), shadows.len()), (n, n));
            for (i, distance) in distances.into_iter().enumerate() {
                let hit = hits.get(i);
                assert_eq!(
                    (hit.is_some(), shadows[i]),
                    (distance.is_some(), distance.is_some()),
                    "{N}: ray {i} of {n}"
                );
                if let Some((hit, distance)) = hit.zip(distance) {
                    assert!((hit.t - distance).abs() < 1e-6, "{hit:?} at {distance}");
                    assert_eq!((hit.geometry, hit.primitive, hit.instance), (5, 0, 7));
                }
            }
        }
    }

    #[test]
    fn packets_of_all_widths_are_filled_asked_about_and_read_in_bounds() {
        packets_of::<Align16, 1>();
        packets_of::<Align16, 4>();
        packets_of::<Align32, 8>();
        packets_of::<Align64, 16>();
    }

    #[test]
    fn bounds_are_written_where_embree_wants_them() {
        let disk = Quadric::disk(Vec3::new(1.0, 2.0, 3.0), Vec3::Z, 0.5);
        let mut bounds = ffi::Bounds::default();
        let question = ffi::BoundsArguments {
            user: ptr::from_ref(&disk).cast(),
            primitive: 0,
            time_step: 0,
            bounds: ptr::from_mut(&mut bounds),
        };
        // SAFETY: as above.
        unsafe { quadric::bounds(&question) };
        let [lower, upper] = [bounds.lower, bounds.upper].map(Vec3::from);
        assert!(lower.abs_diff_eq(Vec3::new(0.5, 1.5, 3.0), 1e-4) && upper.abs_diff_eq(Vec3::new(1.5, 2.5, 3.0), 1e-4));
        assert!(lower.z < 3.0 && upper.z > 3.0, "wider than flat");
    }
}
