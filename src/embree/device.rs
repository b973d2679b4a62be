//! An Embree device: the library, with a choice of instruction set.

use super::ffi::{DeviceHandle, PROPERTY_NATIVE_RAY4, PROPERTY_NATIVE_RAY8, PROPERTY_NATIVE_RAY16};
use super::library::{Embree, EmbreeError, embree, error_in_words};
use super::packet::Width;
use std::ffi::{CString, c_int};
use std::sync::Arc;
use std::thread::available_parallelism;

/// Options of every device: affinity is ours to set, not Embree's.
const OPTIONS: &str = "set_affinity=0";

/// Embree, loaded and started. Clones share it.
#[derive(Clone)]
pub struct Device(Arc<Owned>);

struct Owned {
    embree: &'static Embree,
    handle: DeviceHandle,
}

// SAFETY: Embree's devices may be used from any thread at any time; its documentation says so.
unsafe impl Send for Owned {}
// SAFETY: as above.
unsafe impl Sync for Owned {}

impl Drop for Owned {
    fn drop(&mut self) {
        // SAFETY: the handle came from `rtcNewDevice`, is not null and is released only here.
        unsafe { (self.embree.starting.release_device)(self.handle) }
    }
}

impl Device {
    /// As [`on_threads`](Self::on_threads), with as many threads as the machine runs at once.
    pub fn new(config: &str) -> Result<Device, EmbreeError> {
        Device::on_threads(available_parallelism().map_or(1, usize::from), config)
    }

    /// Loads Embree and starts it with additional options of `rtcNewDevice`, such as `isa=avx2`, or none. Hierarchies
    /// will be built on so many threads, 1 or more, of which the one that asks is the first; the others sleep otherwise.
    ///
    /// The number of threads does not show: Embree splits by counts, least and greatest values, which are exact in any
    /// order, and sorts the triangles of a leaf by their numbers. So even those rays find the same triangle that hit
    /// several at once.
    pub fn on_threads(threads: usize, config: &str) -> Result<Device, EmbreeError> {
        let embree = embree()?;
        let separator = if config.is_empty() { "" } else { "," };
        let config = format!("threads={threads},{OPTIONS}{separator}{config}");
        let options = CString::new(config.clone())
            .map_err(|_| EmbreeError::Device { config: config.clone(), reason: "the options hold a zero byte" })?;
        // SAFETY: a C string that outlives the call.
        let handle = unsafe { (embree.starting.new_device)(options.as_ptr()) };
        if handle.is_null() {
            // SAFETY: asked about no device, Embree tells what went wrong on this thread.
            let code = unsafe { (embree.starting.device_error)(handle) };
            return Err(EmbreeError::Device { config, reason: error_in_words(code) });
        }
        Ok(Device(Arc::new(Owned { embree, handle })))
    }

    /// Major, minor, patch.
    pub fn version(&self) -> (u32, u32, u32) {
        self.0.embree.version.parts()
    }

    /// The packet widths for which this processor has a kernel of its own; Embree takes the others apart.
    pub fn native_widths(&self) -> Vec<Width> {
        let native = |width: &Width| match width {
            Width::W1 => true,
            Width::W4 => self.property(PROPERTY_NATIVE_RAY4) != 0,
            Width::W8 => self.property(PROPERTY_NATIVE_RAY8) != 0,
            Width::W16 => self.property(PROPERTY_NATIVE_RAY16) != 0,
        };
        Width::ALL.into_iter().filter(native).collect()
    }

    /// The loaded library: a path, or a bare name where the system's loader found it.
    pub fn library_path(&self) -> &std::path::Path {
        &self.0.embree.path
    }

    /// Version, place and origin of the library, for logs.
    pub fn description(&self) -> String {
        let embree = self.0.embree;
        format!("Embree {} ({}, {})", embree.version, embree.path.display(), embree.origin)
    }

    /// What decides on the last bits of a hit: version, processor family and instruction sets.
    pub fn arithmetic(&self) -> String {
        let widths: Vec<String> = self.native_widths().iter().map(Width::to_string).collect();
        #[cfg(target_arch = "x86_64")]
        let fused = is_x86_feature_detected!("fma") && is_x86_feature_detected!("avx2");
        #[cfg(not(target_arch = "x86_64"))]
        let fused = false;
        format!(
            "Embree {}, {}{}, packets of {}",
            self.0.embree.version,
            std::env::consts::ARCH,
            if fused { " with AVX2" } else { "" },
            widths.join(", ")
        )
    }

    pub(super) fn embree(&self) -> &'static Embree {
        self.0.embree
    }

    pub(super) fn handle(&self) -> DeviceHandle {
        self.0.handle
    }

    /// The first error on this thread since the last call, in words.
    pub(super) fn take_error(&self) -> Option<&'static str> {
        // SAFETY: the handle lives as long as `self`.
        let code = unsafe { (self.0.embree.starting.device_error)(self.0.handle) };
        (code != 0).then(|| error_in_words(code))
    }

    fn property(&self, property: c_int) -> isize {
        // SAFETY: the handle lives as long as `self`.
        unsafe { (self.0.embree.starting.device_property)(self.0.handle, property) }
    }
}
