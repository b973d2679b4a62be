//! What a scene file says, free of any file format: plain data, validated, in world space.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};

use super::{Appearance, Mesh, lights::Light, textures::Varying};
use crate::film::Filter;

/// A scene as its file describes it. [`load`](crate::load) makes it, `Scene` is built from it.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    /// How long paths may become.
    pub integrator: Integrator,
    /// Where the picture is taken from.
    pub camera: CameraDescription,
    /// The picture.
    pub film: FilmDescription,
    /// What surfaces look like, referred to by index.
    pub appearances: Vec<Appearance>,
    /// Surfaces.
    pub shapes: Vec<ShapeDescription>,
    /// Lights that are not surfaces.
    pub lights: Vec<Light>,
    /// What the person should know but which does not keep the scene from rendering, one sentence each.
    pub warnings: Vec<String>,
}

/// Limits on path length, with Mitsuba's meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrator {
    /// Longest path in edges (1: lights seen directly, 2: one bounce); `None`: no limit.
    pub max_depth: Option<u32>,
    /// Number of edges from which on paths end by Russian roulette.
    pub rr_depth: u32,
}

impl Integrator {
    /// Longest path in edges that primary dimensions can be numbered for. Also the limit where a scene sets none: with
    /// survival of at most 0.95 a bounce, fewer than one path in 10⁷⁰⁰ would be longer.
    pub const LONGEST: u32 = 32_000;
}

/// Which extent of the film the field of view spans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FovAxis {
    /// The width.
    X,
    /// The height.
    Y,
    /// The diagonal.
    Diagonal,
    /// The smaller of width and height.
    Smaller,
    /// The larger of width and height.
    Larger,
}

/// A pinhole camera. In its own coordinates it looks along +z, +y is up and +x is *left* (Mitsuba's convention).
#[derive(Clone, Copy, Debug)]
pub struct CameraDescription {
    /// Camera to world; no scale other than a uniform one.
    pub to_world: Affine3A,
    /// Field of view in degrees, within (0, 180).
    pub fov: f32,
    /// What `fov` spans.
    pub fov_axis: FovAxis,
    /// Distance along the optical axis before which nothing is seen, > 0.
    pub near_clip: f32,
    /// Distance along the optical axis beyond which nothing is seen.
    pub far_clip: f32,
}

/// Size and reconstruction filter of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmDescription {
    /// Width in pixels, ≥ 1.
    pub width: u32,
    /// Height in pixels, ≥ 1.
    pub height: u32,
    /// How samples spread over pixels.
    pub filter: Filter,
}

/// One surface.
#[derive(Clone, Debug)]
pub struct ShapeDescription {
    /// The shape's id in the file, or a made-up one, for messages.
    pub name: String,
    /// Its geometry in world space.
    pub geometry: ShapeGeometry,
    /// What its two sides do.
    pub sides: Sides,
    /// Radiance emitted from the front, where it is a light.
    pub emission: Option<Varying>,
}

/// Geometry of a surface, in world space.
#[derive(Clone, Debug)]
pub enum ShapeGeometry {
    /// Triangles; the front is where they run counter-clockwise (flipped already if the file says so).
    Mesh(Arc<Mesh>),
    /// An exact sphere; the front is the outside unless flipped.
    Sphere {
        /// Centre.
        center: Vec3,
        /// Radius, > 0.
        radius: f32,
        /// Its own axes, which surface coordinates refer to: a rotation.
        axes: Mat3,
        /// The front is the inside.
        flipped: bool,
    },
    /// An exact flat disk.
    Disk {
        /// Centre.
        center: Vec3,
        /// Radius, > 0.
        radius: f32,
        /// Its own axes, orthonormal, of which the third is the normal of the front.
        axes: Mat3,
    },
}

/// Appearances of the two sides of a surface, as indices into [`SceneDescription::appearances`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// One for a surface that has a front (an opaque one is black from behind, a dielectric
    /// transmits between the two sides).
    One(u32),
    /// One for each side, each seeing the side it is on as its front (Mitsuba's `twosided`).
    Two {
        /// Of the front.
        front: u32,
        /// Of the back.
        back: u32,
    },
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// An empty scene with those lights.
    pub fn with_lights(lights: Vec<Light>) -> SceneDescription {
        SceneDescription {
            integrator: Integrator { max_depth: None, rr_depth: 5 },
            camera: CameraDescription {
                to_world: Affine3A::IDENTITY,
                fov: 45.0,
                fov_axis: FovAxis::X,
                near_clip: 0.01,
                far_clip: 100.0,
            },
            film: FilmDescription { width: 1, height: 1, filter: Filter::Box },
            appearances: Vec::new(),
            shapes: Vec::new(),
            lights,
            warnings: Vec::new(),
        }
    }
}
