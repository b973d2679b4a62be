//! The only wall around Embree 4: finding and loading the library, owning its objects, tracing packets of rays.
//!
//! [`Device`] loads the library, [`Scene`] builds a hierarchy over [`Geometry`], and [`Rays`] go in and [`Hits`]
//! come out in packets of a [`Width`]. A hit does not depend on the width: see `packet` for what was measured.
//!
//! Embree is loaded when the program runs, not linked, so that one binary serves a system's package, a release
//! somewhere on the disk and the copy that the build obtained; `library` has the order in which they are tried.
//!
//! We declare the functions of Embree that we call in `ffi`, because the existing bindings carry the headers of
//! 4.2: since 4.3 a hit is one field longer, and with them every traced ray writes past its end.
#![allow(unsafe_code)] // a C library behind raw pointers; everywhere else the crate denies it

mod device;
mod ffi;
mod library;
mod packet;
mod quadric;
mod scene;

pub use device::Device;
pub use library::EmbreeError;
pub use packet::{Hit, Hits, MISS, Rays, Width};
pub use scene::{Geometry, Scene};
