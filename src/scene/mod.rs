//! The immutable scene: shapes, materials, lights, camera.
//!
//! [`SceneDescription`] is what a file says; [`Scene`] is what rays travel through.

pub mod appearance;
mod camera;
pub mod description;
mod emitters;
mod features;
mod instances;
pub mod lights;
pub mod materials;
pub mod mesh;
pub mod parameters;
mod parametrisation;
pub mod relief;
mod scaling;
mod surface;
pub mod textures;

pub use appearance::{Appearance, Mixture, Scattering, ScatteringRef};
pub(crate) use camera::Eye;
pub use camera::{Camera, Ray, Sight};
pub use description::SceneDescription;
pub use emitters::Emitters;
pub use features::{DiffuseProfile, Features, FlatProfile, FullProfile, Kernel, PlainProfile, Profile};
pub use mesh::Mesh;
pub use surface::{NO_LIGHT, Surface};
pub(crate) use surface::{Side, on_triangle};

use crate::embree;
use description::{FilmDescription, Integrator, ShapeDescription, ShapeGeometry, Sides};
use instances::Instances;
use lights::Ball;
use materials::Material;
use surface::Shape;
use textures::Varying;

/// A colour or a radiometric quantity in linear RGB (Rec. 709 primaries), one `f32` a channel.
pub type Rgb = glam::Vec3;

/// A scene ready to be rendered; never changes.
pub struct Scene {
    /// Limits on path length.
    pub integrator: Integrator,
    /// Size and filter of the picture.
    pub film: FilmDescription,
    /// Where it is taken from.
    pub camera: Camera,
    /// Lights.
    pub emitters: Emitters,
    /// What the scene needs.
    pub features: Features,
    /// The acceleration structure.
    pub tracer: embree::Scene,
    /// In the world first, then those of groups.
    shapes: Vec<Shape>,
    instances: Instances,
    appearances: Vec<Appearance>,
    /// The scattering function of each appearance that has a plain one (of others, that of their first part).
    materials: Vec<Material>,
}

impl Scene {
    /// Builds the acceleration structure and look-up tables. Errors are Embree's: memory, mostly.
    pub fn new(device: &embree::Device, description: SceneDescription) -> Result<Scene, embree::EmbreeError> {
        Scene::watched(device, description, &|_| ())
    }

    /// As [`new`](Self::new); `watch` is told, now and then, how much of the acceleration structure is built, 0 to 1.
    pub fn watched(
        device: &embree::Device,
        description: SceneDescription,
        watch: &(dyn Fn(f64) + Sync),
    ) -> Result<Scene, embree::EmbreeError> {
        let description = description.in_fit_units();
        let features = Features::of(&description);
        let groups = instances::trace_groups(device, &description.groups)?;
        let mut geometries = geometries(&description.shapes);
        geometries.extend(description.instances.iter().map(|instance| embree::Geometry::Instance {
            of: groups[instance.group].clone(),
            to_world: instance.to_world,
        }));
        let tracer = embree::Scene::watched(device, geometries, watch)?;
        let around = |(low, high): (glam::Vec3, glam::Vec3)| Ball {
            center: 0.5 * (low + high),
            radius: 0.5 * (high - low).length(),
        };
        let bounds = tracer.bounds().map_or(Ball { center: glam::Vec3::ZERO, radius: 1.0 }, around);
        let (emitters, light_of_shape) = Emitters::new(&description, bounds);
        let lights = light_of_shape.into_iter().chain(std::iter::repeat(None)); // shapes of groups do not emit
        let surface = |(shape, light)| surface_of(shape, light, &description.appearances);
        let shapes = description.all_shapes().zip(lights).map(surface).collect();
        Ok(Scene {
            integrator: description.integrator,
            film: description.film,
            camera: Camera::new(&description.camera, &description.film),
            emitters,
            features,
            tracer,
            shapes,
            instances: Instances::new(&description),
            materials: description.appearances.iter().map(|a| a.parts()[0].material).collect(),
            appearances: description.appearances,
        })
    }

    /// The scattering function of an appearance that has a plain one.
    #[inline(always)]
    pub(crate) fn material(&self, appearance: u32) -> &Material {
        &self.materials[appearance as usize]
    }

    /// All appearances.
    pub fn appearances(&self) -> &[Appearance] {
        &self.appearances
    }
}

/// The surface that a shape is.
fn surface_of(shape: &ShapeDescription, light: Option<u32>, all: &[Appearance]) -> Shape {
    let (appearances, two_sided) = match shape.sides {
        Sides::One(m) => ([m, m], false),
        Sides::Two { front, back } => ([front, back], true),
    };
    let depends = |m: u32| all[m as usize].plain().is_none() || all[m as usize].needs_tangents();
    Shape {
        kind: surface::Kind::new(&shape.geometry),
        appearances,
        two_sided,
        light: light.unwrap_or(NO_LIGHT),
        varies: shape.emission.as_ref().is_some_and(Varying::is_textured) || appearances.into_iter().any(depends),
    }
}

/// What Embree is given.
fn geometries(shapes: &[ShapeDescription]) -> Vec<embree::Geometry> {
    let geometry = |shape: &ShapeDescription| match &shape.geometry {
        ShapeGeometry::Mesh(mesh) => embree::Geometry::Triangles(mesh.clone()),
        &ShapeGeometry::Sphere { center, radius, .. } => embree::Geometry::Sphere { center, radius },
        &ShapeGeometry::Disk { center, radius, axes } => embree::Geometry::Disk { center, normal: axes.z_axis, radius },
        &ShapeGeometry::Cylinder { start, length, radius, axes, .. } => {
            embree::Geometry::Cylinder { start, end: start + axes.z_axis * length, radius }
        }
    };
    shapes.iter().map(geometry).collect()
}
