//! Kinds of lights, one file each.
//!
//! A light knows how to be sampled from a surface point and with what density; choosing among the lights of a scene is
//! [`Emitters`](super::Emitters)' business. Surfaces that emit become one of the kinds by [`Light::of_shape`], others
//! are read from files by [`read`].
//!
//! To add one: a new file and one line in the registry below (and in [`read`], where files name it).

mod constant;
mod cylinder;
mod directional;
mod disk;
mod mesh;
mod point;
mod sphere;
mod spot;

pub use constant::Constant;
pub use cylinder::Cylinder;
pub use directional::Directional;
pub use disk::Disk;
pub use mesh::MeshLight;
pub use point::Point;
pub use sphere::Sphere;
pub use spot::Spot;

use glam::Vec3;

use super::{
    Profile, Rgb,
    description::{ShapeDescription, ShapeGeometry},
    parameters::Parameters,
};
use crate::math::offset_origin;

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Start of the shadow ray, just off the surface.
    pub origin: Vec3,
    /// Unit direction.
    pub wi: Vec3,
    /// Length of the shadow ray, a little short of the light.
    pub tfar: f32,
    /// Radiance over density, per channel.
    pub weight: Rgb,
    /// Density with respect to solid angle; infinite for points and single directions, which no other technique can hit.
    pub pdf: f32,
}

/// Keeps shadow rays from meeting the light itself.
const SHORT_OF_LIGHT: f32 = 0.9999;

/// A kind of light.
trait Emit {
    /// Emitted power in W, up to the unit of the scene, per channel; `scene_radius` is that of a sphere around it.
    fn power(&self, scene_radius: f32) -> Rgb;
    /// The largest radiance, intensity or irradiance it can show, per channel.
    fn value(&self) -> Rgb;
    /// Samples a direction to it from the surface point `p` with geometric normal `ng`; `None` where the chosen place
    /// does not shine to `p`.
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample>;
    /// Density with which [`sample`](Self::sample) gives the direction from `origin` to the point `q` with normal `n`
    /// on it, with respect to solid angle at `origin`; for lights at infinity, to any direction.
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32;
}

macro_rules! registry {
    ($($kind:ident),+ $(,)?) => {
        /// A light of any kind.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Light {
            /// See [`MeshLight`].
            MeshLight(MeshLight),
            $(#[doc = concat!("See [`", stringify!($kind), "`].")] $kind($kind)),+
        }

        impl Light {
            /// The light whatever its kind.
            fn as_emit(&self) -> &dyn Emit {
                match self {
                    Light::MeshLight(light) => light,
                    $(Light::$kind(light) => light),+
                }
            }

            /// Samples a direction from the surface point `p` with geometric normal `ng`; `None` where the chosen
            /// place does not shine to `p`.
            #[inline(always)]
            pub fn sample<P: Profile>(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
                match self {
                    Light::MeshLight(light) => light.sample(p, ng, u),
                    _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
                    $(Light::$kind(light) => light.sample(p, ng, u)),+
                }
            }

            /// Density with which [`sample`](Self::sample) gives the direction from `origin` to the point `q` with
            /// normal `n` on the light, with respect to solid angle at `origin`.
            #[inline(always)]
            pub fn pdf<P: Profile>(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
                match self {
                    Light::MeshLight(light) => light.pdf(origin, q, n),
                    _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
                    $(Light::$kind(light) => light.pdf(origin, q, n)),+
                }
            }
        }
    };
}

// meshes are in every profile; the others only where a scene has any
registry! { Constant, Cylinder, Directional, Disk, Point, Sphere, Spot }

/// Names that [`read`] knows, as scene files use them. (`area` is a property of shapes.)
pub const KNOWN: &[&str] = &["constant", "directional", "point", "spot"];

/// Reads the light of that name; `None` where the name is not [`KNOWN`].
pub fn read(name: &str, parameters: &mut dyn Parameters) -> Option<Light> {
    match name {
        "constant" => Some(Light::Constant(Constant::read(parameters))),
        "directional" => Some(Light::Directional(Directional::read(parameters))),
        "point" => Some(Light::Point(Point::read(parameters))),
        "spot" => Some(Light::Spot(Spot::read(parameters))),
        _ => None,
    }
}

impl Light {
    /// Emitted power in W, up to the unit of the scene, per channel; `scene_radius` is that of a sphere around it.
    pub fn power(&self, scene_radius: f32) -> Rgb {
        self.as_emit().power(scene_radius)
    }

    /// The largest radiance (intensity, for points) it can show.
    #[inline(always)]
    pub fn value(&self) -> Rgb {
        match self {
            Light::MeshLight(light) => light.value(),
            other => other.as_emit().value(),
        }
    }

    /// The light that an emitting surface is.
    pub fn of_shape(shape: &ShapeDescription) -> Option<Light> {
        let radiance = shape.emission?;
        Some(match &shape.geometry {
            ShapeGeometry::Mesh(mesh) => Light::MeshLight(MeshLight::new(mesh.clone(), radiance)),
            &ShapeGeometry::Sphere { center, radius, flipped } => {
                Light::Sphere(Sphere { center, radius, flipped, radiance })
            }
            &ShapeGeometry::Disk { center, normal, radius } => Light::Disk(Disk::new(center, normal, radius, radiance)),
            &ShapeGeometry::Cylinder { start, end, radius, flipped } => {
                Light::Cylinder(Cylinder::new(start, end, radius, flipped, radiance))
            }
        })
    }
}

/// A sample towards the point `q` of a surface that emits `radiance`, chosen with density `pdf_area`. Of the surface's
/// normals the shading one tells the side that shines, as for rays that hit it, and the geometric one the density.
#[inline(always)]
fn towards(
    p: Vec3,
    ng: Vec3,
    q: Vec3,
    [geometric, shading]: [Vec3; 2],
    radiance: Rgb,
    pdf_area: f32,
) -> Option<LightSample> {
    let origin = origin_towards(p, ng, q - p);
    let to = q - origin;
    let d2 = to.length_squared();
    let distance = d2.sqrt();
    let wi = to / distance;
    let cos = wi.dot(geometric).abs();
    if wi.dot(shading) >= 0.0 || cos == 0.0 || d2 <= 0.0 {
        return None; // from behind
    }
    let pdf = pdf_area * d2 / cos;
    Some(LightSample { origin, wi, tfar: distance * SHORT_OF_LIGHT, weight: radiance / pdf, pdf })
}

/// A density per area as one per solid angle at `origin`: times distance² over the cosine at the light.
#[inline(always)]
fn per_solid_angle(pdf_area: f32, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
    let to = q - origin;
    let d2 = to.length_squared();
    let cos = to.dot(n).abs() / d2.sqrt();
    pdf_area * d2 / cos.max(f32::MIN_POSITIVE)
}

/// Start of a shadow ray from `p` in about the direction `to`.
#[inline(always)]
fn origin_towards(p: Vec3, ng: Vec3, to: Vec3) -> Vec3 {
    offset_origin(p, if ng.dot(to) >= 0.0 { ng } else { -ng })
}
