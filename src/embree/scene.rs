//! Geometry handed to Embree, and the hierarchy over it.

use super::device::Device;
use super::ffi::{self, Bounds, GeometryHandle, SceneHandle};
use super::library::EmbreeError;
use crate::scene::Mesh;
use glam::Vec3;
use std::ffi::{c_int, c_void};
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
}

/// A built hierarchy, ready for rays from any number of threads.
pub struct Scene {
    device: Device,
    handle: SceneHandle,
    /// Keeps alive what Embree reads.
    geometries: Vec<Geometry>,
}

// SAFETY: after its commit a scene is only read, and Embree allows queries from any number of threads.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: the handle came from `rtcNewScene` and is released only here; `device` and `geometries` are
        // dropped after this.
        unsafe { (self.device.embree().tracing.release_scene)(self.handle) }
    }
}

impl Scene {
    /// Builds the hierarchy, with watertight intersections and at the highest quality.
    pub fn new(device: &Device, geometries: Vec<Geometry>) -> Result<Scene, EmbreeError> {
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
        let scene = Scene { device: device.clone(), handle, geometries };
        // SAFETY: the scene is alive and not shared yet.
        unsafe {
            (functions.set_scene_flags)(handle, ffi::SCENE_ROBUST);
            (functions.set_scene_build_quality)(handle, ffi::BUILD_QUALITY_HIGH);
        }
        for (id, geometry) in (0..).zip(&scene.geometries) {
            scene.attach(geometry, id).map_err(failed)?;
        }
        // SAFETY: as above; the buffers that Embree reads from now on are held by `geometries`.
        unsafe { (functions.commit_scene)(handle) };
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

    pub(super) fn handle(&self) -> SceneHandle {
        self.handle
    }

    fn attach(&self, geometry: &Geometry, id: u32) -> Result<(), &'static str> {
        let functions = &self.device.embree().tracing;
        let kind = match geometry {
            Geometry::Triangles(_) => ffi::GEOMETRY_TRIANGLE,
            Geometry::Sphere { .. } => ffi::GEOMETRY_SPHERE_POINT,
            Geometry::Disk { .. } => ffi::GEOMETRY_ORIENTED_DISC_POINT,
        };
        // SAFETY: the device is alive; the new geometry is checked before it is used, and released once: the scene
        // holds its own reference.
        unsafe {
            let handle = (functions.new_geometry)(self.device.handle(), kind);
            if handle.is_null() {
                return Err(self.device.take_error().unwrap_or("unknown error"));
            }
            match geometry {
                Geometry::Triangles(mesh) => self.share_mesh(handle, mesh),
                Geometry::Sphere { center, radius } => {
                    self.fill(handle, ffi::BUFFER_VERTEX, ffi::FORMAT_FLOAT4, center.extend(*radius).to_array());
                }
                Geometry::Disk { center, normal, radius } => {
                    self.fill(handle, ffi::BUFFER_VERTEX, ffi::FORMAT_FLOAT4, center.extend(*radius).to_array());
                    self.fill(handle, ffi::BUFFER_NORMAL, ffi::FORMAT_FLOAT3, normal.to_array());
                }
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
    /// `handle` is a triangle geometry, and `mesh` belongs to one of `self.geometries`, which outlive it.
    unsafe fn share_mesh(&self, handle: GeometryHandle, mesh: &Mesh) {
        let share = self.device.embree().tracing.set_shared_buffer;
        let (positions, triangles) = (mesh.padded_positions(), &mesh.triangles);
        // The padding, which Embree needs behind the last vertex because it reads four floats, is not counted.
        // SAFETY: pointers, strides and counts describe these slices; `Arc` keeps them in place and unchanged.
        unsafe {
            let vertices: *const c_void = positions.as_ptr().cast();
            share(
                handle,
                ffi::BUFFER_VERTEX,
                0,
                ffi::FORMAT_FLOAT3,
                vertices,
                0,
                size_of::<Vec3>(),
                positions.len() - 1,
            );
            let indices: *const c_void = triangles.as_ptr().cast();
            share(handle, ffi::BUFFER_INDEX, 0, ffi::FORMAT_UINT3, indices, 0, size_of::<[u32; 3]>(), triangles.len());
        }
    }

    /// Gives a geometry a buffer of one item.
    ///
    /// # Safety
    /// `handle` is a geometry that takes such a buffer.
    unsafe fn fill<const N: usize>(&self, handle: GeometryHandle, buffer: c_int, format: c_int, item: [f32; N]) {
        // SAFETY: Embree allocates at least one item of `N` floats, or returns null.
        unsafe {
            let set = self.device.embree().tracing.set_new_buffer;
            let memory: *mut f32 = set(handle, buffer, 0, format, size_of::<[f32; N]>(), 1).cast();
            if !memory.is_null() {
                ptr::copy_nonoverlapping(item.as_ptr(), memory, N);
            }
        }
    }
}
