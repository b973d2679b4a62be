//! Kinds of lights, one file each.
//!
//! A light knows how to be sampled from a surface point, how to start light subpaths ([`Emission`]), and with what
//! density; choosing among the lights of a scene is
//! [`Emitters`](super::Emitters)' business. Surfaces that emit become one of the kinds by [`Light::of_shape`], others
//! are read from files by [`read`].
//!
//! To add one: a new file and one line in the registry below (and in [`read`], where files name it).

mod constant;
mod cylinder;
mod directional;
mod disk;
mod emission;
mod envmap;
mod mesh;
mod point;
mod sphere;
mod spot;

pub use constant::Constant;
pub use cylinder::Cylinder;
pub use directional::Directional;
pub use disk::Disk;
pub(crate) use emission::surface_direction_pdf;
pub use emission::{Ball, Emission, EmissionInverse, EmitterKind};
pub use envmap::Envmap;
pub use mesh::MeshLight;
pub(crate) use mesh::{Face, on_face};
pub use point::Point;
pub use sphere::Sphere;
pub use spot::Spot;

use glam::{Vec2, Vec3};

use super::{
    Profile, Rgb,
    description::{ShapeDescription, ShapeGeometry},
    parameters::Parameters,
    textures::Varying,
};
use crate::math::offset_origin;
use emission::{from_infinity, from_point, from_surface, invert_surface, surface_pdf};

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
    /// Geometric and shading unit normal at the sampled place of a surface; zero for lights without surface.
    pub normals: [Vec3; 2],
    /// Index of the light, as [`Emitters`](super::Emitters) count them; 0 from a light itself.
    pub light: u32,
}

impl LightSample {
    /// A direction to a light at infinity.
    #[inline(always)]
    fn from_infinity(origin: Vec3, wi: Vec3, weight: Rgb, pdf: f32) -> LightSample {
        LightSample { origin, wi, tfar: f32::MAX, weight, pdf, normals: [Vec3::ZERO; 2], light: 0 }
    }
}

/// Keeps shadow rays from meeting the light itself: their length over the distance of the sampled place.
pub const SHORT_OF_LIGHT: f32 = 0.9999;

/// A kind of light.
trait Emit {
    /// Where it is.
    fn kind(&self) -> EmitterKind;
    /// Emitted power in W, up to the unit of the scene, per channel; `scene_radius` is that of a sphere around it.
    fn power(&self, scene_radius: f32) -> Rgb;
    /// Radiance over its surface, of what rays can hit.
    #[inline(always)]
    fn surface(&self) -> Option<&Varying> {
        None
    }
    /// The largest channel of any radiance, intensity or irradiance it can show.
    fn largest(&self) -> f32 {
        self.surface().map_or(0.0, Varying::largest)
    }
    /// Samples a direction to it from the surface point `p` with geometric normal `ng`, whose length says how far to leave
    /// the surface (see [`lift`](crate::math::lift)); `None` where the chosen place does not shine to `p`.
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample>;
    /// Density with which [`sample`](Self::sample) gives the direction from `origin` to the point `q` with normal `n`
    /// on it, with respect to solid angle at `origin`; for lights at infinity, in the direction `q` from anywhere.
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32;
    /// Starts a light subpath in the scene within that ball: `place` for the place, which of lights all around is a
    /// direction, and `direction` for the rest; `None` where nothing leaves the light so.
    fn emit(&self, place: [f32; 2], direction: [f32; 2], scene: Ball) -> Option<Emission>;
    /// [`Emission::pdf_place`] and [`Emission::pdf_rest`] with which [`emit`](Self::emit) starts a subpath at a place with
    /// those geometric and shading normals in the unit vector `direction`, in which light leaves. Of single directions
    /// that is the light's own; of points the place is the light's.
    fn emission_pdf(&self, normals: [Vec3; 2], direction: Vec3, scene: Ball) -> [f32; 2];
    /// The triangle of a mesh that has the place of [`emit`](Self::emit) and, on meshes, of [`sample`](Self::sample).
    fn triangle(&self, _place: [f32; 2]) -> u32 {
        0
    }
    /// The numbers that [`emit`](Self::emit) starts a subpath with at the place `q` with those normals, on that triangle of
    /// a mesh, in the direction in which light leaves; `None` where they are not known.
    fn invert_emission(
        &self,
        _q: Vec3,
        _triangle: u32,
        _normals: [Vec3; 2],
        _direction: Vec3,
    ) -> Option<EmissionInverse> {
        None
    }
    /// The numbers for which [`sample`](Self::sample) looks from `p` to the place `q`, itself `None` where any will do;
    /// `None` where they are not known.
    fn invert_sample(&self, _p: Vec3, _ng: Vec3, _q: Vec3, _triangle: u32) -> Option<Option<[f32; 2]>> {
        None
    }
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

            /// Radiance of the place with those surface coordinates, of a surface.
            #[inline(always)]
            pub fn radiance<P: Profile>(&self, uv: Vec2) -> Rgb {
                let surface = match self {
                    Light::MeshLight(light) => light.surface(),
                    _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
                    $(Light::$kind(light) => light.surface()),+
                };
                surface.map_or(Rgb::ZERO, |radiance| radiance.at(|| uv))
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

            /// Starts a light subpath in the scene within that ball: `place` for the place, which of lights all around
            /// is a direction, and `direction` for the rest; `None` where nothing leaves the light so.
            #[inline(always)]
            pub fn emit<P: Profile>(&self, place: [f32; 2], direction: [f32; 2], scene: Ball) -> Option<Emission> {
                match self {
                    Light::MeshLight(light) => light.emit(place, direction, scene),
                    _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
                    $(Light::$kind(light) => light.emit(place, direction, scene)),+
                }
            }

            /// [`Emission::pdf_place`] and [`Emission::pdf_rest`] with which [`emit`](Self::emit) starts a subpath at
            /// a place with those geometric and shading normals (of no account for lights without surface) in the unit
            /// vector `direction`, in which light leaves. Of points and single directions, of which there is but one,
            /// the place is taken to be the light's, or the direction.
            #[inline(always)]
            pub fn emission_pdf<P: Profile>(&self, normals: [Vec3; 2], direction: Vec3, scene: Ball) -> [f32; 2] {
                match self {
                    Light::MeshLight(light) => light.emission_pdf(normals, direction, scene),
                    _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
                    $(Light::$kind(light) => light.emission_pdf(normals, direction, scene)),+
                }
            }

            /// Where it is, and with it what can find it.
            #[inline]
            pub fn kind(&self) -> EmitterKind {
                match self {
                    Light::MeshLight(light) => light.kind(),
                    $(Light::$kind(light) => light.kind()),+
                }
            }
        }
    };
}

// meshes are in every profile; the others only where a scene has any
registry! { Constant, Cylinder, Directional, Disk, Envmap, Point, Sphere, Spot }

/// Names that [`read`] knows, as scene files use them. (`area` is a property of shapes.)
pub const KNOWN: &[&str] = &["constant", "directional", "envmap", "point", "spot"];

/// Reads the light of that name: `None` where the name is not [`KNOWN`], `Some(None)` after a fault without which there
/// is no light.
pub fn read(name: &str, parameters: &mut dyn Parameters) -> Option<Option<Light>> {
    let light = match name {
        "constant" => Light::Constant(Constant::read(parameters)),
        "directional" => Light::Directional(Directional::read(parameters)),
        "envmap" => return Some(Envmap::read(parameters).map(Light::Envmap)),
        "point" => Light::Point(Point::read(parameters)),
        "spot" => Light::Spot(Spot::read(parameters)),
        _ => return None,
    };
    Some(Some(light))
}

impl Light {
    /// Emitted power in W, up to the unit of the scene, per channel; `scene_radius` is that of a sphere around it.
    pub fn power(&self, scene_radius: f32) -> Rgb {
        self.as_emit().power(scene_radius)
    }

    /// The triangle of a mesh where subpaths start, and where it is seen, for those numbers.
    pub fn triangle(&self, place: [f32; 2]) -> u32 {
        self.as_emit().triangle(place)
    }

    /// The numbers that [`emit`](Light::emit) starts a subpath with at the place `q` with those normals, on that triangle
    /// of a mesh, in the direction in which light leaves; `None` where they are not known.
    pub fn invert_emission(
        &self,
        q: Vec3,
        triangle: u32,
        normals: [Vec3; 2],
        direction: Vec3,
    ) -> Option<EmissionInverse> {
        self.as_emit().invert_emission(q, triangle, normals, direction)
    }

    /// The numbers for which [`sample`](Light::sample) looks from `p` with geometric normal `ng` to the place `q` on that
    /// triangle of a mesh, themselves `None` where any will do; `None` where they are not known.
    pub fn invert_sample(&self, p: Vec3, ng: Vec3, q: Vec3, triangle: u32) -> Option<Option<[f32; 2]>> {
        self.as_emit().invert_sample(p, ng, q, triangle)
    }

    /// The largest channel of any radiance, intensity or irradiance it can show.
    pub fn largest(&self) -> f32 {
        self.as_emit().largest()
    }

    /// Where it is, of one without a surface that is somewhere.
    pub fn position(&self) -> Option<Vec3> {
        match self {
            Light::Point(point) => Some(point.position),
            Light::Spot(spot) => Some(spot.point().position),
            _ => None,
        }
    }

    /// Multiplies all lengths, if it has no surface: intensities grow as squares of distances do, and surfaces get as much
    /// light as before.
    pub fn scale(&mut self, factor: f32) {
        let point = match self {
            Light::Point(point) => point,
            Light::Spot(spot) => spot.point_mut(),
            _ => return,
        };
        point.position *= factor;
        point.intensity *= factor * factor;
    }

    /// Whether it is infinitely far away in all directions, so that what leaves the scene meets it.
    pub fn is_surrounding(&self) -> bool {
        self.kind() == EmitterKind::Surrounding
    }

    /// Radiance that comes from the direction `d`, and the density of sampling that direction, of a light that
    /// [surrounds](Light::is_surrounding) the scene.
    #[inline]
    pub fn surrounding(&self, d: Vec3) -> (Rgb, f32) {
        match self {
            Light::Constant(light) => (light.radiance, light.pdf(Vec3::ZERO, d, d)),
            Light::Envmap(light) => light.surrounding(d),
            _ => (Rgb::ZERO, 0.0),
        }
    }

    /// The light that an emitting surface is.
    pub fn of_shape(shape: &ShapeDescription) -> Option<Light> {
        let radiance = shape.emission.clone()?;
        Some(match &shape.geometry {
            ShapeGeometry::Mesh(mesh) => Light::MeshLight(MeshLight::new(mesh.clone(), radiance)),
            &ShapeGeometry::Sphere { center, radius, axes, flipped } => {
                Light::Sphere(Sphere { center, radius, axes, flipped, radiance })
            }
            &ShapeGeometry::Disk { center, radius, axes } => Light::Disk(Disk::new(center, radius, axes, radiance)),
            &ShapeGeometry::Cylinder { start, length, radius, axes, flipped } => {
                Light::Cylinder(Cylinder { start, length, radius, axes, flipped, radiance })
            }
        })
    }
}

/// What [`towards_anyhow`] gives, where it shines.
#[inline(always)]
fn towards(p: Vec3, ng: Vec3, q: Vec3, normals: [Vec3; 2], radiance: Rgb, pdf_area: f32) -> Option<LightSample> {
    let (sample, shines) = towards_anyhow(p, ng, q, normals, radiance, pdf_area);
    shines.then_some(sample)
}

/// A sample towards the point `q` of a surface that emits `radiance`, chosen with density `pdf_area`. Of the surface's
/// normals the shading one tells the side that shines, as for rays that hit it, and the geometric one the density. And whether it
/// shines there: without a branch, for loops over lanes.
#[inline(always)]
pub(crate) fn towards_anyhow(
    p: Vec3,
    ng: Vec3,
    q: Vec3,
    [geometric, shading]: [Vec3; 2],
    radiance: Rgb,
    pdf_area: f32,
) -> (LightSample, bool) {
    let origin = origin_towards(p, ng, q - p);
    let to = q - origin;
    let d2 = to.length_squared();
    let distance = d2.sqrt();
    let wi = to / distance;
    let cos = wi.dot(geometric).abs();
    let pdf = pdf_area * d2 / cos;
    let sample = LightSample {
        origin,
        wi,
        tfar: distance * SHORT_OF_LIGHT,
        weight: radiance / pdf,
        pdf,
        normals: [geometric, shading],
        light: 0,
    };
    let from_behind = (wi.dot(shading) >= 0.0) | (cos == 0.0) | (d2 <= 0.0);
    (sample, !from_behind)
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
