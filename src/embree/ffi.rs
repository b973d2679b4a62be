//! The few types and functions of Embree ≥ 4.3 that we use, declared after its C headers.
//!
//! Sizes and alignments are asserted below: Embree writes through these with aligned vector stores.

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::mem::{align_of, offset_of, size_of};

/// `RTCDevice`, opaque.
pub type DeviceHandle = *mut c_void;
/// `RTCScene`, opaque.
pub type SceneHandle = *mut c_void;
/// `RTCGeometry`, opaque.
pub type GeometryHandle = *mut c_void;

pub const PROPERTY_VERSION: c_int = 0;
pub const PROPERTY_NATIVE_RAY4: c_int = 32;
pub const PROPERTY_NATIVE_RAY8: c_int = 33;
pub const PROPERTY_NATIVE_RAY16: c_int = 34;

pub const GEOMETRY_TRIANGLE: c_int = 0;
pub const GEOMETRY_USER: c_int = 120;
pub const GEOMETRY_INSTANCE: c_int = 121;

pub const BUFFER_INDEX: c_int = 0;
pub const BUFFER_VERTEX: c_int = 1;

pub const FORMAT_UINT3: c_int = 0x5003;
pub const FORMAT_FLOAT3: c_int = 0x9003;
/// Four columns of three: the images of x, y and z, and of the origin.
pub const FORMAT_FLOAT3X4_COLUMN_MAJOR: c_int = 0x9234;

pub const SCENE_ROBUST: c_int = 1 << 2;
pub const BUILD_QUALITY_HIGH: c_int = 2;

/// `RTC_INVALID_GEOMETRY_ID`.
pub const INVALID_ID: u32 = u32::MAX;

/// Alignment of the packets of 1 and 4.
#[repr(align(16))]
#[derive(Clone, Copy)]
pub struct Align16;
/// Alignment of the packet of 8.
#[repr(align(32))]
#[derive(Clone, Copy)]
pub struct Align32;
/// Alignment of the packet of 16.
#[repr(align(64))]
#[derive(Clone, Copy)]
pub struct Align64;

/// `RTCRay`, `RTCRay4`, `RTCRay8` and `RTCRay16`: the first is the others with one lane.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Ray<A, const N: usize> {
    pub align: [A; 0],
    pub origin: [[f32; N]; 3],
    pub tnear: [f32; N],
    pub direction: [[f32; N]; 3],
    pub time: [f32; N],
    pub tfar: [f32; N],
    pub mask: [u32; N],
    pub id: [u32; N],
    pub flags: [u32; N],
}

/// `RTCHit` and its packets, with `RTC_MAX_INSTANCE_LEVEL_COUNT` = 1 as every distribution builds it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Hit<A, const N: usize> {
    pub align: [A; 0],
    pub normal: [[f32; N]; 3],
    pub u: [f32; N],
    pub v: [f32; N],
    pub primitive: [u32; N],
    pub geometry: [u32; N],
    pub instance: [u32; N],
    /// New in 4.3, and the reason why that is the oldest version we take.
    pub instance_primitive: [u32; N],
}

/// `RTCRayHit` and its packets.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct RayHit<A, const N: usize> {
    pub ray: Ray<A, N>,
    pub hit: Hit<A, N>,
}

/// The lanes of a packet that Embree shall look at: −1, all others 0.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Valid<A, const N: usize> {
    pub align: [A; 0],
    pub lanes: [i32; N],
}

/// `RTCIntersectArguments`, also used for occlusion.
#[repr(C)]
pub struct Arguments {
    /// 0: rays are incoherent.
    pub flags: c_int,
    /// All of them: only GPUs look at it.
    pub feature_mask: c_uint,
    pub context: *mut c_void,
    pub filter: *mut c_void,
    pub callback: *mut c_void,
    /// Part of the struct only in builds with `EMBREE_MIN_WIDTH`; the others never read it.
    pub min_width_distance_factor: f32,
}

impl Arguments {
    /// What `rtcInitIntersectArguments` sets.
    pub fn new() -> Arguments {
        Arguments {
            flags: 0,
            feature_mask: u32::MAX,
            context: std::ptr::null_mut(),
            filter: std::ptr::null_mut(),
            callback: std::ptr::null_mut(),
            min_width_distance_factor: 0.0,
        }
    }
}

/// `RTCBounds`.
#[repr(C, align(16))]
#[derive(Default)]
pub struct Bounds {
    pub lower: [f32; 3],
    pub align0: f32,
    pub upper: [f32; 3],
    pub align1: f32,
}

/// `RTCBoundsFunctionArguments`.
#[repr(C)]
pub struct BoundsArguments {
    pub user: *const c_void,
    pub primitive: c_uint,
    pub time_step: c_uint,
    pub bounds: *mut Bounds,
}

/// The beginning of `RTCRayQueryContext`, as far as we read it.
#[repr(C)]
pub struct QueryContext {
    /// The instance that is being looked into, [`INVALID_ID`] in the world.
    pub instance: u32,
}

/// `RTCIntersectFunctionNArguments` and `RTCOccludedFunctionNArguments`, which differ in name only.
#[repr(C)]
pub struct CallbackArguments {
    pub valid: *const i32,
    pub user: *const c_void,
    pub primitive: c_uint,
    pub context: *const QueryContext,
    /// `RTCRayHitN` or `RTCRayN`: fields of `lanes` words each, in the order of [`RayHit`].
    pub rays: *mut f32,
    pub lanes: c_uint,
    pub geometry: c_uint,
}

/// `RTCProgressMonitorFunction`: gets its own pointer and the fraction that is done; false would end the build.
pub type ProgressFunction = unsafe extern "C" fn(*mut c_void, f64) -> bool;
type BoundsFunction = unsafe extern "C" fn(*const BoundsArguments);
type Callback = unsafe extern "C" fn(*const CallbackArguments);

macro_rules! assert_layout {
    ($align:ty, $n:literal: ray $ray:literal, rayhit $rayhit:literal, aligned $aligned:literal) => {
        const _: () = {
            assert!(size_of::<Ray<$align, $n>>() == $ray);
            assert!(align_of::<Ray<$align, $n>>() == $aligned);
            assert!(size_of::<RayHit<$align, $n>>() == $rayhit);
            assert!(align_of::<RayHit<$align, $n>>() == $aligned);
    assert!(offset_of!(RayHit<$align, $n>, hit) == $ray);
    assert!(offset_of!(Ray<$align, $n>, tfar) == 32 * $n);
    assert!(offset_of!(Hit<$align, $n>, geometry) == 24 * $n);
            assert!(align_of::<Valid<$align, $n>>() == $aligned);
        };
    };
}

assert_layout!(Align16, 1: ray 48, rayhit 96, aligned 16);
assert_layout!(Align16, 4: ray 192, rayhit 336, aligned 16);
assert_layout!(Align32, 8: ray 384, rayhit 672, aligned 32);
assert_layout!(Align64, 16: ray 768, rayhit 1344, aligned 64);
const _: () = assert!(size_of::<Bounds>() == 32);

type Intersect1 = unsafe extern "C" fn(SceneHandle, *mut RayHit<Align16, 1>, *mut Arguments);
type IntersectN<A, const N: usize> = unsafe extern "C" fn(*const i32, SceneHandle, *mut RayHit<A, N>, *mut Arguments);
type Occluded1 = unsafe extern "C" fn(SceneHandle, *mut Ray<Align16, 1>, *mut Arguments);
type OccludedN<A, const N: usize> = unsafe extern "C" fn(*const i32, SceneHandle, *mut Ray<A, N>, *mut Arguments);

/// Declares a table of C functions and how to fill it from a library.
macro_rules! functions {
    ($(#[$doc:meta])* pub struct $table:ident { $($field:ident = $symbol:literal: $signature:ty,)* }) => {
        $(#[$doc])*
        pub struct $table { $(pub $field: $signature,)* }

        impl $table {
            /// Looks up every function; the error names the first that is missing.
            ///
            /// # Safety
            /// `library` must be Embree, of a version whose functions have the signatures above, and must stay
            /// loaded for as long as the table is used.
            pub unsafe fn load(library: &libloading::Library) -> Result<$table, &'static str> {
                // SAFETY: the caller vouches for the signatures and for the library staying loaded.
                Ok(unsafe { $table { $($field: *library.get::<$signature>($symbol).map_err(|_| $symbol)?,)* } })
            }
        }
    };
}

functions! {
    /// What it takes to ask a library for its version; the same in Embree 3 and 4.
    pub struct VersionFunctions {
        new_device = "rtcNewDevice": unsafe extern "C" fn(*const c_char) -> DeviceHandle,
        release_device = "rtcReleaseDevice": unsafe extern "C" fn(DeviceHandle),
        device_property = "rtcGetDeviceProperty": unsafe extern "C" fn(DeviceHandle, c_int) -> isize,
        device_error = "rtcGetDeviceError": unsafe extern "C" fn(DeviceHandle) -> c_int,
    }
}

functions! {
    /// Building and tracing, as in Embree ≥ 4.3.
    pub struct Functions {
        new_scene = "rtcNewScene": unsafe extern "C" fn(DeviceHandle) -> SceneHandle,
        release_scene = "rtcReleaseScene": unsafe extern "C" fn(SceneHandle),
        set_scene_flags = "rtcSetSceneFlags": unsafe extern "C" fn(SceneHandle, c_int),
        set_scene_build_quality = "rtcSetSceneBuildQuality": unsafe extern "C" fn(SceneHandle, c_int),
        set_progress_monitor = "rtcSetSceneProgressMonitorFunction": unsafe extern "C" fn(
            SceneHandle, Option<ProgressFunction>, *mut c_void),
        commit_scene = "rtcCommitScene": unsafe extern "C" fn(SceneHandle),
        scene_bounds = "rtcGetSceneBounds": unsafe extern "C" fn(SceneHandle, *mut Bounds),
        new_geometry = "rtcNewGeometry": unsafe extern "C" fn(DeviceHandle, c_int) -> GeometryHandle,
        release_geometry = "rtcReleaseGeometry": unsafe extern "C" fn(GeometryHandle),
        set_shared_buffer = "rtcSetSharedGeometryBuffer": unsafe extern "C" fn(
            GeometryHandle, c_int, c_uint, c_int, *const c_void, usize, usize, usize),
        set_user_primitive_count = "rtcSetGeometryUserPrimitiveCount": unsafe extern "C" fn(GeometryHandle, c_uint),
        set_user_data = "rtcSetGeometryUserData": unsafe extern "C" fn(GeometryHandle, *const c_void),
        set_bounds_function = "rtcSetGeometryBoundsFunction": unsafe extern "C" fn(
            GeometryHandle, BoundsFunction, *const c_void),
        set_intersect_function = "rtcSetGeometryIntersectFunction": unsafe extern "C" fn(GeometryHandle, Callback),
        set_occluded_function = "rtcSetGeometryOccludedFunction": unsafe extern "C" fn(GeometryHandle, Callback),
        set_instanced_scene = "rtcSetGeometryInstancedScene": unsafe extern "C" fn(GeometryHandle, SceneHandle),
        set_transform = "rtcSetGeometryTransform": unsafe extern "C" fn(GeometryHandle, c_uint, c_int, *const c_void),
        commit_geometry = "rtcCommitGeometry": unsafe extern "C" fn(GeometryHandle),
        attach_geometry_by_id = "rtcAttachGeometryByID": unsafe extern "C" fn(SceneHandle, GeometryHandle, c_uint),
        intersect1 = "rtcIntersect1": Intersect1,
        intersect4 = "rtcIntersect4": IntersectN<Align16, 4>,
        intersect8 = "rtcIntersect8": IntersectN<Align32, 8>,
        intersect16 = "rtcIntersect16": IntersectN<Align64, 16>,
        occluded1 = "rtcOccluded1": Occluded1,
        occluded4 = "rtcOccluded4": OccludedN<Align16, 4>,
        occluded8 = "rtcOccluded8": OccludedN<Align32, 8>,
        occluded16 = "rtcOccluded16": OccludedN<Align64, 16>,
    }
}
