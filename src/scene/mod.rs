//! The immutable scene: shapes, materials, lights, camera.
//!
//! [`SceneDescription`] is what a file says; [`Scene`] is what rays travel through.

pub mod appearance;
mod camera;
pub mod description;
mod emitters;
mod features;
pub mod lights;
pub mod materials;
pub mod mesh;
pub mod parameters;
mod parametrisation;
pub mod relief;
mod surface;
pub mod textures;

pub use appearance::Appearance;
pub use camera::{Camera, Ray};
pub use description::SceneDescription;
pub use emitters::Emitters;
pub use features::{DiffuseProfile, Features, FullProfile, Kernel, PlainProfile, Profile};
pub use mesh::Mesh;
pub use surface::{NO_LIGHT, Surface};

use crate::embree;
use description::{FilmDescription, Integrator, ShapeGeometry, Sides};
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
    shapes: Vec<Shape>,
    appearances: Vec<Appearance>,
    /// The scattering function of each appearance that has a plain one (of others, that of their first part).
    materials: Vec<Material>,
}

impl Scene {
    /// Builds the acceleration structure and look-up tables. Errors are Embree's: memory, mostly.
    pub fn new(device: &embree::Device, description: SceneDescription) -> Result<Scene, embree::EmbreeError> {
        let features = Features::of(&description);
        let geometries = description.shapes.iter().map(|s| geometry(&s.geometry)).collect();
        let tracer = embree::Scene::new(device, geometries)?;
        let radius = tracer.bounds().map_or(1.0, |(low, high)| 0.5 * (high - low).length());
        let (emitters, light_of_shape) = Emitters::new(&description, radius);
        let shapes = description
            .shapes
            .iter()
            .zip(light_of_shape)
            .map(|(shape, light)| {
                let (appearances, two_sided) = match shape.sides {
                    Sides::One(m) => ([m, m], false),
                    Sides::Two { front, back } => ([front, back], true),
                };
                let depends = |m: u32| {
                    let appearance = &description.appearances[m as usize];
                    appearance.plain().is_none() || appearance.needs_tangents()
                };
                Shape {
                    kind: surface::Kind::new(&shape.geometry),
                    appearances,
                    two_sided,
                    light: light.unwrap_or(NO_LIGHT),
                    varies: shape.emission.as_ref().is_some_and(Varying::is_textured)
                        || appearances.into_iter().any(depends),
                }
            })
            .collect();
        Ok(Scene {
            integrator: description.integrator,
            film: description.film,
            camera: Camera::new(&description.camera, &description.film),
            emitters,
            features,
            tracer,
            shapes,
            materials: description.appearances.iter().map(|a| a.parts()[0].material).collect(),
            appearances: description.appearances,
        })
    }

    /// All appearances.
    pub fn appearances(&self) -> &[Appearance] {
        &self.appearances
    }
}

fn geometry(g: &ShapeGeometry) -> embree::Geometry {
    match g {
        ShapeGeometry::Mesh(mesh) => embree::Geometry::Triangles(mesh.clone()),
        &ShapeGeometry::Sphere { center, radius, .. } => embree::Geometry::Sphere { center, radius },
        &ShapeGeometry::Disk { center, radius, axes } => embree::Geometry::Disk { center, normal: axes.z_axis, radius },
    }
}
