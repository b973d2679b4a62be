//! What a scene file says, free of any file format: plain data, validated, in world space.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};

use serde::{Deserialize, Serialize};

use super::{Appearance, Mesh, lights::Light, textures::Varying};
use crate::film::{Filter, PixelFormat, Window};

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
    /// Surfaces in the world.
    pub shapes: Vec<ShapeDescription>,
    /// Surfaces that are there only where instances place them.
    pub groups: Vec<GroupDescription>,
    /// Where the groups are.
    pub instances: Vec<InstanceDescription>,
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
    /// survival of at most 0.95 a bounce, fewer than one path in 10³⁵⁰ would be longer.
    pub const LONGEST: u32 = 16_000;
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

/// A camera. In its own coordinates it looks along +z, +y is up and +x is *left* (Mitsuba's convention).
#[derive(Clone, Copy, Debug)]
pub struct CameraDescription {
    /// Camera to world; no scale other than a uniform one, but for [`Projection::Orthographic`].
    pub to_world: Affine3A,
    /// How film positions become rays.
    pub projection: Projection,
    /// Distance along the optical axis before which nothing is seen, > 0.
    pub near_clip: f32,
    /// Distance along the optical axis beyond which nothing is seen.
    pub far_clip: f32,
}

/// How film positions become rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays pass through the origin, or through a lens around it.
    Perspective {
        /// Field of view in degrees, within (0, 180).
        fov: f32,
        /// What `fov` spans.
        fov_axis: FovAxis,
        /// How far the picture is moved against the optical axis, as fractions of its width and height: with (x, y) the
        /// axis passes through (½ − x, ½ − y), counted from the upper left corner.
        principal_point: [f32; 2],
        /// A lens in the place of the pinhole.
        lens: Option<Lens>,
    },
    /// All rays are parallel to +z, and the whole film is as wide as −1 to 1 along x; the scale of `to_world` is that of
    /// the picture.
    Orthographic,
}

/// An ideal thin lens with a round aperture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the aperture, > 0.
    pub aperture_radius: f32,
    /// Distance along the optical axis of the plane that is sharp, > 0.
    pub focus_distance: f32,
}

/// Size and reconstruction filter of the picture, which may be a part of a larger one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilmDescription {
    /// Width in pixels of the picture that is made, ≥ 1.
    pub width: u32,
    /// Height in pixels of the picture that is made, ≥ 1.
    pub height: u32,
    /// Where it lies in the whole picture, which is what the camera's field of view spans.
    pub window: Window,
    /// How samples spread over pixels. None come from beyond the picture that is made.
    pub filter: Filter,
    /// What a pixel holds.
    pub format: PixelFormat,
}

impl FilmDescription {
    /// A whole picture in colour.
    pub const fn new(width: u32, height: u32, filter: Filter) -> FilmDescription {
        FilmDescription { width, height, window: Window::on_whole(width, height), filter, format: PixelFormat::Rgb }
    }
}

impl SceneDescription {
    /// All surfaces: those in the world, then group by group those of groups.
    pub fn all_shapes(&self) -> impl Iterator<Item = &ShapeDescription> {
        self.shapes.iter().chain(self.groups.iter().flat_map(|group| &group.shapes))
    }
}

/// Surfaces that belong together and do not emit, at least one.
#[derive(Clone, Debug)]
pub struct GroupDescription {
    /// The group's id in the file, or a made-up one, for messages.
    pub name: String,
    /// The surfaces, in the group's own coordinates.
    pub shapes: Vec<ShapeDescription>,
}

/// One appearance of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceDescription {
    /// Index into [`SceneDescription::groups`].
    pub group: usize,
    /// The group's coordinates to those of the world; not singular.
    pub to_world: Affine3A,
}

/// One surface.
#[derive(Clone, Debug)]
pub struct ShapeDescription {
    /// The shape's id in the file, or a made-up one, for messages.
    pub name: String,
    /// Its geometry in world space, or in the group's.
    pub geometry: ShapeGeometry,
    /// What its two sides do.
    pub sides: Sides,
    /// Radiance emitted from the front, where it is a light.
    pub emission: Option<Varying>,
}

/// Geometry of a surface, in world space or in that of its group.
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
    /// An exact cylinder without caps; the front is the outside unless flipped.
    Cylinder {
        /// Where the axis begins.
        start: Vec3,
        /// How long it is, > 0.
        length: f32,
        /// Radius, > 0.
        radius: f32,
        /// Its own axes, orthonormal, of which the third is that of the cylinder.
        axes: Mat3,
        /// The front is the inside.
        flipped: bool,
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
                projection: Projection::Perspective {
                    fov: 45.0,
                    fov_axis: FovAxis::X,
                    principal_point: [0.0; 2],
                    lens: None,
                },
                near_clip: 0.01,
                far_clip: 100.0,
            },
            film: FilmDescription::new(1, 1, Filter::Box),
            appearances: Vec::new(),
            shapes: Vec::new(),
            groups: Vec::new(),
            instances: Vec::new(),
            lights,
            warnings: Vec::new(),
        }
    }
}
