//! Geometry handed to Embree, and the hierarchy over it.

use super::device::Device;
use super::ffi::{self, Bounds, GeometryHandle, SceneHandle};
use super::library::EmbreeError;
use super::quadric::{self, Quadric};
use crate::scene::Mesh;
use glam::{Affine3A, Vec3};
use std::ffi::c_void;
use std::fmt;
use std::mem::size_of;
use std::ptr;
use std::sync::Arc;

/// One shape. Its place in the list given to [`Scene::new`] is the `geometry` of its hits.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Triangles; a hit at (u, v) is at (1 − u − v) a + u b + v c. Their buffers are shared with Embree.
    Triangles(Arc<Mesh>),
    /// A sphere, hit from outside and from inside.
    Sphere {
        /// Centre.
        center: Vec3,
        /// Radius, > 0.
        radius: f32,
    },
    /// A disk, hit from both sides.
    Disk {
        /// Centre.
        center: Vec3,
        /// Normal, of any length but 0.
        normal: Vec3,
        /// Radius, > 0.
        radius: f32,
    },
    /// A cylinder without caps, hit from outside and from inside.
    Cylinder {
        /// Where the axis begins.
        start: Vec3,
        /// Where it ends, elsewhere.
        end: Vec3,
        /// Radius, > 0.
        radius: f32,
    },
    /// All that a scene holds, placed elsewhere; the scene itself holds no instances.
    Instance {
        /// The scene.
        of: Arc<Scene>,
        /// Its coordinates to those of this scene, not singular.
        to_world: Affine3A,
    },
}

/// A built hierarchy, ready for rays from any number of threads.
pub struct Scene {
    device: Device,
    handle: SceneHandle,
    geometries: Vec<Geometry>,
    /// What Embree reads: in place, and alive as long as the scene.
    shapes: Box<[Shape]>,
    has_instances: bool,
}

enum Shape {
    Triangles(Arc<Mesh>),
    Quadric(Quadric),
    Instance(Arc<Scene>, Affine3A),
}

impl Shape {
    fn new(geometry: &Geometry) -> Shape {
        match *geometry {
            Geometry::Triangles(ref mesh) => Shape::Triangles(mesh.clone()),
            Geometry::Sphere { center, radius } => Shape::Quadric(Quadric::sphere(center, radius)),
            Geometry::Disk { center, normal, radius } => Shape::Quadric(Quadric::disk(center, normal, radius)),
            Geometry::Cylinder { start, end, radius } => Shape::Quadric(Quadric::cylinder(start, end, radius)),
            Geometry::Instance { ref of, to_world } => Shape::Instance(of.clone(), to_world),
        }
    }
}

// SAFETY: after its commit a scene is only read, and Embree allows queries from any number of threads.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: the handle came from `rtcNewScene` and is released only here; `device` and `shapes` are
        // dropped after this.
        unsafe { (self.device.embree().tracing.release_scene)(self.handle) }
    }
}

impl fmt::Debug for Scene {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("Scene").field("geometries", &self.geometries).finish_non_exhaustive()
    }
}

impl Scene {
    /// Flags and quality of all hierarchies, in Embree's words.
    pub const BUILT_WITH: &str = "scene flag ROBUST, build quality HIGH";

    /// Builds the hierarchy, with watertight intersections and at the highest quality.
    pub fn new(device: &Device, geometries: Vec<Geometry>) -> Result<Scene, EmbreeError> {
        Scene::watched(device, geometries, &|_| ())
    }

    /// As [`new`](Self::new); `watch` is told, now and then and by several threads, how much of the hierarchy is built,
    /// 0 to 1.
    pub fn watched(
        device: &Device,
        geometries: Vec<Geometry>,
        watch: &(dyn Fn(f64) + Sync),
    ) -> Result<Scene, EmbreeError> {
        let functions = &device.embree().tracing;
        device.take_error(); // an earlier one would be taken for ours
        let count = geometries.len();
        let failed = |reason| EmbreeError::Scene { geometries: count, reason };
        // SAFETY: the device is alive.
        let handle = unsafe { (functions.new_scene)(device.handle()) };
        if handle.is_null() {
            return Err(failed(device.take_error().unwrap_or("unknown error")));
        }
        // From here on the scene is released on every way out.
        let shapes: Box<[Shape]> = geometries.iter().map(Shape::new).collect();
        let has_instances = shapes.iter().any(|shape| matches!(shape, Shape::Instance(..)));
        let scene = Scene { device: device.clone(), handle, geometries, shapes, has_instances };
        // SAFETY: the scene is alive and not shared yet.
        unsafe {
            (functions.set_scene_flags)(handle, ffi::SCENE_ROBUST);
            (functions.set_scene_build_quality)(handle, ffi::BUILD_QUALITY_HIGH);
        }
        for (id, shape) in (0..).zip(&scene.shapes) {
            scene.attach(shape, id).map_err(failed)?;
        }
        // SAFETY: as above; the buffers and quadrics that Embree reads from now on, on several threads, are held by
        // `shapes`, and `watch` is `Sync` and outlives the commit, after which nobody calls it.
        unsafe {
            (functions.set_progress_monitor)(handle, Some(tell), ptr::from_ref(&watch).cast_mut().cast());
            (functions.commit_scene)(handle);
            (functions.set_progress_monitor)(handle, None, ptr::null_mut());
        }
        device.take_error().map_or(Ok(scene), |reason| Err(failed(reason)))
    }

    /// The axis-aligned box of everything, or `None` where there is nothing.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut bounds = Bounds::default();
        // SAFETY: the scene is committed, `bounds` has Embree's layout and alignment.
        unsafe { (self.device.embree().tracing.scene_bounds)(self.handle, &mut bounds) };
        let (lower, upper) = (Vec3::from(bounds.lower), Vec3::from(bounds.upper));
        lower.cmple(upper).all().then_some((lower, upper))
    }

    /// The shapes, in the order of their ids.
    pub fn geometries(&self) -> &[Geometry] {
        &self.geometries
    }

    /// The device on which the scene was built.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Whether hits may lie in instances.
    pub fn has_instances(&self) -> bool {
        self.has_instances
    }

    pub(super) fn handle(&self) -> SceneHandle {
        self.handle
    }

    fn attach(&self, shape: &Shape, id: u32) -> Result<(), &'static str> {
        let functions = &self.device.embree().tracing;
        let kind = match shape {
            Shape::Triangles(_) => ffi::GEOMETRY_TRIANGLE,
            Shape::Quadric(_) => ffi::GEOMETRY_USER,
            Shape::Instance(..) => ffi::GEOMETRY_INSTANCE,
        };
        // SAFETY: the device is alive; the new geometry is checked before it is used, and released once: the scene
        // holds its own reference.
        unsafe {
            let handle = (functions.new_geometry)(self.device.handle(), kind);
            if handle.is_null() {
                return Err(self.device.take_error().unwrap_or("unknown error"));
            }
            match shape {
                Shape::Triangles(mesh) => self.share_mesh(handle, mesh),
                Shape::Quadric(quadric) => self.call_back(handle, quadric),
                Shape::Instance(scene, to_world) => self.place(handle, scene, to_world),
            }
            (functions.commit_geometry)(handle);
            (functions.attach_geometry_by_id)(self.handle, handle, id);
            (functions.release_geometry)(handle);
        }
        self.device.take_error().map_or(Ok(()), Err)
    }

    /// Lets Embree read a mesh in place.
    ///
    /// # Safety
    /// `handle` is a triangle geometry, and `mesh` is one that `self.shapes` keeps alive.
    unsafe fn share_mesh(&self, handle: GeometryHandle, mesh: &Mesh) {
        let share = self.device.embree().tracing.set_shared_buffer;
        let (positions, triangles) = (mesh.padded_positions(), &mesh.triangles);
        let (vertex, triangle) = (size_of::<Vec3>(), size_of::<[u32; 3]>());
        // The padding, which Embree needs behind the last vertex because it reads four floats, is not counted.
        let count = positions.len() - 1;
        // SAFETY: pointers, strides and counts describe these slices; `Arc` keeps them in place and unchanged.
        unsafe {
            share(handle, ffi::BUFFER_VERTEX, 0, ffi::FORMAT_FLOAT3, positions.as_ptr().cast(), 0, vertex, count);
            let indices = triangles.as_ptr().cast();
            share(handle, ffi::BUFFER_INDEX, 0, ffi::FORMAT_UINT3, indices, 0, triangle, triangles.len());
        }
    }

    /// Shows Embree a scene in another place.
    ///
    /// # Safety
    /// `handle` is an instance geometry, and `scene` is one that `self.shapes` keeps alive.
    unsafe fn place(&self, handle: GeometryHandle, scene: &Scene, to_world: &Affine3A) {
        let functions = &self.device.embree().tracing;
        let columns = to_world.to_cols_array();
        // SAFETY: the scene is committed; Embree copies the matrix.
        unsafe {
            (functions.set_instanced_scene)(handle, scene.handle);
            (functions.set_transform)(handle, 0, ffi::FORMAT_FLOAT3X4_COLUMN_MAJOR, columns.as_ptr().cast());
        }
    }

    /// Lets Embree ask us about a sphere, disk or cylinder.
    ///
    /// # Safety
    /// `handle` is a user geometry, and `quadric` stays in place as long as `self.shapes`.
    unsafe fn call_back(&self, handle: GeometryHandle, quadric: &Quadric) {
        let functions = &self.device.embree().tracing;
        // SAFETY: the callbacks get back the pointer to the quadric and take it for nothing else.
        unsafe {
            (functions.set_user_primitive_count)(handle, 1);
            (functions.set_user_data)(handle, ptr::from_ref(quadric).cast());
            (functions.set_bounds_function)(handle, quadric::bounds, ptr::null());
            (functions.set_intersect_function)(handle, quadric::intersect);
            (functions.set_occluded_function)(handle, quadric::occluded);
        }
    }
}

/// Tells a watcher how much is built.
///
/// # Safety
/// To be called by Embree only, with the address of a `&(dyn Fn(f64) + Sync)`.
unsafe extern "C" fn tell(watch: *mut c_void, done: f64) -> bool {
    // SAFETY: the caller is Embree, see above.
    let watch: &&(dyn Fn(f64) + Sync) = unsafe { &*watch.cast() };
    watch(done);
    true
}
